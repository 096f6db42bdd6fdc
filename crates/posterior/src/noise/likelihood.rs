//! Log likelihood of a record under a noise model, for one or several parameter points at once.

use std::borrow::Borrow;

use pulp::{Arch, Scalar, Simd, WithSimd};

use super::NoiseModel;
use super::filter::{Covariance, Mean, PriorVariances};
use super::lanes::{LANES, Product, Products, Register};
use super::rows::NoiseRows;
use super::scales::FilterScales;
use super::terms::{Equations, MOST_PARAMETERS};

/// A record prepared for the likelihood of its observed positions under a noise model.
#[derive(Debug, Clone)]
pub struct NoiseLikelihood {
    pub(super) model: NoiseModel,
    pub(super) rows: NoiseRows,
    /// Observed position (m) of each row with an observation.
    pub(super) observed_m: Vec<f64>,
}

impl NoiseLikelihood {
    /// Prepares a record. Times (s) must increase strictly. `cycle` holds the cycle number of each row, and a cycle's rows are consecutive. `observed_m` holds
    /// positions (m), or `None` at rows without one. All slices have one entry per row.
    pub fn new(model: NoiseModel, time_s: &[f64], cycle: &[u32], observed_m: &[Option<f64>]) -> Self {
        let visited: Vec<usize> = (0..observed_m.len()).filter(|row| observed_m[*row].is_some()).collect();
        let rows = NoiseRows::new(time_s, cycle, &visited);
        Self { model, rows, observed_m: observed_m.iter().copied().flatten().collect() }
    }

    /// Replaces the observed positions (m): one entry per row of the record, `None` at rows that had no observation. This is cheaper than [`NoiseLikelihood::new`],
    /// which must also find equal time steps.
    pub fn with_observed(&self, observed_m: &[Option<f64>]) -> Self {
        let observed = |row: &super::rows::NoiseRow| observed_m[row.index].unwrap_or(f64::NAN);
        let observed_m = self.rows.rows.iter().map(observed).collect();
        Self { model: self.model, rows: self.rows.clone(), observed_m }
    }

    /// Returns the noise model of the likelihood.
    pub fn model(&self) -> NoiseModel {
        self.model
    }

    /// Number of observed positions that the likelihood compares with the model.
    pub fn n_observed(&self) -> usize {
        self.observed_m.len()
    }

    /// Log likelihood of one parameter point, in nats for positions in m. `position_m` holds the predicted position at every row of the record. `parameters` holds the
    /// noise parameters in their units, in the order of [`NoiseModel::parameters`]. The result is −∞ for parameters outside their support and NaN for NaN positions.
    pub fn ln_likelihood(&self, position_m: &[f64], parameters: &[f64]) -> f64 {
        let scales = self.model.scales(parameters);
        let mut out = [0.0];
        self.evaluate::<_, [f64; 1], 1>(Scalars, position_m.as_chunks().0, &[scales], &mut out);
        out[0]
    }

    /// Log likelihoods of several parameter points with one common trajectory. The noise parameters are `parameters[parameter][lane]`; the number of lanes is a
    /// multiple of [`LANES`].
    pub fn ln_likelihood_shared<const W: usize>(
        &self,
        position_m: &[SharedPosition],
        parameters: &[[f64; W]],
        out: &mut [f64; W],
    ) {
        self.evaluate(Vectors, position_m, &self.scales(parameters), out);
    }

    /// Log likelihoods of several parameter points, one per lane. Predicted positions (m) are `position_m[row][lane]`, and noise parameters are
    /// `parameters[parameter][lane]`. A lane's result is bitwise independent of the other lanes. It may differ from [`NoiseLikelihood::ln_likelihood`] by rounding.
    pub fn ln_likelihood_lanes<R: Borrow<[f64; LANES]>>(
        &self,
        position_m: &[R],
        parameters: &[[f64; LANES]],
        out: &mut [f64; LANES],
    ) {
        self.evaluate(Vectors, position_m, &self.scales(parameters), out);
    }

    pub(super) fn scales<const W: usize>(&self, parameters: &[[f64; W]]) -> [Option<FilterScales>; W] {
        std::array::from_fn(|lane| {
            let mut values = [0.0; MOST_PARAMETERS];
            for (value, lanes) in values.iter_mut().zip(parameters) {
                *value = lanes[lane];
            }
            self.model.scales(&values[..parameters.len().min(values.len())])
        })
    }

