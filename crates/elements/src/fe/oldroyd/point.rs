//! Stress of the gel at one point of the half meridian.
//!
//! The conformation of a mode is A = F S Fᵀ, with the deformation gradient F and its value S in
//! undeformed coordinates. A stage of implicit Euler of Giesekus's law reads A + z [(A − 1) + α (A
//! − 1)²] = A*, where A* = F S* Fᵀ, S* is the value from which the stage starts, and α the
//! mobility. z is the stage's implicit time divided by the relaxation time. A has the principal
//! axes of A*. It is therefore a matrix function: A = 2m(b + R)⁻¹ with b = 1 + z(1 − 2α), m = A* +
//! z(1 − α) and the root R² = b² + 4αz m. α = 0 is Oldroyd-B.

use base::number::{Dual, PointScalar};

/// Components of a gradient in the half meridian, in the order rR, rZ, zR, zZ, θΘ. The first index
/// is the current direction, the second the undeformed one.
pub(super) type Gradient<N = f64> = [N; N_GRADIENT];
pub(super) const N_GRADIENT: usize = 5;
/// Components of a symmetric tensor in the order RR, RZ, ZZ, ΘΘ.
pub(super) type Symmetric<N = f64> = [N; N_SYMMETRIC];
pub(super) const N_SYMMETRIC: usize = 4;

pub(super) const IDENTITY: Gradient = [1.0, 0.0, 0.0, 1.0, 1.0];
/// Conformation of a gel after a long rest, in undeformed coordinates: the unit tensor.
pub(super) const AT_REST: Symmetric = [1.0, 0.0, 1.0, 1.0];

/// The law over a stage of a time step.
#[derive(Debug, Clone, Copy)]
pub struct StageLaw<'a> {
    /// Inverse of the stage's implicit time (diagonal coefficient × step length), in 1/s.
    pub(super) rate_per_s: f64,
    /// Viscosity of the solvent, in Pa·s.
    pub(super) solvent_pa_s: f64,
    /// Mobility of Giesekus's fluid; 0 is Oldroyd-B.
    pub(super) mobility: f64,
    /// For every mode, its modulus (Pa) and the stage's implicit time divided by the relaxation
    /// time.
    pub modes: &'a [(f64, f64)],
    /// Compliance of the volume ratio to a pressure, in 1/Pa. It is 0 if the gel keeps its volume.
    pub(super) volume_compliance_per_pa: f64,
    /// Bulk viscosity of the solvent, in Pa·s. It is 0 if the gel keeps its volume.
    pub(super) bulk_pa_s: f64,
    /// True if a change of volume does not affect the conformation. The conformation then resists
    /// only changes of shape.
    pub(super) is_apart: bool,
}

/// Constants of a stage at one point.
#[derive(Debug, Clone)]
pub(super) struct PointConstants<'a> {
    /// Law over this stage.
    pub(super) law: StageLaw<'a>,
    /// Deformation gradient at the start of the stage, at this point.
    pub(super) start: Gradient,
    /// Conformation of every mode from which the stage starts, in undeformed coordinates.
    pub(super) configurations: &'a [Symmetric],
    /// Relative volume change at zero pressure.
    pub(super) rest: f64,
}

/// Determinant of a deformation gradient: the volume ratio.
pub(super) fn determinant(f: &Gradient) -> f64 {
    (f[0] * f[3] - f[1] * f[2]) * f[4]
}

/// Cofactor of a deformation gradient: the derivative of its determinant.
pub(super) fn cofactor<N: PointScalar>(f: &Gradient<N>) -> Gradient<N> {
    [f[3] * f[4], -f[2] * f[4], -f[1] * f[4], f[0] * f[4], f[0] * f[3] - f[1] * f[2]]
}

type Plane<N> = [N; 4];

fn plane<N: PointScalar>(f: &Gradient<N>) -> Plane<N> {
    [f[0], f[1], f[2], f[3]]
}

fn product<N: PointScalar>(a: &Plane<N>, b: &Plane<N>) -> Plane<N> {
    [a[0] * b[0] + a[1] * b[2], a[0] * b[1] + a[1] * b[3], a[2] * b[0] + a[3] * b[2], a[2] * b[1] + a[3] * b[3]]
}

fn transposed<N: PointScalar>(a: &Plane<N>) -> Plane<N> {
    [a[0], a[2], a[1], a[3]]
}

fn symmetric<N: PointScalar>(a: &Plane<N>) -> Plane<N> {
    let off = (a[1] + a[2]) * 0.5;
    [a[0], off, off, a[3]]
}

fn inverse<N: PointScalar>(a: &Plane<N>) -> Plane<N> {
    let determinant = a[0] * a[3] - a[1] * a[2];
    [a[3] / determinant, -a[1] / determinant, -a[2] / determinant, a[0] / determinant]
}

