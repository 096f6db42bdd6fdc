//! `groups`: samples each experiment alone, then the population, and compares the groups.

use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};

use super::apparatus::compliances;
use super::cohort::{self, Key, Measurement};
use super::contrast::{Contrast, contrasts};
use super::design::Design;
use super::hierarchy::{
    ExperimentDensity, ExperimentMember, HierarchyOptions, INTERRUPTED_MESSAGE, InterimDraws, Population,
    PopulationDraw, sample_population,
};
use super::interim::{InterimResult, Specimen, SpecimenDensity};
use super::predict::{PredictedGroup, predicted_groups};
use super::scale::SizeScale;
use base::error::{Error, InputPlace, Result, Setting};
use laws::rheology::BaseLaw;
use models::model::Compliance;
use nalgebra::DMatrix;
use posterior::monitor::{Counter, Monitor};
use sampling::SamplerOptions;

/// Scale of the prior for the standard deviation between species, or between regions. It refers to the logarithm or the log-odds of a parameter. A
/// standard deviation below 0.4 (a factor of 1.5) has a prior probability of 1 %.
pub const LEVEL_SCALE: f64 = 1.0;
/// Scales of three half-t priors for standard deviations: between groups in addition to species and region, between specimens, and between repeats. For
/// logarithms, the scales mean factors of 1.35, 1.6 and 1.35 in the parameter. For the log-odds of parameters with two bounds, they mean these factors in
/// the odds.
pub const SPREAD_SCALES: [f64; 3] = [0.3, 0.5, 0.3];
/// Degrees of freedom of the Student-t distribution if specimens are heavy-tailed.
pub const HEAVY_TAILED_DOF: f64 = 4.0;
/// Smallest effective number of draws with which the hierarchy represents an experiment by its draws. With fewer draws, it uses the exact likelihood.
const FEWEST_EFFECTIVE: f64 = 100.0;
/// Number of first sweeps per chain that are dropped, and number of further sweeps until convergence is first tested.
pub const FIRST_SWEEPS: [usize; 2] = [1_000, 4_000];
/// Initial interval between kept sweeps of the population's sampler. Neighbouring sweeps are nearly equal, so not all are kept.
const KEEP_EVERY: usize = 4;
/// Number of chains of the pilot run, which estimates the effective numbers of draws.
const PILOT_CHAINS: usize = 2;
/// Two numbers of sweeps in the pilot run: discarded sweeps and kept sweeps.
const PILOT_SWEEPS: [usize; 2] = [300, 300];

/// Settings of a comparison of groups.
pub struct GroupsRequest<'a> {
    /// Keys that define the groups.
    pub keys: &'a [Key],
    /// Margin of practical equivalence: ratios from 1/(1 + margin) to 1 + margin count as no difference.
    pub margin: f64,
    /// `true` if deviations of specimens have a Student-t distribution. An outlying specimen then does not widen the spread of its group.
    pub is_heavy_tailed: bool,
    /// Settings for sampling single experiments.
    pub sampler: SamplerOptions,
    /// Number of chains for sampling the population.
    pub n_chains: usize,
    /// Largest number of sweeps per chain. Convergence is first tested after [`FIRST_SWEEPS`].
    pub max_sweeps: usize,
    /// `true` uses exact likelihoods instead of draws for all experiments, as a reference.
    pub is_exact: bool,
    /// Folder that stores the draws of single experiments.
    pub kept: &'a Path,
}

impl GroupsRequest<'_> {
    fn student_dof(&self) -> Option<f64> {
        self.is_heavy_tailed.then_some(HEAVY_TAILED_DOF)
    }
}

/// Form in which an experiment enters the hierarchy: draws or exact likelihood.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ExperimentForm {
    /// Effective number of the experiment's draws after they are re-weighted from the interim prior to the population.
    pub effective_draws: f64,
    /// `true` if the exact likelihood is used instead of draws.
    pub is_exact: bool,
}

