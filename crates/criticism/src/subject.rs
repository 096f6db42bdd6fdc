//! One experiment, prepared for the fits of many models.

use std::sync::{Arc, OnceLock};

use super::{Candidate, noise_bounds::noise_bounds, score::Score};
use base::error::{Error, InputPlace, Result, Setting};
use base::number::Dual;
use laws::stages::SharedStepper;
use models::effects::{Effect, Library};
use models::model::{Compliance, Lanes, N_LANES, Response};
use posterior::monitor::Monitor;
use posterior::noise::{NoiseBounds, NoiseKnowledge, NoiseLikelihood, NoiseModel};
use posterior::prepared::{KeptSurrogate, PreparedModel};
use posterior::problem::Problem;
use posterior::study::ModelSpecification;
use record::{Experiment, Record};

/// Noise standard deviation as a fraction of the range of positions, used if the noise is unknown and cannot be estimated.
const UNKNOWN_NOISE: f64 = 0.005;

/// One experiment, prepared for the fits of many models.
///
/// All subjects derived from one subject by [`Subject::with_positions`] share everything that does not depend on the positions.
#[derive(Clone)]
pub struct Subject {
    shared: Arc<SharedParts>,
    /// True if trajectories of nonlinear laws come from the memory of learnt trajectories.
    has_trajectory_memory: bool,
    /// True if the noise has only the terms of the model's specification.
    has_only_specified_noise: bool,
    /// Plausible sizes of noise beside white noise; `None` if noise of any size is allowed.
    noise_bounds: Option<NoiseBounds>,
    /// Straight line that stands for the model's trajectories; `None` for the trajectories themselves.
    line: Option<Arc<StraightLine>>,
    /// Positions (m) of the fitted cycles, `None` elsewhere; one entry per row of the record.
    pub fitted_m: Vec<Option<f64>>,
    /// Positions (m) of the scored cycle, `None` elsewhere.
    pub scored_m: Vec<Option<f64>>,
    /// Likelihood of the fitted positions, given predicted positions and a noise.
    pub(super) fitted: NoiseLikelihood,
    /// Likelihood of the fitted and the scored positions.
    pub(super) all: NoiseLikelihood,
}

/// First-order expansion of a model's positions about a fit.
struct StraightLine {
    /// Coordinates of the fit.
    theta: Vec<f64>,
    /// Positions (m) of the fit, one per row of the record.
    position_m: Vec<f64>,
    /// Derivatives of the positions (m per unit): one column per coordinate of the fit.
    columns_m: Vec<Vec<f64>>,
}

impl StraightLine {
    /// Columns (m) of a candidate beside those of the linearised model.
    fn added_columns<'a>(&self, candidate: &'a Candidate) -> &'a [Vec<f64>] {
        debug_assert!(candidate.free.len() <= self.theta.len(), "another model than the linearised one");
        &candidate.columns[self.theta.len() - candidate.free.len()..]
    }

    /// Positions (m) at a point whose coordinates begin with those of the fit. Each coordinate behind them is the amplitude of one of the columns `added_m`.
    fn position_m(&self, point: &[f64], added_m: &[Vec<f64>]) -> Vec<f64> {
        let (of_fit, added) = point.split_at(self.theta.len());
        let steps = of_fit.iter().zip(&self.theta).map(|(to, from)| to - from).chain(added.iter().copied());
        let mut position_m = self.position_m.clone();
        for (step, column) in steps.zip(self.columns_m.iter().chain(added_m)) {
            position_m.iter_mut().zip(column).for_each(|(position, by)| *position += step * by);
        }
        position_m
    }
}

/// Parts of a subject that do not depend on the positions.
pub(super) struct SharedParts {
    /// Base model with the noise terms of the fits. Its experiment is split into fitted and scored cycles; the positions in it are unused. Its compliance serves every
    /// effect of the library.
    pub model: PreparedModel,
    pub library: Library,
    /// Names of the noise terms in the model's specification.
    pub own_noise: Vec<String>,
    pub reference_noise_m: f64,
    /// The model's compliance, with a memory of trajectories for nonlinear laws.
    pub response: Response,
    /// Response to large displacements in this record, or the reason why it was not learnt. A search sets it once it has decided.
    pub large: LearntResponse,
}

