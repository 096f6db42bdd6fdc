//! Warnings about a posterior, each with advice.

use super::cache;
use super::judgement::Judgement;
use super::prepared::{SURROGATE_NAME, Verification};
use super::problem::Problem;
use base::distribution::Distribution;
use documents::posterior::{ModelSummary, ParameterSummary, PosteriorSummary, Warning, WarningKind};
use figures::number::format_significant;
use models::effects::Library;
use record::{Apparatus, Experiment, Indenter, Tip};

/// Smallest ratio of known to learnt noise that causes a warning: the measurement cannot be so much more precise than its known noise.
const LOW_NOISE_FACTOR: f64 = 3.0;
/// Largest error of the reduced model without a warning, in noise standard deviations.
const SURROGATE_SHARE: f64 = 0.1;
/// Largest relative error of the reduced model without a warning, in a check at parameter values of the prior. It is relative to the largest displacement at these
/// values, which can be many times the record's.
const SURROGATE_PART: f64 = 0.01;
/// Largest discretisation error without a warning, in noise standard deviations.
const MESH_SHARE: f64 = 0.25;
/// Largest Pareto k̂ (tail index of importance weights) at which the weights can be trusted.
const PARETO_LIMIT: f64 = 0.7;
/// Strain up to which the gel is known to be linear (below 1 %, by the literature).
const LINEAR_STRAIN: f64 = 0.01;
/// Strain up to which records of stress and strain are judged as linear. Fibrous gels stiffen from about a tenth on.
const LINEAR_RECORDED_STRAIN: f64 = 0.1;
/// Strain above which a wrong unit is the only explanation. For comparison, the bead of the paper strains its gel by 2.6.
const IMPOSSIBLE_STRAIN: f64 = 20.0;
/// Advice that precedes all other advice if a strain, a position or a parameter has an implausible value.
const UNITS_FIRST: &str =
    "check the units of force, position and sizes first: implausible values show that one of them is wrong";
/// Depth of a spherical tip over its radius above which the error of Hertz's contact is named: 1 %.
const DEEP_SPHERE: f64 = 0.1;
/// Distance of a posterior median from the middle of the prior, in standard deviations of the prior, from which it is named.
const FAR_FROM_PRIOR: f64 = 4.0;

/// Input of [`warnings`]: results of a sampled posterior.
pub struct WarningInputs<'a> {
    /// Summary of the posterior, whose list of warnings is still empty.
    pub summary: &'a PosteriorSummary,
    /// Judgement of the residuals of the posterior mean.
    pub judgement: &'a Judgement,
    /// Messages of the sampler about its convergence.
    pub sampler_messages: &'a [String],
    /// Warning of [`impossible_positions_warning`], if it applies.
    pub impossible_positions: Option<Warning>,
}

/// Lists all warnings that apply to a posterior, most serious first.
pub fn warnings(findings: &WarningInputs) -> Vec<Warning> {
    let mut list = Vec::new();
    let mut add = |kind, text: String, advice: &str| list.push(Warning { kind, text, advice: advice.into() });
    let summary = findings.summary;
    let heldout = &summary.heldout;
    let messages = findings.sampler_messages.join("; ");
    if let Some(impossible) = &findings.impossible_positions {
        add(impossible.kind, impossible.text.clone(), &impossible.advice);
    }
    if !summary.at_edge_of_range.is_empty() {
        let text = format!(
            "the posterior of {} accumulates at the end of the range that the prior allows",
            summary.at_edge_of_range.join(", ")
        );
        add(
            WarningKind::EdgeOfRange,
            text,
            "check the units of force and position first; if they are right, give a wider prior (--prior generic)",
        );
    }
    let units_first = findings.impossible_positions.is_some()
        || !summary.at_edge_of_range.is_empty()
        || summary.largest_strain.is_some_and(|strain| strain > IMPOSSIBLE_STRAIN);
    if !summary.converged {
        let text = format!("the draws have not converged: {messages}");
        add(WarningKind::NotConverged, text, "give more steps (--steps), or a more informative prior (--prior)");
    } else if !messages.is_empty() {
        add(WarningKind::Sampler, messages, "check the trace plot before you rely on the tails");
    }
    list.extend(findings.judgement.warnings());
    let mut add = |kind, text: String, advice: &str| list.push(Warning { kind, text, advice: advice.into() });
    if let Some(noise) = heldout.noise_um {
        noise_below(summary, noise, &mut add);
    }
    model_error(summary, heldout.noise_um.unwrap_or(summary.error_budget_um.noise), units_first, &mut add);
    if heldout.rmse_um.is_none() {
        let Warning { kind, text, advice } = nothing_held_out_warning();
        add(kind, text, &advice);
    }
    let by_strain = if summary.surrogate.fe_unknowns.is_some() { strain_warning } else { recorded_strain_warning };
    if let Some(warning) = summary.largest_strain.and_then(by_strain) {
        add(warning.kind, warning.text, &warning.advice);
    }
    if summary.surrogate.fe_unknowns.is_none() && !summary.model.is_external() {
        let text = "the compliance of the instrument or indenter is given: finite elements, strain and discretisation error are omitted".to_string();
        add(
            WarningKind::NoFiniteElements,
            text,
            "absolute moduli are only as accurate as `compliance_per_m` or the size of the tip",
        );
    }
    list
}

