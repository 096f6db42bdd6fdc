//! The terms of the noise, one file each. A term says what it is called, what its parameters are and what is known of them, how a
//! search learns them, and writes itself into the [`Scales`] that the filter takes. A new one is a file and a line in [`TERMS`]; only one whose equation the filter does not have touches that, too.

mod gain;
mod ornstein_uhlenbeck;
mod student;
mod white;

use super::learnt_term::LearntTerm;
use super::scales::{NoiseScales, Scales};
use base::distribution::Distribution;
use base::parameter::ParameterSpec;

/// A part of the noise; see the [module](super).
pub(super) trait NoiseTerm: Sync {
    /// Name in `model.toml`.
    fn name(&self) -> &'static str;

    /// Its parameters, in order.
    fn parameters(&self) -> &'static [ParameterSpec];

    /// Prior of one of its parameters where no file gives one, and why; `None` where a file must.
    fn default_prior(&self, parameter: &ParameterSpec, scales: &NoiseScales) -> Option<(Distribution, &'static str)>;

    /// What of the filter it needs.
    fn equations(&self) -> Equations;

    /// How a search learns it; `None` where none does.
    fn learning(&'static self) -> Option<&'static dyn LearntTerm> {
        None
    }

    /// Writes values of its parameters, which lie in their supports, beside what the terms before it have written.
    fn write(&self, values: &[f64], scales: &mut Scales);
}

/// Parts of the filter.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) struct Equations {
    /// A state that forgets with time.
    pub process: bool,
    /// States that begin anew with every cycle.
    pub cycles: bool,
    /// Student's t in place of normal predictions.
    pub heavy_tails: bool,
}

/// Every term, in the order of their parameters; the first is in every model, and the others' sizes are written in terms of its own.
pub(super) const TERMS: &[&dyn NoiseTerm] =
    &[&white::White, &ornstein_uhlenbeck::OrnsteinUhlenbeck, &gain::Gain, &student::Student];

/// No fewer than all terms have parameters.
pub(super) const MOST_PARAMETERS: usize = 8;
