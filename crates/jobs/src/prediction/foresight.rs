//! Predictions that follow sliders: an ensemble is prepared once, and then put under other forces and other robots.

use base::error::{Error, InputPlace, Result};
use documents::prediction::PositionQuantiles;
use documents::shapes::{BodyShape, SizeRule};
use models::effects::Library;
use posterior::monitor::SilentMonitor;
use posterior::problem::Problem;
use posterior::study::{ModelSpecification, Study};
use prediction::body::{self, of_equal_size};
use prediction::ensemble::{Ensemble, Gel, quantiles_um};
use prediction::force_history::ForceHistory;
use prediction::quantity::Quantity;
use prediction::scenario::{Scenario, resized};
use record::{Apparatus, Control, Orientation, Robot};
use serde::{Deserialize, Serialize};

use super::gel_source::draws_of_revision;
use crate::first_revision::kept_surrogate;

/// Largest number of draws: enough for smooth bands, and fast enough for a slider.
const MOST_DRAWS: usize = 400;
/// Largest number of times of a curve.
const MOST_TIMES: usize = 240;
/// Seed of nothing: without tolerances no random number is drawn.
const SEED: u64 = 1;

/// Prepared prediction of a revision's robot.
pub struct Foresight {
    ensemble: Ensemble,
    scenario: Scenario,
    /// Accurate compliance of the robot in 1/m; `None` if another robot needs a reduced model of its own.
    reference_per_m: Option<f64>,
    limits: ForesightLimits,
}

/// Ranges of the sliders.
#[derive(Debug, Clone, Serialize)]
pub struct ForesightLimits {
    /// Largest force of the record, in µN.
    pub force_un: f64,
    /// Duration of the record, in s.
    pub duration_s: f64,
    /// Largest displacement of the record, in µm.
    pub distance_um: f64,
    /// True if the size and shape of the robot can be changed.
    pub changes_robot: bool,
}

/// Robot and force that a user asks for: a hold and a rest.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
pub struct ForesightRequest {
    /// Force of the hold, in µN.
    pub force_un: f64,
    /// Duration of the hold, in s.
    pub hold_s: f64,
    /// Duration of the rest after it, in s.
    pub rest_s: f64,
    /// Distance whose time of arrival is asked, in µm; 0 for none.
    pub distance_um: f64,
    /// Size of the robot, relative to the record's.
    pub size: f64,
    /// Length over diameter of an ellipsoid along the force with the robot's volume; 0 for the record's shape.
    pub aspect: f64,
}

/// Predicted motion.
#[derive(Debug, Clone, Serialize)]
pub struct Foreseen {
    /// Times in s.
    pub time_s: Vec<f64>,
    /// Quantiles of the position at each time.
    pub position_um: PositionQuantiles,
    /// Robot and gel in words.
    pub apparatus: String,
    /// Quantities of interest in words.
    pub sentences: Vec<String>,
}

impl Foresight {
    /// Prepares the prediction of a revision.
    ///
    /// # Errors
    /// [`Error::Input`] for records without a robot or under a commanded position; errors of files and models.
    pub fn open(study: &Study, revision: &str) -> Result<Self> {
        let dir = study.revision_dir(revision)?;
        let (experiment, _) = study.read_experiment()?;
        let (Apparatus::Robot { robot, vitreous }, Control::Force) = (experiment.apparatus.clone(), experiment.control)
        else {
            return Err(Error::input(
                InputPlace::file(study.dir()).at_key("robot"),
                "this record is not of a robot that a force moves",
                "predict from a record with [robot] and [vitreous] under a commanded force",
            ));
        };
        let specification = ModelSpecification::of_revision(&dir, &Library::default())?;
        let problem = Problem::new(experiment, specification, None, &SilentMonitor)?;
        let scales = problem.experiment.scales();
        let draws = draws_of_revision(&dir, revision, &problem)?.thinned(MOST_DRAWS);
        let scenario = Scenario::of_robot("robot", robot, vitreous);
        let gel = Gel { problem: &problem, draws, is_taught: true, seed: SEED };
        let record = ForceHistory::Steps(vec![[0.0, scales.largest_force_n]]).record(scales.duration_s, &[])?;
        let kept = kept_surrogate(study, &SilentMonitor);
        let ensemble = Ensemble::new(&gel, &scenario, record, kept, &SilentMonitor)?;
        let reference_per_m = body::compliance_per_m(&robot, &vitreous)
            .map(|(compliance_per_m, _)| compliance_per_m)
            .filter(|_| problem.model.is_law_alone());
        let farthest_m =
            problem.experiment.record.position_m.iter().flatten().fold(0.0_f64, |most, x| most.max(x.abs()));
        let limits = ForesightLimits {
            force_un: 1e6 * scales.largest_force_n,
            duration_s: scales.duration_s,
            distance_um: 1e6 * farthest_m,
            changes_robot: reference_per_m.is_some(),
        };
        Ok(Self { ensemble, scenario, reference_per_m, limits })
    }

