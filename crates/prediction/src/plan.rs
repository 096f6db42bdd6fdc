//! Force plans: the smallest constant force, or the fastest stepwise force with a rest at the target, that succeeds with a given probability.
//!
//! Half of the draws serve the search. Draws of the other half are checked by full finite elements, so that the promised probability meets a frequency that
//! the search has not seen.

use base::error::{Error, InputPlace, Result};
use documents::prediction::ForceStep;
use figures::density::quantile_of_sorted;
use nalgebra::{DMatrix, DVector};
use posterior::monitor::Monitor;
use posterior::prepared::KeptSurrogate;
use record::Record;

use crate::body;
use crate::ensemble::{Draws, Ensemble, Gel};
use crate::force_history::ForceHistory;
use crate::quantity::{ten_digits, time_to_reach_s};
use crate::scenario::Scenario;

/// Number of other draws that full finite elements check, and their number if a run takes seconds or more.
const CHECKED: [usize; 2] = [128, 8];
/// Relative width of the interval in which a limiting force is found, and the largest number of forces that are tried.
const FORCE_WIDTH: f64 = 1e-6;
const MOST_TRIALS: usize = 40;
/// Numbers of changes of the force during the rest at the target that are tried.
const REST_STEPS: [usize; 3] = [12, 24, 48];
/// Parts of the largest force that are tried for the way to a rest.
const TRAVEL_PARTS: [f64; 4] = [1.0, 0.8, 0.6, 0.4];
/// Times from which the position of a rest is compared with the target, as parts of the way from the arrival to the deadline. The first keeps the robot from going far beyond the target.
const REST_BEGINS: [f64; 2] = [0.0, 0.5];
/// Number of draws that judge a rest first, and the difference from the requested probability up to which all draws judge it.
const N_FIRST_DRAWS: usize = 400;
const NEAR_PROBABILITY: f64 = 0.1;
/// Number of times at which the position of a rest is compared with the target.
const N_REST_ROWS: usize = 240;
/// Number of equal steps into which a limited slew rate divides a change of the force.
const SLEW_STEPS: usize = 20;
/// Number of equal intervals at whose ends a constant force is searched, beside the changes of the force, if the position is proportional to it.
const N_SEARCH_ROWS: usize = 32;
/// Number of equal steps between the force that a target needs and the one that a limit of the strain allows.
const BETWEEN_LIMITS: u32 = 12;
/// Relative distance from the limit of a draw at which rounding does not lose it.
const ROUNDING: f64 = 1e-6;
/// Distances from the target that a rest aims at if the strain is limited, as parts of its tolerance: a robot that stops short of the target strains the gel less.
const AIMS_SHORT: [f64; 4] = [0.0, 0.25, 0.5, 0.75];
/// Relative distance from the limit of the slew rate at which the rounding of differences does not exceed it.
const SLEW_ROUNDING: f64 = 1e-12;
/// Largest number of last digits by which a force is rounded down under a limit of the slew rate.
const MOST_DIGITS: f64 = 4.0;
/// Number of rounds in which the sizes and durations of changes are found in turn.
const SLEW_ROUNDS: usize = 4;
/// Number of equal intervals of a force that a limited slew rate shapes from the start on, and the largest part of an interval in which the force changes.
const SHAPED_INTERVALS: usize = 40;
const SHAPED_PART: f64 = 0.95;
/// Times from which such a force keeps the mean at the target, as parts of the time of arrival.
const SHAPED_BEGINS: [f64; 3] = [0.6, 0.8, 1.0];
/// Factor of a limit that counts as no limit.
const MUCH: f64 = 100.0;
/// Number of sweeps over the changes of the force in the least-squares search.
const SWEEPS: usize = 2_000;

/// Target of a plan, and the limits of the apparatus.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Target {
    /// Distance to reach, in m; negative against the positive force.
    pub reach_m: f64,
    /// Time within which it is reached, in s.
    pub within_s: f64,
    /// Requested probability of success.
    pub probability: f64,
    /// Largest absolute force, in N.
    pub largest_force_n: f64,
    /// Largest change of the force per time, in N/s; `None` for no limit.
    pub slew_n_per_s: Option<f64>,
    /// Largest principal strain of the gel; `None` for no limit.
    pub largest_strain: Option<f64>,
    /// Rest at the target; `None` for none.
    pub rest: Option<Rest>,
}

/// Rest at the target after the time of arrival.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rest {
    /// Largest distance from the target, in m.
    pub within_m: f64,
    /// Duration of the rest, in s.
    pub for_s: f64,
}

/// Planned force with its probabilities.
pub struct PlannedForce {
    /// Scenario under the planned force, with the draws of the search.
    pub ensemble: Ensemble,
    /// Changes of the force.
    pub steps: Vec<ForceStep>,
    /// True if the requested probability is reached.
    pub is_feasible: bool,
    /// Probability of success over the draws of the search.
    pub promised: f64,
    /// Share of success over other draws, by full finite elements.
    pub checked: f64,
    /// Number of full-order runs of the check.
    pub full_runs: usize,
    /// Limit that binds; empty if none does.
    pub limit: &'static str,
}

impl Target {
    /// Duration of a plan, in s.
    pub fn duration_s(&self) -> f64 {
        self.within_s + self.rest.map_or(0.0, |rest| rest.for_s)
    }

    /// Share of an ensemble's draws that meet the target.
    ///
    /// # Errors
    /// Errors of the model.
    pub fn probability_under(&self, ensemble: &Ensemble) -> Result<f64> {
        let trajectories_m = ensemble.trajectories_m(0..ensemble.parameters.len())?;
        let met = trajectories_m.iter().filter(|x| self.is_met(ensemble.record(), x, ensemble.strain_per_m)).count();
        Ok(met as f64 / trajectories_m.len().max(1) as f64)
    }

