//! From the commanded to the acting force: the only place where the load's equations stand (physics §5).
//!
//! In this order: delay, factors by sign and offset give the force F_in that enters the lag, in straight lines from [`Switch`] to [`Switch`]; the lag τ Ḟ = F_in − F starts from
//! F = 0; the gradient multiplies by e^{gx}. Solvers ask [`Load`] for these and for what follows from them (fastest time, dependence on the position, exact solution
//! between switches, rate at an implicit stage), so that an equation is added or changed here alone.

use base::error::{Error, Result};
use base::number::{Dual, PointScalar, Scalar};
use record::Force;

/// From the commanded to the acting force, in this order: delay, factors by sign, offset, lag, gradient.
#[derive(Debug, Clone, PartialEq)]
pub struct Load<N = Dual> {
    /// δ ≥ 0 in s: F(t) = F_command(t − δ), zero before the record's start.
    pub delay_s: N,
    /// Factor of positive forces.
    pub positive_factor: N,
    /// Factor of negative forces.
    pub negative_factor: N,
    /// Added to the force from the record's start on, in N.
    pub offset_n: N,
    /// τ ≥ 0 in s of τ Ḟ = F_in − F, F = 0 at the record's start; 0 is no lag.
    pub lag_time_s: N,
    /// g in 1/m of F = F_in e^{gx}, x the robot's position; refused where the force runs away with the robot.
    pub gradient_per_m: N,
}

/// |g x| from which on a force gradient is refused: the force is then 10⁸ times as large as it was or as small, and what runs away passes it (physics §5).
pub const LARGEST_EXPONENT: f64 = 20.0;

/// Most steps of Newton's method for a force that depends on the position.
pub const MOST_NEWTON_STEPS: usize = 60;

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

impl<N: Scalar> Switch<N> {
    /// To a force (N) that then holds.
    pub fn to(time_s: N, force_n: N) -> Self {
        Self { time_s, force_n, slope_n_per_s: N::constant(0.0), jumps: true }
    }

    /// The force that enters the lag, in N, at a time since.
    #[inline(always)]
    pub fn input_n(&self, time_s: N) -> N {
        self.force_n + self.slope_n_per_s * (time_s - self.time_s)
    }
}

/// A number of the load that a response can be followed in to first order: all but those by which the force depends on the position.
pub struct LoadNumber {
    /// What it is measured in.
    pub unit: LoadUnit,
    /// Whether a delay delays it; what acts from the record's start on is not delayed.
    pub is_delayed: bool,
    field: fn(&mut Load) -> &mut Dual,
}

/// What a number of the load is measured in.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LoadUnit {
    /// A factor of the force, by its distance from 1.
    Factor,
    /// A force in N.
    Force,
    /// A time in s.
    Time,
}

impl LoadNumber {
    /// Numbers that change the force's size first, times last.
    pub const ALL: [Self; 5] = [
        Self { unit: LoadUnit::Factor, is_delayed: true, field: |load| &mut load.positive_factor },
        Self { unit: LoadUnit::Factor, is_delayed: true, field: |load| &mut load.negative_factor },
        Self { unit: LoadUnit::Force, is_delayed: false, field: |load| &mut load.offset_n },
        Self { unit: LoadUnit::Time, is_delayed: true, field: |load| &mut load.delay_s },
        Self { unit: LoadUnit::Time, is_delayed: true, field: |load| &mut load.lag_time_s },
    ];

    /// Those that change the force's size.
    pub fn of_size() -> impl Iterator<Item = &'static Self> {
        Self::ALL.iter().filter(|number| number.unit != LoadUnit::Time)
    }

    /// How far a load's number is from doing nothing.
    pub fn of(&self, load: &Load) -> Dual {
        let number = *(self.field)(&mut load.clone());
        if self.unit == LoadUnit::Factor { number - Dual::ONE } else { number }
    }

    /// A load that does this alone.
    pub fn alone(&self, size: f64) -> Load {
        let mut load = Load::COMMANDED;
        *(self.field)(&mut load) = if self.unit == LoadUnit::Factor { (1.0 + size).into() } else { size.into() };
        load
    }
}

