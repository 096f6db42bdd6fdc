//! Adds effects or disturbances with a given signal to the motion that a law predicts.

use super::strength::{Strength, scale_to_signal};
use super::{Disturbance, HiddenEffect, NamedValue, Truth};
use base::error::Result;
use criticism::NoiseValues;
use criticism::separation::{RivalTruth as Shown, SEPARATED_SIGMA, fit_rival};
use criticism::{Candidate, Subject};
use models::effects::Effect;
use record::Record;
use sampling::ensemble::RandomStream;

/// Probability of each tail of an effect's prior. Hidden sizes lie between the two tails.
const SIZE_TAIL: f64 = 1e-3;

/// Motion that a law predicts for a protocol. Effects or disturbances are added to it.
pub(super) struct Motion {
    pub subject: Subject,
    pub base: Candidate,
    pub theta: Vec<f64>,
    pub noise: NoiseValues,
}

impl Motion {
    /// Largest distance (m) of the robot from its start, without hidden effects or disturbances.
    pub fn farthest_m(&self) -> Result<f64> {
        let position_m = self.subject.trajectory_m(&self.base, &self.theta)?;
        Ok(position_m.iter().fold(0.0, |most, x| x.abs().max(most)))
    }

    pub fn record(&self) -> &Record {
        &self.subject.experiment().record
    }

    /// Returns the data for rival fits: noise-free positions (m), with the law and the noise of this motion.
    pub fn shown<'a>(&'a self, position_m: &'a [f64]) -> Shown<'a> {
        Shown { candidate: &self.base, theta: &self.theta, noise: self.noise, position_m }
    }

    /// Distance between the positions and the best fit of a candidate, in noise standard deviations; `None` if the candidate's model fails.
    pub fn distance_sigma(&self, shown: &Shown, candidate: &Candidate) -> Option<f64> {
        fit_rival(&self.subject, candidate, shown).ok().map(|closest| closest.distance)
    }

