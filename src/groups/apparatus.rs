//! Displacement per force of every apparatus, each computed once: for quasi-static linear laws it depends on sizes and the Poisson ratio
//! alone (physics §3.3), and not on what a specimen is made of. Effects that change the field bring their reduced models with it; large displacements are learnt for every record.

use std::collections::BTreeMap;

use rayon::prelude::*;

use super::cohort::Measurement;
use crate::effects::{Field, Library};
use crate::error::Result;
use crate::experiment::Apparatus;
use crate::fe::time::FullOrderModel;
use crate::model::Compliance;
use crate::workflow::problem::Problem;
use crate::workflow::reduced::Reduced;
use crate::workflow::{Counter, Monitor, Silent};

/// The compliance of every measurement.
///
/// # Errors
/// What meshing, assembly or the model refuse.
pub fn compliances(measurements: &[Measurement], monitor: &dyn Monitor) -> Result<Vec<Compliance>> {
    let library = Library::default();
    let key = |own: &Measurement| {
        // Effects may ask for other Poisson ratios, in the range that their priors give them.
        let model =
            if own.specification.effects.is_empty() { String::new() } else { format!("{:?}", own.specification) };
        let effects = own.specification.effects.iter().filter_map(|slug| library.get(slug));
        let is_large = effects.into_iter().any(|effect| matches!(effect.field(), Some(Field::Large)));
        let record = if is_large { own.inputs_sha256.as_str() } else { "" };
        format!("{:?} {model} {record}", own.experiment.apparatus)
    };
    let mut first: BTreeMap<String, &Measurement> = BTreeMap::new();
    for own in measurements {
        first.entry(key(own)).or_insert(own);
    }
    let counter = Counter::new(monitor, first.len());
    let of_apparatus = |(key, own): (&String, &&Measurement)| {
        let compliance = compliance(own).map_err(|error| own.named(error))?;
        counter.add_one();
        Ok((key.clone(), compliance))
    };
    let found: BTreeMap<String, Compliance> = first.par_iter().map(of_apparatus).collect::<Result<_>>()?;
    Ok(measurements.iter().map(|own| found[&key(own)].clone()).collect())
}

fn compliance(measurement: &Measurement) -> Result<Compliance> {
    match &measurement.experiment.apparatus {
        Apparatus::Instrument { compliance_per_m } => return Ok(Compliance::given(*compliance_per_m)),
        Apparatus::Indenter(indenter) => return Ok(Compliance::given(indenter.compliance())),
        Apparatus::Robot { .. } => (),
    }
    let problem = Problem::new(measurement.experiment.clone(), measurement.specification.clone(), None, &Silent)?;
    match problem.finite_elements() {
        Some(fe) if problem.model.field().is_none() && problem.poisson_ratios(fe)? == [fe.poisson_ratio; 2] => {
            Ok(Compliance::given(FullOrderModel::new(&fe.stiffness, fe.poisson_ratio)?.compliance_per_m()))
        }
        _ => Ok(Reduced::unverified(&problem, None, &Silent)?.compliance),
    }
}
