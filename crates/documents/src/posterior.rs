//! The document of `sample` (formats §5, `vitreo-uq/posterior/1`), and what others share with it.

use laws::rheology::OUTSIDE;
use serde::{Deserialize, Serialize};

use super::trust::{Trust, TrustLevel};

/// Body of `vitreo-uq/posterior/1`. Figures that do not apply (an instrument has no finite elements) are `null`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct PosteriorSummary {
    /// Specimen identifier.
    pub experiment: String,
    /// The model.
    pub model: ModelSummary,
    /// One entry a sampled parameter.
    pub parameters: Vec<ParameterSummary>,
    /// How the draws were made.
    pub sampler: SamplerSummary,
    /// How good the reduced model is.
    pub surrogate: SurrogateSummary,
    /// How the posterior predicts cycles that it has not seen.
    pub heldout: HeldoutSummary,
    /// Where the uncertainty of a predicted position comes from, in µm.
    pub error_budget_um: ErrorBudget,
    /// Largest absolute principal strain at the largest displacement.
    pub largest_strain: Option<f64>,
    /// What large displacements would do to it; `null` where nothing was run.
    pub large_displacement: Option<LargeDisplacement>,
    /// Parameters whose draws crowd at an end of the surrogate's trained range, that is of the prior.
    pub at_edge_of_range: Vec<String>,
    /// Whether the draws have converged.
    pub converged: bool,
    /// How far the result can be trusted, and why.
    #[serde(default)]
    pub trust: Trust,
    /// What the user should know.
    pub warnings: Vec<Warning>,
}

/// What a gel of the posterior's law does whose strains may be large, beside the linear model (physics §7.6).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct LargeDisplacement {
    /// Farthest that the robot comes from its start in the fitted cycles, in its radii.
    pub farthest_radii: f64,
    /// Root mean square of the deviation over the fitted rows, in µm; `null` where it could not be computed.
    pub deviation_rms_um: Option<f64>,
    /// Its largest size, in µm.
    pub deviation_most_um: Option<f64>,
    /// By how much the deviation moves the means of the law's parameters, to first order: those known to a tenth, where the noise is white.
    pub shifts: Vec<ParameterShift>,
}

/// A parameter that is found away from the gel's own.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct ParameterShift {
    /// Name, with unit.
    pub name: String,
    /// What is found less the gel's own, over what is found.
    pub relative: f64,
    /// The same over the posterior's standard deviation.
    pub standard_deviations: f64,
}

/// The model that was fitted.
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
    /// Whether the law is another program's.
    pub fn is_outside(&self) -> bool {
        self.base == OUTSIDE
    }

    /// What the reduced model stands for, and is checked by.
    pub fn full_model(&self) -> &'static str {
        if self.is_outside() { "the other program itself" } else { "full finite elements" }
    }

    /// So many runs of it.
    pub fn full_runs(&self, n: usize) -> String {
        if self.is_outside() {
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
    /// Effective draws for location.
    pub ess_bulk: f64,
    /// Effective draws for the 5 % and 95 % quantiles.
    pub ess_tail: f64,
    /// Rank-normalised split R̂, one chain an ensemble.
    pub rhat: f64,
    /// Monte Carlo standard error of the mean.
    pub mcse_mean: f64,
    /// What the reduced model shifts the mean by, in posterior standard deviations, estimated by importance weights from full
    /// finite elements.
    pub surrogate_bias_sd: Option<f64>,
    /// What the mesh shifts the mean by, in posterior standard deviations, estimated from two meshes.
    pub discretisation_bias_sd: Option<f64>,
}

/// How the draws were made.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct SamplerSummary {
    /// Walkers of one ensemble.
    pub walkers: usize,
    /// Independent ensembles.
    pub ensembles: usize,
    /// Steps of each walker, burn-in included.
    pub steps: u64,
    /// Fraction of proposals accepted.
    pub acceptance: f64,
    /// Longest integrated autocorrelation time, in steps.
    pub autocorrelation_time: f64,
    /// Log-density evaluations.
    pub likelihood_evaluations: u64,
    /// Walkers moved during burn-in because they were left behind.
    pub walkers_reseeded: u64,
}

/// How good the reduced model is.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct SurrogateSummary {
    /// Modes kept.
    pub modes: Option<usize>,
    /// Largest distance from full finite elements on verification runs, relative to the amplitude.
    pub max_relative_error: Option<f64>,
    /// Unknowns of the full-order model.
    pub fe_unknowns: Option<usize>,
    /// Full-order runs that trained it.
    pub snapshot_runs: Option<usize>,
    /// Singular values relative to the largest, as far as they are not rounding.
    pub singular_values: Option<Vec<f64>>,
    /// Largest relative energy-norm distance of verification fields from the modes.
    pub max_projection_error: Option<f64>,
}

