//! Draws of one experiment's parameters, sampled alone with an interim prior. The draws are stored under the hash of their inputs.

use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use base::sha256::{Hash, hex};
use serde::{Deserialize, Serialize};

use super::cohort::Measurement;
use super::hierarchy::{ExperimentDensity, InterimDraws};
use super::scale::SizeScale;
use base::error::Result;
use base::files::{Content, read_if_there, to_json, write_atomically};
use documents::posterior::{Warning, WarningKind};
use models::effects::Library;
use models::model::{Compliance, Forward};
use posterior::full_check::{mean_trajectory, rmse_m};
use posterior::judgement::Judgement;
use posterior::likelihood::ReducedPosterior;
use posterior::mechanics::Mechanics;
use posterior::misfit::NOISE_FACTOR;
use posterior::monitor::StoppableMonitor;
use posterior::prepared::PreparedModel;
use posterior::prior::Prior;
use posterior::problem::Problem;
use posterior::sample::{SampleRequest, sample};
use posterior::study::{Kept, Provenance, WithProvenance};
use sampling::diagnostics::diagnose;
use sampling::diagnostics::ranks::BlomScores;
use sampling::{LogDensity, SamplerOptions};

/// Number of stored draws per experiment.
const N_DRAWS: usize = 1_000;
/// Number of stored draws from which the mean trajectory is computed and compared with the measurement.
const N_TRAJECTORIES: usize = 32;

/// Largest residual on the held-out cycle that does not count as a misfit, in posterior standard deviations of the prediction.
const LARGEST_PREDICTIVE_SDS: f64 = 3.3;

/// Experiment with its model and the compliance of its apparatus. The compliance replaces the finite elements.
pub struct Specimen {
    /// Model of the experiment, fitted to all cycles except the last held-out cycle, as in comparisons of revisions.
    pub model: PreparedModel,
}

/// Result of sampling an experiment alone with the interim prior, as stored on disk.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct InterimResult {
    /// SHA-256 of all inputs that determine the draws.
    pub built_from_sha256: String,
    /// Names of the sampled parameters, in the order of the coordinates.
    pub parameters: Vec<String>,
    /// Draws in the sampler's coordinates, draw after draw, with one value per parameter.
    pub points: Vec<f64>,
    /// `true` if the sampler converged.
    pub converged: bool,
    /// Smallest effective number of draws of all parameters, before the draws were thinned.
    pub ess: f64,
    /// Root mean square residual on the fitted cycles, in µm, for the mean trajectory of the posterior.
    pub rmse_fitted_um: f64,
    /// Root mean square residual on the held-out cycle, in µm, for the mean trajectory; `None` if no cycle is held out.
    pub rmse_heldout_um: Option<f64>,
    /// Posterior standard deviation of the predicted positions on the held-out cycle: root mean square over the rows, in µm. `None` if no cycle is held
    /// out.
    pub predictive_sd_heldout_um: Option<f64>,
    /// Noise standard deviation with which residuals are compared, in µm; `None` if it is unknown.
    pub noise_um: Option<f64>,
    /// Warnings that the residuals give, by the tests of `sample`.
    pub residual_warnings: Vec<Warning>,
}

impl Specimen {
    /// Joins a measurement with the compliance of its apparatus.
    ///
    /// # Errors
    /// [`base::Error::Input`] if the model does not suit the experiment.
    pub fn new(measurement: &Measurement, compliance: Compliance) -> Result<Self> {
        let mechanics = Arc::new(Mechanics::Instrument { compliance_per_m: compliance.experiment_per_m() });
        let experiment = measurement.experiment.for_comparison();
        let problem =
            Problem::with_mechanics(experiment, measurement.specification.clone(), &Library::default(), mechanics)?;
        let trained = problem.training_ranges();
        Ok(Self { model: PreparedModel::given(&problem, compliance, trained) })
    }