/// Result of a comparison of groups.
pub struct Comparison {
    /// Specimen and group of each experiment.
    pub design: Design,
    /// Law whose parameters are compared.
    pub law: BaseLaw,
    /// Names of the compared parameters.
    pub parameters: Vec<&'static str>,
    /// Scale (logarithm or log-odds) on which each parameter varies in the population.
    pub scales: Vec<SizeScale>,
    /// Each experiment joined with its model.
    pub specimens: Vec<Specimen>,
    /// Result of sampling each experiment alone.
    pub interims: Vec<InterimResult>,
    /// Draws of each experiment in the coordinates of the population (logarithms or log-odds).
    pub draws: Vec<InterimDraws>,
    /// Form in which each experiment entered the hierarchy.
    pub entries: Vec<ExperimentForm>,
    /// Draws of the population.
    pub population: Population,
    /// Groups of the design, then groups without measurements that are predicted.
    pub groups: Vec<PredictedGroup>,
    /// Ratios of each parameter between every pair of groups.
    pub contrasts: Vec<Contrast>,
}

/// Compares groups: computes the compliance of each apparatus, then continues as [`run_with`].
///
/// # Errors
/// [`Error::Input`] if labels are missing or the models differ in their parameters, [`Error::Interrupted`] if stopped (finished experiments are kept),
/// and errors of meshing, sampling and reading.
pub fn run(measurements: &[Measurement], request: &GroupsRequest, monitor: &dyn Monitor) -> Result<Comparison> {
    // Missing labels are refused before the computation starts.
    cohort::labels(measurements, request.keys)?;
    monitor.stage("computing the compliance of every apparatus by finite elements");
    let compliances = compliances(measurements, monitor)?;
    run_with(measurements, compliances, request, monitor)
}

/// Compares groups, given the compliance of each measurement's apparatus.
///
/// # Errors
/// Errors of [`run`].
pub fn run_with(
    measurements: &[Measurement],
    compliances: Vec<Compliance>,
    request: &GroupsRequest,
    monitor: &dyn Monitor,
) -> Result<Comparison> {
    let labels = cohort::labels(measurements, request.keys)?;
    let design = Design::new(&labels);
    let pairs = measurements.iter().zip(compliances);
    let specimens: Vec<Specimen> = pairs
        .map(|(measurement, compliance)| {
            Specimen::new(measurement, compliance).map_err(|error| measurement.with_name(error))
        })
        .collect::<Result<_>>()?;
    let (law, parameters) = common_parameters(measurements, &specimens)?;
    monitor.stage("sampling every experiment on its own");
    let interims = interims(measurements, &specimens, request, monitor)?;
    let draws: Vec<InterimDraws> =
        specimens.iter().zip(&interims).map(|(specimen, interim)| specimen.draws(interim)).collect();

    monitor.stage("weighting the draws of single experiments by the population");
    let scales = specimens.first().map_or_else(Vec::new, Specimen::scales);
    let main = options(&specimens, &parameters, &scales, request);
    let [_, n_pilot] = PILOT_SWEEPS;
    let pilot = HierarchyOptions {
        n_chains: PILOT_CHAINS,
        n_sweeps: PILOT_SWEEPS,
        max_sweeps: n_pilot,
        keep_every: 1,
        ..main.clone()
    };
    let entries = entries(&design, &draws, &pilot, request, monitor)?;
    monitor.stage("sampling the population");
    let densities: Vec<Option<SpecimenDensity>> = entries
        .iter()
        .zip(specimens.iter().zip(&interims))
        .map(|(entry, (specimen, interim))| entry.is_exact.then(|| SpecimenDensity::new(specimen, interim)))
        .collect();
    let members: Vec<ExperimentMember> = densities
        .iter()
        .zip(&draws)
        .map(|(density, draws)| match density {
            Some(density) => ExperimentMember::Exact(density as &dyn ExperimentDensity),
            None => ExperimentMember::Draws(draws),
        })
        .collect();
    let population = sample_population(&design, &members, &main, monitor)?;
    drop(members);
    drop(densities);
    let all: Vec<&PopulationDraw> = population.draws().collect();
    let groups = predicted_groups(&design, &all, parameters.len(), request.student_dof(), request.sampler.seed);
    let contrasts = contrasts(&design, &all, &scales);
    drop(all);
    Ok(Comparison {
        design,
        law,
        parameters,
        scales,
        specimens,
        interims,
        draws,
        entries,
        population,
        groups,
        contrasts,
    })
}

