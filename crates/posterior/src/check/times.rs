//! Whether times are in their unit, and dense enough.

use super::{Looked, found};
use documents::check::Contradiction;
use figures::number::significant;
use record::Apparatus;

/// Seconds between the pictures that a camera on a robot takes, and between the samples of another instrument.
const CAMERA_S: [f64; 2] = [5e-4, 8.0];
const INSTRUMENT_S: [f64; 2] = [1e-7, 3600.0];
/// Rows that a retardation time must have, and the size in noise from which a retarded part counts.
const ROWS: f64 = 1.5;
const NOISES: f64 = 6.0;

/// Sampling intervals that no camera has.
pub(super) fn units(looked: &Looked<'_>) -> Option<Contradiction> {
    let interval_s = looked.record.median_interval_s()?;
    let [shortest_s, longest_s] = match looked.experiment.apparatus {
        Apparatus::Robot { .. } => CAMERA_S,
        Apparatus::Instrument { .. } | Apparatus::Indenter(_) => INSTRUMENT_S,
    };
    if (shortest_s..=longest_s).contains(&interval_s) {
        return None;
    }
    let text = format!("rows are {} s apart, which few cameras are", significant(interval_s, 3));
    Some(found("time_unit", false, text, "check the unit of the time: seconds and milliseconds may be exchanged"))
}

/// A retarded motion that is over within a row.
pub(super) fn few_rows(looked: &Looked<'_>) -> Option<Contradiction> {
    let fit = looked.fit.as_ref()?;
    let interval_s = looked.record.median_interval_s()?;
    let rows = 1.0 / (fit.rate_per_s * interval_s);
    if rows >= ROWS || fit.retarded_m < NOISES * looked.noise_m.max(fit.left_sd_m) {
        return None;
    }
    let text = format!(
        "the elastic motion is over within about {} rows ({} s), so that its viscosity is hardly seen",
        significant(rows, 2),
        significant(1.0 / fit.rate_per_s, 2)
    );
    Some(found("few_rows_in_a_retardation_time", false, text, "sample faster right after every switch of the force"))
}
