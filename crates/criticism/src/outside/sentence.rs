//! Sentences for structure outside the library.

use super::setting::SearchSetting;
use super::shape::{Side, StructureShape};

/// Sentence on a finding, with its time and period (s) if it has them.
pub(super) struct FindingText {
    pub sentence: String,
    pub event_time_s: Option<f64>,
    pub period_s: Option<f64>,
}

/// Writes a value with three significant digits.
fn number(value: f64) -> String {
    let magnitude = value.abs();
    if !(1e-4..1e6).contains(&magnitude) {
        return if magnitude == 0.0 { "0".into() } else { format!("{value:.2e}") };
    }
    let decimals = (2.0 - magnitude.log10().floor()).max(0.0) as usize;
    format!("{value:.decimals$}")
}

/// Writes a value and its standard deviation, rounded to the deviation's first digit.
fn with_sd(value: f64, sd: f64) -> String {
    if !(sd.is_finite() && sd > 0.0) {
        return number(value);
    }
    let decimals = (-sd.log10().floor()).clamp(0.0, 6.0) as usize;
    format!("{value:.decimals$} ± {sd:.decimals$}")
}

/// Describes a shape. `amplitudes` and their standard deviations `sds` are in µm; `size_um` is the size (µm) of the part that the model cannot absorb.
pub(super) fn describe(
    shape: StructureShape,
    amplitudes: &[f64],
    sds: &[f64],
    size_um: f64,
    setting: &SearchSetting,
    cycle: &[u32],
) -> FindingText {
    let norm = |values: &[f64]| values.iter().map(|value| value * value).sum::<f64>().sqrt();
    let amplitude = amplitudes.first().copied().unwrap_or(0.0);
    let sd = sds.first().copied().unwrap_or(f64::NAN);
    let size = number(size_um);
    let when = |time_s: f64| {
        let row = setting.time_s.partition_point(|t| *t < time_s).min(cycle.len().saturating_sub(1));
        format!("at {} s (cycle {})", number(time_s), cycle.get(row).copied().unwrap_or(0))
    };
    let up_or_down = if amplitude > 0.0 { "up" } else { "down" };
    let plain = |sentence: String| FindingText { sentence, event_time_s: None, period_s: None };
    let event = |sentence: String, time_s: f64| FindingText { sentence, event_time_s: Some(time_s), period_s: None };
    match shape {
        StructureShape::Vibration { frequency_hz } => {
            let height = with_sd(norm(amplitudes), norm(sds) / (sds.len().max(1) as f64).sqrt());
            let sentence = format!(
                "A vibration of {height} µm at {} Hz{} runs through the record; no effect of the library makes one.",
                number(frequency_hz),
                describe_locking(frequency_hz, setting)
            );
            FindingText { sentence, event_time_s: None, period_s: Some(1.0 / frequency_hz) }
        }
        StructureShape::Offset => plain(format!(
            "All positions are {} µm too {}: the zero is wrong. Write `zero = \"fit\"` in [measurement], which fits it.",
            with_sd(amplitude.abs(), sd),
            if amplitude > 0.0 { "large" } else { "small" }
        )),
        StructureShape::Step { row } => {
            let time_s = setting.time_s[row];
            let by = with_sd(amplitude.abs(), sd);
            let text = format!(
                "The position jumps {up_or_down} by {by} µm {}: a slip or an error of the tracker, not a property of the gel.",
                when(time_s)
            );
            event(text, time_s)
        }
        StructureShape::RampFrom { time_s } => {
            let rate = with_sd(amplitude, sd);
            event(format!("A drift of {rate} µm/s begins {}: a part outside the gel moves.", when(time_s)), time_s)
        }
        StructureShape::RampUntil { time_s } => {
            let rate = with_sd(amplitude, sd);
            event(format!("A drift of {rate} µm/s ends {}: a part outside the gel moved.", when(time_s)), time_s)
        }
        StructureShape::GainChange { row } => {
            let time_s = setting.time_s[row];
            // Amplitudes are in µm at the largest position.
            let percent = 1e-4 / setting.largest_position_m().max(f64::MIN_POSITIVE);
            let by = with_sd(amplitude * percent, sd * percent);
            event(
                format!(
                    "All positions are {by} % larger from {} on: the scale of the tracker or of the force changed.",
                    &when(time_s)[3..]
                ),
                time_s,
            )
        }
        StructureShape::Bump { centre_s, width_s } => {
            let by = with_sd(amplitude, sd);
            let text = format!(
                "A disturbance of {by} µm passes {}, about {} s long: it occurs once and is no property of the gel.",
                when(centre_s),
                number(2.355 * width_s)
            );
            event(text, centre_s)
        }
        StructureShape::Backlash { half_width_m } => {
            // The width is the backward motion until the side has changed; the amplitude is the error of the measured position. In a worn drive, the width is twice the
            // amplitude.
            let side = if amplitude > 0.0 { "lag behind" } else { "run ahead of" };
            plain(format!(
                "Readings {side} the motion by {} µm, and change sides within {} µm of a reversal, as with backlash (unexplained: {size} µm).",
                with_sd(amplitude.abs(), sd),
                number(2e6 * half_width_m)
            ))
        }
        StructureShape::CycleLocked { n_harmonics } => FindingText {
            sentence: format!(
                "{size} µm repeat with the cycle, in its first {n_harmonics} harmonics, and follow no effect of the library."
            ),
            event_time_s: None,
            period_s: Some(setting.cycle_s),
        },
        StructureShape::SinceStep { .. } => plain(format!(
            "{size} µm follow the time since the force step and change sign with it: a response that the model lacks."
        )),
        StructureShape::SlowChange { n_waves } => {
            let (first_s, last_s) = setting.span_s();
            plain(format!(
                "{size} µm change slowly with absolute time (no faster than {} s): a nonlinear drift.",
                number((last_s - first_s) / n_waves as f64)
            ))
        }
        StructureShape::Nonlinearity { power, is_odd } => {
            let form = match (power, is_odd) {
                (2, false) => "x²",
                (2, true) => "x·|x|",
                _ => "x³",
            };
            plain(format!(
                "{size} µm follow the position itself, as {form}: the tracker's scale or the gel is not linear."
            ))
        }
        StructureShape::OfPosition { .. } => plain(format!(
            "{size} µm are a curve of the position itself: the tracker's scale or the gel is not linear."
        )),
        StructureShape::PositionWave { period_m } => plain(format!(
            "{size} µm vary periodically with the position, with a period of {} µm, as if the tracker were drawn towards its pixels.",
            number(1e6 * period_m)
        )),
        StructureShape::Ratchet { side } => {
            let of = match side {
                Side::Above => "highest",
                Side::Below => "lowest",
                Side::Both => "farthest",
            };
            plain(format!(
                "{size} µm follow the {of} position so far and remain: the largest excursion has a permanent effect."
            ))
        }
        StructureShape::ForceSquared => plain(format!(
            "{size} µm follow the square of the force, with the gel's own delay: the force is not proportional to its command, or the gel is not linear."
        )),
        StructureShape::ForceLevel => {
            plain(format!("{size} µm follow the level of the force immediately, without the gel's delay."))
        }
    }
}

/// Phrase for a vibration whose frequency is a multiple of the cycle's, as far as the record resolves it; empty for others.
fn describe_locking(frequency_hz: f64, setting: &SearchSetting) -> String {
    let (first_s, last_s) = setting.span_s();
    let a_cycle = frequency_hz * setting.cycle_s;
    let is_locked =
        (a_cycle - a_cycle.round()).abs() < 0.1 * setting.cycle_s / (last_s - first_s).max(f64::MIN_POSITIVE);
    if is_locked && a_cycle > 0.5 { format!(", {} periods a cycle,", a_cycle.round()) } else { String::new() }
}
