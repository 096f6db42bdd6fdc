//! Transformation of the robot's position into the recorded position, with all equations of the observation (physics §5).

use base::number::{Dual, PointScalar, Scalar};

/// Transformation of the robot's position x into the recorded position scale · x^{1/p} + b + v t + Σ A (1 − e^{−t/τ}), with t the
/// time since the record's start. The fields name the other symbols. For an indenter (p ≠ 1), x^{1/p} is 0 if x < 0.
#[derive(Debug, Clone, PartialEq)]
pub struct Observation<N = Dual> {
    /// Factor of the robot's position.
    pub scale: N,
    /// Offset b of the recorded position, in m.
    pub offset_m: N,
    /// Exponent p of an indenter, whose depth is x^{1/p} in m for a linear response x in m^p. It is 1 if x itself is the
    /// position.
    pub depth_exponent: N,
    /// Drift velocity v in m/s.
    pub velocity_m_per_s: N,
    /// Drifts A (1 − e^{−t/τ}), each with a limit A and a time constant τ.
    pub approaches: Vec<DriftApproach<N>>,
}

/// Drift A (1 − e^{−t/τ}) of the recorded position towards a limit A, with t the time since the record's start.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DriftApproach<N = Dual> {
    /// Limit A of the drift, in m.
    pub amplitude_m: N,
    /// Time constant τ > 0 in s.
    pub time_s: N,
}

impl Observation {
    /// Observation without any effect. The recorded position is the robot's position.
    pub const IDENTITY: Self = Self {
        scale: Dual::ONE,
        offset_m: Dual::ZERO,
        depth_exponent: Dual::ONE,
        velocity_m_per_s: Dual::ZERO,
        approaches: Vec::new(),
    };

    /// Converts the observation to another number type.
    pub fn of<N: PointScalar>(&self) -> Observation<N> {
        let mut numbers = self.numbers().into_iter().map(N::from_dual);
        Observation::of_numbers(self.approaches.len(), || numbers.next().unwrap_or(N::constant(0.0)))
    }

    /// Returns `true` if the recorded position differs from the robot's position or depth.
    pub fn is_changed(&self) -> bool {
        !(self.scale.is_constant(1.0)
            && self.offset_m.is_constant(0.0)
            && self.velocity_m_per_s.is_constant(0.0)
            && self.approaches.is_empty())
    }

    /// Returns `true` if the position is an indenter's depth, which is a root of the linear response.
    pub fn is_depth(&self) -> bool {
        self.depth_exponent.value != 1.0
    }
}

impl<N: Scalar> Observation<N> {
    /// Returns all parameters of the observation as one list, in the order of [`Self::of_numbers`].
    pub fn numbers(&self) -> Vec<N> {
        let Self { scale, offset_m, depth_exponent, velocity_m_per_s, approaches } = self;
        let of_approaches = approaches.iter().flat_map(|approach| [approach.amplitude_m, approach.time_s]);
        [*scale, *offset_m, *depth_exponent, *velocity_m_per_s].into_iter().chain(of_approaches).collect()
    }

    /// Builds an observation from its parameters in the order of [`Self::numbers`]. `n_approaches` is the number of drifts A (1 −
    /// e^{−t/τ}).
    pub fn of_numbers(n_approaches: usize, mut next: impl FnMut() -> N) -> Self {
        Self {
            scale: next(),
            offset_m: next(),
            depth_exponent: next(),
            velocity_m_per_s: next(),
            approaches: (0..n_approaches).map(|_| DriftApproach { amplitude_m: next(), time_s: next() }).collect(),
        }
    }

    /// Returns the recorded position (m) without the drifts A (1 − e^{−t/τ}). `position_m` is the robot's position or depth,
    /// `time_s` the time after the record's start.
    #[inline(always)]
    pub fn without_approaches_m(&self, position_m: N, time_s: f64) -> N {
        self.scale * position_m + self.offset_m + self.velocity_m_per_s * time_s
    }
}

impl<N: PointScalar> Observation<N> {
    /// Returns the depth x^{1/p} of an indenter for the exponent p and the linear response x. It is 0 for x ≤ 0, and NaN for NaN.
    pub fn depth_m(depth_exponent: N, x: N) -> N {
        if x.value() <= 0.0 { N::constant(0.0) } else { x.pow(N::constant(1.0) / depth_exponent) }
    }
}

impl Observation<f64> {
    /// Returns the recorded position (m) for the robot's position (m), at `time_s` after the record's start.
    pub fn recorded_m(&self, position_m: f64, time_s: f64) -> f64 {
        let depth_m =
            if self.depth_exponent == 1.0 { position_m } else { Self::depth_m(self.depth_exponent, position_m) };
        let approach = |a: &DriftApproach<f64>| -a.amplitude_m * (-time_s / a.time_s).exp_m1();
        self.without_approaches_m(depth_m, time_s) + self.approaches.iter().map(approach).sum::<f64>()
    }
}

impl<N: Scalar> DriftApproach<N> {
    /// Returns the factor e^{−h/τ} by which the drift's distance from its limit shrinks in a time step h (s).
    pub fn remaining_after(&self, step_s: f64) -> N {
        (N::constant(1.0) / self.time_s * -step_s).exp()
    }

    /// Returns the drift (m) whose distance from its limit is the fraction `left` of the limit.
    pub fn drift_m(&self, left: N) -> N {
        self.amplitude_m * (N::constant(1.0) - left)
    }
}
