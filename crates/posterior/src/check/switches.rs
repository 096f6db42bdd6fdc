//! Checks that the force switches at the stated rows.

use super::quick_fit::quick_fit;
use super::{CheckContext, found, um};
use documents::check::Contradiction;
use documents::posterior::{Warning, WarningKind};
use figures::number::format_significant;
use record::{ForceRule, MotionLine, Record};

/// Number of positions whose regression line is extrapolated to the next row.
const BEFORE: usize = 4;
/// Number of rows before a row in which positions for its regression line are searched. It exceeds [`BEFORE`], because some positions may be lost.
const WITHIN: usize = 8;
/// Smallest number of force steps from which a motion before the stated switches can be judged.
const STEPS: usize = 2;
/// Smallest median excess that counts as a motion before the stated switch, in standard errors of the median.
const ERRORS: f64 = 5.0;
/// Smallest median excess that counts as a motion before the stated switch, in noise standard deviations.
const NOISES: f64 = 2.0;

/// Smallest motion that counts, as a fraction of the positions' range.
const LEAST_PART: f64 = 1e-3;
/// Intervals between two rows from which a row is missing between them, and from which the gap is too long for the line through the rows before it.
const MISSING: f64 = 1.5;
const MOST_MISSING: f64 = 6.0;
/// Factor on the curvature of the motion before a missing row, by which it may grow until the switch.
const CURVED: f64 = 1.5;

/// Difference (m) between a row's position and the line through the last four known positions before it; `None` if too many positions are lost.
fn excess_m(looked: &CheckContext<'_>, row: usize) -> Option<f64> {
    let record = looked.record;
    let before = (row.saturating_sub(WITHIN)..row).rev();
    let known = before.filter_map(|row| Some((record.time_s[row], record.position_m[row]?)));
    let points: Vec<(f64, f64)> = known.take(BEFORE).collect();
    if points.len() < BEFORE {
        return None;
    }
    Some(MotionLine::through(points.iter().copied()).excess((record.time_s[row], record.position_m[row]?)))
}

/// Factor by which a few switches must stand out more than many.
const FEW: f64 = 4.0;

/// Finds positions that have already moved in the row in which the force is stated to switch. A row's position is measured just before a switch in that row, so
/// the force must have switched earlier.
pub(super) fn between_rows(looked: &CheckContext<'_>) -> Option<Contradiction> {
    let record = looked.record;
    // A force that is linear between rows changes before the row of its new value.
    if record.force_rule == ForceRule::Linear {
        return None;
    }
    let excesses: Vec<f64> = record
        .force_step_rows()
        .into_iter()
        .filter(|row| *row > WITHIN)
        .filter_map(|row| {
            let is_held = (row - WITHIN - 1..row).all(|before| record.force_n[before] == record.force_n[row - 1]);
            let sign = (record.force_n[row] - record.force_n[row - 1]).signum();
            // The excess of the previous position shows the curvature of the motion. It is subtracted, because the switch does not cause it.
            let before = (row - WITHIN..row).rev().find(|before| record.position_m[*before].is_some())?;
            is_held.then_some(sign * (excess_m(looked, row)? - excess_m(looked, before)?))
        })
        .collect();
    // A few switches alone may be outliers, so that they must stand out more, and do not stop a fit.
    let is_sure = excesses.len() >= STEPS;
    if excesses.is_empty() {
        return None;
    }
    let mut sorted = excesses.clone();
    sorted.sort_unstable_by(f64::total_cmp);
    // The median is robust against an outlier, and against a few switches that are at the right time.
    let middle_m = sorted[(sorted.len() - 1) / 2];
    let noise_m = looked.noise_m;
    // The excess of a row minus the excess of the previous row weights six positions by 1, −2, ½, ½, ½ and −½. Its standard deviation is √6 times the noise. The
    // standard error of the median of n such values is 1.25/√n times this standard deviation.
    let error_m = 1.25 * 6.0_f64.sqrt() * noise_m / (excesses.len() as f64).sqrt();
    let error_m = if is_sure { error_m } else { FEW * error_m };
    if middle_m <= (ERRORS * error_m).max(NOISES * noise_m) || middle_m <= LEAST_PART * looked.range_m {
        return None;
    }
    let text = format!(
        "at {} of the force, the position has already moved by about {} µm in the row of the step: the force switched between two rows",
        match excesses.len() {
            1 => "one step".into(),
            n => format!("{n} steps"),
        },
        um(middle_m)
    );
    let advice = "give every switch a separate row at its time (or a little later, if a row has this time), with the new force and an empty position; if each row is the end of an \
                  interval with its force, write `force_acts = \"until-row\"` in [measurement]; if the force rises in ramps of few rows, `force = \"linear\"`";
    Some(found("switch_between_rows", is_sure, text, advice))
}