    fn evaluate<M: Machine, R: PositionRow<W>, const W: usize>(
        &self,
        machine: M,
        position_m: &[R],
        scales: &[Option<FilterScales>; W],
        out: &mut [f64; W],
    ) {
        let inside = scales.map(|scales| scales.unwrap_or(FilterScales::UNIT));
        let Equations { process, cycles, heavy_tails } = self.model.equations();
        let sums = match (process, cycles, heavy_tails) {
            (false, false, false) => self.pass::<M, R, W, false, false, false>(machine, position_m, &inside),
            (false, false, true) => self.pass::<M, R, W, false, false, true>(machine, position_m, &inside),
            (false, true, false) => self.pass::<M, R, W, false, true, false>(machine, position_m, &inside),
            (false, true, true) => self.pass::<M, R, W, false, true, true>(machine, position_m, &inside),
            (true, false, false) => self.pass::<M, R, W, true, false, false>(machine, position_m, &inside),
            (true, false, true) => self.pass::<M, R, W, true, false, true>(machine, position_m, &inside),
            (true, true, false) => self.pass::<M, R, W, true, true, false>(machine, position_m, &inside),
            (true, true, true) => self.pass::<M, R, W, true, true, true>(machine, position_m, &inside),
        };
        for (lane, out) in out.iter_mut().enumerate() {
            *out = match &scales[lane] {
                Some(scales) => ln_density(self.n_observed(), scales, &sums, lane),
                None => f64::NEG_INFINITY,
            };
        }
    }

    fn pass<M: Machine, R: PositionRow<W>, const W: usize, const OU: bool, const GAIN: bool, const STUDENT: bool>(
        &self,
        machine: M,
        position_m: &[R],
        scales: &[FilterScales; W],
    ) -> Sums<W> {
        let of = |part: fn(&FilterScales) -> f64| scales.each_ref().map(part);
        let pass = FilterPass::<R, W, OU, GAIN, STUDENT> {
            record: self,
            position_m,
            scales,
            ou: of(|s| s.ou),
            ou_time_s: of(|s| s.ou_time_s),
            gain_per_m2: of(|s| s.gain_per_m2),
            offset: of(|s| s.offset),
            tail_per_m2: of(|s| 1.0 / (s.dof * s.noise_sd_m * s.noise_sd_m)),
            tail_weight: of(|s| (s.dof + 1.0) / s.dof),
        };
        machine.run(pass)
    }
}

/// Predicted position (m) of a row, common to all parameter points.
#[derive(Debug, Clone, Copy)]
pub struct SharedPosition(pub f64);

/// Predicted positions of a row: one per parameter point, or one for all points.
trait PositionRow<const W: usize> {
    fn register<S: Simd>(&self, simd: S, index: usize) -> Register<S>;
}

impl<R: Borrow<[f64; W]>, const W: usize> PositionRow<W> for R {
    #[inline(always)]
    fn register<S: Simd>(&self, simd: S, index: usize) -> Register<S> {
        Register::load(simd, self.borrow(), index)
    }
}

impl<const W: usize> PositionRow<W> for SharedPosition {
    #[inline(always)]
    fn register<S: Simd>(&self, simd: S, _index: usize) -> Register<S> {
        Register::splat(simd, self.0)
    }
}

/// Arithmetic of a pass: vector registers of the processor, or single floating-point values.
trait Machine {
    fn run<W: WithSimd>(self, pass: W) -> W::Output;
}

struct Vectors;
struct Scalars;

impl Machine for Vectors {
    fn run<W: WithSimd>(self, pass: W) -> W::Output {
        Arch::new().dispatch(pass)
    }
}

impl Machine for Scalars {
    fn run<W: WithSimd>(self, pass: W) -> W::Output {
        pass.with_simd(Scalar)
    }
}

/// Change of the Ornstein–Uhlenbeck process over a time step, for every lane: decay factor, and gained variance divided by the white variance.
#[derive(Clone)]
pub(super) struct FilterStep<const W: usize> {
    pub decay: [f64; W],
    pub gained: [f64; W],
}

impl<const W: usize> FilterStep<W> {
    pub const NONE: Self = Self { decay: [0.0; W], gained: [0.0; W] };

