//! Defines an effect outside the library, and extends a model by it: `cargo run --release --example custom_effect`.
//!
//! `thermal-drift`: the stage warms up and moves the camera. The recorded position is x + A (1 − e^{−t/τ}), with amplitude A and time constant τ. The null is A
//! = 0, at which τ is unidentified.

use vitreo_uq::Result;
use vitreo_uq::base::distribution::Distribution;
use vitreo_uq::base::number::Dual;
use vitreo_uq::base::parameter::{ParameterSpec, Support};
use vitreo_uq::figures::labels;
use vitreo_uq::jobs::extend::{self, ExtensionRequest};
use vitreo_uq::models::effects::{DriftApproach, Effect, EffectDescription, EffectParameter, Library, Stage, Stages};
use vitreo_uq::posterior::monitor::SilentMonitor;
use vitreo_uq::posterior::problem::Problem;
use vitreo_uq::posterior::replica;
use vitreo_uq::posterior::study::ModelSpecification;
use vitreo_uq::record::CharacteristicSizes;

struct ThermalDrift;

const PARAMETERS: &[EffectParameter] = &[
    EffectParameter {
        spec: ParameterSpec::new("thermal-drift.amplitude_m", "A", "m", Support::REAL),
        null: &|_| Some(0.0),
        prior: &|scales| Distribution::Normal { mean: 0.0, sd: 0.1 * scales.position_range_m.max(1e-9) },
        prior_source: "chosen: a tenth of the range of positions",
    },
    EffectParameter {
        spec: ParameterSpec::new("thermal-drift.time_s", "τ", "s", Support::POSITIVE),
        null: &|_| None,
        prior: &|scales| Distribution::LogNormal { median: scales.duration_s, log_sd: 1.0 },
        prior_source: "chosen: about as long as the record",
    },
];

impl Effect for ThermalDrift {
    fn description(&self) -> EffectDescription {
        EffectDescription {
            slug: "thermal-drift",
            stage: Stage::Observation,
            summary: "the stage warms up and carries the camera along",
            equation: "x_obs = x + A (1 − exp(−t/τ))",
            parameters: PARAMETERS,
        }
    }
    fn apply(&self, parameters: &[Dual], _scales: &CharacteristicSizes, stages: &mut Stages) -> Result<()> {
        if !parameters[0].is_constant(0.0) {
            stages.observation.approaches.push(DriftApproach { amplitude_m: parameters[0], time_s: parameters[1] });
        }
        Ok(())
    }
}

fn main() -> Result<()> {
    let library = Library::default().with(&ThermalDrift);
    // The replica as recorded on a warming stage: 30 µm within about 8 s.
    let (mut experiment, _) = replica::embedded()?;
    let record = &mut experiment.record;
    let drift_m = |t: &f64| 30e-6 * (1.0 - (-t / 8.0).exp());
    record.position_m.iter_mut().zip(&record.time_s).for_each(|(x, t)| *x = x.map(|x| x + drift_m(t)));
    let base = Problem::with_library(experiment, ModelSpecification::default(), &library, None, &SilentMonitor)?;
    let effects = [ThermalDrift.slug().to_string()];
    let request = ExtensionRequest { effects: &effects, ..ExtensionRequest::default() };
    let pair = extend::prepare_comparison(&base, &request, &library)?;
    let summary = extend::refit(pair, &request, &SilentMonitor)?.summary;
    println!("{}", summary.sentence);
    summary.parameters.iter().for_each(|p| println!("{} = {:.3e} ± {:.1e}", p.name, p.mean, p.sd));
    println!("Figures label the first parameter {}.", labels::parameter_label(PARAMETERS[0].spec.name).axis());
    Ok(())
}
