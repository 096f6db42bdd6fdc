//! Tests of the law at one point: the stage's stress in the law's equations, tangents and
//! derivatives against finite differences, and limits.

use super::*;
use laws::rheology::BaseLaw;
use laws::stages::YIELD_SMOOTHING;

const P: [f64; 5] = [3.527, 1.402, 47.370, 20.0, 2.5];
const STEP_S: f64 = 0.3;
const STRAIN: Tensor<f64> = [0.7, -0.4, 0.2, 0.5, -0.1, 0.03];
const HISTORIES: [Tensor<f64>; 3] =
    [[0.1, 0.2, -0.1, 0.05, 0.0, 0.01], [-0.2, 0.1, 0.3, 0.0, 0.1, -0.02], [0.05, -0.03, 0.02, 0.1, 0.2, 0.004]];

fn kinds() -> Vec<Nonlinearity> {
    vec![
        Nonlinearity::StrainStiffening { coefficient: 0.8 },
        Nonlinearity::ShearThinning { index: 0.45, reference_stress_pa: 2.0 },
        Nonlinearity::ShearThinning { index: 0.8, reference_stress_pa: 0.7 },
        Nonlinearity::YieldStress { stress_pa: 1.5, smoothing: YIELD_SMOOTHING },
        Nonlinearity::YieldStress { stress_pa: 0.2, smoothing: 0.3 },
    ]
}

fn bodies<N: Number>(base: BaseLaw, nonlinearity: Nonlinearity<Dual>, parameters: &[Dual]) -> Bodies<N> {
    Bodies::new(&base.elements(&parameters[..base.parameters().len()]), nonlinearity).expect("a sound law")
}

fn stress_of<N: Number>(law: &StageLaw<N>, strain: &Tensor<N>, histories: &[Tensor<N>]) -> Tensor<N> {
    let offset = law.offset(histories);
    let a: Tensor<N> = std::array::from_fn(|i| strain[i] + offset[i]);
    let moduli = law.moduli(deviator_norm(&a));
    std::array::from_fn(|i| {
        let modulus = if i < 5 { moduli.secant } else { moduli.volumetric };
        modulus * a[i] - law.kappa * histories[0][i]
    })
}

fn equivalent(tensor: &Tensor<f64>) -> f64 {
    (2.0 / 3.0 * tensor[..5].iter().map(|t| t * t).sum::<f64>()).sqrt()
}

/// Checks the equation of every body over an implicit Euler step, and that the bodies' strains add
/// up to the total strain.
#[test]
fn the_stress_satisfies_the_equations_of_every_body() {
    for base in BaseLaw::NAMED {
        for kind in kinds() {
            let law = StageLaw::new(&bodies::<f64>(base, kind.constant(), &P.map(Dual::constant)), STEP_S);
            let n = if base == BaseLaw::TwoElement { 3 } else { 2 };
            let mut ends = HISTORIES[..n].to_vec();
            let s = stress_of(&law, &STRAIN, &ends);
            law.advance(&STRAIN, &s, &mut ends);
            let rate = |body: usize, i: usize| (ends[body][i] - HISTORIES[body][i]) / STEP_S;
            let stiffens = matches!(kind, Nonlinearity::StrainStiffening { .. });
            let (kelvin_voigt, dashpot) = if stiffens { (0, 1) } else { (1, 0) };
            for i in 0..6 {
                let (mut stiffness, mut fluidity) = (P[0], 1.0 / P[2]);
                match kind {
                    Nonlinearity::StrainStiffening { coefficient } if i < 5 => {
                        stiffness *= 1.0 + coefficient * equivalent(&ends[kelvin_voigt]).powi(2);
                    }
                    Nonlinearity::StrainStiffening { .. } => {}
                    Nonlinearity::ShearThinning { index, reference_stress_pa } => {
                        fluidity *= (equivalent(&s) / reference_stress_pa).powf(1.0 / index - 1.0);
                    }
                    Nonlinearity::YieldStress { stress_pa, smoothing } => {
                        fluidity *= smoothed_yield(equivalent(&s), stress_pa, smoothing)[0];
                    }
                }
                let body = stiffness * ends[kelvin_voigt][i] + P[1] * rate(kelvin_voigt, i);
                assert!((body - s[i]).abs() < 1e-9, "{base:?} {kind:?} {i}: {body} {}", s[i]);
                assert!((rate(dashpot, i) - fluidity * s[i]).abs() < 1e-9, "{base:?} {kind:?} {i}");
                let mut sum = ends[0][i] + ends[1][i];
                if base == BaseLaw::Burgers {
                    sum += s[i] / P[3];
                }
                if base == BaseLaw::TwoElement {
                    assert!((P[3] * ends[2][i] + P[4] * rate(2, i) - s[i]).abs() < 1e-9, "{kind:?}");
                    sum += ends[2][i];
                }
                assert!((sum - STRAIN[i]).abs() < 1e-12, "{base:?} {kind:?} {i}");
            }
        }
    }
}