    /// Computes the decay exp(−Δt/τ) and the gained variance (1 − exp(−2Δt/τ)) σ_ou²/σ² of every lane. Δt is the time step, τ the correlation time, σ_ou the standard
    /// deviation of the process and σ the standard deviation of the white noise. `FilterScales::step` computes both quantities for one point. With uneven sampling,
    /// every row needs a step, and exponentials computed one by one would take longer than the filter.
    #[inline(always)]
    pub fn fill<S: Simd>(&mut self, simd: S, register: usize, step_s: f64, ou: &[f64; W], ou_time_s: &[f64; W]) {
        let time_s = Register::load(simd, ou_time_s, register);
        let change = (Register::splat(simd, -step_s) / time_s).exp_m1_below_zero();
        (Register::splat(simd, 1.0) + change).store(&mut self.decay, register);
        let lost = change.mul_add(change, change + change);
        (lost.zero() - lost * Register::load(simd, ou, register)).store(&mut self.gained, register);
    }
}

/// Sums and products over the rows of a pass, for every lane. v is the innovation, S its variance, σ² the variance of the white noise, and ν the degrees of freedom.
struct Sums<const W: usize> {
    /// Sum Σ v²σ²/S in m² of the squared innovations; 0 with Student-t noise.
    quadratic_m2: [f64; W],
    /// Product Π S/σ² of the innovations' variances in units of the white variance.
    variance: Products<W>,
    /// Product Π (1 + v²/(νS)) of the Student-t densities' denominators; 1 with normal noise.
    tail: Products<W>,
}

fn ln_density<const W: usize>(n_observed: usize, scales: &FilterScales, sums: &Sums<W>, lane: usize) -> f64 {
    let n = n_observed as f64;
    let scale = -n * (scales.noise_sd_m.ln() + 0.5 * (2.0 * std::f64::consts::PI).ln()) - 0.5 * sums.variance.ln(lane);
    if scales.dof.is_finite() {
        scale + n * ln_student_constant(scales.dof) - 0.5 * (scales.dof + 1.0) * sums.tail.ln(lane)
    } else {
        scale - 0.5 * sums.quadratic_m2[lane] / (scales.noise_sd_m * scales.noise_sd_m)
    }
}

/// Logarithm of the ratio of the Student-t density with ν degrees of freedom to the standard normal density, both at 0: ln[Γ((ν + 1)/2) / (Γ(ν/2) √(ν/2))].
///
/// It uses Stirling's series of the ratio at ν/2 + 10, where the next term is below 2·10⁻¹⁴. A difference of two ln Γ would lose its digits at large ν.
pub(super) fn ln_student_constant(dof: f64) -> f64 {
    let half = 0.5 * dof;
    let mut ratio = 1.0;
    for k in 0..10 {
        ratio *= 1.0 - 0.5 / (half + f64::from(k) + 0.5);
    }
    let shifted = half + 10.0;
    let inverse = 1.0 / (shifted * shifted);
    let series = [-1.0 / 8.0, 1.0 / 192.0, -1.0 / 640.0, 17.0 / 14_336.0, -31.0 / 18_432.0];
    let series = series.iter().rev().fold(0.0, |sum, coefficient| sum * inverse + coefficient) / shifted;
    ratio.ln() + 0.5 * (10.0 / half).ln_1p() + series
}

/// One pass of the filter over the record, with one parameter point per lane.
struct FilterPass<'a, R, const W: usize, const OU: bool, const GAIN: bool, const STUDENT: bool> {
    record: &'a NoiseLikelihood,
    position_m: &'a [R],
    scales: &'a [FilterScales; W],
    ou: [f64; W],
    ou_time_s: [f64; W],
    gain_per_m2: [f64; W],
    offset: [f64; W],
    /// Inverse 1/(νσ²) of the degrees of freedom times the squared scale of the errors, for each lane, in 1/m².
    tail_per_m2: [f64; W],
    /// Weight (ν + 1)/ν of an innovation of 0 under Student-t errors with ν degrees of freedom, for each lane.
    tail_weight: [f64; W],
}

