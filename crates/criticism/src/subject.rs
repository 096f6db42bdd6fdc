//! One experiment, prepared for the fits of many models.

use std::sync::{Arc, OnceLock};

use super::{Candidate, rank::Score};
use base::error::{Error, Place, Result, Setting};
use base::number::Dual;
use laws::stages::Stepped;
use models::effects::{Effect, Field, Library};
use models::model::{Compliance, Lanes, N_LANES, Response};
use models::surrogate::trajectory;
use posterior::mechanics::FiniteElements;
use posterior::monitor::{Monitor, Silent};
use posterior::noise::{NoiseLikelihood, NoiseModel};
use posterior::problem::Problem;
use posterior::reduced::{KeptSurrogate, Reduced, field_models, with_fields};
use posterior::study::ModelSpecification;
use record::Experiment;

/// Names of the noise terms that every model is given here.
pub const NOISE_TERMS: [&str; 3] = ["white", "ou", "gain"];
/// The noise is taken as this where nothing is known and nothing can be estimated, relative to the range of positions.
const UNKNOWN_NOISE: f64 = 0.005;

/// One experiment, prepared for the fits of many models.
///
/// What does not depend on the positions is shared by all subjects made from one by [`Subject::with_positions`].
#[derive(Clone)]
pub struct Subject {
    shared: Arc<Shared>,
    /// Whether trajectories of laws that are not linear are those that are remembered.
    is_local: bool,
    /// Whether the noise has the terms of the model as it is written, and no others.
    has_own_noise: bool,
    /// Positions (m) of the fitted cycles, `None` elsewhere; one entry a row of the record.
    pub fitted_m: Vec<Option<f64>>,
    /// Positions (m) of the scored cycle, `None` elsewhere.
    pub scored_m: Vec<Option<f64>>,
    /// Likelihood of the fitted positions.
    pub(super) fitted: NoiseLikelihood,
    /// Likelihood of the fitted and the scored ones.
    pub(super) all: NoiseLikelihood,
}

/// What does not depend on the positions.
pub(super) struct Shared {
    /// Fitted and scored cycles, record, apparatus; its positions are not used.
    pub experiment: Experiment,
    pub specification: ModelSpecification,
    pub base: Problem,
    pub library: Library,
    pub noise: NoiseModel,
    /// Names of the noise terms of the model as it is written.
    pub own_noise: Vec<String>,
    pub yardstick_m: f64,
    pub compliance: Compliance,
    /// The same with laws that are not linear remembering their trajectories.
    pub local: Compliance,
    pub response: Response,
    /// What answers for large displacements, once a search has looked whether it is worth learning; or why nothing does.
    pub large: Large,
}

/// What answers for large displacements, or why nothing does.
pub(super) type Large = Arc<OnceLock<std::result::Result<Stepped, NotLearnt>>>;

/// Why nothing was learnt of large displacements.
#[derive(Debug, Clone)]
pub(super) struct NotLearnt {
    /// In words.
    pub why: String,
    /// What a record shows of the effect, where a full run said it.
    pub score: Option<Score>,
}

impl NotLearnt {
    pub fn of(why: impl Into<String>) -> Self {
        Self { why: why.into(), score: None }
    }
}

impl Subject {
    /// Prepares the problem of a base model; its experiment is split into fitted and scored cycles here.
    ///
    /// # Errors
    /// Whatever training a surrogate over the Poisson ratios of all effects refuses.
    pub fn new(
        problem: &Problem,
        library: &Library,
        kept: Option<KeptSurrogate>,
        monitor: &dyn Monitor,
    ) -> Result<Self> {
        monitor.stage("preparing the models to compare");
        let compliance = compliance_of(problem, library, library.effects(), kept, monitor)?;
        Self::with_compliance(problem, library, compliance)
    }

