//! Finds contradictions between a record and its description before the first fit (formats §4).
//!
//! Every submodule except `quick_fit` finds one kind of contradiction, or several kinds that use the same inputs. A certain contradiction is an error, a possible one a
//! warning.

mod force;
mod noise;
mod positions;
mod quick_fit;
mod sizes;
mod switches;
mod times;
mod zero;

use base::error::{Error, InputPlace, Result};
use documents::check::{CheckSummary, Contradiction};
use record::{Apparatus, Control, Experiment, ExperimentFiles, ForceRule, Interpretation, Record};

use crate::monitor::Monitor;
use figures::number::format_ranges;
pub use quick_fit::{QuickFit, quick_fit};
pub use switches::unknown_jump;

/// An experiment with the quantities that all checks share.
struct CheckContext<'a> {
    experiment: &'a Experiment,
    understood: &'a Interpretation,
    record: &'a Record,
    /// Noise standard deviation in m. It is the known noise, or else the smaller of the estimated noise and the residual of the quick fit. It is 0 if all are unknown.
    noise_m: f64,
    /// Range of the positions in m, without the largest 1 % and the smallest 1 % of them.
    range_m: f64,
    /// Fit of a simple law (see `quick_fit`) under the record's own rule for the force between rows.
    fit: Option<QuickFit>,
}

/// Fraction of the positions that is left out at either end when their range is computed.
const TAIL: f64 = 0.01;

impl<'a> CheckContext<'a> {
    fn new(experiment: &'a Experiment, understood: &'a Interpretation) -> Self {
        let record = &experiment.record;
        let fit = match experiment.control {
            Control::Force => quick_fit(record, record.force_rule),
            Control::Position => None,
        };
        let estimated_m = || experiment.reference_noise().map(|yardstick| yardstick.sd_m);
        let left_m = fit.as_ref().map(|fit| fit.left_sd_m);
        let noise_m = experiment.noise_sd_m.or_else(|| match (estimated_m(), left_m) {
            (Some(estimated_m), Some(left_m)) => Some(estimated_m.min(left_m)),
            (estimated_m, left_m) => estimated_m.or(left_m),
        });
        let mut positions: Vec<f64> = record.position_m.iter().flatten().copied().collect();
        positions.sort_unstable_by(f64::total_cmp);
        let at = |share: f64| positions.get((share * positions.len() as f64) as usize).copied().unwrap_or(0.0);
        let range_m = if positions.is_empty() { 0.0 } else { at(1.0 - TAIL - 1e-9) - at(TAIL) };
        Self { experiment, understood, record, noise_m: noise_m.unwrap_or(0.0), range_m, fit }
    }
}

/// Creates a contradiction. `certain` is true if it is an error and not a warning.
fn found(kind: &str, certain: bool, text: String, advice: impl Into<String>) -> Contradiction {
    Contradiction { kind: kind.into(), certain, text, advice: advice.into() }
}

/// Text of a length in µm, with three significant digits.
fn um(metres: f64) -> String {
    figures::number::format_significant(1e6 * metres, 3)
}

/// All contradictions between an experiment's record and its description, the certain ones first.
pub fn contradictions(experiment: &Experiment, understood: &Interpretation) -> Vec<Contradiction> {
    let looked = CheckContext::new(experiment, understood);
    let looks = [
        force::between_rows,
        force::curved,
        force::against,
        zero::off,
        zero::force_off_at_rest,
        zero::is_a_row,
        zero::drifts_at_rest,
        sizes::no_gel,
        sizes::leaves_its_container,
        noise::above_the_motion,
        noise::above_the_record,
        times::units,
        times::few_rows,
        times::gaps,
        positions::clipped,
        positions::repeated,
        positions::lost,
        positions::outliers,
        positions::unread,
        switches::between_rows,
        switches::after_missing_rows,
        switches::logged_late,
        zero::starts_under_load,
    ];
    // The quick fit assumes that positions are linear in the force. An indenter's depth is not linear, so only checks without the quick fit apply to it.
    let of_indenter = [times::units, positions::clipped, positions::repeated, zero::approach_missing];
    // A relaxation starts anywhere, and no simple law is fitted to it.
    let of_relaxation = [
        zero::off_at_rest,
        times::units,
        times::gaps,
        positions::clipped,
        positions::repeated,
        positions::unread,
        switches::jumps_between_rows,
    ];
    let looks = match (&experiment.apparatus, experiment.control) {
        (Apparatus::Indenter(_), _) => &of_indenter[..],
        (_, Control::Position) => &of_relaxation[..],
        (_, Control::Force) => &looks[..],
    };
    let mut all: Vec<Contradiction> = looks.iter().filter_map(|look| look(&looked)).collect();
    // If a cause is found, advice on its consequences would mislead the user.
    for (cause, consequences) in CAUSES {
        if all.iter().any(|contradiction| contradiction.kind == cause) {
            all.retain(|contradiction| !consequences.contains(&contradiction.kind.as_str()));
        }
    }
    all.sort_by_key(|contradiction| !contradiction.certain);
    all
}

/// Kinds of contradictions that explain others: each cause with its consequences. The consequences are not reported together with their cause.
const CAUSES: [(&str, &[&str]); 4] = [
    (
        "force_logged_late",
        &[
            "against_force",
            "drift_at_rest",
            "zero_off",
            "few_rows_in_a_retardation_time",
            "switch_between_rows",
            "starts_under_load",
        ],
    ),
    ("starts_under_load", &["few_rows_in_a_retardation_time", "zero_off"]),
    ("force_off", &["starts_under_load"]),
    ("lost_positions", &["outliers", "clipped_positions", "repeated_positions"]),
];

