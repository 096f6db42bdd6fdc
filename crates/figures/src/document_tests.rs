//! Tests the figures of ladders and diagnoses: they are legible, and the length of every bar corresponds to its number.

use super::diagnosis::diagnosis;
use super::ladder::ladder;
use super::layout_tests::{LONG, assert_legible};
use crate::rung_for_tests::make_rung;
use documents::diagnosis::*;
use documents::extension::EquivalentEffects;
use documents::ladder::{LadderRow, LadderSummary};
use documents::trust::{Trust, TrustLevel};

fn ladder_of(revisions: Vec<LadderRow>, experiment: &str, sentence: &str) -> LadderSummary {
    LadderSummary {
        experiment: experiment.into(),
        fitted_cycles: vec![1, 2, 3],
        heldout_cycles: vec![4],
        noise_um: Some(4.0),
        noise_origin: "estimated from short lags".into(),
        revisions,
        shifts: vec![],
        sentence: sentence.into(),
        trust: Trust { level: TrustLevel::Trusted, reason: "all is well".into() },
    }
}

fn three_rungs() -> Vec<LadderRow> {
    let mut rungs = vec![
        make_rung("m0", None, &[], Some(40.0)),
        make_rung("m1", Some("m0"), &["instantaneous-elasticity"], Some(10.0)),
        make_rung("m12", Some("m1"), &["instantaneous-elasticity", "second-retardation", "tracking-drift"], Some(4.1)),
    ];
    rungs[2].added = vec!["second-retardation".into(), "tracking-drift".into()];
    rungs[1].equivalents = vec![EquivalentEffects {
        revision: "m1".into(),
        effects: vec!["instantaneous-elasticity".into()],
        rivals: vec!["actuator-lag".into(), "clock-offset".into()],
        diagnosis_of: Some("m0".into()),
        refits: Vec::new(),
    }];
    let names =
        ["viscosity_1_pa_s", "noise_sd_um", "tracking-drift.velocity_m_per_s", "instantaneous-elasticity.modulus_pa"];
    for (k, name) in names.into_iter().enumerate() {
        for rung in &mut rungs[k / 2..] {
            let mut parameter = rung.parameters[0].clone();
            parameter.name = name.into();
            rung.parameters.push(parameter);
        }
    }
    rungs[0].converged = false;
    rungs
}

#[test]
fn ladders_are_legible() {
    let rungs = three_rungs();
    assert!(
        ladder(&ladder_of(vec![], "gel", ""))
            .is_err_and(|error| error.to_string().contains("the ladder has no revisions"))
    );
    assert_legible("one rung", &ladder(&ladder_of(rungs[..1].to_vec(), "gel", "There is one revision.")).unwrap());
    assert_legible("three rungs", &ladder(&ladder_of(rungs.clone(), LONG, &[LONG; 3].join(". "))).unwrap());
    let mut unscored = ladder_of(rungs, "gel", LONG);
    unscored.revisions.iter_mut().for_each(|rung| (rung.rmse_heldout_um, rung.heldout_log_score_nats) = (None, None));
    (unscored.heldout_cycles, unscored.noise_um) = (vec![], None);
    assert_legible("nothing scored", &ladder(&unscored).unwrap());
}

/// An estimated noise is never called known.
#[test]
fn a_ladder_names_the_origin_of_the_noise() {
    let document = ladder(&ladder_of(three_rungs(), "gel", "x")).unwrap().document();
    assert!(document.contains("estimated from short lags") && !document.contains("known noise"), "{document}");
}

/// Bars of the errors 40, 10 and 4.1 µm on one axis have widths in these proportions.
#[test]
fn bars_are_as_long_as_the_errors() {
    let document = ladder(&ladder_of(three_rungs(), "gel", "x")).unwrap().document();
    let colour = format!("height=\"20\" fill=\"{}\"", super::palette::BLUE);
    let bars = document.lines().filter(|line| line.starts_with("<rect") && line.contains(&colour));
    let width = |line: &str| line.split("width=\"").nth(1)?.split('"').next()?.parse::<f64>().ok();
    let widths: Vec<f64> = bars.filter_map(width).collect();
    assert_eq!(widths.len(), 3, "{document}");
    for (found, error_um) in widths.iter().zip([40.0, 10.0, 4.1]) {
        assert!((found / widths[0] - error_um / 40.0).abs() < 1e-3, "{widths:?}");
    }
}

fn candidate(effect: &str, status: Status, gain_nats: Option<f64>, heldout: Option<f64>) -> CandidateEntry {
    let refit = gain_nats.map(|gain_nats| Refit {
        gain_nats,
        heldout_gain_nats: heldout,
        last_cycle_gain_nats: heldout,
        rmse_heldout_um: Some(4.1),
        largest_change: 1.0,
        log_bayes_factor: None,
        log_bayes_factor_at_most: None,
        answers: vec![],
        parameters: vec![],
        law_parameters: Vec::new(),
    });
    CandidateEntry {
        effect: effect.into(),
        status,
        z: 3.4,
        p_familywise: if gain_nats > Some(10.0) { 1e-4 } else { 0.4 },
        visible_fraction: if gain_nats > Some(10.0) { 0.34 } else { 1e-5 },
        expected_parameter: None,
        refused: refit.is_none().then(|| "an instrument has no finite elements, which this effect needs".into()),
        refit,
        twins: if status == Status::Equivalent { vec!["actuator-lag".into(), "clock-offset".into()] } else { vec![] },
    }
}

