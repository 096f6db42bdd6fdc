//! Document of `compare --laws` (formats §5, `vitreo-uq/laws/1`).

use serde::{Deserialize, Serialize};

use super::diagnosis::RefitParameter;
use super::oscillation::{Frequencies, OscillationMisfit};

/// Result of `compare --laws`, which compares base laws on one record: body of the JSON document `vitreo-uq/laws/1`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct LawComparison {
    /// Specimen identifier.
    pub experiment: String,
    /// Cycles that every law is fitted to; empty for an oscillation.
    pub fitted_cycles: Vec<u32>,
    /// The scored cycle; empty if no cycle is held out.
    pub heldout_cycles: Vec<u32>,
    /// Frequencies of an oscillation; `None` for records over time.
    pub frequencies: Option<Frequencies>,
    /// Number of positions or frequencies that every law is fitted to. A long record over time is thinned.
    pub n_fitted: usize,
    /// Known or estimated noise standard deviation, in µm; `None` if it is unknown, and for an oscillation.
    pub noise_um: Option<f64>,
    /// True if the best law leaves only noise on the fitted positions, and only noise and uncertain parameters on the scored ones. `None` if the noise is unknown.
    /// For an oscillation, true if the residuals of the best law are consistent with measurement errors.
    pub is_explained: Option<bool>,
    /// Laws by falling evidence, or by rising error if no law explains the record. Without an explanation there is no evidence. Laws that could not be fitted come last.
    pub laws: Vec<LawRow>,
    /// Summary of the comparison as a sentence.
    pub sentence: String,
}

impl LawComparison {
    /// Unit of [`LawRow::errors`].
    pub fn error_unit(&self) -> &'static str {
        if self.frequencies.is_some() { "%" } else { "µm" }
    }
}

/// One law of a comparison.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct LawRow {
    /// Name of the law.
    pub law: String,
    /// Status of the law.
    pub status: LawStatus,
    /// Reason for which the law has no evidence; `None` for other laws.
    pub reason: Option<String>,
    /// Log evidence minus that of the likeliest law, in nats; `None` without evidence.
    pub evidence_difference_nats: Option<f64>,
    /// Standard error of the law's log evidence, in nats; `None` without evidence.
    pub evidence_standard_error_nats: Option<f64>,
    /// Root mean square residual of the fitted positions at the best fit, in µm; `None` without a fit.
    pub rmse_fitted_um: Option<f64>,
    /// Root mean square residual of the scored positions at the best fit, in µm; `None` without a fit or a scored cycle.
    pub rmse_heldout_um: Option<f64>,
    /// Distance of the scored positions from the law's prediction, per position: √(rᵀΣ⁻¹r/n) with the covariance Σ of white noise and uncertain parameters. About 1 for the true law; `None` without a fit or a scored cycle.
    pub heldout_over_expected: Option<f64>,
    /// Residuals of an oscillation at the best fit, relative to the modulus of the complex modulus; `None` without a fit and for records over time.
    pub misfit: Option<OscillationMisfit>,
    /// Posterior of each parameter of the law; empty without evidence.
    pub parameters: Vec<RefitParameter>,
}

impl LawRow {
    /// Root mean square residuals of the fitted and of the scored rows at the best fit: in µm, or in % of the complex modulus for an oscillation.
    pub fn errors(&self) -> [Option<f64>; 2] {
        let percent = |share: f64| 100.0 * share;
        match &self.misfit {
            Some(misfit) => [Some(percent(misfit.relative_fitted)), misfit.relative_heldout.map(percent)],
            None => [self.rmse_fitted_um, self.rmse_heldout_um],
        }
    }

    /// Error by which laws are ranked without evidence, in the unit of [`LawRow::errors`]: that of the scored rows, or of the fitted rows if none is scored.
    pub fn ranking_error(&self) -> Option<f64> {
        let [fitted, heldout] = self.errors();
        heldout.or(fitted)
    }
}

base::named_enum! {
    /// Status of a law in a comparison.
    #[derive(Serialize, Deserialize)]
    #[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
    #[serde(rename_all = "snake_case")]
    pub enum LawStatus {
        /// The record gives this law the largest evidence.
        Likeliest = "likeliest",
        /// The record cannot distinguish this law from the likeliest law.
        Indistinguishable = "indistinguishable",
        /// The record gives this law less evidence.
        LessLikely = "less likely",
        /// No law explains the record, and this law has the smallest error.
        Closest = "closest",
        /// No law explains the record, and this law has a larger error.
        FartherOff = "farther off",
        /// The law has no evidence.
        NotCompared = "not compared",
    }
    /// Text for readers.
    pub fn text
}