/// Returns an error if a contradiction is certain, and warns about possible ones.
///
/// # Errors
/// [`Error::Input`] with the remedy of the first certain contradiction.
pub fn refuse_contradictions(
    experiment: &Experiment,
    understood: &Interpretation,
    monitor: &dyn Monitor,
) -> Result<()> {
    let translated = |text: String| match experiment.quantities() {
        Some(quantities) => quantities.translate(&text).into_owned(),
        None => text,
    };
    for contradiction in contradictions(experiment, understood) {
        let Contradiction { kind, certain, text, advice } = contradiction;
        let (text, advice) = (translated(text), translated(advice));
        if certain {
            let place = InputPlace::file(experiment.specimen_id.as_str()).at_key(kind);
            return Err(Error::input(place, text, format!("{advice}; `vitreo-uq check` shows the record")));
        }
        monitor.warn(&format!("{text}: {advice}"));
    }
    Ok(())
}

/// Summary of the program's reading of a record, with the contradictions that it found.
pub fn summary(experiment: &Experiment, files: &ExperimentFiles) -> CheckSummary {
    CheckSummary {
        experiment: experiment.specimen_id.clone(),
        understood: documents::check::RecordReading {
            rows: experiment.record.n_samples(),
            positions: experiment.record.position_m.iter().flatten().count(),
            cycles: experiment.record.n_cycles(),
            sentences: sentences(experiment, &files.interpretation).to_vec(),
        },
        contradictions: contradictions(experiment, &files.interpretation),
    }
}

/// Description of the program's reading of a record, in five lines: apparatus, rows, force, positions and cycles.
fn sentences(experiment: &Experiment, understood: &Interpretation) -> [String; 5] {
    let record = &experiment.record;
    let number = |value: f64| figures::number::format_significant(value, 3);
    let scales = experiment.scales();
    let n_positions = record.position_m.iter().flatten().count();
    let apparatus = match &experiment.apparatus {
        Apparatus::Robot { robot, vitreous } => format!(
            "a robot of {} mm (sphere of equal volume) in a vitreous of {} mm, Poisson ratio {}",
            number(2e3 * robot.shape.equivalent_radius_m()),
            number(1e3 * vitreous.diameter_m),
            vitreous.poisson_ratio
        ),
        // The record counts a strain of 1 % as 1 µm and a stress of 1 Pa as 1 µN, which makes the compliance a hundred times as large.
        Apparatus::Instrument { compliance_per_m, is_stress_strain: true } => {
            format!(
                "an instrument whose strain is {} × the creep compliance × the stress",
                number(compliance_per_m / 100.0)
            )
        }
        Apparatus::Instrument { compliance_per_m, .. } => {
            format!("an instrument with a compliance of {} 1/m", number(*compliance_per_m))
        }
        Apparatus::Indenter(indenter) => format!(
            "an indenter, a {} whose depth to the power {} is proportional to the force",
            indenter.tip.name(),
            indenter.exponent()
        ),
    };
    let rule = match (record.force_rule, understood.force_rule_given) {
        (ForceRule::Hold, true) => "holds until the next row",
        (ForceRule::Hold, false) => "holds until the next row (not stated, the default)",
        (ForceRule::Linear, _) => "is linear from row to row",
    };
    let ends = |values: &mut dyn Iterator<Item = f64>| {
        let [low, high] = values.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], x| [low.min(x), high.max(x)]);
        format!("{} to {}", number(1e6 * low), number(1e6 * high))
    };
    let settled = &understood.settled;
    // The zero is that of the position, which a relaxation commands and enters in place of the force.
    let is_commanded = experiment.control == Control::Position;
    let unit = if is_commanded { "µN" } else { "µm" };
    let counted = match (&settled.projection, settled.is_reversed, settled.zero_m.first().copied().unwrap_or(0.0)) {
        (Some(projection), ..) => format!(", {projection} with {} µm across", um(projection.across_rms_m)),
        (None, true, zero_m) => format!(", from {} {unit}, sign reversed", um(zero_m)),
        (None, false, 0.0) => String::new(),
        (None, false, zero_m) => format!(", from {} {unit}", um(zero_m)),
    };
    let (of_force, of_position) = if is_commanded { (counted, String::new()) } else { (String::new(), counted) };
    let left_out = match understood.n_left_out {
        0 => String::new(),
        n => format!(", {n} left out"),
    };
    let noise = experiment.reference_noise().map_or("noise unknown".into(), |yardstick| yardstick.to_string());
    [
        format!("{}: {apparatus}", experiment.specimen_id),
        format!(
            "{} rows over {} s, {} s apart, {n_positions} with a position{left_out}",
            record.n_samples(),
            number(scales.duration_s),
            number(scales.sample_interval_s)
        ),
        format!("force {} µN{of_force}, which {rule}", ends(&mut record.force_n.iter().copied())),
        format!("position {} µm{of_position}; {noise}", ends(&mut record.position_m.iter().flatten().copied())),
        format!(
            "{} cycles of {} s: fitted [{}], held out [{}]",
            record.n_cycles(),
            number(scales.cycle_s),
            format_ranges(&experiment.calibration_cycles),
            format_ranges(&experiment.heldout_cycles)
        ),
    ]
}
