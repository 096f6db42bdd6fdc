//! Gradient of the log posterior over natural parameters, for gradient-based samplers.

use super::likelihood::{ParameterSource, sources};
use super::noise::NoiseLikelihood;
use super::prior::PriorSet;
use base::error::Result;
use models::model::{Forward, SurrogateForward};

/// Gradient of [`super::likelihood::ReducedPosterior::log_density_natural`]. It combines exact sensitivities of the reduced model's trajectory, finite differences of the
/// noise filter, and closed forms of the priors.
pub struct PosteriorGradient<'a> {
    /// Reduced forward model up to the last row with a fitted position.
    forward: SurrogateForward<'a>,
    noise: NoiseLikelihood,
    priors: &'a PriorSet,
    /// Source of every parameter: the model's parameters in order, then the noise parameters.
    sources: Vec<ParameterSource>,
}

impl<'a> PosteriorGradient<'a> {
    /// Creates the gradient of a posterior. `fixed` holds the values of the parameters without a prior, by name.
    pub fn new(
        forward: SurrogateForward<'a>,
        noise: NoiseLikelihood,
        priors: &'a PriorSet,
        fixed: &std::collections::BTreeMap<String, f64>,
    ) -> Self {
        let sources = sources(forward.model, noise.model(), priors, fixed);
        Self { forward, noise, priors, sources }
    }

    /// Derivative of the log posterior by each sampled parameter, per unit of the parameter, in the order of the priors. `point` holds natural values in this order.
    ///
    /// # Errors
    /// Errors of [`SurrogateForward::derivative_along_m`]: they occur if the log density is −∞, or if the trajectory has no derivative.
    pub fn gradient(&self, point: &[f64]) -> Result<Vec<f64>> {
        let value = |source: &ParameterSource| match *source {
            ParameterSource::Sampled(index) => point[index],
            ParameterSource::Fixed(value) => value,
        };
        let values: Vec<f64> = self.sources.iter().map(value).collect();
        let (of_model, of_noise) = values.split_at(self.forward.model.parameters().len());
        let position_m = self.forward.trajectory_m(of_model)?;
        let priors = self.priors.priors().iter().zip(point);
        let mut gradient: Vec<f64> = priors.map(|(prior, x)| prior.distribution.ln_pdf_slope(*x)).collect();
        for (place, source) in self.sources.iter().enumerate() {
            let ParameterSource::Sampled(index) = *source else { continue };
            gradient[index] += match place.checked_sub(of_model.len()) {
                Some(noise) => self.noise.slope_in(&position_m, of_noise, noise),
                None => {
                    let direction_m = self.forward.derivative_m(of_model, place)?;
                    self.noise.slope_along(&position_m, &direction_m, of_noise)
                }
            };
        }
        Ok(gradient)
    }
}
