//! Draws the truths of challenges: laws, hidden effects and disturbances with a given strength.

use rayon::prelude::*;

use super::large::{self, LargeGel};
use super::motion::Motion;
use super::protocol::WHITE_M;
use super::strength::Strength;
use super::{Disturbance, DisturbanceKind, HiddenEffect, HiddenPhysics, NamedValue, NoiseKind, Protocol, Truth};
use base::error::{Error, InputPlace, Result, Setting};
use criticism::Candidate;
use criticism::Subject;
use criticism::separation::{RivalTruth as Shown, fit_rival};
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

/// Largest number of random pairs of effects that are tried until two are compatible.
const MOST_PAIRS: usize = 1000;

/// Specification of a truth to draw: hidden effects or errors, protocol, noise and strength.
#[derive(Debug, Clone, PartialEq)]
pub struct TruthRequest {
    /// Hidden effects or errors: effects, physics outside the library, a wrong constant of the apparatus, or nothing.
    pub hidden: HiddenPhysics,
    /// Protocol of the experiment.
    pub protocol: Protocol,
    /// Kind of noise in the experiment's data.
    pub noise: NoiseKind,
    /// True if the experiment states its noise standard deviation.
    pub is_noise_given: bool,
    /// Strength of the hidden effects or disturbance.
    pub strength: Strength,
}

/// The reference apparatus with its surrogate. Truths are drawn for it, and their signals are computed with it.
pub struct Bench {
    problem: Problem,
    compliance: Compliance,
    library: Library,
    /// Effects that the surrogate covers, in the library's order.
    served: Vec<&'static dyn Effect>,
}

/// Largest factors between a drawn law and the law of the paper's Table I. `LARGEST_FACTOR` limits the elastic displacement. `LONGEST_FACTOR` limits
/// retardation time and flow.
const LARGEST_FACTOR: f64 = 2.0;
const LONGEST_FACTOR: f64 = 3.0;
/// Number of draws (law, signs and shapes) after which a requested signal counts as out of reach.
const MOST_DRAWS: usize = 40;
/// Default signal of physics outside the library, in standard deviations. Such physics has no prior to draw a size from.
const OUTSIDE_SIGMA: f64 = 20.0;
/// Number of fixed-point iterations in `draw_from_priors`. Priors may scale with the range of positions, and this range depends on the drawn sizes.
const PRIOR_ROUNDS: usize = 4;

/// An effect with parameters drawn from its prior.
pub(super) struct FromPriors {
    /// Drawn law: E (Pa), c₁ and c₂ (Pa s).
    pub law: [f64; 3],
    /// Drawn parameters of the effect.
    pub parameters: Vec<NamedValue>,
    /// Distance between the noise-free data and the best fit without the effect, in noise standard deviations.
    pub signal_sigma: f64,
    /// Noise-free position (m) at every row, from the surrogate.
    pub position_m: Vec<f64>,
}

impl Bench {
    /// Meshes the reference apparatus, and trains its surrogate for all effects of the library.
    ///
    /// # Errors
    /// Errors of the training.
    pub fn new(monitor: &dyn Monitor) -> Result<Self> {
        Self::serving_those(|_| true, monitor)
    }

    /// Meshes the reference apparatus, and trains its surrogate for fewer effects than [`Bench::new`]: for `slugs`, and for all effects that leave the
    /// displacement field unchanged. These suffice to draw a truth that hides the effects `slugs`.
    ///
    /// # Errors
    /// [`Error::Input`] if an effect does not exist; errors of the training.
    pub fn for_effects(slugs: &[String], monitor: &dyn Monitor) -> Result<Self> {
        refuse_unknown(&Library::default(), slugs)?;
        Self::serving_those(|effect| !effect.changes_field() || slugs.iter().any(|s| s == effect.slug()), monitor)
    }

    fn serving_those(is_served: impl Fn(&dyn Effect) -> bool, monitor: &dyn Monitor) -> Result<Self> {
        let (replica, _) = embedded()?;
        let library = Library::default();
        let served: Vec<_> = library.effects().iter().copied().filter(|effect| is_served(*effect)).collect();
        let problem = Problem::new(replica, ModelSpecification::default(), None, monitor)?;
        monitor.stage("preparing the models that compute signals");
        let compliance = PreparedModel::for_effects(&problem, &library, &served, None, monitor)?.compliance;
        Ok(Self { problem, compliance, library, served })
    }

