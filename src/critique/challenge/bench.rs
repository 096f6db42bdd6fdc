//! Where truths are drawn.

use super::super::separation::{SEPARATED_SIGMA, Truth as Shown, closest};
use super::super::{Candidate, Subject};
use super::large::{self, LargeGel};
use super::strength::scaled_to;
use super::{Disturbance, Hidden, HiddenEffect, NamedValue, NoiseKind, OutsideKind, Protocol, Truth};
use crate::effects::{Effect, Library};
use crate::error::{Error, Place, Result};
use crate::experiment::{Apparatus, Experiment, Record};
use crate::inference::ensemble::RandomStream;
use crate::model::Compliance;
use crate::study::ModelSpecification;
use crate::workflow::Monitor;
use crate::workflow::problem::Problem;
use crate::workflow::replica::{TABLE_I, embedded};

/// What to hide, in which experiment.
#[derive(Debug, Clone, PartialEq)]
pub struct Order {
    /// What to hide.
    pub hidden: Hidden,
    /// Protocol.
    pub protocol: Protocol,
    /// Noise.
    pub noise: NoiseKind,
    /// Signal in standard deviations that each hidden thing shall have; `None` for a size from the effect's prior.
    pub strength_sigma: Option<f64>,
}

/// The reference apparatus with its reduced model, on which truths are drawn and sized.
pub struct Bench {
    problem: Problem,
    compliance: Compliance,
    library: Library,
}

/// Elastic displacement, retardation time and flow of a drawn law lie within these factors of Table I's.
const LARGEST_FACTOR: f64 = 2.0;
const LONGEST_FACTOR: f64 = 3.0;
/// Laws, signs and shapes that are tried before a signal is called out of reach.
const MOST_DRAWS: usize = 40;
/// Signal of what is outside the library where none is asked for: it has no prior.
const OUTSIDE_SIGMA: f64 = 20.0;
/// Sizes stay where the prior leaves this on either side.
const SIZE_TAIL: f64 = 1e-3;

/// Rounds in which sizes and the range of positions that their priors are scaled by come to agree.
const PRIOR_ROUNDS: usize = 4;

/// An effect with a size from its prior.
pub(super) struct FromPriors {
    /// E (Pa), c₁ and c₂ (Pa s).
    pub law: [f64; 3],
    /// Parameters of the effect.
    pub parameters: Vec<NamedValue>,
    /// Distance in σ that the best fit without it leaves of its noise-free data.
    pub signal_sigma: f64,
    /// Noise-free position (m) at every row, by the reduced model.
    pub position_m: Vec<f64>,
}

/// A law's motion, ready to have something added.
struct Motion {
    subject: Subject,
    base: Candidate,
    theta: Vec<f64>,
    noise: [f64; 5],
}

impl Bench {
    /// Meshes the reference apparatus and trains its reduced model for all effects of the library.
    ///
    /// # Errors
    /// Whatever the training refuses.
    pub fn new(monitor: &dyn Monitor) -> Result<Self> {
        let (replica, _) = embedded()?;
        let library = Library::default();
        let problem = Problem::new(replica, ModelSpecification::default(), None, monitor)?;
        let compliance = Subject::new(&problem, &library, None, monitor)?.compliance().clone();
        Ok(Self { problem, compliance, library })
    }

    /// The library.
    pub fn library(&self) -> &Library {
        &self.library
    }

    /// Effects that can be hidden: all but those that only rescale the law in a creep test of one body, of which no signal can be asked for.
    pub fn hideable(&self) -> Vec<String> {
        let shows = |effect: &&&dyn Effect| !effect.changes_field() || effect.field_model().is_some();
        self.library.effects().iter().filter(shows).map(|effect| effect.slug().to_string()).collect()
    }

    /// The reference apparatus.
    pub fn apparatus(&self) -> &Apparatus {
        &self.problem.experiment.apparatus
    }