    /// True if a trajectory reaches the target in time, rests there and stays below the largest strain.
    fn is_met(&self, record: &Record, position_m: &[f64], strain_per_m: f64) -> bool {
        let arrives = time_to_reach_s(record, position_m, self.reach_m) <= self.within_s * (1.0 + 1e-9);
        let rests = self.rest.is_none_or(|rest| {
            let rows = record.time_s.iter().zip(position_m).filter(|(time_s, _)| **time_s >= self.within_s);
            rows.into_iter().all(|(_, x)| (x - self.reach_m).abs() <= rest.within_m)
        });
        // The rest replaces the first passage: a robot that stops just before the target within the tolerance has arrived.
        (if self.rest.is_some() { rests } else { arrives }) && self.strain_is_met(position_m, strain_per_m)
    }

    /// True if the strain stays below its limit.
    fn strain_is_met(&self, position_m: &[f64], strain_per_m: f64) -> bool {
        self.largest_strain.is_none_or(|limit| strain_per_m * largest(position_m) <= limit)
    }

    /// Farthest position (m) towards the target in time; 0 if the robot only moves away from it.
    fn farthest_m(&self, record: &Record, position_m: &[f64]) -> f64 {
        let n_rows = record.time_s.partition_point(|time_s| *time_s <= self.within_s * (1.0 + 1e-9));
        position_m[..n_rows].iter().fold(0.0_f64, |most, x| most.max(self.sign() * x))
    }

    /// Smallest and largest factor of a trajectory at which it reaches the target and stays below the largest strain.
    pub(crate) fn succeeding_factors(&self, record: &Record, position_m: &[f64], strain_per_m: f64) -> [f64; 2] {
        let strain = self.largest_strain.map_or(0.0, |limit| strain_per_m * largest(position_m) / limit);
        [self.reach_m.abs() / self.farthest_m(record, position_m), strain.recip()]
    }
}

/// Largest distance from 0.
fn largest(position_m: &[f64]) -> f64 {
    position_m.iter().fold(0.0_f64, |most, x| most.max(x.abs()))
}

/// Smallest factor up to `most` at which the share `probability` of all ranges of factors overlaps, or else the largest at which most of them do, with the share that overlaps.
pub(crate) fn best_factor(ranges: &[[f64; 2]], probability: f64, most: f64) -> (f64, f64) {
    let able = ranges.iter().filter(|[from, to]| *from <= most && from <= to);
    let mut ends: Vec<(f64, i32)> = able.flat_map(|[from, to]| [(*from, 1), (*to, -1)]).collect();
    // Ranges that touch overlap.
    ends.sort_by(|a, b| a.0.total_cmp(&b.0).then(b.1.cmp(&a.1)));
    let share = |count: i32| f64::from(count) / ranges.len().max(1) as f64;
    if ends.is_empty() {
        // Nothing succeeds: the largest factor below the ends of the ranges of that share.
        return ((-within_share(ranges.iter().map(|[_, to]| -to), probability)).min(most), 0.0);
    }
    let (mut count, mut best) = (0, (most, 0));
    for (k, (at, change)) in ends.iter().enumerate().take_while(|(_, (at, _))| *at <= most) {
        count += change;
        if *change < 0 {
            continue;
        }
        let next = ends.get(k + 1).map_or(most, |next| next.0.min(most));
        if share(count) >= probability - 1e-12 {
            return ((at * (1.0 + ROUNDING)).min(0.5 * (at + next)), share(count));
        }
        if count > best.1 {
            let end = ends[k + 1..].iter().find(|(_, change)| *change < 0).map_or(most, |end| end.0);
            best = (if end > most { most } else { (end * (1.0 - ROUNDING)).max(*at) }, count);
        }
    }
    (best.0, share(best.1))
}

/// A force as its changes, with the probability of success over the draws of the search.
struct Tried {
    changes: Vec<[f64; 2]>,
    probability: f64,
}

/// A search for forces.
struct ForceSearch<'a> {
    target: &'a Target,
    /// Scenario with the draws of the search.
    ensemble: Ensemble,
    is_linear: bool,
}

/// Plans the force of a scenario.
///
/// # Errors
/// Errors of the models; [`Error::Input`] if a rest is asked of a model that is not linear.
pub fn plan(
    gel: &Gel<'_>,
    scenario: &Scenario,
    target: &Target,
    kept: Option<KeptSurrogate>,
    monitor: &dyn Monitor,
) -> Result<PlannedForce> {
    let [planned, unused] = halves(&gel.draws);
    let search = ForceSearch::new(&Gel { draws: planned, ..*gel }, scenario, target, kept, monitor)?;
    let found = search.found()?;
    let is_feasible = found.probability >= target.probability;
    let limit = if is_feasible { "" } else { search.limit()? };
    let record = target.record(&found.changes)?;
    monitor.stage("checking unused draws by full finite elements");
    let other = search.ensemble.with_record(record.clone());
    let other = other.with_draws(&unused.thinned(CHECKED[usize::from(other.is_slow())]), 1);
    let full_m = other.full_trajectories_m(&(0..other.parameters.len()).collect::<Vec<usize>>())?;
    let met = full_m.iter().filter(|x| target.is_met(&record, x, other.strain_per_m)).count();
    Ok(PlannedForce {
        steps: target.written(&found.changes),
        is_feasible,
        promised: found.probability,
        checked: met as f64 / full_m.len().max(1) as f64,
        full_runs: full_m.len(),
        limit,
        ensemble: search.ensemble.with_record(record),
    })
}

