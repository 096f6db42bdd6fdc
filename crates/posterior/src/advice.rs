//! What a posterior's figures mean, in words, with advice.

use super::cache;
use super::judgement::Judgement;
use super::prepared::{SURROGATE_NAME, Verification};
use documents::posterior::{ModelSummary, PosteriorSummary, Warning, WarningKind};
use figures::number::significant;
use models::effects::Library;
use record::{Apparatus, Experiment};

/// Learnt noise so many times below the known one is not the tracker's.
const LOW_NOISE_FACTOR: f64 = 3.0;
/// Largest tolerated error of the reduced model, in units of the noise.
const SURROGATE_SHARE: f64 = 0.1;
/// The same of a check at points of the prior, in units of the amplitude there, which may be many times the record's.
const SURROGATE_PART: f64 = 0.01;
/// Largest tolerated discretisation error, in units of the noise.
const MESH_SHARE: f64 = 0.25;
/// Above this, importance weights cannot be trusted.
const PARETO_LIMIT: f64 = 0.7;
/// Strain up to which the gel is known to be linear (`literature`: below 1 %).
const LINEAR_STRAIN: f64 = 0.01;
/// A gel that is strained so many times its own length is no gel: a unit is wrong. The paper's bead strains its gel by 2.6.
const IMPOSSIBLE_STRAIN: f64 = 20.0;
/// What comes before any other advice where figures are impossible.
const UNITS_FIRST: &str =
    "check the units of force, position and sizes first: other figures say that one of them is wrong";

/// What advice is drawn from.
pub struct Findings<'a> {
    /// The summary without its warnings.
    pub summary: &'a PosteriorSummary,
    /// What the posterior's mean leaves, judged.
    pub judgement: &'a Judgement,
    /// What the sampler said of itself.
    pub sampler_messages: &'a [String],
    /// Positions that cannot be.
    pub impossible_positions: Option<Warning>,
}

/// All warnings that apply, gravest first.
pub fn warnings(findings: &Findings) -> Vec<Warning> {
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
            "the posterior of {} leans against the end of the range that the prior allows",
            summary.at_edge_of_range.join(", ")
        );
        add(
            WarningKind::EdgeOfRange,
            text,
            "check the units of force and position first; where they are right, give a wider prior (--prior generic)",
        );
    }
    let units_first = findings.impossible_positions.is_some()
        || !summary.at_edge_of_range.is_empty()
        || summary.largest_strain.is_some_and(|strain| strain > IMPOSSIBLE_STRAIN);
    if !summary.converged {
        let text = format!("the draws have not converged: {messages}");
        add(WarningKind::NotConverged, text, "give more steps (--steps), or a more informative prior (--prior)");
    } else if !messages.is_empty() {
        add(WarningKind::Sampler, messages, "look at the trace plot before relying on the tails");
    }
    list.extend(findings.judgement.warnings());
    let mut add = |kind, text: String, advice: &str| list.push(Warning { kind, text, advice: advice.into() });
    if let Some(noise) = heldout.noise_um {
        noise_below(summary, noise, &mut add);
    }
    model_error(summary, heldout.noise_um.unwrap_or(summary.error_budget_um.noise), units_first, &mut add);
    if heldout.rmse_um.is_none() {
        let Warning { kind, text, advice } = nothing_held_out();
        add(kind, text, &advice);
    }
    if let Some(warning) = summary.largest_strain.and_then(strain_warning) {
        add(warning.kind, warning.text, &warning.advice);
    }
    if summary.surrogate.fe_unknowns.is_none() && !summary.model.is_outside() {
        let text = "the apparatus is an instrument or an indenter, whose compliance is given: finite elements, strain and discretisation error are left out".to_string();
        add(
            WarningKind::NoFiniteElements,
            text,
            "absolute moduli are as good as `compliance_per_m` or the size of the tip; the default prior is of porcine vitreous, `--prior generic` is decades wide",
        );
    }
    list
}

/// No cycle tests the predictions.
pub fn nothing_held_out() -> Warning {
    Warning {
        kind: WarningKind::NothingHeldOut,
        text: "no cycle is held out, so nothing is known about how the model predicts".into(),
        advice: "hold a cycle out in [measurement], or record another one".into(),
    }
}