impl Load {
    /// The force acts as it is commanded.
    pub const COMMANDED: Self = Self {
        delay_s: Dual::ZERO,
        positive_factor: Dual::ONE,
        negative_factor: Dual::ONE,
        offset_n: Dual::ZERO,
        lag_time_s: Dual::ZERO,
        gradient_per_m: Dual::ZERO,
    };

    /// Whether the force acts as it is commanded, and that does not change.
    pub fn is_commanded(&self) -> bool {
        self.numbers().iter().zip(Self::COMMANDED.numbers()).all(|(number, null)| number.is_constant(null.value))
    }

    /// The same in another number.
    pub fn of<N: PointScalar>(&self) -> Load<N> {
        Load::of_numbers(self.numbers().map(N::of))
    }

    /// The load of commands that are `factor` times as large: what is added to them grows likewise.
    pub fn of_commands_times(&self, factor: f64) -> Self {
        Self { offset_n: self.offset_n * factor, ..self.clone() }
    }

    /// The load where positions are measured in units so many times as large.
    pub fn of_positions_in(&self, unit: f64) -> Self {
        Self { gradient_per_m: self.gradient_per_m * unit, ..self.clone() }
    }

    /// Refuses times below 0.
    ///
    /// # Errors
    /// [`Error::Numerical`] that says which.
    pub fn check(&self) -> Result<()> {
        for (what, number) in [("the force's delay", self.delay_s), ("the force's lag", self.lag_time_s)] {
            if number.value.is_nan() || number.value < 0.0 {
                return Err(Error::numerical(format!("{what} is {} s", number.value), "give a value of at least 0"));
            }
        }
        Ok(())
    }

    /// Refuses a derivative that cannot be computed in forward mode: that with respect to the lag's time where there is no lag.
    ///
    /// # Errors
    /// [`Error::Numerical`].
    pub fn check_derivative(&self) -> Result<()> {
        if self.lag_time_s.value == 0.0 && self.lag_time_s.derivative != 0.0 {
            return Err(Error::numerical(
                "the position has no computable derivative with respect to the lag's time at 0",
                "take a finite step from 0",
            ));
        }
        Ok(())
    }
}

/// How many numbers a load has.
pub const N_LOAD_NUMBERS: usize = 6;

impl<N: Scalar> Load<N> {
    /// Its numbers, in the order in which [`Self::of_numbers`] takes them.
    pub fn numbers(&self) -> [N; N_LOAD_NUMBERS] {
        let Self { delay_s, positive_factor, negative_factor, offset_n, lag_time_s, gradient_per_m } = self;
        [delay_s, positive_factor, negative_factor, offset_n, lag_time_s, gradient_per_m].map(|number| *number)
    }

    /// The load of [`Self::numbers`].
    pub fn of_numbers(
        [delay_s, positive_factor, negative_factor, offset_n, lag_time_s, gradient_per_m]: [N; N_LOAD_NUMBERS],
    ) -> Self {
        Self { delay_s, positive_factor, negative_factor, offset_n, lag_time_s, gradient_per_m }
    }

    /// A commanded force (N), or the slope (N/s) of one, after the factors by sign, without the offset.
    pub fn scaled(&self, commanded: f64, is_positive: bool) -> N {
        (if is_positive { self.positive_factor } else { self.negative_factor }) * commanded
    }

    /// The force (N) that enters the lag under a commanded one (N).
    pub fn entering_n(&self, commanded_n: f64, is_positive: bool) -> N {
        self.scaled(commanded_n, is_positive) + self.offset_n
    }

    /// The force (N) that enters the lag from the record's start on, until the first command comes to act.
    pub fn start_n(&self) -> N {
        self.offset_n
    }

    /// When a command given at a time (s) comes to act, in s.
    pub fn acts_at_s(&self, commanded_s: f64) -> N {
        self.delay_s + N::constant(commanded_s)
    }