/// Response to large displacements in one record, learnt by the search, or the reason why it was not learnt.
pub(super) type LearntResponse = Arc<OnceLock<std::result::Result<SharedStepper, NotLearnt>>>;

/// Reason why the response to large displacements was not learnt for a record.
#[derive(Debug, Clone)]
pub(super) struct NotLearnt {
    /// The reason, in words.
    pub reason: String,
    /// First-order score of the effect on this record, if a full-order run gave one.
    pub score: Option<Score>,
}

impl NotLearnt {
    pub fn of(why: impl Into<String>) -> Self {
        Self { reason: why.into(), score: None }
    }
}

/// Positions (m) of the fitted and the scored cycles, one per row.
fn fitted_and_scored(fitted_m: &[Option<f64>], scored_m: &[Option<f64>]) -> Vec<Option<f64>> {
    fitted_m.iter().zip(scored_m).map(|(fitted, scored)| fitted.or(*scored)).collect()
}

impl Subject {
    /// Prepares the problem of a base model and splits its experiment into fitted and scored cycles.
    ///
    /// # Errors
    /// Errors of training a surrogate over the Poisson ratios of all effects.
    pub fn new(
        problem: &Problem,
        library: &Library,
        kept: Option<KeptSurrogate>,
        monitor: &dyn Monitor,
    ) -> Result<Self> {
        monitor.stage("preparing the models to compare");
        let compliance = PreparedModel::for_effects(problem, library, library.effects(), kept, monitor)?.compliance;
        Self::with_compliance(problem, library, compliance)
    }

    /// Prepares the problem with a given compliance that serves all effects of the library.
    ///
    /// # Errors
    /// [`Error::Input`] if the model does not fit the experiment.
    pub fn with_compliance(problem: &Problem, library: &Library, compliance: Compliance) -> Result<Self> {
        let experiment = problem.experiment.for_comparison();
        let mut specification = problem.specification.clone();
        let own_noise = std::mem::replace(
            &mut specification.noise,
            NoiseModel::learnt_names().into_iter().map(String::from).collect(),
        );
        specification.fixed.retain(|name, _| problem.model.parameters().iter().any(|p| p.name == name));
        let base = problem.with_experiment(experiment, specification, library)?;
        let reference_noise_m = problem
            .experiment
            .reference_noise()
            .map_or_else(|| UNKNOWN_NOISE * problem.experiment.scales().position_range_m, |yardstick| yardstick.sd_m);
        let Experiment { record, calibration_cycles, heldout_cycles, .. } = &base.experiment;
        let response = Response::new(&record.time_s, record.force(), record.n_rows());
        let (fitted_m, scored_m) = (base.positions_of(calibration_cycles), base.positions_of(heldout_cycles));
        let library = library.clone();
        let large = LearntResponse::default();
        let slot = large.clone();
        let compliance = match problem.model.field() {
            // The base model itself has large displacements, so their response is already learnt.
            Some((_, field)) if field.is_learnt_for_record() => compliance,
            _ => compliance.with_trained(move || slot.get().and_then(|found| found.clone().ok())),
        };
        let model = PreparedModel::given(&base, compliance, Vec::new());
        let shared = SharedParts { model, library, own_noise, reference_noise_m, response, large };
        Ok(Self::of(Arc::new(shared), fitted_m, scored_m))
    }

    /// Returns the subject with another library. The compliance must already serve the effects of that library.
    ///
    /// # Errors
    /// As [`Self::with_compliance`].
    pub fn with_library(&self, library: &Library) -> Result<Self> {
        self.with_experiment(self.problem().experiment.clone(), library)
    }

    fn with_experiment(&self, experiment: Experiment, library: &Library) -> Result<Self> {
        let shared = &self.shared;
        let base = self.problem();
        let problem = base.with_experiment(experiment, base.specification.clone(), library)?;
        let shared_parts = SharedParts {
            model: shared.model.for_problem(problem),
            library: library.clone(),
            own_noise: shared.own_noise.clone(),
            reference_noise_m: shared.reference_noise_m,
            response: shared.response.clone(),
            large: shared.large.clone(),
        };
        Ok(Self { shared: Arc::new(shared_parts), ..self.clone() })
    }

