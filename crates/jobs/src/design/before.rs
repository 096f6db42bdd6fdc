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
use record::{Experiment, Record};

use super::sequence::FittedModel;
use super::{DesignGoal, DesignRequest, Known, designed, fitted_cycles, refuse_other_records};
use crate::artefacts;
use crate::outcome::Outcome;
use crate::target::{TargetRequest, specification};

/// Name that takes the place of a revision.
const OF_PRIOR: &str = "prior";
/// Range of the positions (m) until the model has predicted them. It scales priors of effects.
const RANGE_M: f64 = 1e-3;

/// True if a path is an experiment in whose table no position is measured yet.
pub fn is_before_measurement(path: &Path) -> bool {
    !Study::is_study(path) && Experiment::read_before_measurement(path).is_ok_and(|read| read.is_some())
}

/// Designs the first record of a specimen. The table of the experiment has the force of a draft, without positions.
///
/// # Errors
/// [`Error::Input`] for an experiment with positions or without a known noise, and for goals that need a record; errors of models and files.
pub fn run_before_measurement(
    target: &TargetRequest,
    request: &DesignRequest,
    monitor: &dyn Monitor,
) -> Result<Outcome<Design>> {
    refuse_needing_a_record(request)?;
    let path = target.paths.first().map_or(Path::new("."), |path| path.as_path());
    let Some((experiment, files)) = Experiment::read_before_measurement(path)? else {
        return Err(Error::input(InputPlace::file(path), "the experiment has positions", "design its next record"));
    };
    refuse_other_records(&experiment)?;
    if experiment.noise_sd_m.is_none() {
        return Err(Error::input(
            InputPlace::file(path.join(&files.toml_name)).at_key("measurement.noise_um"),
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
    let refuse = |setting: Setting, found: &str| {
        let remedy = "design for the parameters now, and for other goals after the first record";
        Err(Error::input(InputPlace::setting(setting), found, remedy))
    };
    if !request.after.is_empty() {
        return refuse(Setting::After, "the experiment has no positions yet, so there is no earlier record");
    }
    if request.scenario.is_some() {
        return refuse(
            Setting::Scenario,
            "a decision needs the posterior of a record, and no position is measured yet",
        );
    }
    match request.goal {
        None | Some(DesignGoal::Parameters) => Ok(()),
        Some(goal) => Err(Error::input(
            InputPlace::default().at_key("goal"),
            format!("the goal `{}` needs a record, and no position is measured yet", goal.name()),
            "design for the parameters now, and for other goals after the first record",
        )),
    }
}

/// The experiment with positions (m) in all rows.
fn with_positions(experiment: &Experiment, position_m: &[f64]) -> Experiment {
    let position_m = position_m.iter().copied().map(Some).collect();
    Experiment { record: Record { position_m, ..experiment.record.clone() }, ..experiment.clone() }
}
