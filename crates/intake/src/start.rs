//! Zero of the strains and start of the load, where the table shows them only in its first rows.

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

/// True if stress and strain as written have opposite signs: a commanded strain and the stress that it causes have one sign.
pub(super) fn opposes(proposal: &TableProposal) -> bool {
    // A specimen that rests in the hold of the first row shows a change of the strain, which may have another sign.
    let is_at_rest = proposal.loaded_from_s.is_none() && proposal.starts_at_hold();
    !is_at_rest && proposal.has_opposite_signs
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

/// Least time of the first row, in intervals between rows, at which a bead's record counts as begun after its load. Clocks may count from 0 or from 1.
const LATE_INTERVALS: f64 = 1.5;
/// Least such time if the first position is the motion that the load causes in it. The two are equal if their ratio is in this range.
const FIRST_INTERVAL: f64 = 0.5;
const AS_LOADED: [f64; 2] = [0.6, 1.6];
/// Largest such time, divided by the record's duration. Later first rows are times of another clock.
const LATEST: f64 = 0.1;

const SINCE_ZERO: &str = "the step began at 0, before the first row (load_start_s = 0)";
const BEAD_SINCE_ZERO: &str = "a force acts in the first row, which is after time 0, and the body has moved before: the force is assumed to act since time 0 (load_start_s = 0); \
     correct that line if it began at another time";
const WITH_FIRST_ROW: &str = "a load acts in the first row, which is after time 0, and is assumed to begin with it; if it began earlier, write that time (load_start_s)";
const STEP_JUST_BEFORE: &str = "the strain of the first row, at time 0, is that of the hold: the step is assumed to have begun just before it (load_start_s), \
     and the stress of this row is left out (left_out_s), because it depends on how the strain rises";
const LOAD_JUST_BEFORE: &str = "the strain of the first row, at time 0, is not 0, and a stress acts: the step is assumed to have begun just before it (load_start_s), \
     so that this strain is the gel's instantaneous answer; if the instrument's zero was off, remove that line and write zero = \"fit\"";

/// When the load of the first row began.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Start {
    /// Time (s) of the table's clock; `None` if it began with the first row or later, or if nothing is known of it, as for a tip, which is pressed from its own contact on.
    pub load_start_s: Option<f64>,
    /// True if the first row already shows the hold or the instantaneous answer of a step.
    pub is_under_way: bool,
    /// Interval (s) with the first row of a relaxation whose step has begun just before it. A stress in the middle of the step depends on how the strain rises.
    pub left_out_s: Option<[f64; 2]>,
    /// Why, if neither the table's first rows nor the user say so.
    pub reason: Option<&'static str>,
}