    /// Returns the subject with other fitted and scored cycles.
    ///
    /// # Errors
    /// As [`Self::with_compliance`].
    pub fn with_cycles(&self, fitted: &[u32], scored: &[u32]) -> Result<Self> {
        let mut experiment = self.problem().experiment.clone();
        (experiment.calibration_cycles, experiment.heldout_cycles) = (fitted.to_vec(), scored.to_vec());
        let subject = self.with_experiment(experiment, &self.shared.library)?;
        let (fitted_m, scored_m) = (subject.problem().positions_of(fitted), subject.problem().positions_of(scored));
        let other = Self::of(subject.shared, fitted_m, scored_m);
        Ok(other.treated_like(self))
    }

    fn of(shared: Arc<SharedParts>, fitted_m: Vec<Option<f64>>, scored_m: Vec<Option<f64>>) -> Self {
        let Problem { experiment, noise, .. } = &shared.model.problem;
        let (record, recordings) = (&experiment.record, shared.model.problem.recordings());
        let likelihood =
            |positions: &[Option<f64>]| NoiseLikelihood::new(*noise, &record.time_s, &recordings, positions);
        let both = fitted_and_scored(&fitted_m, &scored_m);
        let (fitted, all) = (likelihood(&fitted_m), likelihood(&both));
        Self {
            shared,
            has_trajectory_memory: false,
            has_only_specified_noise: false,
            noise_bounds: None,
            line: None,
            fitted_m,
            scored_m,
            fitted,
            all,
        }
    }

    /// Returns the experiment with other positions (m), one per row. Rows that had no position get none.
    pub fn with_positions(&self, position_m: &[f64]) -> Self {
        let replaced = |old: &[Option<f64>]| old.iter().zip(position_m).map(|(old, new)| old.map(|_| *new)).collect();
        let (fitted_m, scored_m): (Vec<Option<f64>>, Vec<Option<f64>>) =
            (replaced(&self.fitted_m), replaced(&self.scored_m));
        let both = fitted_and_scored(&fitted_m, &scored_m);
        let (fitted, all) = (self.fitted.with_observed(&fitted_m), self.all.with_observed(&both));
        Self { fitted_m, scored_m, fitted, all, ..self.clone() }
    }

