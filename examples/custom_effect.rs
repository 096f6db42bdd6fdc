//! An effect of your own, added from outside the crate: `cargo run --example custom_effect`.
//!
//! `thermal-drift`: the stage warms up and carries the camera along, x_obs = x + A (1 − e^{−t/τ}). Null: A = 0, where τ means nothing.

use vitreo_uq::Result;
use vitreo_uq::distribution::Distribution;
use vitreo_uq::effects::{Approach, Effect, EffectParameter, Library, Stage, Stages};
use vitreo_uq::error::Place;
use vitreo_uq::experiment::Scales;
use vitreo_uq::model::Model;
use vitreo_uq::number::Dual;
use vitreo_uq::parameter::{ParameterSpec, Support};
use vitreo_uq::rheology::BaseLaw;
use vitreo_uq::workflow::replica;

struct ThermalDrift;

const PARAMETERS: &[EffectParameter] = &[
    EffectParameter {
        spec: ParameterSpec::new("thermal-drift.amplitude_m", "m", Support::REAL),
        symbol: "A",
        null: |_| Some(0.0),
        prior: |scales| Distribution::Normal { mean: 0.0, sd: 0.1 * scales.position_range_m.max(1e-9) },
        prior_source: "chosen: a tenth of the range of positions",
        finite_step: None,
    },
    EffectParameter {
        spec: ParameterSpec::new("thermal-drift.time_s", "s", Support::POSITIVE),
        symbol: "τ",
        null: |_| None,
        prior: |scales| Distribution::LogNormal { median: scales.duration_s, log_sd: 1.0 },
        prior_source: "chosen: about as long as the record",
        finite_step: None,
    },
];

impl Effect for ThermalDrift {
    fn slug(&self) -> &'static str {
        "thermal-drift"
    }
    fn stage(&self) -> Stage {
        Stage::Observation
    }
    fn summary(&self) -> &'static str {
        "the stage warms up and carries the camera along"
    }
    fn equation(&self) -> &'static str {
        "x_obs = x + A (1 − exp(−t/τ))"
    }
    fn parameters(&self) -> &'static [EffectParameter] {
        PARAMETERS
    }
    fn apply(&self, parameters: &[Dual], _scales: &Scales, stages: &mut Stages) -> Result<()> {
        if !parameters[0].is_constant(0.0) {
            stages.observation.approaches.push(Approach { amplitude_m: parameters[0], time_s: parameters[1] });
        }
        Ok(())
    }
}

fn main() -> Result<()> {
    let library = Library::default().with(&ThermalDrift);
    let (experiment, _) = replica::embedded()?;
    let effects = library.get("thermal-drift").into_iter().collect();
    let model = Model::new(BaseLaw::Lethersich, effects, experiment.scales(), &Place::option("--with"))?;
    let stages = model.stages(&[3.527, 1.402, 47.37, 5e-5, 30.0].map(Dual::constant))?;
    println!("{} effects; the last adds {:?}", library.effects().len(), stages.observation.approaches);
    Ok(())
}