impl<R: PositionRow<W>, const W: usize, const OU: bool, const GAIN: bool, const STUDENT: bool> WithSimd
    for FilterPass<'_, R, W, OU, GAIN, STUDENT>
{
    type Output = Sums<W>;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> Sums<W> {
        let mut sums = Sums { quadratic_m2: [0.0; W], variance: Products::ONE, tail: Products::ONE };
        let mut steps = Vec::new();
        if OU {
            steps.resize(self.record.rows.step_s.len(), FilterStep::NONE);
        }
        let n_registers = W / S::F64_LANES;
        for register in 0..n_registers {
            for (step, length_s) in steps.iter_mut().zip(&self.record.rows.step_s) {
                if W == 1 {
                    // For single values, the standard library's exponential is faster than the exponential of the registers.
                    (step.decay[0], step.gained[0]) = self.scales[0].step(*length_s);
                } else {
                    step.fill(simd, register, *length_s, &self.ou, &self.ou_time_s);
                }
            }
        }
        // Each row waits for a division. Two registers that are processed together therefore take hardly longer than one register.
        for register in (0..n_registers - n_registers % 2).step_by(2) {
            self.run::<S, 2>(simd, register, &steps, &mut sums);
        }
        if n_registers % 2 == 1 {
            self.run::<S, 1>(simd, n_registers - 1, &steps, &mut sums);
        }
        sums
    }
}

impl<R: PositionRow<W>, const W: usize, const OU: bool, const GAIN: bool, const STUDENT: bool>
    FilterPass<'_, R, W, OU, GAIN, STUDENT>
{
    /// Runs the filter over the record for the points of `K` registers, starting with register `first`.
    #[inline(always)]
    fn run<S: Simd, const K: usize>(&self, simd: S, first: usize, steps: &[FilterStep<W>], sums: &mut Sums<W>) {
        let load = |lanes: &[f64; W]| -> [Register<S>; K] {
            std::array::from_fn(
                #[inline(always)]
                |k| Register::load(simd, lanes, first + k),
            )
        };
        let (prior_gain, prior_offset) = (load(&self.gain_per_m2), load(&self.offset));
        let (tail_per_m2, tail_weight) = (load(&self.tail_per_m2), load(&self.tail_weight));
        let one = Register::splat(simd, 1.0);
        let mut covariance = [Covariance::<S, OU, GAIN>::zero(simd); K];
        let mut mean = [Mean::<S, OU, GAIN>::zero(simd); K];
        let mut quadratic = [one.zero(); K];
        let (mut variance, mut tail) = ([Product::one(simd); K], [Product::one(simd); K]);
        for (row, &observed_m) in self.record.rows.rows.iter().zip(&self.record.observed_m) {
            let position = &self.position_m[row.index];
            let observed = Register::splat(simd, observed_m);
            for k in 0..K {
                let (covariance, mean) = (&mut covariance[k], &mut mean[k]);
                if OU {
                    let step: &FilterStep<W> = &steps[row.step];
                    let decay = Register::load(simd, &step.decay, first + k);
                    covariance.advance(decay, Register::load(simd, &step.gained, first + k));
                    mean.advance(decay);
                }
                if GAIN && row.new_cycle {
                    covariance.renew(PriorVariances { gain: prior_gain[k], offset: prior_offset[k] });
                    mean.renew();
                }
                let x = position.register(simd, first + k);
                let innovation = mean.innovation(observed - x, x);
                if !OU && !GAIN {
                    let square = innovation * innovation;
                    if STUDENT {
                        tail[k].grow(square * tail_per_m2[k]);
                    } else {
                        quadratic[k] = quadratic[k] + square;
                    }
                    continue;
                }
                let gain = covariance.observe(x);
                variance[k].grow(gain.excess);
                let scaled = innovation * gain.precision;
                if STUDENT {
                    let u = innovation * scaled * tail_per_m2[k];
                    tail[k].grow(u);
                    mean.correct(&gain, scaled * (tail_weight[k] / (one + u)));
                } else {
                    quadratic[k] = innovation.mul_add(scaled, quadratic[k]);
                    mean.correct(&gain, scaled);
                }
            }
        }
        for k in 0..K {
            quadratic[k].store(&mut sums.quadratic_m2, first + k);
            variance[k].store(&mut sums.variance, first + k);
            tail[k].store(&mut sums.tail, first + k);
        }
    }
}

#[cfg(test)]
#[path = "likelihood_tests.rs"]
mod tests;
