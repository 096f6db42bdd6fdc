//! Formats the result of a calibration as text: the verdict, then one line for each quantity.

use vitreo_uq::documents::calibration::{CalibratedQuantity, Calibration, Coverage};
use vitreo_uq::figures::number::format_significant;

/// Returns the text of a calibration: its verdict, then a table with one row for each quantity.
pub fn format_calibration(found: &Calibration) -> String {
    let mut lines = vec![
        format!("{}: {}", found.experiment, found.verdict.sentence),
        String::new(),
        format!(
            "  {:<34}{:>11}{:>9}{:>9}{:>16}{:>20}{:>20}",
            "quantity", "corrected p", "location", "spread", "z", "50 % intervals", "90 % intervals"
        ),
    ];
    lines.extend(found.quantities.iter().map(row));
    lines.push("  (location: negative if the posteriors are too high; spread: positive if they are too narrow; both in standard errors.".into());
    lines.push("  z: true value minus posterior mean, in posterior standard deviations; mean ± standard deviation over the records.\n  \
         Intervals: fraction of the records whose interval contains the true value, with the 95 % interval of this fraction)".into());
    lines.join("\n") + "\n\n"
}

fn row(calibrated_quantity: &CalibratedQuantity) -> String {
    let number =
        |value: Option<f64>, digits: usize| value.map_or_else(|| "–".into(), |value| format!("{value:.digits$}"));
    let z = match (calibrated_quantity.z_mean, calibrated_quantity.z_sd) {
        (Some(mean), Some(sd)) => format!("{mean:.2} ± {sd:.2}"),
        _ => "–".into(),
    };
    format!(
        "  {:<34}{:>11}{:>9}{:>9}{:>16}{:>20}{:>20}",
        calibrated_quantity.name,
        calibrated_quantity.p_holm.map_or_else(|| "–".into(), |p| format_significant(p, 2)),
        number(calibrated_quantity.place, 1),
        number(calibrated_quantity.spread, 1),
        z,
        share(&calibrated_quantity.coverage_50),
        share(&calibrated_quantity.coverage_90)
    )
}

fn share(coverage: &Coverage) -> String {
    let percent = |share: f64| format!("{:.0}", 100.0 * share);
    let [lower, upper] = coverage.interval_95.map(percent);
    coverage.share.map_or_else(|| "–".into(), |share| format!("{} % ({lower} to {upper})", percent(share)))
}
