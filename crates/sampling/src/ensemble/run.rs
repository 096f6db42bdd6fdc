//! Sampling run from starting points to draws: burn-in, freeze (the end of the burn-in), sampling and end.

use super::batches::{CountingDensity, SplitDensity};
use super::draws::{DrawRecord, Draws, join};
use super::moves::Independence;
use super::options::{Batches, Phase, Progress, RunControl, SamplerOptions};
use super::random::RandomStream;
use super::recover::{Recovery, reseed_stranded_walkers};
use super::starts;
use super::state::{AdaptationState, EnsembleRecord, from_bytes, problem, to_bytes};
use super::verdict::{ConvergenceReport, autocorrelation_time, check_convergence};
use super::walkers::{Ensemble, Kernel};
use crate::LogDensity;
use crate::diagnostics::ParameterDiagnostics;
use crate::optimum::{Mode, find_modes};
use base::error::{InputPlace, Setting};
use base::{Error, Result};
use rayon::prelude::*;
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

/// Result of a sampling run: draws, diagnostics and statistics of the run.
#[derive(Debug, Clone)]
pub struct SampleOutcome {
    /// Draws since the end of the burn-in.
    pub draws: Draws,
    /// Diagnostics of each coordinate, with autocorrelation times in steps.
    pub parameters: Vec<ParameterDiagnostics>,
    /// `true` if all convergence criteria are met.
    pub converged: bool,
    /// Convergence criteria that are not met, and other remarks, in words; empty for a run that converged without remarks.
    pub messages: Vec<String>,
    /// Number of steps of each walker, burn-in included.
    pub n_steps: u64,
    /// Step at which the burn-in ended (the last freeze). Earlier draws were discarded.
    pub freeze_step: u64,
    /// Fraction of proposals that were accepted since the end of the burn-in.
    pub acceptance: f64,
    /// Longest integrated autocorrelation time of all coordinates, in steps.
    pub autocorrelation_time: f64,
    /// Number of evaluations of the log density, including the search for modes.
    pub likelihood_evaluations: u64,
    /// Number of walkers that the burn-in moved because they had not joined the others.
    pub walkers_reseeded: u64,
    /// Distinct modes, largest mass first.
    pub modes: Vec<Mode>,
}

/// Number of steps of the first burn-in round. Each later round doubles the total number of steps.
const FIRST_ROUND: u64 = 128;
/// Largest number of steps of the first sampling round.
const LONGEST_FIRST_ROUND: f64 = 256.0;
/// Shortest burn-in, in autocorrelation times. If a burn-in is shorter, another round follows.
const BURN_IN_TIMES: f64 = 10.0;
/// Fraction of accepted jumps above which jumps are used as often as allowed. With a smaller fraction, the other moves are more effective.
const FULL_JUMP_ACCEPTANCE: f64 = 0.3;
/// Probability to leave a point by a jump below which only half as many jumps are made, because other moves must reach and leave such points.
const HARD_ACCEPTANCE: f64 = 0.1;
/// Number of the random stream that selects where components of the approximation start. Walkers' streams have smaller numbers, those that all walkers
/// of an ensemble share larger ones.
const FIT_STREAM: u64 = 1 << 62;
/// Wall-clock time between two checks for progress, stop requests and checkpoints. It has no influence on results.
const LOOK_UP: Duration = Duration::from_millis(50);