    /// When a command was given that acts at a time (s), in s.
    pub fn commanded_at_s(&self, at_s: f64) -> N {
        N::constant(at_s) + -self.delay_s
    }

    /// The acting force (N) where the robot is at `position_m` and the lag gives `force_n`.
    #[inline(always)]
    pub fn acting_n(&self, force_n: N, position_m: N) -> N {
        force_n * (self.gradient_per_m * position_m).exp()
    }

    /// By how much an acting force (N) grows with the position, in N/m.
    #[inline(always)]
    pub fn acting_slope(&self, acting_n: N) -> N {
        acting_n * self.gradient_per_m
    }
}

impl<N: PointScalar> Load<N> {
    /// Whether commands come to act later than they are given.
    pub fn is_delayed(&self) -> bool {
        !self.delay_s.is_constant(0.0)
    }

    /// Whether the force lags behind what enters.
    pub fn lags(&self) -> bool {
        self.lag_time_s.value() > 0.0
    }

    /// Whether the force depends on the robot's position.
    pub fn depends_on_position(&self) -> bool {
        !self.gradient_per_m.is_constant(0.0)
    }

    /// Whether all that happens to the force happens at the rows of the command.
    pub fn acts_at_rows(&self) -> bool {
        !self.is_delayed() && self.lag_time_s.value() == 0.0 && !self.depends_on_position()
    }

    /// Fastest time (s) in which the force changes by itself; infinite where it only follows.
    pub fn fastest_s(&self) -> f64 {
        if self.lags() { self.lag_time_s.value() } else { f64::INFINITY }
    }

    /// Largest force (N) that may come to act on a robot at rest, under commands of a largest size (N).
    pub fn largest_n(&self, commanded_n: f64) -> f64 {
        let factor = self.positive_factor.value().abs().max(self.negative_factor.value().abs());
        commanded_n * factor + self.offset_n.value().abs()
    }

    /// The changes of the force that enters the lag, from the record's start on; the first is the offset's.
    pub fn switches(&self, time_s: &[f64], force: Force<'_>) -> Vec<Switch<N>> {
        let Some(&start_s) = time_s.first() else { return Vec::new() };
        let mut switches = vec![Switch::to(N::constant(start_s), self.start_n())];
        let (mut commanded_n, mut slope_before) = (0.0, 0.0);
        for (row, (&row_s, &force_n)) in time_s.iter().zip(force.at_rows_n).enumerate() {
            let slope = force.slope_n_per_s(time_s, row);
            let jumps = force_n != commanded_n && (row == 0 || !force.is_linear());
            commanded_n = force_n;
            if !jumps && slope == slope_before {
                continue;
            }
            slope_before = slope;
            let is_positive = force.is_positive(row);
            switches.push(Switch {
                time_s: self.acts_at_s(row_s),
                force_n: self.entering_n(force_n, is_positive),
                slope_n_per_s: self.scaled(slope, is_positive),
                jumps,
            });
        }
        switches
    }

    /// 1/τ in 1/s, at which the lag's transient decays; `None` without a lag.
    pub fn lag_rate_per_s(&self) -> Option<N> {
        self.lags().then(|| N::constant(1.0) / self.lag_time_s)
    }

    /// How many of the lag's times a step (s) has; `None` without a lag.
    pub fn lags_in(&self, step_s: f64) -> Option<f64> {
        self.lags().then(|| step_s / self.lag_time_s.value())
    }

    /// What the lag makes of a switch's straight line in the long run, in N: it follows by the lag's time late.
    #[inline(always)]
    pub fn followed_n(&self, input: &Switch<N>, time_s: N) -> N {
        input.input_n(time_s) - input.slope_n_per_s * self.lag_time_s
    }

    /// The force after the lag at a time since a switch, in N, where it was `lagged_n` at the switch.
    #[inline(always)]
    pub fn after_lag_n(&self, input: &Switch<N>, lagged_n: N, time_s: N) -> N {
        if self.lag_time_s.value() == 0.0 {
            return input.input_n(time_s);
        }
        let left_n = lagged_n - self.followed_n(input, input.time_s);
        self.followed_n(input, time_s) + left_n * (-(time_s - input.time_s) / self.lag_time_s).exp()
    }

