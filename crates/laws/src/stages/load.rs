//! Transformation of the commanded force into the acting force, with all equations of the load (physics §5).
//!
//! Delay, factors by sign and offset are applied to the command in this order. The result is the force F_in, which enters the
//! lag. F_in is a straight line in time from each [`Switch`] to the next. The lag makes the force F follow F_in by τ Ḟ = F_in − F
//! from F = 0, with the lag time τ. The gradient g multiplies F by e^{gx}, with x the robot's position. Solvers take all
//! equations of the force from [`Load`]: its fastest time, its dependence on the position, its exact solution between switches
//! and its rate at an implicit stage.

use base::error::{Error, Result};
use base::number::{Dual, PointScalar, Scalar};
use record::Force;

/// Transformation of the commanded force into the acting force, by delay, factors by sign, offset, lag and gradient in this
/// order.
#[derive(Debug, Clone, PartialEq)]
pub struct Load<N = Dual> {
    /// Delay δ ≥ 0 in s: the force at time t is the command at t − δ. The command is zero before the record's start.
    pub delay_s: N,
    /// Factor that multiplies positive commands.
    pub positive_factor: N,
    /// Factor that multiplies negative commands.
    pub negative_factor: N,
    /// Offset in N, which is added to the force from the record's start.
    pub offset_n: N,
    /// Lag time τ ≥ 0 in s: the force F follows the entering force F_in by τ Ḟ = F_in − F, with F = 0 at the record's start. At τ
    /// = 0 there is no lag.
    pub lag_time_s: N,
    /// Gradient g in 1/m: the force is multiplied by e^{gx}, with x the robot's position. Solvers return an error if the force
    /// diverges with the position.
    pub gradient_per_m: N,
}

/// Largest |g x| for which a force gradient g (1/m) is computed, with x the robot's position. At this limit the gradient changes
/// the force by a factor of about 10⁸. A force that diverges exceeds the limit (physics §5).
pub const MAX_GRADIENT_EXPONENT: f64 = 20.0;

/// Largest number of Newton steps to solve for a force that depends on the position.
pub const MAX_NEWTON_STEPS: usize = 60;

/// Change of the force that enters the lag. From each change to the next, the force is a straight line in time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Switch<N = f64> {
    /// Time of the change, in s.
    pub time_s: N,
    /// Force just after the change, in N.
    pub force_n: N,
    /// Rate of the force after the change, in N/s.
    pub slope_n_per_s: N,
    /// `true` if the force itself jumps, `false` if only its slope changes.
    pub jumps: bool,
}

impl<N: Scalar> Switch<N> {
    /// Returns a switch to a force (N) that then stays constant.
    pub fn to(time_s: N, force_n: N) -> Self {
        Self { time_s, force_n, slope_n_per_s: N::constant(0.0), jumps: true }
    }

    /// Returns the force (N) that enters the lag at a time (s) after the switch.
    #[inline(always)]
    pub fn input_n(&self, time_s: N) -> N {
        self.force_n + self.slope_n_per_s * (time_s - self.time_s)
    }
}

/// Parameter of the load by which the force can be expanded to first order. All parameters qualify except the gradient, which
/// makes the force depend on the position.
pub struct LoadParameter {
    /// Unit of the parameter.
    pub unit: LoadUnit,
    /// `true` if the delay also applies to the force that this parameter changes. A force that acts from the record's start is
    /// not delayed.
    pub is_delayed: bool,
    field: fn(&mut Load) -> &mut Dual,
}

/// Unit of a parameter of the load.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LoadUnit {
    /// Dimensionless factor of the force, whose null is 1.
    Factor,
    /// Force in N.
    Force,
    /// Time in s.
    Time,
}

impl LoadParameter {
    /// All parameters of the load except the gradient. The parameters that change the size of the force come first, the times
    /// last.
    pub const ALL: [Self; 5] = [
        Self { unit: LoadUnit::Factor, is_delayed: true, field: |load| &mut load.positive_factor },
        Self { unit: LoadUnit::Factor, is_delayed: true, field: |load| &mut load.negative_factor },
        Self { unit: LoadUnit::Force, is_delayed: false, field: |load| &mut load.offset_n },
        Self { unit: LoadUnit::Time, is_delayed: true, field: |load| &mut load.delay_s },
        Self { unit: LoadUnit::Time, is_delayed: true, field: |load| &mut load.lag_time_s },
    ];

