//! Terms of the noise, one file each. A term states its name, its parameters with their priors, and its learning in a search. It writes itself into the [`PredictiveScales`] of the
//! filter. A new term is a file and a line in [`TERMS`]; only a term with a new equation changes the filter, too.

mod gain;
mod ornstein_uhlenbeck;
mod student;
mod white;

use super::learnt_term::LearntTerm;
use super::scales::{FilterScales, NoiseScales};
use base::distribution::Distribution;
use base::parameter::ParameterSpec;

/// A part of the noise; see the [module](super).
pub(super) trait NoiseTerm: Sync {
    /// Name in `model.toml`.
    fn name(&self) -> &'static str;

    /// Parameters, in order.
    fn parameters(&self) -> &'static [ParameterSpec];

    /// Default prior of a parameter, used if no file gives one, and its reason; `None` if a file must give it.
    fn default_prior(&self, parameter: &ParameterSpec, scales: &NoiseScales) -> Option<(Distribution, &'static str)>;

    /// Parts of the filter that the term needs.
    fn equations(&self) -> Equations;

    /// Learning of the term in a search; `None` if a search cannot learn it.
    fn learning(&'static self) -> Option<&'static dyn LearntTerm> {
        None
    }

    /// Writes parameter values, which lie in their supports, into the scales. The terms before it have already written theirs.
    fn write(&self, values: &[f64], scales: &mut FilterScales);
}

/// Parts of the filter.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) struct Equations {
    /// A state that decays with time.
    pub process: bool,
    /// States that begin anew with every cycle.
    pub cycles: bool,
    /// Student's t instead of normal predictions.
    pub heavy_tails: bool,
}

/// All terms, in the order of their parameters. The first is in every model, and the sizes of the others are relative to its size.
pub(super) const TERMS: &[&dyn NoiseTerm] =
    &[&white::White, &ornstein_uhlenbeck::OrnsteinUhlenbeck, &gain::Gain, &student::Student];

/// Upper bound of the number of parameters of all terms.
pub(super) const MOST_PARAMETERS: usize = 8;
