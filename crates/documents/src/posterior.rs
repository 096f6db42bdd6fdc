//! Document of `sample` (formats §5, `vitreo-uq/posterior/1`), with parts that other documents share.

use laws::rheology::EXTERNAL;
use serde::{Deserialize, Serialize};

use super::trust::{Trust, TrustLevel};

/// Body of `vitreo-uq/posterior/1`. Inapplicable figures are `null`; for example, an instrument has no finite elements.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct PosteriorSummary {
    /// Specimen identifier.
    pub experiment: String,
    /// The model.
    pub model: ModelSummary,
    /// Sampled parameters.
    pub parameters: Vec<ParameterSummary>,
    /// Statistics of the sampler.
    pub sampler: SamplerSummary,
    /// Accuracy of the surrogate.
    pub surrogate: SurrogateSummary,
    /// Prediction of the held-out cycles.
    pub heldout: HeldoutSummary,
    /// Error budget of a predicted position, in µm.
    pub error_budget_um: ErrorBudget,
    /// Largest absolute principal strain at the largest displacement.
    pub largest_strain: Option<f64>,
    /// Influence of large displacements on the result; `null` if it was not simulated.
    pub large_displacement: Option<LargeDisplacement>,
    /// Parameters whose draws accumulate at an end of the prior, which is the surrogate's trained range.
    pub at_edge_of_range: Vec<String>,
    /// True if the draws have converged.
    pub converged: bool,
    /// Trust in the result, with the reason.
    #[serde(default)]
    pub trust: Trust,
    /// Warnings for the user.
    pub warnings: Vec<Warning>,
}

/// Deviation of a gel with large strains from the linear model, under the posterior's law (physics §7.6).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct LargeDisplacement {
    /// Largest distance of the robot from its start in the fitted cycles, in robot radii.
    pub farthest_radii: f64,
    /// Root mean square of the deviation over the fitted rows, in µm; `null` if it could not be computed.
    pub deviation_rms_um: Option<f64>,
    /// Largest absolute deviation, in µm.
    pub deviation_most_um: Option<f64>,
    /// First-order shifts of the law's parameters by the deviation, assuming white noise; only parameters known to within a tenth.
    pub shifts: Vec<ParameterShift>,
}

/// Bias of an estimated parameter against the gel's true value.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct ParameterShift {
    /// Name, with unit.
    pub name: String,
    /// Estimate minus the gel's true value, divided by the estimate.
    pub relative: f64,
    /// Estimate minus the gel's true value, divided by the posterior standard deviation.
    pub standard_deviations: f64,
}

/// The fitted model.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct ModelSummary {
    /// Base law.
    pub base: String,
    /// Effects.
    pub effects: Vec<String>,
    /// Noise terms.
    pub noise: Vec<String>,
}

impl ModelSummary {
    /// True if another program computes the law.
    pub fn is_external(&self) -> bool {
        self.base == EXTERNAL
    }

    /// Name of the model that the surrogate replaces and is tested against.
    pub fn full_model(&self) -> &'static str {
        if self.is_external() { "the other program itself" } else { "full finite elements" }
    }

    /// Text for `n` runs of the full-order model, or of the other program.
    pub fn full_runs(&self, n: usize) -> String {
        if self.is_external() {
            format!("{n} answers of the other program")
        } else {
            format!("{n} full finite-element runs")
        }
    }
}

/// Posterior of one parameter, in the unit of its name.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct ParameterSummary {
    /// Name, with unit.
    pub name: String,
    /// Posterior mean.
    pub mean: f64,
    /// Posterior standard deviation.
    pub sd: f64,
    /// 5 % quantile.
    pub q05: f64,
    /// Median.
    pub median: f64,
    /// 95 % quantile.
    pub q95: f64,
    /// Effective number of draws for the location.
    pub ess_bulk: f64,
    /// Effective number of draws for the 5 % and 95 % quantiles.
    pub ess_tail: f64,
    /// Rank-normalised split R̂, with one chain for each ensemble.
    pub rhat: f64,
    /// Monte Carlo standard error of the mean.
    pub mcse_mean: f64,
    /// Shift of the mean by the surrogate's error, in posterior standard deviations. Importance weights from the full-order model estimate it.
    pub surrogate_bias_sd: Option<f64>,
    /// Shift of the mean by the mesh's error, in posterior standard deviations, estimated from two meshes.
    pub discretisation_bias_sd: Option<f64>,
}

/// Statistics of the sampler.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct SamplerSummary {
    /// Number of walkers in each ensemble.
    pub walkers: usize,
    /// Number of independent ensembles.
    pub ensembles: usize,
    /// Number of steps of each walker, including burn-in.
    pub steps: u64,
    /// Fraction of accepted proposals.
    pub acceptance: f64,
    /// Longest integrated autocorrelation time, in steps.
    pub autocorrelation_time: f64,
    /// Number of evaluations of the log density.
    pub likelihood_evaluations: u64,
    /// Number of walkers that were moved during burn-in because they were stuck.
    pub walkers_reseeded: u64,
}