    /// Returns the parameters that change the size of the force, which are all but the times.
    pub fn of_size() -> impl Iterator<Item = &'static Self> {
        Self::ALL.iter().filter(|number| number.unit != LoadUnit::Time)
    }

    /// Returns the parameter's value in a load, minus its null, which is the value without effect.
    pub fn of(&self, load: &Load) -> Dual {
        let number = *(self.field)(&mut load.clone());
        if self.unit == LoadUnit::Factor { number - Dual::ONE } else { number }
    }

    /// Returns a load without effects, except that the parameter differs by `size` from its null (the value without effect).
    pub fn alone(&self, size: f64) -> Load {
        let mut load = Load::COMMANDED;
        *(self.field)(&mut load) = if self.unit == LoadUnit::Factor { (1.0 + size).into() } else { size.into() };
        load
    }
}

impl Load {
    /// Load without any effect. The force acts as commanded.
    pub const COMMANDED: Self = Self {
        delay_s: Dual::ZERO,
        positive_factor: Dual::ONE,
        negative_factor: Dual::ONE,
        offset_n: Dual::ZERO,
        lag_time_s: Dual::ZERO,
        gradient_per_m: Dual::ZERO,
    };

    /// Returns `true` if the force acts as commanded and no parameter of the load carries a derivative.
    pub fn is_commanded(&self) -> bool {
        self.numbers().iter().zip(Self::COMMANDED.numbers()).all(|(number, null)| number.is_constant(null.value))
    }

    /// Converts the load to another number type.
    pub fn of<N: PointScalar>(&self) -> Load<N> {
        Load::of_numbers(self.numbers().map(N::from_dual))
    }

    /// Returns the load for commands that are `factor` times as large. Its offset is also multiplied by `factor`.
    pub fn for_scaled_commands(&self, factor: f64) -> Self {
        Self { offset_n: self.offset_n * factor, ..self.clone() }
    }

    /// Returns the load for positions in another unit, whose length is `unit` in m.
    pub fn in_position_unit(&self, unit: f64) -> Self {
        Self { gradient_per_m: self.gradient_per_m * unit, ..self.clone() }
    }

    /// Checks that delay and lag are at least 0.
    ///
    /// # Errors
    /// [`Error::Numerical`] names the time that is negative or not a number.
    pub fn check(&self) -> Result<()> {
        for (what, number) in [("the force's delay", self.delay_s), ("the force's lag", self.lag_time_s)] {
            if number.value.is_nan() || number.value < 0.0 {
                return Err(Error::numerical(format!("{what} is {} s", number.value), "give a value of at least 0"));
            }
        }
        Ok(())
    }

    /// Checks that dual numbers can compute the derivative of the response. They cannot compute the derivative with respect to a
    /// lag time of 0.
    ///
    /// # Errors
    /// [`Error::Numerical`] if the lag time is 0 and its derivative is not 0.
    pub fn check_derivative(&self) -> Result<()> {
        if self.lag_time_s.value == 0.0 && self.lag_time_s.derivative != 0.0 {
            return Err(Error::numerical(
                "the derivative with respect to the lag time cannot be computed at a lag time of 0",
                "compute the derivative as a finite difference from 0",
            ));
        }
        Ok(())
    }
}

/// Number of parameters of a load.
pub const N_LOAD_PARAMETERS: usize = 6;

impl<N: Scalar> Load<N> {
    /// Returns the parameters of the load as one list, in the order of [`Self::of_numbers`].
    pub fn numbers(&self) -> [N; N_LOAD_PARAMETERS] {
        let Self { delay_s, positive_factor, negative_factor, offset_n, lag_time_s, gradient_per_m } = self;
        [delay_s, positive_factor, negative_factor, offset_n, lag_time_s, gradient_per_m].map(|number| *number)
    }