/// Force that a robot needs for a target.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NeededForce {
    /// Largest absolute force of the plan, in N.
    pub force_n: f64,
    /// Probability of success over the draws of the search.
    pub probability: f64,
    /// Distance in m that the largest force reaches in time with the requested probability.
    pub reach_m: f64,
}

/// Robots that are compared for one target, each without the check by full finite elements.
pub struct RobotComparison<'a> {
    gel: Gel<'a>,
    kept: Option<KeptSurrogate>,
    /// Ensemble of the first robot with its accurate compliance, from which those of others follow.
    first: Option<(Ensemble, f64)>,
}

impl<'a> RobotComparison<'a> {
    /// Begins a comparison with the draws of a gel that serve the search.
    pub fn new(gel: &Gel<'a>, kept: Option<KeptSurrogate>) -> Self {
        let [planned, _] = halves(&gel.draws);
        Self { gel: Gel { draws: planned, ..*gel }, kept, first: None }
    }

    /// Finds the force that a robot needs.
    ///
    /// # Errors
    /// The errors of [`plan`].
    pub fn needed_force(&mut self, scenario: &Scenario, target: &Target, monitor: &dyn Monitor) -> Result<NeededForce> {
        // The strain depends on the shape, so that a limit of it needs each robot's own elements.
        let first = self.first.as_ref().filter(|_| target.largest_strain.is_none());
        let search = match first.and_then(|(first, compliance_per_m)| first.for_robot(scenario, *compliance_per_m)) {
            Some(ensemble) => ForceSearch::of(ensemble.with_record(target.at_largest_force()?), target)?,
            None => ForceSearch::new(&self.gel, scenario, target, self.kept.clone(), monitor)?,
        };
        let found = needed(&search)?;
        if self.first.is_none() {
            let compliance = body::compliance_per_m(&scenario.robot, &scenario.vitreous);
            self.first = compliance.map(|(compliance_per_m, _)| (search.ensemble, compliance_per_m));
        }
        Ok(found)
    }
}

fn needed(search: &ForceSearch<'_>) -> Result<NeededForce> {
    let (target, found) = (search.target, search.found()?);
    let (record, trajectories_m) = search.trajectories_m(&target.whole())?;
    let row = record.time_s.partition_point(|time_s| *time_s < target.within_s).min(record.n_rows() - 1);
    let mut reached_m: Vec<f64> = trajectories_m.iter().map(|x| target.sign() * x[row]).collect();
    reached_m.sort_unstable_by(f64::total_cmp);
    Ok(NeededForce {
        force_n: found.changes.iter().fold(0.0_f64, |most, change| most.max(change[1].abs())),
        probability: found.probability,
        reach_m: target.sign() * quantile_of_sorted(&reached_m, 1.0 - target.probability),
    })
}

/// Draws with even and odd numbers.
pub(crate) fn halves(draws: &Draws) -> [Draws; 2] {
    [0, 1].map(|first| Draws {
        source: draws.source.clone(),
        names: draws.names.clone(),
        values: draws.values.iter().skip(first).step_by(2).cloned().collect(),
        other_specimens: Vec::new(),
    })
}

impl Target {
    fn sign(&self) -> f64 {
        self.reach_m.signum()
    }

    /// Changes of the force, each spread over the time that the slew rate needs, in equal steps. A change that needs longer than until the next ends there.
    fn stepped(&self, changes: &[[f64; 2]]) -> Vec<[f64; 2]> {
        let Some(slew_n_per_s) = self.slew_n_per_s else { return changes.to_vec() };
        let mut steps: Vec<[f64; 2]> = Vec::new();
        let mut before_n = 0.0;
        for (k, [time_s, force_n]) in changes.iter().enumerate() {
            let until_s = changes.get(k + 1).map_or(self.duration_s(), |next| next[0]);
            let most_n = slew_n_per_s * (until_s - time_s);
            let change_n = (force_n - before_n).clamp(-most_n, most_n);
            let ramp_s = change_n.abs() / slew_n_per_s;
            let mut reached_n = before_n;
            for step in 1..=SLEW_STEPS {
                let share = step as f64 / SLEW_STEPS as f64;
                // Each step follows the time that it needs, so that no two steps are steeper than the slew rate.
                let at_s = time_s + ramp_s * share;
                if at_s < until_s && change_n != 0.0 {
                    reached_n = before_n + share * change_n;
                    steps.push([at_s, reached_n]);
                }
            }
            before_n = reached_n;
        }
        if steps.first().is_none_or(|first| first[0] > 0.0) {
            steps.insert(0, [0.0, 0.0]);
        }
        steps
    }

    /// Changes of the force as files state them. Under a limit of the slew rate, times and forces have the ten digits of the controller's file, and no force is rounded beyond
    /// the limit.
    fn written(&self, changes: &[[f64; 2]]) -> Vec<ForceStep> {
        let exact = |[time_s, n]: [f64; 2]| ForceStep { time_s, force_un: 1e6 * n };
        let steps = self.stepped(changes).into_iter().map(exact);
        let Some(slew_un_per_s) = self.slew_n_per_s.map(|slew| 1e6 * slew * (1.0 - SLEW_ROUNDING)) else {
            return steps.collect();
        };
        let mut written: Vec<ForceStep> = Vec::new();
        for ForceStep { time_s, force_un } in steps {
            let (time_s, mut force_un) = (ten_digits(time_s), ten_digits(force_un));
            if let Some(before) = written.last().copied() {
                let interval_s = time_s - before.time_s;
                if interval_s <= 0.0 {
                    // The next change contains this one.
                    continue;
                }
                let change_un = force_un - before.force_un;
                let most_un = slew_un_per_s * interval_s;
                let last_digit_un = 10_f64.powf(force_un.abs().max(before.force_un.abs()).log10().floor() - 9.0);
                let mut digits = 1.0;
                while (force_un - before.force_un).abs() > most_un && digits <= MOST_DIGITS {
                    let smaller_un = (most_un - digits * last_digit_un).max(0.0);
                    force_un = ten_digits(before.force_un + smaller_un.copysign(change_un));
                    digits += 1.0;
                }
            }
            written.push(ForceStep { time_s, force_un });
        }
        written
    }