    /// The same with a compliance that serves all effects of the library.
    ///
    /// # Errors
    /// [`Error::Input`] when the model is none of the experiment.
    pub fn with_compliance(problem: &Problem, library: &Library, compliance: Compliance) -> Result<Self> {
        let experiment = problem.experiment.for_comparison();
        let mut specification = problem.specification.clone();
        let own_noise = std::mem::replace(&mut specification.noise, NOISE_TERMS.map(String::from).to_vec());
        specification.fixed.retain(|name, _| problem.model.parameters().iter().any(|p| p.name == name));
        let base = problem.with(experiment.clone(), specification.clone(), library)?;
        let record = &experiment.record;
        let yardstick_m = problem
            .experiment
            .noise_yardstick()
            .map_or_else(|| UNKNOWN_NOISE * problem.experiment.scales().position_range_m, |yardstick| yardstick.sd_m);
        let response = Response::new(&record.time_s, record.force(), record.n_rows());
        let (fitted_m, scored_m) =
            (base.positions_of(&experiment.calibration_cycles), base.positions_of(&experiment.heldout_cycles));
        let noise = base.noise;
        let library = library.clone();
        let large = Large::default();
        let slot = large.clone();
        let compliance = match problem.model.field() {
            // Learnt with the model.
            Some((_, Field::Large)) => compliance,
            _ => compliance.with_large(move || slot.get().and_then(|found| found.clone().ok())),
        };
        let local = trajectory::local(&compliance, &experiment.record.time_s, experiment.record.force());
        let shared = Shared {
            experiment,
            specification,
            base,
            library,
            noise,
            own_noise,
            yardstick_m,
            compliance,
            local,
            response,
            large,
        };
        Ok(Self::of(Arc::new(shared), fitted_m, scored_m))
    }

    /// The same with another library, whose effects the compliance serves already.
    ///
    /// # Errors
    /// As [`Self::with_compliance`].
    pub fn with_library(&self, library: &Library) -> Result<Self> {
        self.with_experiment(self.shared.experiment.clone(), library)
    }

    fn with_experiment(&self, experiment: Experiment, library: &Library) -> Result<Self> {
        let shared = &self.shared;
        let own = Shared {
            base: shared.base.with(experiment.clone(), shared.specification.clone(), library)?,
            experiment,
            specification: shared.specification.clone(),
            library: library.clone(),
            noise: shared.noise,
            own_noise: shared.own_noise.clone(),
            yardstick_m: shared.yardstick_m,
            compliance: shared.compliance.clone(),
            local: shared.local.clone(),
            response: shared.response.clone(),
            large: shared.large.clone(),
        };
        Ok(Self { shared: Arc::new(own), ..self.clone() })
    }

    /// The same with other cycles fitted and scored.
    ///
    /// # Errors
    /// As [`Self::with_compliance`].
    pub fn with_cycles(&self, fitted: &[u32], scored: &[u32]) -> Result<Self> {
        let mut experiment = self.shared.experiment.clone();
        (experiment.calibration_cycles, experiment.heldout_cycles) = (fitted.to_vec(), scored.to_vec());
        let own = self.with_experiment(experiment, &self.shared.library)?;
        let (fitted_m, scored_m) = (own.shared.base.positions_of(fitted), own.shared.base.positions_of(scored));
        let other = Self::of(own.shared, fitted_m, scored_m);
        Ok(Self { is_local: self.is_local, has_own_noise: self.has_own_noise, ..other })
    }

    fn of(shared: Arc<Shared>, fitted_m: Vec<Option<f64>>, scored_m: Vec<Option<f64>>) -> Self {
        let record = &shared.experiment.record;
        let likelihood =
            |positions: &[Option<f64>]| NoiseLikelihood::new(shared.noise, &record.time_s, &record.cycle, positions);
        let both: Vec<Option<f64>> = fitted_m.iter().zip(&scored_m).map(|(a, b)| a.or(*b)).collect();
        let (fitted, all) = (likelihood(&fitted_m), likelihood(&both));
        Self { shared, is_local: false, has_own_noise: false, fitted_m, scored_m, fitted, all }
    }

    /// The same experiment with other positions (m), one a row; rows without a position stay without.
    pub fn with_positions(&self, position_m: &[f64]) -> Self {
        let replaced = |old: &[Option<f64>]| old.iter().zip(position_m).map(|(old, new)| old.map(|_| *new)).collect();
        let (fitted_m, scored_m): (Vec<Option<f64>>, Vec<Option<f64>>) =
            (replaced(&self.fitted_m), replaced(&self.scored_m));
        let both: Vec<Option<f64>> = fitted_m.iter().zip(&scored_m).map(|(a, b)| a.or(*b)).collect();
        let (fitted, all) = (self.fitted.with_observed(&fitted_m), self.all.with_observed(&both));
        Self { fitted_m, scored_m, fitted, all, ..self.clone() }
    }