/// Finds switches of the force behind a missing row in which the position has already moved: the force switched in the missing row or near it.
pub(super) fn after_missing_rows(looked: &CheckContext<'_>) -> Option<Contradiction> {
    let record = looked.record;
    let has_moved = |row: &usize| {
        let row = *row;
        let is_held =
            row > WITHIN && (row - WITHIN - 1..row).all(|before| record.force_n[before] == record.force_n[row - 1]);
        if !is_held {
            return false;
        }
        let before_s = (record.time_s[row - 1] - record.time_s[row - 1 - BEFORE]) / BEFORE as f64;
        let intervals = (record.time_s[row] - record.time_s[row - 1]) / before_s;
        let known_before = (row - WITHIN..row).rev().find(|before| record.position_m[*before].is_some());
        let curved_m = known_before.and_then(|before| excess_m(looked, before)).unwrap_or(f64::INFINITY).abs();
        if !(MISSING..MOST_MISSING).contains(&intervals) {
            return false;
        }
        let sign = (record.force_n[row] - record.force_n[row - 1]).signum();
        // The line through four rows, extrapolated over this many intervals, has the variance ¼ + (1.5 + n)²/5 of a position; the curvature of the motion grows with n².
        let sd = (1.25 + (1.5 + intervals).powi(2) / 5.0).sqrt();
        let least_m = ERRORS * sd * looked.noise_m + CURVED * intervals * intervals * curved_m.max(looked.noise_m);
        excess_m(looked, row).is_some_and(|excess_m| sign * excess_m > least_m.max(LEAST_PART * looked.range_m))
    };
    let rows: Vec<usize> = record.force_step_rows().into_iter().filter(|row| *row > 0).filter(has_moved).collect();
    let first = *rows.first()?;
    let number = |time_s: f64| format_significant(time_s, 5);
    let text = format!(
        "rows are missing at {} of the force's switches, and the next position has already moved: the first between {} and {} s",
        rows.len(),
        number(record.time_s[first - 1]),
        number(record.time_s[first])
    );
    let advice = "give every switch a separate row at its time (or a little later, if a row has this time), with the new force and an empty position";
    Some(found("switch_between_rows", true, text, advice))
}

/// Least part of a jump's answer that relaxes in the next interval, from which the unknown time of the jump matters.
const RELAXES: f64 = 0.05;
/// Interval after the jump, as a part of the jump's own, above which the rows are as dense before and after it.
const DENSER: f64 = 0.5;
/// Part of the jump's interval after which the relaxation is read: rounding does not skip a row.
const AS_LONG: f64 = 0.99;
/// Least part of the command's range that counts as a jump.
const JUMP: f64 = 0.1;

/// Finds the jump of [`unknown_jump`].
pub(super) fn jumps_between_rows(looked: &CheckContext<'_>) -> Option<Contradiction> {
    let Warning { text, advice, .. } = unknown_jump(looked.record, looked.noise_m)?;
    Some(found("jump_between_rows", false, text, advice))
}