    /// The largest force from the start on, as its changes.
    fn whole(&self) -> [[f64; 2]; 1] {
        [[0.0, self.sign() * self.largest_force_n]]
    }

    /// Rows of the largest force from the start on.
    ///
    /// # Errors
    /// [`Error::Input`] for a duration without rows.
    pub(crate) fn at_largest_force(&self) -> Result<Record> {
        self.record(&self.whole())
    }

    /// Few rows of a force with these changes: at the changes, at equal distances and at the deadline.
    fn few_rows(&self, changes: &[[f64; 2]]) -> Record {
        let steps = self.stepped(changes);
        let even = (0..=N_SEARCH_ROWS).map(|row| self.duration_s() * row as f64 / N_SEARCH_ROWS as f64);
        let time_s = even.chain(steps.iter().map(|step| step[0])).chain([self.within_s]).collect();
        ForceHistory::Steps(steps).record_at(time_s, self.duration_s())
    }

    /// Rows of a force with these changes.
    fn record(&self, changes: &[[f64; 2]]) -> Result<Record> {
        ForceHistory::Steps(self.stepped(changes)).record(self.duration_s(), &[self.within_s])
    }
}

impl<'a> ForceSearch<'a> {
    /// Prepares the scenario under the largest force.
    fn new(
        gel: &Gel<'_>,
        scenario: &Scenario,
        target: &'a Target,
        kept: Option<KeptSurrogate>,
        monitor: &dyn Monitor,
    ) -> Result<Self> {
        let ensemble = Ensemble::new(gel, scenario, target.at_largest_force()?, kept, monitor)?;
        monitor.stage(&format!("searching for the force of {}", scenario.name));
        Self::of(ensemble, target)
    }

    /// Search for the force on an ensemble under the largest force.
    fn of(ensemble: Ensemble, target: &'a Target) -> Result<Self> {
        let is_linear = ensemble.is_linear()?;
        Ok(Self { target, ensemble, is_linear })
    }

    /// Best force that the search finds.
    fn found(&self) -> Result<Tried> {
        match self.target.rest {
            None => self.constant(),
            Some(_) if self.is_linear => self.with_rest(),
            Some(_) => Err(Error::input(
                InputPlace::default().at_key("rest"),
                "a rest at the target is planned for models whose position is proportional to the force, and this model's is not",
                "plan without a rest, or use a revision without the nonlinear effect",
            )),
        }
    }

    /// Trajectories (m) under a force, on few rows if the model is linear: its position grows as long as the force does, so that few rows hold the farthest one.
    fn trajectories_on_few_rows_m(&self, changes: &[[f64; 2]]) -> Result<(Record, Vec<Vec<f64>>)> {
        let record = match self.is_linear {
            true => self.target.few_rows(changes),
            false => self.target.record(changes)?,
        };
        self.trajectories_at_m(record)
    }

    fn trajectories_m(&self, changes: &[[f64; 2]]) -> Result<(Record, Vec<Vec<f64>>)> {
        self.trajectories_at_m(self.target.record(changes)?)
    }

    fn trajectories_at_m(&self, record: Record) -> Result<(Record, Vec<Vec<f64>>)> {
        let under_force = self.ensemble.with_record(record.clone());
        let trajectories_m = under_force.trajectories_m(0..self.ensemble.parameters.len())?;
        Ok((record, trajectories_m))
    }

    /// Share of the draws that meet a target under a force.
    fn share(&self, target: &Target, changes: &[[f64; 2]]) -> Result<f64> {
        self.share_of(target, changes, 1)
    }

    /// Share of every `step`-th draw.
    fn share_of(&self, target: &Target, changes: &[[f64; 2]], step: usize) -> Result<f64> {
        let record = self.target.record(changes)?;
        let draws: Vec<usize> = (0..self.ensemble.parameters.len()).step_by(step).collect();
        let trajectories_m = self.ensemble.with_record(record.clone()).trajectories_m(draws)?;
        let is_met = |x: &&Vec<f64>| target.is_met(&record, x, self.ensemble.strain_per_m);
        Ok(trajectories_m.iter().filter(is_met).count() as f64 / trajectories_m.len().max(1) as f64)
    }