/// A reduced model that is too far (µm) from the full one, or whose importance weights cannot be trusted.
pub fn surrogate_warning(
    distance_um: f64,
    pareto_k: Option<f64>,
    noise_um: f64,
    model: &ModelSummary,
) -> Option<Warning> {
    let is_inaccurate = distance_um > SURROGATE_SHARE * noise_um || pareto_k.is_some_and(|k| k > PARETO_LIMIT);
    let weights = pareto_k.map_or(String::new(), |k| format!(", Pareto k {k:.2}"));
    // Modes and points of a law that is not linear are as many as they are, whatever the prior.
    let advice = if Library::default().any_nonlinear(model.effects.iter().map(String::as_str)) {
        format!(
            "the reduced model of a law that is not linear is right to a thousandth of the amplitude: the parameters may err by more than their intervals say; measure at a smaller amplitude; where it is off by more, {}",
            make_anew()
        )
    } else if model.is_outside() {
        "narrow the prior, or hold a parameter that the data do not determine: what is learnt of the other program is then closer".into()
    } else {
        format!("{}; where that changes nothing, narrow the prior", make_anew())
    };
    is_inaccurate.then(|| Warning {
        kind: WarningKind::SurrogateInaccurate,
        text: format!(
            "the reduced model differs from {} by up to {} µm (noise {} µm{weights})",
            model.full_model(),
            significant(distance_um, 3),
            significant(noise_um, 3)
        ),
        advice,
    })
}

/// A reduced model that is too far from the full runs of a check.
pub fn check_warning(check: &Verification) -> Option<Warning> {
    (check.relative_error > SURROGATE_PART).then(|| Warning {
        kind: WarningKind::SurrogateInaccurate,
        text: format!(
            "the reduced model differs from full finite elements of this apparatus by {} % of the amplitude",
            significant(100.0 * check.relative_error, 2)
        ),
        advice: make_anew(),
    })
}

/// How a reduced model is made anew.
fn make_anew() -> String {
    format!(
        "make the reduced model anew: {}; delete `{SURROGATE_NAME}` in the study's revisions, too",
        cache::how_to_empty()
    )
}

/// A strain beyond the range in which the gel is known to be linear (physics §6).
pub fn strain_warning(largest_strain: f64) -> Option<Warning> {
    (largest_strain > LINEAR_STRAIN).then(|| Warning {
        kind: WarningKind::LargeStrain,
        text: format!(
            "the largest strain at the integration points is {largest_strain:.2} (at the robot's surface up to a tenth more), and the gel is known to be linear below {LINEAR_STRAIN}: the linear model is used beyond its proven range"
        ),
        advice: if largest_strain > IMPOSSIBLE_STRAIN {
            "no gel is strained by twenty times its own length: check the units of force, position and sizes first"
        } else {
            "read E, c₁ and c₂ as effective values at this amplitude, or repeat with a smaller force"
        }
        .into(),
    })
}

/// A learnt noise far below the one (µm) that is known or estimated.
fn noise_below(summary: &PosteriorSummary, noise: f64, add: &mut impl FnMut(WarningKind, String, &str)) {
    let learnt = summary.error_budget_um.noise;
    if learnt * LOW_NOISE_FACTOR < noise {
        let text = format!(
            "the learnt noise, {learnt:.2e} µm, is far below the {} noise of {} µm",
            summary.heldout.noise_origin,
            significant(noise, 3)
        );
        add(
            WarningKind::LearntNoiseBelowKnown,
            text,
            "check `noise_um` and the units of the positions; a simulated record has no noise to learn",
        );
    }
}

/// Errors of the reduced model and of the mesh, against the noise.
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
        && !summary.model.is_outside()
        && let Some(warning) = mesh_warning(summary.error_budget_um.fe_discretisation, noise, units_first)
    {
        add(warning.kind, warning.text, &warning.advice);
    }
}

/// Positions that range farther than the gel that the robot moves in.
pub fn impossible_positions(experiment: &Experiment) -> Option<Warning> {
    let Apparatus::Robot { vitreous, .. } = &experiment.apparatus else { return None };
    let positions_m = experiment.record.position_m.iter().flatten();
    let [lowest, highest] =
        positions_m.fold([f64::INFINITY, f64::NEG_INFINITY], |[lowest, highest], x| [lowest.min(*x), highest.max(*x)]);
    (highest - lowest > vitreous.diameter_m).then(|| Warning {
        kind: WarningKind::ImpossiblePositions,
        text: format!(
            "the positions range over {:.3} mm, and the gel measures {:.3} mm",
            1e3 * (highest - lowest),
            1e3 * vitreous.diameter_m
        ),
        advice: "check the units first: of the position's column (`position_um`, `position_mm`, …) and of the sizes in experiment.toml".into(),
    })
}