    /// Log posterior density of the experiment alone, with the interim prior.
    pub fn posterior(&self) -> ReducedPosterior<'_> {
        self.model.posterior()
    }

    /// Names of the base law's sampled parameters, which are pooled over the cohort and compared between groups.
    pub fn pooled(&self) -> Vec<&'static str> {
        let law = self.model.problem.model.base().parameters().iter().map(|spec| spec.name);
        law.filter(|name| self.model.problem.priors.get(name).is_some()).collect()
    }

    /// Scale (logarithm or log-odds) on which each pooled parameter varies in the population.
    pub fn scales(&self) -> Vec<SizeScale> {
        self.pooled_parameters().into_iter().map(|pooled_parameter| pooled_parameter.scale).collect()
    }

    /// SHA-256 of all inputs that determine the draws.
    pub fn built_from(&self, inputs_sha256: &str, options: &SamplerOptions) -> String {
        let Problem { specification, priors, .. } = &self.model.problem;
        let compliance = self.model.compliance.experiment_per_m().to_bits();
        let SamplerOptions { n_walkers, max_steps, seed, .. } = options;
        let mut hash = Hash::new();
        hash.update(env!("CARGO_PKG_VERSION"));
        hash.update(inputs_sha256);
        hash.update(format!("{specification:?} {compliance:x} {n_walkers} {max_steps} {seed} {N_DRAWS}"));
        hash.update(priors.text());
        hex(&hash.finalize())
    }

    /// Reads the stored draws of this experiment from `folder`. If there are no draws for these inputs, samples the experiment and stores its draws in
    /// `folder`.
    ///
    /// # Errors
    /// [`base::Error::Interrupted`] if stopped; errors of the sampler and the file system.
    pub fn load_or_sample(
        &self,
        measurement: &Measurement,
        options: &SamplerOptions,
        folder: &Path,
        stop: Option<&AtomicBool>,
    ) -> Result<InterimResult> {
        let built_from_sha256 = self.built_from(&measurement.inputs_sha256, options);
        let file = folder.join(file_name(&measurement.name(), &built_from_sha256));
        if let Some(kept) = self.read_kept(&file, &built_from_sha256) {
            return Ok(kept);
        }
        let interim = self.sample(options, built_from_sha256, stop)?;
        write_atomically(&file, &to_keep(measurement, options, &interim)?)?;
        Ok(interim)
    }

    /// Samples the experiment. Returns name and bytes of the file that [`Specimen::load_or_sample`] would store.
    ///
    /// # Errors
    /// Errors of [`Specimen::load_or_sample`].
    pub fn interim_file(
        &self,
        measurement: &Measurement,
        options: &SamplerOptions,
        stop: Option<&AtomicBool>,
    ) -> Result<(String, Vec<u8>)> {
        let built_from_sha256 = self.built_from(&measurement.inputs_sha256, options);
        let name = file_name(&measurement.name(), &built_from_sha256);
        let interim = self.sample(options, built_from_sha256, stop)?;
        Ok((name, to_keep(measurement, options, &interim)?))
    }

    /// Reads stored draws; `None` if the file cannot be read, was changed or is for other inputs.
    fn read_kept(&self, file: &Path, built_from_sha256: &str) -> Option<InterimResult> {
        let bytes = read_if_there(file, Content::Document)?;
        let document: WithProvenance<Kept<InterimResult>> = serde_json::from_slice(&bytes).ok()?;
        let n = self.model.problem.priors.priors().len();
        let is_ours = |kept: &InterimResult| {
            kept.built_from_sha256 == built_from_sha256
                && kept.parameters.iter().map(String::as_str).eq(self.model.problem.priors.names())
                && !kept.points.is_empty()
                && n > 0
                && kept.points.len().is_multiple_of(n)
        };
        document.body.unchanged().filter(is_ours)
    }

    fn sample(
        &self,
        options: &SamplerOptions,
        built_from_sha256: String,
        stop: Option<&AtomicBool>,
    ) -> Result<InterimResult> {
        let posterior = self.posterior();
        let request = SampleRequest { options: options.clone(), kept_surrogate: None, checkpoint: None, resume: false };
        let outcome = sample(&self.model, &posterior, &request, &StoppableMonitor(stop))?;
        let draws = &outcome.draws;
        let blom = BlomScores::new(draws.len());
        let of_parameter = |d: usize| diagnose(&draws.column(d), &blom);
        let diagnostics: Vec<_> = (0..draws.dimension).map(of_parameter).collect();
        let ess = diagnostics
            .iter()
            .map(|diagnostic| diagnostic.ess_bulk.min(diagnostic.ess_tail))
            .fold(f64::INFINITY, f64::min);
        let points = draws.subsample(N_DRAWS);
        let forward = self.model.forward();
        let n_of_model = self.model.problem.model.parameters().len();
        let of_point = |point: &Vec<f64>| {
            let natural = posterior.natural(point);
            Some((forward.trajectory_m(&natural[..n_of_model]).ok()?, natural[n_of_model..].to_vec()))
        };
        let chosen = points.iter().step_by(points.len().div_ceil(N_TRAJECTORIES).max(1));
        let (trajectories, noise): (Vec<Vec<f64>>, Vec<Vec<f64>>) = chosen.filter_map(of_point).unzip();
        let mean_m = mean_trajectory(&trajectories, None);
        let misfit_um = |cycles: &[u32]| {
            let observed = self.model.problem.positions_of(cycles);
            (!trajectories.is_empty() && observed.iter().any(Option::is_some)).then(|| {
                let about_mean = about(&mean_m, &observed);
                let squares = trajectories.iter().map(|trajectory| rmse_m(trajectory, &about_mean).powi(2));
                let spread_m = (squares.sum::<f64>() / trajectories.len() as f64).sqrt();
                [rmse_m(&mean_m, &observed), spread_m].map(|m| 1e6 * m)
            })
        };
        let experiment = &self.model.problem.experiment;
        let heldout_um = misfit_um(&experiment.heldout_cycles);
        let residual_warnings = if trajectories.is_empty() {
            Vec::new()
        } else {
            let spread_um = heldout_um.map_or(0.0, |[_, spread]| spread);
            self.residual_warnings(&trajectories, &noise, 1e-6 * spread_um)
        };
        Ok(InterimResult {
            built_from_sha256,
            parameters: self.model.problem.priors.names().map(String::from).collect(),
            points: points.concat(),
            converged: outcome.converged,
            ess,
            rmse_fitted_um: misfit_um(&experiment.calibration_cycles).map_or(f64::NAN, |[rmse, _]| rmse),
            rmse_heldout_um: heldout_um.map(|[rmse, _]| rmse),
            predictive_sd_heldout_um: heldout_um.map(|[_, spread]| spread),
            noise_um: experiment.reference_noise().map(|yardstick| 1e6 * yardstick.sd_m),
            residual_warnings,
        })
    }

    /// Warnings that the residuals give, by the tests of `sample`: without its joint band, but a misfit of the held-out cycles must exceed the spread of the prediction, too: its standard
    /// deviation is `spread_m`.
    fn residual_warnings(&self, trajectories_m: &[Vec<f64>], noise: &[Vec<f64>], spread_m: f64) -> Vec<Warning> {
        let experiment = &self.model.problem.experiment;
        let judgement =
            Judgement::of_draws(&self.model.problem, (trajectories_m, noise), None, experiment.reference_noise());
        let is_covered = judgement.misfit.is_some_and(|misfit| {
            let most_m = (NOISE_FACTOR * misfit.noise_m).hypot(LARGEST_PREDICTIVE_SDS * spread_m);
            !misfit.fitted.is_too_large && misfit.heldout.is_some_and(|heldout| heldout.rms_m <= most_m)
        });
        let is_wanted = |warning: &Warning| match warning.kind {
            // `groups` says so of all experiments together.
            WarningKind::NoiseUnknown | WarningKind::ResidualsUntested => false,
            WarningKind::MisfitAboveNoise => !is_covered,
            _ => true,
        };
        let wanted = judgement.warnings().into_iter().filter(is_wanted);
        let Some(quantities) = experiment.quantities() else { return wanted.collect() };
        let translated = |text: String| quantities.translate(&text).into_owned();
        wanted
            .map(|warning| Warning { text: translated(warning.text), advice: translated(warning.advice), ..warning })
            .collect()
    }

    /// Converts stored draws to the coordinates of the population (logarithms or log-odds), for the hierarchy.
    pub fn draws(&self, interim: &InterimResult) -> InterimDraws {
        let pooled = self.pooled_parameters();
        let mut coordinates = Vec::new();
        let mut log_prior = Vec::new();
        for point in interim.points.chunks_exact(interim.parameters.len().max(1)) {
            let mut sum = 0.0;
            for entry in &pooled {
                let value = entry.prior.distribution.from_unconstrained(point[entry.place]);
                let coordinate = entry.scale.coordinate(value);
                coordinates.push(coordinate);
                sum += entry.ln_prior_of_coordinate(coordinate);
            }
            log_prior.push(sum);
        }
        InterimDraws::new(coordinates, log_prior)
    }

    fn pooled_parameters(&self) -> Vec<Pooled<'_>> {
        let priors = self.model.problem.priors.priors();
        let of_law = self.model.problem.model.base().parameters().iter();
        let pooled = of_law.filter_map(|spec| {
            let place = priors.iter().position(|prior| prior.name == spec.name)?;
            Some(Pooled { place, prior: &priors[place], scale: SizeScale::of(spec.support) })
        });
        pooled.collect()
    }
}