    /// Returns the library of effects, of which truths are drawn.
    pub fn library(&self) -> &Library {
        &self.library
    }

    /// Returns the reference apparatus, which all challenges use.
    pub fn apparatus(&self) -> &Apparatus {
        &self.problem.experiment.apparatus
    }

    /// Returns an experiment on the reference apparatus as a subject of the diagnosis, with the default base model.
    ///
    /// # Errors
    /// Errors of [`Subject::with_compliance`].
    pub fn subject(&self, experiment: Experiment) -> Result<Subject> {
        let problem = self.problem.with_experiment(experiment, self.problem.specification.clone(), &self.library)?;
        Subject::with_compliance(&problem, &self.library, self.compliance.clone())
    }

    /// Returns the subject of a diagnosis for a protocol and positions (m, one for each row). The stated noise is the tracker's white noise.
    ///
    /// # Errors
    /// Errors of [`Bench::subject`].
    pub fn subject_of(&self, protocol: Protocol, position_m: &[f64]) -> Result<Subject> {
        let all: Vec<Option<f64>> = position_m.iter().copied().map(Some).collect();
        self.subject_measured(protocol, &all, Some(WHITE_M))
    }

    /// Returns the subject of a diagnosis for a protocol and measured positions (m, one for each row; `None` if lost). `noise_sd_m` is the stated noise
    /// standard deviation (m); `None` if the diagnosis must estimate it.
    ///
    /// # Errors
    /// Errors of [`Bench::subject`].
    pub fn subject_measured(
        &self,
        protocol: Protocol,
        position_m: &[Option<f64>],
        noise_sd_m: Option<f64>,
    ) -> Result<Subject> {
        self.subject(protocol.experiment("challenge", self.apparatus().clone(), position_m, noise_sd_m))
    }