/// Warning about a commanded position that jumps from one constant value to another between two rows, while the measured force relaxes within an interval: the force depends on
/// the time of the jump within the interval, which the record does not show. The text calls the command the force, as all texts do before their translation. `noise_m` is the
/// noise standard deviation of the measured quantity.
pub fn unknown_jump(record: &Record, noise_m: f64) -> Option<Warning> {
    let Record { time_s, force_n: command, position_m: answer, .. } = record;
    if record.force_rule != ForceRule::Linear {
        return None;
    }
    let range = record.force_range_n();
    let share = |row: usize| {
        let is_jump = (command[row] - command[row - 1]).abs() > JUMP * range;
        let is_held = command[row + 1] == command[row] && (row == 1 || command[row - 2] == command[row - 1]);
        if !is_jump || !is_held {
            return None;
        }
        // Rows with an answer, as long as the command holds.
        let is_level = |other: &usize| command[*other] == command[row];
        let later: Vec<usize> =
            (row..command.len()).take_while(is_level).filter(|row| answer[*row].is_some()).collect();
        let [at, next, ..] = later[..] else { return None };
        let before = (0..row).rev().find(|row| answer[*row].is_some())?;
        let jump_s = time_s[row] - time_s[row - 1];
        let as_long_after = |other: &&usize| time_s[**other] - time_s[at] >= AS_LONG * jump_s;
        let after = *later.iter().find(as_long_after).unwrap_or(&later[later.len() - 1]);
        let after_s = time_s[after] - time_s[at];
        let (jump, lost) = (answer[at]? - answer[before]?, answer[at]? - answer[after]?);
        let is_clear = lost.abs() > ERRORS * noise_m && lost * jump > 0.0;
        // The part that relaxes in as long a time as the jump may take.
        let share = lost / jump * (jump_s / after_s).min(1.0);
        // Rows that are far denser after the jump show that the interval is a ramp, unless nothing was commanded before.
        let is_ramp = time_s[next] - time_s[at] <= DENSER * jump_s && command[..row].iter().any(|c| *c != command[0]);
        (is_clear && !is_ramp && share > RELAXES).then_some((row, share))
    };
    let (row, share) = (1..command.len().saturating_sub(1)).find_map(share)?;
    let number = |time_s: f64| format_significant(time_s, 5);
    let text = format!(
        "the force jumps between the rows at {} and {} s, and {} % of the answering position relaxes in as long a time after it: the time of the jump is not known, and a ramp between both rows is assumed",
        number(time_s[row - 1]),
        number(time_s[row]),
        format_significant(100.0 * share, 2)
    );
    let advice = "moduli of fast elements are wrong if it was no ramp: give the jump a row just before its time and one just after it, or the ramp a row in its middle, each with an empty position";
    Some(Warning { kind: WarningKind::UnknownJump, text, advice: advice.into() })
}

/// Largest delay, in rows, of a force log that the check for a late log tries.
const MOST_LAG: usize = 200;
/// Largest ratio of two mean residuals that shows a late log: the residual of a fit with the force shifted to earlier rows, divided by that with the logged
/// force.
const LEFT: f64 = 0.5;
/// Smallest reduction of the mean residual by shifting the force to earlier rows, as a fraction of the positions' range.
const MATTERS: f64 = 0.003;
/// Number of successive rows that must deviate in the same direction to count as the beginning of a motion.
const SUSTAINED: usize = 3;
/// Largest number of switch times that a message lists.
const LISTED: usize = 8;

