//! Simulation-based calibration of one experiment's inference (Talts et al. 2018, arXiv:1804.06788). Parameters are drawn from the prior. A record is simulated
//! at the experiment's rows, and the posterior is sampled as by `sample`. The rank of the true value among the posterior draws must be uniformly distributed.
//!
//! The full-order model simulates the records, and the posterior uses the surrogate. The ranks therefore also show errors of the surrogate. A calibration
//! cannot test whether the finite elements describe the physics.

mod judgement;
mod sentence;

use std::sync::Arc;

use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

pub use judgement::judge;

use base::error::{Error, InputPlace, Result, Setting};
use documents::calibration::Simulator;
use documents::posterior::ModelSummary;
use models::effects::Library;
use models::model::{Forward, FullOrderForward};
use posterior::mechanics::Mechanics;
use posterior::monitor::{Counter, Monitor, StoppableMonitor, refuse_if_stopped};
use posterior::prepared::{PreparedModel, training_load};
use posterior::problem::Problem;
use posterior::sample::{SampleRequest, refuse_too_many_rows, sample};
use posterior::study::ModelSpecification;
use record::Experiment;
use sampling::calibration::{independent_draw_indices, rank};
use sampling::ensemble::SampleOutcome;
use sampling::{LogDensity, SamplerOptions};

/// Number of posterior draws among which a true value is ranked. The 100 possible ranks divide evenly into 20 bins and into intervals of 50 % and 90 %.
pub const N_DRAWS: usize = 99;
/// Name of the last ranked quantity, the log density. Its ranks reveal faults that no single parameter shows, such as a posterior that equals the prior.
pub const LOG_DENSITY: &str = "log_density";
/// A calibration fails if the smallest corrected p is below this level. A correct program fails at most once in a hundred calibrations.
const LEVEL: f64 = 0.01;
/// Smallest number of ranks for a verdict. With fewer, the statistic is not χ² distributed, and only gross errors would be detected.
pub const FEWEST: usize = 20;
/// Number of the first random stream for true values and their noise; each replicate has its own stream. Samplers have their own seeds.
const STREAMS: u64 = 1 << 61;
/// Largest number of prior draws for one replicate. If the model fails for all of them, the calibration stops with an error.
const MOST_DRAWN: usize = 200;

/// Subject of a calibration: experiment, model and simulator, common to all replicates.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct CalibrationSubject {
    /// Specimen identifier of the experiment.
    pub experiment: String,
    /// Model that is calibrated.
    pub model: ModelSummary,
    /// Names of the sampled parameters.
    pub parameters: Vec<String>,
    /// Model that simulates the records.
    pub simulated_by: Simulator,
}

/// One simulated record with the ranks of its true parameters.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Replicate {
    /// Number of the replicate, from 0.
    pub number: usize,
    /// True values of the sampled parameters, in the parameters' units.
    pub truth: Vec<f64>,
    /// Number of prior draws that the model refused before it accepted `truth`.
    pub redrawn: usize,
    /// Ranks from the sampler; `None` if it failed.
    pub ranked: Option<Ranked>,
    /// Reason why the sampler failed; `None` if it did not.
    pub failure: Option<String>,
}

/// Ranks of the true values among the draws of the posterior.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Ranked {
    /// Ranks of all parameters, followed by the rank of the log density; from 0 to [`N_DRAWS`].
    pub ranks: Vec<usize>,
    /// (true value − posterior mean)/posterior standard deviation of each parameter, in the sampler's coordinates.
    pub z: Vec<f64>,
    /// True if the sampler has converged.
    pub converged: bool,
}

/// Checks that an experiment's inference can be calibrated, before a mesh is made. Returns the text of the model's priors.
///
/// # Errors
/// [`Error::Input`] if it cannot be calibrated.
pub fn check(experiment: &Experiment, model: &ModelSpecification, options: &SamplerOptions) -> Result<String> {
    refuse_too_many_rows(experiment.record.n_rows())?;
    let mechanics = Arc::new(Mechanics::Instrument { compliance_per_m: 1.0 });
    let problem = Problem::with_mechanics(experiment.clone(), model.clone(), &Library::default(), mechanics)?;
    posterior::sample::refuse_nothing_to_sample(&problem)?;
    if let Some((slug, field)) = problem.model.field().filter(|(_, field)| field.is_learnt_for_record()) {
        return Err(Error::input(
            InputPlace::setting(Setting::Effects),
            format!(
                "the surrogate for {} is trained for the law of one record, so each simulated record would need its own",
                field.words()
            ),
            format!("calibrate the model without `{slug}`"),
        ));
    }
    options.validate(problem.priors.priors().len())?;
    Ok(problem.priors.text().into())
}