/// Samples a log density with independent ensembles of walkers. The starting points need not be near the posterior's mass.
///
/// The documentation of the module `ensemble` lists the steps. Equal settings and starting points give equal bytes for any number of threads and any
/// number of interruptions.
///
/// # Errors
/// [`Error::Input`] for invalid settings or an unusable checkpoint; [`Error::Numerical`] if no start leads to a maximum, or if a log density is NaN
/// or +∞; [`Error::Interrupted`] if the run was stopped; any error of the function that stores checkpoints.
pub fn sample(
    density: &dyn LogDensity,
    start_points: &[Vec<f64>],
    options: &SamplerOptions,
    control: &RunControl,
) -> Result<SampleOutcome> {
    let dimension = density.dimension();
    options.validate(dimension)?;
    if dimension == 0 || start_points.is_empty() || start_points.iter().any(|start| start.len() != dimension) {
        return Err(Error::input(
            InputPlace::default().at_key("starts"),
            format!("the {} starts do not fit a log density of {dimension} parameters", start_points.len()),
            "give at least one start with one coordinate for every parameter",
        ));
    }
    let pool = rayon::ThreadPoolBuilder::new().num_threads(options.threads).build().map_err(|error| {
        Error::numerical(
            format!("the sampler cannot start its threads: {error}"),
            format!("use fewer threads ({})", Setting::Threads),
        )
    })?;
    pool.install(|| {
        let problem = problem(options, dimension, start_points, &control.fingerprint);
        let mut run = match control.resume {
            Some(bytes) => {
                let (course, lanes) = from_bytes(&problem, options, dimension, bytes)?;
                EnsembleRun { density, options, control, problem, course, lanes, pace: CheckpointSchedule::new() }
            }
            None => EnsembleRun::begin(density, start_points, options, control, problem)?,
        };
        run.finish()
    })
}

struct EnsembleRun<'a> {
    density: &'a dyn LogDensity,
    options: &'a SamplerOptions,
    control: &'a RunControl<'a>,
    problem: String,
    course: AdaptationState,
    lanes: Vec<EnsembleRecord>,
    pace: CheckpointSchedule,
}

impl<'a> EnsembleRun<'a> {
    fn begin(
        density: &'a dyn LogDensity,
        start_points: &[Vec<f64>],
        options: &'a SamplerOptions,
        control: &'a RunControl<'a>,
        problem: String,
    ) -> Result<Self> {
        let counting = CountingDensity::new(density);
        let modes = find_modes(&counting, start_points)?;
        starts::require(&modes, start_points.len())?;
        let course = AdaptationState {
            phase: Phase::BurnIn,
            base_step: 0,
            target_step: FIRST_ROUND.min(options.max_steps / 2),
            jumps: Independence::from_modes(&modes, density.dimension()).map(|q| (q, options.jump_fraction)),
            modes,
            walkers_reseeded: 0,
            extra_evaluations: 0,
            autocorrelation_time: None,
            forced: false,
        };
        let dimension = density.dimension();
        let blank = vec![0.0; dimension * options.n_walkers];
        let capacity = if options.store_every.is_none() { options.max_stored_steps } else { 0 };
        let lane = |number| EnsembleRecord {
            ensemble: Ensemble::new(options.seed, number, dimension, &blank, &blank[..options.n_walkers]),
            record: DrawRecord::new(0, options.store_every.unwrap_or(1), capacity, dimension, options.n_walkers),
        };
        let lanes = (0..options.n_ensembles).map(lane).collect();
        let mut run = Self { density, options, control, problem, course, lanes, pace: CheckpointSchedule::new() };
        run.place_all(&counting)?;
        run.course.extra_evaluations = counting.count();
        Ok(run)
    }

    /// Draws a new position for every walker from the modes, in proportion to the modes' masses.
    fn place_all(&mut self, density: &dyn LogDensity) -> Result<()> {
        let weights = self.course.modes.weights();
        let allocation = starts::allocation(&weights, self.options.n_ensembles, self.options.n_walkers);
        let modes: Vec<&Mode> = self.course.modes.iter().collect();
        for (lane, walkers) in self.lanes.iter_mut().zip(&allocation) {
            for (walker, &mode) in walkers.iter().enumerate() {
                let (point, value) = starts::draw(density, modes[mode], lane.ensemble.stream(walker))?;
                lane.ensemble.set_walker(walker, &point, value);
            }
        }
        Ok(())
    }

    fn finish(&mut self) -> Result<SampleOutcome> {
        let split = self.splits_batches();
        let split_density = SplitDensity { inner: self.density, piece: split.unwrap_or(usize::MAX) };
        let density: &dyn LogDensity = if split.is_some() { &split_density } else { self.density };
        loop {
            self.advance(density)?;
            if let Some(outcome) = self.decide()? {
                return Ok(outcome);
            }
        }
    }

