//! Check of the stated noise against the motion.

use super::{CheckContext, found, um};
use documents::check::Contradiction;

/// Smallest ratio of the stated noise to the estimated noise that is reported.
const OVERSTATED: f64 = 3.0;

/// Finds a stated noise that is several times what the record shows. Such a noise hides misfits of the model.
pub(super) fn above_the_record(looked: &CheckContext<'_>) -> Option<Contradiction> {
    let stated_m = looked.experiment.noise_sd_m?;
    let shown = record::noise::estimate_noise(looked.record)?;
    if stated_m < OVERSTATED * shown.sd_m || above_the_motion(looked).is_some() {
        return None;
    }
    let text = format!("`noise_um` is {}, but the record shows noise of {} µm", um(stated_m), um(shown.sd_m));
    let advice =
        "check `noise_um`: a noise that is too large hides what the model misses; without it the noise is estimated";
    Some(found("noise_above_record", false, text, advice))
}

/// Finds a stated noise that is larger than the range of all positions, which includes the motion.
pub(super) fn above_the_motion(looked: &CheckContext<'_>) -> Option<Contradiction> {
    let stated_m = looked.experiment.noise_sd_m.filter(|stated_m| *stated_m > looked.range_m)?;
    let text = format!("`noise_um` is {}, but all positions lie within {} µm", um(stated_m), um(looked.range_m));
    let advice = "check `noise_um` and the position's unit: one of them may be in nm or mm";
    Some(found("noise_above_motion", true, text, advice))
}