    /// A subject of the diagnosis: an experiment on the reference apparatus, under the default base model.
    ///
    /// # Errors
    /// As [`Subject::with_compliance`].
    pub fn subject(&self, experiment: Experiment) -> Result<Subject> {
        let problem = self.problem.with(experiment, self.problem.specification.clone(), &self.library)?;
        Subject::with_compliance(&problem, &self.library, self.compliance.clone())
    }

    /// The subject of a protocol and positions (m, one a row).
    ///
    /// # Errors
    /// As [`Bench::subject`].
    pub fn subject_of(&self, protocol: Protocol, position_m: &[f64]) -> Result<Subject> {
        self.subject(protocol.experiment("challenge", self.apparatus().clone(), position_m))
    }

    /// Draws a truth. The same order and stream give the same truth.
    ///
    /// # Errors
    /// [`Error::Input`] where there is no such effect, or the signal asked for is out of its reach.
    pub fn draw(&self, order: &Order, stream: &mut RandomStream) -> Result<Truth> {
        if let Hidden::Outside(kind) = order.hidden
            && !kind.suits(order.protocol)
        {
            return Err(unsuited(kind));
        }
        let order = &self.in_order_of_application(order)?;
        for _ in 0..MOST_DRAWS {
            let motion = self.motion(order, self.law(stream))?;
            if let Some(truth) = self.with_hidden(order, &motion, stream)? {
                return Ok(truth);
            }
        }
        Err(out_of_reach(order))
    }

    /// Effects in the library's order, which is that of a model's parameters.
    fn in_order_of_application(&self, order: &Order) -> Result<Order> {
        let Hidden::Effects(slugs) = &order.hidden else { return Ok(order.clone()) };
        if let Some(unknown) = slugs.iter().find(|slug| self.library.get(slug).is_none()) {
            return Err(Error::input(
                Place::option("--effect"),
                format!("there is no effect `{unknown}`"),
                "name effects that `vitreo-uq effects` lists",
            ));
        }
        let known = self.library.effects().iter().map(|effect| effect.slug());
        let sorted: Vec<String> = known.filter(|slug| slugs.iter().any(|s| s == slug)).map(String::from).collect();
        Ok(Order { hidden: Hidden::Effects(sorted), ..order.clone() })
    }

    /// A law from the prior, given that elastic displacement, retardation time and flow are within factors of Table I's: so that the motion is like that
    /// of an experiment, and none of its parts is over before the first sample or hidden in the noise.
    fn law(&self, stream: &mut RandomStream) -> [f64; 3] {
        let priors = self.problem.priors.priors();
        let within = |value: f64, reference: f64, factor: f64| (value / reference).ln().abs() <= f64::ln(factor);
        let [modulus_pa, viscosity_1_pa_s, viscosity_2_pa_s] = TABLE_I;
        for _ in 0..10_000 {
            let [e, c1, c2]: [f64; 3] = std::array::from_fn(|k| priors[k].distribution.quantile(stream.unit()));
            if within(e, modulus_pa, LARGEST_FACTOR)
                && within(c1 / e, viscosity_1_pa_s / modulus_pa, LONGEST_FACTOR)
                && within(c2 / e, viscosity_2_pa_s / modulus_pa, LONGEST_FACTOR)
            {
                return [e, c1, c2];
            }
        }
        // A draw in about thirty is taken, so that this is out of reach.
        TABLE_I
    }

    fn motion(&self, order: &Order, law: [f64; 3]) -> Result<Motion> {
        let n_rows = order.protocol.record().n_rows();
        let still = self.subject_of(order.protocol, &vec![0.0; n_rows])?;
        let theta_of = |base: &Candidate| base.free.iter().map(|free| free.coordinate.theta(law[free.index])).collect();
        let base = still.base();
        let theta: Vec<f64> = theta_of(&base);
        let position_m = still.trajectory_m(&base, &theta)?;
        // Once more, so that priors that are scaled by the range of positions are those of this motion.
        let subject = self.subject_of(order.protocol, &position_m)?;
        let base = subject.base();
        Ok(Motion { theta: theta_of(&base), subject, base, noise: order.noise.parameters() })
    }