/// Finds a force that acts before the rows in which it is written, because it was logged late or more rarely than the positions.
pub(super) fn logged_late(looked: &CheckContext<'_>) -> Option<Contradiction> {
    let record = looked.record;
    let fit = looked.fit.as_ref()?;
    let steps = record.force_step_rows();
    let shortest = steps.windows(2).map(|pair| pair[1] - pair[0]).min()?;
    let moved = |lag: usize| {
        let last_n = record.force_n.last().copied().unwrap_or(0.0);
        let earlier = record.force_n[lag..].iter().copied().chain(std::iter::repeat_n(last_n, lag)).collect();
        let moved = quick_fit(&Record { force_n: earlier, ..record.clone() }, record.force_rule)?;
        Some((moved.mean_residual_m(record), lag, moved.left_sd_m))
    };
    let most = MOST_LAG.min(shortest / 2);
    let lags = std::iter::successors(Some(1), |lag| Some((lag + lag / 4).max(lag + 1))).take_while(|lag| *lag <= most);
    let (left_m, _, noise_m) = lags.filter_map(moved).min_by(|a, b| a.0.total_cmp(&b.0))?;
    let here_m = fit.mean_residual_m(record);
    if left_m > LEFT * here_m || here_m - left_m < MATTERS * looked.range_m {
        return None;
    }
    let noise_m = noise_m.min(looked.noise_m);
    let begin = |step: usize| {
        let first = step.saturating_sub(most).max(WITHIN);
        (first..step).find(|row| {
            let ahead: Vec<f64> = (*row..row + SUSTAINED).filter_map(|row| excess_m(looked, row)).collect();
            ahead.len() == SUSTAINED && ahead.iter().all(|x| x * ahead[0] > 0.0 && x.abs() > ERRORS * noise_m)
        })
    };
    // The motion begins in the row before the first row whose position has moved.
    let begins: Vec<(f64, f64)> =
        steps.iter().filter_map(|step| Some((record.time_s[begin(*step)? - 1], record.time_s[*step]))).collect();
    let late_s = record::robust::median(begins.iter().map(|(begin_s, step_s)| step_s - begin_s).collect())?;
    // Half of the rows of a hold may be nearly all of its time. The law's own misfit then looks like a motion.
    let holds_s = steps.windows(2).map(|pair| record.time_s[pair[1]] - record.time_s[pair[0]]);
    if late_s > 0.5 * holds_s.fold(f64::INFINITY, f64::min) {
        return None;
    }
    let listed: Vec<String> = begins.iter().take(LISTED).map(|(begin_s, _)| format_significant(*begin_s, 5)).collect();
    let text = format!(
        "the force column lags the motion: the body moves about {} s before the rows in which the force switches. The force was logged late or too rarely",
        format_significant(late_s, 2)
    );
    let advice = format!(
        "give the force in a separate log ([actuation]) with the times at which it switched; the motion begins at {} s{}",
        listed.join(", "),
        if begins.len() > LISTED { ", …" } else { "" }
    );
    Some(found("force_logged_late", true, text, advice))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Steps of the command at 2 s and at 6 s, whose answer relaxes with a time of 2 s; a row each 0.5 s, and those at `more` s. Rows at `lost` s have no answer.
    fn stepped(more: &[f64], lost: &[f64]) -> Record {
        let mut time_s: Vec<f64> = (0..24).map(|row| 0.5 * f64::from(row)).chain(more.iter().copied()).collect();
        time_s.sort_by(f64::total_cmp);
        let since = |t: f64, step_s: f64| if t < step_s { 0.0 } else { 1.0 + (-(t - step_s) / 2.0).exp() };
        let command = |t: f64| f64::from(u8::from(t >= 2.0)) + f64::from(u8::from(t >= 6.0));
        let answer = |t: &f64| (!lost.contains(t)).then(|| since(*t, 2.0) + since(*t, 6.0));
        Record {
            force_n: time_s.iter().map(|t| command(*t)).collect(),
            position_m: time_s.iter().map(answer).collect(),
            cycle: vec![1; time_s.len()],
            time_s,
            force_rule: ForceRule::Linear,
            force_rows: Vec::new(),
        }
    }

    #[test]
    fn a_jump_is_unknown_unless_rows_tell_its_time() {
        let just_before = [1.9999, 5.9999];
        let is_unknown = |more: &[f64], lost: &[f64]| unknown_jump(&stepped(more, lost), 1e-3).is_some();
        assert!(is_unknown(&[], &[]));
        // A lost answer in the row of each jump hides nothing.
        assert!(is_unknown(&[], &[2.0, 6.0]));
        assert!(!is_unknown(&just_before, &just_before));
        // One jump that is told leaves the other one.
        assert!(is_unknown(&just_before[..1], &just_before[..1]));
        assert!(unknown_jump(&Record { force_rule: ForceRule::Hold, ..stepped(&[], &[]) }, 1e-3).is_none());
    }
}
