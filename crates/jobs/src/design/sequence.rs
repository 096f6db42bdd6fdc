//! Models of the specimen, and what the records so far say about them.

use std::collections::BTreeMap;
use std::path::PathBuf;

use base::error::{Error, InputPlace, Result};
use criticism::joint_fit::JointFit;
use criticism::protocol::REJECTED_NATS;
use criticism::protocol::design::ln_evidence;
use criticism::{Candidate, Fitted, Subject};
use documents::design::{LaterRecord, ModelStanding};
use documents::diagnosis::{Diagnosis, VerdictKind};
use documents::posterior::{Warning, WarningKind};
use figures::number::format_significant;
use models::effects::Library;
use posterior::check::refuse_contradictions;
use posterior::misfit::NOISE_FACTOR;
use posterior::monitor::Monitor;
use posterior::problem::Problem;
use posterior::study::{DIAGNOSIS_NAME, ModelSpecification, Study};
use record::Experiment;

use crate::last_cycle::read_document;
use crate::simulation_files::apparatus_toml;
use crate::target::{Revision, repeated_rows, report_notes};

/// Class of effects that a diagnosis could not distinguish.
pub struct Class {
    pub problem: Problem,
    pub revision: String,
    claimed: Vec<String>,
    equivalent: Vec<String>,
}

/// Class of equivalent effects in the last diagnosis that has one, from the revision back to the first; `None` without such a diagnosis.
pub fn class(revision: &Revision) -> Result<Option<Class>> {
    let study: &Study = &revision.study;
    let names = study.revisions()?;
    let end = names.iter().position(|name| *name == revision.name).map_or(names.len(), |place| place + 1);
    for name in names[..end].iter().rev() {
        let dir = study.revision_dir(name)?;
        let Some(diagnosis) = read_document::<Diagnosis>(&dir.join(DIAGNOSIS_NAME)) else { continue };
        let verdict = diagnosis.body.verdict;
        if verdict.kind != VerdictKind::Missing || verdict.equivalent.is_empty() {
            continue;
        }
        let specification = ModelSpecification::of_revision(&dir, &Library::default())?;
        let problem = revision.problem.with_model(specification, &Library::default())?;
        return Ok(Some(Class {
            problem,
            revision: name.clone(),
            claimed: verdict.effects,
            equivalent: verdict.equivalent,
        }));
    }
    Ok(None)
}

/// A later record of the specimen, on the same apparatus.
pub struct Later {
    pub experiment: Experiment,
    /// Hashes of its files.
    pub hashes: BTreeMap<String, String>,
}

/// Reads later records.
///
/// # Errors
/// [`Error::Input`] for a record that is given twice, another apparatus or a position with an unknown offset; errors of reading.
pub fn read_later(paths: &[PathBuf], first: &Experiment, monitor: &dyn Monitor) -> Result<Vec<Later>> {
    let read = |path: &PathBuf| {
        let (experiment, files) = Experiment::read(path)?;
        report_notes(&experiment, &files, monitor);
        refuse_contradictions(&experiment, &files.interpretation, monitor)?;
        if experiment.specimen_id != first.specimen_id {
            monitor.warn(&format!(
                "{}: the specimen is `{}`, and the study's is `{}`; both are taken for one",
                path.display(),
                experiment.specimen_id,
                first.specimen_id
            ));
        }
        let refuse = |found: &str, remedy: &str| Err(Error::input(InputPlace::file(path.as_path()), found, remedy));
        // Descriptions are compared, because lengths in mm are rounded when a designed record is described.
        if apparatus_toml(&experiment.apparatus) != apparatus_toml(&first.apparatus)
            || experiment.control != first.control
        {
            return refuse(
                "this record comes from another apparatus than the study's",
                "give records of the same robot and vitreous; `vitreo-uq sample` joins records of others",
            );
        }
        if experiment.fits_position_offset || first.fits_position_offset {
            return refuse(
                "positions with an unknown offset cannot be joined with another record",
                "give records whose position is zero before the first force, or join these by `vitreo-uq sample`",
            );
        }
        Ok(Later { experiment, hashes: Study::hashes_of(&files)? })
    };
    let mut all: Vec<Later> = Vec::new();
    for path in paths {
        let later = read(path)?;
        let earlier = std::iter::once(first).chain(all.iter().map(|later| &later.experiment));
        if earlier.into_iter().any(|earlier| earlier.record == later.experiment.record) {
            return Err(repeated_rows(path));
        }
        all.push(later);
    }
    Ok(all)
}

impl Later {
    /// Hashes of the files of the later record of this number, by names for a header.
    pub fn named_hashes(&self, number: usize) -> impl Iterator<Item = (String, String)> {
        self.hashes.iter().map(move |(name, hash)| (format!("later record {number}: {name}"), hash.clone()))
    }

