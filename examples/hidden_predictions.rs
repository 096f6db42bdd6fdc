//! Counts how often predictions and plans hold for hidden gels: the posterior comes from the replica's protocol with a sphere, and the truth moves another robot
//! under another force, by finer elements.
//!
//! `cargo run --release --example hidden_predictions -- --count 200 --first 0 --seed 1 --json predictions.json`

use std::path::PathBuf;

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use serde::Serialize;
use vitreo_uq::base::error::{Error, InputPlace, Result};
use vitreo_uq::base::files::write_json_atomically;
use vitreo_uq::elements::fe::Stiffness;
use vitreo_uq::elements::fe::time::FullOrderModel;
use vitreo_uq::models::model::{Forward, FullOrderForward};
use vitreo_uq::posterior::mechanics::robot_mesh;
use vitreo_uq::posterior::monitor::SilentMonitor;
use vitreo_uq::posterior::problem::Problem;
use vitreo_uq::posterior::replica;
use vitreo_uq::posterior::sample::{self, SampleRequest};
use vitreo_uq::posterior::study::ModelSpecification;
use vitreo_uq::prediction::ensemble::{Draws, Ensemble, Gel, quantiles_um};
use vitreo_uq::prediction::force_history::ForceHistory;
use vitreo_uq::prediction::plan::{Target, plan};
use vitreo_uq::prediction::quantity::time_to_reach_s;
use vitreo_uq::prediction::scenario::Scenario;
use vitreo_uq::record::{Apparatus, Orientation, Record, Robot, RobotShape, Vitreous};
use vitreo_uq::sampling::SamplerOptions;

/// Refinement of the mesh that makes the data, and of the meshes that move the other robots. The models have level 3.
const DATA_LEVEL: usize = 4;
const TRUTH_LEVEL: usize = 5;
const NOISE_M: f64 = 4e-6;
const N_DRAWS: usize = 2_000;
const DURATION_S: f64 = 8.0;
const WITHIN_S: f64 = 3.0;
const PROBABILITY: f64 = 0.95;

/// Results of one hidden gel.
#[derive(Serialize)]
struct Case {
    robot: String,
    force: &'static str,
    converged: bool,
    /// True position at the end inside the 90 % band.
    end_is_covered: bool,
    /// Share of the times at which the true position is inside the 90 % band.
    share_covered: f64,
    /// Probability over the planning draws, frequency among unused draws, and arrival of the truth.
    promised: f64,
    checked: f64,
    truth_arrives: bool,
}

