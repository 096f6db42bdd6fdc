//! Reduced models of each apparatus for all effects of the library, built once. They depend on sizes, not on the record (physics §3.3).

use std::collections::BTreeMap;
use std::sync::Arc;

use crate::apparatus::compliance_key;
use crate::cohort::Measurement;
use base::error::Result;
use criticism::Subject;
use models::effects::Library;
use models::model::Compliance;
use posterior::mechanics::Mechanics;
use posterior::monitor::{Counter, Monitor, SilentMonitor};
use posterior::prepared::PreparedModel;
use posterior::problem::Problem;

/// Reduced models of all apparatus in a cohort.
pub struct Apparatuses {
    library: Library,
    known: BTreeMap<String, (Arc<Mechanics>, Compliance)>,
}

impl Apparatuses {
    /// Meshes each apparatus and builds its reduced models. One apparatus is built after another, because each build uses all threads.
    ///
    /// # Errors
    /// Errors of meshing, assembly or the models.
    pub fn of(measurements: &[Measurement], monitor: &dyn Monitor) -> Result<Self> {
        let library = Library::default();
        let mut first: BTreeMap<String, &Measurement> = BTreeMap::new();
        for measurement in measurements {
            first.entry(compliance_key(measurement, &library)).or_insert(measurement);
        }
        let counter = Counter::new(monitor, first.len());
        let mut known = BTreeMap::new();
        for (key, measurement) in first {
            let built = || -> Result<(Arc<Mechanics>, Compliance)> {
                let problem = Problem::new(
                    measurement.experiment.clone(),
                    measurement.specification.clone(),
                    None,
                    &SilentMonitor,
                )?;
                let compliance =
                    PreparedModel::for_effects(&problem, &library, library.effects(), None, monitor)?.compliance;
                Ok((problem.mechanics.clone(), compliance))
            };
            known.insert(key, built().map_err(|error| measurement.with_name(error))?);
            counter.add_one();
        }
        Ok(Self { library, known })
    }

    /// Prepares a record for fitting its model with each effect.
    ///
    /// # Errors
    /// [`base::Error::Input`] if its model does not suit the experiment.
    pub fn subject(&self, measurement: &Measurement) -> Result<Subject> {
        let (mechanics, compliance) = &self.known[&compliance_key(measurement, &self.library)];
        let (experiment, specification) = (measurement.experiment.clone(), measurement.specification.clone());
        let problem = Problem::with_mechanics(experiment, specification, &self.library, mechanics.clone())?;
        Subject::with_compliance(&problem, &self.library, compliance.clone())
    }
}
