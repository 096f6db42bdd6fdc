//! When the force changes, and when it depends too much on the position.

use base::error::{Error, Result};
use base::number::PointScalar;
use laws::stages::{LARGEST_EXPONENT, Load};
use record::Force;

/// A change of the force that enters the lag: from then on it is a straight line.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Switch<N = f64> {
    /// When, in s.
    pub time_s: N,
    /// The force from the right, in N.
    pub force_n: N,
    /// By how much it rises a second from then on, in N/s.
    pub slope_n_per_s: N,
    /// Whether the force itself jumps there, and not its slope alone.
    pub jumps: bool,
}

impl<N: PointScalar> Switch<N> {
    /// To a force (N) that then holds.
    pub fn to(time_s: N, force_n: N) -> Self {
        Self { time_s, force_n, slope_n_per_s: N::constant(0.0), jumps: true }
    }

    /// The force that enters the lag, in N, at a time since.
    #[inline(always)]
    pub fn input_n(&self, time_s: N) -> N {
        self.force_n + self.slope_n_per_s * (time_s - self.time_s)
    }

    /// What a lag of some time (s) makes of that force in the long run, in N: it follows a line by the lag's time late.
    #[inline(always)]
    pub(crate) fn followed_n(&self, time_s: N, lag_time_s: N) -> N {
        self.input_n(time_s) - self.slope_n_per_s * lag_time_s
    }

    /// The force after the lag τ Ḟ = F_in − F at a time since, in N, where it was `lagged_n` at the switch.
    #[inline(always)]
    pub fn after_lag_n(&self, lagged_n: N, lag_time_s: N, time_s: N) -> N {
        if lag_time_s.value() == 0.0 {
            return self.input_n(time_s);
        }
        let left_n = lagged_n - self.followed_n(self.time_s, lag_time_s);
        self.followed_n(time_s, lag_time_s) + left_n * (-(time_s - self.time_s) / lag_time_s).exp()
    }
}

/// The changes of the force, from the record's start on, after delay, factors and offset; the first is the offset's.
pub fn switches<N: PointScalar>(load: &Load, time_s: &[f64], force: Force<'_>) -> Vec<Switch<N>> {
    let Some(&start_s) = time_s.first() else { return Vec::new() };
    let offset_n = N::of(load.offset_n);
    let mut switches = vec![Switch::to(N::constant(start_s), offset_n)];
    let (mut commanded_n, mut slope_before) = (0.0, 0.0);
    for (row, (&row_s, &force_n)) in time_s.iter().zip(force.at_rows_n).enumerate() {
        let slope = force.slope_n_per_s(time_s, row);
        let jumps = force_n != commanded_n && (row == 0 || !force.is_linear());
        commanded_n = force_n;
        if !jumps && slope == slope_before {
            continue;
        }
        slope_before = slope;
        let factor = if force.is_positive(row) { load.positive_factor } else { load.negative_factor };
        switches.push(Switch {
            time_s: N::of(load.delay_s) + N::constant(row_s),
            force_n: N::of(factor) * force_n + offset_n,
            slope_n_per_s: N::of(factor) * slope,
            jumps,
        });
    }
    switches
}

/// Refuses positions (m) at which a force F_in e^{gx} has run away with the robot.
pub fn check_feedback(gradient_per_m: f64, position_m: &[f64], time_s: f64) -> Result<()> {
    if gradient_per_m == 0.0 {
        return Ok(());
    }
    // What is not a number has no balance.
    if position_m.iter().all(|x| (gradient_per_m * x).abs() < LARGEST_EXPONENT) {
        return Ok(());
    }
    Err(Error::numerical(
        format!("the force's gradient pulls the robot away at {time_s} s: it grows faster than the gel holds"),
        "take a gradient nearer to 0, or a stiffer gel",
    ))
}

/// Most steps of Newton's method for a force that depends on the position.
pub const MOST_NEWTON_STEPS: usize = 60;

/// y = a + b e^y, the solution that b = 0 leads to, found from its side; not a number where there is none, since the force runs away.
pub fn balanced_exponent(a: f64, b: f64) -> f64 {
    let mut y = a;
    for _ in 0..MOST_NEWTON_STEPS {
        let grown = b * y.exp();
        let step = (a + grown - y) / (1.0 - grown);
        y += step;
        if step.abs() <= 1e-15 * (1.0 + y.abs()) {
            return if grown < 1.0 { y } else { f64::NAN };
        }
    }
    f64::NAN
}
