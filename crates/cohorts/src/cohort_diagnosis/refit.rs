//! Fits of the claimed effect to each record, together with law and noise. The fits give the effect's size, gain and held-out error.

use super::law::{Nodes, Place, SizeLawGrid};
use super::likelihood::SizeLikelihood;
use base::error::Result;
use criticism::predicted::allowed_noise_um;
use criticism::sketch::{BaseFit, EffectSignature};
use criticism::{Candidate, Fitted, Search, Subject, Tangent};

/// Smallest gain in log likelihood (nats) with which a fitted size replaces the first-order likelihood. With a smaller gain, the size may be at its null,
/// and the first-order likelihood suffices.
const LEAST_NATS: f64 = 4.5;

/// Fit of a cohort's claimed effect to one record.
pub struct SizeFit {
    /// Likelihood of the size; `None` if the first-order likelihood should be used instead.
    pub likelihood: Option<SizeLikelihood>,
    /// Coordinates and noise of this fit, from which fits with a given size of the effect start. `None` if the effect cannot be fitted.
    start: Option<Fitted>,
}

/// Fits of the base model without and with the effect, to the same cycles of a record.
struct BaseAndEffectFit {
    candidate: Candidate,
    without: Fitted,
    fitted: Fitted,
}

impl BaseAndEffectFit {
    /// Makes both fits; `None` if the effect cannot be added or a model cannot be evaluated.
    ///
    /// # Errors
    /// Errors of [`Subject::extended`].
    fn new(subject: &Subject, record: &BaseFit, asked: &EffectSignature) -> Result<Option<Self>> {
        if asked.refused.is_some() {
            return Ok(None);
        }
        let candidate = subject.extended(&[asked.slug])?;
        let base = &record.base.candidate;
        let start = (record.base.fitted.theta.clone(), record.base.fitted.noise);
        let Ok(without) = subject.fit(base, &[start], Search::Local) else { return Ok(None) };
        let start = (candidate.embed(base, &without.theta), without.noise);
        let Ok(fitted) = subject.fit(&candidate, &[start], Search::Local) else { return Ok(None) };
        Ok(Some(Self { candidate, without, fitted }))
    }

    fn gain_nats(&self) -> f64 {
        self.fitted.objective - self.without.objective
    }
}

/// Fits an effect to the fitted cycles of a record, and returns the gain in log likelihood (nats). `None` if the effect cannot be fitted.
///
/// # Errors
/// Errors of [`Subject::extended`].
pub fn gain_nats(subject: &Subject, record: &BaseFit, asked: &EffectSignature) -> Result<Option<f64>> {
    Ok(BaseAndEffectFit::new(subject, record, asked)?.map(|both| both.gain_nats()))
}

/// Fits an effect to the cycles that `subject` defines as fitted, and returns the likelihood of its size.
///
/// # Errors
/// Errors of building the model. It is no error if the effect cannot be added.
pub fn fit_size(subject: &Subject, record: &BaseFit, asked: &EffectSignature) -> Result<SizeFit> {
    let none = SizeFit { likelihood: None, start: None };
    let Some(both) = BaseAndEffectFit::new(subject, record, asked)? else { return Ok(none) };
    let (gain, BaseAndEffectFit { candidate, fitted, .. }) = (both.gain_nats(), both);
    let Some(place) = candidate.free.iter().position(|free| free.name == asked.parameter) else { return Ok(none) };
    let likelihood = if gain > LEAST_NATS {
        let sd = Tangent::new(subject, &candidate, &fitted)?.standard_deviations()[place];
        let (free, theta) = (&candidate.free[place], fitted.theta[place]);
        let value = |theta: f64| free.coordinate.value(free.clamped(theta));
        // Converts the standard deviation to the parameter's unit, with the slope at the fit.
        let sd = 0.5 * (value(theta + sd) - value(theta - sd)).abs();
        let size = value(theta) - asked.null;
        let size = if asked.is_downwards { -size } else { size };
        (sd > 0.0 && sd.is_finite()).then(|| SizeLikelihood::fitted(size, sd, gain, asked.reach))
    } else {
        None
    };
    Ok(SizeFit { likelihood, start: Some(fitted) })
}

/// Fit of a record with the effect held at the size that the cohort's size law predicts for this record.
pub struct SizedPrediction {
    /// Probability that the record has the effect.
    pub has: f64,
    /// Value of the effect's parameter: its mean over all possible sizes, including no effect.
    pub value: f64,
    /// Parameters of the base law, in the order of the base model.
    pub law: Vec<f64>,
    /// Root mean square error (µm) on the scored cycle, and the number of positions in this cycle. `None` if no cycle is held out.
    pub heldout: Option<(f64, usize)>,
    /// Root mean square error (µm) on the scored cycle that the predictive noise allows. `None` if no cycle is held out.
    pub allowed_um: Option<f64>,
}

/// Holds the effect at the size that the cohort's size law predicts for a record, and fits the law and the noise.
///
/// # Errors
/// Errors of building the model.
pub fn predict_at_cohort_size(
    subject: &Subject,
    record: &BaseFit,
    (asked, sized): (&EffectSignature, &SizeFit),
    (laws, nodes, place): (&SizeLawGrid, &Nodes, Place),
) -> Result<SizedPrediction> {
    let (has, sizes) = laws.specimen_posterior(nodes, place);
    let size = has * sizes.iter().map(|(size, weight)| size * weight).sum::<f64>();
    let value = asked.null + if asked.is_downwards { -size } else { size };
    let of_base = || SizedPrediction {
        has,
        value,
        law: law_of(record, &record.base.fitted.theta),
        heldout: heldout_um(subject, &record.base.fitted),
        allowed_um: allowed_noise_um(subject, (&record.base.candidate, &record.base.fitted), &subject.scored_m),
    };
    let Some(start) = &sized.start else { return Ok(of_base()) };
    let candidate = subject.extended(&[asked.slug])?;
    let Some(place) = candidate.free.iter().position(|free| free.name == asked.parameter) else {
        return Ok(of_base());
    };
    let mut theta = start.theta.clone();
    theta[place] = candidate.free[place].clamped(candidate.free[place].coordinate.theta(value));
    let held = candidate.held(&theta, |free| free.name == asked.parameter);
    theta.remove(place);
    let Ok(fitted) = subject.fit(&held, &[(theta, start.noise)], Search::Local) else { return Ok(of_base()) };
    let parameters = held.parameters(&fitted.theta);
    let law = parameters[..held.model.base().parameters().len()].to_vec();
    let allowed_um = allowed_noise_um(subject, (&held, &fitted), &subject.scored_m);
    Ok(SizedPrediction { has, value, law, heldout: heldout_um(subject, &fitted), allowed_um })
}

/// Parameters of the base law at the coordinates `theta` of a record's base model.
pub fn law_of(record: &BaseFit, theta: &[f64]) -> Vec<f64> {
    let candidate = &record.base.candidate;
    candidate.parameters(theta)[..candidate.model.base().parameters().len()].to_vec()
}

/// Root mean square error (µm) of a fit on the scored cycle, and the number of positions in this cycle. `None` if no cycle is held out.
pub fn heldout_um(subject: &Subject, fitted: &Fitted) -> Option<(f64, usize)> {
    let n = subject.scored_m.iter().flatten().count();
    fitted.rmse_m(&subject.scored_m).map(|rmse_m| (1e6 * rmse_m, n))
}
