//! Zero of the strains and begin of the load, where the table shows them only in its first rows.

use super::device::Device;
use super::stress::StressStrain;
use base::error::{Error, InputPlace, Result, Setting};
use figures::number::format_significant;
use record::table::TableProposal;
use record::{Control, Direction};
use std::path::Path;

/// Returns true if strains keep the zero and the sign of the table. A commanded strain does, because a record may begin in the middle of a hold, and so does a
/// published compliance or modulus. The position of a testing machine has any zero and any sign.
pub(super) fn has_absolute_strain(stress_strain: Option<&StressStrain>, control: Control) -> bool {
    stress_strain.is_some_and(|own| control == Control::Position && !own.is_of_specimen || own.constant.is_some())
}

/// Smallest ratio of the largest value on one side of 0 to that on the other at which a quantity counts as one-sided.
const ONE_SIDED: f64 = 10.0;

/// True if forces and written positions are one-sided, on opposite sides of 0: a commanded strain and the stress that it causes have one sign.
pub(super) fn opposes(proposal: &TableProposal) -> bool {
    let side = |[low, high]: [f64; 2]| match () {
        () if high > 0.0 && high > -ONE_SIDED * low => 1,
        () if low < 0.0 && -low > ONE_SIDED * high => -1,
        () => 0,
    };
    // A specimen that rests in the hold of the first row shows a change of the strain, which may have another sign.
    let is_at_rest = proposal.loaded_from_s.is_none() && proposal.starts_at_hold();
    !is_at_rest && side(proposal.force_n) * side(proposal.position_m) < 0
}

/// Largest time of the first loaded row at which a rheometer's load still counts as begun at time 0, divided by the record's duration.
const FIRST_ROW: f64 = 0.01;

/// Largest relative difference of the first time from the interval between rows at which a record's first row counts as the end of its first interval.
const SAME_INTERVAL: f64 = 0.01;

/// Time from a rheometer's step to the first row at time 0, divided by the record's duration, where that row shows the strain after the step.
const JUST_BEFORE: f64 = 1e-9;

/// True if the user's units say that the columns are stress and strain, and the strains are stretches.
pub(super) fn is_stretch(proposal: &TableProposal, stress_strain: Option<&StressStrain>) -> bool {
    stress_strain.is_some_and(|own| own.is_told) && proposal.is_stretch()
}

/// True if the step has begun before the first row, at time 0. For stress and strain, a stress acts and the strain has already jumped; a commanded strain is then at its hold.
/// Stretches count from the first row. A bead is then at a hold from which it returns to 0, whatever its clock shows.
pub(super) fn answers_at_once(
    proposal: &TableProposal,
    stress_strain: Option<&StressStrain>,
    control: Control,
) -> bool {
    let Some(own) = stress_strain else {
        return control == Control::Position
            && proposal.starts_loaded
            && proposal.starts_at_hold()
            && proposal.returns_to_zero();
    };
    (!own.is_of_specimen || proposal.frame.direction == Direction::Forward)
        && !is_stretch(proposal, stress_strain)
        && match control {
            Control::Force => proposal.loaded_from_s == Some(0.0) && proposal.starts_displaced(),
            // The zero of a machine's position says nothing, but a force shows that the specimen is held.
            Control::Position => {
                let has_force = proposal.loaded_from_s.is_some() || proposal.starts_loaded;
                proposal.first_time_s == 0.0
                    && has_force
                    && proposal.starts_at_hold()
                    && (proposal.starts_loaded || !own.is_of_specimen)
            }
        }
}

/// Interval (s) with the first row of a relaxation whose step has begun just before it. A stress in the middle of the step depends on how the strain rises.
pub(super) fn left_out_s(proposal: &TableProposal, device: &Device, control: Control) -> Option<[f64; 2]> {
    let is_relaxation = control == Control::Position && answers_at_once(proposal, device.stress_strain(), control);
    (is_relaxation && proposal.first_time_s == 0.0).then_some([0.0, 2.0 * JUST_BEFORE * proposal.duration_s])
}