/// Returns the law and the names of its compared parameters. Refuses experiments whose law or compared parameters differ.
fn common_parameters(measurements: &[Measurement], specimens: &[Specimen]) -> Result<(BaseLaw, Vec<&'static str>)> {
    let of = |specimen: &Specimen| (specimen.model.problem.model.base(), specimen.pooled());
    let Some(first) = specimens.first() else {
        return Err(Error::input(
            InputPlace::default(),
            "there is no experiment to compare",
            "give directories that hold experiments",
        ));
    };
    let (law, parameters) = of(first);
    for (specimen, measurement) in specimens.iter().zip(measurements) {
        if of(specimen) != (law, parameters.clone()) {
            return Err(Error::input(
                InputPlace::file(&measurement.path),
                format!(
                    "the model of this experiment compares other parameters ({}: {}) than the model of {} ({}: {})",
                    specimen.model.problem.model.base().name(),
                    specimen.pooled().join(", "),
                    measurements[0].name(),
                    law.name(),
                    parameters.join(", ")
                ),
                format!(
                    "give all experiments the same base law ({}) and fix the same parameters ({}), or leave this experiment out ({} {})",
                    Setting::Base,
                    Setting::Fixed,
                    Setting::LeaveOut,
                    measurement.name()
                ),
            ));
        }
    }
    if parameters.is_empty() {
        return Err(Error::input(
            InputPlace::setting(Setting::Fixed),
            "every parameter of the law is fixed, so nothing can be compared",
            "leave at least one parameter free",
        ));
    }
    Ok((law, parameters))
}

/// Samples each experiment alone, in one thread per experiment. There are usually more experiments than processor cores.
fn interims(
    measurements: &[Measurement],
    specimens: &[Specimen],
    request: &GroupsRequest,
    monitor: &dyn Monitor,
) -> Result<Vec<InterimResult>> {
    base::files::forbid_links(base::files::folder_of(request.kept), "a comparison");
    base::files::create_folders(request.kept, &format!("choose a writable place with `{}`", Setting::Out))?;
    let options = SamplerOptions { threads: 1, ..request.sampler.clone() };
    let counter = Counter::new(monitor, specimens.len());
    let one = |(specimen, measurement): (&Specimen, &Measurement)| {
        let interim = specimen.load_or_sample(measurement, &options, request.kept, monitor.stop()).map_err(
            |error| match error {
                Error::Interrupted { .. } => Error::Interrupted { kept: INTERRUPTED_MESSAGE.into() },
                other => measurement.with_name(other),
            },
        )?;
        counter.add_one();
        Ok(interim)
    };
    over_threads(specimens.len(), |index| one((&specimens[index], &measurements[index])))
}

/// Runs independent jobs in plain threads, as many at once as the thread pool has threads. Each job has its own thread pool. In the common pool, a waiting
/// job would start another job on its own stack, which could nest hundreds deep.
fn over_threads<T: Send>(n: usize, job: impl Fn(usize) -> Result<T> + Sync) -> Result<Vec<T>> {
    let next = AtomicUsize::new(0);
    let work = || -> Result<Vec<(usize, T)>> {
        let mut done = Vec::new();
        loop {
            let index = next.fetch_add(1, Ordering::Relaxed);
            if index >= n {
                return Ok(done);
            }
            match job(index) {
                Ok(result) => done.push((index, result)),
                Err(error) => {
                    next.store(n, Ordering::Relaxed);
                    return Err(error);
                }
            }
        }
    };
    let panicked = |_| Error::numerical("a thread ended unexpectedly", "report the command that was run");
    let mut all: Vec<(usize, T)> = std::thread::scope(|scope| {
        let threads: Vec<_> = (0..rayon::current_num_threads()).map(|_| scope.spawn(work)).collect();
        let lists = threads.into_iter().map(|thread| thread.join().map_err(panicked)?);
        lists.collect::<Result<Vec<_>>>().map(|lists| lists.into_iter().flatten().collect())
    })?;
    all.sort_by_key(|(index, _)| *index);
    Ok(all.into_iter().map(|(_, result)| result).collect())
}

