//! Evaluation of the law at blocks of cubature points, and of the reduced balance of forces summed over the blocks.
//!
//! The equations are those of [`elements::fe::nonlinear::point`], evaluated for eight points at once.
//!
//! Each loop over the blocks is a separate pass ([`pulp::Simd::vectorize`]). If a whole run were one function, the compiler would
//! need a minute for each kind of processor. Its time grows with the square of a function's length.

use super::lanes::{LaneBlock, N_LANES, Plain};
use base::number::PointScalar;
use elements::fe::nonlinear::Bodies;
use elements::fe::nonlinear::point::{EQUIVALENT, Number, Radial, STIFFENING_START, StageLaw};
use laws::stages::Nonlinearity;
use pulp::{Simd, WithSimd};

/// Strain or stress at the points of a block, as six tensor coordinates.
pub(super) type BlockTensor<B> = [B; 6];

/// Number added to the squares of deviatoric strains to prevent a division by zero. It is far below the squared strain of any
/// moving gel.
const MIN_SQUARED_STRAIN: f64 = 1e-60;
const MOST_ITERATIONS: usize = 60;
/// Constant k of the hyperbola √(v² + k), which approximates |v| + 2 ln(1 + e^−|v|) within 0.2.
const HYPERBOLA: f64 = 1.6;

/// Strains of M modes at the cubature points, in blocks of eight points.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct CubaturePoints<const M: usize>(Vec<KernelPoints<M>>);

/// Block of eight cubature points.
#[derive(Debug, Clone, PartialEq)]
struct KernelPoints<const M: usize> {
    /// Strains, by tensor coordinate (row) and mode (column).
    strains: [[Plain; M]; 6],
    /// Inner products of the deviatoric strains of every pair of modes.
    products: [[Plain; M]; M],
    /// Weights (m³) times twice the shear modulus, and weights times the bulk modulus, both for unit Young's modulus.
    weights: [Plain; 2],
}

impl<const M: usize> CubaturePoints<M> {
    /// Builds the blocks. `strains` are ordered by point, then by tensor coordinate, then by mode. `unit_moduli` are twice the shear
    /// modulus and the bulk modulus, for unit Young's modulus.
    pub fn new(strains: &[f64], weights_m3: &[f64], unit_moduli: [f64; 2]) -> Self {
        let lanes = |values: &[f64], stride: usize, place: usize, block: usize| {
            // Points that fill up the last block have the weight 0.
            let of_point = |l: usize| values.get((block * N_LANES + l) * stride + place).copied().unwrap_or(0.0);
            Plain(std::array::from_fn(of_point))
        };
        let block = |b: usize| {
            let strains: [[Plain; M]; 6] =
                std::array::from_fn(|c| std::array::from_fn(|i| lanes(strains, 6 * M, c * M + i, b)));
            let product = |i: usize, j: usize| {
                strains[..5].iter().fold(splat(0.0), |sum, of_modes| sum + of_modes[i] * of_modes[j])
            };
            let products = std::array::from_fn(|i| std::array::from_fn(|j| product(i, j)));
            let weights = unit_moduli.map(|modulus| lanes(weights_m3, 1, 0, b) * splat(modulus));
            KernelPoints { strains, products, weights }
        };
        Self((0..weights_m3.len().div_ceil(N_LANES)).map(block).collect())
    }

    /// Returns the largest equivalent strain at the points, if the modes have these factors.
    pub(super) fn largest_strain(&self, coordinates: &[f64; M]) -> f64 {
        let at = |points: &KernelPoints<M>| deviator_norm(&points.strain::<Plain>(coordinates)).largest();
        EQUIVALENT * self.0.iter().map(at).fold(0.0, f64::max)
    }

    /// Number of blocks of eight points.
    pub(super) fn n_blocks(&self) -> usize {
        self.0.len()
    }
}