/// Warning that no cycle is held out, so that no data test the predictions.
pub fn nothing_held_out_warning() -> Warning {
    Warning {
        kind: WarningKind::NothingHeldOut,
        text: "no cycle is held out, so the model's predictions are untested".into(),
        advice: "hold out a cycle in [measurement], or record another one; `cycle_starts_s = [0, 5]` splits a single hold at 5 s, so that its second part is held out".into(),
    }
}

/// Warning about a reduced model whose largest distance from the full-order model (µm) is too large, or whose importance weights cannot be trusted.
pub fn surrogate_warning(
    distance_um: f64,
    pareto_k: Option<f64>,
    noise_um: f64,
    model: &ModelSummary,
) -> Option<Warning> {
    let is_inaccurate = distance_um > SURROGATE_SHARE * noise_um || pareto_k.is_some_and(|k| k > PARETO_LIMIT);
    let weights = pareto_k.map_or(String::new(), |k| format!(", Pareto k {k:.2}"));
    // For a nonlinear law, a narrower prior does not change the reduced model's number of modes and points.
    let advice = if Library::default().any_nonlinear(model.effects.iter().map(String::as_str)) {
        format!(
            "the reduced model of a nonlinear law is accurate to a thousandth of the amplitude: the parameters' errors can exceed their intervals; measure at a \
             smaller amplitude; if the difference is larger, {}",
            rebuild_instructions()
        )
    } else if model.is_external() {
        "narrow the prior, or fix a parameter that the data do not determine: the surrogate of the external program is then more accurate".into()
    } else {
        format!("{}; if that changes nothing, narrow the prior", rebuild_instructions())
    };
    is_inaccurate.then(|| Warning {
        kind: WarningKind::SurrogateInaccurate,
        text: format!(
            "the reduced model differs from {} by up to {} µm (noise {} µm{weights})",
            model.full_model(),
            format_significant(distance_um, 3),
            format_significant(noise_um, 3)
        ),
        advice,
    })
}

/// Warning about a reduced model that differs too much from the full-order runs of a check; `None` if it does not.
pub fn check_warning(check: &Verification) -> Option<Warning> {
    (check.relative_error > SURROGATE_PART).then(|| Warning {
        kind: WarningKind::SurrogateInaccurate,
        text: format!(
            "the reduced model differs from full finite elements of this apparatus by {} % of the amplitude",
            format_significant(100.0 * check.relative_error, 2)
        ),
        advice: rebuild_instructions(),
    })
}

/// Instruction to the user for rebuilding a reduced model.
fn rebuild_instructions() -> String {
    format!(
        "rebuild the reduced model: {}; delete `{SURROGATE_NAME}` in the study's revisions, too",
        cache::cache_instructions()
    )
}