    /// Subject of this record under the model of the study's own, which has the same apparatus.
    pub fn subject(&self, problem: &Problem, first: &Subject) -> Result<Subject> {
        let library = first.library();
        let problem = problem.with_experiment(self.experiment.clone(), problem.specification.clone(), library)?;
        Subject::with_compliance(&problem, library, first.compliance().clone())
    }
}

/// A model with its fit to all records.
pub struct FittedModel {
    pub candidate: Candidate,
    pub fit: JointFit,
}

impl FittedModel {
    fn of(subjects: &[Subject], candidate: Candidate) -> Result<Self> {
        let fit = JointFit::of(subjects, &candidate)?;
        Ok(Self { candidate, fit })
    }

    /// Model and fit of the study's own record.
    pub fn first(&self) -> (&Candidate, &Fitted) {
        (&self.candidate, &self.fit.records[0])
    }

    pub fn name(&self) -> String {
        self.candidate.effects.join(" + ")
    }
}

/// Fits of the models to all records: the claimed effects, then each equivalent in place of the claimed effect that it replaces best; after later records, the likeliest first.
/// Without a class, the base model.
pub fn models(subjects: &[Subject], class: Option<&Class>) -> Result<Vec<FittedModel>> {
    let with = |effects: &[&str]| FittedModel::of(subjects, subjects[0].extended(effects)?);
    let Some(class) = class else {
        return Ok(vec![FittedModel::of(subjects, subjects[0].base())?]);
    };
    let claimed: Vec<&str> = class.claimed.iter().map(String::as_str).collect();
    let mut list = vec![with(&claimed)?];
    for effect in &class.equivalent {
        let mut best: Option<FittedModel> = None;
        for place in 0..claimed.len() {
            let mut effects = claimed.clone();
            effects[place] = effect;
            // A combination of effects that is not possible is no rival.
            let Ok(found) = with(&effects) else { continue };
            if best.as_ref().is_none_or(|best| found.fit.objective > best.fit.objective) {
                best = Some(found);
            }
        }
        list.extend(best);
    }
    if subjects.len() > 1 {
        list.sort_by(|a, b| b.fit.objective.total_cmp(&a.fit.objective));
    }
    Ok(list)
}

/// Probabilities of the models, all equally probable before the records; empty if the records do not determine the parameters of one.
pub fn standings(models: &[FittedModel]) -> Vec<ModelStanding> {
    let evidence = models.iter().map(|model| ln_evidence(&model.candidate, &model.fit));
    let Ok(evidence) = evidence.collect::<Result<Vec<f64>>>() else { return Vec::new() };
    let largest = evidence.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let sum: f64 = evidence.iter().map(|value| (value - largest).exp()).sum();
    let standing = |(model, value): (&FittedModel, f64)| ModelStanding {
        effects: model.name(),
        trails_by_nats: models[0].fit.objective - model.fit.objective,
        probability: (value - largest).exp() / sum,
    };
    models.iter().zip(evidence).map(standing).collect()
}

/// Removes the models that the records reject, as simulated records do: they trail the first by more than 4 nats. Returns the reason to stop if only one is left.
pub fn keep_possible(models: &mut Vec<FittedModel>) -> Option<String> {
    let best = models[0].fit.objective;
    let is_possible = |model: &FittedModel| best - model.fit.objective <= REJECTED_NATS;
    let rejected: Vec<String> = models.iter().filter(|model| !is_possible(model)).map(FittedModel::name).collect();
    models.retain(is_possible);
    (models.len() == 1 && !rejected.is_empty()).then(|| {
        format!(
            "The records tell the effects apart: {} leads {} by more than {REJECTED_NATS:.0} nats. No further record is needed for this question.",
            models[0].name(),
            rejected.join(", ")
        )
    })
}

/// The later records with the residuals that the first model leaves, and a warning for each that it does not explain.
pub fn judge_later(subjects: &[Subject], model: &FittedModel) -> (Vec<LaterRecord>, Vec<Warning>) {
    let records = subjects.iter().zip(&model.fit.records).skip(1).map(|(subject, fitted)| LaterRecord {
        experiment: subject.experiment().specimen_id.clone(),
        rmse_um: 1e6 * fitted.rmse_m(&subject.fitted_m).unwrap_or(f64::NAN),
        noise_um: subject.noise_um(),
    });
    let records: Vec<LaterRecord> = records.collect();
    let warning = |record: &LaterRecord| {
        let factor = record.rmse_um / record.noise_um?;
        (factor > NOISE_FACTOR).then(|| Warning {
            kind: WarningKind::MisfitAboveNoise,
            text: format!(
                "{}: no model of the class explains this record; the likeliest leaves {} times the noise",
                record.experiment,
                format_significant(factor, 2)
            ),
            advice: "run `vitreo-uq diagnose` on this record: another effect may be present".into(),
        })
    };
    let warnings = records.iter().filter_map(warning).collect();
    (records, warnings)
}