    /// Smallest constant force with the requested probability. Without one, the force with the highest probability.
    fn constant(&self) -> Result<Tried> {
        let target = self.target;
        let changes = |force_n: f64| vec![[0.0, target.sign() * force_n]];
        let tried = |force_n: f64| {
            let probability = self.share(target, &changes(force_n))?;
            Ok::<Tried, Error>(Tried { changes: changes(force_n), probability })
        };
        if self.is_linear && target.slew_n_per_s.is_none() {
            let (record, trajectories_m) = self.trajectories_on_few_rows_m(&target.whole())?;
            let range = |x: &Vec<f64>| target.succeeding_factors(&record, x, self.ensemble.strain_per_m);
            let ranges: Vec<[f64; 2]> = trajectories_m.iter().map(range).collect();
            return tried(best_factor(&ranges, target.probability, 1.0).0 * target.largest_force_n);
        }
        // A quantity of all draws (a part of its limit), for the share of them that the probability asks for.
        let of_share = |force_n: f64, part: &dyn Fn(&Record, &Vec<f64>) -> f64| {
            let (record, trajectories_m) = self.trajectories_on_few_rows_m(&changes(force_n))?;
            Ok(within_share(trajectories_m.iter().map(|x| part(&record, x)), target.probability))
        };
        // Farthest position in time as a part of the distance; the sign makes the share one of draws that go at least so far.
        let reached =
            |force_n: f64| Ok(-of_share(force_n, &|record, x| -target.farthest_m(record, x) / target.reach_m.abs())?);
        let [_, force_n] = crossing(target.largest_force_n, reached)?;
        // Rounding must not lose the draw at the limit.
        let force_n = (force_n * (1.0 + ROUNDING)).min(target.largest_force_n);
        let found = tried(force_n)?;
        let Some(largest_strain) = target.largest_strain.filter(|_| found.probability < target.probability) else {
            return Ok(found);
        };
        let part = self.ensemble.strain_per_m / largest_strain;
        let strain = |force_n: f64| of_share(force_n, &|_, x| part * largest(x));
        let [_, strain_n] = crossing(target.largest_force_n, strain)?;
        // Draws differ in the force that they need and in the one that strains them too much, so that a force between both limits may serve most.
        let mut best = found;
        for k in 0..=BETWEEN_LIMITS {
            let share = f64::from(k) / f64::from(BETWEEN_LIMITS);
            let found = tried(force_n + share * (strain_n - force_n))?;
            if found.probability >= target.probability {
                return Ok(found);
            }
            best = if found.probability > best.probability { found } else { best };
        }
        Ok(best)
    }

    /// First stepwise force with the requested probability, or the one with the highest: the largest force, or a part of it, until the mean arrives, then steps that keep the mean at the target.
    fn with_rest(&self) -> Result<Tried> {
        let mut best: Option<Tried> = None;
        let record = Target { slew_n_per_s: None, ..*self.target }.at_largest_force()?;
        let all = 0..self.ensemble.parameters.len();
        let mean_m = mean(&self.ensemble.with_record(record.clone()).trajectories_m(all)?);
        let first_draws = (self.ensemble.parameters.len() / N_FIRST_DRAWS).max(1);
        let short = if self.target.largest_strain.is_some() { &AIMS_SHORT[..] } else { &AIMS_SHORT[..1] };
        let within_m = self.target.rest.map_or(0.0, |rest| rest.within_m);
        let aims_m = short.iter().map(|part| self.target.reach_m - part * self.target.sign() * within_m);
        let (record, mean_m) = (&record, &mean_m);
        let all = aims_m.flat_map(|aim_m| {
            let steps = TRAVEL_PARTS.into_iter().flat_map(|part| REST_STEPS.map(|n_steps| (part, n_steps)));
            let of_steps =
                REST_BEGINS.into_iter().flat_map(move |begin| steps.clone().map(move |(part, n)| (begin, part, n)));
            let at_once =
                of_steps.map(move |(begin, part, n)| self.rest_changes(aim_m, (part, begin, n), record, mean_m));
            let begins = if self.target.slew_n_per_s.is_some() { &SHAPED_BEGINS[..] } else { &[] };
            at_once.chain(begins.iter().map(move |begin| self.shaped_changes(aim_m, *begin, record, mean_m)))
        });
        for changes in all {
            let mut probability = self.share_of(self.target, &changes, first_draws)?;
            if probability >= self.target.probability - NEAR_PROBABILITY {
                probability = self.share(self.target, &changes)?;
            }
            if probability >= self.target.probability {
                return Ok(Tried { changes, probability });
            }
            if best.as_ref().is_none_or(|best| probability > best.probability) {
                best = Some(Tried { changes, probability });
            }
        }
        let changes = best.map_or(vec![[0.0, 0.0]], |best| best.changes);
        Ok(Tried { probability: self.share(self.target, &changes)?, changes })
    }

    /// Changes of a stepwise force: `part` of the largest force until the mean arrives at `aim_m`, then `n_steps` changes that keep the mean there in the sense of
    /// least squares. `begin` is one of [`REST_BEGINS`], and `mean_m` is the mean position (m) under the largest force at the rows of `record`.
    fn rest_changes(
        &self,
        aim_m: f64,
        (part, begin, n_steps): (f64, f64, usize),
        record: &Record,
        mean_m: &[f64],
    ) -> Vec<[f64; 2]> {
        let target = self.target;
        let travel_n = part * target.sign() * target.largest_force_n;
        let step_m =
            |since_s: f64| if since_s <= 0.0 { 0.0 } else { part * interpolated(&record.time_s, mean_m, since_s) };
        // Response to a change that the slew rate spreads over a time.
        let response_m = |since_s: f64, ramp_s: f64| {
            let at = |k: usize| step_m(since_s - ramp_s * (k as f64 + 1.0) / SLEW_STEPS as f64);
            if ramp_s == 0.0 { step_m(since_s) } else { (0..SLEW_STEPS).map(at).sum::<f64>() / SLEW_STEPS as f64 }
        };
        let arrival_s = time_to_reach_s(record, mean_m, aim_m / part);
        let end_s = target.duration_s();
        if arrival_s > target.within_s {
            return vec![[0.0, travel_n]];
        }
        // The changes follow each other ever more slowly, as the creep of the gel does.
        let change_s = |k: usize| arrival_s + (end_s - arrival_s) * (k as f64 / n_steps as f64).powi(2);
        let mut changes_s: Vec<f64> = vec![0.0];
        for k in 0..n_steps {
            let time_s = change_s(k);
            if time_s - changes_s[changes_s.len() - 1] >= 1e-3 * end_s {
                changes_s.push(time_s);
            }
        }
        let begin_s = arrival_s + begin * (target.within_s - arrival_s);
        let rows: Vec<f64> =
            (0..=N_REST_ROWS).map(|k| begin_s + (end_s - begin_s) * k as f64 / N_REST_ROWS as f64).collect();
        let wanted = DVector::from_element(rows.len(), aim_m);
        let mut ramps_s = vec![0.0; changes_s.len()];
        let mut parts = Vec::new();
        // The time that a change takes depends on its size, so that both are found in turn.
        for _ in 0..if target.slew_n_per_s.is_some() { SLEW_ROUNDS } else { 1 } {
            let matrix = DMatrix::from_fn(rows.len(), changes_s.len(), |row, k| {
                // The force of interval k acts from its change until the next.
                let until = changes_s.get(k + 1).map_or(0.0, |next_s| response_m(rows[row] - next_s, ramps_s[k + 1]));
                response_m(rows[row] - changes_s[k], ramps_s[k]) - until
            });
            parts = bounded_least_squares(&matrix, &wanted, 1.0 / part);
            if let Some(slew) = target.slew_n_per_s {
                let before = std::iter::once(&0.0).chain(&parts);
                let change_n = before.zip(&parts).map(|(a, b)| ((b - a) * travel_n).abs());
                ramps_s = change_n.map(|change_n| change_n / slew).collect();
            }
        }
        changes_s.iter().zip(&parts).map(|(time_s, part)| [*time_s, part * travel_n]).collect()
    }