/// Product F S Fᵀ of a deformation gradient F and a symmetric tensor S.
fn push_forward<N: PointScalar>(f: &Gradient<N>, s: &Symmetric<N>) -> Symmetric<N> {
    let [a, b, c, d, hoop] = *f;
    let (left, right) = ([a * s[0] + b * s[1], a * s[1] + b * s[2]], [c * s[0] + d * s[1], c * s[1] + d * s[2]]);
    [left[0] * a + left[1] * b, left[0] * c + left[1] * d, right[0] * c + right[1] * d, hoop * hoop * s[3]]
}

/// Conformation at the end of a stage. `start` is the conformation without relaxation in the stage,
/// `z` the stage's implicit time divided by the relaxation time.
fn relaxed<N: PointScalar>(start: &Symmetric<N>, z: f64, mobility: f64) -> Symmetric<N> {
    let b = 1.0 + z * (1.0 - 2.0 * mobility);
    let rest = N::constant(z * (1.0 - mobility));
    let m = [start[0] + rest, start[1], start[2] + rest, start[3] + rest];
    if mobility == 0.0 {
        return m.map(|m| m * (1.0 / b));
    }
    let four = 4.0 * mobility * z;
    let squared = N::constant(b * b);
    // Square root of a symmetric 2 × 2 matrix M: (M + √det M)/√(tr M + 2 √det M).
    let square = [squared + m[0] * four, m[1] * four, squared + m[2] * four];
    let root_of_determinant = (square[0] * square[2] - square[1] * square[1]).sqrt();
    let by = (square[0] + square[2] + root_of_determinant * 2.0).sqrt();
    let b = N::constant(b);
    let sum = [
        (square[0] + root_of_determinant) / by + b,
        square[1] / by,
        square[1] / by,
        (square[2] + root_of_determinant) / by + b,
    ];
    let found = symmetric(&product(&[m[0], m[1], m[1], m[2]], &inverse(&sum)));
    let hoop = m[3] / (b + (squared + m[3] * four).sqrt());
    [found[0] * 2.0, found[1] * 2.0, found[3] * 2.0, hoop * 2.0]
}

/// Gradient that changes the conformation: the deformation gradient `f` or, with `is_apart`, `f`
/// without its change of volume.
fn shape<N: PointScalar>(f: &Gradient<N>, is_apart: bool) -> Gradient<N> {
    if !is_apart {
        return *f;
    }
    let determinant = (f[0] * f[3] - f[1] * f[2]) * f[4];
    let by = determinant.pow(N::constant(-1.0 / 3.0));
    f.map(|x| x * by)
}

/// First Piola–Kirchhoff stress in Pa, without the contribution of the pressure.
///
/// Each mode contributes G (A − 1), with its modulus G and conformation A. If the volume is
/// constant, this differs from G A only by a pressure. But a mesh keeps the volume only in the
/// mean. With G A, the relaxed part would pull volumes apart. A mode as stiff as a spring in series
/// (Burgers) would then destroy the mesh.
pub(super) fn stress<N: PointScalar>(held: &PointConstants, f: &Gradient<N>) -> Gradient<N> {
    let law = held.law;
    let m = inverse(&plane(f));
    let moved: Plane<N> = std::array::from_fn(|k| (f[k] - N::constant(held.start[k])) * law.rate_per_s);
    let rate = symmetric(&product(&moved, &m));
    let hoop_rate = (f[4] - N::constant(held.start[4])) * law.rate_per_s / f[4];
    let two_eta = 2.0 * law.solvent_pa_s;
    let swelling = (rate[0] + rate[3] + hoop_rate) * law.bulk_pa_s;
    let mut cauchy =
        [rate[0] * two_eta + swelling, rate[1] * two_eta, rate[3] * two_eta + swelling, hoop_rate * two_eta + swelling];
    for ((modulus_pa, z), start) in law.modes.iter().zip(held.configurations) {
        let push_forward = push_forward(&shape(f, law.is_apart), &start.map(N::constant));
        let found = relaxed(&push_forward, *z, law.mobility);
        let strains = found.into_iter().zip(AT_REST);
        cauchy.iter_mut().zip(strains).for_each(|(sum, (a, rest))| *sum += (a - N::constant(rest)) * *modulus_pa);
    }
    if law.is_apart {
        let mean = (cauchy[0] + cauchy[2] + cauchy[3]) * (1.0 / 3.0) - swelling;
        cauchy = [cauchy[0] - mean, cauchy[1], cauchy[2] - mean, cauchy[3] - mean];
    }
    let nominal = product(&[cauchy[0], cauchy[1], cauchy[1], cauchy[2]], &transposed(&m));
    [nominal[0], nominal[1], nominal[2], nominal[3], cauchy[3] / f[4]]
}

