//! Check of the stated noise against the motion.

use super::{CheckContext, found, um};
use documents::check::Contradiction;

/// Finds a stated noise that is larger than the range of all positions, which includes the motion.
pub(super) fn above_the_motion(looked: &CheckContext<'_>) -> Option<Contradiction> {
    let stated_m = looked.experiment.noise_sd_m.filter(|stated_m| *stated_m > looked.range_m)?;
    let text = format!("`noise_um` is {}, but all positions lie within {} µm", um(stated_m), um(looked.range_m));
    let advice = "check `noise_um` and the position's unit: one of them may be in nm or mm";
    Some(found("noise_above_motion", true, text, advice))
}