    /// Draws a truth. Equal requests and equal random streams give equal truths.
    ///
    /// # Errors
    /// [`Error::Input`] if an effect does not exist, or if the requested signal is out of reach.
    pub fn draw(&self, order: &TruthRequest, stream: &mut RandomStream) -> Result<Truth> {
        if let HiddenPhysics::Outside(kind) = order.hidden
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

    /// Compares the effects in the list `not_compared` with the hidden effects. Returns the truth with this list empty. Effects that this experiment cannot
    /// distinguish from the hidden effects are added to the list `ideal_class`.
    ///
    /// # Errors
    /// [`Error::Numerical`] if the model fails for the truth.
    pub fn complete_ideal_class(&self, truth: &Truth) -> Result<Truth> {
        let mut whole = Truth { not_compared: Vec::new(), ..truth.clone() };
        let is_late = |effect: &&&'static dyn Effect| truth.not_compared.iter().any(|slug| slug == effect.slug());
        let late: Vec<_> = self.served.iter().filter(is_late).copied().collect();
        if late.is_empty() {
            return Ok(whole);
        }
        let motion = self.motion(truth.protocol, truth.noise, truth.law)?;
        let hidden: Vec<String> = truth.effects.iter().map(|effect| effect.slug.clone()).collect();
        let found = if let Some(mobility) = self.mobility_of(truth) {
            let gel = LargeGel::new(self.apparatus(), &large::SIGNAL_RESOLUTION)?;
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

    /// Returns the request with its effects in the library's order, which is also the order of a model's parameters.
    fn in_order_of_application(&self, order: &TruthRequest) -> Result<TruthRequest> {
        let HiddenPhysics::Effects(slugs) = &order.hidden else { return Ok(order.clone()) };
        refuse_unknown(&self.library, slugs)?;
        let known = self.library.effects().iter().map(|effect| effect.slug());
        let sorted: Vec<String> = known.filter(|slug| slugs.iter().any(|s| s == slug)).map(String::from).collect();
        Ok(TruthRequest { hidden: HiddenPhysics::Effects(sorted), ..order.clone() })
    }

    /// Draws a law from the prior: E (Pa), c₁ and c₂ (Pa s). Its elastic displacement, retardation time and flow differ by limited factors from those of the
    /// law in Table I. The motion then resembles an experiment: no part of it ends before the first sample or stays below the noise.
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
        // About one draw in thirty is accepted, so this line is almost never reached.
        TABLE_I
    }

    fn motion(&self, protocol: Protocol, noise: NoiseKind, law: [f64; 3]) -> Result<Motion> {
        let n_rows = protocol.record().n_rows();
        let still = self.subject_of(protocol, &vec![0.0; n_rows])?;
        let theta_of = |base: &Candidate| base.free.iter().map(|free| free.coordinate.theta(law[free.index])).collect();
        let base = still.base();
        let theta: Vec<f64> = theta_of(&base);
        let position_m = still.trajectory_m(&base, &theta)?;
        // The priors of this second subject scale with the range of positions that the law predicts. The first subject stands still.
        let subject = self.subject_of(protocol, &position_m)?;
        let base = subject.base();
        Ok(Motion { theta: theta_of(&base), subject, base, noise: noise.parameters() })
    }

    /// Draws a law, and the parameters of the effect `slug` from its priors, for a record with this protocol and noise. Returns `None` if the model fails.
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
        let Ok(nearest) = fit_rival(&subject, &subject.base(), &shown) else { return Ok(None) };
        let values = candidate.parameters(&theta);
        let of_effect = candidate.free.iter().filter(|free| free.effect.is_some());
        let parameters =
            of_effect.map(|free| NamedValue { name: free.name.into(), value: values[free.index] }).collect();
        Ok(Some(FromPriors { law, parameters, signal_sigma: nearest.distance, position_m }))
    }

    fn with_hidden(&self, order: &TruthRequest, motion: &Motion, stream: &mut RandomStream) -> Result<Option<Truth>> {
        let mut law = [0.0; 3];
        law.copy_from_slice(&motion.base.parameters(&motion.theta)[..3]);
        let mut truth = Truth::of_nothing(order.protocol, order.noise, law);
        match &order.hidden {
            HiddenPhysics::Nothing => {}
            HiddenPhysics::Apparatus(error) => truth.apparatus = Some(*error),
            HiddenPhysics::Effects(slugs) if slugs.iter().any(|slug| self.is_large(slug)) => {
                let [slug] = &slugs[..] else { return Err(not_beside()) };
                let effect = |signal_sigma: f64| HiddenEffect {
                    slug: slug.clone(),
                    parameters: vec![NamedValue { name: AMPLITUDE.into(), value: 1.0 }],
                    signal_sigma,
                };
                let (large, _, sigma) = self.with_large(order, motion, law, 0.0)?;
                return Ok(Some(Truth { effects: vec![effect(sigma)], ..large }));
            }
            HiddenPhysics::Effects(slugs) => {
                let Some((effects, class)) = motion.with_effects(slugs, order.strength, &self.served, stream)? else {
                    return Ok(None);
                };
                truth.ideal_class = class;
                truth.effects = effects;
            }
            HiddenPhysics::Outside(kind @ DisturbanceKind::LargeDisplacement) => {
                let mobility = large::mobility(stream.unit());
                let (large, size, sigma) = self.with_large(order, motion, law, mobility)?;
                let outside = Some(Disturbance { kind: *kind, size, shape: vec![mobility] });
                return Ok(Some(Truth { outside, outside_sigma: Some(sigma), ..large }));
            }
            HiddenPhysics::Outside(kind) => {
                let asked_sigma = order.strength.sigma_or(OUTSIDE_SIGMA);
                let drawn = Disturbance::draw(*kind, stream);
                let Some((disturbance, sigma)) = motion.with_outside(&drawn, asked_sigma)? else { return Ok(None) };
                let position_m = motion.disturbed_m(&disturbance)?;
                // A disturbance that an effect of the library explains is not outside the library.
                if !motion.ideal_class(&motion.shown(&position_m), &[], &self.served).is_empty() {
                    return Ok(None);
                }
                (truth.outside, truth.outside_sigma) = (Some(disturbance), Some(sigma));
            }
        }
        Ok(Some(truth))
    }

    /// True if the slug names the effect of large displacements.
    fn is_large(&self, slug: &str) -> bool {
        self.library.get(slug).is_some_and(large::is_large)
    }

    /// Giesekus mobility of the gel of a truth with large displacements, 0 for an Oldroyd-B fluid; `None` without large displacements.
    pub(super) fn mobility_of(&self, truth: &Truth) -> Option<f64> {
        large::mobility_of(truth, |slug| self.is_large(slug))
    }

    /// Returns a truth with large displacements, the largest distance of the robot from its start in radii, and the signal in noise standard deviations. The
    /// drawn law is scaled so that the robot moves by 1 to 4 radii. Among the tried distances, the function chooses the distance whose signal is nearest to the
    /// requested signal. The law absorbs much of the deviation, so the signal need not grow with the distance.
    fn with_large(
        &self,
        order: &TruthRequest,
        motion: &Motion,
        law: [f64; 3],
        mobility: f64,
    ) -> Result<(Truth, f64, f64)> {
        let asked_sigma = order.strength.sigma_or(OUTSIDE_SIGMA);
        let gel = LargeGel::new(self.apparatus(), &large::SIGNAL_RESOLUTION)?;
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

/// Slugs of the effects that may be hidden if the user names none. Two kinds are excluded. Effects that only rescale the law in a creep test of one body have
/// no adjustable signal. Large displacements need a surrogate trained for each record, and their signal is bounded.
pub fn hideable_effects(library: &Library) -> Vec<String> {
    let shows = |effect: &&&dyn Effect| match effect.field() {
        Some(field) => !field.is_learnt_for_record(),
        None => !effect.changes_field(),
    };
    library.effects().iter().filter(shows).map(|effect| effect.slug().to_string()).collect()
}

/// Draws two effects from `slugs` that one model can contain together.
///
/// # Errors
/// Errors of reading the reference experiment; [`Error::Input`] if no two effects are compatible.
pub fn draw_pair(library: &Library, slugs: &[String], stream: &mut RandomStream) -> Result<[String; 2]> {
    let (replica, _) = embedded()?;
    for _ in 0..MOST_PAIRS {
        let (a, b) = stream.distinct_pair(slugs.len());
        let effects = [a, b].iter().filter_map(|k| library.get(&slugs[*k])).collect();
        if Model::new(BaseLaw::Lethersich, effects, replica.scales(), &InputPlace::default()).is_ok() {
            return Ok([slugs[a].clone(), slugs[b].clone()]);
        }
    }
    Err(Error::input(
        InputPlace::setting(Setting::Pair),
        "no two of these effects fit into one model",
        "give other effects",
    ))
}

fn not_beside() -> Error {
    Error::input(
        InputPlace::setting(Setting::Pair),
        "large displacements cannot be hidden together with another effect",
        format!("give only `{} large-displacement`", Setting::HiddenEffect),
    )
}

fn refuse_unknown(library: &Library, slugs: &[String]) -> Result<()> {
    match slugs.iter().find(|slug| library.get(slug).is_none()) {
        None => Ok(()),
        Some(unknown) => Err(Error::input(
            InputPlace::setting(Setting::HiddenEffect),
            format!("there is no effect `{unknown}`"),
            "give effects listed by `vitreo-uq effects`",
        )),
    }
}

fn unsuited(kind: DisturbanceKind) -> Error {
    Error::input(
        InputPlace::setting(Setting::Outside),
        format!(
            "`{}` is not outside the library with the paper's protocol: with one force level it equals a delay or a scale",
            kind.name()
        ),
        format!("use `{} levels`, or remove the kind", Setting::Protocol),
    )
}

fn out_of_reach(order: &TruthRequest) -> Error {
    let what = match &order.hidden {
        HiddenPhysics::Effects(slugs) => slugs.join(" and "),
        HiddenPhysics::Outside(kind) => kind.name().into(),
        _ => "this".into(),
    };
    let (setting, strength) = match order.strength {
        Strength::Sigma(sigma) => (Setting::Strength, format!(" at a signal of {sigma} standard deviations")),
        Strength::Prior => (Setting::Strength, String::new()),
        Strength::Size(size) => (Setting::Size, format!(" at a size of {size}")),
    };
    Error::input(
        InputPlace::setting(setting),
        format!("{what} is out of reach{strength} under the {} protocol", order.protocol.name()),
        "request a smaller signal, another effect or the other protocol; `vitreo-uq effects` lists the detectable effects of an experiment",
    )
}
