//! An experiment and a model joined: what is fitted, by which law, under which priors, with which mechanics.

use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use super::Monitor;
use super::mechanics::{FiniteElements, Mechanics, MeshFile};
use crate::error::{Error, Place, Result};
use crate::experiment::{Apparatus, Experiment};
use crate::inference::likelihood::ReducedPosterior;
use crate::inference::prior::PriorSet;
use crate::mesh::Mesh;
use crate::model::{ReducedForward, SumOfSquares, TrainedRange};
use crate::rheology::BaseLaw;
use crate::study::ModelSpecification;
use crate::surrogate::{Surrogate, Training};

/// Prior mass beyond either end of the surrogate's trained range; the prior is truncated there.
const TAIL_MASS: f64 = 1e-9;
/// Singular values below this fraction of the largest carry no mode.
const POD_TOLERANCE: f64 = 1e-6;

/// An experiment, a model of it, and the mechanics made computable.
pub struct Problem {
    /// What was measured.
    pub experiment: Experiment,
    /// The model.
    pub specification: ModelSpecification,
    /// Its base law.
    pub law: BaseLaw,
    /// Priors of the sampled parameters.
    pub priors: PriorSet,
    /// Finite elements or an instrument.
    pub mechanics: Mechanics,
}

impl Problem {
    /// Checks the model against the experiment and builds the mechanics.
    pub fn new(
        experiment: Experiment,
        specification: ModelSpecification,
        mesh_file: Option<&MeshFile>,
        monitor: &dyn Monitor,
    ) -> Result<Self> {
        let law = BaseLaw::named(&specification.base).ok_or_else(|| {
            let known = BaseLaw::NAMED.map(BaseLaw::name).join(", ");
            Error::input(
                Place::option("--base"),
                format!("`{}` is not a base law", specification.base),
                format!("use one of: {known}"),
            )
        })?;
        let all_priors = PriorSet::read(&specification.prior)?;
        for (name, value) in &specification.fixed {
            let is_known = all_priors.names().any(|known| known == name);
            if !(is_known && *value > 0.0 && value.is_finite()) {
                let names: Vec<&str> = all_priors.names().collect();
                return Err(Error::input(
                    Place::option("--set"),
                    format!("{name} = {value}"),
                    format!("set one of {} to a positive value", names.join(", ")),
                ));
            }
        }
        let fixed: Vec<&str> = specification.fixed.keys().map(String::as_str).collect();
        let priors = all_priors.without(&fixed);
        if matches!(experiment.apparatus, Apparatus::Robot { .. }) {
            monitor.stage("meshing and assembling the finite elements");
        }
        let mechanics = Mechanics::new(&experiment.apparatus, mesh_file)?;
        if let Mechanics::FiniteElements(fe) = &mechanics {
            fe.mesh_warnings.iter().for_each(|w| monitor.warn(&format!("{}; {}", w.text, w.advice)));
        }
        Ok(Self { experiment, specification, law, priors, mechanics })
    }

    /// The finite elements, if there are any.
    pub fn finite_elements(&self) -> Option<&FiniteElements> {
        match &self.mechanics {
            Mechanics::FiniteElements(fe) => Some(fe),
            Mechanics::Instrument { .. } => None,
        }
    }

    /// Ranges of the law's parameters on which a surrogate is trained: the prior's box, or a fixed value.
    pub fn training_ranges(&self) -> Vec<TrainedRange> {
        let boxes = self.priors.box_quantiles(TAIL_MASS);
        let range = |name: &str| {
            let sampled = self.priors.names().position(|n| n == name).map(|i| boxes[i]);
            let (lower, upper) = sampled.unwrap_or_else(|| {
                let value = self.specification.fixed.get(name).copied().unwrap_or(f64::NAN);
                (value, value)
            });
            TrainedRange { name: name.to_string(), lower, upper }
        };
        self.law.parameters().iter().map(|p| range(p.name)).collect()
    }

    /// Positions of some cycles, `None` elsewhere.
    pub fn positions_of(&self, cycles: &[u32]) -> Vec<Option<f64>> {
        let record = &self.experiment.record;
        let pairs = record.position_m.iter().zip(&record.cycle);
        pairs.map(|(position, cycle)| position.filter(|_| cycles.contains(cycle))).collect()
    }

    /// Log-posterior of the calibration cycles by the reduced model.
    pub fn posterior<'a>(&'a self, reduced: &'a Reduced) -> ReducedPosterior<'a> {
        let record = &self.experiment.record;
        let observed = self.positions_of(&self.experiment.calibration_cycles);
        let data = SumOfSquares::new(&record.time_s, &record.force_n, &observed);
        ReducedPosterior::new(
            self.law,
            reduced.compliance_per_m,
            &reduced.trained,
            data,
            &self.priors,
            &self.specification.fixed,
        )
    }

