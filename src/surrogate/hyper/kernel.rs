//! The law at blocks of cubature points, and the reduced balance summed over them.
//!
//! The equations are those of [`crate::fe::nonlinear::point`], for eight points at once.

use super::lanes::{Block, N_LANES, Plain};
use crate::fe::nonlinear::point::{EQUIVALENT, Number, Radial, StageLaw};
use crate::number::PointScalar;

/// A strain or stress at the points of a block.
pub(super) type BlockTensor<B> = [B; 6];

/// Added to squared deviators (of strains): nothing that moves is so still, and nothing is divided by zero.
const STILL: f64 = 1e-60;
const MOST_ITERATIONS: usize = 60;
const ROUNDING: f64 = 1e-11;

/// What the modes strain at the points of the cubature, in blocks.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct CubaturePoints {
    pub n_modes: usize,
    pub n_blocks: usize,
    /// Strain of every mode: block by block, tensor coordinate by coordinate, mode by mode.
    pub strains: Vec<Plain>,
    /// Products of the modes' deviators, block by block, i ≤ j.
    pub products: Vec<Plain>,
    /// Weights (m³) times 2μ̂ and times κ̂.
    pub weights: Vec<[Plain; 2]>,
}

impl CubaturePoints {
    /// From strains (point by point, coordinate by coordinate, mode by mode), weights in m³ and unit moduli 2μ̂ and κ̂.
    pub(super) fn new(n_modes: usize, strains: &[f64], weights_m3: &[f64], [two_mu, kappa]: [f64; 2]) -> Self {
        let n_blocks = weights_m3.len().div_ceil(N_LANES);
        // Points that fill the last block up weigh nothing.
        let lane = |block: usize, place: usize| {
            let of_point = |l: usize| strains.get((block * N_LANES + l) * 6 * n_modes + place).copied().unwrap_or(0.0);
            Plain(std::array::from_fn(of_point))
        };
        let blocks: Vec<Plain> =
            (0..n_blocks).flat_map(|b| (0..6 * n_modes).map(move |k| (b, k))).map(|(b, k)| lane(b, k)).collect();
        let mut products = Vec::new();
        for block in blocks.chunks_exact(6 * n_modes) {
            for i in 0..n_modes {
                for j in i..n_modes {
                    let terms = (0..5).map(|c| block[c * n_modes + i] * block[c * n_modes + j]);
                    products.push(terms.fold(Plain([0.0; N_LANES]), |a, b| a + b));
                }
            }
        }
        let weight = |b: usize| Plain(std::array::from_fn(|l| weights_m3.get(b * N_LANES + l).copied().unwrap_or(0.0)));
        let weights = (0..n_blocks).map(|b| [weight(b) * splat(two_mu), weight(b) * splat(kappa)]).collect();
        Self { n_modes, n_blocks, strains: blocks, products, weights }
    }

    /// Strain of a block at reduced coordinates.
    #[inline(always)]
    fn strain<B: Block>(&self, block: usize, coordinates: &[B::Scalar]) -> BlockTensor<B> {
        let m = self.n_modes;
        let mut strain = [B::constant(splat(0.0)); 6];
        for (c, sum) in strain.iter_mut().enumerate() {
            for (z, b) in coordinates.iter().zip(&self.strains[(block * 6 + c) * m..][..m]) {
                *sum = *sum + B::splat(*z) * *b;
            }
        }
        strain
    }
}

/// What the law makes of the histories of a block: a = strain + offset, and κ H_N.
#[derive(Debug, Clone, Copy)]
pub(super) struct Given<B> {
    pub offset: BlockTensor<B>,
    pub taken: BlockTensor<B>,
}