/// Meshed, assembled and trained model of a calibration. All replicates share it.
pub struct Bench {
    model: PreparedModel,
}

impl Bench {
    /// Meshes, assembles and trains the model.
    ///
    /// # Errors
    /// Errors of [`check`], of meshing and of training.
    pub fn new(experiment: Experiment, model: ModelSpecification, monitor: &dyn Monitor) -> Result<Self> {
        let problem = Problem::new(experiment, model, None, monitor)?;
        Ok(Self { model: PreparedModel::unverified(&problem, None, monitor)? })
    }

    /// Returns the subject of the calibration.
    pub fn subject(&self) -> CalibrationSubject {
        let has_finite_elements = self.model.problem.finite_elements().is_some();
        CalibrationSubject {
            experiment: self.model.problem.experiment.specimen_id.clone(),
            model: self.model.problem.specification.summary(),
            parameters: self.model.problem.priors.names().map(String::from).collect(),
            simulated_by: if has_finite_elements { Simulator::FullFiniteElements } else { Simulator::ClosedForm },
        }
    }

    /// Simulates and samples the replicates with these numbers, and returns them in order. Each replicate depends only on its number and on the seed in
    /// `options`.
    ///
    /// # Errors
    /// [`Error::Interrupted`] when stopped; [`Error::Numerical`] if the model fails for nearly all draws from the prior.
    pub fn replicates(
        &self,
        numbers: std::ops::Range<usize>,
        options: &SamplerOptions,
        monitor: &dyn Monitor,
    ) -> Result<Vec<Replicate>> {
        let (time_s, force) = training_load(&self.model.problem);
        let model = &self.model.problem.model;
        let full = match self.model.problem.finite_elements() {
            Some(fe) => {
                let full = FullOrderForward::new(model, &fe.stiffness, fe.full_order()?.clone(), time_s, force);
                Some(full.in_surroundings(fe.surroundings()))
            }
            None => None,
        };
        let reduced = self.model.local_forward(time_s.len());
        let forwards = Forwards { reduced: &reduced, full: full.as_ref().map(|full| full as &dyn Forward) };
        monitor.stage("simulating and sampling records");
        let counter = Counter::new(monitor, numbers.len());
        let one = |number: usize| {
            let found = self.replicate(number, &forwards, options, monitor)?;
            counter.add_one();
            Ok(found)
        };
        numbers.into_par_iter().map(one).collect()
    }

    fn replicate(
        &self,
        number: usize,
        forwards: &Forwards<'_>,
        options: &SamplerOptions,
        monitor: &dyn Monitor,
    ) -> Result<Replicate> {
        let mut rng = ChaCha8Rng::seed_from_u64(options.seed);
        rng.set_stream(STREAMS + number as u64);
        let Simulated { truth, redrawn, position_m } = self.simulated(forwards, &mut rng, monitor)?;
        let options = SamplerOptions { seed: rng.next_u64(), threads: 1, ..options.clone() };
        let replicate = |ranked, failure| Replicate { number, truth: truth.clone(), redrawn, ranked, failure };
        match self.ranked(&truth, position_m, &options, monitor) {
            Ok(ranked) => Ok(replicate(Some(ranked), None)),
            Err(error @ (Error::Interrupted { .. } | Error::Input { .. } | Error::File { .. })) => Err(error),
            Err(error) => Ok(replicate(None, Some(error.to_string()))),
        }
    }