impl<const M: usize> KernelPoints<M> {
    /// Returns the strain at the points of the block, if the modes have these factors.
    #[inline(always)]
    fn strain<B: LaneBlock>(&self, coordinates: &[B::Scalar; M]) -> BlockTensor<B> {
        let mut strain = [B::constant(splat(0.0)); 6];
        for (sum, of_modes) in strain.iter_mut().zip(&self.strains) {
            for (z, b) in coordinates.iter().zip(of_modes) {
                *sum = *sum + B::splat(*z) * *b;
            }
        }
        strain
    }
}

/// Terms by which the past strains of the law's bodies enter the present stress of a block. `offset` is added to the strain before the
/// moduli are applied, and `taken` is subtracted from the stress.
#[derive(Debug, Clone, Copy)]
pub(super) struct HistoryTerms<B> {
    pub offset: BlockTensor<B>,
    pub taken: BlockTensor<B>,
}

impl<B: LaneBlock> HistoryTerms<B> {
    /// Returns the terms for the past strains of the bodies. `histories` has the nonlinear body first, then the linear bodies.
    #[inline(always)]
    pub fn new(law: &StageLaw<B::Scalar>, histories: &[BlockTensor<B>]) -> Self {
        let (omega, kappa) = (B::splat(law.omega), B::splat(law.kappa));
        let (mut offset, mut taken) = (histories[0], histories[0]);
        for (o, t) in offset.iter_mut().zip(&mut taken) {
            (*o, *t) = (omega * *o, kappa * *t);
        }
        for (body, history) in law.linear.iter().zip(&histories[1..]) {
            let decay = B::splat(body.decay);
            for (o, h) in offset.iter_mut().zip(history) {
                *o = *o - decay * *h;
            }
        }
        Self { offset, taken }
    }

    #[inline(always)]
    pub(super) fn values(&self) -> HistoryTerms<Plain> {
        let mut values = HistoryTerms { offset: [splat(0.0); 6], taken: [splat(0.0); 6] };
        for c in 0..6 {
            values.offset[c] = self.offset[c].values();
            values.taken[c] = self.taken[c].values();
        }
        values
    }
}

/// Secant and tangent moduli of a block, as in [`elements::fe::nonlinear::point::Moduli`].
#[derive(Debug, Clone, Copy)]
struct BlockModuli<B> {
    secant: B,
    normal: B,
    volumetric: B,
    coupling: B,
}

#[inline(always)]
fn splat(value: f64) -> Plain {
    Plain([value; N_LANES])
}

/// Improves a root by one Newton step, so that it carries the derivative. The step uses the residual `rest` and its `slope` at the root.
#[inline(always)]
fn polished<B: LaneBlock>(root: B, rest: B, slope: Plain) -> B {
    if B::Scalar::HAS_DERIVATIVE { root - rest * (splat(1.0) / slope) } else { root }
}

/// Returns the moduli of a compliance j in series with a flow. At the stress m, the strain is m (j + `flow`), and its slope by the stress
/// is j + `slope`.
#[inline(always)]
fn in_series<B: LaneBlock>(j: B, flow: B, slope: B, m: B) -> BlockModuli<B> {
    let one = B::constant(splat(1.0));
    let (secant, normal) = (one / (j + flow), one / (j + slope));
    let coupling = -(slope - flow) * secant * secant * normal * splat(EQUIVALENT) / m;
    BlockModuli { secant, normal, volumetric: secant, coupling }
}

/// Returns the solution m of (a + b m²) m = e, the equation of a stiffening body, by Halley's method of third order.
///
/// The initial guess is accurate to 4 % for b e²/a³ below 1000, so that two steps reach rounding. Larger values need more steps.
#[inline(always)]
fn stiffening_root(a: Plain, b: Plain, e: Plain) -> Plain {
    let (one, three, inverse) = (splat(1.0), splat(3.0), splat(1.0) / a);
    let (bend, linear) = (b * inverse, e * inverse);
    let t = bend * linear * linear;
    let [[a_1, a_2], [b_1, b_2]] = STIFFENING_START;
    let above = one + t * (splat(a_1) + t * splat(a_2));
    let below = one + t * (splat(b_1) + t * splat(b_2));
    let mut m = linear * above / below;
    for step in 0..MOST_ITERATIONS {
        let squared = bend * m * m;
        let (excess, slope) = (m * (one + squared) - linear, one + three * squared);
        let change = excess * slope / (slope * slope - excess * three * bend * m);
        m = m - change;
        // A step of third order leaves an error of the cube of the relative change.
        if step > 0 && change.is_within(m * splat(1e-5)) {
            break;
        }
    }
    m
}