fn robots() -> [(&'static str, RobotShape); 3] {
    [
        (
            "cylinder along the force",
            RobotShape::Cylinder { length_m: 2.04e-3, diameter_m: 0.21e-3, orientation: Orientation::Horizontal },
        ),
        (
            "ellipsoid across the force",
            RobotShape::Ellipsoid { length_m: 1.5e-3, diameter_m: 0.3e-3, orientation: Orientation::Vertical },
        ),
        ("smaller sphere", RobotShape::Sphere { diameter_m: 0.3e-3 }),
    ]
}

fn force(random: &mut ChaCha8Rng) -> (&'static str, ForceHistory) {
    let un = 1e-6 * (1.0 + 3.0 * random.random::<f64>());
    match (3.0 * random.random::<f64>()) as u32 {
        0 => ("steps", ForceHistory::Steps(vec![[0.0, un], [2.0, -0.5 * un], [5.0, 0.8 * un]])),
        1 => ("ramp", ForceHistory::Ramp { rate_n_per_s: un / DURATION_S }),
        _ => ("sine", ForceHistory::Sine { amplitude_n: un, frequency_hz: 0.1 + 0.4 * random.random::<f64>() }),
    }
}

/// Everything that all cases share.
struct Bench {
    problem: Problem,
    robot: Robot,
    vitreous: Vitreous,
    data: Stiffness,
    truths: Vec<(&'static str, Robot, Stiffness)>,
}

impl Bench {
    fn new() -> Result<Self> {
        let (experiment, _) = replica::embedded()?;
        let Apparatus::Robot { robot, vitreous } = experiment.apparatus.clone() else {
            return Err(Error::numerical("the replica has no robot", "restore its description"));
        };
        let problem = Problem::new(experiment, ModelSpecification::default(), None, &SilentMonitor)?;
        let stiffness = |robot: &Robot, level| Stiffness::new(&robot_mesh(robot, &vitreous, level)?);
        let truth = |(name, shape)| {
            let robot = Robot { shape, ..robot };
            Ok((name, robot, stiffness(&robot, TRUTH_LEVEL)?))
        };
        let truths = robots().into_iter().map(truth).collect::<Result<_>>()?;
        Ok(Self { data: stiffness(&robot, DATA_LEVEL)?, problem, robot, vitreous, truths })
    }

    fn moved_m(&self, stiffness: &Stiffness, truth: &[f64], record: &Record) -> Result<Vec<f64>> {
        let at_ratio = FullOrderModel::new(stiffness, self.vitreous.poisson_ratio)?;
        FullOrderForward::new(&self.problem.model, stiffness, at_ratio, &record.time_s, record.force())
            .trajectory_m(truth)
    }

    fn case(&self, number: u64, seed: u64) -> Result<Case> {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        random.set_stream(number);
        let priors = self.problem.priors.priors();
        let n = self.problem.model.parameters().len();
        let truth: Vec<f64> =
            priors[..n].iter().map(|prior| prior.distribution.quantile(0.02 + 0.96 * random.random::<f64>())).collect();
        let clean_m = self.moved_m(&self.data, &truth, &self.problem.experiment.record)?;
        let mut noisy = |x: f64| {
            let noise: f64 = StandardNormal.sample(&mut random);
            Some(x + NOISE_M * noise)
        };
        let problem = self.problem.with_positions(clean_m.into_iter().map(&mut noisy).collect());
        let options = SamplerOptions { seed: number, threads: 2, ..SamplerOptions::default() };
        let request = SampleRequest { options, kept_surrogate: None, checkpoint: None, resume: false };
        let found = sample::run(&problem, &request, &SilentMonitor)?;
        let posterior = found.model.posterior();
        let draws = Draws {
            source: "hidden gel".into(),
            names: problem.parameters().iter().map(|spec| spec.name.to_string()).collect(),
            values: found.outcome.draws.subsample(N_DRAWS).iter().map(|point| posterior.natural(point)).collect(),
            other_specimens: Vec::new(),
        };
        let gel = Gel { problem: &problem, draws, is_taught: true, seed };
        let (name, robot, stiffness) = &self.truths[(number % 3) as usize];
        let (kind, history) = force(&mut random);
        let mut scenario = Scenario::of_robot(name, *robot, self.vitreous);
        let record = history.record(DURATION_S, &[])?;
        let ensemble = Ensemble::new(&gel, &scenario, record.clone(), None, &SilentMonitor)?;
        let band = quantiles_um(&ensemble.trajectories_m(0..N_DRAWS)?);
        let truth_m = self.moved_m(stiffness, &truth, &record)?;
        let is_inside = |row: usize| (band.q05[row]..=band.q95[row]).contains(&(1e6 * truth_m[row]));
        let rows = 1..record.n_rows();
        let n_rows = rows.len() as f64;
        let share_covered = rows.clone().filter(|row| is_inside(*row)).count() as f64 / n_rows;
        // A target that about two thirds of the largest force reach.
        let largest_force_n = 4.6e-6;
        scenario.robot = if number.is_multiple_of(2) { *robot } else { self.robot };
        let stiffness = if number.is_multiple_of(2) { stiffness } else { &self.data };
        let push = ForceHistory::Steps(vec![[0.0, 0.65 * largest_force_n]]).record(WITHIN_S, &[])?;
        let reached = Ensemble::new(&gel, &scenario, push, None, &SilentMonitor)?.trajectories_m(0..1)?;
        let reach_m = reached[0][reached[0].len() - 1];
        let target = Target {
            reach_m,
            within_s: WITHIN_S,
            probability: PROBABILITY,
            largest_force_n,
            slew_n_per_s: None,
            largest_strain: None,
            rest: None,
        };
        let planned = plan(&gel, &scenario, &target, None, &SilentMonitor)?;
        let steps: Vec<[f64; 2]> = planned.steps.iter().map(|step| [step.time_s, 1e-6 * step.force_un]).collect();
        let record = ForceHistory::Steps(steps).record(WITHIN_S, &[])?;
        let pushed_m = self.moved_m(stiffness, &truth, &record)?;
        Ok(Case {
            robot: (*name).into(),
            force: kind,
            converged: found.summary.converged,
            end_is_covered: is_inside(band.q05.len() - 1),
            share_covered,
            promised: planned.promised,
            checked: planned.checked,
            truth_arrives: time_to_reach_s(&record, &pushed_m, reach_m) <= WITHIN_S,
        })
    }
}

fn main() -> Result<()> {
    let (mut count, mut first, mut seed, mut json) = (4, 0, 1, None::<PathBuf>);
    let mut arguments = std::env::args().skip(1);
    while let Some(option) = arguments.next() {
        let value = arguments.next().unwrap_or_default();
        let number = || {
            value.parse::<u64>().map_err(|_| {
                let place = InputPlace::default().at_key("hidden_predictions");
                Error::input(place, format!("{option} {value}"), "give --count, --first or --seed with a number")
            })
        };
        match option.as_str() {
            "--json" => json = Some(PathBuf::from(&value)),
            "--count" => count = number()?,
            "--first" => first = number()?,
            "--seed" => seed = number()?,
            _ => {
                let found = format!("`{option}` is not an option of this program");
                let place = InputPlace::default().at_key("hidden_predictions");
                return Err(Error::input(place, found, "give --count, --first, --seed or --json"));
            }
        }
    }
    let bench = Bench::new()?;
    let mut cases = Vec::new();
    for number in first..first + count {
        let case = bench.case(number, seed)?;
        println!(
            "{number}: {}, {}: end covered {}, {:.2} of the times; plan promised {:.3}, checked {:.3}, truth arrives {}",
            case.robot,
            case.force,
            case.end_is_covered,
            case.share_covered,
            case.promised,
            case.checked,
            case.truth_arrives
        );
        cases.push(case);
    }
    if let Some(path) = json {
        write_json_atomically(&path, &cases)?;
    }
    Ok(())
}
