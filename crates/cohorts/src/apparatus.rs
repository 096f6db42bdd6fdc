//! Compliance (displacement per force) of each apparatus, computed once. For quasi-static linear laws it depends only on sizes and Poisson's ratio
//! (physics §3.3), not on the specimen's material. An effect that changes the displacement field adds a reduced model. Some of these models are learnt
//! for each record.

use std::collections::{BTreeMap, BTreeSet};

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::cohort::Measurement;
use base::error::{Error, InputPlace, Result, Setting};
use models::effects::Library;
use models::model::Compliance;
use posterior::cache::{self, ModelInputs};
use posterior::mechanics::MODEL_LEVEL;
use posterior::monitor::{Counter, Monitor, SilentMonitor, WarningMonitor};
use posterior::prepared::PreparedModel;
use posterior::problem::Problem;
use record::Apparatus;

/// Compliance of an apparatus, as stored between commands. It depends on the apparatus alone.
#[derive(Serialize, Deserialize)]
struct KeptCompliance {
    compliance_per_m: f64,
}

/// For each measurement, the index of the first measurement whose compliance has equal inputs, such as the apparatus. The compliance is computed only for
/// this first measurement.
pub fn first_equal_apparatus(measurements: &[Measurement]) -> Vec<usize> {
    let library = Library::default();
    let mut first: BTreeMap<String, usize> = BTreeMap::new();
    measurements
        .iter()
        .enumerate()
        .map(|(index, measurement)| *first.entry(compliance_key(measurement, &library)).or_insert(index))
        .collect()
}

/// Describes all inputs of a measurement's compliance as text: the sizes of the apparatus, and the model with its effects. If an effect is learnt for
/// each record, the record's hash is added.
pub(super) fn compliance_key(measurement: &Measurement, library: &Library) -> String {
    // The model matters only if it has effects, which can need Poisson's ratios other than that of the apparatus.
    let model = if measurement.specification.effects.is_empty() {
        String::new()
    } else {
        format!("{:?}", measurement.specification)
    };
    let effects = measurement.specification.effects.iter().filter_map(|slug| library.get(slug));
    let is_learnt = effects.into_iter().any(|effect| effect.is_learnt_for_record());
    let record = if is_learnt { measurement.inputs_sha256.as_str() } else { "" };
    format!("{:?} {model} {record}", measurement.experiment.apparatus)
}

/// Computes the compliance of each measurement.
///
/// # Errors
/// Errors of meshing, assembly or the model.
pub fn compliances(measurements: &[Measurement], monitor: &dyn Monitor) -> Result<Vec<Compliance>> {
    let first = first_equal_apparatus(measurements);
    let needed: BTreeSet<usize> = first.iter().copied().collect();
    let counter = Counter::new(monitor, needed.len());
    let of_apparatus = |index: &usize| {
        let measurement = &measurements[*index];
        let compliance = compliance(measurement, monitor).map_err(|error| measurement.with_name(error))?;
        counter.add_one();
        Ok((*index, compliance))
    };
    let found: BTreeMap<usize, Compliance> = needed.par_iter().map(of_apparatus).collect::<Result<_>>()?;
    Ok(first.iter().map(|index| found[index].clone()).collect())
}

/// Computes the compliance of one measurement. If a stored compliance cannot be used, `monitor` receives a warning.
///
/// # Errors
/// Errors of [`compliances`].
pub fn compliance(measurement: &Measurement, monitor: &dyn Monitor) -> Result<Compliance> {
    if let Some(law) = measurement.specification.base.outside() {
        return Err(Error::input(
            InputPlace::setting(Setting::Base),
            format!("{} predicts one record at a time, but groups compare built-in laws", law.url()),
            format!("sample each experiment with {}, or group them by another law", Setting::Forward),
        ));
    }
    let apparatus = &measurement.experiment.apparatus;
    match apparatus {
        Apparatus::Instrument { compliance_per_m, .. } => return Ok(Compliance::fixed(*compliance_per_m)),
        Apparatus::Indenter(indenter) => return Ok(Compliance::fixed(indenter.compliance())),
        Apparatus::Robot { .. } => (),
    }
    let built_from = compliance_built_from(apparatus);
    if measurement.specification.effects.is_empty()
        && let Some(kept) = cache::read::<KeptCompliance>(&built_from, monitor)
    {
        return Ok(Compliance::fixed(kept.compliance_per_m));
    }
    let problem =
        Problem::new(measurement.experiment.clone(), measurement.specification.clone(), None, &SilentMonitor)?;
    match problem.finite_elements() {
        Some(fe) if problem.model.field().is_none() && problem.poisson_ratios(fe)? == [fe.poisson_ratio; 2] => {
            let compliance_per_m = fe.compliance_per_m()?;
            cache::write(&built_from, &KeptCompliance { compliance_per_m });
            Ok(Compliance::fixed(compliance_per_m))
        }
        _ => Ok(PreparedModel::unverified(&problem, None, &WarningMonitor(monitor))?.compliance),
    }
}

/// Inputs from which the compliance of an apparatus is computed. Their hash identifies the stored compliance.
fn compliance_built_from(apparatus: &Apparatus) -> ModelInputs {
    ModelInputs::new("compliance").with("mesh level", MODEL_LEVEL).with("apparatus", apparatus)
}

/// Name of the file that stores the compliance of a measurement's apparatus. `None` for instruments and for models with effects, whose compliance is not
/// stored.
pub fn cache_file_name(measurement: &Measurement) -> Option<String> {
    let apparatus = &measurement.experiment.apparatus;
    let is_kept = matches!(apparatus, Apparatus::Robot { .. }) && measurement.specification.effects.is_empty();
    is_kept.then(|| compliance_built_from(apparatus).file_name())
}

/// Name and bytes of the file that stores the compliance of a measurement's apparatus.
///
/// # Errors
/// Errors of [`compliances`].
pub fn cache_file(measurement: &Measurement, monitor: &dyn Monitor) -> Result<(String, Vec<u8>)> {
    let compliance_per_m = compliance(measurement, monitor)?.experiment_per_m();
    cache::file_of(&compliance_built_from(&measurement.experiment.apparatus), &KeptCompliance { compliance_per_m })
}