    /// Changes of a force that the slew rate limits, in equal intervals from the start on. They keep the mean at `aim_m`, in the sense of least squares, from the part `begin` of the
    /// time of arrival on. `mean_m` is the mean position (m) under the largest force at the rows of `record`.
    fn shaped_changes(&self, aim_m: f64, begin: f64, record: &Record, mean_m: &[f64]) -> Vec<[f64; 2]> {
        let target = self.target;
        let (end_s, begin_s) = (target.duration_s(), begin * target.within_s);
        let slew = target.slew_n_per_s.unwrap_or(f64::INFINITY) / target.largest_force_n;
        let interval_s = end_s / SHAPED_INTERVALS as f64;
        let step_m = |since_s: f64| if since_s <= 0.0 { 0.0 } else { interpolated(&record.time_s, mean_m, since_s) };
        let response_m = |since_s: f64, ramp_s: f64| {
            let at = |k: usize| step_m(since_s - ramp_s * (k as f64 + 1.0) / SLEW_STEPS as f64);
            (0..SLEW_STEPS).map(at).sum::<f64>() / SLEW_STEPS as f64
        };
        let change_s = |k: usize| interval_s * k as f64;
        let row_s = |row: usize| begin_s + (end_s - begin_s) * row as f64 / N_REST_ROWS as f64;
        let wanted = DVector::from_element(N_REST_ROWS + 1, aim_m);
        let mut changes = vec![0.0_f64; SHAPED_INTERVALS];
        // The time that a change takes depends on its size, so that both are found in turn.
        for _ in 0..SLEW_ROUNDS {
            let response = |row: usize, k: usize| response_m(row_s(row) - change_s(k), changes[k].abs() / slew);
            let matrix = DMatrix::from_fn(N_REST_ROWS + 1, SHAPED_INTERVALS, response);
            changes = bounded_changes(&matrix, &wanted, SHAPED_PART * slew * interval_s);
        }
        let levels = changes.iter().scan(0.0, |level, change| {
            *level += change;
            Some(*level * target.sign() * target.largest_force_n)
        });
        levels.enumerate().map(|(k, force_n)| [change_s(k), force_n]).collect()
    }

    /// Limit that keeps the probability below the request: the first whose removal helps.
    fn limit(&self) -> Result<&'static str> {
        let relaxed = [
            ("strain", Target { largest_strain: None, ..*self.target }),
            ("slew rate", Target { slew_n_per_s: None, ..*self.target }),
            ("force", Target { largest_force_n: MUCH * self.target.largest_force_n, ..*self.target }),
        ];
        for (limit, target) in relaxed.iter().filter(|(_, target)| target != self.target) {
            let ensemble = self.ensemble.with_record(target.at_largest_force()?);
            let search = ForceSearch { target, ensemble, is_linear: self.is_linear };
            if search.found()?.probability >= self.target.probability {
                return Ok(limit);
            }
        }
        let has_others = self.target.largest_strain.is_some() || self.target.slew_n_per_s.is_some();
        Ok(match self.target.rest {
            Some(_) => "uncertainty of the gel",
            // Without other limits, a force that is large enough reaches any target.
            None if self.is_linear && !has_others => "force",
            None => "combination of all limits",
        })
    }
}

/// Smallest value that the share `probability` of all values does not exceed.
fn within_share(values: impl Iterator<Item = f64>, probability: f64) -> f64 {
    let mut ascending: Vec<f64> = values.collect();
    ascending.sort_unstable_by(f64::total_cmp);
    let n = (probability * ascending.len() as f64 - 1e-9).ceil().max(1.0) as usize;
    n.min(ascending.len()).checked_sub(1).map_or(f64::NAN, |last| ascending[last])
}

