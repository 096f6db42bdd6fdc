//! Files of an oscillation's revision: model, posterior, draws and figures.

use std::path::Path;

use super::job::SweepResult;
use super::joint::JointResult;
use super::problem::SweepProblem;
use crate::artefacts::{arrange_draws, draw_corner, draw_trace, write_document, write_model};
use base::error::Result;
use figures::draws::write_draws_csv;
use figures::svg::{Svg, write_figure};
use figures::sweep::{OscillationFigure, oscillation as sweep_figure};
use posterior::prior::PriorSet;
use posterior::study::{POSTERIOR_NAME, Provenance};
use record::{OscillationRecord, SweepRow};

/// Number of points on each predicted curve.
const N_CURVE: usize = 160;
/// Factor by which the predicted curves extend beyond either end of the measured frequency range.
const BEYOND: f64 = 1.15;

/// Writes all files of an oscillation's revision into `dir`. `header` returns the header of a JSON document, given the kind of document.
///
/// # Errors
/// [`base::Error::File`] if the operating system refuses.
pub fn write(
    dir: &Path,
    problem: &SweepProblem,
    result: &SweepResult,
    header: &dyn Fn(&str) -> Provenance,
) -> Result<()> {
    write_model(dir, &problem.specification, &problem.priors)?;
    write_document(&dir.join(POSTERIOR_NAME), header("oscillation"), &result.summary)?;
    let table = arrange_draws(&problem.priors, &result.outcome, &result.columns);
    write_draws_csv(&dir.join("draws.csv"), &table)?;
    let figures = dir.join("figures");
    std::fs::create_dir_all(&figures)
        .map_err(|source| base::Error::at_path("create", &figures, source, "make the study directory writable"))?;
    let id = &problem.sweep.specimen_id;
    let corner = draw_corner(id, &result.summary.model, &problem.priors, &result.columns, &|_| None)?;
    write_figure(&figures, "corner", &corner)?;
    write_figure(&figures, "trace", &draw_trace(id, &problem.priors, &result.outcome, &result.columns)?)?;
    write_figure(&figures, "moduli", &moduli_figure(problem, result)?)
}

/// Figure of the measured and predicted moduli against frequency, with residuals.
fn moduli_figure(problem: &SweepProblem, result: &SweepResult) -> Result<Svg> {
    let sweep = &problem.sweep;
    let [lowest_hz, highest_hz] = sweep.range_hz();
    let (from, to) = (lowest_hz / BEYOND, highest_hz * BEYOND);
    let at = |k: usize| from * (to / from).powf(k as f64 / (N_CURVE - 1) as f64);
    let row = |frequency_hz| SweepRow { frequency_hz, pair: [f64::NAN; 2], sd: None, is_heldout: false };
    let curve_hz: Vec<f64> = (0..N_CURVE).map(at).collect();
    let curve = problem.with_rows(curve_hz.iter().copied().map(row).collect());
    let drawn: Vec<Vec<[f64; 2]>> = result.values.iter().filter_map(|values| curve.predict(values)).collect();
    let quantiles = |place: usize, k: usize| {
        let mut all: Vec<f64> = drawn.iter().map(|pairs| sweep.form.moduli(pairs[place])[k]).collect();
        all.sort_by(f64::total_cmp);
        [0.05, 0.5, 0.95].map(|p| all[((p * all.len() as f64) as usize).min(all.len() - 1)])
    };
    let bands_pa: Vec<[[f64; 3]; 2]> = (0..N_CURVE).map(|place| [0, 1].map(|k| quantiles(place, k))).collect();
    let middle = &result.values[0];
    let residuals = problem.residuals(&result.mean, middle);
    draw(sweep, &curve_hz, &bands_pa, &residuals, &format!("{}: measured moduli and posterior", sweep.specimen_id))
}

/// Figure of the measured moduli without a model.
///
/// # Errors
/// The errors of the figure.
pub fn raw_figure(sweep: &OscillationRecord) -> Result<Svg> {
    draw(sweep, &[], &[], &[], &format!("{}: measured moduli", sweep.specimen_id))
}

fn draw(
    sweep: &OscillationRecord,
    curve_hz: &[f64],
    bands_pa: &[[[f64; 3]; 2]],
    residuals: &[[f64; 2]],
    heading: &str,
) -> Result<Svg> {
    let frequency_hz: Vec<f64> = sweep.rows.iter().map(|row| row.frequency_hz).collect();
    let moduli_pa: Vec<[f64; 2]> = sweep.rows.iter().map(|row| sweep.form.moduli(row.pair)).collect();
    let is_heldout: Vec<bool> = sweep.rows.iter().map(|row| row.is_heldout).collect();
    let data = OscillationFigure {
        frequency_hz: &frequency_hz,
        moduli_pa: &moduli_pa,
        is_heldout: &is_heldout,
        curve_hz,
        bands_pa,
        residuals,
        names: sweep.form.names(),
    };
    sweep_figure(&data, heading)
}

/// Draws the corner plot of a joint posterior.
///
/// # Errors
/// The errors of the figure.
pub fn joint_figure(id: &str, priors: &PriorSet, result: &JointResult) -> Result<Svg> {
    draw_corner(id, &result.summary.model, priors, &result.columns, &|_| None)
}
