//! Noise model: a set of noise terms with their parameters and default priors.

use super::scales::{FilterScales, NoiseScales};
use super::terms::{Equations, NoiseTerm, TERMS};
use crate::prior::Prior;
use base::error::{Error, InputPlace, Result};
use base::parameter::ParameterSpec;
use base::units::nearest_name;

/// Set of noise terms: white noise and optional further terms. The default is white noise alone.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct NoiseModel {
    /// True for each present term, by its index in [`TERMS`]. The first entry is unused, because white noise is always present.
    has: [bool; TERMS.len()],
}

impl NoiseModel {
    /// Creates the noise model with the named terms, in any order. Error messages state `place` as the place of the names.
    ///
    /// # Errors
    /// [`Error::Input`] for an unknown name, a repeated name, or names without `white`.
    pub fn named(names: &[String], place: &InputPlace) -> Result<Self> {
        let mut model = Self::default();
        for (index, name) in names.iter().enumerate() {
            if names[..index].contains(name) {
                return Err(Error::input(place.clone(), format!("`{name}` is named twice"), "name it once"));
            }
            let Some(term) = TERMS.iter().position(|term| term.name() == name) else {
                let known = || TERMS.iter().map(|term| term.name());
                let near = nearest_name(name, known());
                let hint = near.map_or(String::new(), |near| format!("did you mean `{near}`? "));
                let remedy = format!("{hint}this version has: {}", known().collect::<Vec<_>>().join(", "));
                return Err(Error::input(place.clone(), format!("`{name}` is not available"), remedy));
            };
            model.has[term] = term > 0;
        }
        let compulsory = TERMS[0].name();
        if !names.iter().any(|name| name == compulsory) {
            let remedy = format!("write `noise = {:?}`", model.names());
            let found = format!("the noise has no `{compulsory}`, which every model needs");
            return Err(Error::input(place.clone(), found, remedy));
        }
        Ok(model)
    }

    /// Terms of the model, in the order of their parameters.
    pub(super) fn terms(self) -> impl Iterator<Item = &'static dyn NoiseTerm> {
        TERMS.iter().enumerate().filter(move |(place, _)| *place == 0 || self.has[*place]).map(|(_, term)| *term)
    }

    /// Names of the model's terms, as in `model.toml`.
    pub fn names(self) -> Vec<&'static str> {
        self.terms().map(|term| term.name()).collect()
    }

    /// Parameters of the noise model. All functions of noise models expect parameter values in this order.
    pub fn parameters(self) -> Vec<ParameterSpec> {
        self.terms().flat_map(|term| term.parameters()).copied().collect()
    }

    /// Parameters of all noise terms that the program has.
    pub fn known_parameters() -> impl Iterator<Item = &'static ParameterSpec> {
        TERMS.iter().flat_map(|term| term.parameters())
    }

    /// Converts parameter values, in the model's order and units, to the filter's form; `None` outside their support.
    pub(super) fn scales(self, parameters: &[f64]) -> Option<FilterScales> {
        let (mut scales, mut left) = (FilterScales::UNIT, parameters);
        for term in self.terms() {
            let (values, others) = left.split_at_checked(term.parameters().len())?;
            let is_inside = |(spec, value): (&ParameterSpec, &f64)| value.is_finite() && spec.support.contains(*value);
            if !term.parameters().iter().zip(values).all(is_inside) {
                return None;
            }
            term.write(values, &mut scales);
            left = others;
        }
        scales.is_in_range().then_some(scales)
    }

    /// Components of the filter that the model's terms need.
    pub(super) fn equations(self) -> Equations {
        self.terms().map(|term| term.equations()).fold(Equations::default(), |all, equations| Equations {
            process: all.process || equations.process,
            cycles: all.cycles || equations.cycles,
            heavy_tails: all.heavy_tails || equations.heavy_tails,
        })
    }

    /// Default priors of the parameters. The white noise has no default, because its prior comes from the prior file.
    pub fn default_priors(self, scales: &NoiseScales) -> Vec<Prior> {
        let of_term = |term: &'static dyn NoiseTerm| {
            term.parameters().iter().filter_map(move |spec| {
                let (distribution, source) = term.default_prior(spec, scales)?;
                Some(Prior { name: spec.name.into(), distribution, unit: spec.unit.into(), source: source.into() })
            })
        };
        self.terms().flat_map(of_term).collect()
    }

    /// Standard deviation (µm) of the noise that varies from row to row: the white errors and the process. Gains and offsets are left out, because they are constant
    /// within a cycle. They can absorb a misfit, which must not count as noise. The result is NaN for parameters outside their support.
    pub fn row_sd_um(self, parameters: &[f64]) -> f64 {
        let of_scales = |scales: FilterScales| 1e6 * scales.noise_sd_m * (scales.variance_factor() + scales.ou).sqrt();
        self.scales(parameters).map_or(f64::NAN, of_scales)
    }

    /// Degrees of freedom of Student-t errors; `None` for normal errors.
    pub fn student_dof(self, parameters: &[f64]) -> Option<f64> {
        self.scales(parameters).map(|scales| scales.dof).filter(|dof| dof.is_finite())
    }
}