    /// Builds a load from its parameters in the order of [`Self::numbers`].
    pub fn of_numbers(
        [delay_s, positive_factor, negative_factor, offset_n, lag_time_s, gradient_per_m]: [N; N_LOAD_PARAMETERS],
    ) -> Self {
        Self { delay_s, positive_factor, negative_factor, offset_n, lag_time_s, gradient_per_m }
    }

    /// Returns a commanded force (N), or its slope (N/s), times the factor for its sign. The offset is not added.
    pub fn scaled(&self, commanded: f64, is_positive: bool) -> N {
        (if is_positive { self.positive_factor } else { self.negative_factor }) * commanded
    }

    /// Returns the force (N) that enters the lag for a commanded force (N): the command times the factor for its sign, plus the
    /// offset.
    pub fn entering_n(&self, commanded_n: f64, is_positive: bool) -> N {
        self.scaled(commanded_n, is_positive) + self.offset_n
    }

    /// Force (N) that enters the lag from the record's start until the first command acts.
    pub fn start_n(&self) -> N {
        self.offset_n
    }

    /// Time (s) at which a command given at `commanded_s` acts.
    pub fn action_time_s(&self, commanded_s: f64) -> N {
        self.delay_s + N::constant(commanded_s)
    }

    /// Time (s) at which the command was given that acts at the time `at_s`.
    pub fn command_time_s(&self, at_s: f64) -> N {
        N::constant(at_s) + -self.delay_s
    }

    /// Returns the acting force (N) on a robot at `position_m`. `force_n` is the force after the lag.
    #[inline(always)]
    pub fn acting_n(&self, force_n: N, position_m: N) -> N {
        force_n * (self.gradient_per_m * position_m).exp()
    }

    /// Returns the derivative (N/m) of the acting force with respect to the robot's position. `acting_n` is the acting force (N).
    #[inline(always)]
    pub fn acting_slope(&self, acting_n: N) -> N {
        acting_n * self.gradient_per_m
    }
}

impl<N: PointScalar> Load<N> {
    /// Returns `true` if commands act later than they are given.
    pub fn is_delayed(&self) -> bool {
        !self.delay_s.is_constant(0.0)
    }

    /// Returns `true` if the acting force lags behind the force that enters the lag.
    pub fn has_lag(&self) -> bool {
        self.lag_time_s.value() > 0.0
    }

    /// Returns `true` if the force depends on the robot's position.
    pub fn depends_on_position(&self) -> bool {
        !self.gradient_per_m.is_constant(0.0)
    }

    /// Returns `true` if the force changes only at the rows of the record, which is so without delay, lag and gradient.
    pub fn acts_at_rows(&self) -> bool {
        !self.is_delayed() && self.lag_time_s.value() == 0.0 && !self.depends_on_position()
    }

    /// Time scale (s) of the force's fastest change between switches, which is the lag time; infinite without a lag.
    pub fn fastest_s(&self) -> f64 {
        if self.has_lag() { self.lag_time_s.value() } else { f64::INFINITY }
    }

    /// Largest force (N) that can act on a robot at position 0 if no command exceeds `commanded_n` (N).
    pub fn largest_n(&self, commanded_n: f64) -> f64 {
        let factor = self.positive_factor.value().abs().max(self.negative_factor.value().abs());
        commanded_n * factor + self.offset_n.value().abs()
    }

    /// Returns all changes of the force that enters the lag, in the order of the rows. The first is the start of the offset, at
    /// the record's start.
    pub fn switches(&self, time_s: &[f64], force: Force<'_>) -> Vec<Switch<N>> {
        let Some(&start_s) = time_s.first() else { return Vec::new() };
        let mut switches = vec![Switch::to(N::constant(start_s), self.start_n())];
        let (mut commanded_n, mut slope_before, mut sign_before) = (0.0, 0.0, None);
        for (row, (&row_s, &force_n)) in time_s.iter().zip(force.at_rows_n).enumerate() {
            let slope = force.slope_n_per_s(time_s, row);
            let jumps = force_n != commanded_n && (row == 0 || !force.is_linear());
            commanded_n = force_n;
            // A line that passes through zero at a row keeps its slope, but the factor of the other direction applies from there on.
            let is_positive = force.is_positive(row);
            let keeps_sign = sign_before.is_none_or(|before| before == is_positive);
            if !jumps && slope == slope_before && keeps_sign {
                continue;
            }
            (slope_before, sign_before) = (slope, Some(is_positive));
            switches.push(Switch {
                time_s: self.action_time_s(row_s),
                force_n: self.entering_n(force_n, is_positive),
                slope_n_per_s: self.scaled(slope, is_positive),
                jumps,
            });
        }
        switches
    }

