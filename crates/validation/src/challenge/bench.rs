//! Where truths are drawn.

use rayon::prelude::*;

use super::large::{self, LargeGel};
use super::motion::Motion;
use super::protocol::WHITE_M;
use super::strength::Strength;
use super::{Disturbance, Hidden, HiddenEffect, NamedValue, NoiseKind, OutsideKind, Protocol, Truth};
use base::error::{Error, Place, Result, Setting};
use criticism::Candidate;
use criticism::Subject;
use criticism::separation::{Truth as Shown, closest};
use laws::rheology::BaseLaw;
use models::effects::{AMPLITUDE, Effect, Library};
use models::model::{Compliance, Model};
use posterior::monitor::Monitor;
use posterior::prepared::PreparedModel;
use posterior::problem::Problem;
use posterior::replica::{TABLE_I, embedded};
use posterior::study::ModelSpecification;
use record::{Apparatus, Experiment};
use sampling::ensemble::RandomStream;

/// Pairs that are drawn at most until two effects can stand together.
const MOST_PAIRS: usize = 1000;

/// What to hide, in which experiment.
#[derive(Debug, Clone, PartialEq)]
pub struct Order {
    /// What to hide.
    pub hidden: Hidden,
    /// Protocol.
    pub protocol: Protocol,
    /// Noise.
    pub noise: NoiseKind,
    /// Whether the experiment states the noise.
    pub is_noise_given: bool,
    /// How much of it.
    pub strength: Strength,
}

/// The reference apparatus with its reduced model, on which truths are drawn and sized.
pub struct Bench {
    problem: Problem,
    compliance: Compliance,
    library: Library,
    /// Effects that can be fitted here, in the library's order.
    served: Vec<&'static dyn Effect>,
}

/// Elastic displacement, retardation time and flow of a drawn law lie within these factors of Table I's.
const LARGEST_FACTOR: f64 = 2.0;
const LONGEST_FACTOR: f64 = 3.0;
/// Laws, signs and shapes that are tried before a signal is called out of reach.
const MOST_DRAWS: usize = 40;
/// Signal of what is outside the library where none is asked for: it has no prior.
const OUTSIDE_SIGMA: f64 = 20.0;
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

impl Bench {
    /// Meshes the reference apparatus and trains its reduced model for all effects of the library.
    ///
    /// # Errors
    /// Whatever the training refuses.
    pub fn new(monitor: &dyn Monitor) -> Result<Self> {
        Self::serving_those(|_| true, monitor)
    }

    /// Trains its reduced model for those effects alone that are named, and for all that need no more than the base law's: for one truth with these hidden.
    ///
    /// # Errors
    /// [`Error::Input`] where there is no such effect; whatever the training refuses.
    pub fn serving(slugs: &[String], monitor: &dyn Monitor) -> Result<Self> {
        refuse_unknown(&Library::default(), slugs)?;
        Self::serving_those(|effect| !effect.changes_field() || slugs.iter().any(|s| s == effect.slug()), monitor)
    }

    fn serving_those(is_served: impl Fn(&dyn Effect) -> bool, monitor: &dyn Monitor) -> Result<Self> {
        let (replica, _) = embedded()?;
        let library = Library::default();
        let served: Vec<_> = library.effects().iter().copied().filter(|effect| is_served(*effect)).collect();
        let problem = Problem::new(replica, ModelSpecification::default(), None, monitor)?;
        monitor.stage("preparing the models that size a signal");
        let compliance = PreparedModel::for_effects(&problem, &library, &served, None, monitor)?.compliance;
        Ok(Self { problem, compliance, library, served })
    }