impl<B: Block> Given<B> {
    /// From the histories of a block: the nonlinear body's, then the linear ones'.
    #[inline(always)]
    pub(super) fn new(law: &StageLaw<B::Scalar>, histories: &[BlockTensor<B>]) -> Self {
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
    pub(super) fn values(&self) -> Given<Plain> {
        let mut values = Given { offset: [splat(0.0); 6], taken: [splat(0.0); 6] };
        for c in 0..6 {
            values.offset[c] = self.offset[c].values();
            values.taken[c] = self.taken[c].values();
        }
        values
    }
}

/// Moduli as in [`crate::fe::nonlinear::point::Moduli`].
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

/// The root in numbers that carry a derivative, given what `rest` it leaves there.
#[inline(always)]
fn polished<B: Block>(root: B, rest: B, slope: Plain) -> B {
    if B::Scalar::HAS_DERIVATIVE { root - rest * (splat(1.0) / slope) } else { root }
}

/// Moduli of j in series with a flow: strain m (j + `flow`), of slope j + `slope`.
#[inline(always)]
fn in_series<B: Block>(j: B, flow: B, slope: B, m: B) -> BlockModuli<B> {
    let one = B::constant(splat(1.0));
    let (secant, normal) = (one / (j + flow), one / (j + slope));
    let coupling = -(slope - flow) * secant * secant * normal * splat(EQUIVALENT) / m;
    BlockModuli { secant, normal, volumetric: secant, coupling }
}

/// m of (a + b m²) m = e, from the right.
#[inline(always)]
fn stiffening_root(a: Plain, b: Plain, e: Plain) -> Plain {
    let mut m = e / a;
    for _ in 0..MOST_ITERATIONS {
        let change = (m * (a + b * m * m) - e) / stiffening_slope(a, b, m);
        m = m - change;
        if (change / m).largest() <= ROUNDING {
            break;
        }
    }
    m
}

#[inline(always)]
fn stiffening_slope(a: Plain, b: Plain, m: Plain) -> Plain {
    a + b * splat(3.0) * m * m
}

/// m of m (j + g (m/s₀)^p) = e, and (m/s₀)^p.
#[inline(always)]
fn thinning_root(e: Plain, j: f64, g: f64, s0: f64, p: f64) -> (Plain, Plain) {
    let one = splat(1.0);
    let target = Block::ln(e / splat(j * s0));
    let mut y = target.min((target - splat((g / j).ln())) * splat(1.0 / (1.0 + p)));
    let mut share = one;
    for _ in 0..MOST_ITERATIONS {
        share = Block::exp(y * splat(p));
        let ratio = share * splat(g / j);
        // The logarithm of what m (j + flow) is of what it should be, to third order: right where it matters.
        let excess = Block::exp(y - target) * (one + ratio);
        let excess = (excess - one) * splat(2.0) / (excess + one);
        let change = excess / (one + splat(p) * ratio / (one + ratio));
        y = y - change;
        if change.largest() <= 1e-9 {
            share = share * (one - change * splat(p));
            break;
        }
    }
    (Block::exp(y) * splat(s0), share)
}

#[inline(always)]
fn thinning_slope(share: Plain, j: f64, g: f64) -> Plain {
    splat(j) + share * splat(g)
}

#[inline(always)]
fn moduli<B: Block>(law: &StageLaw<B::Scalar>, norm: B) -> BlockModuli<B> {
    let (one, j) = (B::constant(splat(1.0)), B::splat(law.linear_compliance));
    let driving = norm * splat(EQUIVALENT);
    match law.radial {
        Radial::Stiffening { rate, modulus, cubic } => {
            let (linear, cubic) = (B::splat(rate + modulus), B::splat(cubic));
            let (alpha, beta) = (j * linear + one, j * cubic);
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
            let (m, share) = thinning_root(driving.values(), jv, g, s0, p);
            let (reference, exponent, fluidity) = (B::splat(reference), B::splat(exponent), B::splat(fluidity));
            if !B::Scalar::HAS_DERIVATIVE {
                let flow = fluidity * share;
                return in_series(j, flow, flow * (exponent + one), B::constant(m));
            }
            let root = B::constant(m);
            let rest = root * (j + fluidity * ((root / reference).ln() * exponent).exp()) - driving;
            let m = polished(root, rest, thinning_slope(share, jv, g * (1.0 + p)));
            let flow = fluidity * ((m / reference).ln() * exponent).exp();
            in_series(j, flow, flow * (exponent + one), m)
        }
        Radial::Yield { fluidity, stress, smoothing } => {
            // The smoothed law is a hyperbola, so that its stress solves a quadratic equation.
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

/// Largest equivalent strain of the nonlinear body, among histories of `n_histories` a block.
#[inline(always)]
pub(super) fn largest_equivalent<B: Block>(histories: &[BlockTensor<B>], n_histories: usize) -> f64 {
    let mut largest = 0.0_f64;
    for histories in histories.chunks_exact(n_histories) {
        largest = largest.max(deviator_norm(&histories[0]).values().largest());
    }
    EQUIVALENT * largest
}

#[inline(always)]
fn sum<B: Block>(a: &BlockTensor<B>, b: &BlockTensor<B>) -> BlockTensor<B> {
    let mut sum = *a;
    for (s, b) in sum.iter_mut().zip(b) {
        *s = *s + *b;
    }
    sum
}

#[inline(always)]
fn deviator_norm<B: Block>(a: &BlockTensor<B>) -> B {
    let mut squared = a[0] * a[0];
    for t in &a[1..5] {
        squared = squared + *t * *t;
    }
    (squared + B::constant(splat(STILL))).sqrt()
}

/// Sums of the balance over the blocks.
#[derive(Debug, Clone)]
pub(super) struct Sums {
    force: Vec<Plain>,
    /// Row by row.
    tangent: Vec<Plain>,
}

impl Sums {
    pub(super) fn new(n_modes: usize) -> Self {
        Self { force: vec![splat(0.0); n_modes], tangent: vec![splat(0.0); n_modes * n_modes] }
    }
}

/// Internal forces on the modes and, row by row, their derivatives.
#[inline(always)]
pub(super) fn forces_and_tangent(
    points: &CubaturePoints,
    law: &StageLaw<f64>,
    given: &[Given<Plain>],
    coordinates: &[f64],
    sums: &mut Sums,
    force: &mut [f64],
    tangent: &mut [f64],
) {
    let m = points.n_modes;
    sums.force.fill(splat(0.0));
    sums.tangent.fill(splat(0.0));
    let couples = !matches!(law.radial, Radial::Stiffening { .. });
    let mut along = [splat(0.0); MOST_MODES];
    for (block, given) in given.iter().enumerate() {
        let [deviatoric, volumetric] = points.weights[block];
        let a = sum(&points.strain::<Plain>(block, coordinates), &given.offset);
        let norm = deviator_norm(&a);
        let at = moduli::<Plain>(law, norm);
        let row = |c: usize| &points.strains[(block * 6 + c) * m..][..m];
        let inverse = splat(1.0) / norm;
        for (c, (a, taken)) in a[..5].iter().zip(&given.taken).enumerate() {
            let stress = (at.secant * *a - *taken) * deviatoric;
            for (f, b) in sums.force.iter_mut().zip(row(c)) {
                *f = *f + stress * *b;
            }
        }
        let trace = (at.volumetric * a[5] - given.taken[5]) * volumetric;
        for (f, b) in sums.force.iter_mut().zip(row(5)) {
            *f = *f + trace * *b;
        }
        for (i, n) in along[..m].iter_mut().enumerate() {
            let mut sum = a[0] * row(0)[i];
            for (c, a) in a[..5].iter().enumerate().skip(1) {
                sum = sum + *a * row(c)[i];
            }
            *n = sum * inverse;
        }
        let (secant, extra) = (at.secant * deviatoric, (at.normal - at.secant) * deviatoric);
        let (dilation, coupling) = (at.volumetric * volumetric, at.coupling * a[5] * volumetric);
        let mut products = points.products[block * m * (m + 1) / 2..].iter();
        for i in 0..m {
            let (n_i, t_i) = (extra * along[i], dilation * row(5)[i]);
            let columns = along[i..m].iter().zip(&row(5)[i..]).zip(&mut sums.tangent[i * m + i..]);
            for (((n_j, t_j), entry), product) in columns.zip(&mut products) {
                *entry = *entry + secant * *product + n_i * *n_j + t_i * *t_j;
            }
        }
        if couples {
            // The part that is not symmetric goes below the diagonal and is spread afterwards with what the upper part lacks.
            for i in 0..m {
                let t_i = coupling * row(5)[i];
                for j in 0..m {
                    let entry = &mut sums.tangent[i * m + j];
                    if j >= i {
                        *entry = *entry + t_i * along[j];
                    } else {
                        *entry = *entry + t_i * along[j] - coupling * row(5)[j] * along[i];
                    }
                }
            }
        }
    }
    for (f, sum) in force.iter_mut().zip(&sums.force) {
        *f = sum.sum();
    }
    for i in 0..m {
        for j in i..m {
            let upper = sums.tangent[i * m + j].sum();
            tangent[i * m + j] = upper;
            if j > i {
                tangent[j * m + i] = upper + sums.tangent[j * m + i].sum();
            }
        }
    }
}

/// Most modes of a surrogate.
pub(super) const MOST_MODES: usize = 16;

/// Stress s of a block.
#[inline(always)]
fn stress<B: Block>(law: &StageLaw<B::Scalar>, given: &Given<B>, strain: &BlockTensor<B>) -> BlockTensor<B> {
    let mut stress = sum(strain, &given.offset);
    let at = moduli::<B>(law, deviator_norm(&stress));
    for (c, s) in stress.iter_mut().enumerate() {
        *s = (if c < 5 { at.secant } else { at.volumetric }) * *s - given.taken[c];
    }
    stress
}

/// Internal forces on the modes alone.
#[inline(always)]
pub(super) fn forces<B: Block>(
    points: &CubaturePoints,
    law: &StageLaw<B::Scalar>,
    given: &[Given<B>],
    coordinates: &[B::Scalar],
    force: &mut [B::Scalar],
) {
    let m = points.n_modes;
    let mut sums = [B::constant(splat(0.0)); MOST_MODES];
    for (block, given) in given.iter().enumerate() {
        let [deviatoric, volumetric] = points.weights[block];
        let stress = stress(law, given, &points.strain::<B>(block, coordinates));
        for (c, s) in stress.iter().enumerate() {
            let weighed = *s * if c < 5 { deviatoric } else { volumetric };
            for (f, b) in sums.iter_mut().zip(&points.strains[(block * 6 + c) * m..][..m]) {
                *f = *f + weighed * *b;
            }
        }
    }
    for (f, sum) in force.iter_mut().zip(&sums[..m]) {
        *f = sum.sum();
    }
}

/// Carries the histories of all blocks (`n_histories` each) to the stage's end.
#[inline(always)]
pub(super) fn advance<B: Block>(
    points: &CubaturePoints,
    law: &StageLaw<B::Scalar>,
    given: &[Given<B>],
    coordinates: &[B::Scalar],
    histories: &mut [BlockTensor<B>],
) {
    let n = 1 + law.linear.len();
    let compliance = B::splat(law.linear_compliance);
    for ((block, given), histories) in given.iter().enumerate().zip(histories.chunks_exact_mut(n)) {
        let strain = points.strain::<B>(block, coordinates);
        let stress = stress(law, given, &strain);
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
