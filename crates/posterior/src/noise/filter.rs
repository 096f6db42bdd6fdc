//! Kalman filter whose state is the Ornstein–Uhlenbeck process, the gain and the offset.
//!
//! The state (u, g, o) holds the process u, the gain g and the offset o, with indices 0, 1, 2. A position x observes it through the row vector h = (1, x, 1). P = U D
//! Uᵀ is the state's covariance divided by the variance σ² of the white noise. U is unit upper triangular and D diagonal. The process comes first because D₀ occurs
//! only in P₀₀. A time step thus changes only D₀, U₀₁ and U₀₂. Terms that a model lacks are left out at compile time.

use pulp::{Scalar, Simd};

use super::lanes::Register;

/// Prior variances of gain and offset at the beginning of a cycle, divided by the variance of the white noise. This gives 1/m² for the gain.
#[derive(Debug, Clone, Copy)]
pub(super) struct PriorVariances<S: Simd> {
    pub gain: Register<S>,
    pub offset: Register<S>,
}

/// Covariance of the filter's state, given all earlier observations, divided by the variance of the white noise.
#[derive(Debug, Clone, Copy)]
pub(super) struct Covariance<S: Simd, const OU: bool, const GAIN: bool> {
    one: Register<S>,
    d: [Register<S>; 3],
    u01: Register<S>,
    u02: Register<S>,
    u12: Register<S>,
}

/// Correction of the state's mean by an observation. S is the predictive variance of the observed position, and σ² the variance of the white noise. The module's
/// documentation defines h and P.
#[derive(Debug, Clone, Copy)]
pub(super) struct Gain<S: Simd> {
    /// Part of the predictive variance S that is not white noise, divided by the white variance σ²: S/σ² − 1 = h P hᵀ.
    pub excess: Register<S>,
    /// Inverse σ²/S of the predictive variance, in units of the white variance.
    pub precision: Register<S>,
    /// Direction P hᵀ of the correction. Divided by S/σ², it is the Kalman gain.
    direction: [Register<S>; 3],
}

/// A [`Gain`] as plain floating-point values. One covariance thus provides the gain for the means of many columns.
#[derive(Debug, Clone, Copy)]
pub(super) struct GainNumbers {
    /// Inverse σ²/S of the predictive variance S, in units of the white variance σ².
    pub precision: f64,
    direction: [f64; 3],
}

impl Gain<Scalar> {
    pub fn numbers(&self) -> GainNumbers {
        GainNumbers { precision: self.precision.number(), direction: self.direction.map(Register::number) }
    }
}

impl GainNumbers {
    /// Copies the gain into every lane of a register. The field `excess` is 0, because the correction of a mean does not use it.
    #[inline(always)]
    pub fn splat<S: Simd>(&self, simd: S) -> Gain<S> {
        let [u, g, o] = self.direction;
        Gain {
            excess: Register::splat(simd, 0.0),
            precision: Register::splat(simd, self.precision),
            direction: [Register::splat(simd, u), Register::splat(simd, g), Register::splat(simd, o)],
        }
    }
}

impl<S: Simd, const OU: bool, const GAIN: bool> Covariance<S, OU, GAIN> {
    #[inline(always)]
    pub fn zero(simd: S) -> Self {
        let zero = Register::splat(simd, 0.0);
        Self { one: Register::splat(simd, 1.0), d: [zero; 3], u01: zero, u02: zero, u12: zero }
    }

    /// Advances the covariance by a time step. `decay` is the factor on the process, and `gained` is the variance that the process gains, divided by the variance of
    /// the white noise.
    #[inline(always)]
    pub fn advance(&mut self, decay: Register<S>, gained: Register<S>) {
        if OU {
            self.d[0] = self.d[0].mul_add(decay * decay, gained);
            if GAIN {
                self.u01 = self.u01 * decay;
                self.u02 = self.u02 * decay;
            }
        }
    }

    /// Begins a cycle: gain and offset get their prior variances, and the process continues.
    #[inline(always)]
    pub fn renew(&mut self, prior: PriorVariances<S>) {
        if GAIN {
            let zero = self.one.zero();
            if OU {
                let through_gain = (self.u01 * self.u01).mul_add(self.d[1], self.d[0]);
                self.d[0] = (self.u02 * self.u02).mul_add(self.d[2], through_gain);
            }
            self.d[1] = prior.gain;
            self.d[2] = prior.offset;
            (self.u01, self.u02, self.u12) = (zero, zero, zero);
        }
    }

