//! Tests of the balance: its tangent against finite differences, and the convergence of the
//! iterations.

use super::super::Bodies;
use super::*;
use crate::fe::Stiffness;
use crate::fe::nonlinear::NonlinearModel;
use crate::mesh::QuarterBall;
use base::number::Dual;
use laws::rheology::BaseLaw;
use laws::stages::{Nonlinearity, YIELD_SMOOTHING};
use nalgebra::{DMatrix, DVector};

const STEP_S: f64 = 0.4;
const FORCE_N: f64 = 4.6e-6;

fn kinds() -> [Nonlinearity; 3] {
    [
        Nonlinearity::StrainStiffening { coefficient: 1.0 },
        Nonlinearity::ShearThinning { index: 0.5, reference_stress_pa: 4.84 },
        Nonlinearity::YieldStress { stress_pa: 1.0, smoothing: YIELD_SMOOTHING },
    ]
}

/// Calls `check` with a balance on a coarse ball, a stage with non-zero histories, and a
/// displacement. The displacement is about as large as the solution.
fn with_stage(nonlinearity: Nonlinearity, check: impl Fn(&Balance, &NonlinearStage, Vec<f64>)) {
    // Displacement of the robot divided by its displacement in a linear gel under the force.
    let size = 0.1;
    let ball = QuarterBall { robot_radius_m: 0.275e-3, outer_radius_m: 10e-3, n_per_edge: 1, n_layers: 2 };
    let mesh = ball.mesh().expect("the sizes are good");
    let stiffness = Stiffness::new(&mesh).expect("the mesh is good");
    let model = NonlinearModel::new(&mesh, &stiffness, 0.48).expect("positive definite");
    let parameters = [3.527, 1.402, 20.0].map(Dual::constant);
    let bodies = Bodies::new(&BaseLaw::Lethersich.elements(&parameters), nonlinearity.constant()).expect("a sound law");
    let law = StageLaw::new(&bodies, STEP_S);
    let unit = model.factor().unit_response();
    let field: Vec<f64> = unit.iter().map(|u| size * FORCE_N * u).collect();
    let strains = model.strains(&field);
    let histories: Vec<Tensor<f64>> = strains.iter().flat_map(|e| [e.map(|e| 0.3 * e), e.map(|e| -0.2 * e)]).collect();
    let force_n = model.share() * FORCE_N;
    let load = Load { gradient_per_m: 200.0, ..Load::COMMANDED.of() };
    let push = RobotForce { force_n, load: &load };
    let stage = NonlinearStage { law: &law, histories: &histories, n_histories: 2, push };
    let wavy = field.iter().enumerate().map(|(i, u)| u * (1.0 + 0.1 * (i as f64).sin())).collect();
    check(&Balance(&model), &stage, wavy);
}

/// Returns the tangent, including its asymmetric part, as a dense matrix.
fn dense_tangent(balance: &Balance, stage: &NonlinearStage, displacement: &[f64]) -> DMatrix<f64> {
    let now = balance.evaluate(stage, displacement);
    let n = displacement.len();
    let columns: Vec<DVector<f64>> = (0..n)
        .map(|i| {
            let mut unit = vec![0.0; n];
            unit[i] = 1.0;
            DVector::from_vec(balance.apply(&now, &unit, false))
        })
        .collect();
    DMatrix::from_columns(&columns)
}

#[test]
fn the_tangent_is_the_residuals_derivative() {
    for nonlinearity in kinds() {
        with_stage(nonlinearity, |balance, stage, displacement| {
            let tangent = dense_tangent(balance, stage, &displacement);
            let size = displacement.iter().fold(0.0_f64, |m, u| m.max(u.abs()));
            for seed in 0..3_u32 {
                let direction: Vec<f64> =
                    (0..displacement.len()).map(|i| size * (0.7 * i as f64 + f64::from(seed)).sin()).collect();
                let at = |share: f64| {
                    let moved: Vec<f64> = displacement.iter().zip(&direction).map(|(u, d)| u + share * d).collect();
                    DVector::from_vec(balance.evaluate(stage, &moved).residual)
                };
                let difference = (at(-1e-6) - at(1e-6)) / 2e-6;
                let exact = &tangent * DVector::from_column_slice(&direction);
                let error = (&exact - &difference).amax() / exact.amax();
                assert!(error < 2e-7, "{nonlinearity:?}: {error:e}");
            }
        });
    }
}

/// Checks that the complete tangent nearly doubles the number of correct digits per step.
#[test]
fn newtons_method_converges_quadratically_with_the_whole_tangent() {
    for nonlinearity in kinds() {
        with_stage(nonlinearity, |balance, stage, mut displacement| {
            balance.solve(stage, &mut displacement, 1e-4 * FORCE_N).expect("a start near the solution");
            displacement.iter_mut().enumerate().for_each(|(i, u)| *u *= 1.0 + 0.05 * (i as f64).sin());
            let mut norms = Vec::new();
            for _ in 0..4 {
                let now = balance.evaluate(stage, &displacement);
                norms.push(now.norm);
                let tangent = dense_tangent(balance, stage, &displacement);
                let step = tangent.lu().solve(&DVector::from_vec(now.residual)).expect("regular");
                displacement.iter_mut().zip(step.iter()).for_each(|(u, d)| *u += d);
            }
            let gain = |k: usize| (norms[k + 1] / norms[k]).ln();
            assert!(norms[1] < 0.05 * norms[0] && norms[2] < 0.01 * norms[1], "{nonlinearity:?} {norms:?}");
            assert!(gain(1) < 1.5 * gain(0), "{nonlinearity:?} {norms:?}");
        });
    }
}

/// Checks that each step of the program's iteration leaves at most a twentieth of the residual. It
/// must end where a step with the complete tangent is zero.
#[test]
fn the_iteration_with_conjugate_gradients_converges_to_the_balance() {
    for nonlinearity in kinds() {
        with_stage(nonlinearity, |balance, stage, mut displacement| {
            let tolerance = 1e-11 * balance.0.unit_compliance_per_m().sqrt() * FORCE_N;
            let solved = balance.solve(stage, &mut displacement, tolerance).expect("converges");
            let last = solved.norms.len() - 1;
            assert!(solved.norms[last] < tolerance && last < 12, "{nonlinearity:?} {:?}", solved.norms);
            assert!(solved.norms[last] < 0.2 * solved.norms[last - 1], "{:?}", solved.norms);
            let rest = DVector::from_vec(balance.evaluate(stage, &displacement).residual);
            let step = dense_tangent(balance, stage, &displacement).lu().solve(&rest).expect("regular");
            assert!(step.amax() < 1e-9 * displacement[balance.0.robot()].abs(), "{nonlinearity:?}");
        });
    }
}