    /// Returns the effects `slugs` with parameters of the requested strength, and the slugs of their equivalent effects. The signal of each effect is measured
    /// while the model contains the other effects. Returns `None` if the strength is out of reach.
    pub fn with_effects(
        &self,
        slugs: &[String],
        strength: Strength,
        compared: &[&'static dyn Effect],
        stream: &mut RandomStream,
    ) -> Result<Option<(Vec<HiddenEffect>, Vec<String>)>> {
        let names: Vec<&str> = slugs.iter().map(String::as_str).collect();
        let candidate = self.subject.extended(&names)?;
        let mut theta = candidate.embed(&self.base, &self.theta);
        // Index of each effect's size in the coordinates, its null, and its largest signed distance from the null.
        let mut sizes: Vec<(usize, f64, f64)> = Vec::new();
        for (k, free) in candidate.free.iter().enumerate().filter(|(_, free)| free.effect.is_some()) {
            let [lower, upper] = [free.quantile(SIZE_TAIL), free.quantile(1.0 - SIZE_TAIL)];
            let uniform = stream.unit();
            match free.null {
                Some(null) => {
                    let is_upward = if free.is_one_sided() { null == free.ends[0] } else { uniform < 0.5 };
                    sizes.push((k, null, if is_upward { upper - null } else { lower - null }));
                    theta[k] = free.quantile(uniform);
                }
                None => theta[k] = free.quantile(0.05 + 0.9 * uniform),
            }
        }
        let others: Vec<Candidate> = (0..names.len())
            .map(|left_out| {
                let kept: Vec<&str> = (0..names.len()).filter(|k| *k != left_out).map(|k| names[k]).collect();
                self.subject.extended(&kept)
            })
            .collect::<Result<_>>()?;
        let signals = |theta: &[f64]| -> Option<Vec<f64>> {
            let position_m = self.subject.trajectory_m(&candidate, theta).ok()?;
            let shown = Shown { candidate: &candidate, theta, noise: self.noise, position_m: &position_m };
            others.iter().map(|other| self.distance_sigma(&shown, other)).collect()
        };
        let (theta, signals_sigma) = match strength {
            Strength::Prior => {
                let Some(found) = signals(&theta) else { return Ok(None) };
                (theta, found)
            }
            Strength::Size(size) => {
                let [(first, null, reach), ..] = sizes[..] else { return Ok(None) };
                let free = &candidate.free[first];
                let sign = if free.is_one_sided() { reach.signum() } else { 1.0 };
                theta[first] = free.coordinate.theta(free.coordinate.value(null) + sign * size);
                let is_reached = free.clamped(theta[first]) == theta[first];
                match signals(&theta).filter(|_| is_reached) {
                    Some(found) => (theta, found),
                    None => return Ok(None),
                }
            }
            Strength::Sigma(asked_sigma) => {
                let at = |reach: &[f64]| {
                    let mut theta = theta.clone();
                    for ((k, null, whole), share) in sizes.iter().zip(reach) {
                        theta[*k] = null + whole * share;
                    }
                    theta
                };
                let n = sizes.len();
                match scale_to_signal(asked_sigma, vec![0.1; n], &vec![1.0; n], |reach| signals(&at(reach))) {
                    Some((reach, found)) => (at(&reach), found),
                    None => return Ok(None),
                }
            }
        };
        let values = candidate.parameters(&theta);
        let effect = |(place, slug): (usize, &String)| HiddenEffect {
            slug: slug.clone(),
            parameters: candidate
                .free
                .iter()
                .filter(|free| free.effect == Some(place))
                .map(|free| NamedValue { name: free.name.into(), value: values[free.index] })
                .collect(),
            signal_sigma: signals_sigma[place],
        };
        let effects = candidate.effects.iter().enumerate().map(effect).collect();
        let position_m = self.subject.trajectory_m(&candidate, &theta)?;
        let shown = Shown { candidate: &candidate, theta: &theta, noise: self.noise, position_m: &position_m };
        Ok(Some((effects, self.ideal_class(&shown, slugs, compared))))
    }

    /// Returns the law extended by a truth's effects, and the values of its coordinates.
    pub fn with_hidden_effects(&self, truth: &Truth) -> Result<(Candidate, Vec<f64>)> {
        let names: Vec<&str> = truth.effects.iter().map(|effect| effect.slug.as_str()).collect();
        let candidate = self.subject.extended(&names)?;
        let mut theta = candidate.embed(&self.base, &self.theta);
        for (free, theta) in candidate.free.iter().zip(&mut theta) {
            let parameters = || truth.effects.iter().flat_map(|effect| &effect.parameters);
            if let Some(parameter) = parameters().find(|parameter| parameter.name == free.name) {
                *theta = free.coordinate.theta(parameter.value);
            }
        }
        Ok((candidate, theta))
    }

    /// Noise-free positions (m) of this motion with a disturbance.
    pub fn disturbed_m(&self, disturbance: &Disturbance) -> Result<Vec<f64>> {
        let record = self.record();
        let mut experiment = self.subject.experiment().clone();
        experiment.record.force_n = disturbance.force_n(record);
        let problem = self.subject.problem();
        let acting =
            problem.with_experiment(experiment, self.subject.specification().clone(), self.subject.library())?;
        let acting = Subject::with_compliance(&acting, self.subject.library(), self.subject.compliance().clone())?;
        let position_m = acting.trajectory_m(&acting.base(), &self.theta)?;
        Ok(disturbance.recorded_m(record, &position_m))
    }

    pub fn with_outside(&self, drawn: &Disturbance, asked_sigma: f64) -> Result<Option<(Disturbance, f64)>> {
        let at = |sizes: &[f64]| drawn.sized(drawn.size * sizes[0]);
        let signals = |sizes: &[f64]| {
            let position_m = self.disturbed_m(&at(sizes)).ok()?;
            self.distance_sigma(&self.shown(&position_m), &self.base).map(|sigma| vec![sigma])
        };
        let found = scale_to_signal(asked_sigma, vec![1.0], &[20.0], signals);
        Ok(found.map(|(sizes, sigma)| (at(&sizes), sigma[0])))
    }

    /// Returns the slugs of the effects in `compared` that noise-free data cannot distinguish from the hidden effects. An effect may replace all hidden
    /// effects, or one effect of a pair.
    pub fn ideal_class(&self, shown: &Shown, hidden: &[String], compared: &[&'static dyn Effect]) -> Vec<String> {
        let mut class = Vec::new();
        for effect in compared {
            let slug = effect.slug();
            let hidden: Vec<&str> = hidden.iter().map(String::as_str).collect();
            let mut models = vec![vec![slug]];
            if let [a, b] = hidden[..] {
                models.extend([vec![slug, b], vec![a, slug]]);
            }
            let explains = |model: &Vec<&str>| {
                // An effect that is incompatible with the others or with this law is not a candidate.
                let Ok(candidate) = self.subject.extended(model) else { return false };
                self.distance_sigma(shown, &candidate).is_some_and(|sigma| sigma < SEPARATED_SIGMA)
            };
            if hidden.contains(&slug) || models.iter().any(explains) {
                class.push(slug.to_string());
            }
        }
        class
    }
}

#[cfg(test)]
#[path = "../../../criticism/src/test_protocols.rs"]
mod test_protocols;

#[cfg(test)]
mod tests {
    use super::test_protocols::{NOISE, ONE_LEVEL, TWO_LEVELS, at, subject_with};
    use super::*;
    use models::effects::Library;

    /// Signals have the requested size. With one force level, an asymmetry is equivalent to a bias, alone or together with a drift. With two levels it is not.
    #[test]
    fn an_ideal_class_is_what_the_protocol_cannot_tell_from_what_is_hidden() {
        let library = Library::only(&["clock-offset", "force-asymmetry", "force-bias", "tracking-drift"]);
        let class = |cycles: &[&[f64]], hidden: &[&str], asked_sigma: f64| {
            let subject = subject_with(cycles, &library, &[]);
            let (base, fitted) = at(&subject, &[], &[]);
            let motion = Motion { subject, base, theta: fitted.theta, noise: NOISE };
            let slugs: Vec<String> = hidden.iter().map(|slug| slug.to_string()).collect();
            let drawn = motion.with_effects(
                &slugs,
                Strength::Sigma(asked_sigma),
                library.effects(),
                &mut RandomStream::new(5, 0),
            );
            let (effects, class) = drawn.expect("models").expect("in reach");
            assert!(effects.iter().all(|effect| (effect.signal_sigma / asked_sigma - 1.0).abs() < 0.02), "{effects:?}");
            class
        };
        assert_eq!(class(&ONE_LEVEL, &["force-bias"], 20.0), ["force-asymmetry", "force-bias"]);
        assert_eq!(class(&TWO_LEVELS, &["force-bias"], 20.0), ["force-bias"]);
        let pair = class(&ONE_LEVEL, &["force-bias", "tracking-drift"], 6.0);
        assert!(pair.iter().any(|slug| slug == "force-asymmetry") && pair.len() >= 3, "{pair:?}");
    }
}
