//! One played challenge.

use serde::{Deserialize, Serialize};

use super::Truth;

/// Sorts of challenges, by their hidden effects or errors.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
#[serde(rename_all = "lowercase")]
pub enum HiddenKind {
    /// Nothing is hidden.
    None,
    /// One effect of the library.
    Single,
    /// Two effects of the library.
    Pair,
    /// Physics outside the library.
    Outside,
    /// A wrong constant of the apparatus, which the law absorbs.
    Apparatus,
}

impl HiddenKind {
    /// Sort of a truth.
    pub fn of(truth: &Truth) -> Self {
        match (&truth.outside, truth.apparatus, truth.effects.len()) {
            (Some(_), ..) => Self::Outside,
            (None, Some(_), _) => Self::Apparatus,
            (None, None, 0) => Self::None,
            (None, None, 1) => Self::Single,
            (None, None, _) => Self::Pair,
        }
    }

    /// Name in tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::None => "none",
            Self::Single => "single",
            Self::Pair => "pair",
            Self::Outside => "outside",
            Self::Apparatus => "apparatus",
        }
    }
}

/// One played challenge.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct Play {
    /// Number of the play, from 0.
    pub number: usize,
    /// Sort of the challenge.
    pub sort: HiddenKind,
    /// Truth behind the data.
    pub truth: Truth,
    /// Verdict of a right diagnosis.
    pub label: String,
    /// Verdict of the diagnosis: slugs joined by `+`, `none`, `unexplained`, or `failed`.
    pub said: String,
    /// Claimed effects and their equivalent effects.
    pub class: Vec<String>,
    /// Kinds of unexplained misfits.
    pub unexplained: Vec<String>,
    /// The leading effect: the first claimed one, or else the one with the largest gain.
    pub first: Option<String>,
    /// Gain of each effect's refit in nats, best first, with the gain on the last cycle.
    pub gains: Vec<(String, f64, Option<f64>)>,
    /// Sentence of the verdict; empty if there is none.
    pub sentence: String,
    /// Seed of the diagnosis; 0 if it is unknown.
    pub seed: u64,
    /// True if the hidden effect's size lies in its 90 % interval; `None` if it was not claimed or nothing was hidden.
    pub size_covered: Option<bool>,
    /// Size of every hidden effect that was claimed.
    pub sizes: Vec<NamedSize>,
    /// Noise (µm) that the diagnosis compared residuals with, given or estimated.
    pub yardstick_um: Option<f64>,
    /// Root mean square error (µm) on the scored cycle with the claimed effects, or of the base model without a claim.
    pub rmse_heldout_um: Option<f64>,
    /// Root mean square (µm) of the drawn noise over the scored rows, which is the error of the true model.
    pub true_noise_um: Option<f64>,
    /// Ratio of the error on the scored cycle to the true noise: 1 for the true model. A misfit of f times the noise gives √(1 + f²),
    /// unless it correlates with the noise.
    pub heldout_over_true_noise: Option<f64>,
    /// Ratio of the error on the scored cycle to the predictive noise of the claimed model; `None` without a claim.
    pub heldout_over_predictive_noise: Option<f64>,
    /// Reason why there is no diagnosis.
    pub failure: Option<String>,
}

/// True size of a hidden effect, with the diagnosis's estimate.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct NamedSize {
    /// Name of the parameter, with unit.
    pub name: String,
    /// Hidden value.
    pub value: f64,
    /// Posterior mean.
    pub mean: f64,
    /// 5 % quantile.
    pub q05: f64,
    /// 95 % quantile.
    pub q95: f64,
}

impl Play {
    /// True if the diagnosis was right: the hidden effects are in the class, `none` if nothing is hidden, `unexplained` for physics outside the library.
    pub fn is_right(&self) -> bool {
        match self.sort {
            HiddenKind::None | HiddenKind::Apparatus => self.said == "none",
            // An equivalent effect of the library may be claimed instead.
            HiddenKind::Outside => {
                self.said == "unexplained" || self.class.iter().any(|slug| self.truth.ideal_class.contains(slug))
            }
            HiddenKind::Single | HiddenKind::Pair => self.is_in_class(),
        }
    }

    pub(super) fn is_in_class(&self) -> bool {
        self.truth.effects.iter().all(|effect| self.class.contains(&effect.slug))
    }

    pub(super) fn is_claim(&self) -> bool {
        !["none", "unexplained", "failed"].contains(&self.said.as_str())
    }

    pub(super) fn is_first_separated(&self) -> bool {
        self.first.as_ref().is_some_and(|first| self.truth.ideal_class.contains(first))
    }
}
