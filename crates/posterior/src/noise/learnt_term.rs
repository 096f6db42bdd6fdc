//! Learning of one noise term in a search: its parameters, their priors and ranges, and draws of the term.

use base::distribution::Distribution;
use base::parameter::ParameterSpec;
use sampling::ensemble::RandomStream;

use super::scales::NoiseScales;

/// Learning of one noise parameter, in the logarithm of its value.
#[derive(Debug, Clone, PartialEq)]
pub struct LearntParameter {
    /// Name, unit and support.
    pub spec: ParameterSpec,
    /// Prior in the search.
    pub prior: LearningPrior,
    /// Range of the logarithm in the search.
    pub ln_ends: [f64; 2],
    /// Logarithm at which the noise is white with the size of the reference noise, and the other terms nearly vanish.
    pub ln_white: f64,
    /// Contribution to the noise of a row.
    pub of_row: RowShare,
}

/// Prior of a parameter in the search.
#[derive(Debug, Clone, PartialEq)]
pub enum LearningPrior {
    /// Flat between the ends of the search.
    Flat,
    /// Normal in the logarithm.
    NormalLog {
        /// Mean of the logarithm.
        mean: f64,
        /// Standard deviation of the logarithm.
        sd: f64,
    },
    /// This distribution, as a density of the logarithm.
    OfLog(Distribution),
    /// This distribution, as a density of the value itself, which may be 0.
    OfValue(Distribution),
}

/// Contribution of a parameter to the noise that varies from row to row.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RowShare {
    /// A standard deviation, in µm.
    Sd,
    /// Correlation of such a part from row to row.
    Shape,
    /// No contribution: the value is the same for many rows.
    Nothing,
}

impl LearningPrior {
    /// Log density at a logarithm, up to a constant; `None` if the prior is flat.
    pub fn ln_density(&self, ln: f64) -> Option<f64> {
        Some(match self {
            Self::Flat => return None,
            Self::NormalLog { mean, sd } => -0.5 * ((ln - mean) / sd).powi(2),
            Self::OfLog(distribution) => distribution.ln_pdf(ln.exp()) + ln,
            Self::OfValue(distribution) => distribution.ln_pdf(ln.exp()),
        })
    }
}

/// A term that a search can learn.
pub(super) trait LearntTerm {
    /// Parameters of the term, in order. `priors` are those of `sample`, in the same order; the white noise does not use them. `is_known` is true if the reference noise is
    /// known and false if it is estimated from short lags.
    fn learnt(&self, scales: &NoiseScales, priors: &[Distribution], is_known: bool) -> Vec<LearntParameter>;

    /// Starts of the searches, as logarithms of the parameters.
    fn starts(&self, scales: &NoiseScales, priors: &[Distribution]) -> Vec<Vec<f64>>;

    /// Values of the parameters in a few words.
    fn words(&self, values: &[f64]) -> String;

    /// Standard deviations (µm) that the term adds to one position (µm), independent of each other.
    fn sds_um(&self, values: &[f64], position_um: f64) -> Vec<f64>;

    /// Draws of the term, row by row. They are 0 for the white noise, which draws of whitened residuals replace.
    fn drawn(&self, _values: &[f64], _stream: &mut RandomStream) -> Box<DrawRow> {
        Box::new(|_, _, _| [0.0; 2])
    }
}

/// Error (µm) and gain of a row, given the time since the previous row (s, `None` at the first) and whether a cycle begins.
pub type DrawRow = dyn FnMut(Option<f64>, bool, &mut RandomStream) -> [f64; 2];
