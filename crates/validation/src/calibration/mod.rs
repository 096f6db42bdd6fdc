//! Simulation-based calibration of one experiment's inference (Talts et al. 2018, arXiv:1804.06788): parameters are drawn from its prior, a record is simulated at its rows and sampled as
//! `sample` does, and the truth's rank among the draws must be uniform.
//!
//! Records are simulated by the full finite-element model and sampled by the reduced one, so that the reduced model's error shows in the ranks. A calibration cannot say whether the finite
//! elements are the physics.

mod judgement;
mod sentence;

use std::sync::Arc;

use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

pub use judgement::judged;

use base::error::{Error, Place, Result, Setting};
use documents::calibration::Simulator;
use documents::posterior::ModelSummary;
use models::effects::Library;
use models::model::{Forward, FullForward};
use posterior::mechanics::Mechanics;
use posterior::monitor::{Counter, Monitor, Stoppable, refuse_if_stopped};
use posterior::prepared::{PreparedModel, training_load};
use posterior::problem::Problem;
use posterior::sample::{SampleRequest, refuse_too_many_rows, sample};
use posterior::study::ModelSpecification;
use record::Experiment;
use sampling::calibration::{apart, rank};
use sampling::ensemble::SampleOutcome;
use sampling::{LogDensity, SamplerOptions};

/// Posterior draws that a truth is ranked among: 100 ranks, which bins of 20 and intervals of 50 % and 90 % divide without a rest.
pub const N_DRAWS: usize = 99;
/// Name of the last ranked quantity: it sees what no single parameter shows, such as a posterior that is the prior.
pub const LOG_DENSITY: &str = "log_density";
/// Largest corrected p at which a calibration fails: a right program fails one in a hundred at most.
const LEVEL: f64 = 0.01;
/// Fewest ranked truths that are judged: with fewer χ² is no χ², and only gross errors would show.
pub const FEWEST: usize = 20;
/// Streams of truths and their noise, one a replicate; samplers have seeds of their own.
const STREAMS: u64 = 1 << 61;
/// Draws from the prior for one replicate: where so few have a model there is no prior to calibrate.
const MOST_DRAWN: usize = 200;

/// What a calibration is of; the same for all its replicates.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Subject {
    /// Specimen of the experiment.
    pub experiment: String,
    /// The model.
    pub model: ModelSummary,
    /// Sampled parameters.
    pub parameters: Vec<String>,
    /// What simulates its records.
    pub simulated_by: Simulator,
}

/// One simulated record and what its posterior said.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Replicate {
    /// Its number, from 0.
    pub number: usize,
    /// The sampled parameters that it was simulated with, in their own units.
    pub truth: Vec<f64>,
    /// Draws from the prior before this truth, which the model refuses.
    pub redrawn: usize,
    /// What the sampler came to; `None` where it failed.
    pub ranked: Option<Ranked>,
    /// Why it failed.
    pub failure: Option<String>,
}

/// A truth among the draws of its posterior.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Ranked {
    /// Ranks of all parameters, and of the log-density last.
    pub ranks: Vec<usize>,
    /// (truth − posterior mean)/posterior standard deviation of each parameter, in the sampler's coordinates.
    pub z: Vec<f64>,
    /// Whether the sampler's demands were met.
    pub converged: bool,
}

/// Refuses an experiment whose inference cannot be calibrated, before anything is meshed; gives the model's priors as they are written.
///
/// # Errors
/// [`Error::Input`].
pub fn check(experiment: &Experiment, model: &ModelSpecification, options: &SamplerOptions) -> Result<String> {
    refuse_too_many_rows(experiment.record.n_rows())?;
    let mechanics = Arc::new(Mechanics::Instrument { compliance_per_m: 1.0 });
    let problem = Problem::with_mechanics(experiment.clone(), model.clone(), &Library::default(), mechanics)?;
    posterior::sample::refuse_nothing_to_sample(&problem)?;
    if let Some((slug, field)) = problem.model.field().filter(|(_, field)| field.is_learnt_for_record()) {
        return Err(Error::input(
            Place::setting(Setting::Effects),
            format!(
                "{} are learnt about the law of one record, and every simulated record would take its own",
                field.words()
            ),
            format!("calibrate the model without `{slug}`"),
        ));
    }
    options.validate(problem.priors.priors().len())?;
    Ok(problem.priors.text().into())
}