    /// The force (N) at an implicit stage of a Runge–Kutta method, and its rate k (N/s): τ k = F_in − (F₀ + earlier stages' share + h k).
    pub fn at_implicit_stage(&self, input_n: N, start_n: N, earlier_n: N, implicit_s: f64) -> (N, N) {
        let rate = (input_n - start_n - earlier_n) / (self.lag_time_s + N::constant(implicit_s));
        (if self.lags() { start_n + earlier_n + rate * implicit_s } else { input_n }, rate)
    }

    /// What the lag makes of a signal that goes straight from `from` to `to` in a step (s), where it had made `lagged` of it before.
    pub fn lagged_along(&self, lagged: N, from: N, to: N, step_s: f64) -> N {
        let behind = (to + -from) * self.lag_time_s * (1.0 / step_s);
        let left = (N::constant(-step_s) / self.lag_time_s).exp();
        to + -behind + (lagged + -from + behind) * left
    }

    /// The exponent of the force's growth at a position (m): below [`LARGEST_EXPONENT`] in size, or refused.
    fn exponent(&self, position_m: f64) -> f64 {
        self.gradient_per_m.value() * position_m
    }

    /// Refuses positions (m) at which the force has run away with the robot.
    ///
    /// # Errors
    /// [`Error::Numerical`].
    pub fn check_feedback(&self, position_m: &[f64], time_s: f64) -> Result<()> {
        if self.gradient_per_m.value() == 0.0 {
            return Ok(());
        }
        // What is not a number has no balance.
        if position_m.iter().all(|x| self.exponent(*x).abs() < LARGEST_EXPONENT) {
            return Ok(());
        }
        Err(Error::numerical(
            format!("the force's gradient pulls the robot away at {time_s} s: it grows faster than the gel holds"),
            "take a gradient nearer to 0, or a stiffer gel",
        ))
    }

    /// The exponent of the force's growth over the creep compliance, in Pa, for a displacement per force (1/m) and a largest force (N).
    pub fn feedback_strength_pa(&self, compliance_per_m: f64, largest_n: f64) -> f64 {
        (self.gradient_per_m.value() * compliance_per_m).abs() * largest_n
    }
}

impl Load<f64> {
    /// What a lag makes of a force (N) that holds for a step (s): at its end, and in the mean.
    pub fn lagged_of_hold(&self, begin_n: f64, entering_n: f64, step_s: f64) -> [f64; 2] {
        let rate = step_s / self.lag_time_s;
        let end_n = entering_n + (begin_n - entering_n) * (-rate).exp();
        let mean_n = if rate == 0.0 { begin_n } else { entering_n + (begin_n - entering_n) * -(-rate).exp_m1() / rate };
        [end_n, mean_n]
    }

    /// The acting force (N) that balances a robot whose position is `history_m` and `per_n` a newton, where the lag gives `force_n`; not a number where there is none.
    pub fn balanced_n(&self, force_n: f64, history_m: f64, per_n: f64) -> f64 {
        let g = self.gradient_per_m;
        force_n * balanced_exponent(g * history_m, g * force_n * per_n).exp()
    }

    /// How a message says that the force depends on the position; nothing where it does not.
    pub fn feedback_words(&self) -> String {
        if self.gradient_per_m == 0.0 {
            return String::new();
        }
        format!(" under a force gradient of {} per m", self.gradient_per_m)
    }

    /// Why a response under this load is refused whose position is not finite.
    pub fn refusal(&self) -> Error {
        let gradient = self.gradient_per_m;
        if gradient == 0.0 {
            return Error::numerical("the position is not finite", "keep rates and times within the record's scales");
        }
        Error::numerical(
            format!("a force gradient of {gradient:e} per m pulls the robot away: it grows faster than the gel holds"),
            "take a gradient nearer to 0, or a stiffer gel",
        )
    }
}

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