    /// The reduced forward model over the whole record.
    pub fn reduced_forward<'a>(&'a self, reduced: &'a Reduced) -> ReducedForward<'a> {
        ReducedForward {
            compliance_per_m: reduced.compliance_per_m,
            law: self.law,
            time_s: &self.experiment.record.time_s,
            force_n: &self.experiment.record.force_n,
            trained: &reduced.trained,
        }
    }
}

/// The reduced model of a problem.
pub struct Reduced {
    /// The surrogate; `None` for an instrument, whose compliance is given.
    pub surrogate: Option<Surrogate>,
    /// Displacement per force at unit creep compliance, in 1/m.
    pub compliance_per_m: f64,
    /// Ranges in which it may be asked; empty for an instrument.
    pub trained: Vec<TrainedRange>,
}

/// A surrogate as it is kept on disk, with what it was built from.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct KeptSurrogate {
    /// Hash of everything that the surrogate depends on.
    pub built_from_sha256: String,
    /// The surrogate.
    #[serde(flatten)]
    pub surrogate: Surrogate,
}

impl Reduced {
    /// Takes the kept surrogate if it was built from the same input, else trains one.
    pub fn new(problem: &Problem, kept: Option<KeptSurrogate>, monitor: &dyn Monitor) -> Result<Self> {
        let fe = match &problem.mechanics {
            Mechanics::Instrument { compliance_per_m } => {
                return Ok(Self { surrogate: None, compliance_per_m: *compliance_per_m, trained: Vec::new() });
            }
            Mechanics::FiniteElements(fe) => fe,
        };
        let parameters = problem.training_ranges();
        let training = training(problem, fe, &parameters);
        let key = built_from(fe, &training);
        let surrogate = match kept.filter(|kept| kept.built_from_sha256 == key) {
            Some(kept) => {
                monitor.stage("taking the surrogate that is there");
                kept.surrogate
            }
            None => {
                monitor.stage("training the surrogate on full finite-element runs");
                Surrogate::train(&fe.stiffness, &training)?
            }
        };
        let compliance_per_m = surrogate.compliance_per_m(fe.poisson_ratio)?;
        Ok(Self { trained: surrogate.parameters.clone(), surrogate: Some(surrogate), compliance_per_m })
    }

    /// The surrogate with the hash of what it was built from.
    pub fn to_keep(&self, problem: &Problem) -> Option<KeptSurrogate> {
        let (fe, surrogate) = (problem.finite_elements()?, self.surrogate.clone()?);
        let training = training(problem, fe, &self.trained);
        Some(KeptSurrogate { built_from_sha256: built_from(fe, &training), surrogate })
    }
}

/// Training on the load up to the last calibration row: what comes after is left to the held-out check.
fn training<'a>(problem: &'a Problem, fe: &FiniteElements, parameters: &'a [TrainedRange]) -> Training<'a> {
    let Experiment { record, calibration_cycles, .. } = &problem.experiment;
    let n_rows = record.cycle.iter().rposition(|cycle| calibration_cycles.contains(cycle)).map_or(0, |last| last + 1);
    Training {
        law: problem.law,
        parameters,
        poisson_ratio: [fe.poisson_ratio; 2],
        time_s: &record.time_s[..n_rows],
        force_n: &record.force_n[..n_rows],
        tolerance: POD_TOLERANCE,
    }
}

/// SHA-256 over the program's version, the mesh and everything in the training.
fn built_from(fe: &FiniteElements, training: &Training) -> String {
    let mut hash = Sha256::new();
    hash.update(env!("CARGO_PKG_VERSION"));
    hash.update(format!("{:?}", fe.mesh.element_kind));
    fe.mesh.node_coordinates_m.iter().flatten().for_each(|x| hash.update(x.to_le_bytes()));
    let Mesh { connectivity, robot_nodes, outer_nodes, symmetry_y_nodes, symmetry_z_nodes, .. } = &fe.mesh;
    for nodes in [connectivity, robot_nodes, outer_nodes, symmetry_y_nodes, symmetry_z_nodes] {
        hash.update(nodes.len().to_le_bytes());
        nodes.iter().for_each(|n| hash.update(n.to_le_bytes()));
    }
    hash.update(format!("{training:?}"));
    hash.finalize().iter().map(|byte| format!("{byte:02x}")).collect()
}