/// Compares all 36 entries of ds/dε with central differences, whose error is about 1e-9 here.
#[test]
fn tangents_are_finite_differences() {
    for kind in kinds() {
        let law = StageLaw::new(&bodies::<f64>(BaseLaw::TwoElement, kind.constant(), &P.map(Dual::constant)), STEP_S);
        let offset = law.offset(&HISTORIES);
        let a: Tensor<f64> = std::array::from_fn(|i| STRAIN[i] + offset[i]);
        let norm = deviator_norm(&a);
        let moduli = law.moduli(norm);
        for column in 0..6 {
            let at = |change: f64| {
                let mut strain = STRAIN;
                strain[column] += change;
                stress_of(&law, &strain, &HISTORIES)
            };
            let (up, down) = (at(1e-5), at(-1e-5));
            for row in 0..6 {
                let difference = (up[row] - down[row]) / 2e-5;
                let along = if column < 5 { a[column] / norm } else { 0.0 };
                let exact = match (row, column) {
                    (5, 5) => moduli.volumetric,
                    (5, _) => moduli.coupling * a[5] * along,
                    (_, 5) => 0.0,
                    _ => {
                        let across = if row == column { moduli.secant } else { 0.0 };
                        across + (moduli.normal - moduli.secant) * along * a[row] / norm
                    }
                };
                assert!((exact - difference).abs() < 3e-8, "{kind:?} {row} {column}: {exact} {difference}");
            }
        }
    }
}

/// Compares automatic derivatives with central differences. They are taken with respect to every
/// parameter, the step and the strain.
#[test]
fn derivatives_are_carried_through_the_scalar_equation() {
    let moved = |kind: Nonlinearity<Dual>, by: Dual| match kind {
        Nonlinearity::StrainStiffening { coefficient } => {
            Nonlinearity::StrainStiffening { coefficient: coefficient + by }
        }
        Nonlinearity::ShearThinning { index, reference_stress_pa } => {
            Nonlinearity::ShearThinning { index: index + by, reference_stress_pa }
        }
        Nonlinearity::YieldStress { stress_pa, smoothing } => {
            Nonlinearity::YieldStress { stress_pa: stress_pa + by, smoothing }
        }
    };
    for kind in kinds() {
        for which in 0..8 {
            let at = |by: Dual| {
                let share = |i: usize| if i == which { by } else { Dual::ZERO };
                let parameters: [Dual; 5] = std::array::from_fn(|i| Dual::constant(P[i]) + share(i));
                let kind = moved(kind.constant(), share(5));
                let law = StageLaw::new(&bodies::<Dual>(BaseLaw::TwoElement, kind, &parameters), share(6) + STEP_S);
                let strain = STRAIN.map(|e| Dual::constant(e) + share(7));
                stress_of(&law, &strain, &HISTORIES.map(|h| h.map(Dual::constant)))
            };
            let found = at(Dual::variable(0.0));
            let (up, down) = (at(Dual::constant(1e-5)), at(Dual::constant(-1e-5)));
            for i in 0..6 {
                let difference = (up[i].value - down[i].value) / 2e-5;
                let error = (found[i].derivative - difference).abs();
                assert!(error < 1e-7 * (1.0 + difference.abs()), "{kind:?} {which} {i}: {error}");
            }
        }
    }
}

/// Checks that at their nulls all three nonlinear laws equal the linear law to rounding: stress =
/// (strain − history) / compliance.
#[test]
fn nulls_are_the_linear_law() {
    let exact = {
        let [e, c1, c2, ..] = P;
        let (body, fluidity) = (1.0 / (e + c1 / STEP_S), STEP_S / c2);
        move |strain: f64, body_history: f64, dashpot_history: f64| {
            (strain - c1 / STEP_S * body * body_history - dashpot_history) / (body + fluidity)
        }
    };
    for (kind, body, dashpot) in [
        (Nonlinearity::StrainStiffening { coefficient: 0.0 }, 0, 1),
        (Nonlinearity::ShearThinning { index: 1.0, reference_stress_pa: 2.0 }, 1, 0),
        (Nonlinearity::YieldStress { stress_pa: 0.0, smoothing: YIELD_SMOOTHING }, 1, 0),
    ] {
        let law = StageLaw::new(&bodies::<f64>(BaseLaw::Lethersich, kind.constant(), &P.map(Dual::constant)), STEP_S);
        let s = stress_of(&law, &STRAIN, &HISTORIES[..2]);
        for i in 0..6 {
            let exact = exact(STRAIN[i], HISTORIES[body][i], HISTORIES[dashpot][i]);
            assert!((s[i] - exact).abs() < 1e-13, "{kind:?} {i}: {} {exact}", s[i]);
        }
        let rest = stress_of(&law, &[0.0; 6], &[[0.0; 6]; 2]);
        assert_eq!(rest, [0.0; 6]);
    }
}

/// Checks the documented properties of the smoothed yield law, for small and large δ.
#[test]
fn the_smoothed_bracket_is_convex_and_near_the_sharp_one() {
    for smoothing in [0.3, 0.1, YIELD_SMOOTHING] {
        let sharp = |m: f64| (m - 2.0_f64).max(0.0);
        let mut slope_before = 0.0;
        for i in 0..2000 {
            let m = 0.01 * f64::from(i);
            let [share, slope] = smoothed_yield(m, 2.0, smoothing);
            let excess = m * share - sharp(m);
            assert!(excess >= 0.0 && excess <= 2.0 * smoothing * (1.0 + 1e-12), "{m}: {excess}");
            assert!(slope >= slope_before && slope > 0.0, "{m}");
            slope_before = slope;
        }
        let squared = smoothing * smoothing;
        assert!((smoothed_yield(1e-9, 2.0, smoothing)[0] / squared - 1.0).abs() < 1e-8);
        let far = 2e5;
        assert!((far * smoothed_yield(far, 2.0, smoothing)[0] - (far - 2.0) - 2.0 * squared).abs() < 1e-4 * squared);
        assert_eq!(smoothed_yield(0.7, 0.0, smoothing)[0], 1.0);
    }
    let at_yield = |smoothing: f64| 2.0 * smoothed_yield(2.0, 2.0, smoothing)[0];
    assert!((at_yield(0.1) - 0.2).abs() < 1e-15 && (at_yield(0.001) - 0.002).abs() < 1e-15);
}
