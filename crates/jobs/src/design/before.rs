//! Design of a specimen's first record: what is known is the prior.

use std::path::Path;

use base::error::{Error, InputPlace, Result, Setting};
use criticism::Subject;
use criticism::joint_fit::JointFit;
use documents::design::Design;
use models::effects::Library;
use posterior::monitor::Monitor;
use posterior::prepared::PreparedModel;
use posterior::problem::Problem;
use posterior::study::{Provenance, Study};
use record::{Experiment, ExperimentFiles, Record};

use super::sequence::FittedModel;
use super::{DesignGoal, DesignRequest, Known, designed, fitted_cycles, refuse_other_records};
use crate::artefacts;
use crate::outcome::Outcome;
use crate::target::{TargetRequest, specification};

/// Name that takes the place of a revision.
const OF_PRIOR: &str = "prior";
/// Range of the positions (m) until the model has predicted them. It scales priors of effects.
const RANGE_M: f64 = 1e-3;

/// An experiment in whose table no position is measured yet.
pub struct Unmeasured {
    experiment: Experiment,
    files: ExperimentFiles,
}

impl Unmeasured {
    /// Reads a path; `None` for anything else, whose errors its own reader reports.
    pub fn read(path: &Path) -> Option<Self> {
        let read = if Study::is_study(path) { None } else { Experiment::read_before_measurement(path).ok()? };
        read.map(|(experiment, files)| Self { experiment, files })
    }
}

/// Designs the first record of a specimen. The table of the experiment has the force of a draft, without positions.
///
/// # Errors
/// [`Error::Input`] for an experiment without a known noise, and for goals that need a record; errors of models and files.
pub fn run_before_measurement(
    Unmeasured { experiment, files }: Unmeasured,
    target: &TargetRequest,
    request: &DesignRequest,
    monitor: &dyn Monitor,
) -> Result<Outcome<Design>> {
    refuse_needing_a_record(request)?;
    refuse_other_records(&experiment)?;
    if experiment.noise_sd_m.is_none() {
        return Err(Error::input(
            InputPlace::file(&files.toml_name).at_key("measurement.noise_um"),
            "the noise is not given, and there are no positions from which it can be estimated",
            "give the standard deviation of a single position, as in `noise_um = 4.0`",
        ));
    }
    let specification = specification(None, &target.model, None, &experiment)?;
    let n_rows = experiment.record.n_rows();
    let ascending: Vec<f64> = (0..n_rows).map(|row| RANGE_M * row as f64 / n_rows as f64).collect();
    let experiment = with_positions(&experiment, &ascending);
    let problem = Problem::new(experiment, specification, target.model.mesh.as_ref(), monitor)?;
    let compliance = PreparedModel::unverified(&problem, None, monitor)?.compliance;
    let subject = |problem: &Problem| {
        let all = fitted_cycles(&problem.experiment, true);
        Subject::with_compliance(problem, &Library::default(), compliance.clone())?
            .with_specified_noise()
            .with_cycles(&all, &[])
    };
    let draft = subject(&problem)?;
    let expected_m = draft.at_prior(&draft.base())?.position_m;
    let expected = with_positions(&problem.experiment, &expected_m);
    let problem = problem.with_experiment(expected, problem.specification.clone(), &Library::default())?;
    let subject = subject(&problem)?;
    let candidate = subject.base();
    let models = vec![FittedModel { fit: JointFit::before_data(&subject, &candidate)?, candidate }];
    let provenance = Provenance::new("design", 1, request.sampler.seed, Study::hashes_of(&files)?);
    let id = &problem.experiment.specimen_id;
    let known = Known {
        dir: target.out.clone().unwrap_or_else(|| Study::default_dir(&format!("{id}-design"))),
        study: None,
        revision: OF_PRIOR.into(),
        goal: DesignGoal::Parameters,
        provenance: artefacts::with_inputs(provenance, &problem),
        subjects: vec![subject],
        models,
        holds_out: false,
        standings: Vec::new(),
        after: Vec::new(),
        warnings: Vec::new(),
        decided: None,
        asked: None,
    };
    designed(known, request, monitor)
}

fn refuse_needing_a_record(request: &DesignRequest) -> Result<()> {
    let refuse = |place: InputPlace, found: String| {
        Err(Error::input(place, found, "design for the parameters now, and for other goals after the first record"))
    };
    if !request.after.is_empty() {
        let found = "the experiment has no positions yet, so there is no earlier record";
        return refuse(InputPlace::setting(Setting::After), found.into());
    }
    if request.scenario.is_some() {
        let found = "a decision needs the posterior of a record, and no position is measured yet";
        return refuse(InputPlace::setting(Setting::Scenario), found.into());
    }
    match request.goal {
        None | Some(DesignGoal::Parameters) => Ok(()),
        Some(goal) => refuse(
            InputPlace::default().at_key("goal"),
            format!("the goal `{}` needs a record, and no position is measured yet", goal.name()),
        ),
    }
}

/// The experiment with positions (m) in all rows.
fn with_positions(experiment: &Experiment, position_m: &[f64]) -> Experiment {
    let position_m = position_m.iter().copied().map(Some).collect();
    Experiment { record: Record { position_m, ..experiment.record.clone() }, ..experiment.clone() }
}