    /// The same without the positions of some rows.
    pub fn without_rows(&self, rows: &[usize]) -> Self {
        let left = |old: &[Option<f64>]| {
            let mut left = old.to_vec();
            for row in rows {
                if let Some(left) = left.get_mut(*row) {
                    *left = None;
                }
            }
            left
        };
        let other = Self::of(self.shared.clone(), left(&self.fitted_m), left(&self.scored_m));
        Self { is_local: self.is_local, has_own_noise: self.has_own_noise, ..other }
    }

    /// The same where a model's noise has the terms that it is written with, and no others: what a fit of that model by `sample` or `extend` is given.
    pub fn with_own_noise(self) -> Self {
        Self { has_own_noise: true, ..self }
    }

    /// The same where many models of one law that is not linear are asked for, near to each other: its trajectories are learnt once, and then remembered.
    pub fn locally(self) -> Self {
        Self { is_local: true, ..self }
    }

    /// The experiment, split into fitted and scored cycles. Its positions are those of the measurement, outliers included.
    pub fn experiment(&self) -> &Experiment {
        &self.shared.experiment
    }

    /// The base model.
    pub fn base(&self) -> Candidate {
        Candidate::new(&self.shared.base)
    }

    /// The base model as it is written down, with the noise that is used here.
    pub fn specification(&self) -> &ModelSpecification {
        &self.shared.specification
    }

    /// The base model joined with the experiment.
    pub fn problem(&self) -> &Problem {
        &self.shared.base
    }

    /// The library.
    pub fn library(&self) -> &Library {
        &self.shared.library
    }

    /// The base model with effects added.
    ///
    /// # Errors
    /// [`Error::Input`] when they cannot stand together or the base has one of them; the text says why.
    pub fn extended(&self, effects: &[&str]) -> Result<Candidate> {
        let mut specification = self.shared.specification.clone();
        for slug in effects {
            if specification.effects.iter().any(|own| own == slug) {
                return Err(Error::input(
                    Place::setting(Setting::Effects),
                    format!("the model has `{slug}` already"),
                    "name effects that it lacks",
                ));
            }
            specification.effects.push(slug.to_string());
        }
        let problem = self.shared.base.with_model(specification, &self.shared.library)?;
        let is_new = |effect: &&&'static dyn Effect| effects.contains(&effect.slug());
        if problem.model.effects().iter().filter(is_new).any(|effect| matches!(effect.field(), Some(Field::Large))) {
            let reason = match self.shared.large.get() {
                Some(Ok(_)) => None,
                Some(Err(not_learnt)) => Some(not_learnt.why.clone()),
                None => Some("no search has learnt large displacements for this record".into()),
            };
            if let Some(reason) = reason {
                let remedy = "leave `large-displacement` out";
                return Err(Error::input(Place::setting(Setting::Effects), reason, remedy));
            }
        }
        Ok(Candidate::new(&problem))
    }

    /// Where what answers for large displacements is put by the search that learns it.
    pub(super) fn large(&self) -> &Large {
        &self.shared.large
    }

    /// The noise model.
    pub fn noise(&self) -> NoiseModel {
        self.shared.noise
    }

    /// Names of the noise terms of the model as it is written, where fits here have those alone.
    pub(super) fn own_noise(&self) -> Option<&[String]> {
        self.has_own_noise.then_some(&self.shared.own_noise[..])
    }

    /// The known or estimated noise (m) that misfits are measured against.
    pub fn yardstick_m(&self) -> f64 {
        self.shared.yardstick_m
    }

    /// Whether the noise was given with the experiment.
    pub fn is_noise_known(&self) -> bool {
        self.shared.experiment.noise_sd_m.is_some()
    }

    /// What turns ∫J dF into a position, for every effect of the library.
    pub fn compliance(&self) -> &Compliance {
        &self.shared.compliance
    }

    /// The same where many points of one law that is not linear are asked for.
    pub fn local_compliance(&self) -> &Compliance {
        &self.shared.local
    }

    /// Number of fitted positions.
    pub fn n_fitted(&self) -> usize {
        self.fitted.n_observed()
    }