/// Forces on both sides of the one at which a quantity reaches 1, up to the largest force; the second is the largest force if it is not reached. The quantity grows with the force
/// from 0. False position with the modification "Illinois", which is exact after one step where the quantity is proportional to the force.
fn crossing(largest_n: f64, quantity: impl Fn(f64) -> Result<f64>) -> Result<[f64; 2]> {
    let ([mut low_n, mut high_n], [mut low, mut high]) = ([0.0, largest_n], [-1.0, quantity(largest_n)? - 1.0]);
    if high <= 0.0 {
        return Ok([largest_n; 2]);
    }
    // Side that the last trial replaced.
    let mut last = None;
    for _ in 0..MOST_TRIALS {
        if high_n - low_n <= FORCE_WIDTH * high_n {
            break;
        }
        // Aims beside the crossing, so that both sides close in on it.
        let aim_n = (low_n * high - high_n * low) / (high - low);
        let beside_n = 0.4 * FORCE_WIDTH * aim_n;
        let force_n = if last == Some(false) { aim_n + beside_n } else { aim_n - beside_n };
        let force_n = force_n.clamp(low_n + 0.1 * beside_n, high_n - 0.1 * beside_n);
        let found = quantity(force_n)? - 1.0;
        let is_high = found >= 0.0;
        if is_high {
            (high_n, high) = (force_n, found);
            low *= if last == Some(true) { 0.5 } else { 1.0 };
        } else {
            (low_n, low) = (force_n, found);
            high *= if last == Some(false) { 0.5 } else { 1.0 };
        }
        last = Some(is_high);
    }
    Ok([low_n, high_n])
}

/// Mean trajectory.
fn mean(trajectories_m: &[Vec<f64>]) -> Vec<f64> {
    let n = trajectories_m.len().max(1) as f64;
    let n_rows = trajectories_m.first().map_or(0, Vec::len);
    (0..n_rows).map(|row| trajectories_m.iter().map(|x| x[row]).sum::<f64>() / n).collect()
}

/// Value at a time between rows, by a straight line; the last value beyond the rows.
fn interpolated(time_s: &[f64], values: &[f64], at_s: f64) -> f64 {
    let next = time_s.partition_point(|time| *time < at_s);
    match (next.checked_sub(1), values.get(next)) {
        (Some(before), Some(value)) => {
            let share = (at_s - time_s[before]) / (time_s[next] - time_s[before]);
            values[before] + share * (value - values[before])
        }
        (None, Some(value)) => *value,
        _ => values[values.len() - 1],
    }
}

/// Minimises |A x − b|² over x between −`bound` and `bound`. The first coordinate begins at 1.
fn bounded_least_squares(matrix: &DMatrix<f64>, wanted: &DVector<f64>, bound: f64) -> Vec<f64> {
    let mut start = vec![0.0; matrix.ncols()];
    start[0] = 1.0;
    descend(matrix, wanted, start, |_, _| [-bound, bound])
}

/// Minimises |A x − b|² over changes x between −`bound` and `bound` whose sums from the first on stay between −1 and 1.
fn bounded_changes(matrix: &DMatrix<f64>, wanted: &DVector<f64>, bound: f64) -> Vec<f64> {
    let range = |x: &[f64], k: usize| {
        // Levels from this change on, which all move with it.
        let before: f64 = x[..k].iter().sum();
        let levels = x[k..].iter().scan(before, |level, change| {
            *level += change;
            Some(*level)
        });
        let [lowest, highest] =
            levels.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], level| [low.min(level), high.max(level)]);
        // Rounding must not exclude the present value.
        [(x[k] - 1.0 - lowest).max(-bound).min(x[k]), (x[k] + 1.0 - highest).min(bound).max(x[k])]
    };
    descend(matrix, wanted, vec![0.0; matrix.ncols()], range)
}

