//! When the force changes, and when it depends too much on the position.

use crate::error::{Error, Result};
use crate::number::PointScalar;
use crate::stages::{LARGEST_FEEDBACK, Load};

/// A change of the force that enters the lag.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Switch<N = f64> {
    /// When, in s.
    pub time_s: N,
    /// The force from then on, in N.
    pub force_n: N,
}

/// The changes of the force, from the record's start on, after delay, factors and offset; the first is the offset's.
pub(crate) fn switches<N: PointScalar>(load: &Load, time_s: &[f64], force_n: &[f64]) -> Vec<Switch<N>> {
    let Some(&start_s) = time_s.first() else { return Vec::new() };
    let offset_n = N::of(load.offset_n);
    let mut switches = vec![Switch { time_s: N::constant(start_s), force_n: offset_n }];
    let mut commanded_n = 0.0;
    for (&time_s, &force_n) in time_s.iter().zip(force_n) {
        if force_n != commanded_n {
            commanded_n = force_n;
            let factor = if force_n < 0.0 { load.negative_factor } else { load.positive_factor };
            let force_n = N::of(factor) * force_n + offset_n;
            switches.push(Switch { time_s: N::of(load.delay_s) + N::constant(time_s), force_n });
        }
    }
    switches
}

/// Refuses positions (m) at which the gradient is too strong for what the model says of it.
pub(crate) fn check_feedback(gradient_per_m: f64, position_m: &[f64], time_s: f64) -> Result<()> {
    if gradient_per_m == 0.0 {
        return Ok(());
    }
    // What is not a number is too strong as well.
    let shares = position_m.iter().map(|x| (gradient_per_m * x).abs());
    let Some(feedback) = shares.filter(|share| share.is_nan() || *share >= LARGEST_FEEDBACK).reduce(f64::max) else {
        return Ok(());
    };
    Err(Error::numerical(
        format!(
            "the force's gradient changes the force by a share of {feedback:.3} at {time_s} s; {LARGEST_FEEDBACK} and more is refused"
        ),
        "use a smaller gradient, or a stiffer gel",
    ))
}