/// What all replicates share: meshed, assembled and trained once.
pub struct Bench {
    model: PreparedModel,
}

impl Bench {
    /// Meshes, assembles and trains.
    ///
    /// # Errors
    /// As [`check`]; whatever meshing and training refuse.
    pub fn new(experiment: Experiment, model: ModelSpecification, monitor: &dyn Monitor) -> Result<Self> {
        let problem = Problem::new(experiment, model, None, monitor)?;
        Ok(Self { model: PreparedModel::unverified(&problem, None, monitor)? })
    }

    /// What is calibrated.
    pub fn subject(&self) -> Subject {
        let has_finite_elements = self.model.problem.finite_elements().is_some();
        Subject {
            experiment: self.model.problem.experiment.specimen_id.clone(),
            model: self.model.problem.specification.summary(),
            parameters: self.model.problem.priors.names().map(String::from).collect(),
            simulated_by: if has_finite_elements { Simulator::FullFiniteElements } else { Simulator::ClosedForm },
        }
    }

    /// Replicates of some numbers, in their order; each depends on its number and on the seed in `options` alone.
    ///
    /// # Errors
    /// [`Error::Interrupted`] when stopped; [`Error::Numerical`] where next to nothing of the prior has a model.
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
                let full = FullForward::new(model, &fe.stiffness, fe.poisson_ratio, time_s, force)?;
                Some(full.in_surroundings(fe.surroundings()))
            }
            None => None,
        };
        let reduced = self.model.forward_up_to(time_s.len());
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

    /// A truth that has a model, and its record.
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
            // Where tracking was lost nothing is simulated: a heavy-tailed noise that is seen everywhere would not be that of what is left.
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
            format!("of {MOST_DRAWN} draws from the prior none has a model for this record"),
            format!("give a narrower prior ({}), or fix what makes it fail ({})", Setting::Prior, Setting::Fixed),
        ))
    }

    /// Samples a simulated record and ranks its truth.
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
        let outcome = sample(problem, &posterior, &request, &Stoppable(monitor.stop()))?;
        let point = problem.priors.to_unconstrained(truth);
        let mut log_density = [0.0];
        posterior.log_density(&point, &mut log_density);
        ranked(&point, log_density[0], &outcome)
    }
}

/// A truth, at a point of the sampler and by its log-density, among the draws.
fn ranked(point: &[f64], log_density: f64, outcome: &SampleOutcome) -> Result<Ranked> {
    let draws = &outcome.draws;
    let places = apart(draws, N_DRAWS);
    if places.len() < N_DRAWS {
        return Err(Error::numerical(
            format!("{} draws were kept, and {N_DRAWS} are ranked among", places.len()),
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
        return Err(Error::numerical("the draws do not differ", format!("give more steps ({})", Setting::Steps)));
    }
    Ok(Ranked { ranks, z, converged: outcome.converged })
}

/// A truth that was drawn, and the positions (m) that were simulated at the fitted rows.
struct Simulated {
    truth: Vec<f64>,
    redrawn: usize,
    position_m: Vec<Option<f64>>,
}

/// The models of one record up to its last fitted row.
struct Forwards<'a> {
    reduced: &'a dyn Forward,
    full: Option<&'a dyn Forward>,
}

impl Forwards<'_> {
    /// The trajectory (m) by the full model, where there is one. What the reduced model refuses is outside of the posterior, and so of the prior; it is asked first, since it answers at once.
    fn trajectory_m(&self, parameters: &[f64]) -> Result<Vec<f64>> {
        let reduced_m = self.reduced.trajectory_m(parameters)?;
        self.full.map_or(Ok(reduced_m), |full| full.trajectory_m(parameters))
    }
}