    /// Returns the number of points per smaller batch if batches are split over threads; otherwise `None`.
    fn splits_batches(&self) -> Option<usize> {
        let half = self.options.n_walkers / 2;
        let threads = rayon::current_num_threads();
        let piece = half.div_ceil(threads.div_ceil(self.options.n_ensembles).max(2));
        match self.options.batches {
            Batches::Whole => None,
            Batches::Split => Some(piece),
            Batches::Auto if threads <= self.options.n_ensembles => None,
            Batches::Auto => {
                let position = self.lanes[0].ensemble.position(0);
                let began = Instant::now();
                self.density.log_density(&position, &mut [0.0]);
                (began.elapsed() > Duration::from_micros(20)).then_some(piece)
            }
        }
    }

    /// Moves all ensembles to the next convergence check. Meanwhile it reports progress, checks for stop requests and saves checkpoints.
    fn advance(&mut self, density: &dyn LogDensity) -> Result<()> {
        let stopped = || self.control.stop.is_some_and(|stop| stop.load(Ordering::Relaxed));
        let target = self.course.target_step;
        let limit = self.options.store_every.is_none().then_some(self.options.max_stored_steps);
        let jumps = self.course.jumps.as_ref().map(|(q, fraction)| (q, *fraction));
        let kernel = Kernel { local: &*self.options.kernel, jumps };
        let mut chunk = 16;
        while self.lanes.iter().any(|lane| lane.ensemble.n_steps() < target) {
            let began = Instant::now();
            self.lanes.par_iter_mut().try_for_each(|lane| -> Result<()> {
                for _ in 0..chunk.min(target.saturating_sub(lane.ensemble.n_steps())) {
                    if stopped() {
                        break;
                    }
                    lane.ensemble.step(density, &kernel)?;
                    lane.record.keep(&lane.ensemble, limit);
                }
                Ok(())
            })?;
            if stopped() {
                return Err(self.interrupted());
            }
            chunk = next_chunk(chunk, began.elapsed());
            self.report();
            if let Some(checkpoint) = &self.control.checkpoint
                && self.pace.due(checkpoint.interval)
            {
                self.pace.timed(|| (checkpoint.sink)(&to_bytes(&self.problem, &self.course, &self.lanes)?))?;
            }
        }
        Ok(())
    }

    /// Saves the state and returns the error that ends the interrupted run.
    fn interrupted(&self) -> Error {
        let Some(checkpoint) = &self.control.checkpoint else {
            return Error::Interrupted { kept: "nothing was saved: the run had no checkpoint".into() };
        };
        match to_bytes(&self.problem, &self.course, &self.lanes).and_then(|bytes| (checkpoint.sink)(&bytes)) {
            Ok(()) => {
                Error::Interrupted { kept: format!("the sampler's state was saved: continue with {}", Setting::Resume) }
            }
            Err(error) => error,
        }
    }

    fn report(&self) {
        if let Some(progress) = self.control.progress {
            progress(&Progress {
                phase: self.course.phase,
                steps: self.lanes.iter().map(|lane| lane.ensemble.n_steps()).min().unwrap_or(0),
                next_check_step: self.course.target_step,
                max_steps: self.options.max_steps,
            });
        }
    }

    fn draws(&self) -> Draws {
        let records: Vec<&DrawRecord> = self.lanes.iter().map(|lane| &lane.record).collect();
        join(&records, self.density.dimension(), self.options.n_walkers)
    }