    /// An effect whose parameters are at uniform quantiles of their priors, as an experiment with their own data has them; `None` where that has no model.
    pub(super) fn draw_from_priors(
        &self,
        slug: &str,
        protocol: Protocol,
        noise: NoiseKind,
        stream: &mut RandomStream,
    ) -> Result<Option<FromPriors>> {
        let order = Order { hidden: Hidden::Effects(vec![slug.into()]), protocol, noise, strength_sigma: None };
        let motion = self.motion(&self.in_order_of_application(&order)?, self.law(stream))?;
        let mut law = [0.0; 3];
        law.copy_from_slice(&motion.base.parameters(&motion.theta)[..3]);
        let n_parameters = motion.subject.extended(&[slug])?.free.len() - motion.base.free.len();
        let uniforms: Vec<f64> = (0..n_parameters).map(|_| stream.unit()).collect();
        let mut position_m = motion.subject.trajectory_m(&motion.base, &motion.theta)?;
        let mut drawn = None;
        for _ in 0..PRIOR_ROUNDS {
            let subject = self.subject_of(protocol, &position_m)?;
            let candidate = subject.extended(&[slug])?;
            let mut uniforms = uniforms.iter();
            let coordinate = |free: &super::super::Free| match free.effect {
                None => free.coordinate.theta(law[free.index]),
                Some(_) => free.quantile(uniforms.next().copied().unwrap_or(0.5)),
            };
            let theta: Vec<f64> = candidate.free.iter().map(coordinate).collect();
            let Ok(moved_m) = subject.trajectory_m(&candidate, &theta) else { return Ok(None) };
            position_m = moved_m;
            drawn = Some((subject, candidate, theta));
        }
        let Some((subject, candidate, theta)) = drawn else { return Ok(None) };
        let shown = Shown { candidate: &candidate, theta: &theta, noise: motion.noise, position_m: &position_m };
        let Ok(nearest) = closest(&subject, &subject.base(), &shown) else { return Ok(None) };
        let values = candidate.parameters(&theta);
        let of_effect = candidate.free.iter().filter(|free| free.effect.is_some());
        let parameters =
            of_effect.map(|free| NamedValue { name: free.name.into(), value: values[free.index] }).collect();
        Ok(Some(FromPriors { law, parameters, signal_sigma: nearest.distance, position_m }))
    }

    fn with_hidden(&self, order: &Order, motion: &Motion, stream: &mut RandomStream) -> Result<Option<Truth>> {
        let mut law = [0.0; 3];
        law.copy_from_slice(&motion.base.parameters(&motion.theta)[..3]);
        let mut truth = Truth::of_nothing(order.protocol, order.noise, law);
        match &order.hidden {
            Hidden::Nothing => {}
            Hidden::Apparatus(error) => truth.apparatus = Some(*error),
            Hidden::Effects(slugs) => {
                let Some((effects, class)) = motion.with_effects(slugs, order.strength_sigma, &self.library, stream)?
                else {
                    return Ok(None);
                };
                truth.ideal_class = class;
                truth.effects = effects;
            }
            Hidden::Outside(OutsideKind::LargeDisplacement) => return self.with_large(order, motion, law).map(Some),
            Hidden::Outside(kind) => {
                let asked_sigma = order.strength_sigma.unwrap_or(OUTSIDE_SIGMA);
                let drawn = Disturbance::draw(*kind, stream);
                let Some((disturbance, sigma)) = motion.with_outside(&drawn, asked_sigma)? else { return Ok(None) };
                let position_m = motion.disturbed_m(&disturbance)?;
                // What an effect of the library would explain is not outside.
                if !motion.ideal_class(&motion.shown(&position_m), &[], &self.library).is_empty() {
                    return Ok(None);
                }
                (truth.outside, truth.outside_sigma) = (Some(disturbance), Some(sigma));
            }
        }
        Ok(Some(truth))
    }

