//! Makes a rung of a ladder for the tests of several modules.

use documents::ladder::{LadderParameter, LadderRow};
use documents::posterior::ModelSummary;

/// Row of a ladder for the revision `revision`, which extends the revision `from`. It has one parameter of the law and the held-out error `heldout_um` (µm).
pub(crate) fn make_rung(revision: &str, from: Option<&str>, effects: &[&str], heldout_um: Option<f64>) -> LadderRow {
    let effects: Vec<String> = effects.iter().map(|slug| slug.to_string()).collect();
    let spread = |name: &str, median: f64| LadderParameter {
        name: name.into(),
        mean: median,
        sd: 0.1,
        q05: median - 0.16,
        median,
        q95: median + 0.16,
    };
    LadderRow {
        revision: revision.into(),
        effects: effects.clone(),
        from: from.map(String::from),
        added: effects.clone(),
        equivalents: Vec::new(),
        model: ModelSummary { base: "lethersich".into(), effects, noise: vec!["white".into()] },
        rmse_fitted_um: 0.9 * heldout_um.unwrap_or(5.0),
        rmse_heldout_um: heldout_um,
        heldout_log_score_nats: heldout_um.map(|error| -100.0 * error),
        heldout_log_score_mcse_nats: heldout_um.map(|_| 0.1),
        parameters: vec![spread("young_modulus_pa", 3.0 + 0.1 * heldout_um.unwrap_or(0.0))],
        learnt_noise_um: 4.0,
        coverage_50: heldout_um.map(|_| 0.5),
        coverage_90: heldout_um.map(|_| 0.9),
        joint_p: heldout_um.map(|_| 0.5),
        fe_runs: Some(128),
        surrogate_vs_fe_max_um: Some(1e-9),
        converged: true,
        warnings: vec![],
    }
}