#[inline(always)]
fn stiffening_slope(a: Plain, b: Plain, m: Plain) -> Plain {
    a + b * splat(3.0) * m * m
}

/// Returns the stress m of a thinning law at the strain e, and g (m/s₀)^p/j. It solves m (j + g (m/s₀)^p) = e, with j the compliance, g the
/// fluidity at the stress s₀, and p the exponent.
///
/// The equation is v + p ln(1 + eᵛ) = c for v = ln(g/j) + p ln(m/s₀). This curve has two straight asymptotes. A hyperbola near it
/// gives the initial guess for two steps of third order.
#[inline(always)]
fn thinning_root(e: Plain, j: f64, g: f64, s0: f64, p: f64) -> (Plain, Plain) {
    let (one, half, power) = (splat(1.0), splat(0.5), splat(p));
    let c = LaneBlock::ln(e * splat(1.0 / (j * s0))) * power + splat((g / j).ln());
    let bend = (c * c + splat(HYPERBOLA * (1.0 + p))).sqrt();
    let mut v = (c * splat(2.0 + p) - bend * power) * splat(0.5 / (1.0 + p));
    let mut ratio = LaneBlock::exp(v);
    for _ in 0..2 {
        let whole = one + ratio;
        let share = ratio / whole;
        let excess = v + power * LaneBlock::ln(whole) - c;
        let slope = one + power * share;
        let curvature = power * share * (one - share);
        let change = excess * slope / (slope * slope - half * excess * curvature);
        v = v - change;
        ratio = ratio * exp_of_little(-change);
    }
    (e * splat(1.0 / j) / (one + ratio), ratio)
}

/// Returns eˣ by Taylor's polynomial of degree 9. The result is accurate to rounding for |x| < 0.1.
#[inline(always)]
fn exp_of_little(x: Plain) -> Plain {
    let mut sum = splat(1.0);
    for n in (1_u8..10).rev() {
        sum = splat(1.0) + x * sum * splat(1.0 / f64::from(n));
    }
    sum
}

#[inline(always)]
fn thinning_slope(ratio: Plain, j: f64, p: f64) -> Plain {
    splat(j) * (splat(1.0) + ratio * splat(1.0 + p))
}