/// Accuracy of the surrogate.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct SurrogateSummary {
    /// Number of retained modes of the reduced basis.
    pub modes: Option<usize>,
    /// Largest distance from the full-order model in the verification runs, relative to the amplitude.
    pub max_relative_error: Option<f64>,
    /// Number of unknowns of the full-order model.
    pub fe_unknowns: Option<usize>,
    /// Number of full-order training runs.
    pub snapshot_runs: Option<usize>,
    /// Singular values relative to the largest, down to rounding error.
    pub singular_values: Option<Vec<f64>>,
    /// Largest relative energy-norm distance of verification fields from the span of the modes.
    pub max_projection_error: Option<f64>,
}

/// Prediction of the held-out cycles by the posterior.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct HeldoutSummary {
    /// Fitted cycles.
    pub fitted_cycles: Vec<u32>,
    /// Held-out cycles.
    pub cycles: Vec<u32>,
    /// Number of full-order runs, one for each posterior draw used.
    pub fe_runs: Option<usize>,
    /// Root mean square distance of the posterior mean trajectory from the held-out positions, in µm.
    pub rmse_um: Option<f64>,
    /// Root mean square distance of the posterior mean trajectory from the fitted positions, in µm.
    pub rmse_fitted_um: f64,
    /// Noise that residuals are compared with, in µm.
    pub noise_um: Option<f64>,
    /// Source of the noise value.
    pub noise_origin: String,
    /// Fraction of held-out positions inside the central 50 % band.
    pub coverage_50: Option<f64>,
    /// Fraction of held-out positions inside the central 90 % band.
    pub coverage_90: Option<f64>,
    /// Range of the 50 % coverage in 99 % of simulated measurements.
    pub coverage_50_expected: Option<[f64; 2]>,
    /// Range of the 90 % coverage in 99 % of simulated measurements.
    pub coverage_90_expected: Option<[f64; 2]>,
    /// Probability of a misfit at least as large, by joint predictive simulation. It is twice the smaller p of largest and mean square residual.
    pub joint_p: Option<f64>,
    /// Mean continuous ranked probability score, in µm.
    pub crps_um: Option<f64>,
    /// ln p(held-out positions | fitted positions), averaged over draws, in nats for positions in µm.
    pub log_score_nats: Option<f64>,
    /// Monte Carlo standard error of the log score.
    pub log_score_mcse_nats: Option<f64>,
    /// Largest distance of the surrogate from the full-order model over all draws and rows, in µm.
    pub surrogate_vs_fe_max_um: Option<f64>,
    /// Pareto k̂ of the importance weights from the full-order model; 0 if all weights are equal.
    pub pareto_k: Option<f64>,
}

/// Error budget of a predicted position, in µm.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct ErrorBudget {
    /// Learnt noise from row to row, posterior median.
    pub noise: f64,
    /// Largest difference from the next coarser mesh. For an imported mesh around a sphere: largest difference from the exact solution.
    pub fe_discretisation: Option<f64>,
    /// Largest difference between surrogate and full-order model.
    pub surrogate: Option<f64>,
    /// Monte Carlo error of the posterior mean trajectory.
    pub monte_carlo: f64,
}

/// A warning to the user, with advice.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct Warning {
    /// Kind of warning.
    pub kind: WarningKind,
    /// Description of the problem.
    pub text: String,
    /// Advice to the user.
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
    /// The user's imported mesh is doubtful.
    Mesh,
    /// The mesh is too coarse for the noise.
    MeshTooCoarse,
    /// The held-out cycles lie outside the joint predictive band.
    HeldoutOutsideBand,
    /// Fitted or held-out misfit is above the known noise.
    MisfitAboveNoise,
    /// The learnt noise is above the known noise.
    LearntNoiseAboveKnown,
    /// Strains exceed the gel's proven linear range.
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
    /// The learnt noise is far below the known noise.
    LearntNoiseBelowKnown,
    /// The posterior accumulates at an end of the prior's range.
    EdgeOfRange,
    /// No cycle is held out.
    NothingHeldOut,
    /// The estimate of an effect is consistent with its null.
    AtNull,
    /// The model fails for some posterior draws on the whole record.
    DrawsRefused,
    /// The apparatus is an instrument. Parts that need finite elements are left out.
    NoFiniteElements,
    /// Only one specimen of a group was measured.
    GroupOfOne,
    /// No specimen of a group was measured.
    GroupPredicted,
    /// A specimen lies far from its group.
    OutlyingSpecimen,
    /// The positions range over more than the gel's size.
    ImpossiblePositions,
}

impl WarningKind {
    /// Highest level of trust that a result with this warning can have.
    pub fn level(self) -> TrustLevel {
        use WarningKind::*;
        match self {
            NotConverged
            | EdgeOfRange
            | ImpossiblePositions
            | MeshInaccurate
            | Undetermined
            | SurrogateInaccurate
            | HeldoutOutsideBand
            | MisfitAboveNoise
            | DrawsRefused
            | LearntNoiseAboveKnown
            | ResidualsUntested
            | SystematicResidual => TrustLevel::Untrusted,
            LargeStrain | LargeDisplacement | NoiseUnknown => TrustLevel::Effective,
            Sampler
            | Mesh
            | MeshTooCoarse
            | LargeDisplacementFitted
            | LearntNoiseBelowKnown
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
    /// True if the result is sound (exit code 0).
    pub fn is_sound(&self) -> bool {
        self.trust.is_sound()
    }
}