impl Start {
    /// Begin of the load as the user says, as the rows before it show, or as the first row suggests.
    ///
    /// # Errors
    /// [`Error::Input`] for a record whose first rows are missing, if nothing shows when its load began: a load acts in the first row, the body has moved, and the clock shows
    /// neither a time close to 0 nor that of another event.
    pub fn of(place: &Path, proposal: &TableProposal, device: &Device, control: Control) -> Result<Self> {
        let own = device.stress_strain();
        let is_under_way = is_under_way(proposal, own, control);
        let leaves_out = is_under_way && control == Control::Position && proposal.first_time_s == 0.0;
        let just_before_s = JUST_BEFORE * proposal.duration_s;
        let known = Self {
            load_start_s: None,
            is_under_way,
            left_out_s: leaves_out.then_some([0.0, 2.0 * just_before_s]),
            reason: None,
        };
        if device.is_tip() {
            return Ok(known);
        }
        if let Some(began_s) = proposal.load_began_s {
            let load_start_s = Some(began_s).filter(|began_s| *began_s < proposal.first_time_s);
            // The first row is then after the step.
            let left_out_s = known.left_out_s.filter(|_| load_start_s.is_none());
            return Ok(Self { load_start_s, left_out_s, ..known });
        }
        let begun =
            |load_start_s: f64, reason| Ok(Self { load_start_s: Some(load_start_s), reason: Some(reason), ..known });
        match own {
            // A prescribed position has no load.
            None if control == Control::Position => return Ok(known),
            // Times of a published compliance or modulus count from the step.
            Some(own) if own.constant.is_some() && proposal.loaded_from_s.is_some_and(|first_s| first_s > 0.0) => {
                return begun(0.0, SINCE_ZERO);
            }
            Some(_) if is_under_way && control == Control::Force && proposal.description.time.1.is_of_day() => {
                let (why, when) =
                    ("times of day do not show when it began", "-0.5` if it began 0.5 s before the first row");
                return Err(unknown(place, why, when, control));
            }
            Some(_) if leaves_out => return begun(-just_before_s, STEP_JUST_BEFORE),
            Some(_) if is_under_way => return begun(-just_before_s, LOAD_JUST_BEFORE),
            _ => {}
        }
        let Some(first_s) = proposal.loaded_from_s else { return Ok(known) };
        if began_at_zero(first_s, proposal, own, control) {
            return begun(0.0, if own.is_some() { SINCE_ZERO } else { BEAD_SINCE_ZERO });
        }
        if is_unknown(first_s, proposal, own, control) {
            let at = format!("at {} s, and the table does not show when it began", format_significant(first_s, 6));
            let before = (1e6 * (first_s - proposal.interval_s())).round() / 1e6;
            let when = match first_s <= proposal.duration_s {
                true => "0` if it began at time 0".into(),
                false => format!("{before}` if it began one interval before the first row"),
            };
            return Err(unknown(place, &at, &when, control));
        }
        let is_assumed = first_s > 0.0 && control == Control::Force && !proposal.starts_fresh;
        Ok(Self { reason: is_assumed.then_some(WITH_FIRST_ROW), ..known })
    }
}

/// True if the step has begun before the first row, at time 0. For stress and strain, a stress acts and the strain has already jumped; a commanded strain is then at its hold.
/// Stretches count from the first row. A bead is then at a hold from which it returns to 0, whatever its clock shows.
fn is_under_way(proposal: &TableProposal, stress_strain: Option<&StressStrain>, control: Control) -> bool {
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

/// Returns whether the load of the first row, at `first_s` seconds, began at time 0 of the clock, because that row follows soon after it.
fn began_at_zero(first_s: f64, proposal: &TableProposal, own: Option<&StressStrain>, control: Control) -> bool {
    let interval_s = proposal.interval_s();
    match own {
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
    }
}

/// Returns whether the load of the first row, at `first_s` seconds, began at an unknown time before it.
fn is_unknown(first_s: f64, proposal: &TableProposal, own: Option<&StressStrain>, control: Control) -> bool {
    let has_moved = match own {
        // A commanded strain is at its hold, and the position of a machine has any zero.
        Some(_) if control == Control::Position => proposal.starts_at_hold(),
        Some(own) if own.is_of_specimen => proposal.starts_displaced(),
        Some(_) => proposal.starts_away(),
        None => proposal.starts_away() && !proposal.starts_fresh,
    };
    // A later clock is that of another event. A commanded strain has then been at its hold for an unknown time.
    let is_of_record = first_s <= proposal.duration_s || own.is_some() && control == Control::Position;
    has_moved && first_s > LATE_INTERVALS * proposal.interval_s() && is_of_record
}

/// A load in the first row, of which nothing shows when it began: `why` says so, and `when` ends an option that says when.
fn unknown(place: &Path, why: &str, when: &str, control: Control) -> Error {
    let others = match control {
        Control::Force => format!("`{} first` if it began with the first row", Setting::LoadStart),
        Control::Position => "or give the time of the step".into(),
    };
    Error::input(
        InputPlace::file(place),
        format!("a load acts in the first row, {why}"),
        format!("say when: `{} {when}, {others}", Setting::LoadStart),
    )
}