/// How the posterior predicts the held-out cycles.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct HeldoutSummary {
    /// The cycles that were fitted.
    pub fitted_cycles: Vec<u32>,
    /// The cycles that were held out.
    pub cycles: Vec<u32>,
    /// Full finite-element runs, one a posterior draw.
    pub fe_runs: Option<usize>,
    /// Posterior mean trajectory against the positions, in µm.
    pub rmse_um: Option<f64>,
    /// The same on the fitted cycles, in µm.
    pub rmse_fitted_um: f64,
    /// The noise that misfits are measured against, in µm.
    pub noise_um: Option<f64>,
    /// Where that noise comes from.
    pub noise_origin: String,
    /// Fraction of positions inside the central 50 % band.
    pub coverage_50: Option<f64>,
    /// Fraction of positions inside the central 90 % band.
    pub coverage_90: Option<f64>,
    /// Range in which the 50 % coverage falls in 99 % of simulated measurements.
    pub coverage_50_expected: Option<[f64; 2]>,
    /// Range in which the 90 % coverage falls in 99 % of simulated measurements.
    pub coverage_90_expected: Option<[f64; 2]>,
    /// Probability, by joint predictive simulation, of a misfit at least as large (the smaller of its largest and its mean square, doubled).
    pub joint_p: Option<f64>,
    /// Mean continuous ranked probability score, in µm.
    pub crps_um: Option<f64>,
    /// ln p(held-out positions | fitted positions), draws averaged, in nats for positions in µm.
    pub log_score_nats: Option<f64>,
    /// Monte Carlo standard error of that.
    pub log_score_mcse_nats: Option<f64>,
    /// Largest distance of the reduced from the full model over all draws and rows, in µm.
    pub surrogate_vs_fe_max_um: Option<f64>,
    /// Pareto k̂ of the importance weights from full finite elements; 0 where all weights are equal.
    pub pareto_k: Option<f64>,
}

/// Where the uncertainty of a predicted position comes from, in µm.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct ErrorBudget {
    /// Learnt noise from row to row, posterior median.
    pub noise: f64,
    /// Largest difference from the next coarser mesh; for an imported mesh around a sphere, from the exact solution.
    pub fe_discretisation: Option<f64>,
    /// Largest difference between reduced and full model.
    pub surrogate: Option<f64>,
    /// Monte Carlo error of the posterior mean trajectory.
    pub monte_carlo: f64,
}

/// Something that the user should know, with advice.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct Warning {
    /// Which.
    pub kind: WarningKind,
    /// What was found.
    pub text: String,
    /// What to do.
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
    /// The sampler had something to say.
    Sampler,
    /// The data do not determine every parameter.
    Undetermined,
    /// The reduced model differs from full finite elements by too much.
    SurrogateInaccurate,
    /// The mesh that the user brought is doubtful.
    Mesh,
    /// The mesh is too coarse for the noise.
    MeshTooCoarse,
    /// The held-out cycles lie outside the joint predictive band.
    HeldoutOutsideBand,
    /// Fitted or held-out misfit is above the known noise.
    MisfitAboveNoise,
    /// The learnt noise is above the known noise.
    LearntNoiseAboveKnown,
    /// Strains are beyond the proven linear range.
    LargeStrain,
    /// Displacements are so large that a gel of the law would deviate from the linear model.
    LargeDisplacement,
    /// Large displacements are part of the model, and their fitted amplitude is that of the geometry.
    LargeDisplacementFitted,
    /// The mesh's error exceeds the noise.
    MeshInaccurate,
    /// The tracker's noise is not known, and the residuals look like noise of the learnt size.
    NoiseUnknown,
    /// The tracker's noise is not known, and the residuals are too few to be tested.
    ResidualsUntested,
    /// The residuals follow a pattern that noise of the fitted kind does not make.
    SystematicResidual,
    /// The learnt noise is far below the known noise.
    LearntNoiseBelowKnown,
    /// The posterior leans against the end of the prior's range.
    EdgeOfRange,
    /// There is no held-out cycle.
    NothingHeldOut,
    /// An effect is estimated not to be there.
    AtNull,
    /// Posterior draws have no model on the whole record.
    DrawsRefused,
    /// The apparatus is an instrument: parts that need finite elements are left out.
    NoFiniteElements,
    /// One specimen is all that was measured of a group.
    GroupOfOne,
    /// Nothing was measured of a group.
    GroupPredicted,
    /// A specimen lies far from its group.
    OutlyingSpecimen,
    /// The positions range farther than the gel.
    ImpossiblePositions,
}

impl WarningKind {
    /// The highest level of trust that a result with this warning can have.
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

    /// Whether the result is not to be trusted as it stands (exit code 1).
    pub fn is_fatal(self) -> bool {
        self.level() == TrustLevel::Untrusted
    }
}

impl PosteriorSummary {
    /// Whether the result is sound (exit code 0).
    pub fn is_sound(&self) -> bool {
        self.trust.is_sound()
    }
}