    /// Decides on the next phase of the run from the present draws. Returns the outcome if the run is over.
    fn decide(&mut self) -> Result<Option<SampleOutcome>> {
        let draws = self.draws();
        let recovery = if self.course.forced { Recovery::default() } else { self.recover(&draws)? };
        let steps = self.course.target_step;
        let time = self.resolved(autocorrelation_time(&draws), draws.store_every);
        // Another burn-in round doubles the steps, and at least half of all steps must remain for draws. If that is impossible, the outcome lists the criteria
        // that are not met.
        let may_burn = 4 * steps <= self.options.max_steps;
        let burnt = if self.course.phase == Phase::BurnIn { steps } else { self.course.base_step };
        // An unknown time (NaN) does not prolong the burn-in, because the sampling phase determines it.
        let too_short = (burnt as f64) < BURN_IN_TIMES * time;
        // The outcome always reports these walkers, because a later freeze does not move them back.
        self.course.forced |= recovery.invalidates_draws() && !may_burn;
        match self.course.phase {
            _ if may_burn && recovery.invalidates_draws() => self.burn_in(steps),
            Phase::BurnIn if may_burn && too_short => {
                self.fit_jumps(&draws);
                self.burn_in(steps);
            }
            Phase::Sampling if 2 * steps <= self.options.max_steps && too_short => self.freeze(steps, time, &draws),
            Phase::BurnIn => self.freeze(steps, time, &draws),
            Phase::Sampling => return Ok(self.judge(draws, time, &recovery)),
        }
        Ok(None)
    }

    /// Returns the estimated autocorrelation time, in steps. If draws are kept too rarely to resolve this time, an earlier estimate limits the
    /// result.
    fn resolved(&mut self, estimate: f64, store_every: u64) -> f64 {
        if estimate > 3.0 * store_every as f64 || store_every == 1 || self.options.store_every.is_some() {
            self.course.autocorrelation_time = Some(estimate);
        }
        self.course.autocorrelation_time.map_or(estimate, |known| if known < estimate { known } else { estimate })
    }

    /// Returns the outcome if all criteria are met or the step limit is reached.
    fn judge(&mut self, draws: Draws, time: f64, recovery: &Recovery) -> Option<SampleOutcome> {
        let steps = self.course.target_step;
        let since = (steps - self.course.base_step) as f64;
        let at_the_end = steps >= self.options.max_steps;
        if !at_the_end {
            let wanted = self.options.convergence.autocorrelation_times * time;
            if since < wanted {
                self.go_on(steps, (1.05 * wanted).min(2.0 * since) - since);
                return None;
            }
            if !self.options.stop_when_converged {
                self.go_on(steps, since);
                return None;
            }
        }
        let verdict = check_convergence(&draws, &self.options.convergence);
        let met = verdict.unmet_criteria.is_empty() && !self.course.forced && recovery.stuck == 0;
        if met || at_the_end {
            return Some(self.outcome(draws, verdict, time, recovery, met));
        }
        self.go_on(steps, since * (1.1 * verdict.shortfall).clamp(1.25, 2.0) - since);
        None
    }

    /// Schedules the next convergence check about `more` steps after the present step `steps`.
    fn go_on(&mut self, steps: u64, more: f64) {
        self.course.target_step = (steps + (more.ceil() as u64).max(8)).min(self.options.max_steps);
    }

    /// Starts another burn-in round, with as many steps as were made so far.
    fn burn_in(&mut self, steps: u64) {
        self.course.phase = Phase::BurnIn;
        self.discard(steps);
        self.go_on(steps, steps as f64);
    }

    /// Ends the burn-in: fits the approximation for jumps and discards earlier draws. From then on only fixed moves act on the walkers.
    fn freeze(&mut self, steps: u64, time: f64, draws: &Draws) {
        self.course.phase = Phase::Sampling;
        self.fit_jumps(draws);
        self.discard(steps);
        let wanted = 1.05 * self.options.convergence.autocorrelation_times * time;
        // The first sampling round is short, because the new approximation can shorten the autocorrelation time, and the burn-in may not have determined it.
        self.go_on(
            steps,
            if wanted.is_finite() { wanted.clamp(64.0, LONGEST_FIRST_ROUND) } else { LONGEST_FIRST_ROUND },
        );
    }