    /// A gel so much stiffer than the drawn law that large displacements show as strongly as is asked.
    fn with_large(&self, order: &Order, motion: &Motion, law: [f64; 3]) -> Result<Truth> {
        let asked_sigma = order.strength_sigma.unwrap_or(OUTSIDE_SIGMA);
        let gel = LargeGel::new(self.apparatus(), large::SIZING_LEVEL)?;
        let farthest_m = motion.farthest_m()?;
        let radius_m = large::radius_m(self.apparatus())?;
        let law_at = |radii: f64| law.map(|value| value * farthest_m / (radii * radius_m));
        let at = |radii: f64| -> Result<(Motion, Vec<f64>)> {
            let motion = self.motion(order, law_at(radii))?;
            let position_m = gel.position_m(law_at(radii), motion.record())?;
            Ok((motion, position_m))
        };
        let sigma_at = |radii: f64| {
            let (motion, position_m) = at(radii).ok()?;
            motion.distance_sigma(&motion.shown(&position_m), &motion.base)
        };
        // A gel does not know left from right: what is not linear in it goes with the third power.
        let signals = |cubes: &[f64]| sigma_at(cubes[0].cbrt()).map(|sigma| vec![sigma]);
        let most = large::FARTHEST_RADII.powi(3);
        let Some((cubes, sigma)) = scaled_to(asked_sigma, vec![0.5 * most], &[most], signals) else {
            let farthest = sigma_at(large::FARTHEST_RADII).map_or("unknown".into(), |sigma| format!("{sigma:.1} σ"));
            return Err(Error::input(
                Place::option("--strength"),
                format!(
                    "{asked_sigma} σ are out of reach: the mesh carries {} radii, where the signal is {farthest}",
                    large::FARTHEST_RADII
                ),
                "ask for a smaller `--strength`",
            ));
        };
        let radii = cubes[0].cbrt();
        let (motion, position_m) = at(radii)?;
        let mut truth = Truth::of_nothing(order.protocol, order.noise, law_at(radii));
        truth.outside = Some(Disturbance { kind: OutsideKind::LargeDisplacement, size: radii, shape: Vec::new() });
        truth.outside_sigma = Some(sigma[0]);
        truth.ideal_class = motion.ideal_class(&motion.shown(&position_m), &[], &self.library);
        Ok(truth)
    }
}

impl Motion {
    /// Farthest position (m) without anything hidden.
    fn farthest_m(&self) -> Result<f64> {
        let position_m = self.subject.trajectory_m(&self.base, &self.theta)?;
        Ok(position_m.iter().fold(0.0, |most, x| x.abs().max(most)))
    }

    fn record(&self) -> &Record {
        &self.subject.experiment().record
    }

    /// Noise-free positions (m) that the law has a part in.
    fn shown<'a>(&'a self, position_m: &'a [f64]) -> Shown<'a> {
        Shown { candidate: &self.base, theta: &self.theta, noise: self.noise, position_m }
    }

    /// Distance in σ that the best fit of a candidate leaves; `None` where it has no model.
    fn distance_sigma(&self, shown: &Shown, candidate: &Candidate) -> Option<f64> {
        closest(&self.subject, candidate, shown).ok().map(|closest| closest.distance)
    }

