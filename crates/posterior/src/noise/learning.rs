//! Estimation of a record's noise parameters by a search: instructions for the search, and use of the estimated parameters.

use std::ops::{Deref, DerefMut};

use base::distribution::Distribution;
use base::parameter::ParameterSpec;
use sampling::ensemble::RandomStream;

use super::learnt_term::{DrawRow, LearntParameter, LearntTerm, NoiseKnowledge};
use super::terms::{MOST_PARAMETERS, NoiseTerm, TERMS};
use super::{NoiseModel, NoiseScales};

/// Values of a noise model's parameters in their units, or the logarithms of these values, in the order of the model's parameters.
#[derive(Clone, Copy)]
pub struct NoiseValues {
    values: [f64; MOST_PARAMETERS],
    n: usize,
}

impl NoiseValues {
    /// Creates the list from an array of values, one per parameter.
    ///
    /// # Panics
    /// Panics if there are more values than any noise model has parameters.
    pub const fn new<const N: usize>(values: [f64; N]) -> Self {
        let mut all = [0.0; MOST_PARAMETERS];
        let mut k = 0;
        while k < N {
            all[k] = values[k];
            k += 1;
        }
        Self { values: all, n: N }
    }

    /// Returns the list with `of` applied to every value.
    pub fn map(mut self, of: impl Fn(f64) -> f64) -> Self {
        self.iter_mut().for_each(|value| *value = of(*value));
        self
    }

    /// Creates a list of `n` values, with `of(index)` as the value at each index.
    pub fn from_fn(n: usize, mut of: impl FnMut(usize) -> f64) -> Self {
        (0..n).map(&mut of).collect()
    }
}

impl FromIterator<f64> for NoiseValues {
    fn from_iter<I: IntoIterator<Item = f64>>(values: I) -> Self {
        let mut all = Self::new([]);
        for value in values {
            all.values[all.n] = value;
            all.n += 1;
        }
        all
    }
}

impl Deref for NoiseValues {
    type Target = [f64];
    fn deref(&self) -> &[f64] {
        &self.values[..self.n]
    }
}

impl DerefMut for NoiseValues {
    fn deref_mut(&mut self) -> &mut [f64] {
        &mut self.values[..self.n]
    }
}

impl PartialEq for NoiseValues {
    fn eq(&self, other: &Self) -> bool {
        **self == **other
    }
}

impl std::fmt::Debug for NoiseValues {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        (**self).fmt(f)
    }
}

/// Instructions for a search that learns a noise model.
#[derive(Debug, Clone, PartialEq)]
pub struct NoiseLearning {
    /// Noise parameters that the search varies, in the order of the noise model.
    pub parameters: Vec<LearntParameter>,
    /// Name of the noise term to which each parameter belongs.
    pub terms: Vec<&'static str>,
    /// Starts of the searches: every combination of the terms' starts. The start of the last term changes fastest along the list.
    pub starts: Vec<NoiseValues>,
}

