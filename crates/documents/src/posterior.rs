//! Document of `sample` (formats §5, `vitreo-uq/posterior/1`), with parts that other documents share.

use laws::rheology::EXTERNAL;
use serde::{Deserialize, Serialize};

use super::trust::{Trust, TrustLevel};

/// Reads a diagnostic of the draws, which JSON writes as null where it is undefined.
fn number_or_null<'de, D: serde::Deserializer<'de>>(deserializer: D) -> Result<f64, D::Error> {
    Ok(Option::<f64>::deserialize(deserializer)?.unwrap_or(f64::NAN))
}

/// Result of `sample`: body of the JSON document `vitreo-uq/posterior/1`. Figures that do not apply are `null`, such as those of finite elements for an
/// instrument.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct PosteriorSummary {
    /// Specimen identifier.
    pub experiment: String,
    /// The sampled model.
    pub model: ModelSummary,
    /// Posteriors of all sampled parameters.
    pub parameters: Vec<ParameterSummary>,
    /// Statistics of the sampler.
    pub sampler: SamplerSummary,
    /// Accuracy of the surrogate that replaces the full-order model in the likelihood.
    pub surrogate: SurrogateSummary,
    /// Prediction of the held-out cycles.
    pub heldout: HeldoutSummary,
    /// Error budget of a predicted position: sizes of its sources of error, in µm.
    pub error_budget_um: ErrorBudget,
    /// Largest absolute principal strain of the gel at the largest displacement.
    pub largest_strain: Option<f64>,
    /// Effect of large displacements on positions and parameters; `null` if it was not simulated.
    pub large_displacement: Option<LargeDisplacement>,
    /// Parameters whose draws accumulate at an end of the prior. The surrogate is trained for the prior's range only.
    pub at_edge_of_range: Vec<String>,
    /// True if the draws have converged.
    pub converged: bool,
    /// Trust in the result, with the reason.
    #[serde(default)]
    pub trust: Trust,
    /// Warnings about the result, for the user.
    pub warnings: Vec<Warning>,
}

/// Difference between a gel with large strains and the linear model, computed for parameters of the posterior (physics §7.6).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct LargeDisplacement {
    /// Largest distance of the robot from its starting point in the fitted cycles, divided by the robot's radius.
    pub farthest_radii: f64,
    /// Root mean square difference of the positions from the linear model over the fitted rows, in µm; `null` if it could not be computed.
    pub deviation_rms_um: Option<f64>,
    /// Largest absolute difference of the positions from the linear model, in µm; `null` if it could not be computed.
    pub deviation_most_um: Option<f64>,
    /// First-order biases of the law's parameters by the difference, if the noise is white. The list contains only parameters that are known to within a tenth.
    pub shifts: Vec<ParameterShift>,
}

/// Bias of an estimated parameter, because the linear model neglects large displacements.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct ParameterShift {
    /// Name of the parameter, with its unit.
    pub name: String,
    /// Estimate minus the gel's true value, divided by the estimate.
    pub relative: f64,
    /// Estimate minus the gel's true value, divided by the posterior standard deviation.
    pub standard_deviations: f64,
}

/// A model: its law, effects and noise terms.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct ModelSummary {
    /// Name of the law.
    pub base: String,
    /// Names of the effects.
    pub effects: Vec<String>,
    /// Names of the noise terms.
    pub noise: Vec<String>,
}

impl ModelSummary {
    /// True if another program computes the response of the law.
    pub fn is_external(&self) -> bool {
        self.base == EXTERNAL
    }

    /// Name, for people, of the model that the surrogate replaces and is tested against.
    pub fn full_model(&self) -> &'static str {
        if self.is_external() { "the other program itself" } else { "full finite elements" }
    }

    /// Text for people: `n` runs of the full-order model, or `n` responses of the other program.
    pub fn full_runs(&self, n: usize) -> String {
        if self.is_external() {
            format!("{n} responses of the other program")
        } else {
            format!("{n} full finite-element runs")
        }
    }
}

/// Posterior of one parameter, in the unit of its name.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct ParameterSummary {
    /// Name of the parameter, with its unit.
    pub name: String,
    /// Posterior mean.
    pub mean: f64,
    /// Posterior standard deviation.
    pub sd: f64,
    /// 5 % quantile of the posterior.
    pub q05: f64,
    /// Posterior median.
    pub median: f64,
    /// 95 % quantile of the posterior.
    pub q95: f64,
    /// Effective sample size for the centre of the posterior.
    #[serde(deserialize_with = "number_or_null")]
    #[cfg_attr(feature = "schemas", schemars(with = "Option<f64>"))]
    pub ess_bulk: f64,
    /// Effective sample size for the tails of the posterior: the smaller one of the 5 % and the 95 % quantile.
    #[serde(deserialize_with = "number_or_null")]
    #[cfg_attr(feature = "schemas", schemars(with = "Option<f64>"))]
    pub ess_tail: f64,
    /// Convergence diagnostic R̂, rank-normalised and split, with each ensemble as one chain; 1 if the ensembles agree perfectly.
    #[serde(deserialize_with = "number_or_null")]
    #[cfg_attr(feature = "schemas", schemars(with = "Option<f64>"))]
    pub rhat: f64,
    /// Monte Carlo standard error of the posterior mean.
    #[serde(deserialize_with = "number_or_null")]
    #[cfg_attr(feature = "schemas", schemars(with = "Option<f64>"))]
    pub mcse_mean: f64,
    /// Shift of the posterior mean by the surrogate's error, in posterior standard deviations, estimated by importance weights from the full-order model.
    pub surrogate_bias_sd: Option<f64>,
    /// Shift of the posterior mean by the mesh's error, in posterior standard deviations, estimated from two meshes.
    pub discretisation_bias_sd: Option<f64>,
}

