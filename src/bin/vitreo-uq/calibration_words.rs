//! Text of a calibration: the verdict, then one line for each quantity.

use vitreo_uq::documents::calibration::{CalibratedQuantity, Calibration, Coverage};
use vitreo_uq::figures::number::significant;

/// Returns the verdict and the table that supports it.
pub fn words_of_calibration(found: &Calibration) -> String {
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
    lines.push("  z: mean ± sd of the true values, in posterior standard deviations. Intervals: share of true values inside, with its 95 % interval)".into());
    lines.join("\n") + "\n\n"
}

fn row(own: &CalibratedQuantity) -> String {
    let number =
        |value: Option<f64>, digits: usize| value.map_or_else(|| "–".into(), |value| format!("{value:.digits$}"));
    let z = match (own.z_mean, own.z_sd) {
        (Some(mean), Some(sd)) => format!("{mean:.2} ± {sd:.2}"),
        _ => "–".into(),
    };
    format!(
        "  {:<34}{:>11}{:>9}{:>9}{:>16}{:>20}{:>20}",
        own.name,
        own.p_holm.map_or_else(|| "–".into(), |p| significant(p, 2)),
        number(own.place, 1),
        number(own.spread, 1),
        z,
        share(&own.coverage_50),
        share(&own.coverage_90)
    )
}

fn share(own: &Coverage) -> String {
    let percent = |share: f64| format!("{:.0}", 100.0 * share);
    let [lower, upper] = own.interval_95.map(percent);
    own.share.map_or_else(|| "–".into(), |share| format!("{} % ({lower} to {upper})", percent(share)))
}