/// Warning about a strain above the range in which the gel is known to be linear (physics §6).
pub fn strain_warning(largest_strain: f64) -> Option<Warning> {
    (largest_strain > LINEAR_STRAIN).then(|| Warning {
        kind: WarningKind::LargeStrain,
        text: format!(
            "the largest strain at the integration points is {} (up to a tenth more at the robot's surface), but the gel is known to be linear \
             only below {LINEAR_STRAIN}",
            figures::number::format_significant(largest_strain, 2)
        ),
        advice: if largest_strain > IMPOSSIBLE_STRAIN {
            "check the units of force, position and sizes first: no gel is strained by twenty times its own length"
        } else {
            "read the parameters as effective values at this amplitude, or repeat with a smaller force"
        }
        .into(),
    })
}

/// Warning about a recorded strain at which many gels are not linear.
pub fn recorded_strain_warning(largest_strain: f64) -> Option<Warning> {
    (largest_strain > LINEAR_RECORDED_STRAIN).then(|| Warning {
        kind: WarningKind::LargeStrain,
        text: format!("the largest strain of the record is {largest_strain:.2}, and many gels are linear only below {LINEAR_RECORDED_STRAIN}"),
        advice: if largest_strain > IMPOSSIBLE_STRAIN {
            "check the units of stress and strain first: no gel is strained by twenty times its own length"
        } else {
            "read the law's parameters as effective values at this amplitude, or repeat with a smaller one: equal parameters show that the gel is linear"
        }
        .into(),
    })
}

/// Adds a warning if the learnt noise is far below the known or estimated `noise` (µm).
fn noise_below(summary: &PosteriorSummary, noise: f64, add: &mut impl FnMut(WarningKind, String, &str)) {
    let learnt = summary.error_budget_um.noise;
    if learnt * LOW_NOISE_FACTOR < noise {
        let text = format!(
            "the learnt noise of {learnt:.2e} µm is far below the noise of {} µm, which is {}",
            format_significant(noise, 3),
            summary.heldout.noise_origin
        );
        add(
            WarningKind::LearntNoiseBelowKnown,
            text,
            "check `noise_um` and the units of the positions; a simulated record without noise has this result, too",
        );
    }
}

/// Adds warnings about errors of the reduced model and of the mesh that are large relative to the noise.
fn model_error(
    summary: &PosteriorSummary,
    noise: f64,
    units_first: bool,
    add: &mut impl FnMut(WarningKind, String, &str),
) {
    let heldout = &summary.heldout;
    let distance_um = heldout.surrogate_vs_fe_max_um.unwrap_or(0.0);
    if let Some(warning) = surrogate_warning(distance_um, heldout.pareto_k, noise, &summary.model) {
        add(warning.kind, warning.text, &warning.advice);
    }
    if heldout.fe_runs.is_some()
        && !summary.model.is_external()
        && let Some(warning) = mesh_warning(summary.error_budget_um.fe_discretisation, noise, units_first)
    {
        add(warning.kind, warning.text, &warning.advice);
    }
}

/// Warning about positions with a range larger than the gel in which the robot moves, or deeper than the model of a spherical tip holds. `offset_m` is the position (m) at which the
/// tip touches, if it is fitted.
pub fn impossible_positions_warning(experiment: &Experiment, offset_m: Option<f64>) -> Option<Warning> {
    let positions_m = experiment.record.position_m.iter().flatten();
    let [lowest, highest] =
        positions_m.fold([f64::INFINITY, f64::NEG_INFINITY], |[lowest, highest], x| [lowest.min(*x), highest.max(*x)]);
    let vitreous = match &experiment.apparatus {
        Apparatus::Robot { vitreous, .. } => vitreous,
        Apparatus::Indenter(Indenter { tip: Tip::Sphere, size: Some(radius_m), .. }) => {
            return deep_sphere_warning((highest - offset_m.unwrap_or(0.0)) / radius_m);
        }
        _ => return None,
    };
    (highest - lowest > vitreous.diameter_m).then(|| Warning {
        kind: WarningKind::ImpossiblePositions,
        text: format!(
            "the positions range over {:.3} mm, but the gel measures only {:.3} mm",
            1e3 * (highest - lowest),
            1e3 * vitreous.diameter_m
        ),
        advice: "check the units first: of the position column (`position_um`, `position_mm`, …) and of the sizes in experiment.toml".into(),
    })
}