    /// Draws parameters from the prior until the model accepts them, and simulates their record.
    fn simulated(&self, forwards: &Forwards<'_>, rng: &mut ChaCha8Rng, monitor: &dyn Monitor) -> Result<Simulated> {
        let Problem { experiment, model, noise, priors, .. } = &self.model.problem;
        let record = &experiment.record;
        let measured = self.model.problem.positions_of(&experiment.calibration_cycles);
        let rows: Vec<usize> = (0..measured.len()).filter(|row| measured[*row].is_some()).collect();
        let posterior = self.model.posterior();
        for redrawn in 0..MOST_DRAWN {
            refuse_if_stopped(monitor, "results of finished tasks are kept")?;
            let truth = priors.draw(rng);
            let natural = posterior.natural(&priors.to_unconstrained(&truth));
            let (parameters, of_noise) = natural.split_at(model.parameters().len());
            let Ok(trajectory_m) = forwards.trajectory_m(parameters) else { continue };
            // Rows with lost tracking are not simulated, because a heavy-tailed noise depends on the number of observed rows.
            let time_s: Vec<f64> = rows.iter().map(|row| record.time_s[*row]).collect();
            let recordings = self.model.problem.recordings();
            let cycle: Vec<u32> = rows.iter().map(|row| recordings[*row]).collect();
            let at_rows_m: Vec<f64> = rows.iter().map(|row| trajectory_m[*row]).collect();
            let errors_m = noise.simulate_m(&time_s, &cycle, &at_rows_m, of_noise, rng);
            let mut position_m = vec![None; record.n_rows()];
            for ((row, x), error) in rows.iter().zip(&at_rows_m).zip(&errors_m) {
                position_m[*row] = Some(x + error);
            }
            if errors_m.iter().all(|error| error.is_finite()) {
                return Ok(Simulated { truth, redrawn, position_m });
            }
        }
        Err(Error::numerical(
            format!("the model fails for all of {MOST_DRAWN} draws from the prior with this record"),
            format!(
                "give a narrower prior ({}), or fix the parameter that makes it fail ({})",
                Setting::Prior,
                Setting::Fixed
            ),
        ))
    }

    /// Samples the posterior of a simulated record, and ranks the true values.
    fn ranked(
        &self,
        truth: &[f64],
        position_m: Vec<Option<f64>>,
        options: &SamplerOptions,
        monitor: &dyn Monitor,
    ) -> Result<Ranked> {
        let model = self.model.for_problem(self.model.problem.with_positions(position_m));
        let (problem, posterior) = (&model.problem, model.posterior());
        let request = SampleRequest { options: options.clone(), kept_surrogate: None, checkpoint: None, resume: false };
        let outcome = sample(&model, &posterior, &request, &StoppableMonitor(monitor.stop()))?;
        let point = problem.priors.to_unconstrained(truth);
        let mut log_density = [0.0];
        posterior.log_density(&point, &mut log_density);
        ranked(&point, log_density[0], &outcome)
    }
}

/// Ranks the true values among the posterior draws. `point` holds them in the sampler's coordinates, and `log_density` is their log density.
fn ranked(point: &[f64], log_density: f64, outcome: &SampleOutcome) -> Result<Ranked> {
    let draws = &outcome.draws;
    let places = independent_draw_indices(draws, N_DRAWS);
    if places.len() < N_DRAWS {
        return Err(Error::numerical(
            format!("only {} draws were kept, but ranks need {N_DRAWS}", places.len()),
            format!("give more steps ({}) or walkers ({})", Setting::Steps, Setting::Chains),
        ));
    }
    let of = |value: &dyn Fn(&[usize; 3]) -> f64| places.iter().map(value).collect::<Vec<f64>>();
    let mut ranks: Vec<usize> = point
        .iter()
        .enumerate()
        .map(|(d, truth)| rank(*truth, of(&|[ensemble, step, walker]| draws.value(*ensemble, *step, *walker, d))))
        .collect();
    let index = |[ensemble, step, walker]: &[usize; 3]| (ensemble * draws.n_steps + step) * draws.n_walkers + walker;
    ranks.push(rank(log_density, of(&|place| draws.log_density[index(place)])));
    let z = point.iter().enumerate().map(|(d, truth)| {
        let values = draws.column(d).values;
        let n = values.len() as f64;
        let mean = values.iter().sum::<f64>() / n;
        let variance = values.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / (n - 1.0);
        (truth - mean) / variance.sqrt()
    });
    let z: Vec<f64> = z.collect();
    if z.iter().any(|z| !z.is_finite()) {
        return Err(Error::numerical("all draws are equal", format!("give more steps ({})", Setting::Steps)));
    }
    Ok(Ranked { ranks, z, converged: outcome.converged })
}

/// True parameters drawn from the prior, with the simulated positions (m) at the fitted rows.
struct Simulated {
    truth: Vec<f64>,
    redrawn: usize,
    position_m: Vec<Option<f64>>,
}

/// Full-order model and surrogate of one record up to its last fitted row.
struct Forwards<'a> {
    reduced: &'a dyn Forward,
    full: Option<&'a dyn Forward>,
}

impl Forwards<'_> {
    /// Returns the simulated positions (m), from the full-order model if there is one. The surrogate runs first, because it is fast. Parameters that the
    /// surrogate refuses have posterior density 0, so they are excluded from the prior.
    fn trajectory_m(&self, parameters: &[f64]) -> Result<Vec<f64>> {
        let reduced_m = self.reduced.trajectory_m(parameters)?;
        self.full.map_or(Ok(reduced_m), |full| full.trajectory_m(parameters))
    }
}
