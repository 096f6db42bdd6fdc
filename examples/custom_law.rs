//! Defines a law as a network of springs, dashpots and springpots: `cargo run --release --example custom_law`.
//!
//! The law is the standard linear solid (a spring in series with a Kelvin–Voigt body) on an instrument with a known displacement per force at unit creep
//! compliance. `model.toml` contains the same text under `[base.network]`.

use vitreo_uq::Result;
use vitreo_uq::base::error::{InputPlace, Setting};
use vitreo_uq::laws::rheology::{BaseLaw, Network};
use vitreo_uq::models::model::{Compliance, Forward, Model, Response, SurrogateForward};
use vitreo_uq::record::CharacteristicSizes;

const NETWORK: &str = r#"series = [{ spring = "gel" }, { parallel = [{ spring = "mesh" }, { dashpot = "water" }] }]"#;

fn main() -> Result<()> {
    let law = BaseLaw::Network(Network::from_text("network.toml".as_ref(), NETWORK)?);
    let names: Vec<&str> = law.parameters().iter().map(|parameter| parameter.name).collect();
    println!("parameters: {}", names.join(", "));
    let model = Model::new(law, Vec::new(), CharacteristicSizes::default(), &InputPlace::setting(Setting::Base))?;
    // A force of 1 µN for 5 s, then 5 s of rest.
    let time_s: Vec<f64> = (0..=100).map(|row| 0.1 * f64::from(row)).collect();
    let force_n: Vec<f64> = time_s.iter().map(|time| if *time < 5.0 { 1e-6 } else { 0.0 }).collect();
    let forward = SurrogateForward {
        model: &model,
        compliance: Compliance::fixed(500.0),
        response: Response::new(&time_s, &force_n, time_s.len()),
        trained: &[],
    };
    let position_m = forward.trajectory_m(&[8.0, 4.0, 6.0])?;
    for row in [10, 50, 51, 100] {
        println!("{:.1} s: {:.4} µm", time_s[row], 1e6 * position_m[row]);
    }
    Ok(())
}