/// Pooled parameter of an experiment: one whose distribution over specimens the population describes.
struct Pooled<'a> {
    /// Index of the parameter among the sampler's coordinates.
    place: usize,
    prior: &'a Prior,
    scale: SizeScale,
}

impl Pooled<'_> {
    /// Logarithm of the interim prior's density over the population's coordinate (logarithm or log-odds) of the parameter.
    fn ln_prior_of_coordinate(&self, coordinate: f64) -> f64 {
        self.prior.distribution.ln_pdf(self.scale.value(coordinate)) + self.scale.ln_slope(coordinate)
    }
}

/// Mean trajectory (m), restricted to the rows with an observed position; `None` at all other rows.
fn about(mean_m: &[f64], observed_m: &[Option<f64>]) -> Vec<Option<f64>> {
    mean_m.iter().zip(observed_m).map(|(mean, observed)| observed.map(|_| *mean)).collect()
}

/// Exact likelihood of an experiment, which the hierarchy can use instead of draws.
pub struct SpecimenDensity<'a> {
    posterior: ReducedPosterior<'a>,
    /// Parameters that are pooled over the cohort. The field `others` holds the indices of the unpooled parameters among the sampler's coordinates.
    pooled: Vec<Pooled<'a>>,
    others: Vec<usize>,
    archive: Vec<Vec<f64>>,
}

