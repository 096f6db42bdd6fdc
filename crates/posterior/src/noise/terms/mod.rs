//! Terms of the noise, one file each. A term defines its name, its parameters with their priors, and how a search learns it. It writes its parameters into the
//! [`FilterScales`]. A new term needs a file and a line in [`TERMS`]. Only a term with a new equation also needs a change of the filter.

mod gain;
mod ornstein_uhlenbeck;
mod student;
mod white;

use super::learnt_term::LearntTerm;
use super::scales::{FilterScales, NoiseScales};
use base::distribution::Distribution;
use base::parameter::ParameterSpec;

/// A term of the noise model. The [parent module](super) lists the terms and their equations.
pub(super) trait NoiseTerm: Sync {
    /// Name of the term in `model.toml`.
    fn name(&self) -> &'static str;

    /// Parameters of the term, in the order in which values are given.
    fn parameters(&self) -> &'static [ParameterSpec];

    /// Default prior of a parameter and the reason for it, used if the prior file has no table of the parameter. `None` means that the file must have one.
    fn default_prior(&self, parameter: &ParameterSpec, scales: &NoiseScales) -> Option<(Distribution, &'static str)>;

    /// Components of the filter that the term needs.
    fn equations(&self) -> Equations;

    /// Description of the term for a search that learns it; `None` if a search cannot learn it.
    fn learning(&'static self) -> Option<&'static dyn LearntTerm> {
        None
    }

    /// Writes the term's parameter values into the scales. The values lie in their supports. Earlier terms have already written theirs.
    fn write(&self, values: &[f64], scales: &mut FilterScales);
}

/// Components of the filter that a noise model uses.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) struct Equations {
    /// State that decays with time: the process.
    pub process: bool,
    /// States that begin anew in every cycle: gain and offset.
    pub cycles: bool,
    /// Student-t predictions instead of normal ones.
    pub heavy_tails: bool,
}

/// All terms, in the order of their parameters. The first term is in every model. The variances of the others are relative to its variance.
pub(super) const TERMS: &[&dyn NoiseTerm] =
    &[&white::White, &ornstein_uhlenbeck::OrnsteinUhlenbeck, &gain::Gain, &student::Student];

/// Upper bound of the number of parameters of all terms.
pub(super) const MOST_PARAMETERS: usize = 8;