#[inline(always)]
fn moduli<B: LaneBlock>(law: &StageLaw<B::Scalar>, norm: B) -> BlockModuli<B> {
    let (one, j) = (B::constant(splat(1.0)), B::splat(law.linear_compliance));
    let driving = norm * splat(EQUIVALENT);
    match law.radial {
        Radial::Stiffening { rate, modulus, cubic } => {
            let (linear, cubic) = (B::splat(rate + modulus), B::splat(cubic));
            let (alpha, beta) = (j * linear + one, j * cubic);
            if law.is_linear() && !B::Scalar::HAS_DERIVATIVE {
                let secant = linear / alpha;
                return BlockModuli { secant, normal: secant, volumetric: secant, coupling: B::constant(splat(0.0)) };
            }
            let (a, b) = (alpha.values(), beta.values());
            let m = stiffening_root(a, b, driving.values());
            let root = B::constant(m);
            let rest = root * (alpha + beta * root * root) - driving;
            let m = polished(root, rest, stiffening_slope(a, b, m));
            let squared = cubic * m * m;
            let (secant, normal) = (linear + squared, linear + squared * splat(3.0));
            BlockModuli {
                secant: secant / (j * secant + one),
                normal: normal / (j * normal + one),
                volumetric: linear / alpha,
                coupling: B::constant(splat(0.0)),
            }
        }
        Radial::Thinning { fluidity, exponent, reference } => {
            let (g, s0, p) = (fluidity.value(), reference.value(), exponent.value());
            let jv = law.linear_compliance.value();
            let (m, ratio) = thinning_root(driving.values(), jv, g, s0, p);
            let (reference, exponent, fluidity) = (B::splat(reference), B::splat(exponent), B::splat(fluidity));
            if !B::Scalar::HAS_DERIVATIVE {
                let flow = j * ratio;
                return in_series(j, flow, flow * (exponent + one), B::constant(m));
            }
            let root = B::constant(m);
            let rest = root * (j + fluidity * ((root / reference).ln() * exponent).exp()) - driving;
            let m = polished(root, rest, thinning_slope(ratio, jv, p));
            let flow = fluidity * ((m / reference).ln() * exponent).exp();
            in_series(j, flow, flow * (exponent + one), m)
        }
        Radial::Yield { fluidity, stress, smoothing } => {
            // The smoothed yield law is a hyperbola, so that its stress solves a quadratic equation.
            let (g, sy, squared) = (B::splat(fluidity), B::splat(stress), splat(smoothing * smoothing));
            let b = driving * (j + j + g) + g * sy * (j + g * squared);
            let c = driving * (driving + g * sy);
            let a = j * (j + g);
            let m = c * splat(2.0) / (b + (b * b - a * c * splat(4.0)).sqrt());
            let quarter = sy * squared * splat(2.0);
            let beyond = m - sy;
            let root = (beyond * beyond + quarter * m * splat(2.0)).sqrt();
            // r = ½(m − s_y + √…), without cancellation on either side.
            let above = (beyond + root) * splat(0.5) / m;
            let below = quarter / (root - beyond);
            let share = B::choose(beyond, above, below);
            let slope = ((beyond + quarter) / root + one) * splat(0.5);
            in_series(j, g * share, g * slope, m)
        }
    }
}

/// Returns the equivalent strain of the nonlinear body under the stress that would give an unstiffened body the strain `elastic`.
pub(super) fn stiffened_strain(bodies: &Bodies<f64>, elastic: f64) -> f64 {
    match bodies.nonlinearity {
        Nonlinearity::StrainStiffening { coefficient } => {
            let [strain, ..] = stiffening_root(splat(1.0), splat(coefficient), splat(elastic)).0;
            strain
        }
        _ => elastic,
    }
}

/// Returns the largest equivalent strain of the nonlinear body. `histories` has `n_histories` strains for each block, with the
/// nonlinear body first.
#[inline(always)]
pub(super) fn largest_equivalent<B: LaneBlock>(histories: &[BlockTensor<B>], n_histories: usize) -> f64 {
    let mut largest = 0.0_f64;
    for histories in histories.chunks_exact(n_histories) {
        largest = largest.max(deviator_norm(&histories[0]).values().largest());
    }
    EQUIVALENT * largest
}

#[inline(always)]
fn sum<B: LaneBlock>(a: &BlockTensor<B>, b: &BlockTensor<B>) -> BlockTensor<B> {
    let mut sum = *a;
    for (s, b) in sum.iter_mut().zip(b) {
        *s = *s + *b;
    }
    sum
}

#[inline(always)]
fn deviator_norm<B: LaneBlock>(a: &BlockTensor<B>) -> B {
    let mut squared = a[0] * a[0];
    for t in &a[1..5] {
        squared = squared + *t * *t;
    }
    (squared + B::constant(splat(MIN_SQUARED_STRAIN))).sqrt()
}

/// Law of a block of points, linearised about the strain measure a (strain plus offset by past strains).
#[derive(Debug, Clone, Copy)]
pub(super) struct LinearisedLaw {
    a: BlockTensor<Plain>,
    inverse_norm: Plain,
    moduli: BlockModuli<Plain>,
}

