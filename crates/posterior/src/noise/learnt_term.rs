//! Description of a noise term for a search that learns the noise: parameters with priors and ranges, starts, and draws of the term.

use base::distribution::Distribution;
use base::parameter::ParameterSpec;
use sampling::ensemble::RandomStream;

use super::scales::NoiseScales;

/// Description of one noise parameter for a search. The search coordinate is the logarithm of the parameter.
#[derive(Debug, Clone, PartialEq)]
pub struct LearntParameter {
    /// Name, unit and support of the parameter.
    pub spec: ParameterSpec,
    /// Prior of the parameter in a search that estimates the noise.
    pub prior: LearningPrior,
    /// Smallest and largest logarithm of the parameter in the search.
    pub ln_ends: [f64; 2],
    /// Logarithm of the parameter for nearly white noise with the standard deviation of the reference noise. All other noise terms nearly vanish there.
    pub ln_white: f64,
    /// Contribution of the parameter to the part of the noise that varies from row to row.
    pub of_row: RowShare,
}

/// Prior distribution of a noise parameter in a search that estimates the noise together with the model. It may differ from the prior in `sample`.
#[derive(Debug, Clone, PartialEq)]
pub enum LearningPrior {
    /// Constant density per unit of the parameter's logarithm, between the ends of the search.
    Flat,
    /// Normal distribution of the parameter's logarithm.
    NormalLog {
        /// Mean of the logarithm.
        mean: f64,
        /// Standard deviation of the logarithm.
        sd: f64,
    },
    /// Distribution of the parameter's value. The log density is per unit of the value's logarithm, and therefore includes the Jacobian.
    OfLog(Distribution),
    /// Distribution of the parameter's value. The log density is per unit of the value, without a Jacobian, so that the value may be 0.
    OfValue(Distribution),
}

/// Contribution of a parameter to the part of the noise that varies from row to row.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RowShare {
    /// The parameter is the standard deviation (µm) of noise that varies from row to row.
    Sd,
    /// The parameter describes the correlation between rows of noise that varies from row to row.
    Shape,
    /// The parameter describes noise that is constant over many rows.
    Nothing,
}

impl LearningPrior {
    /// Log density at the logarithm `ln` of the parameter, up to a constant; `None` if the prior is flat.
    pub fn ln_density(&self, ln: f64) -> Option<f64> {
        Some(match self {
            Self::Flat => return None,
            Self::NormalLog { mean, sd } => -0.5 * ((ln - mean) / sd).powi(2),
            Self::OfLog(distribution) => distribution.ln_pdf(ln.exp()) + ln,
            Self::OfValue(distribution) => distribution.ln_pdf(ln.exp()),
        })
    }
}

/// Sizes of slow noise, gains and offsets that are plausible beside white noise of known size. A search would otherwise explain a model's misfit by noise of any size.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NoiseBounds {
    /// Prior scale of the standard deviation of slow noise, in µm.
    pub slow_sd_um: f64,
    /// Prior scale of the standard deviation of the cycles' gains.
    pub gain_sd: f64,
    /// Prior scale of the standard deviation of the cycles' offsets, in µm.
    pub offset_sd_um: f64,
}

impl NoiseBounds {
    /// Prior of a standard deviation with a bound `sd`.
    pub(super) fn prior(sd: f64) -> LearningPrior {
        LearningPrior::OfValue(Distribution::HalfNormal { sd })
    }
}

/// Knowledge of the reference noise in a search that learns the noise.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum NoiseKnowledge {
    /// The reference noise is estimated from short lags.
    Estimated,
    /// The reference noise is given.
    Given,
    /// The reference noise is given, and all other noise has plausible sizes.
    Bounded(NoiseBounds),
}

/// Noise term that a search can learn.
pub(super) trait LearntTerm {
    /// Parameters of the term, in order. `priors` are the parameters' priors in `sample`, in the order of the parameters; the white noise does not use them. `known`
    /// describes the knowledge of the reference noise.
    fn learnt(&self, scales: &NoiseScales, priors: &[Distribution], known: NoiseKnowledge) -> Vec<LearntParameter>;

    /// Starting points of the searches, one per inner list: logarithms of the term's parameters.
    fn starts(&self, scales: &NoiseScales, priors: &[Distribution]) -> Vec<Vec<f64>>;

    /// Describes the term with these parameter values in a few words, for a message.
    fn words(&self, values: &[f64]) -> String;

    /// Standard deviations (µm) of the independent errors that the term adds to one position (µm).
    fn sds_um(&self, values: &[f64], position_um: f64) -> Vec<f64>;

    /// Function that draws the term's error row by row. For the white noise it returns 0, because the caller draws whitened residuals instead.
    fn drawn(&self, _values: &[f64], _stream: &mut RandomStream) -> Box<DrawRow> {
        Box::new(|_, _, _| [0.0; 2])
    }
}

/// Function that draws the error (µm) and the gain of the next row. Its arguments are the time since the previous row (s, `None` at the first row), true if a cycle
/// begins, and the random stream.
pub type DrawRow = dyn FnMut(Option<f64>, bool, &mut RandomStream) -> [f64; 2];