/// Options of the hierarchy. The prior of the overall mean has the average median and the largest width of the priors of the single experiments.
fn options(
    specimens: &[Specimen],
    parameters: &[&str],
    scales: &[SizeScale],
    request: &GroupsRequest,
) -> HierarchyOptions {
    let [n_dropped, n_first] = FIRST_SWEEPS;
    let named = || parameters.iter().zip(scales);
    let quantile = |specimen: &Specimen, (name, scale): (&&str, &SizeScale), probability: f64| {
        let prior = specimen.model.problem.priors.get(name);
        prior.map_or(f64::NAN, |prior| scale.coordinate(prior.distribution.quantile(probability)))
    };
    let mean = |own_parameter: (&&str, &SizeScale)| {
        specimens.iter().map(|specimen| quantile(specimen, own_parameter, 0.5)).sum::<f64>() / specimens.len() as f64
    };
    let sd = |specimen: &Specimen, parameter: (&&str, &SizeScale)| {
        0.5 * (quantile(specimen, parameter, 0.8413) - quantile(specimen, parameter, 0.1587))
    };
    let widest =
        |parameter: (&&str, &SizeScale)| specimens.iter().map(|specimen| sd(specimen, parameter)).fold(0.0, f64::max);
    HierarchyOptions {
        overall_mean: named().map(mean).collect(),
        overall_sd: named().map(widest).collect(),
        level_scale: LEVEL_SCALE,
        scales: SPREAD_SCALES,
        student_dof: request.student_dof(),
        n_chains: request.n_chains,
        n_sweeps: [n_dropped, n_first.min(request.max_sweeps)],
        max_sweeps: request.max_sweeps,
        keep_every: KEEP_EVERY,
        seed: request.sampler.seed,
    }
}

/// Chooses the form in which each experiment enters the hierarchy: its draws, or its exact likelihood if too few draws agree with the population.
fn entries(
    design: &Design,
    draws: &[InterimDraws],
    pilot: &HierarchyOptions,
    request: &GroupsRequest,
    monitor: &dyn Monitor,
) -> Result<Vec<ExperimentForm>> {
    let p = pilot.overall_mean.len();
    let members: Vec<ExperimentMember> = draws.iter().map(ExperimentMember::Draws).collect();
    let population = sample_population(design, &members, pilot, monitor)?;
    let all: Vec<&PopulationDraw> = population.draws().collect();
    let average = |of: &dyn Fn(&PopulationDraw) -> f64| all.iter().map(|draw| of(draw)).sum::<f64>() / all.len() as f64;
    let mut entries = vec![ExperimentForm { effective_draws: 0.0, is_exact: false }; draws.len()];
    for (index, specimen) in design.specimens.iter().enumerate() {
        let first = design.group_of[specimen.experiments[0]];
        for &e in &specimen.experiments {
            let group = design.group_of[e];
            let mean: Vec<f64> = (0..p)
                .map(|k| {
                    average(&|draw| {
                        let of_group = |group: usize| draw.group_mean[group * p + k];
                        let of_specimen =
                            if design.has_repeats() { draw.specimen_mean[index * p + k] } else { of_group(first) };
                        of_specimen + of_group(group) - of_group(first)
                    })
                })
                .collect();
            let at = specimen.stratum * p * p;
            let covariance = DMatrix::from_fn(p, p, |i, j| {
                average(&|draw| match draw.within_specimens.get(j * p + i) {
                    Some(value) => *value,
                    None => draw.between_specimens[at + j * p + i],
                })
            });
            let Some(precision) = covariance.try_inverse() else { continue };
            let effective_draws = draws[e].effective_number(&mean, &precision);
            let is_exact = request.is_exact || effective_draws < FEWEST_EFFECTIVE;
            entries[e] = ExperimentForm { effective_draws, is_exact };
        }
    }
    Ok(entries)
}