impl LinearisedLaw {
    /// Returns the stress at a strain measure `a` close to the point of linearisation, by the tangent.
    #[inline(always)]
    fn stress_beside(&self, a: &BlockTensor<Plain>, taken: &BlockTensor<Plain>) -> BlockTensor<Plain> {
        let Self { a: here, inverse_norm, moduli } = self;
        let mut along = (a[0] - here[0]) * here[0];
        for c in 1..5 {
            along = along + (a[c] - here[c]) * here[c];
        }
        along = along * *inverse_norm;
        let bent = (moduli.normal - moduli.secant) * along * *inverse_norm;
        let mut stress = *a;
        for (c, s) in stress[..5].iter_mut().enumerate() {
            *s = moduli.secant * *s + bent * here[c] - taken[c];
        }
        stress[5] = moduli.volumetric * stress[5] + moduli.coupling * along * here[5] - taken[5];
        stress
    }
}

/// Task that computes the internal forces on the modes, and their derivatives by mode factors, row by row. It writes the
/// linearised law of every block to `at`.
pub(super) struct ForcesAndTangent<'a, const M: usize> {
    pub points: &'a CubaturePoints<M>,
    pub law: &'a StageLaw<f64>,
    pub given: &'a [HistoryTerms<Plain>],
    pub coordinates: &'a [f64; M],
    pub at: &'a mut Vec<LinearisedLaw>,
}

impl<const M: usize> WithSimd for ForcesAndTangent<'_, M> {
    type Output = ([f64; M], [[f64; M]; M]);

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> Self::Output {
        let Self { points, law, given, coordinates, at } = self;
        // The law of all blocks is evaluated first. The slow operations of one block depend on each other, but not on the operations of
        // other blocks.
        at.clear();
        for (points, given) in points.0.iter().zip(given) {
            let a = sum(&points.strain::<Plain>(coordinates), &given.offset);
            let norm = deviator_norm(&a);
            at.push(LinearisedLaw { a, inverse_norm: splat(1.0) / norm, moduli: moduli::<Plain>(law, norm) });
        }
        let zero = splat(0.0);
        let (mut force, mut tangent, mut below) = ([zero; M], [[zero; M]; M], [[zero; M]; M]);
        let couples = !matches!(law.radial, Radial::Stiffening { .. });
        for ((points, given), LinearisedLaw { a, inverse_norm, moduli }) in points.0.iter().zip(given).zip(&*at) {
            let [deviatoric, volumetric] = points.weights;
            let mut along = [zero; M];
            for (c, of_modes) in points.strains[..5].iter().enumerate() {
                let stress = (moduli.secant * a[c] - given.taken[c]) * deviatoric;
                let direction = a[c] * *inverse_norm;
                for i in 0..M {
                    force[i] = force[i] + stress * of_modes[i];
                    along[i] = along[i] + direction * of_modes[i];
                }
            }
            let traces = &points.strains[5];
            let trace = (moduli.volumetric * a[5] - given.taken[5]) * volumetric;
            let (secant, extra) = (moduli.secant * deviatoric, (moduli.normal - moduli.secant) * deviatoric);
            let dilation = moduli.volumetric * volumetric;
            for i in 0..M {
                force[i] = force[i] + trace * traces[i];
                let (n_i, t_i) = (extra * along[i], dilation * traces[i]);
                for j in i..M {
                    let bent = n_i * along[j] + t_i * traces[j];
                    tangent[i][j] = tangent[i][j] + secant * points.products[i][j] + bent;
                }
            }
            if couples {
                let coupling = moduli.coupling * a[5] * volumetric;
                for i in 0..M {
                    let t_i = coupling * traces[i];
                    for j in 0..M {
                        below[i][j] = below[i][j] + t_i * along[j];
                    }
                }
            }
        }
        let mut summed = [[0.0; M]; M];
        for i in 0..M {
            for j in i..M {
                let symmetric = tangent[i][j].sum();
                (summed[i][j], summed[j][i]) = (symmetric, symmetric);
            }
        }
        if couples {
            for i in 0..M {
                for j in 0..M {
                    summed[i][j] += below[i][j].sum();
                }
            }
        }
        (force.map(|f| f.sum()), summed)
    }
}