    /// Positions (m) at every row of the record for one to eight points of a candidate, row by row and lane by lane; which points have one.
    pub(super) fn trajectories_m(&self, candidate: &Candidate, points: &[Vec<f64>]) -> (Vec<Lanes>, [bool; N_LANES]) {
        let mut lanes = Vec::with_capacity(N_LANES);
        let (mut stages, mut compliances_per_m) = (Vec::new(), Vec::new());
        for (lane, theta) in points.iter().enumerate().take(N_LANES) {
            let parameters: Vec<Dual> = candidate.parameters(theta).into_iter().map(Dual::constant).collect();
            let made = candidate.model.stages(&parameters).and_then(|mut stages| {
                let compliance = if self.is_local { &self.shared.local } else { &self.shared.compliance };
                let compliance = compliance.resolve(&mut stages)?;
                Ok((stages, compliance.value))
            });
            if let Ok((of_point, compliance_per_m)) = made {
                lanes.push(lane);
                stages.push(of_point);
                compliances_per_m.push(compliance_per_m);
            }
        }
        let n_rows = self.shared.experiment.record.n_rows();
        let mut is_valid = [false; N_LANES];
        if lanes.is_empty() {
            return (vec![Lanes([0.0; N_LANES]); n_rows], is_valid);
        }
        let mut position_m = Vec::new();
        let sound = self.shared.response.trajectories_m(&stages, &compliances_per_m, &mut position_m);
        position_m.resize(n_rows, Lanes([0.0; N_LANES]));
        if lanes.iter().enumerate().any(|(place, lane)| place != *lane) {
            for row in &mut position_m {
                let packed = row.0;
                lanes.iter().enumerate().for_each(|(place, lane)| row.0[*lane] = packed[place]);
            }
        }
        lanes.iter().enumerate().for_each(|(place, lane)| is_valid[*lane] = sound[place]);
        for (k, column) in candidate.columns.iter().enumerate() {
            let place = candidate.free.len() + k;
            for (row, value) in position_m.iter_mut().zip(column) {
                points.iter().take(N_LANES).enumerate().for_each(|(lane, theta)| row.0[lane] += theta[place] * value);
            }
        }
        (position_m, is_valid)
    }

    /// Position (m) at every row of the record.
    ///
    /// # Errors
    /// [`Error::Numerical`] where the candidate has no model.
    pub fn trajectory_m(&self, candidate: &Candidate, theta: &[f64]) -> Result<Vec<f64>> {
        let (lanes, is_valid) = self.trajectories_m(candidate, std::slice::from_ref(&theta.to_vec()));
        if is_valid[0] {
            return Ok(lanes.iter().map(|row| row.0[0]).collect());
        }
        Err(Error::numerical(
            format!("{} has no model at {:?}", candidate.effects.join(" + "), candidate.parameters(theta)),
            "stay inside the supports of its parameters",
        ))
    }
}

/// A compliance that serves some effects of a library: the widest range of Poisson ratios that one of them asks for, and the models of all other fields.
///
/// # Errors
/// Whatever building these models refuses.
pub fn compliance_of(
    problem: &Problem,
    library: &Library,
    effects: &[&'static dyn Effect],
    kept: Option<KeptSurrogate>,
    monitor: &dyn Monitor,
) -> Result<Compliance> {
    let of_model = |problem: &Problem| Reduced::unverified(problem, kept.clone(), &Silent).map(|own| own.compliance);
    if let Some(outside) = problem.outside() {
        let all = [problem.model.effects(), effects].concat();
        return Reduced::of_outside(problem, outside, &all, monitor).map(|own| own.compliance);
    }
    let Some(fe) = problem.finite_elements() else { return of_model(problem) };
    let (widest, wanted) = asked_for(problem, fe, library, effects)?;
    let fields = field_models(fe, kept.as_ref(), &wanted, monitor)?;
    Ok(with_fields(of_model(widest.as_ref().unwrap_or(problem))?, &fields))
}

/// What a library's effects ask for beside a problem: the problem with the widest range of Poisson ratios, where one of them asks for more than the problem itself; and all whose fields are
/// modelled, its own first.
///
/// # Errors
/// Whatever the stages of a model refuse.
pub fn asked_for(
    problem: &Problem,
    fe: &FiniteElements,
    library: &Library,
    effects: &[&'static dyn Effect],
) -> Result<(Option<Problem>, Vec<&'static dyn Effect>)> {
    let own = problem.poisson_ratios(fe)?;
    let (mut widest, mut wanted) = (None, problem.model.effects().to_vec());
    for effect in effects {
        let mut specification = problem.specification.clone();
        if specification.effects.iter().any(|slug| slug == effect.slug()) {
            continue;
        }
        specification.effects.push(effect.slug().into());
        let Ok(extended) = problem.with_model(specification, library) else { continue };
        wanted.push(*effect);
        let asked = extended.poisson_ratios(fe)?;
        if asked[0] < own[0] || asked[1] > own[1] {
            // One effect at most asks for another ratio.
            widest = Some(extended);
        }
    }
    Ok((widest, wanted))
}