impl<'a> SpecimenDensity<'a> {
    /// Makes the exact likelihood of an experiment. The draws in `interim` become the archive, from which Monte Carlo steps are proposed.
    pub fn new(specimen: &'a Specimen, interim: &InterimResult) -> Self {
        let n = interim.parameters.len();
        let pooled = specimen.pooled_parameters();
        let others: Vec<usize> = (0..n).filter(|index| pooled.iter().all(|pooled| pooled.place != *index)).collect();
        let of_draw = |draw: &[f64]| -> Vec<f64> {
            let coordinate = |pooled: &Pooled| {
                pooled.scale.coordinate(pooled.prior.distribution.from_unconstrained(draw[pooled.place]))
            };
            pooled.iter().map(coordinate).chain(others.iter().map(|place| draw[*place])).collect()
        };
        let archive = interim.points.chunks_exact(n.max(1)).map(of_draw).collect();
        Self { posterior: specimen.posterior(), pooled, others, archive }
    }
}

impl ExperimentDensity for SpecimenDensity<'_> {
    fn ln_density(&self, point: &[f64]) -> f64 {
        let mut coordinates = vec![0.0; point.len()];
        let mut ln_priors = 0.0;
        for (Pooled { place, prior, scale }, coordinate) in self.pooled.iter().zip(point) {
            let coordinate_value = prior.distribution.to_unconstrained(scale.value(*coordinate));
            // The range of the interim prior may be narrower than the parameter's support. The model is not evaluated outside this range, so the
            // likelihood there is unknown.
            if !coordinate_value.is_finite() {
                return f64::NEG_INFINITY;
            }
            coordinates[*place] = coordinate_value;
            // The interim prior is taken as a density over the sampler's coordinate, as in the posterior density.
            ln_priors += prior.distribution.ln_pdf_unconstrained(coordinate_value);
        }
        for (place, value) in self.others.iter().zip(&point[self.pooled.len()..]) {
            coordinates[*place] = *value;
        }
        let mut out = [0.0];
        self.posterior.log_density(&coordinates, &mut out);
        if out[0] > f64::NEG_INFINITY { out[0] - ln_priors } else { f64::NEG_INFINITY }
    }

    fn archive(&self) -> &[Vec<f64>] {
        &self.archive
    }
}

fn file_name(name: &str, hash: &str) -> String {
    let short = &hash[..12.min(hash.len())];
    format!("{}-{short}.json", base::files::safe_name(name))
}

fn to_keep(measurement: &Measurement, options: &SamplerOptions, interim: &InterimResult) -> Result<Vec<u8>> {
    let inputs = [(measurement.name(), measurement.inputs_sha256.clone())].into();
    let provenance = Provenance::new("specimen", 1, options.seed, inputs);
    to_json(Path::new(&measurement.name()), &WithProvenance { provenance, body: Kept::new(interim) })
}
