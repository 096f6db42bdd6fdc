//! The full-order model's general time stepping on a mesh, against its exact scheme for the base law.

use vitreo_uq::base::number::Dual;
use vitreo_uq::elements::fe::Stiffness;
use vitreo_uq::elements::fe::stepping::Resolution;
use vitreo_uq::elements::fe::time::{FullOrderModel, TimeScheme};
use vitreo_uq::elements::mesh::QuarterBall;
use vitreo_uq::laws::rheology::BaseLaw;
use vitreo_uq::models::effects::{DriftApproach, Stages};

/// Largest difference over the largest value of `exact`.
fn distance(found: &[f64], exact: &[f64]) -> f64 {
    assert_eq!(found.len(), exact.len());
    let amplitude = exact.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
    found.iter().zip(exact).fold(0.0_f64, |m, (a, b)| m.max((a - b).abs())) / amplitude
}

#[test]
fn positions_and_fields_are_those_of_the_exact_scheme_and_the_camera_sees_them_as_told() {
    let ball = QuarterBall { robot_radius_m: 0.275e-3, outer_radius_m: 10e-3, n_per_edge: 1, n_layers: 3 };
    let stiffness = Stiffness::new(&ball.mesh().expect("the radii are in order")).expect("a sound mesh");
    let model = FullOrderModel::new(&stiffness, 0.48).expect("positive definite");
    let time_s: Vec<f64> = (0..60).map(|i| 5.0 + 0.1 * f64::from(i)).collect();
    let force_n: Vec<f64> = (0..60).map(|i| [4.6e-6, 0.0, -4.6e-6][i / 20]).collect();
    let parameters = [3.527, 1.402, 47.370];
    let mut stages = Stages::of_law(BaseLaw::Lethersich.elements(&parameters.map(Dual::constant)));
    stages.observation.scale = Dual::constant(1.2);
    stages.observation.velocity_m_per_s = Dual::constant(2e-6);
    stages.observation.approaches =
        vec![DriftApproach { amplitude_m: Dual::constant(1e-5), time_s: Dual::constant(0.7) }];

    let stepped = model.step(&stages, &time_s, &force_n, Resolution::default()).expect("a sound model");
    let load = model.solve_load(&time_s, &force_n);
    let law = BaseLaw::Lethersich.creep_compliance(&parameters).unwrap();
    let exact = model.trajectory(&load, &law, TimeScheme::Exponential);
    assert!(distance(&stepped.displacement_m, &exact) < 2e-8);
    let seen = |(x, t): (&f64, &f64)| 1.2 * x + 2e-6 * (t - 5.0) + 1e-5 * (1.0 - (-(t - 5.0) / 0.7).exp());
    let seen: Vec<f64> = exact.iter().zip(&time_s).map(seen).collect();
    assert!(distance(&stepped.position_m, &seen) < 2e-8);

    let fields = model.fields_of(&stepped, &[7, 45, 60]);
    let exact = model.fields(&load, &law, &[7, 45]);
    assert_eq!(fields.len(), 2, "the record has no row 60");
    for (field, exact) in fields.iter().zip(&exact) {
        assert!(distance(field, exact) < 2e-8);
    }
}