/// Returns the stress of a block at a strain, for these terms of the past strains.
#[inline(always)]
fn stress<B: LaneBlock>(law: &StageLaw<B::Scalar>, given: &HistoryTerms<B>, strain: &BlockTensor<B>) -> BlockTensor<B> {
    let mut stress = sum(strain, &given.offset);
    let at = moduli::<B>(law, deviator_norm(&stress));
    for (c, s) in stress.iter_mut().enumerate() {
        *s = (if c < 5 { at.secant } else { at.volumetric }) * *s - given.taken[c];
    }
    stress
}

/// Task that computes the internal forces on the modes, without derivatives.
pub(super) struct Forces<'a, B: LaneBlock, const M: usize> {
    pub points: &'a CubaturePoints<M>,
    pub law: &'a StageLaw<B::Scalar>,
    pub given: &'a [HistoryTerms<B>],
    pub coordinates: &'a [B::Scalar; M],
}

impl<B: LaneBlock, const M: usize> WithSimd for Forces<'_, B, M> {
    type Output = [B::Scalar; M];

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> Self::Output {
        let Self { points, law, given, coordinates } = self;
        let mut sums = [B::constant(splat(0.0)); M];
        for (points, given) in points.0.iter().zip(given) {
            let [deviatoric, volumetric] = points.weights;
            let stress = stress(law, given, &points.strain::<B>(coordinates));
            for (c, (s, of_modes)) in stress.iter().zip(&points.strains).enumerate() {
                let weighed = *s * if c < 5 { deviatoric } else { volumetric };
                for (f, b) in sums.iter_mut().zip(of_modes) {
                    *f = *f + weighed * *b;
                }
            }
        }
        sums.map(|sum| sum.sum())
    }
}

/// Task that advances the bodies' strains at all blocks (`n_histories` for each block) to the end of a stage of the time step. Plain
/// numbers use the linearised law `at` from the last evaluation of the balance of forces. Its error is at most the square of the last
/// Newton step, like that of the balance.
pub(super) struct Advance<'a, B: LaneBlock, const M: usize> {
    pub points: &'a CubaturePoints<M>,
    pub law: &'a StageLaw<B::Scalar>,
    pub given: &'a [HistoryTerms<B>],
    pub coordinates: &'a [B::Scalar; M],
    pub at: &'a [LinearisedLaw],
    pub histories: &'a mut [BlockTensor<B>],
}

impl<B: LaneBlock, const M: usize> WithSimd for Advance<'_, B, M> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let Self { points, law, given, coordinates, at, histories } = self;
        let n = 1 + law.linear.len();
        let compliance = B::splat(law.linear_compliance);
        for (((points, given), at), histories) in points.0.iter().zip(given).zip(at).zip(histories.chunks_exact_mut(n))
        {
            let strain = points.strain::<B>(coordinates);
            let stress = if B::Scalar::HAS_DERIVATIVE {
                stress(law, given, &strain)
            } else {
                let a = sum(&strain, &given.offset).map(|a| a.values());
                at.stress_beside(&a, &given.taken.map(|t| t.values())).map(B::constant)
            };
            let mut rest = strain;
            for (r, s) in rest.iter_mut().zip(&stress) {
                *r = *r - compliance * *s;
            }
            let (nonlinear, linear) = histories.split_at_mut(1);
            for (body, history) in law.linear.iter().zip(linear) {
                let (decay, compliance) = (B::splat(body.decay), B::splat(body.compliance));
                for c in 0..6 {
                    let left = decay * history[c];
                    rest[c] = rest[c] - left;
                    history[c] = left + compliance * stress[c];
                }
            }
            nonlinear[0] = rest;
        }
    }
}