    /// Decay rate 1/τ of the lag's transient, in 1/s; `None` without a lag.
    pub fn lag_rate_per_s(&self) -> Option<N> {
        self.has_lag().then(|| N::constant(1.0) / self.lag_time_s)
    }

    /// Length of a step (s), divided by the lag time; `None` without a lag.
    pub fn lag_times_in(&self, step_s: f64) -> Option<f64> {
        self.has_lag().then(|| step_s / self.lag_time_s.value())
    }

    /// Returns the force (N) after the lag, without the lag's decaying transient. This force is the straight line of the switch,
    /// delayed by the lag time.
    #[inline(always)]
    pub fn steady_lagged_n(&self, input: &Switch<N>, time_s: N) -> N {
        input.input_n(time_s) - input.slope_n_per_s * self.lag_time_s
    }

    /// Returns the force (N) after the lag at a time (s) after a switch. At the switch this force is `lagged_n`.
    #[inline(always)]
    pub fn after_lag_n(&self, input: &Switch<N>, lagged_n: N, time_s: N) -> N {
        if self.lag_time_s.value() == 0.0 {
            return input.input_n(time_s);
        }
        let left_n = lagged_n - self.steady_lagged_n(input, input.time_s);
        self.steady_lagged_n(input, time_s) + left_n * (-(time_s - input.time_s) / self.lag_time_s).exp()
    }

    /// Returns the force (N) after the lag at an implicit stage of a Runge–Kutta method, and its rate k (N/s). The rate solves τ
    /// k = F_in − (F₀ + F₁ + h k), with the lag time τ and the entering force F_in = `input_n`. F₀ = `start_n` is the force at
    /// the start of the step, F₁ = `earlier_n` its change by the earlier stages, and h = `implicit_s` the stage's implicit step.
    pub fn at_implicit_stage(&self, input_n: N, start_n: N, earlier_n: N, implicit_s: f64) -> (N, N) {
        let rate = (input_n - start_n - earlier_n) / (self.lag_time_s + N::constant(implicit_s));
        (if self.has_lag() { start_n + earlier_n + rate * implicit_s } else { input_n }, rate)
    }

    /// Returns the lagged signal at the end of a time step of `step_s`. Its input changes linearly from `from` to `to`. `lagged`
    /// is the lagged signal at the start.
    pub fn lagged_along(&self, lagged: N, from: N, to: N, step_s: f64) -> N {
        let behind = (to + -from) * self.lag_time_s * (1.0 / step_s);
        let left = (N::constant(-step_s) / self.lag_time_s).exp();
        to + -behind + (lagged + -from + behind) * left
    }

    /// Returns the exponent g x of the force gradient g at a position x (m). Its size must be below [`MAX_GRADIENT_EXPONENT`].
    fn exponent(&self, position_m: f64) -> f64 {
        self.gradient_per_m.value() * position_m
    }

    /// Checks that the force does not diverge at any of the positions (m).
    ///
    /// # Errors
    /// [`Error::Numerical`] if the exponent of the gradient reaches [`MAX_GRADIENT_EXPONENT`] or is not a number.
    pub fn check_feedback(&self, position_m: &[f64], time_s: f64) -> Result<()> {
        if self.gradient_per_m.value() == 0.0 {
            return Ok(());
        }
        // A position is NaN if the solver found no balance of forces.
        if position_m.iter().all(|x| self.exponent(*x).abs() < MAX_GRADIENT_EXPONENT) {
            return Ok(());
        }
        Err(Error::numerical(
            format!(
                "the force's gradient pulls the robot away at {time_s} s: the force grows faster than the gel's resistance"
            ),
            "use a gradient closer to 0, or a stiffer gel",
        ))
    }