/// A mesh whose error (µm) is not small beside the noise, or is not known; `units_first` where a wrong unit is the likelier reason.
pub fn mesh_warning(error_um: Option<f64>, noise_um: f64, units_first: bool) -> Option<Warning> {
    let (kind, text, advice) = match error_um {
        Some(error) if error > noise_um => (
            WarningKind::MeshInaccurate,
            format!(
                "the mesh misplaces the robot by {} µm, more than the noise of {} µm: E, c₁ and c₂ have absorbed it",
                significant(error, 3),
                significant(noise_um, 3)
            ),
            "bring a finer mesh, of 10-node tetrahedra (--mesh), or use the built-in one",
        ),
        Some(error) if error > MESH_SHARE * noise_um => (
            WarningKind::MeshTooCoarse,
            format!(
                "the mesh's error is {} µm against a noise of {} µm",
                significant(error, 3),
                significant(noise_um, 3)
            ),
            "bring a finer mesh (--mesh)",
        ),
        Some(_) => return None,
        None => (
            WarningKind::MeshTooCoarse,
            "the error of the imported mesh is not known: there is neither a second mesh nor an exact solution"
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
    use crate::misfit::{Misfit, Size};
    use crate::systematic::SystematicTest;
    use crate::trust::trust;
    use WarningKind::*;
    use documents::posterior::*;
    use documents::trust::Trust;

    /// A sound result: noise 4 µm, nothing wrong.
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
            systematic: is_noise_unknown.then_some(white),
            learnt_noise_m: Some(1e-6 * summary.error_budget_um.noise),
            joint_p: summary.heldout.joint_p,
            has_gain: false,
        }
    }

    /// White errors of many rows: what is above 1.5 × the noise is so beyond chance.
    fn misfit_of(summary: &PosteriorSummary) -> Misfit {
        let size = |rms_um: f64| Size { rms_m: 1e-6 * rms_um, is_too_large: rms_um > 6.0 };
        Misfit {
            fitted: size(summary.heldout.rmse_fitted_um),
            heldout: summary.heldout.rmse_um.map(size),
            noise_m: 4e-6,
            is_known: true,
            returning_m: None,
            learnt_degrees: 1e4,
        }
    }

    /// Kinds of warnings after a change, and whether the result is then sound.
    fn after(change: impl Fn(&mut PosteriorSummary)) -> (Vec<WarningKind>, bool) {
        let mut summary = sound();
        change(&mut summary);
        let judgement = &judgement_of(&summary);
        summary.warnings =
            warnings(&Findings { summary: &summary, judgement, sampler_messages: &[], impossible_positions: None });
        summary.trust = trust(&summary.warnings);
        (summary.warnings.iter().map(|warning| warning.kind).collect(), summary.is_sound())
    }

    /// Each rule of formats §4 on both sides of its limit.
    #[test]
    fn every_rule_speaks_on_its_side_of_the_limit_only() {
        let none: (Vec<WarningKind>, bool) = (vec![], true);
        assert_eq!(after(|_| {}), none);
        // Misfit and learnt noise: 1.5 × the known noise of 4 µm.
        assert_eq!(after(|s| s.heldout.rmse_um = Some(5.9)), none);
        assert_eq!(after(|s| s.heldout.rmse_um = Some(6.1)), (vec![MisfitAboveNoise], false));
        assert_eq!(after(|s| s.heldout.rmse_fitted_um = 5.9), none);
        assert_eq!(after(|s| s.heldout.rmse_fitted_um = 6.1), (vec![MisfitAboveNoise], false));
        assert_eq!(after(|s| s.error_budget_um.noise = 5.9), none);
        assert_eq!(after(|s| s.error_budget_um.noise = 6.1), (vec![LearntNoiseAboveKnown], false));
        assert_eq!(after(|s| s.error_budget_um.noise = 1.0), (vec![LearntNoiseBelowKnown], true));
        // The joint band, 99.9 %.
        assert_eq!(after(|s| s.heldout.joint_p = Some(0.0011)), none);
        assert_eq!(after(|s| s.heldout.joint_p = Some(0.0009)), (vec![HeldoutOutsideBand], false));
        // Reduced model: a tenth of the noise, k̂ of 0.7.
        assert_eq!(after(|s| s.heldout.surrogate_vs_fe_max_um = Some(0.39)), none);
        assert_eq!(after(|s| s.heldout.surrogate_vs_fe_max_um = Some(0.41)), (vec![SurrogateInaccurate], false));
        let inaccurate = surrogate_warning(0.41, None, 4.0, &sound().model).expect("it is too far");
        assert!(inaccurate.advice.contains(&cache::how_to_empty()), "{inaccurate:?}");
        assert_eq!(after(|s| s.heldout.pareto_k = Some(0.69)), none);
        assert_eq!(after(|s| s.heldout.pareto_k = Some(0.71)), (vec![SurrogateInaccurate], false));
        // Mesh: a quarter of the noise, and the noise.
        assert_eq!(after(|s| s.error_budget_um.fe_discretisation = Some(0.9)), none);
        assert_eq!(after(|s| s.error_budget_um.fe_discretisation = Some(1.1)), (vec![MeshTooCoarse], true));
        assert_eq!(after(|s| s.error_budget_um.fe_discretisation = Some(4.1)), (vec![MeshInaccurate], false));
        assert_eq!(after(|s| s.error_budget_um.fe_discretisation = None), (vec![MeshTooCoarse], true));
        assert_eq!(after(|s| s.converged = false), (vec![NotConverged], false));
        assert_eq!(after(|s| s.largest_strain = Some(0.02)), (vec![LargeStrain], true));
        // With large displacements no strain is given, and there are finite elements all the same.
        assert_eq!(after(|s| s.largest_strain = None), none);
        assert_eq!(after(|s| s.surrogate.fe_unknowns = None), (vec![NoFiniteElements], true));
        assert_eq!(after(|s| s.at_edge_of_range = vec!["young_modulus_pa".into()]), (vec![EdgeOfRange], false));
        assert_eq!(after(|s| s.heldout.noise_um = None), (vec![NoiseUnknown], true));
        // Without a yardstick the model's own errors are still judged, against the learnt noise.
        assert_eq!(
            after(|s| (s.heldout.noise_um, s.heldout.pareto_k) = (None, Some(0.9))),
            (vec![NoiseUnknown, SurrogateInaccurate], false)
        );
        assert_eq!(after(|s| (s.heldout.rmse_um, s.heldout.joint_p) = (None, None)), (vec![NothingHeldOut], true));
    }

    /// A mesh that is coarse by its error is named with the mesh's remedy; where the parameters are absurd, with the units' first.
    #[test]
    fn units_come_before_meshes_where_figures_are_impossible() {
        type Change = fn(&mut PosteriorSummary);
        let advice = |change: Change| {
            let mut summary = sound();
            summary.error_budget_um.fe_discretisation = Some(400.0);
            change(&mut summary);
            let all = warnings(&Findings {
                summary: &summary,
                judgement: &judgement_of(&summary),
                sampler_messages: &[],
                impossible_positions: None,
            });
            all.into_iter().find(|warning| warning.kind == MeshInaccurate).expect("the mesh is told").advice
        };
        assert!(advice(|_| {}).starts_with("bring a finer mesh"));
        let changes: [Change; 2] =
            [|s| s.at_edge_of_range = vec!["young_modulus_pa".into()], |s| s.largest_strain = Some(30.0)];
        for change in changes {
            let advice = advice(change);
            assert!(advice.starts_with("check the units"), "{advice}");
        }
        assert!(strain_warning(30.0).expect("large").advice.contains("check the units"));
        assert!(strain_warning(2.6).expect("the paper's").advice.starts_with("read E"));
    }

    /// A record of 300 µm whose column says millimetres.
    #[test]
    fn positions_that_no_gel_allows_are_told_first() {
        let (mut experiment, _) = crate::replica::embedded().expect("embedded");
        assert_eq!(impossible_positions(&experiment), None);
        experiment.record.position_m.iter_mut().flatten().for_each(|x| *x *= 1e3);
        let impossible = impossible_positions(&experiment).expect("the gel measures 20 mm");
        assert!(impossible.kind.is_fatal() && impossible.advice.starts_with("check the units"));
        let mut summary = sound();
        summary.heldout.rmse_um = Some(4e3);
        let all = warnings(&Findings {
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