    /// Ranges of the sliders.
    pub fn limits(&self) -> &ForesightLimits {
        &self.limits
    }

    /// Predicts the motion under a request.
    ///
    /// # Errors
    /// [`Error::Input`] for a request that cannot be computed.
    pub fn predicted(&self, asked: &ForesightRequest) -> Result<Foreseen> {
        let ForesightRequest { force_un, hold_s, rest_s, distance_um, size, aspect } = *asked;
        let all = [force_un, hold_s, rest_s, distance_um, size, aspect];
        if !all.iter().all(|value| value.is_finite()) || hold_s <= 0.0 || rest_s < 0.0 || size <= 0.0 || force_un == 0.0
        {
            return Err(Error::input(
                InputPlace::default().at_key("prediction"),
                "force, hold and size must differ from 0",
                "move the sliders",
            ));
        }
        let mut scenario = self.scenario.clone();
        scenario.robot = resized(&with_aspect(&scenario.robot, aspect), size, size);
        let force_n = 1e-6 * force_un;
        let changes = if rest_s > 0.0 { vec![[0.0, force_n], [hold_s, 0.0]] } else { vec![[0.0, force_n]] };
        let record = ForceHistory::Steps(changes).record(hold_s + rest_s, &[hold_s])?;
        let under_force = self.ensemble.with_record(record);
        let is_own = scenario.robot == self.scenario.robot;
        let ensemble = match self.reference_per_m.filter(|_| !is_own) {
            None => under_force,
            Some(reference_per_m) => under_force.for_robot(&scenario, reference_per_m).ok_or_else(|| {
                Error::input(
                    InputPlace::default().at_key("robot"),
                    "the compliance of this robot cannot be computed accurately",
                    "choose a size nearer to that of the record's robot",
                )
            })?,
        };
        let trajectories_m = ensemble.trajectories_m(0..ensemble.parameters.len())?;
        let mut quantities = vec![Quantity::PositionAt { at_s: hold_s, at_least_m: None }];
        if distance_um != 0.0 {
            let distance_m = (1e-6 * distance_um).copysign(force_n);
            quantities.push(Quantity::TimeToReach { distance_m, within_s: Some(hold_s) });
        }
        let record = ensemble.record();
        let sentence = |quantity: &Quantity| {
            let value = |x: &Vec<f64>| quantity.value(record, x, ensemble.strain_per_m);
            quantity.summary(&trajectories_m.iter().map(value).collect::<Vec<f64>>(), hold_s + rest_s).sentence
        };
        let every = record.n_rows().div_ceil(MOST_TIMES);
        let rows: Vec<usize> = (0..record.n_rows()).step_by(every).collect();
        let shown: Vec<Vec<f64>> = trajectories_m.iter().map(|x| rows.iter().map(|row| x[*row]).collect()).collect();
        Ok(Foreseen {
            time_s: rows.iter().map(|row| record.time_s[*row]).collect(),
            position_um: quantiles_um(&shown),
            apparatus: scenario.apparatus(),
            sentences: quantities.iter().map(sentence).collect(),
        })
    }
}

/// Ellipsoid along the force with the robot's volume and this ratio of length to diameter; the robot itself for a ratio of 0.
fn with_aspect(robot: &Robot, aspect: f64) -> Robot {
    if aspect <= 0.0 {
        return *robot;
    }
    let form = (BodyShape::Ellipsoid, Orientation::Horizontal);
    Robot { shape: of_equal_size(form, aspect, SizeRule::EqualVolume, &robot.shape), ..*robot }
}