/// Least time of the first row, in intervals between rows, at which a bead's record counts as begun after its load. Clocks may count from 0 or from 1.
const LATE_INTERVALS: f64 = 1.5;
/// Least such time if the first position is the motion that the load causes in it. The two are equal if their ratio is in this range.
const FIRST_INTERVAL: f64 = 0.5;
const AS_LOADED: [f64; 2] = [0.6, 1.6];
/// Largest such time, divided by the record's duration. Later first rows are times of another clock.
const LATEST: f64 = 0.1;

/// True if the strain of the first row shows that the step came before it. A commanded strain is at its hold, and that of a machine has any zero.
fn has_moved(proposal: &TableProposal, own: &StressStrain, control: Control) -> bool {
    match control {
        Control::Position => proposal.starts_at_hold(),
        Control::Force if own.is_of_specimen => proposal.starts_displaced(),
        Control::Force => proposal.starts_away(),
    }
}

/// Refuses a record whose first rows are missing, if neither the table nor the user says when its load began: a load acts in the first row, the body has moved, and the clock
/// shows neither a time close to 0 nor that of another event.
///
/// # Errors
/// [`Error::Input`] for such a record.
pub(super) fn refuse_unknown_start(
    place: &Path,
    proposal: &TableProposal,
    device: &Device,
    control: Control,
) -> Result<()> {
    let own = device.stress_strain();
    let Some(first_s) = proposal.loaded_from_s.filter(|_| proposal.load_began_s.is_none() && !device.is_tip()) else {
        return Ok(());
    };
    let has_moved = match own {
        Some(own) => own.constant.is_none() && has_moved(proposal, own, control),
        None => control == Control::Force && proposal.starts_away() && !proposal.starts_fresh,
    };
    let interval_s = proposal.interval_s();
    let is_open = has_moved && first_s > LATE_INTERVALS * interval_s && first_s <= proposal.duration_s;
    if !is_open || load_start_s(proposal, device, control).is_some() {
        return Ok(());
    }
    let first_s = format_significant(first_s, 6);
    let others = match control {
        Control::Force => format!("`{} first` if it began with the first row", Setting::LoadStart),
        Control::Position => "or give the time of the step".into(),
    };
    Err(Error::input(
        InputPlace::file(place),
        format!("a load acts in the first row, at {first_s} s, and the table does not show when it began"),
        format!("say when: `{} 0` if it began at time 0, {others}", Setting::LoadStart),
    ))
}

/// Time at which the load of the first row begins, in s of the table's clock: 0 if the first loaded row follows soon after time 0, otherwise `None`.
pub(super) fn load_start_s(proposal: &TableProposal, device: &Device, control: Control) -> Option<f64> {
    let creep = device.stress_strain();
    if let Some(began_s) = proposal.load_began_s.filter(|_| !device.is_tip()) {
        return (began_s < proposal.first_time_s).then_some(began_s);
    }
    // A tip is pressed from its own contact on, and a prescribed position has no load.
    if device.is_tip() || creep.is_none() && control == Control::Position {
        return None;
    }
    // Times of a published compliance or modulus count from the step.
    if creep.is_some_and(|creep| creep.constant.is_some())
        && proposal.loaded_from_s.is_some_and(|first_s| first_s > 0.0)
    {
        return Some(0.0);
    }
    if answers_at_once(proposal, creep, control) {
        return Some(-JUST_BEFORE * proposal.duration_s);
    }
    let first_s = proposal.loaded_from_s?;
    let interval_s = proposal.interval_s();
    let begins_late = match creep {
        // A ramp begins with the record, whatever its clock shows.
        Some(_) if control == Control::Position && !proposal.starts_at_hold() => false,
        Some(_) => {
            let is_one_interval = (first_s / interval_s - 1.0).abs() < SAME_INTERVAL
                && (control == Control::Position || proposal.starts_displaced());
            first_s > 0.0 && (first_s <= FIRST_ROW * proposal.duration_s || is_one_interval)
        }
        None => {
            let is_as_loaded = proposal.first_answer.is_some_and(|ratio| (AS_LOADED[0]..AS_LOADED[1]).contains(&ratio));
            let least = if is_as_loaded { FIRST_INTERVAL } else { LATE_INTERVALS };
            first_s > least * interval_s
                && first_s <= LATEST * proposal.duration_s
                && (is_as_loaded || proposal.starts_displaced())
        }
    };
    begins_late.then_some(0.0)
}
