//! Shows that one mode suffices at one Poisson ratio, and three over a range: `cargo run --release --example poisson_family -- [DIR for the figure]`.

use vitreo_uq::elements::fe::Stiffness;
use vitreo_uq::elements::mesh::QuarterBall;
use vitreo_uq::figures::singular_values::{Family, singular_values};
use vitreo_uq::figures::svg::write_figure;
use vitreo_uq::laws::rheology::BaseLaw;
use vitreo_uq::models::model::TrainedRange;
use vitreo_uq::models::surrogate::{Surrogate, Training};

fn main() -> vitreo_uq::Result<()> {
    let ball = QuarterBall { robot_radius_m: 0.275e-3, outer_radius_m: 10e-3, n_per_edge: 3, n_layers: 12 };
    let stiffness = Stiffness::new(&ball.mesh()?)?;
    let time_s: Vec<f64> = (0..200).map(|i| 0.05 * f64::from(i)).collect();
    let force_n: Vec<f64> = (0..200).map(|i| if i < 100 { 4.6e-6 } else { -4.6e-6 }).collect();
    let range = |name: &str, lower, upper| TrainedRange { name: name.into(), lower, upper };
    let parameters = [
        range("young_modulus_pa", 0.5, 20.0),
        range("viscosity_1_pa_s", 0.2, 10.0),
        range("viscosity_2_pa_s", 5.0, 500.0),
    ];
    let train = |poisson_ratio| {
        let law = BaseLaw::Lethersich;
        Surrogate::train(
            &stiffness,
            &Training {
                law,
                parameters: &parameters,
                poisson_ratio,
                time_s: &time_s,
                force: (&force_n).into(),
                tolerance: 1e-5,
            },
        )
    };
    let (one, family) = (train([0.48, 0.48])?, train([0.3, 0.499])?);
    println!("Poisson ratio 0.48: {} mode, error {:.0e}", one.n_modes(), one.max_relative_error);
    println!("Poisson ratio 0.3 to 0.499: {} modes, error {:.0e}", family.n_modes(), family.max_relative_error);
    println!("compliance at 0.48: {:.2} per m", family.compliance_per_m(0.48)?);
    if let Some(dir) = std::env::args_os().nth(1) {
        let families = [
            Family { label: "base model", singular_values: first(&one), n_chosen: one.n_modes() },
            Family { label: "Poisson ratio 0.3–0.499", singular_values: first(&family), n_chosen: family.n_modes() },
        ];
        let figure = singular_values(&families, one.tolerance, "POD of full finite-element snapshots")?;
        write_figure(std::path::Path::new(&dir), "singular_values", &figure)?;
    }
    Ok(())
}

/// The first twelve singular values.
fn first(surrogate: &Surrogate) -> &[f64] {
    let n = surrogate.singular_values.len().min(12);
    &surrogate.singular_values[..n]
}
