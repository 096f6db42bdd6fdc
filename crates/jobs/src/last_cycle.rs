//! Posterior of a revision that is fitted to all cycles except the last (formats §4). Every comparison of revisions shows the errors of this posterior.

use base::error::{Error, InputPlace, Result, Setting};
use base::files::{Content, read_if_there};
use documents::errors::ModelErrors;
use documents::posterior::PosteriorSummary;
use models::effects::Library;
use posterior::monitor::Monitor;
use posterior::problem::Problem;
use posterior::sample::{self, SampleRequest};
use posterior::study::{ModelSpecification, POSTERIOR_NAME, Provenance, Study, WithProvenance};
use sampling::SamplerOptions;

use crate::artefacts::{MESH_INPUT, with_inputs};
use crate::first_revision::kept_surrogate;

/// File name of the posterior that is fitted to all cycles except the last. Only revisions whose own posterior is fitted to other cycles have this file.
const LAST_CYCLE_NAME: &str = "last_cycle.json";

/// Revision with its experiment, prepared for comparing revisions: all cycles except the last are fitted, and the last is scored.
pub struct LastCycleFit<'a> {
    study: &'a Study,
    /// Name of the revision.
    pub name: String,
    /// Model of the revision, with the experiment.
    pub problem: Problem,
}

impl<'a> LastCycleFit<'a> {
    /// Prepares the revision called `name`. `of_study` is any model of the study, joined with the experiment; its mesh and matrices are reused.
    ///
    /// # Errors
    /// [`Error::Input`] for a revision that does not exist or uses another mesh.
    pub fn of(study: &'a Study, of_study: &Problem, name: &str) -> Result<Self> {
        let (dir, library) = (study.revision_dir(name)?, Library::default());
        let specification = ModelSpecification::of_revision(&dir, &library)?;
        let problem = of_study.with_experiment(of_study.experiment.for_comparison(), specification, &library)?;
        let last_cycle_fit = Self { study, name: name.into(), problem };
        let mesh_of = |provenance: &Provenance| provenance.inputs_sha256.get(MESH_INPUT).cloned();
        let path = dir.join(POSTERIOR_NAME);
        let there: Option<WithProvenance<PosteriorSummary>> = read_document(&path);
        if there.is_some_and(|document| mesh_of(&document.provenance) != mesh_of(&last_cycle_fit.provenance(0))) {
            return Err(Error::input(
                InputPlace::file(path),
                "this revision uses another mesh",
                format!("name the mesh of the study (`{}`, `{}`)", Setting::Mesh, Setting::MeshUnit),
            ));
        }
        Ok(last_cycle_fit)
    }

    fn provenance(&self, seed: u64) -> Provenance {
        with_inputs(self.study.provenance("posterior", 1, seed), &self.problem)
    }

    /// Returns the revision's posterior, fitted to all cycles except the last. The revision's own posterior is used if it was fitted to these cycles.
    /// Otherwise a posterior that an earlier command stored is used, unless `anew` is set. If neither exists, the posterior is sampled and written into
    /// the revision.
    ///
    /// # Errors
    /// The errors of sampling and writing.
    pub fn posterior(&self, options: &SamplerOptions, anew: bool, monitor: &dyn Monitor) -> Result<PosteriorSummary> {
        let names = if anew { &[POSTERIOR_NAME][..] } else { &[POSTERIOR_NAME, LAST_CYCLE_NAME] };
        if let Some(stored) = self.stored(names, options) {
            return Ok(stored);
        }
        monitor.stage(&format!("{}, fitted to all cycles except the last", self.name));
        let kept_surrogate = kept_surrogate(self.study, monitor);
        let request = SampleRequest { options: options.clone(), kept_surrogate, checkpoint: None, resume: false };
        let body = sample::run(&self.problem, &request, monitor)?.summary;
        if !body.converged {
            monitor.warn(&format!("{}: the draws have not converged, so the errors are uncertain", self.name));
        }
        let document = WithProvenance { provenance: self.provenance(options.seed), body };
        self.study.amend_revision(&self.name)?.publish(LAST_CYCLE_NAME, &document, |_| Ok(()))?;
        Ok(document.body)
    }

    fn stored(&self, names: &[&str], options: &SamplerOptions) -> Option<PosteriorSummary> {
        let (dir, inputs) = (self.study.revision_dir(&self.name).ok()?, self.provenance(0).inputs_sha256);
        let (model, experiment) = (self.problem.specification.summary(), &self.problem.experiment);
        let is_of_this = |document: &WithProvenance<PosteriorSummary>| {
            let (heldout, sampler) = (&document.body.heldout, &document.body.sampler);
            let is_as_long = (sampler.walkers, sampler.ensembles) == (options.n_walkers, options.n_ensembles)
                && sampler.steps >= options.max_steps;
            document.provenance.version == env!("CARGO_PKG_VERSION")
                && document.provenance.inputs_sha256 == inputs
                && document.body.model == model
                && heldout.fitted_cycles == experiment.calibration_cycles
                && heldout.cycles == experiment.heldout_cycles
                && (heldout.log_score_nats.is_some() || heldout.rmse_um.is_none())
                && (document.body.converged || is_as_long)
        };
        let read = |name: &&str| read_document::<PosteriorSummary>(&dir.join(name));
        names.iter().filter_map(read).find(is_of_this).map(|document| document.body)
    }
}

/// Root mean square residuals of a posterior, on its fitted and its held-out cycles.
pub fn errors(posterior: &PosteriorSummary) -> ModelErrors {
    ModelErrors { rmse_fitted_um: posterior.heldout.rmse_fitted_um, rmse_heldout_um: posterior.heldout.rmse_um }
}

/// Reads a JSON document with its provenance; `None` if the file is missing or unreadable. The caller then computes the content again.
pub fn read_document<T: serde::de::DeserializeOwned>(path: &std::path::Path) -> Option<WithProvenance<T>> {
    serde_json::from_slice(&read_if_there(path, Content::Document)?).ok()
}