    /// Effects at sizes of the signal asked for, each given the others, and those that cannot be told from them; `None` where that is out of reach.
    fn with_effects(
        &self,
        slugs: &[String],
        asked_sigma: Option<f64>,
        library: &Library,
        stream: &mut RandomStream,
    ) -> Result<Option<(Vec<HiddenEffect>, Vec<String>)>> {
        let names: Vec<&str> = slugs.iter().map(String::as_str).collect();
        let candidate = self.subject.extended(&names)?;
        let mut theta = candidate.embed(&self.base, &self.theta);
        // Coordinate, null and signed reach of each effect's size.
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
        let (theta, signals_sigma) = match asked_sigma {
            None => {
                let Some(found) = signals(&theta) else { return Ok(None) };
                (theta, found)
            }
            Some(asked_sigma) => {
                let at = |reach: &[f64]| {
                    let mut theta = theta.clone();
                    for ((k, null, whole), share) in sizes.iter().zip(reach) {
                        theta[*k] = null + whole * share;
                    }
                    theta
                };
                let n = sizes.len();
                match scaled_to(asked_sigma, vec![0.1; n], &vec![1.0; n], |reach| signals(&at(reach))) {
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
        Ok(Some((effects, self.ideal_class(&shown, slugs, library))))
    }

    /// Noise-free positions (m) with a disturbance.
    fn disturbed_m(&self, disturbance: &Disturbance) -> Result<Vec<f64>> {
        let record = self.record();
        let mut experiment = self.subject.experiment().clone();
        experiment.record.force_n = disturbance.force_n(record);
        let problem = self.subject.problem();
        let acting = problem.with(experiment, self.subject.specification().clone(), self.subject.library())?;
        let acting = Subject::with_compliance(&acting, self.subject.library(), self.subject.compliance().clone())?;
        let position_m = acting.trajectory_m(&acting.base(), &self.theta)?;
        Ok(disturbance.recorded_m(record, &position_m))
    }

    fn with_outside(&self, drawn: &Disturbance, asked_sigma: f64) -> Result<Option<(Disturbance, f64)>> {
        let at = |sizes: &[f64]| drawn.sized(drawn.size * sizes[0]);
        let signals = |sizes: &[f64]| {
            let position_m = self.disturbed_m(&at(sizes)).ok()?;
            self.distance_sigma(&self.shown(&position_m), &self.base).map(|sigma| vec![sigma])
        };
        let found = scaled_to(asked_sigma, vec![1.0], &[20.0], signals);
        Ok(found.map(|(sizes, sigma)| (at(&sizes), sigma[0])))
    }

    /// Effects that cannot be told from the hidden ones by noise-free data: alone, or in the place of one of a pair.
    fn ideal_class(&self, shown: &Shown, hidden: &[String], library: &Library) -> Vec<String> {
        let mut class = Vec::new();
        for effect in library.effects() {
            let slug = effect.slug();
            let hidden: Vec<&str> = hidden.iter().map(String::as_str).collect();
            let mut models = vec![vec![slug]];
            if let [a, b] = hidden[..] {
                models.extend([vec![slug, b], vec![a, slug]]);
            }
            let explains = |model: &Vec<&str>| {
                // What cannot stand together, or with this law, is no candidate.
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

fn unsuited(kind: OutsideKind) -> Error {
    Error::input(
        Place::option("--outside"),
        format!(
            "`{}` is no unknown physics with the paper's protocol: with one force level it is a delay or a scale",
            kind.name()
        ),
        "ask for `--protocol levels`, or leave the kind away",
    )
}

fn out_of_reach(order: &Order) -> Error {
    let what = match &order.hidden {
        Hidden::Effects(slugs) => slugs.join(" and "),
        Hidden::Outside(kind) => kind.name().into(),
        _ => "this".into(),
    };
    let strength = order.strength_sigma.map_or(String::new(), |sigma| format!(" by {sigma} standard deviations"));
    Error::input(
        Place::option("--strength"),
        format!("{what} cannot be made to show{strength} under the {} protocol", order.protocol.name()),
        "ask for less, for another effect, or for the other protocol; `vitreo-uq effects` says what an experiment can see",
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::critique::separation::tests::{NOISE, ONE_LEVEL, TWO_LEVELS, at, subject_with};

    /// Signals are those asked for; on one force level an asymmetry stands for a bias, alone or beside a drift, and on two it does not.
    #[test]
    fn an_ideal_class_is_what_the_protocol_cannot_tell_from_what_is_hidden() {
        let library = Library::only(&["clock-offset", "force-asymmetry", "force-bias", "tracking-drift"]);
        let class = |cycles: &[&[f64]], hidden: &[&str], asked_sigma: f64| {
            let subject = subject_with(cycles, &library, &[]);
            let (base, fitted) = at(&subject, &[], &[]);
            let motion = Motion { subject, base, theta: fitted.theta, noise: NOISE };
            let slugs: Vec<String> = hidden.iter().map(|slug| slug.to_string()).collect();
            let drawn = motion.with_effects(&slugs, Some(asked_sigma), &library, &mut RandomStream::new(5, 0));
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
