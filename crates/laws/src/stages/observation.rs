//! From the robot's to the recorded position: the only place where the observation's equations stand (physics §5).

use base::number::{Dual, PointScalar, Scalar};

/// From the robot's to the recorded position: scale · x^{1/p} + b + v t + Σ A (1 − e^{−t/τ}), t from the record's start; where x < 0 an indenter (p ≠ 1) is at 0.
#[derive(Debug, Clone, PartialEq)]
pub struct Observation<N = Dual> {
    /// Factor of the position.
    pub scale: N,
    /// b in m.
    pub offset_m: N,
    /// p of an indenter, whose depth in m is x^{1/p}, x in m^p; 1 where the position is x itself.
    pub depth_exponent: N,
    /// v in m/s.
    pub velocity_m_per_s: N,
    /// Drifts that come to an end.
    pub approaches: Vec<Approach<N>>,
}

/// A (1 − e^{−t/τ}).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Approach<N = Dual> {
    /// A in m.
    pub amplitude_m: N,
    /// τ > 0 in s.
    pub time_s: N,
}

impl Observation {
    /// The position is recorded as it is.
    pub const AS_IT_IS: Self = Self {
        scale: Dual::ONE,
        offset_m: Dual::ZERO,
        depth_exponent: Dual::ONE,
        velocity_m_per_s: Dual::ZERO,
        approaches: Vec::new(),
    };

    /// The same in another number.
    pub fn of<N: PointScalar>(&self) -> Observation<N> {
        let mut numbers = self.numbers().into_iter().map(N::of);
        Observation::of_numbers(self.approaches.len(), || numbers.next().unwrap_or(N::constant(0.0)))
    }

    /// Whether, depths apart, the recorded position differs from the robot's.
    pub fn is_changed(&self) -> bool {
        !(self.scale.is_constant(1.0)
            && self.offset_m.is_constant(0.0)
            && self.velocity_m_per_s.is_constant(0.0)
            && self.approaches.is_empty())
    }

    /// Whether the position is a root of what answers linearly.
    pub fn is_rooted(&self) -> bool {
        self.depth_exponent.value != 1.0
    }
}

impl<N: Scalar> Observation<N> {
    /// Its numbers, in the order in which [`Self::of_numbers`] takes them.
    pub fn numbers(&self) -> Vec<N> {
        let Self { scale, offset_m, depth_exponent, velocity_m_per_s, approaches } = self;
        let of_approaches = approaches.iter().flat_map(|approach| [approach.amplitude_m, approach.time_s]);
        [*scale, *offset_m, *depth_exponent, *velocity_m_per_s].into_iter().chain(of_approaches).collect()
    }

    /// The observation of [`Self::numbers`], with so many approaches.
    pub fn of_numbers(n_approaches: usize, mut next: impl FnMut() -> N) -> Self {
        Self {
            scale: next(),
            offset_m: next(),
            depth_exponent: next(),
            velocity_m_per_s: next(),
            approaches: (0..n_approaches).map(|_| Approach { amplitude_m: next(), time_s: next() }).collect(),
        }
    }

    /// The recorded position (m) for a depth or position (m) at a time (s) since the record's start, without approaches.
    #[inline(always)]
    pub fn straight_m(&self, position_m: N, time_s: f64) -> N {
        self.scale * position_m + self.offset_m + self.velocity_m_per_s * time_s
    }
}

impl<N: PointScalar> Observation<N> {
    /// x^{1/p} of an indenter, given p and x; none before contact. What is not a number passes.
    pub fn depth_m(depth_exponent: N, x: N) -> N {
        if x.value() <= 0.0 { N::constant(0.0) } else { x.pow(N::constant(1.0) / depth_exponent) }
    }
}

impl Observation<f64> {
    /// The recorded position (m) for the robot's, `time_s` after the record's start.
    pub fn recorded_m(&self, position_m: f64, time_s: f64) -> f64 {
        let depth_m =
            if self.depth_exponent == 1.0 { position_m } else { Self::depth_m(self.depth_exponent, position_m) };
        let approach = |a: &Approach<f64>| -a.amplitude_m * (-time_s / a.time_s).exp_m1();
        self.straight_m(depth_m, time_s) + self.approaches.iter().map(approach).sum::<f64>()
    }
}

impl<N: Scalar> Approach<N> {
    /// Share of the amplitude that is left after a step (s), of what was left before.
    pub fn left_after(&self, step_s: f64) -> N {
        (N::constant(1.0) / self.time_s * -step_s).exp()
    }

    /// How far (m) the position has come where a share of the amplitude is left.
    pub fn passed_m(&self, left: N) -> N {
        self.amplitude_m * (N::constant(1.0) - left)
    }
}