    /// Returns the largest exponent of the force gradient, divided by the creep compliance, in Pa. The exponent is the gradient
    /// times the displacement. `compliance_per_m` is the displacement per force at unit creep compliance, and `largest_n` the
    /// largest force (N).
    pub fn feedback_strength_pa(&self, compliance_per_m: f64, largest_n: f64) -> f64 {
        (self.gradient_per_m.value() * compliance_per_m).abs() * largest_n
    }
}

impl Load<f64> {
    /// Returns the lagged force (N) at the end of a time step of constant input, and its mean (N) over the step. `begin_n` is the
    /// lagged force at the start, and `entering_n` the input.
    pub fn lagged_of_hold(&self, begin_n: f64, entering_n: f64, step_s: f64) -> [f64; 2] {
        let rate = step_s / self.lag_time_s;
        let end_n = entering_n + (begin_n - entering_n) * (-rate).exp();
        let mean_n = if rate == 0.0 { begin_n } else { entering_n + (begin_n - entering_n) * -(-rate).exp_m1() / rate };
        [end_n, mean_n]
    }

    /// Returns the acting force (N) on a robot whose position is `history_m` plus `per_n` (m/N) times the acting force. `force_n`
    /// is the force after the lag. The result is NaN if no force solves the balance.
    pub fn balanced_n(&self, force_n: f64, history_m: f64, per_n: f64) -> f64 {
        let g = self.gradient_per_m;
        force_n * balanced_exponent(g * history_m, g * force_n * per_n).exp()
    }

    /// Returns a phrase that names the force gradient in messages; empty without a gradient.
    pub fn describe_gradient(&self) -> String {
        if self.gradient_per_m == 0.0 {
            return String::new();
        }
        format!(" under a force gradient of {} per m", self.gradient_per_m)
    }

    /// Returns the error for a position that is not finite under this load.
    pub fn divergence_error(&self) -> Error {
        let gradient = self.gradient_per_m;
        if gradient == 0.0 {
            return Error::numerical("the position is not finite", "use rates and times that the record resolves");
        }
        Error::numerical(
            format!(
                "a force gradient of {gradient:e} per m pulls the robot away: the force grows faster than the gel's resistance"
            ),
            "use a gradient closer to 0, or a stiffer gel",
        )
    }
}

/// Returns the solution y of y = a + b e^y on the branch that starts at y = a for b = 0. The result is NaN if there is no
/// solution, because the force diverges. y is the exponent of the force gradient.
pub fn balanced_exponent(a: f64, b: f64) -> f64 {
    let mut y = a;
    for _ in 0..MAX_NEWTON_STEPS {
        let grown = b * y.exp();
        let step = (a + grown - y) / (1.0 - grown);
        y += step;
        if step.abs() <= 1e-15 * (1.0 + y.abs()) {
            return if grown < 1.0 { y } else { f64::NAN };
        }
    }
    f64::NAN
}

#[cfg(test)]
mod tests {
    use record::ForceRule;

    use super::*;

    /// A triangular wave with a row exactly at zero: the slope of the command stays equal there, and the factor changes.
    #[test]
    fn a_line_through_zero_switches_the_factor() {
        let load = Load {
            delay_s: 0.0,
            positive_factor: 1.2,
            negative_factor: 1.0,
            offset_n: 0.0,
            lag_time_s: 0.0,
            gradient_per_m: 0.0,
        };
        let force = Force { at_rows_n: &[-1.0, 0.0, 1.0, 0.0], rule: ForceRule::Linear };
        let slopes: Vec<(f64, f64)> = load.switches(&[0.0, 1.0, 2.0, 3.0], force)[1..]
            .iter()
            .map(|switch| (switch.time_s, switch.slope_n_per_s))
            .collect();
        assert_eq!(slopes, [(0.0, 1.0), (1.0, 1.2), (2.0, -1.2), (3.0, 0.0)]);
    }
}
