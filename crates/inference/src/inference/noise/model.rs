//! Which noise terms a model has, their parameters and default priors.

use crate::distribution::Distribution;
use crate::error::{Error, Place, Result};
use crate::inference::prior::Prior;
use crate::parameter::{GAIN_SD, NOISE_SD, OFFSET_SD, OU_SD, OU_TIME, ParameterSpec, STUDENT_DOF};
use crate::units::nearest_name;

/// A part of the noise; see the [module](super).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum NoiseTerm {
    /// Independent errors of one size; in every model.
    White,
    /// A stationary Ornstein–Uhlenbeck process.
    OrnsteinUhlenbeck,
    /// A gain and an offset for each cycle.
    Gain,
    /// Student-t in place of normal predictions.
    Student,
}

impl NoiseTerm {
    /// Every term, in the order of their parameters.
    pub const ALL: [Self; 4] = [Self::White, Self::OrnsteinUhlenbeck, Self::Gain, Self::Student];

    /// Number of parameters of all terms together.
    pub(super) const MOST_PARAMETERS: usize = 6;

    /// Name in `model.toml`.
    pub fn name(self) -> &'static str {
        match self {
            Self::White => "white",
            Self::OrnsteinUhlenbeck => "ou",
            Self::Gain => "gain",
            Self::Student => "student",
        }
    }

    /// Its parameters, in order.
    pub fn parameters(self) -> &'static [ParameterSpec] {
        match self {
            Self::White => &[NOISE_SD],
            Self::OrnsteinUhlenbeck => &[OU_SD, OU_TIME],
            Self::Gain => &[GAIN_SD, OFFSET_SD],
            Self::Student => &[STUDENT_DOF],
        }
    }
}

/// What default priors are scaled by.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NoiseScales {
    /// Median of the white noise's prior in µm.
    pub noise_sd_um: f64,
    /// Median time between rows in s.
    pub sample_interval_s: f64,
    /// Duration of a cycle in s.
    pub cycle_s: f64,
}

/// White noise and whatever is combined with it. The default is white noise alone.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct NoiseModel {
    pub(super) ou: bool,
    pub(super) gain: bool,
    pub(super) student: bool,
}

impl NoiseModel {
    /// The model of these names, in any order; `place` is where they stand, for messages.
    ///
    /// # Errors
    /// [`Error::Input`] for an unknown name, one named twice, or without `white`.
    pub fn named(names: &[String], place: &Place) -> Result<Self> {
        let mut model = Self::default();
        let known = NoiseTerm::ALL.map(NoiseTerm::name);
        for (index, name) in names.iter().enumerate() {
            if names[..index].contains(name) {
                return Err(Error::input(place.clone(), format!("`{name}` is named twice"), "name it once"));
            }
            match NoiseTerm::ALL.into_iter().find(|term| term.name() == name) {
                Some(NoiseTerm::White) => {}
                Some(NoiseTerm::OrnsteinUhlenbeck) => model.ou = true,
                Some(NoiseTerm::Gain) => model.gain = true,
                Some(NoiseTerm::Student) => model.student = true,
                None => {
                    let near = nearest_name(name, known);
                    let hint = near.map_or(String::new(), |near| format!("did you mean `{near}`? "));
                    let remedy = format!("{hint}this version has: {}", known.join(", "));
                    return Err(Error::input(place.clone(), format!("`{name}` is not available"), remedy));
                }
            }
        }
        if !names.iter().any(|name| name == NoiseTerm::White.name()) {
            let remedy = format!("write `noise = {:?}`", model.names());
            return Err(Error::input(place.clone(), "the noise has no `white`, which every model needs", remedy));
        }
        Ok(model)
    }

    /// Its terms, in the order of their parameters.
    pub fn terms(self) -> impl Iterator<Item = NoiseTerm> {
        NoiseTerm::ALL.into_iter().filter(move |term| match term {
            NoiseTerm::White => true,
            NoiseTerm::OrnsteinUhlenbeck => self.ou,
            NoiseTerm::Gain => self.gain,
            NoiseTerm::Student => self.student,
        })
    }

    /// Names of its terms.
    pub fn names(self) -> Vec<&'static str> {
        self.terms().map(NoiseTerm::name).collect()
    }

    /// Its parameters, in the order in which every function here takes them.
    pub fn parameters(self) -> Vec<ParameterSpec> {
        self.terms().flat_map(NoiseTerm::parameters).copied().collect()
    }

    /// Default priors of all its parameters but `noise_sd_um`, which prior files give.
    pub fn default_priors(self, scales: &NoiseScales) -> Vec<Prior> {
        let specs = self.parameters().into_iter().filter(|spec| spec.name != NOISE_SD.name);
        specs.filter_map(|spec| default_prior(&spec, scales)).collect()
    }

    /// Standard deviation (µm) of what differs from row to row: the white errors and the process. Gains and offsets are left out: they are the
    /// same all through a cycle, so that a misfit which they take up still stands between prediction and positions.
    pub fn row_sd_um(self, parameters: &[f64]) -> f64 {
        let tails = self.student_dof(parameters).map_or(1.0, |dof| dof / (dof - 2.0));
        let process = if self.ou { parameters[1] } else { 0.0 };
        (tails * parameters[0] * parameters[0] + process * process).sqrt()
    }

    /// Degrees of freedom among the parameters, if the model has `student`.
    pub fn student_dof(self, parameters: &[f64]) -> Option<f64> {
        if self.student { parameters.last().copied() } else { None }
    }
}

fn default_prior(spec: &ParameterSpec, scales: &NoiseScales) -> Option<Prior> {
    let NoiseScales { noise_sd_um, sample_interval_s, cycle_s } = *scales;
    let (distribution, source) = if *spec == OU_SD {
        let distribution = Distribution::LogNormal { median: 0.5 * noise_sd_um, log_sd: 1.0 };
        (distribution, "chosen: about half the white noise, within a factor of seven (95 %)")
    } else if *spec == OU_TIME {
        // A process that forgets within two rows is white noise by another name, and the two would trade places.
        let lower = 2.0 * sample_interval_s;
        let distribution = Distribution::LogUniform { lower, upper: cycle_s.max(10.0 * lower) };
        (distribution, "chosen: from two sample intervals, below which it is white noise, to a cycle")
    } else if *spec == GAIN_SD {
        (Distribution::HalfNormal { sd: 0.03 }, "chosen: cycles alike to a few per cent")
    } else if *spec == OFFSET_SD {
        (Distribution::HalfNormal { sd: noise_sd_um }, "chosen: at most about the white noise")
    } else if *spec == STUDENT_DOF {
        let distribution = Distribution::LogUniform { lower: 2.1, upper: 100.0 };
        (distribution, "chosen: from tails almost without a variance to tails that cannot be told from normal ones")
    } else {
        return None;
    };
    let (name, unit) = (spec.name.to_string(), spec.unit.to_string());
    Some(Prior { name, distribution, unit, source: source.to_string() })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn named(names: &[&str]) -> Result<NoiseModel> {
        let names: Vec<String> = names.iter().map(|name| name.to_string()).collect();
        NoiseModel::named(&names, &Place::file("model.toml").at_line(4).at_key("noise"))
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
        assert_eq!(names.len(), NoiseTerm::MOST_PARAMETERS);
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
        // 3² · 4/(4 − 2) + 2².
        assert!((model.row_sd_um(&[3.0, 2.0, 1.0, 0.5, 70.0, 4.0]) - 22.0_f64.sqrt()).abs() < 1e-12);
        assert_eq!(NoiseModel::default().row_sd_um(&[3.0]), 3.0);
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
        // What the sources say.
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
