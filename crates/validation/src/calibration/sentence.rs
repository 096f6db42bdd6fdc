//! Formulates the verdict of a calibration as a sentence.

use super::{FEWEST, LEVEL, LOG_DENSITY};
use documents::calibration::{CalibratedQuantity, Calibration, CalibrationKind};
use figures::number::format_significant;

/// Absolute score above which the sentence names a fault. The verdict itself uses the corrected p.
const NAMED_FAULT_SCORE: f64 = 3.0;
/// Largest number of quantities that the sentence names.
const MOST_NAMED: usize = 3;

/// Returns the verdict as a sentence.
pub(super) fn sentence(found: &Calibration) -> String {
    let n = found.ranked;
    let records = format!("{n} simulated records");
    let said = match found.verdict.kind {
        CalibrationKind::Undecided => format!(
            "There is no verdict on the posteriors: {n} of {} simulated records could be ranked, but {FEWEST} are needed.",
            found.replicates
        ),
        CalibrationKind::Calibrated => format!(
            "The posteriors are calibrated: their intervals contain the true values as often as stated, over {records} (smallest corrected p {}).",
            p(found.quantities.iter())
        ),
        CalibrationKind::Miscalibrated => {
            let mut wrong: Vec<&CalibratedQuantity> =
                found.quantities.iter().filter(|quantity| quantity.p_holm.is_some_and(|p| p < LEVEL)).collect();
            wrong.sort_by(|a, b| a.p_holm.unwrap_or(1.0).total_cmp(&b.p_holm.unwrap_or(1.0)));
            let named: Vec<String> =
                wrong.iter().take(MOST_NAMED).map(|calibrated_quantity| fault(calibrated_quantity)).collect();
            let more = match wrong.len().saturating_sub(MOST_NAMED) {
                0 => String::new(),
                more => format!("; and {more} more"),
            };
            format!("The posteriors are not calibrated, over {records}: {}{more}.", named.join("; "))
        }
    };
    let left_out: Vec<String> =
        [(found.not_converged, "did not converge and are not counted"), (found.failed, "could not be sampled")]
            .into_iter()
            .filter(|(count, _)| *count > 0)
            .map(|(count, words)| format!("{count} of {} {words}", found.replicates))
            .collect();
    if left_out.is_empty() { said } else { format!("{said} {}.", left_out.join(", ")) }
}

/// Text that names a quantity and the fault of its ranks.
fn fault(calibrated_quantity: &CalibratedQuantity) -> String {
    let corrected = p([calibrated_quantity].into_iter());
    if calibrated_quantity.name == LOG_DENSITY {
        return format!(
            "the log density at the true values does not rank uniformly among the draws (corrected p {corrected})"
        );
    }
    let (place, spread) = (calibrated_quantity.place.unwrap_or(0.0), calibrated_quantity.spread.unwrap_or(0.0));
    let mut words = Vec::new();
    if place < -NAMED_FAULT_SCORE {
        words.push("too high");
    } else if place > NAMED_FAULT_SCORE {
        words.push("too low");
    }
    if spread > NAMED_FAULT_SCORE {
        words.push("too narrow");
    } else if spread < -NAMED_FAULT_SCORE {
        words.push("too wide");
    }
    let what = if words.is_empty() { "wrong in shape".into() } else { words.join(" and ") };
    format!("{} is {what} (corrected p {corrected})", calibrated_quantity.name)
}

/// Text of the smallest corrected p of several quantities, with two digits.
fn p<'a>(quantities: impl Iterator<Item = &'a CalibratedQuantity>) -> String {
    let smallest = quantities.filter_map(|calibrated_quantity| calibrated_quantity.p_holm).fold(1.0, f64::min);
    format_significant(smallest, 2)
}
