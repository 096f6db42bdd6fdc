//! A free memory: retardations at times on a logarithmic grid, with amplitudes of at least 0, in series with the law.

use std::sync::Arc;

use base::distribution::Distribution;
use base::error::Result;
use base::number::Dual;
use base::parameter::{ParameterSpec, Support};
use criticism::Subject;
use laws::rheology::Element;
use models::effects::{Effect, EffectDescription, EffectParameter, FieldEffect, Stage, Stages};
use posterior::study::effect_file::leak;
use record::CharacteristicSizes;

/// Number of retardation times per decade, and largest number of times (`MOST_TIMES`).
const TIMES_PER_DECADE: f64 = 1.5;
const MOST_TIMES: usize = 8;

/// Addition to the creep compliance, J += (1/E) Σ aₖ (1 − e^{−t/τₖ}) with amplitudes aₖ ≥ 0 and retardation times τₖ. Here 1/E is the law's compliance at the time of a hold.
pub struct Creep {
    /// Retardation times τₖ in s.
    pub times_s: Arc<[f64]>,
    parameters: &'static [EffectParameter],
}

/// Returns the memory that an experiment can resolve, with retardation times from three sample intervals to the hold or cycle; `None` if this range is too short.
pub fn creep(subject: &Subject) -> Option<&'static Creep> {
    let scales = subject.experiment().scales();
    let (shortest_s, longest_s) = (3.0 * scales.sample_interval_s, scales.hold_s.max(scales.cycle_s));
    let decades = (longest_s / shortest_s).log10();
    if !(decades.is_finite() && decades > 0.3) {
        return None;
    }
    let n = ((TIMES_PER_DECADE * decades).round() as usize + 1).clamp(2, MOST_TIMES);
    let times_s: Arc<[f64]> = (0..n).map(|k| shortest_s * 10.0_f64.powf(decades * k as f64 / (n - 1) as f64)).collect();
    let parameter = |k: usize| EffectParameter {
        spec: ParameterSpec::new(
            leak(format!("creep.share_{k}")),
            "a",
            "1",
            Support { lower: 0.0, upper: f64::INFINITY },
        ),
        null: &|_| Some(0.0),
        prior: &|_| Distribution::HalfNormal { sd: 1.0 },
        prior_source: "a spectrum about zero",
    };
    let parameters = Box::leak((0..n).map(parameter).collect::<Vec<_>>().into_boxed_slice());
    Some(Box::leak(Box::new(Creep { times_s, parameters })))
}

impl Effect for Creep {
    fn description(&self) -> EffectDescription {
        EffectDescription {
            slug: "creep",
            stage: Stage::Mechanics,
            summary: "the law has additional retardation times",
            equation: "J += (1/E) Σ a (1 − e^{−t/τ})",
            parameters: self.parameters,
        }
    }
    fn conflict_with_field(&self, _field: FieldEffect) -> Option<&'static str> {
        Some("a free memory cannot be combined with a solved displacement field")
    }
    fn apply(&self, parameters: &[Dual], scales: &CharacteristicSizes, stages: &mut Stages) -> Result<()> {
        let hold_s = if scales.hold_s > 0.0 { scales.hold_s } else { 1.0 };
        let unit_per_pa = Dual::ONE / Element::Series(stages.law.clone()).operator_pa(hold_s);
        let bodies = parameters.iter().zip(self.times_s.iter()).map(|(share, time_s)| Element::Retarded {
            compliance_per_pa: *share * unit_per_pa,
            time_s: Dual::constant(*time_s),
        });
        stages.law.extend(bodies);
        Ok(())
    }
}