#[cfg(test)]
mod tests {
    use super::super::terms::MOST_PARAMETERS;
    use super::*;

    fn named(names: &[&str]) -> Result<NoiseModel> {
        let names: Vec<String> = names.iter().map(|name| name.to_string()).collect();
        NoiseModel::named(&names, &InputPlace::file("model.toml").at_line(4).at_key("noise"))
    }

    fn scales() -> NoiseScales {
        NoiseScales { noise_sd_um: 4.0, sample_interval_s: 0.05, cycle_s: 10.0 }
    }

    #[test]
    fn parameters_have_one_order_whatever_the_order_of_names() {
        let model = named(&["student", "gain", "white", "ou"]).expect("sound");
        let names: Vec<&str> = model.parameters().iter().map(|spec| spec.name).collect();
        let order = ["noise_sd_um", "ou_sd_um", "ou_time_s", "gain_sd", "offset_sd_um", "student_dof"];
        assert_eq!(names, order);
        assert!(names.len() <= MOST_PARAMETERS);
        assert_eq!(model.names(), ["white", "ou", "gain", "student"]);
        assert_eq!(model.student_dof(&[1.0, 2.0, 3.0, 4.0, 5.0, 6.0]), Some(6.0));
        assert_eq!(NoiseModel::default().student_dof(&[1.0]), None);
        assert_eq!(named(&["white"]).expect("sound"), NoiseModel::default());
    }

    #[test]
    fn impossible_names_are_refused_with_place_and_remedy() {
        let cases: [(&[&str], &str); 4] = [
            (&["white", "gian"], "did you mean `gain`?"),
            (&["white", "ou", "ou"], "named twice"),
            (&["ou"], "write `noise = [\"white\", \"ou\"]`"),
            (&[], "write `noise = [\"white\"]`"),
        ];
        for (names, part) in cases {
            let message = named(names).expect_err("refused").to_string();
            assert!(message.contains(part) && message.contains("model.toml, line 4, `noise`"), "{message}");
        }
    }

    #[test]
    fn what_differs_from_row_to_row_has_no_gain_and_no_offset() {
        let model = named(&["white", "ou", "gain", "student"]).expect("sound");
        // The expected variance is 3² · 4/(4 − 2) + 2².
        assert!((model.row_sd_um(&[3.0, 2.0, 1.0, 0.5, 70.0, 4.0]) - 22.0_f64.sqrt()).abs() < 1e-12);
        assert!((NoiseModel::default().row_sd_um(&[3.0]) - 3.0).abs() < 1e-12);
    }

    #[test]
    fn default_priors_stay_in_the_support_and_scale_with_the_experiment() {
        let model = named(&["white", "ou", "gain", "student"]).expect("sound");
        let priors = model.default_priors(&scales());
        let specs = model.parameters();
        assert_eq!(priors.len(), specs.len() - 1);
        for (prior, spec) in priors.iter().zip(&specs[1..]) {
            let (lower, upper) = prior.distribution.support();
            assert!(prior.name == spec.name && prior.unit == spec.unit);
            assert!(lower >= spec.support.lower && upper <= spec.support.upper);
            assert!(prior.source.starts_with("chosen: "));
        }
        // The sources of the priors state these quantiles.
        let quantile = |name: &str, p: f64| {
            priors.iter().find(|prior| prior.name == name).map_or(f64::NAN, |prior| prior.distribution.quantile(p))
        };
        assert!(
            (quantile("ou_sd_um", 0.5) - 2.0).abs() < 1e-12 && (quantile("ou_sd_um", 0.975) / 14.0 - 1.0).abs() < 0.02
        );
        assert!((quantile("ou_time_s", 1.0) / 10.0 - 1.0).abs() < 1e-9);
        assert!((quantile("ou_time_s", 0.0) / 0.1 - 1.0).abs() < 1e-9);
        assert!(NoiseModel::default().default_priors(&scales()).is_empty());
    }
}