/// Settings and statistics of the ensemble sampler.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct SamplerSummary {
    /// Number of walkers in each ensemble.
    pub walkers: usize,
    /// Number of independent ensembles.
    pub ensembles: usize,
    /// Number of steps of each walker, including burn-in.
    pub steps: u64,
    /// Fraction of proposals that the sampler accepted.
    pub acceptance: f64,
    /// Longest integrated autocorrelation time of a parameter, in steps.
    #[serde(deserialize_with = "number_or_null")]
    #[cfg_attr(feature = "schemas", schemars(with = "Option<f64>"))]
    pub autocorrelation_time: f64,
    /// Number of evaluations of the log density.
    pub likelihood_evaluations: u64,
    /// Number of walkers that were moved during burn-in because they were stuck.
    pub walkers_reseeded: u64,
}

/// Size and accuracy of the surrogate that replaces the full-order model.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct SurrogateSummary {
    /// Number of modes (displacement fields) that the surrogate combines.
    pub modes: Option<usize>,
    /// Largest distance of the surrogate from the full-order model in the verification runs, relative to the amplitude.
    pub max_relative_error: Option<f64>,
    /// Number of unknowns of the full-order model.
    pub fe_unknowns: Option<usize>,
    /// Number of runs of the full-order model from which the surrogate was built.
    pub snapshot_runs: Option<usize>,
    /// Singular values of the snapshots, divided by the largest, down to rounding error.
    pub singular_values: Option<Vec<f64>>,
    /// Largest relative distance, in the energy norm, of a displacement field of the verification runs from the span of the surrogate's modes.
    pub max_projection_error: Option<f64>,
}

/// Prediction of the held-out cycles by the posterior.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct HeldoutSummary {
    /// Cycles that the model was fitted to.
    pub fitted_cycles: Vec<u32>,
    /// Cycles that the fit did not use.
    pub cycles: Vec<u32>,
    /// Number of full-order runs, one for each posterior draw that the prediction uses.
    pub fe_runs: Option<usize>,
    /// Root mean square residual of the held-out positions, predicted by the posterior mean trajectory, in µm.
    pub rmse_um: Option<f64>,
    /// Root mean square residual of the fitted positions, predicted by the posterior mean trajectory, in µm.
    pub rmse_fitted_um: f64,
    /// Noise standard deviation that residuals are compared with, in µm; `null` if it is unknown.
    pub noise_um: Option<f64>,
    /// Source of the noise standard deviation, in words.
    pub noise_origin: String,
    /// Fraction of held-out positions inside the central 50 % band of the prediction.
    pub coverage_50: Option<f64>,
    /// Fraction of held-out positions inside the central 90 % band of the prediction.
    pub coverage_90: Option<f64>,
    /// Range of `coverage_50` in 99 % of simulated measurements.
    pub coverage_50_expected: Option<[f64; 2]>,
    /// Range of `coverage_90` in 99 % of simulated measurements.
    pub coverage_90_expected: Option<[f64; 2]>,
    /// Probability of a misfit of the held-out positions at least as large, from simulated measurements. It is twice the smaller p of two statistics: the
    /// largest residual and the mean square residual.
    pub joint_p: Option<f64>,
    /// Continuous ranked probability score of the held-out positions, averaged over rows, in µm.
    pub crps_um: Option<f64>,
    /// Log posterior predictive density of the held-out positions given the fitted ones, in nats for positions in µm.
    pub log_score_nats: Option<f64>,
    /// Monte Carlo standard error of the log score, in nats.
    pub log_score_mcse_nats: Option<f64>,
    /// Largest distance of the surrogate from the full-order model over all posterior draws and rows, in µm.
    pub surrogate_vs_fe_max_um: Option<f64>,
    /// Pareto shape diagnostic k̂ of the importance weights from the surrogate to the full-order model; 0 if all weights are equal.
    pub pareto_k: Option<f64>,
}