    /// The library.
    pub fn library(&self) -> &Library {
        &self.library
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

    /// The subject of a protocol and positions (m, one a row), with the noise of a tracker that has white noise.
    ///
    /// # Errors
    /// As [`Bench::subject`].
    pub fn subject_of(&self, protocol: Protocol, position_m: &[f64]) -> Result<Subject> {
        let all: Vec<Option<f64>> = position_m.iter().copied().map(Some).collect();
        self.subject_measured(protocol, &all, Some(WHITE_M))
    }

    /// The subject of a protocol, positions (m, one a row, some of which may be lost) and noise (m), where it is given.
    ///
    /// # Errors
    /// As [`Bench::subject`].
    pub fn subject_measured(
        &self,
        protocol: Protocol,
        position_m: &[Option<f64>],
        noise_sd_m: Option<f64>,
    ) -> Result<Subject> {
        self.subject(protocol.experiment("challenge", self.apparatus().clone(), position_m, noise_sd_m))
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
            let motion = self.motion(order.protocol, order.noise, self.law(stream))?;
            if let Some(mut truth) = self.with_hidden(order, &motion, stream)? {
                if truth.outside.is_some() || !truth.effects.is_empty() {
                    let is_served = |slug: &str| self.served.iter().any(|effect| effect.slug() == slug);
                    let others = self.library.effects().iter().map(|effect| effect.slug());
                    truth.not_compared = others.filter(|slug| !is_served(slug)).map(String::from).collect();
                }
                return Ok(Truth { is_noise_given: order.is_noise_given, ..truth });
            }
        }
        Err(out_of_reach(order))
    }

    /// A truth with its class completed by the effects that were not compared when it was drawn.
    ///
    /// # Errors
    /// [`Error::Numerical`] where the truth has no model.
    pub fn compared(&self, truth: &Truth) -> Result<Truth> {
        let mut whole = Truth { not_compared: Vec::new(), ..truth.clone() };
        let is_late = |effect: &&&'static dyn Effect| truth.not_compared.iter().any(|slug| slug == effect.slug());
        let late: Vec<_> = self.served.iter().filter(is_late).copied().collect();
        if late.is_empty() {
            return Ok(whole);
        }
        let motion = self.motion(truth.protocol, truth.noise, truth.law)?;
        let hidden: Vec<String> = truth.effects.iter().map(|effect| effect.slug.clone()).collect();
        let found = if let Some(mobility) = self.mobility_of(truth) {
            let gel = LargeGel::new(self.apparatus(), &large::SIZING)?;
            let position_m = gel.position_m(truth.law, mobility, motion.record())?;
            motion.ideal_class(&motion.shown(&position_m), &[], &late)
        } else {
            let (candidate, theta) = motion.with_hidden_effects(truth)?;
            let position_m = match &truth.outside {
                Some(outside) => motion.disturbed_m(outside)?,
                None => motion.subject.trajectory_m(&candidate, &theta)?,
            };
            let shown = Shown { candidate: &candidate, theta: &theta, noise: motion.noise, position_m: &position_m };
            motion.ideal_class(&shown, &hidden, &late)
        };
        let is_in = |slug: &str| truth.ideal_class.iter().chain(&found).any(|known| known == slug);
        let all = self.library.effects().iter().map(|effect| effect.slug());
        whole.ideal_class = all.filter(|slug| is_in(slug)).map(String::from).collect();
        Ok(whole)
    }

