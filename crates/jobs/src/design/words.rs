//! Recommendations in words.

use criticism::protocol::DesignLimits;
use criticism::protocol::design::{DesignedProtocol, N_REPEATS, separates};
use documents::design::{DesignedDetection, DesignedParameter, DesignedQuantity};
use figures::labels::parameter_label;
use figures::number::format_significant;

/// Ratio of the expected and the present standard deviation above which a record does not pay.
const LITTLE_LEARNT: f64 = 0.9;

/// Reason to stop if a record would lower no standard deviation by more than 10 %. `sd` are the present and the expected ones; `has_gains` tells whether each cycle has a gain of
/// its own.
pub fn stop_sentence(limits: &DesignLimits, mut sd: impl Iterator<Item = [f64; 2]>, has_gains: bool) -> Option<String> {
    sd.all(|[now, expected]| expected > LITTLE_LEARNT * now).then(|| {
        // A designed record is one cycle, whose gain is unknown however long it is.
        let remedy = if has_gains {
            "Each cycle has its own gain, and a designed record is one cycle: a record of more cycles would teach more."
        } else {
            "More force, time or samples would teach more."
        };
        format!(
            "Another record of {} s within these limits lowers no standard deviation by more than 10 %. {remedy}",
            format_significant(limits.duration_s, 3)
        )
    })
}

/// The protocol as an instruction.
fn instruction(best: &DesignedProtocol, limits: &DesignLimits) -> String {
    format!("Apply {} ({} s in all).", best.drive.described(limits), format_significant(limits.duration_s, 3))
}

pub fn with_quantity(
    best: &DesignedProtocol,
    limits: &DesignLimits,
    quantity: &DesignedQuantity,
    has_tolerances: bool,
) -> String {
    let unit = quantity.unit.replace("um", "µm");
    let unit = if unit == "1" { String::new() } else { format!(" {unit}") };
    let [value, now, then] =
        [quantity.value, quantity.sd_now, quantity.sd_expected].map(|value| format_significant(value, 3));
    format!(
        "{} The {} of {} ({value}{unit}) becomes known to ± {then}{unit} (now ± {now}{unit}){}.",
        instruction(best, limits),
        quantity.quantity,
        quantity.scenario,
        if has_tolerances { ", beside the scenario's tolerances, which no record of the gel reduces" } else { "" }
    )
}

pub fn with_detection(best: &DesignedProtocol, limits: &DesignLimits, detectable: &[DesignedDetection]) -> String {
    let opened: Vec<&str> = detectable
        .iter()
        .filter(|found| found.smallest_now.is_none() && found.smallest_expected.is_some())
        .map(|found| found.effect.as_str())
        .collect();
    let blind = detectable.iter().filter(|found| found.smallest_expected.is_none()).count();
    let visible = detectable.len() - blind;
    let mut text = format!(
        "{} The new record shows {visible} of {} effects at some size of their priors.",
        instruction(best, limits),
        detectable.len()
    );
    if !opened.is_empty() {
        text += &format!(" Visible for the first time: {}.", opened.join(", "));
    }
    text
}

pub fn sentence(
    best: &DesignedProtocol,
    limits: &DesignLimits,
    now: Option<f64>,
    right: Option<usize>,
    effects: &[String],
    parameters: &[DesignedParameter],
) -> String {
    let short = |value: f64| format_significant(value, 3);
    let mut text = instruction(best, limits);
    if let (Some((distance, other)), Some(right)) = (best.closest, right) {
        let verb = if separates(distance) { "This separates" } else { "This does not separate" };
        text += &format!(
            " {verb} {} from {}: their distance is {} σ in the new record{}, and the true effect is recognised in {right} of {N_REPEATS} simulated records.",
            effects[0],
            effects[other],
            short(distance),
            now.map_or(String::new(), |now| format!(" ({} σ in all cycles of the present one)", short(now)))
        );
    }
    let improved = parameters.iter().min_by(|a, b| (a.sd_expected / a.sd_now).total_cmp(&(b.sd_expected / b.sd_now)));
    if let Some(parameter) = improved {
        let percent = |sd: f64| short(100.0 * sd / parameter.value.abs());
        text += &format!(
            " {} becomes known to ± {} % (now ± {} %).",
            parameter_label(&parameter.name).symbol,
            percent(parameter.sd_expected),
            percent(parameter.sd_now)
        );
    }
    text
}