fn a_diagnosis(experiment: &str, sentence: &str) -> Diagnosis {
    use Status::*;
    Diagnosis {
        experiment: experiment.into(),
        verdict: Verdict {
            kind: VerdictKind::Missing,
            effects: vec!["actuator-lag".into()],
            equivalent: vec!["clock-offset".into(), "fractional-damping".into()],
            base_law: None,
            sentence: sentence.into(),
        },
        fitted_cycles: vec![1, 2, 3],
        heldout_cycles: vec![4],
        base: BaseErrors { rmse_fitted_um: 14.0, rmse_heldout_um: Some(16.0), noise_um: Some(4.0) },
        extended: Some(Errors { rmse_fitted_um: 3.9, rmse_heldout_um: Some(4.1), predictive_noise_um: Some(4.2) }),
        search_noise_um: 4.2,
        candidates: vec![
            candidate("force-bias", Unsupported, Some(1.3), Some(-14.0)),
            candidate("clock-offset", Equivalent, Some(1180.0), Some(390.0)),
            candidate("actuator-lag", Claimed, Some(1184.0), Some(394.0)),
            candidate("fractional-damping", Equivalent, Some(1181.0), Some(388.0)),
            candidate("instantaneous-elasticity", Suggestive, Some(40.0), Some(1.2)),
            candidate("compressibility", Invisible, None, None),
            candidate("tracking-drift", Unsupported, Some(0.05), None),
        ],
        pairs: vec![PairEntry {
            effects: vec!["actuator-lag".into(), "instantaneous-elasticity".into()],
            gain_nats: 1190.0,
            heldout_gain_nats: Some(395.0),
        }],
        blind_spots: vec!["compressibility".into()],
        smallest_detectable: vec![],
        separating_protocol: String::new(),
        noise: vec![],
        unexplained: vec![UnexplainedMisfit {
            kind: "vibration".into(),
            sentence: "a vibration of 2.1 Hz and 3 µm, all through the record".into(),
            size_um: 3.0,
            gain_nats: 33.0,
            p_familywise: 0.012,
        }],
        discrepancy: None,
        outlier_rows: vec![],
        remarks: vec![],
    }
}

#[test]
fn diagnoses_are_legible() {
    let sentence = "The model lacks actuator-lag, or one of clock-offset and fractional-damping, which this experiment cannot tell from it: with it the error on the cycle that no fit has seen falls from 16.0 to 4.1 µm, the noise (4 µm).";
    let usual = a_diagnosis("gel", sentence);
    assert_legible("usual", &diagnosis(&usual).unwrap());
    assert_legible("long", &diagnosis(&a_diagnosis(LONG, &[LONG; 3].join(". "))).unwrap());
    let mut none = a_diagnosis("gel", "Nothing is missing.");
    (none.extended, none.heldout_cycles, none.base.rmse_heldout_um) = (None, vec![], None);
    none.verdict.effects.clear();
    (none.pairs, none.unexplained) = (vec![], vec![]);
    for candidate in &mut none.candidates {
        candidate.status = Status::Unsupported;
        if let Some(refit) = &mut candidate.refit {
            (refit.gain_nats, refit.heldout_gain_nats) = (0.3, None);
        }
    }
    assert_legible("nothing missing", &diagnosis(&none).unwrap());
}

/// Equivalent effects come first, whatever their gain. The bar of a held-out loss extends to the left.
#[test]
fn the_class_stands_first_and_losses_go_left() {
    let mut odd = a_diagnosis("gel", "x");
    odd.candidates[0].refit.as_mut().unwrap().gain_nats = 5000.0;
    let document = diagnosis(&odd).unwrap().document();
    let place = |words: &str| document.find(&format!(">{words}<")).unwrap_or_else(|| panic!("no {words}"));
    assert!(place("actuator-lag") < place("fractional-damping"));
    assert!(place("fractional-damping") < place("clock-offset") && place("clock-offset") < place("force-bias"));
    assert!(place("force-bias") < place("instantaneous-elasticity"));
    let outlined = |colour: super::palette::Colour| {
        let style = format!("height=\"7\" fill=\"#ffffff\" stroke=\"{colour}\"");
        let line = document.lines().find(|line| line.contains(&style)).expect("a bar");
        let of = |key: &str| {
            line.split(key).nth(1).and_then(|rest| rest.split('"').next()).and_then(|x| x.parse::<f64>().ok())
        };
        (of(" x=\"").expect("x"), of(" width=\"").expect("width"))
    };
    let ((loss_x, loss_width), (gain_x, _)) = (outlined(super::palette::MUTED), outlined(super::palette::GREEN));
    assert!((loss_x + loss_width - gain_x).abs() < 0.02, "both begin at zero");
}

/// An effect is named if its gain is beyond chance but the error does not fall. It is not named if the error falls, or if the gain may be due to chance.
#[test]
fn gains_that_leave_the_error_are_named() {
    let mut diagnosis = a_diagnosis("e", "s");
    assert_eq!(diagnosis.gains_without_error(), None);
    for candidate in &mut diagnosis.candidates {
        if let Some(refit) = &mut candidate.refit {
            refit.rmse_heldout_um = Some(if candidate.effect == "clock-offset" { 15.8 } else { 16.5 });
        }
    }
    let named = diagnosis.gains_without_error().expect("effects");
    assert!(named.starts_with("actuator-lag, fractional-damping, instantaneous-elasticity gain likelihood"), "{named}");
    diagnosis.base.rmse_heldout_um = None;
    assert_eq!(diagnosis.gains_without_error(), None);
}