    /// Updates the covariance by an observation at predicted position `x` (m), and returns the gain.
    #[inline(always)]
    pub fn observe(&mut self, x: Register<S>) -> Gain<S> {
        let one = self.one;
        let zero = one.zero();
        // Here f = Uᵀh and v = D f, and α accumulates the predictive variance, component by component.
        let v0 = if OU { self.d[0] } else { zero };
        let mut gain = Gain { excess: v0, precision: one, direction: [v0, zero, zero] };
        let mut alpha = one;
        if OU {
            alpha = one + v0;
            if !GAIN {
                gain.precision = one / alpha;
                self.d[0] = v0 * gain.precision;
            }
        }
        if GAIN {
            let f1 = if OU { x + self.u01 } else { x };
            let f2 = if OU { self.u12.mul_add(x, one + self.u02) } else { self.u12.mul_add(x, one) };
            let (v1, v2) = (self.d[1] * f1, self.d[2] * f2);
            let with_gain = f1.mul_add(v1, alpha);
            let with_offset = f2.mul_add(v2, with_gain);
            // One division replaces three, because divisions are slow. Ratios of variances are below 10¹⁰⁰, so that the product of three ratios is finite.
            let first_two = alpha * with_gain;
            let inverse = one / (first_two * with_offset);
            let (precision_1, precision_2) = (inverse * (alpha * with_offset), inverse * first_two);
            if OU {
                gain.precision = inverse * (with_gain * with_offset);
                self.d[0] = v0 * gain.precision;
            }
            self.d[1] = self.d[1] * alpha * precision_1;
            self.d[2] = self.d[2] * with_gain * precision_2;
            if OU {
                let (u01, u02) = (self.u01, self.u02);
                let first = f1 * gain.precision;
                self.u01 = u01 - first * v0;
                let b0 = u01.mul_add(v1, v0);
                self.u02 = u02 - f2 * precision_1 * b0;
                gain.direction[0] = u02.mul_add(v2, b0);
            }
            let u12 = self.u12;
            self.u12 = u12 - f2 * precision_1 * v1;
            gain.direction[1] = u12.mul_add(v2, v1);
            gain.direction[2] = v2;
            gain.excess = f2.mul_add(v2, f1.mul_add(v1, v0));
            gain.precision = precision_2;
        }
        gain
    }
}

/// Mean of the state, given all earlier observations. Process and offset are in m.
#[derive(Debug, Clone, Copy)]
pub(super) struct Mean<S: Simd, const OU: bool, const GAIN: bool> {
    state: [Register<S>; 3],
}

impl<S: Simd, const OU: bool, const GAIN: bool> Mean<S, OU, GAIN> {
    #[inline(always)]
    pub fn zero(simd: S) -> Self {
        Self { state: [Register::splat(simd, 0.0); 3] }
    }

    /// Creates the state's mean with a given process (m), and with gain and offset 0.
    #[inline(always)]
    pub fn of_process(process: Register<S>) -> Self {
        Self { state: [process, process.zero(), process.zero()] }
    }

    /// Mean of the Ornstein–Uhlenbeck process (m), the first component of the state.
    #[inline(always)]
    pub fn process(&self) -> Register<S> {
        self.state[0]
    }

    /// Loads register `index` of the mean from arrays of lanes, one array per component of the state.
    #[inline(always)]
    pub fn load<const W: usize>(simd: S, lanes: &[[f64; W]; 3], index: usize) -> Self {
        let part = |part: usize| Register::load(simd, &lanes[part], index);
        Self { state: [part(0), part(1), part(2)] }
    }

    /// Stores the mean into register `index` of arrays of lanes, one array per component of the state.
    #[inline(always)]
    pub fn store<const W: usize>(&self, lanes: &mut [[f64; W]; 3], index: usize) {
        self.state[0].store(&mut lanes[0], index);
        self.state[1].store(&mut lanes[1], index);
        self.state[2].store(&mut lanes[2], index);
    }

    /// Advances the mean by a time step: the process is multiplied by `decay`.
    #[inline(always)]
    pub fn advance(&mut self, decay: Register<S>) {
        if OU {
            self.state[0] = self.state[0] * decay;
        }
    }

    /// Begins a cycle: the means of gain and offset become 0.
    #[inline(always)]
    pub fn renew(&mut self) {
        if GAIN {
            let zero = self.state[1].zero();
            (self.state[1], self.state[2]) = (zero, zero);
        }
    }

    /// Innovation (m): `residual` minus its prediction by the state. `residual` is the observed position minus the predicted position `x` (m).
    #[inline(always)]
    pub fn innovation(&self, residual: Register<S>, x: Register<S>) -> Register<S> {
        match (OU, GAIN) {
            (true, true) => residual - self.state[1].mul_add(x, self.state[0] + self.state[2]),
            (true, false) => residual - self.state[0],
            (false, true) => residual - self.state[1].mul_add(x, self.state[2]),
            (false, false) => residual,
        }
    }

    /// Corrects the state's mean by the gain's direction times `innovation`. This is the innovation divided by the predictive variance in units of the white variance.
    #[inline(always)]
    pub fn correct(&mut self, gain: &Gain<S>, innovation: Register<S>) {
        if OU {
            self.state[0] = gain.direction[0].mul_add(innovation, self.state[0]);
        }
        if GAIN {
            self.state[1] = gain.direction[1].mul_add(innovation, self.state[1]);
            self.state[2] = gain.direction[2].mul_add(innovation, self.state[2]);
        }
    }
}