    /// Fits the approximation of the posterior from which jumps are drawn to the second half of the draws. Jumps are rarer if few of them will be
    /// accepted.
    fn fit_jumps(&mut self, draws: &Draws) {
        let (points, log_density) = draws.since(draws.n_steps / 2);
        let mut stream = RandomStream::new(self.options.seed, FIT_STREAM);
        let fitted = Independence::fitted(&self.course.modes, draws.dimension, &points, &log_density, &mut stream);
        self.course.jumps = fitted.map(|(q, [acceptance, hard])| {
            let of_hard = if hard < HARD_ACCEPTANCE { 0.5 } else { 1.0 };
            let fraction = self.options.jump_fraction * (acceptance / FULL_JUMP_ACCEPTANCE).clamp(0.1, 1.0) * of_hard;
            (q, fraction)
        });
    }

    fn discard(&mut self, steps: u64) {
        self.course.base_step = steps;
        self.course.autocorrelation_time = None;
        for lane in &mut self.lanes {
            lane.record.restart(steps, self.options.store_every.unwrap_or(1));
            lane.ensemble.reset_acceptance();
        }
    }

    /// Finds walkers that did not join the others and moves them.
    fn recover(&mut self, draws: &Draws) -> Result<Recovery> {
        let counting = CountingDensity::new(self.density);
        // During sampling the walkers are only examined, because kept draws must come from the fixed moves alone.
        let is_read_only = self.course.phase == Phase::Sampling && 4 * self.course.target_step > self.options.max_steps;
        let recovery =
            reseed_stranded_walkers(&counting, draws, &mut self.course.modes, &mut self.lanes, is_read_only)?;
        if recovery.new_heavy_mode && !is_read_only {
            self.place_all(&counting)?;
        }
        self.course.walkers_reseeded += recovery.reseeded;
        self.course.extra_evaluations += counting.count();
        Ok(recovery)
    }

    fn outcome(
        &self,
        draws: Draws,
        verdict: ConvergenceReport,
        time: f64,
        recovery: &Recovery,
        converged: bool,
    ) -> SampleOutcome {
        let n_proposals = (self.course.target_step - self.course.base_step) * self.n_all_walkers();
        let accepted: u64 = self.lanes.iter().flat_map(|lane| lane.ensemble.accepted()).sum();
        let mut messages = verdict.unmet_criteria;
        if self.course.forced {
            messages.push("some walkers had not joined the others when the burn-in reached its step limit".into());
        }
        if recovery.stuck > 0 {
            messages.push(format!("{} walkers have stopped moving", recovery.stuck));
        }
        SampleOutcome {
            draws,
            parameters: verdict.parameters,
            converged,
            messages,
            n_steps: self.course.target_step,
            freeze_step: self.course.base_step,
            acceptance: accepted as f64 / n_proposals as f64,
            autocorrelation_time: time,
            likelihood_evaluations: self.course.target_step * self.n_all_walkers() + self.course.extra_evaluations,
            walkers_reseeded: self.course.walkers_reseeded,
            modes: self.course.modes.iter().cloned().collect(),
        }
    }

    fn n_all_walkers(&self) -> u64 {
        (self.options.n_walkers * self.options.n_ensembles) as u64
    }
}

/// Returns the number of steps until the next check for progress and stop requests, which take about [`LOOK_UP`]. `chunk` steps took the time
/// `elapsed`.
fn next_chunk(chunk: u64, elapsed: Duration) -> u64 {
    let ratio = LOOK_UP.as_secs_f64() / elapsed.as_secs_f64().max(1e-9);
    ((chunk as f64 * ratio.clamp(0.1, 4.0)) as u64).clamp(1, 1 << 20)
}

/// Schedule for checkpoints at regular intervals. Saving takes at most one fiftieth of the time.
struct CheckpointSchedule {
    last: Instant,
    cost: Duration,
}

impl CheckpointSchedule {
    fn new() -> Self {
        Self { last: Instant::now(), cost: Duration::ZERO }
    }

    fn due(&self, interval: Duration) -> bool {
        self.last.elapsed() >= interval.max(50 * self.cost)
    }

    fn timed(&mut self, save: impl FnOnce() -> Result<()>) -> Result<()> {
        let began = Instant::now();
        save()?;
        self.cost = began.elapsed();
        self.last = Instant::now();
        Ok(())
    }
}