impl NoiseModel {
    /// Names of all terms that a search can learn.
    pub fn learnt_names() -> Vec<&'static str> {
        TERMS.iter().filter(|term| term.learning().is_some()).map(|term| term.name()).collect()
    }

    /// Instructions for learning the model's parameters, without terms that a search cannot learn. `known` describes the
    /// knowledge of the reference noise.
    pub fn learning(self, scales: &NoiseScales, known: NoiseKnowledge) -> NoiseLearning {
        let (mut parameters, mut terms, mut starts) = (Vec::new(), Vec::new(), vec![NoiseValues::new([])]);
        for (term, learnt) in self.learnt_terms() {
            let specs = term.parameters().iter();
            let priors: Vec<Distribution> =
                specs.filter_map(|spec| term.default_prior(spec, scales)).map(|(prior, _)| prior).collect();
            parameters.extend(learnt.learnt(scales, &priors, known));
            terms.resize(parameters.len(), term.name());
            let term_starts = learnt.starts(scales, &priors);
            let joined = |start: &NoiseValues| -> Vec<NoiseValues> {
                term_starts.iter().map(|term_start| start.iter().chain(term_start).copied().collect()).collect()
            };
            starts = starts.iter().flat_map(joined).collect();
        }
        NoiseLearning { parameters, terms, starts }
    }

    /// Describes the noise with these parameter values in words. The first list holds terms that vary from row to row, the second terms that vary from cycle to cycle.
    pub fn describe(self, values: &[f64]) -> [Vec<String>; 2] {
        let mut words = [Vec::new(), Vec::new()];
        self.with_values(values, |term, learnt, values| {
            words[usize::from(term.equations().cycles)].push(learnt.words(values));
        });
        words
    }

    /// Standard deviations (µm) of the independent errors that the terms add to one position (µm).
    pub fn sds_um(self, values: &[f64], position_um: f64) -> Vec<f64> {
        let mut sds_um = Vec::new();
        self.with_values(values, |_, learnt, values| sds_um.extend(learnt.sds_um(values, position_um)));
        sds_um
    }

    /// Returns functions that draw the error of each term row by row. The function of the white noise returns 0, because the caller draws white noise itself.
    pub fn draw_terms(self, values: &[f64], stream: &mut RandomStream) -> Vec<Box<DrawRow>> {
        let mut drawn = Vec::new();
        self.with_values(values, |_, learnt, values| drawn.push(learnt.drawn(values, stream)));
        drawn
    }

    fn with_values(self, values: &[f64], mut of: impl FnMut(&dyn NoiseTerm, &dyn LearntTerm, &[f64])) {
        let mut left = values;
        for term in self.terms() {
            let (entry, others) = left.split_at(term.parameters().len());
            if let Some(learnt) = term.learning() {
                of(term, learnt, entry);
            }
            left = others;
        }
    }

    fn learnt_terms(self) -> impl Iterator<Item = (&'static dyn NoiseTerm, &'static dyn LearntTerm)> {
        self.terms().filter_map(|term| Some((term, term.learning()?)))
    }

    /// Index of a noise parameter in this model; `None` if the model does not have the parameter.
    pub fn place(self, parameter: &ParameterSpec) -> Option<usize> {
        self.parameters().iter().position(|parameter_spec| parameter_spec == parameter)
    }

    /// Value of a noise parameter in `values`; 0 if the model does not have the parameter.
    pub fn value(self, values: &[f64], parameter: &ParameterSpec) -> f64 {
        self.place(parameter).map_or(0.0, |place| values[place])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use base::error::InputPlace;

    /// Every term that a search can learn describes each of its parameters, in order. The term's starts lie inside the range of the search.
    #[test]
    fn rules_go_with_the_parameters() {
        let names: Vec<String> = NoiseModel::learnt_names().into_iter().map(String::from).collect();
        assert_eq!(names, ["white", "ou", "gain"]);
        let model = NoiseModel::named(&names, &InputPlace::default()).expect("sound");
        let scales = NoiseScales { noise_sd_um: 4.0, sample_interval_s: 0.05, cycle_s: 10.0 };
        let learning = model.learning(&scales, NoiseKnowledge::Estimated);
        let specs: Vec<ParameterSpec> = learning.parameters.iter().map(|parameter| parameter.spec).collect();
        assert_eq!(specs, model.parameters());
        assert_eq!(learning.terms, ["white", "ou", "ou", "gain", "gain"]);
        assert_eq!(learning.starts.len(), 18);
        for start in learning.starts.iter().chain([&learning.parameters.iter().map(|start| start.ln_white).collect()]) {
            assert_eq!(start.len(), specs.len());
            let inside = |(learnt_parameter, ln): (&LearntParameter, &f64)| {
                learnt_parameter.ln_ends[0] <= *ln && *ln <= learnt_parameter.ln_ends[1]
            };
            assert!(learning.parameters.iter().zip(start.iter()).all(inside), "{start:?}");
        }
        let values = [4.0, 2.0, 0.8, 0.005, 1.0];
        assert_eq!(model.describe(&values)[1], ["a gain of 0.50 % and an offset of 1.0 µm per cycle"]);
        assert_eq!(model.sds_um(&values, 100.0), [4.0, 2.0, 0.5, 1.0]);
    }
}