/// Error budget of a predicted position: sizes of its sources of error, in µm.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct ErrorBudget {
    /// Posterior median of the standard deviation of the learnt white noise.
    pub noise: f64,
    /// Error due to the mesh: largest difference from the next coarser mesh. For an imported mesh around a sphere, it is the largest difference from the exact
    /// solution.
    pub fe_discretisation: Option<f64>,
    /// Largest difference between the surrogate and the full-order model.
    pub surrogate: Option<f64>,
    /// Monte Carlo error of the posterior mean trajectory, due to the finite number of draws.
    pub monte_carlo: f64,
}

/// A warning to the user, with advice.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct Warning {
    /// Kind of warning, which determines the level of trust.
    pub kind: WarningKind,
    /// Sentence that describes the problem.
    pub text: String,
    /// Advice on how to solve the problem.
    pub advice: String,
}

/// Kinds of warnings.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum WarningKind {
    /// The draws have not converged.
    NotConverged,
    /// The sampler's diagnostics report a problem.
    Sampler,
    /// The data do not determine every parameter.
    Undetermined,
    /// The surrogate differs too much from the full-order model.
    SurrogateInaccurate,
    /// The mesh that the user imported is doubtful.
    Mesh,
    /// The error due to the mesh is large compared with the noise.
    MeshTooCoarse,
    /// The held-out cycles lie outside the joint band of the prediction.
    HeldoutOutsideBand,
    /// The residual of fitted or held-out cycles is above the known noise.
    MisfitAboveNoise,
    /// The learnt noise is above the known noise.
    LearntNoiseAboveKnown,
    /// Strains exceed the range in which the gel is known to be linear.
    LargeStrain,
    /// Displacements are so large that a gel of this law would deviate from the linear model.
    LargeDisplacement,
    /// Large displacements are part of the model, and their fitted amplitude agrees with the geometry.
    LargeDisplacementFitted,
    /// The mesh's error exceeds the noise.
    MeshInaccurate,
    /// The tracker's noise is unknown, and the residuals are consistent with noise of the learnt size.
    NoiseUnknown,
    /// The tracker's noise is unknown, and the residuals are too few for a test.
    ResidualsUntested,
    /// The residuals follow a pattern that the fitted kind of noise does not produce.
    SystematicResidual,
    /// The residuals do not exceed the noise, but follow a pattern that noise does not have.
    ResidualPattern,
    /// The learnt noise is far below the known noise.
    LearntNoiseBelowKnown,
    /// The posterior accumulates at an end of the prior's range.
    EdgeOfRange,
    /// The posterior of a parameter of the law lies far from the middle of its prior.
    FarFromPrior,
    /// No cycle is held out.
    NothingHeldOut,
    /// The estimate of an effect is consistent with its null, at which the effect vanishes.
    AtNull,
    /// The model cannot be computed for some posterior draws on the whole record.
    DrawsRefused,
    /// The experiment describes an instrument by its compliance, so that results of finite elements are left out.
    NoFiniteElements,
    /// Only one specimen of a group was measured.
    GroupOfOne,
    /// No specimen of a group was measured. Its parameters are predicted from other groups.
    GroupPredicted,
    /// A specimen lies far from its group.
    OutlyingSpecimen,
    /// The positions range over more than the diameter of the gel, or a spherical tip is pressed deeper than its radius.
    ImpossiblePositions,
    /// A commanded position jumps between two rows, so that the time of the jump is unknown.
    UnknownJump,
    /// A prediction leaves the range of the record that taught the law, or the apparatus of that record.
    Extrapolation,
    /// The model that predicts lacks an effect, or the scenario depends on which of several equivalent effects is true.
    ModelIncomplete,
}

impl WarningKind {
    /// Highest level of trust that a result with this warning can have.
    pub fn level(self) -> TrustLevel {
        use WarningKind::*;
        match self {
            NotConverged
            | EdgeOfRange
            | ImpossiblePositions
            | UnknownJump
            | MeshInaccurate
            | Undetermined
            | SurrogateInaccurate
            | HeldoutOutsideBand
            | MisfitAboveNoise
            | DrawsRefused
            | LearntNoiseAboveKnown
            | ResidualsUntested
            | SystematicResidual => TrustLevel::Untrusted,
            LargeStrain | LargeDisplacement | NoiseUnknown | ResidualPattern | Extrapolation | ModelIncomplete => {
                TrustLevel::Effective
            }
            Sampler
            | Mesh
            | MeshTooCoarse
            | LargeDisplacementFitted
            | LearntNoiseBelowKnown
            | FarFromPrior
            | NothingHeldOut
            | AtNull
            | NoFiniteElements
            | GroupOfOne
            | GroupPredicted
            | OutlyingSpecimen => TrustLevel::Trusted,
        }
    }

    /// True if results with this warning are untrusted (exit code 1).
    pub fn is_fatal(self) -> bool {
        self.level() == TrustLevel::Untrusted
    }
}

impl PosteriorSummary {
    /// True unless the result is untrusted. The program exits with code 0 for such results.
    pub fn is_sound(&self) -> bool {
        self.trust.is_sound()
    }
}