/// Warning about a spherical tip that is pressed too deep for Hertz's contact, where the sphere counts as a paraboloid. `depth` is the largest depth over the radius.
/// At the same depth an exact sphere (Sneddon 1965, Int. J. Eng. Sci. 3:47) presses less by the share depth/10, to 1 % of the force up to one radius.
fn deep_sphere_warning(depth: f64) -> Option<Warning> {
    let shown = figures::number::format_significant(depth, 2);
    if depth > 1.0 {
        return Some(Warning {
            kind: WarningKind::ImpossiblePositions,
            text: format!(
                "the tip is pressed in by {shown} of its radii, but the contact of a sphere ends at one radius"
            ),
            advice: "check the unit and the value of the tip's radius, and the unit of the depth".into(),
        });
    }
    (depth > DEEP_SPHERE).then(|| Warning {
        kind: WarningKind::LargeStrain,
        text: format!(
            "the tip is pressed in by {shown} of its radius: Hertz's contact finds moduli about {} % too low",
            figures::number::format_significant(10.0 * depth, 2)
        ),
        advice: "read the parameters as effective values, or press less deep: a tenth of the radius costs 1 %".into(),
    })
}

/// Warning about parameters of the law whose posterior medians lie far from the middle of their priors, which a wrong unit or another gel causes. `None` if there are none.
pub fn far_from_prior(problem: &Problem, parameters: &[ParameterSummary]) -> Option<Warning> {
    let distance = |parameter: &ParameterSummary| {
        let prior = problem.priors.priors().iter().find(|prior| prior.name == parameter.name)?;
        let is_of_law = problem.model.parameters().iter().any(|spec| spec.name == parameter.name);
        let sds = match prior.distribution {
            Distribution::LogNormal { median, log_sd } => (parameter.median / median).ln() / log_sd,
            Distribution::Normal { mean, sd } => (parameter.median - mean) / sd,
            _ => return None,
        };
        let is_far = is_of_law && !parameter.name.contains('.') && sds.abs() > FAR_FROM_PRIOR;
        let side = if sds > 0.0 { "above" } else { "below" };
        is_far.then(|| format!("{} by {} standard deviations {side}", parameter.name, format_significant(sds.abs(), 2)))
    };
    let far: Vec<String> = parameters.iter().filter_map(distance).collect();
    (!far.is_empty()).then(|| Warning {
        kind: WarningKind::FarFromPrior,
        text: format!("the posterior lies far from the middle of the prior: {}", far.join(", ")),
        advice: "check the units of force and position; for a gel of another kind give its prior, or `--prior generic`"
            .into(),
    })
}

