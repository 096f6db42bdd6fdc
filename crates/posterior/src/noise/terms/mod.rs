//! Terms of the noise, one file each. A term defines its name, its parameters with their priors, and its treatment by a search. It writes its parameters into the
//! [`FilterScales`]. A new term needs a file and a line in [`TERMS`]. A term with a new equation also needs a change of the filter.

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

    /// Writes the term's parameter values into `scales`. The values lie in their supports. Earlier terms have already written their values.
    fn write(&self, values: &[f64], scales: &mut FilterScales);
}

/// Components of the filter that a noise model uses.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) struct Equations {
    /// True if the filter has the Ornstein–Uhlenbeck process, a state that decays with time.
    pub process: bool,
    /// True if the filter has gain and offset, states that begin anew in every cycle.
    pub cycles: bool,
    /// True if the filter's predictions are Student-t distributed instead of normal.
    pub heavy_tails: bool,
}

/// All noise terms, in the order of their parameters. The first term is the white noise, which every model has. The variances of the other terms are divided by its
/// variance.
pub(super) const TERMS: &[&dyn NoiseTerm] =
    &[&white::White, &ornstein_uhlenbeck::OrnsteinUhlenbeck, &gain::Gain, &student::Student];

/// Upper bound of the number of parameters of all terms.
pub(super) const MOST_PARAMETERS: usize = 8;
