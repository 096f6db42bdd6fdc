//! A calibration in words: the verdict, and a line a quantity.

use vitreo_uq::documents::calibration::{CalibratedQuantity, Calibration, Coverage};
use vitreo_uq::figures::number::significant;

/// The verdict, and what stands behind it.
pub fn words_of_calibration(found: &Calibration) -> String {
    let mut lines = vec![
        format!("{}: {}", found.experiment, found.verdict.sentence),
        String::new(),
        format!(
            "  {:<34}{:>11}{:>9}{:>9}{:>16}{:>20}{:>20}",
            "quantity", "corrected p", "place", "spread", "z", "50 % intervals", "90 % intervals"
        ),
    ];
    lines.extend(found.quantities.iter().map(row));
    lines.push("  (place: negative for posteriors that lie too high; spread: positive for those too narrow; both in standard errors.".into());
    lines.push("  z: mean ± sd of truths in posterior standard deviations. Intervals: the truths inside, with what their number leaves open)".into());
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