    /// Returns the subject without the positions of some rows.
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
        Self { line: self.line.clone(), ..other.treated_like(self) }
    }

    /// Returns the subject with the noise and the trajectories of the fits of `other`.
    fn treated_like(self, other: &Self) -> Self {
        let Self { has_trajectory_memory, has_only_specified_noise, noise_bounds, .. } = *other;
        Self { has_trajectory_memory, has_only_specified_noise, noise_bounds, ..self }
    }

    /// Positions (m) of the fitted and the scored cycles, `None` elsewhere; one entry per row of the record.
    pub(super) fn observed_m(&self) -> Vec<Option<f64>> {
        fitted_and_scored(&self.fitted_m, &self.scored_m)
    }

    /// Returns the subject with bounds on slow noise, gains and offsets, if the experiment gives the noise.
    pub fn with_bounded_noise(&self) -> Self {
        let position_m = self.observed_m();
        let record = Record { position_m, ..self.experiment().record.clone() };
        let bounds = || noise_bounds(&record, self.experiment().control, self.reference_noise_m());
        Self { noise_bounds: self.is_noise_known().then(bounds), ..self.clone() }
    }

    /// Returns the subject with about `most` of its positions, evenly chosen. The rows at which the force changes are kept, so trajectories at the remaining rows are
    /// unchanged. Returns `None` if it has no more than `most` positions.
    ///
    /// # Errors
    /// As [`Self::with_compliance`].
    pub fn thinned(&self, most: usize) -> Result<Option<Self>> {
        let (shared, record) = (&self.shared, &self.experiment().record);
        let is_of_record = self.problem().model.effects().iter().any(|effect| effect.is_learnt_for_record());
        if is_of_record || self.problem().outside().is_some() {
            // A surrogate learnt for the record is valid for the record's own rows only.
            return Ok(None);
        }
        let is_placed = |row: usize| self.fitted_m[row].is_some() || self.scored_m[row].is_some();
        let Some(is_kept) = select_rows(record, most, is_placed) else { return Ok(None) };
        let mut experiment = self.experiment().clone();
        experiment.record = record.of_rows(&is_kept);
        let base = self.problem();
        let problem = base.with_experiment(experiment, base.specification.clone(), &shared.library)?;
        let record = &problem.experiment.record;
        let shared_parts = SharedParts {
            response: Response::new(&record.time_s, record.force(), record.n_rows()),
            model: shared.model.for_problem(problem),
            library: shared.library.clone(),
            own_noise: shared.own_noise.clone(),
            reference_noise_m: shared.reference_noise_m,
            large: shared.large.clone(),
        };
        let kept = |positions: &[Option<f64>]| {
            positions.iter().zip(&is_kept).filter(|(_, is_kept)| **is_kept).map(|(position, _)| *position).collect()
        };
        let other = Self::of(Arc::new(shared_parts), kept(&self.fitted_m), kept(&self.scored_m));
        Ok(Some(other.treated_like(self)))
    }

    /// Returns the subject with only the noise terms of each model's specification, as in the fits of `sample` and `extend`.
    pub fn with_specified_noise(self) -> Self {
        Self { has_only_specified_noise: true, ..self }
    }

    /// Returns the subject for many neighbouring models of one nonlinear law. Trajectories are learnt once and then remembered.
    pub fn with_trajectory_memory(self) -> Self {
        Self { has_trajectory_memory: true, ..self }
    }

    /// Returns the subject with the first-order expansion of one model about its fit in place of the model. It then serves that model only, and the model with further columns.
    /// Fits to positions that differ from those of the fit by noise are nearly the same. `theta` are the coordinates of the fit, and `position_m` its positions. `columns_m` holds
    /// the derivatives of the positions (m per unit), one column per coordinate.
    pub(super) fn linearised(self, (theta, position_m): (&[f64], &[f64]), columns_m: Vec<Vec<f64>>) -> Self {
        let (theta, position_m) = (theta.to_vec(), position_m.to_vec());
        Self { line: Some(Arc::new(StraightLine { theta, position_m, columns_m })), ..self }
    }

    /// Derivatives of the positions (m per unit) of a linearised model: one column per coordinate; `None` for other models.
    pub(super) fn constant_derivatives_m(&self, candidate: &Candidate) -> Option<Vec<Vec<f64>>> {
        let line = self.line.as_ref()?;
        let added = line.added_columns(candidate);
        Some(line.columns_m.iter().chain(added).cloned().collect())
    }

    /// The experiment, split into fitted and scored cycles. Its positions are the measured ones, outliers included.
    pub fn experiment(&self) -> &Experiment {
        &self.problem().experiment
    }

    /// Returns the base model as a candidate.
    pub fn base(&self) -> Candidate {
        Candidate::new(&self.shared.model.problem)
    }

    /// Specification of the base model, with the noise terms that the fits use.
    pub fn specification(&self) -> &ModelSpecification {
        &self.problem().specification
    }

    /// The base model joined with the experiment.
    pub fn problem(&self) -> &Problem {
        &self.shared.model.problem
    }

    /// Library of effects that may be added.
    pub fn library(&self) -> &Library {
        &self.shared.library
    }

    /// The base model with effects added.
    ///
    /// # Errors
    /// [`Error::Input`] if the effects exclude each other or the base already has one; the text gives the reason.
    pub fn extended(&self, effects: &[&str]) -> Result<Candidate> {
        let mut specification = self.problem().specification.clone();
        for slug in effects {
            if specification.effects.iter().any(|effect| effect == slug) {
                return Err(Error::input(
                    InputPlace::setting(Setting::Effects),
                    format!("the model has `{slug}` already"),
                    "name effects that the model lacks",
                ));
            }
            specification.effects.push(slug.to_string());
        }
        let problem = self.shared.model.problem.with_model(specification, &self.shared.library)?;
        let is_new = |effect: &&&'static dyn Effect| effects.contains(&effect.slug());
        let of_record = |effect: &&&'static dyn Effect| effect.is_learnt_for_record();
        if let Some(effect) = problem.model.effects().iter().filter(is_new).find(of_record) {
            let reason = match self.shared.large.get() {
                Some(Ok(_)) => None,
                Some(Err(not_learnt)) => Some(not_learnt.reason.clone()),
                None => effect.field().map(|field| format!("no search has learnt {} for this record", field.words())),
            };
            if let Some(reason) = reason {
                let remedy = format!("leave `{}` out", effect.slug());
                return Err(Error::input(InputPlace::setting(Setting::Effects), reason, remedy));
            }
        }
        Ok(Candidate::new(&problem))
    }

    /// Cell for the response to large displacements in this record; the search that learns the response fills it.
    pub(super) fn large(&self) -> &LearntResponse {
        &self.shared.large
    }

    /// The record, prepared for evaluating models.
    pub(super) fn response(&self) -> &Response {
        &self.shared.response
    }

    /// Noise model that the fits use.
    pub fn noise(&self) -> NoiseModel {
        self.problem().noise
    }

    /// Names of the noise terms in the model's specification, if fits use only those.
    pub(super) fn own_noise(&self) -> Option<&[String]> {
        self.has_only_specified_noise.then_some(&self.shared.own_noise[..])
    }

    /// Returns whether the model's specification has a gain and an offset for each recording.
    pub fn declares_gains(&self) -> bool {
        self.shared.own_noise.iter().any(|term| term == "gain")
    }

    /// Known or estimated noise standard deviation (m), with which misfits are compared. If the noise is unknown, a fraction of the range of positions.
    pub fn reference_noise_m(&self) -> f64 {
        self.shared.reference_noise_m
    }

    /// Returns whether slow noise, and noise that differs between recordings, can be distinguished from a misfit. The model must declare such noise, or at least two
    /// recordings must be fitted.
    pub fn can_show_slow_noise(&self) -> bool {
        let recordings = self.problem().recordings();
        let mut fitted: Vec<u32> =
            (0..recordings.len()).filter(|row| self.fitted_m[*row].is_some()).map(|row| recordings[row]).collect();
        fitted.dedup();
        fitted.len() > 1 || self.shared.own_noise.len() > 1
    }

    /// Returns whether the noise is neither given nor estimable.
    pub fn is_noise_unknown(&self) -> bool {
        self.problem().experiment.reference_noise().is_none()
    }

    /// Known or estimated noise standard deviation in µm, as documents show it; `None` if unknown.
    pub fn noise_um(&self) -> Option<f64> {
        self.problem().experiment.reference_noise().map(|yardstick| 1e6 * yardstick.sd_m)
    }

    /// Returns whether the experiment gives the noise.
    pub fn is_noise_known(&self) -> bool {
        self.problem().experiment.noise_sd_m.is_some()
    }

    /// Knowledge of the noise in fits that learn it.
    pub(super) fn noise_knowledge(&self) -> NoiseKnowledge {
        match self.noise_bounds {
            Some(bounds) => NoiseKnowledge::Bounded(bounds),
            None if self.is_noise_known() => NoiseKnowledge::Given,
            None => NoiseKnowledge::Estimated,
        }
    }

    /// Compliance that converts the integral of creep compliance over force changes, ∫J dF, into a position, for every effect of the library.
    pub fn compliance(&self) -> &Compliance {
        &self.shared.model.compliance
    }

    /// Compliance that remembers the trajectories of nonlinear laws, for many neighbouring points.
    pub fn memory_compliance(&self) -> &Compliance {
        self.shared.model.local_compliance()
    }

    /// Number of fitted positions.
    pub fn n_fitted(&self) -> usize {
        self.fitted.n_observed()
    }

    /// Positions (m) at every row of the record for one to eight points of a candidate, one lane per point. The flags mark valid points.
    pub(super) fn trajectories_m(&self, candidate: &Candidate, points: &[Vec<f64>]) -> (Vec<Lanes>, [bool; N_LANES]) {
        if let Some(line) = &self.line {
            let added = line.added_columns(candidate);
            let mut position_m = vec![Lanes([0.0; N_LANES]); line.position_m.len()];
            for (lane, point) in points.iter().enumerate().take(N_LANES) {
                let of_point = line.position_m(point, added);
                position_m.iter_mut().zip(of_point).for_each(|(row, position)| row.0[lane] = position);
            }
            return (position_m, [true; N_LANES]);
        }
        let mut lanes = Vec::with_capacity(N_LANES);
        let (mut stages, mut compliances_per_m) = (Vec::new(), Vec::new());
        for (lane, theta) in points.iter().enumerate().take(N_LANES) {
            let parameters: Vec<Dual> = candidate.parameters(theta).into_iter().map(Dual::constant).collect();
            let made = candidate.model.stages(&parameters).and_then(|mut stages| {
                let compliance = if self.has_trajectory_memory { self.memory_compliance() } else { self.compliance() };
                let compliance = compliance.resolve(&mut stages)?;
                Ok((stages, compliance.value))
            });
            if let Ok((of_point, compliance_per_m)) = made {
                lanes.push(lane);
                stages.push(of_point);
                compliances_per_m.push(compliance_per_m);
            }
        }
        let n_rows = self.problem().experiment.record.n_rows();
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
    /// [`Error::Numerical`] if the candidate's model has no solution at these parameters.
    pub fn trajectory_m(&self, candidate: &Candidate, theta: &[f64]) -> Result<Vec<f64>> {
        let (lanes, is_valid) = self.trajectories_m(candidate, std::slice::from_ref(&theta.to_vec()));
        if is_valid[0] {
            return Ok(lanes.iter().map(|row| row.0[0]).collect());
        }
        Err(Error::numerical(
            format!(
                "the model with {} has no solution at {:?}",
                candidate.effects.join(" + "),
                candidate.parameters(theta)
            ),
            "keep its parameters inside their supports",
        ))
    }
}