/// Minimises |A x − b|² by descent in one coordinate after the other. `range` gives the smallest and the largest value of a coordinate beside the others.
fn descend(
    matrix: &DMatrix<f64>,
    wanted: &DVector<f64>,
    mut x: Vec<f64>,
    range: impl Fn(&[f64], usize) -> [f64; 2],
) -> Vec<f64> {
    let mut residual = matrix * DVector::from_column_slice(&x) - wanted;
    let square: Vec<f64> = matrix.column_iter().map(|column| column.norm_squared()).collect();
    for _ in 0..SWEEPS {
        for k in (0..x.len()).filter(|k| square[*k] > 0.0) {
            let (old, [least, most]) = (x[k], range(&x, k));
            x[k] = (old - matrix.column(k).dot(&residual) / square[k]).clamp(least, most);
            residual.axpy(x[k] - old, &matrix.column(k), 1.0);
        }
    }
    x
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Unconstrained changes (2, −1.5): the first stays at its bound. A larger bound lets the first reach the largest level.
    #[test]
    fn bounded_changes_keep_their_levels_within_the_largest() {
        let matrix = DMatrix::from_row_slice(2, 2, &[1.0, 0.0, 1.0, 1.0]);
        let wanted = DVector::from_vec(vec![2.0, 0.5]);
        let [small, large] = [0.4, 5.0].map(|bound| bounded_changes(&matrix, &wanted, bound));
        assert!((small[0] - 0.4).abs() < 1e-12 && (small[1] - 0.1).abs() < 1e-9, "{small:?}");
        assert!((large[0] - 1.0).abs() < 1e-12 && (large[1] + 0.5).abs() < 1e-9, "{large:?}");
    }

    #[test]
    fn bounded_least_squares_finds_the_constrained_minimum() {
        // Unconstrained minimum (2, 0.5): the first coordinate stays at its bound, and the second compensates.
        let matrix = DMatrix::from_row_slice(2, 2, &[1.0, 1.0, 0.0, 1.0]);
        let x = bounded_least_squares(&matrix, &DVector::from_vec(vec![2.5, 0.5]), 1.0);
        assert!((x[0] - 1.0).abs() < 1e-12 && (x[1] - 1.0).abs() < 1e-9, "{x:?}");
    }

    /// Checks crossings of 1 by functions with known inverses, over many decades, and the number of trials: three of a proportional quantity.
    #[test]
    fn a_crossing_is_found_between_two_near_forces() {
        type Case = (&'static str, usize, fn(f64) -> f64, f64);
        let functions: [Case; 5] = [
            ("proportional", 3, |x| x / 0.3, 0.3),
            ("far below the limit", 6, |x| x / 3e-9, 3e-9),
            ("square", 14, |x| (x / 0.02).powi(2), 0.02),
            ("root", 14, |x| (x / 0.02).sqrt(), 0.02),
            ("saturated", 14, |x| (x / 0.4).min(1.5), 0.4),
        ];
        for (name, most, function, expected) in functions {
            let trials = std::cell::Cell::new(0);
            let counted = |x: f64| {
                trials.set(trials.get() + 1);
                Ok(function(x))
            };
            let [low, high] = crossing(1.0, counted).unwrap();
            assert!(function(low) < 1.0 && function(high) >= 1.0, "{name}: {low} {high}");
            assert!(high - low <= FORCE_WIDTH * high && (high / expected - 1.0).abs() < 2.0 * FORCE_WIDTH, "{name}");
            assert!(trials.get() <= most, "{name}: {}", trials.get());
        }
        assert_eq!(crossing(2.0, |x| Ok(0.4 * x)).unwrap(), [2.0; 2]);
    }

    /// Four draws that need 0.2, 0.3, 0.4 and 0.5 of the force; the strain of the first allows 0.45, that of the last 0.48 alone.
    #[test]
    fn a_factor_serves_the_draws_that_overlap() {
        let ranges = [[0.2, 0.45], [0.3, 0.9], [0.4, 0.9], [0.5, 0.48]];
        let near = |(factor, share): (f64, f64), expected: [f64; 2]| {
            assert!((factor - expected[0]).abs() < 1e-5 && share == expected[1], "{factor} {share}");
        };
        near(best_factor(&ranges, 0.5, 1.0), [0.3, 0.5]);
        near(best_factor(&ranges, 0.75, 1.0), [0.4, 0.75]);
        // All four never succeed together: the largest factor for three.
        near(best_factor(&ranges, 1.0, 1.0), [0.45, 0.75]);
        near(best_factor(&ranges, 1.0, 0.35), [0.35, 0.5]);
        near(best_factor(&[[2.0, f64::INFINITY]], 0.5, 1.0), [1.0, 0.0]);
        near(best_factor(&[[2.0, 0.3], [2.0, 0.2]], 1.0, 1.0), [0.2, 0.0]);
        // Without a limit of the strain, the largest force serves most.
        near(best_factor(&[[0.2, f64::INFINITY], [1.5, f64::INFINITY]], 1.0, 1.0), [1.0, 0.5]);
    }

    #[test]
    fn a_share_counts_whole_draws() {
        let values = || (1..=20).map(f64::from);
        assert_eq!([0.0, 0.5, 0.95, 0.951, 1.0].map(|p| within_share(values(), p)), [1.0, 10.0, 19.0, 20.0, 20.0]);
    }

    /// Late and small changes, whose ten digits are coarse beside their steps.
    #[test]
    fn written_forces_keep_the_slew_rate_exactly() {
        let target = Target {
            reach_m: 1e-3,
            within_s: 900.0,
            probability: 0.95,
            largest_force_n: 1e-3,
            slew_n_per_s: Some(5e-6),
            largest_strain: None,
            rest: None,
        };
        let changes = [
            [0.0, 4.612_345_678_9e-6],
            [3.3, 1.1e-6],
            [123.456_789_01, 1.101e-6],
            [777.777_777_777, -2.345_678_901e-6],
        ];
        let steps = target.written(&changes);
        assert!(steps.len() > 3 * SLEW_STEPS, "{}", steps.len());
        for pair in steps.windows(2) {
            let slope = (pair[1].force_un - pair[0].force_un).abs() / (pair[1].time_s - pair[0].time_s);
            assert!(slope <= 5.0, "{slope} {pair:?}");
            assert_eq!((ten_digits(pair[1].time_s), ten_digits(pair[1].force_un)), (pair[1].time_s, pair[1].force_un));
        }
        let last_un = steps.last().map_or(0.0, |step| step.force_un);
        assert!((last_un + 2.345_678_901).abs() < 1e-5, "{last_un}");
        // Without a limit, forces keep all of their digits.
        let free = Target { slew_n_per_s: None, ..target }.written(&changes);
        assert!(free.iter().zip(&changes).all(|(step, change)| step.force_un == 1e6 * change[1]));
    }

    #[test]
    fn a_limited_slew_rate_divides_changes_into_steps_of_its_slope() {
        let target = Target {
            reach_m: 1e-3,
            within_s: 6.0,
            probability: 0.95,
            largest_force_n: 100.0,
            slew_n_per_s: Some(1.0),
            largest_strain: None,
            rest: None,
        };
        let steps = target.stepped(&[[0.0, 1.0], [5.0, -1.0]]);
        let slope = |pair: &[[f64; 2]]| ((pair[1][1] - pair[0][1]) / (pair[1][0] - pair[0][0])).abs();
        // The second change needs 2 s and has 1 s until the end, where its last step falls.
        assert_eq!(steps.len(), 1 + SLEW_STEPS + SLEW_STEPS - 1);
        assert!(steps.windows(2).all(|pair| pair[1][0] > pair[0][0] && slope(pair) <= 1.0 + 1e-9), "{steps:?}");
        assert_eq!((steps[0], steps[SLEW_STEPS]), ([0.0, 0.0], [1.0, 1.0]));
        assert!((steps[steps.len() - 1][1] - 0.05).abs() < 1e-9, "{steps:?}");
        // A limit of the force that the slew rate does not reach changes nothing.
        let [near, far] = [10.0, 1e6].map(|force_n| target.stepped(&[[0.0, force_n]]));
        assert_eq!(near, far);
    }
}
