//! How a search learns one term of the noise: its parameters, their priors and ends, and draws of it.

use base::distribution::Distribution;
use base::parameter::ParameterSpec;
use sampling::ensemble::RandomStream;

use super::scales::NoiseScales;

/// How a search learns one parameter of the noise, in the logarithm of its value.
#[derive(Debug, Clone, PartialEq)]
pub struct LearntParameter {
    /// Name, unit, support.
    pub spec: ParameterSpec,
    /// What is known of it before the data.
    pub prior: LearningPrior,
    /// Where the search ends.
    pub ln_ends: [f64; 2],
    /// Where there is white noise of the yardstick's size and next to nothing else.
    pub ln_white: f64,
    /// What it says of a row's noise.
    pub of_row: RowShare,
}

/// What is known of a parameter before the data.
#[derive(Debug, Clone, PartialEq)]
pub enum LearningPrior {
    /// Nothing, between the search's ends.
    Flat,
    /// Its logarithm is normal.
    NormalLog {
        /// Mean of the logarithm.
        mean: f64,
        /// Standard deviation of it.
        sd: f64,
    },
    /// This, as a density of the logarithm.
    OfLog(Distribution),
    /// This, as a density of the value itself, which may be nothing.
    OfValue(Distribution),
}

/// What a parameter says of what differs from row to row.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RowShare {
    /// A standard deviation, in µm.
    Sd,
    /// How a part of that goes on from row to row.
    Shape,
    /// Nothing: it is the same for many rows.
    Nothing,
}

impl LearningPrior {
    /// Log density at a logarithm, up to a constant; `None` where it is flat.
    pub fn ln_density(&self, ln: f64) -> Option<f64> {
        Some(match self {
            Self::Flat => return None,
            Self::NormalLog { mean, sd } => -0.5 * ((ln - mean) / sd).powi(2),
            Self::OfLog(distribution) => distribution.ln_pdf(ln.exp()) + ln,
            Self::OfValue(distribution) => distribution.ln_pdf(ln.exp()),
        })
    }
}

/// A term that a search learns.
pub(super) trait LearntTerm {
    /// Its parameters, in order; `priors` are those of `sample`, in the same order but for the white noise, and `is_known` says whether the yardstick is known or estimated
    /// from short lags.
    fn learnt(&self, scales: &NoiseScales, priors: &[Distribution], is_known: bool) -> Vec<LearntParameter>;

    /// Logarithms of its parameters from which searches start.
    fn starts(&self, scales: &NoiseScales, priors: &[Distribution]) -> Vec<Vec<f64>>;

    /// Values of its parameters in a few words.
    fn words(&self, values: &[f64]) -> String;

    /// Standard deviations (µm) that it adds to one position (µm), independent of each other.
    fn sds_um(&self, values: &[f64], position_um: f64) -> Vec<f64>;

    /// What it adds to a record, drawn row by row; nothing where whitened residuals are drawn in its place.
    fn drawn(&self, _values: &[f64], _stream: &mut RandomStream) -> Box<DrawRow> {
        Box::new(|_, _, _| [0.0; 2])
    }
}

/// The error (µm) and the gain of a row, given the time since the row before (s, `None` at the first) and whether a cycle begins.
pub type DrawRow = dyn FnMut(Option<f64>, bool, &mut RandomStream) -> [f64; 2];