/// Selects about `most` positions of a record, evenly, and the rows at which the force changes. Returns a flag per row; `None` if there are no more than `most`
/// positions.
fn select_rows(record: &Record, most: usize, is_placed: impl Fn(usize) -> bool) -> Option<Vec<bool>> {
    let n_rows = record.n_rows();
    let n_placed = (0..n_rows).filter(|row| is_placed(*row)).count();
    let every = n_placed.div_ceil(most);
    if every <= 1 {
        return None;
    }
    let mut n_before = 0;
    let is_kept = |row: usize| {
        let is_chosen = is_placed(row) && n_before % every == 0;
        n_before += usize::from(is_placed(row));
        is_chosen || record.force().changes_at(row)
    };
    Some((0..n_rows).map(is_kept).collect())
}

#[cfg(test)]
mod tests {
    use crate::test_replica::{base_fit, replica};

    /// With one position in eight, the replica's remaining rows and the rows at which its force changes keep their model positions and their data. A record that is short
    /// enough stays unchanged.
    #[test]
    fn few_positions_show_the_same_motion() {
        let (base, fitted) = base_fit();
        let few = replica().thinned(100).expect("a record").expect("fewer positions");
        let record = &replica().experiment().record;
        let positions_m = few.trajectory_m(&base, &fitted.theta).expect("a model");
        let times_s = &few.experiment().record.time_s;
        assert!(times_s.len() < 100 + 20 && few.n_fitted() > 60, "{} {}", times_s.len(), few.n_fitted());
        for (k, time_s) in times_s.iter().enumerate() {
            let row = record.time_s.iter().position(|t| t == time_s).expect("a row of the record");
            assert!((positions_m[k] - fitted.position_m[row]).abs() < 1e-12, "{time_s}");
            assert_eq!((few.fitted_m[k], few.scored_m[k]), (replica().fitted_m[row], replica().scored_m[row]));
        }
        let steps = |record: &record::Record| -> Vec<f64> {
            record.force_step_rows().into_iter().map(|row| record.time_s[row]).collect()
        };
        assert_eq!(steps(&few.experiment().record), steps(record));
        assert!(replica().thinned(800).expect("a record").is_none());
    }
}