/// Warning about a mesh whose error (µm) is unknown or not small relative to the noise (µm). Set `units_first` if a wrong unit is the likelier cause.
pub fn mesh_warning(error_um: Option<f64>, noise_um: f64, units_first: bool) -> Option<Warning> {
    let (kind, text, advice) = match error_um {
        Some(error) if error > noise_um => (
            WarningKind::MeshInaccurate,
            format!(
                "the mesh misplaces the robot by {} µm, more than the noise of {} µm: E, c₁ and c₂ have absorbed this error",
                format_significant(error, 3),
                format_significant(noise_um, 3)
            ),
            "give a finer mesh of 10-node tetrahedra (--mesh), or use the built-in mesh",
        ),
        Some(error) if error > MESH_SHARE * noise_um => (
            WarningKind::MeshTooCoarse,
            format!(
                "the mesh's error of {} µm is not small relative to the noise of {} µm",
                format_significant(error, 3),
                format_significant(noise_um, 3)
            ),
            "give a finer mesh (--mesh)",
        ),
        Some(_) => return None,
        None => (
            WarningKind::MeshTooCoarse,
            "the error of the imported mesh is unknown: there is neither a second mesh nor an exact solution"
                .to_string(),
            "repeat with a mesh of half the element size (--mesh) and compare",
        ),
    };
    let advice = if units_first { format!("{UNITS_FIRST}; then {advice}") } else { advice.into() };
    Some(Warning { kind, text, advice })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::misfit::{Misfit, ResidualSize};
    use crate::systematic::SystematicTest;
    use crate::trust::trust;
    use WarningKind::*;
    use documents::posterior::*;
    use documents::trust::Trust;

    /// Summary that causes no warning, with 4 µm of noise.
    fn sound() -> PosteriorSummary {
        PosteriorSummary {
            experiment: "gel".into(),
            model: ModelSummary { base: "lethersich".into(), effects: vec![], noise: vec!["white".into()] },
            parameters: vec![],
            sampler: SamplerSummary {
                walkers: 32,
                ensembles: 4,
                steps: 1000,
                acceptance: 0.5,
                autocorrelation_time: 2.0,
                likelihood_evaluations: 1,
                walkers_reseeded: 0,
            },
            surrogate: SurrogateSummary {
                modes: Some(1),
                max_relative_error: Some(1e-12),
                fe_unknowns: Some(1000),
                snapshot_runs: Some(16),
                singular_values: Some(vec![1.0]),
                max_projection_error: Some(1e-12),
            },
            heldout: HeldoutSummary {
                fitted_cycles: vec![1],
                cycles: vec![2],
                fe_runs: Some(128),
                rmse_um: Some(4.0),
                rmse_fitted_um: 4.0,
                noise_um: Some(4.0),
                noise_origin: "known".into(),
                coverage_50: Some(0.5),
                coverage_90: Some(0.9),
                coverage_50_expected: Some([0.4, 0.6]),
                coverage_90_expected: Some([0.8, 1.0]),
                joint_p: Some(0.5),
                crps_um: Some(2.3),
                log_score_nats: Some(-560.0),
                log_score_mcse_nats: Some(0.1),
                surrogate_vs_fe_max_um: Some(1e-9),
                pareto_k: Some(0.0),
            },
            error_budget_um: ErrorBudget {
                noise: 4.0,
                fe_discretisation: Some(0.06),
                surrogate: Some(1e-9),
                monte_carlo: 0.05,
            },
            largest_strain: Some(0.001),
            large_displacement: None,
            at_edge_of_range: vec![],
            converged: true,
            trust: Trust::default(),
            warnings: vec![],
        }
    }

    fn judgement_of(summary: &PosteriorSummary) -> Judgement {
        let is_noise_unknown = summary.heldout.noise_um.is_none();
        let white = SystematicTest { p: 0.5, first_autocorrelation: 0.0, runs_score: 0.0 };
        Judgement {
            misfit: Some(misfit_of(summary)).filter(|_| !is_noise_unknown),
            is_noise_unknown,
            exceeded_estimate_m: None,
            systematic: is_noise_unknown.then_some(white),
            pattern: None,
            learnt_noise_m: Some(1e-6 * summary.error_budget_um.noise),
            joint_p: summary.heldout.joint_p,
            has_gain: false,
            unknown_jump: None,
        }
    }

    /// Misfit of a summary's residuals, for white residuals of many rows. A root mean square above 6 µm, 1.5 times the noise of 4 µm, is too large.
    fn misfit_of(summary: &PosteriorSummary) -> Misfit {
        let size = |rms_um: f64| ResidualSize { rms_m: 1e-6 * rms_um, is_too_large: rms_um > 6.0 };
        Misfit {
            fitted: size(summary.heldout.rmse_fitted_um),
            heldout: summary.heldout.rmse_um.map(size),
            noise_m: 4e-6,
            is_known: true,
            implausible_gains: None,
            returning_m: None,
            learnt_degrees: 1e4,
        }
    }

    /// Kinds of warnings after a change of the sound summary, and true if the result still counts as sound.
    fn after(change: impl Fn(&mut PosteriorSummary)) -> (Vec<WarningKind>, bool) {
        let mut summary = sound();
        change(&mut summary);
        let judgement = &judgement_of(&summary);
        summary.warnings = warnings(&WarningInputs {
            summary: &summary,
            judgement,
            sampler_messages: &[],
            impossible_positions: None,
        });
        summary.trust = trust(&summary.warnings);
        (summary.warnings.iter().map(|warning| warning.kind).collect(), summary.is_sound())
    }

    /// Exact contact of a sphere by Sneddon: depth and force by the radius of contact a/R.
    #[test]
    fn a_deep_sphere_is_named_with_the_error_of_its_modulus() {
        for contact in [0.31_f64, 0.45, 0.7, 0.8] {
            let logarithm = ((1.0 + contact) / (1.0 - contact)).ln();
            let depth = 0.5 * contact * logarithm;
            let force = 0.5 * (1.0 + contact * contact) * logarithm - contact;
            let too_low = 1.0 - force / (4.0 / 3.0 * depth.powf(1.5));
            assert!((too_low - 0.1 * depth).abs() < 0.01, "{depth}: {too_low}");
            let warned = deep_sphere_warning(depth).map(|warning| warning.kind);
            let expected = match depth {
                d if d > 1.0 => Some(WarningKind::ImpossiblePositions),
                d if d > DEEP_SPHERE => Some(WarningKind::LargeStrain),
                _ => None,
            };
            assert_eq!(warned, expected, "{depth}");
        }
        assert_eq!(deep_sphere_warning(0.05), None);
        assert!(deep_sphere_warning(0.45).is_some_and(|warning| warning.text.contains("4.5 % too low")));
    }

    /// Checks each rule for a warning (docs/formats.md §4) on both sides of its limit.
    #[test]
    fn every_rule_speaks_on_its_side_of_the_limit_only() {
        let none: (Vec<WarningKind>, bool) = (vec![], true);
        assert_eq!(after(|_| {}), none);
        // The limit of misfit and learnt noise is 6 µm, 1.5 times the known noise of 4 µm.
        assert_eq!(after(|s| s.heldout.rmse_um = Some(5.9)), none);
        assert_eq!(after(|s| s.heldout.rmse_um = Some(6.1)), (vec![MisfitAboveNoise], false));
        assert_eq!(after(|s| s.heldout.rmse_fitted_um = 5.9), none);
        assert_eq!(after(|s| s.heldout.rmse_fitted_um = 6.1), (vec![MisfitAboveNoise], false));
        assert_eq!(after(|s| s.error_budget_um.noise = 5.9), none);
        assert_eq!(after(|s| s.error_budget_um.noise = 6.1), (vec![LearntNoiseAboveKnown], false));
        assert_eq!(after(|s| s.error_budget_um.noise = 1.0), (vec![LearntNoiseBelowKnown], true));
        // The limit of the joint band is a probability of 0.001.
        assert_eq!(after(|s| s.heldout.joint_p = Some(0.0011)), none);
        assert_eq!(after(|s| s.heldout.joint_p = Some(0.0009)), (vec![HeldoutOutsideBand], false));
        // The limits of the reduced model are a tenth of the noise, and k̂ = 0.7.
        assert_eq!(after(|s| s.heldout.surrogate_vs_fe_max_um = Some(0.39)), none);
        assert_eq!(after(|s| s.heldout.surrogate_vs_fe_max_um = Some(0.41)), (vec![SurrogateInaccurate], false));
        let inaccurate = surrogate_warning(0.41, None, 4.0, &sound().model).expect("it is too far");
        assert!(inaccurate.advice.contains(&cache::cache_instructions()), "{inaccurate:?}");
        assert_eq!(after(|s| s.heldout.pareto_k = Some(0.69)), none);
        assert_eq!(after(|s| s.heldout.pareto_k = Some(0.71)), (vec![SurrogateInaccurate], false));
        // The limits of the mesh error are a quarter of the noise, and the noise.
        assert_eq!(after(|s| s.error_budget_um.fe_discretisation = Some(0.9)), none);
        assert_eq!(after(|s| s.error_budget_um.fe_discretisation = Some(1.1)), (vec![MeshTooCoarse], true));
        assert_eq!(after(|s| s.error_budget_um.fe_discretisation = Some(4.1)), (vec![MeshInaccurate], false));
        assert_eq!(after(|s| s.error_budget_um.fe_discretisation = None), (vec![MeshTooCoarse], true));
        assert_eq!(after(|s| s.converged = false), (vec![NotConverged], false));
        assert_eq!(after(|s| s.largest_strain = Some(0.02)), (vec![LargeStrain], true));
        // A model of large displacements gives no strain, although it has finite elements.
        assert_eq!(after(|s| s.largest_strain = None), none);
        assert_eq!(after(|s| s.surrogate.fe_unknowns = None), (vec![NoFiniteElements], true));
        assert_eq!(after(|s| s.at_edge_of_range = vec!["young_modulus_pa".into()]), (vec![EdgeOfRange], false));
        assert_eq!(after(|s| s.heldout.noise_um = None), (vec![NoiseUnknown], true));
        // Without a known noise, the model's own errors are compared with the learnt noise.
        assert_eq!(
            after(|s| (s.heldout.noise_um, s.heldout.pareto_k) = (None, Some(0.9))),
            (vec![NoiseUnknown, SurrogateInaccurate], false)
        );
        assert_eq!(after(|s| (s.heldout.rmse_um, s.heldout.joint_p) = (None, None)), (vec![NothingHeldOut], true));
    }

    /// The warning about a coarse mesh advises a finer mesh. If values are impossible, it first advises a check of the units.
    #[test]
    fn units_come_before_meshes_where_figures_are_impossible() {
        type Change = fn(&mut PosteriorSummary);
        let advice = |change: Change| {
            let mut summary = sound();
            summary.error_budget_um.fe_discretisation = Some(400.0);
            change(&mut summary);
            let all = warnings(&WarningInputs {
                summary: &summary,
                judgement: &judgement_of(&summary),
                sampler_messages: &[],
                impossible_positions: None,
            });
            all.into_iter().find(|warning| warning.kind == MeshInaccurate).expect("a mesh warning").advice
        };
        assert!(advice(|_| {}).starts_with("give a finer mesh"));
        let changes: [Change; 2] =
            [|s| s.at_edge_of_range = vec!["young_modulus_pa".into()], |s| s.largest_strain = Some(30.0)];
        for change in changes {
            let advice = advice(change);
            assert!(advice.starts_with("check the units"), "{advice}");
        }
        assert!(strain_warning(30.0).expect("large").advice.contains("check the units"));
        assert!(strain_warning(2.6).expect("the paper's").advice.starts_with("read the parameters"));
    }

    /// The test multiplies the positions of a 300 µm record by 1000, as if µm had been read as mm.
    #[test]
    fn positions_that_no_gel_allows_are_told_first() {
        let (mut experiment, _) = crate::replica::embedded().expect("embedded");
        assert_eq!(impossible_positions_warning(&experiment, None), None);
        experiment.record.position_m.iter_mut().flatten().for_each(|x| *x *= 1e3);
        let impossible = impossible_positions_warning(&experiment, None).expect("the gel measures 20 mm");
        assert!(impossible.kind.is_fatal() && impossible.advice.starts_with("check the units"));
        let mut summary = sound();
        summary.heldout.rmse_um = Some(4e3);
        let all = warnings(&WarningInputs {
            summary: &summary,
            judgement: &judgement_of(&summary),
            sampler_messages: &[],
            impossible_positions: Some(impossible.clone()),
        });
        assert_eq!((all.len(), &all[0]), (2, &impossible));
    }

    #[test]
    fn a_law_that_is_not_linear_is_not_mended_by_its_prior() {
        let of = |slug: &str| ModelSummary { base: "lethersich".into(), effects: vec![slug.into()], noise: Vec::new() };
        let advice = |slug: &str| surrogate_warning(1.0, None, 4.0, &of(slug)).map(|warning| warning.advice);
        assert!(advice("shear-thinning").is_some_and(|advice| advice.contains("smaller amplitude")));
        assert!(advice("poroelasticity").is_some_and(|advice| advice.contains("narrow the prior")));
    }
}