/// Conformation of a mode at the end of a stage, in undeformed coordinates. `start` is its value at
/// the stage's start, `z` the stage's implicit time divided by the relaxation time.
pub(super) fn configuration(f: &Gradient, start: &Symmetric, z: f64, mobility: f64, is_apart: bool) -> Symmetric {
    let f = &shape(f, is_apart);
    let a = relaxed(&push_forward(f, start), z, mobility);
    let m = inverse(&plane(f));
    let back = [m[0], m[1], m[2], m[3], 1.0 / f[4]];
    push_forward(&back, &a)
}

/// Tangent in Pa: derivative of the first Piola–Kirchhoff stress (first index) with respect to the
/// deformation gradient F (second index). It includes the contribution −p cof F of the pressure p
/// (Pa).
pub(super) fn tangent(held: &PointConstants, f: &Gradient, pressure_pa: f64) -> [Gradient; N_GRADIENT] {
    let mut tangent = [[0.0; N_GRADIENT]; N_GRADIENT];
    for column in 0..N_GRADIENT {
        let mut moving = f.map(Dual::constant);
        moving[column] = Dual::variable(f[column]);
        let (stress, cofactor) = (stress(held, &moving), cofactor(&moving));
        for row in 0..N_GRADIENT {
            tangent[row][column] = stress[row].derivative - pressure_pa * cofactor[row].derivative;
        }
    }
    tangent
}

#[cfg(test)]
mod tests {
    use super::*;

    const F: Gradient = [1.3, -0.4, 0.7, 0.9, 0.8];
    const STARTS: [Symmetric; 2] = [[1.4, 0.3, 0.9, 1.1], [0.7, -0.2, 1.6, 0.8]];
    const MODES: [(f64, f64); 2] = [(1.1, 0.4), (0.3, 2.5)];

    fn held(mobility: f64) -> PointConstants<'static> {
        PointConstants {
            law: StageLaw {
                rate_per_s: 3.0,
                solvent_pa_s: 0.45,
                mobility,
                modes: &MODES,
                volume_compliance_per_pa: 0.1,
                bulk_pa_s: 0.8,
                is_apart: false,
            },
            start: [1.1, -0.2, 0.4, 1.0, 0.9],
            configurations: &STARTS,
            rest: 0.0,
        }
    }

    /// Checks that A at the end of a stage satisfies A + z [(A − 1) + α (A − 1)²] = A*, and that S
    /// gives the same A.
    #[test]
    fn a_stage_fulfils_the_law() {
        for mobility in [0.0, 1e-9, 0.1, 0.5] {
            for (start, (_, z)) in STARTS.iter().zip(MODES) {
                let pushed_start = push_forward(&F, start);
                let a = push_forward(&F, &configuration(&F, start, z, mobility, false));
                let b = [a[0] - 1.0, a[1], a[2] - 1.0, a[3] - 1.0];
                let square = [b[0] * b[0] + b[1] * b[1], b[1] * (b[0] + b[2]), b[1] * b[1] + b[2] * b[2], b[3] * b[3]];
                for k in 0..N_SYMMETRIC {
                    let left = a[k] + z * (b[k] + mobility * square[k]);
                    assert!((left - pushed_start[k]).abs() < 1e-12, "α = {mobility}, {k}: {left} {}", pushed_start[k]);
                }
            }
        }
    }

    /// Checks a mode that does not relax, in a gel after a rest. It must be a neo-Hookean solid,
    /// P = G (F − F⁻ᵀ).
    #[test]
    fn what_does_not_relax_is_a_rubber() {
        let law = StageLaw { modes: &[(2.0, 0.0)], ..held(0.0).law };
        let still = PointConstants { law, start: F, configurations: &[AT_REST], rest: 0.0 };
        let determinant = determinant(&F);
        for ((found, f), cofactor) in stress(&still, &F).into_iter().zip(F).zip(cofactor(&F)) {
            let exact = 2.0 * (f - cofactor / determinant);
            assert!((found - exact).abs() < 1e-13, "{found} {exact}");
        }
    }

    /// Checks the tangent against finite differences of the stress, including the contribution of
    /// the pressure.
    #[test]
    fn the_tangent_is_the_derivative() {
        let (h, pressure_pa) = (1e-6, 0.7);
        for (mobility, is_apart) in [(0.0, false), (0.3, false), (0.0, true)] {
            let mut held = held(mobility);
            held.law.is_apart = is_apart;
            let found = tangent(&held, &F, pressure_pa);
            for column in 0..N_GRADIENT {
                let at = |step: f64| {
                    let mut moved = F;
                    moved[column] += step;
                    let (stress, cofactor) = (stress(&held, &moved), cofactor(&moved));
                    std::array::from_fn::<f64, N_GRADIENT, _>(|row| stress[row] - pressure_pa * cofactor[row])
                };
                let (up, down) = (at(h), at(-h));
                for row in 0..N_GRADIENT {
                    let by_difference = (up[row] - down[row]) / (2.0 * h);
                    assert!((found[row][column] - by_difference).abs() < 1e-7, "{row} {column}");
                }
            }
        }
    }
}