    /// Effects in the library's order, which is that of a model's parameters.
    fn in_order_of_application(&self, order: &Order) -> Result<Order> {
        let Hidden::Effects(slugs) = &order.hidden else { return Ok(order.clone()) };
        refuse_unknown(&self.library, slugs)?;
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

    fn motion(&self, protocol: Protocol, noise: NoiseKind, law: [f64; 3]) -> Result<Motion> {
        let n_rows = protocol.record().n_rows();
        let still = self.subject_of(protocol, &vec![0.0; n_rows])?;
        let theta_of = |base: &Candidate| base.free.iter().map(|free| free.coordinate.theta(law[free.index])).collect();
        let base = still.base();
        let theta: Vec<f64> = theta_of(&base);
        let position_m = still.trajectory_m(&base, &theta)?;
        // Once more, so that priors that are scaled by the range of positions are those of this motion.
        let subject = self.subject_of(protocol, &position_m)?;
        let base = subject.base();
        Ok(Motion { theta: theta_of(&base), subject, base, noise: noise.parameters() })
    }

    /// An effect whose parameters are at uniform quantiles of their priors, as an experiment with their own data has them; `None` where that has no model.
    pub(super) fn draw_from_priors(
        &self,
        slug: &str,
        protocol: Protocol,
        noise: NoiseKind,
        stream: &mut RandomStream,
    ) -> Result<Option<FromPriors>> {
        let motion = self.motion(protocol, noise, self.law(stream))?;
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
            let coordinate = |free: &criticism::Free| match free.effect {
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
            Hidden::Effects(slugs) if slugs.iter().any(|slug| self.is_large(slug)) => {
                let [slug] = &slugs[..] else { return Err(not_beside()) };
                let effect = |signal_sigma: f64| HiddenEffect {
                    slug: slug.clone(),
                    parameters: vec![NamedValue { name: AMPLITUDE.into(), value: 1.0 }],
                    signal_sigma,
                };
                let (large, _, sigma) = self.with_large(order, motion, law, 0.0)?;
                return Ok(Some(Truth { effects: vec![effect(sigma)], ..large }));
            }
            Hidden::Effects(slugs) => {
                let Some((effects, class)) = motion.with_effects(slugs, order.strength, &self.served, stream)? else {
                    return Ok(None);
                };
                truth.ideal_class = class;
                truth.effects = effects;
            }
            Hidden::Outside(kind @ OutsideKind::LargeDisplacement) => {
                let mobility = large::mobility(stream.unit());
                let (large, size, sigma) = self.with_large(order, motion, law, mobility)?;
                let outside = Some(Disturbance { kind: *kind, size, shape: vec![mobility] });
                return Ok(Some(Truth { outside, outside_sigma: Some(sigma), ..large }));
            }
            Hidden::Outside(kind) => {
                let asked_sigma = order.strength.sigma_or(OUTSIDE_SIGMA);
                let drawn = Disturbance::draw(*kind, stream);
                let Some((disturbance, sigma)) = motion.with_outside(&drawn, asked_sigma)? else { return Ok(None) };
                let position_m = motion.disturbed_m(&disturbance)?;
                // What an effect of the library would explain is not outside.
                if !motion.ideal_class(&motion.shown(&position_m), &[], &self.served).is_empty() {
                    return Ok(None);
                }
                (truth.outside, truth.outside_sigma) = (Some(disturbance), Some(sigma));
            }
        }
        Ok(Some(truth))
    }

    /// Whether this is the slug of large displacements.
    fn is_large(&self, slug: &str) -> bool {
        self.library.get(slug).is_some_and(large::is_large)
    }

    /// The mobility of a truth's gel where that has large displacements.
    pub(super) fn mobility_of(&self, truth: &Truth) -> Option<f64> {
        large::mobility_of(truth, |slug| self.is_large(slug))
    }

    /// A gel so much stiffer or softer than the drawn law that large displacements show as strongly as is asked, as nearly as some radii between 1 and 4 do: the law takes up so much of the deviation
    /// that the signal need not grow with them. With those radii, and the signal in σ.
    fn with_large(&self, order: &Order, motion: &Motion, law: [f64; 3], mobility: f64) -> Result<(Truth, f64, f64)> {
        let asked_sigma = order.strength.sigma_or(OUTSIDE_SIGMA);
        let gel = LargeGel::new(self.apparatus(), &large::SIZING)?;
        let (farthest_m, radius_m) = (motion.farthest_m()?, large::radius_m(self.apparatus())?);
        let at = |radii: &f64| -> Result<(f64, f64, Motion, Vec<f64>)> {
            let law = law.map(|value| value * farthest_m / (radii * radius_m));
            let motion = self.motion(order.protocol, order.noise, law)?;
            let position_m = gel.position_m(law, mobility, motion.record())?;
            let sigma = motion.distance_sigma(&motion.shown(&position_m), &motion.base);
            Ok((*radii, sigma.ok_or_else(|| out_of_reach(order))?, motion, position_m))
        };
        let tried: Vec<_> = large::RADII.par_iter().map(at).collect::<Result<_>>()?;
        let off = |sigma: f64| (sigma / asked_sigma).ln().abs();
        let nearest = tried.into_iter().min_by(|a, b| off(a.1).total_cmp(&off(b.1)));
        let (radii, sigma, motion, position_m) = nearest.ok_or_else(|| out_of_reach(order))?;
        let law = law.map(|value| value * farthest_m / (radii * radius_m));
        let mut truth = Truth::of_nothing(order.protocol, order.noise, law);
        truth.ideal_class = motion.ideal_class(&motion.shown(&position_m), &[], &self.served);
        let slugs = self.library.effects().iter().filter(|effect| large::is_large(**effect));
        truth.ideal_class.extend(slugs.map(|effect| effect.slug().to_string()));
        Ok((truth, radii, sigma))
    }
}

/// Effects that are hidden unless one is named: all but those that only rescale the law in a creep test of one body, of which no signal can be asked for; and large displacements, which are learnt anew for every record,
/// and whose signal is bounded.
pub fn hideable(library: &Library) -> Vec<String> {
    let shows = |effect: &&&dyn Effect| match effect.field() {
        Some(field) => !field.is_learnt_for_record(),
        None => !effect.changes_field(),
    };
    library.effects().iter().filter(shows).map(|effect| effect.slug().to_string()).collect()
}

/// Two effects that one model can have, drawn from some.
///
/// # Errors
/// Whatever reading the reference experiment refuses; [`Error::Input`] where no two can stand together.
pub fn draw_pair(library: &Library, slugs: &[String], stream: &mut RandomStream) -> Result<[String; 2]> {
    let (replica, _) = embedded()?;
    for _ in 0..MOST_PAIRS {
        let (a, b) = stream.distinct_pair(slugs.len());
        let effects = [a, b].iter().filter_map(|k| library.get(&slugs[*k])).collect();
        if Model::new(BaseLaw::Lethersich, effects, replica.scales(), &Place::default()).is_ok() {
            return Ok([slugs[a].clone(), slugs[b].clone()]);
        }
    }
    Err(Error::input(Place::setting(Setting::Pair), "no two of these effects can stand together", "name other effects"))
}

fn not_beside() -> Error {
    Error::input(
        Place::setting(Setting::Pair),
        "large displacements are hidden alone",
        format!("ask for `{} large-displacement`", Setting::HiddenEffect),
    )
}

fn refuse_unknown(library: &Library, slugs: &[String]) -> Result<()> {
    match slugs.iter().find(|slug| library.get(slug).is_none()) {
        None => Ok(()),
        Some(unknown) => Err(Error::input(
            Place::setting(Setting::HiddenEffect),
            format!("there is no effect `{unknown}`"),
            "name effects that `vitreo-uq effects` lists",
        )),
    }
}

fn unsuited(kind: OutsideKind) -> Error {
    Error::input(
        Place::setting(Setting::Outside),
        format!(
            "`{}` is no unknown physics with the paper's protocol: with one force level it is a delay or a scale",
            kind.name()
        ),
        format!("ask for `{} levels`, or leave the kind away", Setting::Protocol),
    )
}

fn out_of_reach(order: &Order) -> Error {
    let what = match &order.hidden {
        Hidden::Effects(slugs) => slugs.join(" and "),
        Hidden::Outside(kind) => kind.name().into(),
        _ => "this".into(),
    };
    let (setting, strength) = match order.strength {
        Strength::Sigma(sigma) => (Setting::Strength, format!(" by {sigma} standard deviations")),
        Strength::Prior => (Setting::Strength, String::new()),
        Strength::Size(size) => (Setting::Size, format!(" at a size of {size}")),
    };
    Error::input(
        Place::setting(setting),
        format!("{what} cannot be made to show{strength} under the {} protocol", order.protocol.name()),
        "ask for less, for another effect, or for the other protocol; `vitreo-uq effects` says what an experiment can see",
    )
}
