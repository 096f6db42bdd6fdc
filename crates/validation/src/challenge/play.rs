//! A play: one challenge whose data are simulated, diagnosed and compared with the truth.

use serde::{Deserialize, Serialize};

use super::Truth;

base::named_enum! {
    /// Sort of a challenge: the kind of physics that it hides.
    #[derive(PartialOrd, Ord, Serialize, Deserialize)]
    #[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
    #[serde(rename_all = "lowercase")]
    pub enum HiddenKind {
        /// Nothing is hidden.
        None = "none",
        /// One effect of the library.
        Single = "single",
        /// Two effects of the library.
        Pair = "pair",
        /// Physics outside the library.
        Outside = "outside",
        /// A wrong constant of the apparatus, which the law absorbs.
        Apparatus = "apparatus",
    }
    /// Name of the sort in tables.
    pub fn name
}

impl HiddenKind {
    /// Sort to which a truth belongs.
    pub fn of(truth: &Truth) -> Self {
        match (&truth.outside, truth.apparatus, truth.effects.len()) {
            (Some(_), ..) => Self::Outside,
            (None, Some(_), _) => Self::Apparatus,
            (None, None, 0) => Self::None,
            (None, None, 1) => Self::Single,
            (None, None, _) => Self::Pair,
        }
    }
}

/// A play: one challenge with its truth and the result of its diagnosis.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct Play {
    /// Number of the challenge in its run, from 0.
    pub number: usize,
    /// Sort of the challenge: the kind of physics that it hides.
    pub sort: HiddenKind,
    /// Truth that the data are simulated from.
    pub truth: Truth,
    /// Name of the truth: slugs joined by `+`, `none` or `outside`.
    pub label: String,
    /// Verdict that the diagnosis gives: slugs joined by `+`, `none`, `unexplained`, or `failed`.
    pub said: String,
    /// Claimed effects and their equivalent effects.
    pub class: Vec<String>,
    /// Kinds of misfits that the diagnosis leaves unexplained.
    pub unexplained: Vec<String>,
    /// Leading effect: the first claimed effect, or without a claim the effect with the largest gain.
    pub first: Option<String>,
    /// Slug of each refitted effect, its gain, and its gain on the last cycle; gains are in nats. The largest gain comes first.
    pub gains: Vec<(String, f64, Option<f64>)>,
    /// Sentence that states the verdict; empty if there is no diagnosis.
    pub sentence: String,
    /// Seed of the diagnosis; 0 if it is unknown.
    pub seed: u64,
    /// True if the 90 % interval of the hidden effect's size contains the true size; `None` unless exactly one effect is hidden and the diagnosis claims only
    /// this effect.
    pub size_covered: Option<bool>,
    /// Sizes of the hidden effects that were claimed.
    pub sizes: Vec<NamedSize>,
    /// Noise standard deviation (µm) that the diagnosis compared residuals with, given or estimated.
    pub yardstick_um: Option<f64>,
    /// Root mean square error (µm) on the scored cycle, of the model with the claimed effects. Without a claim, it is the error of the base model.
    pub rmse_heldout_um: Option<f64>,
    /// Root mean square (µm) of the drawn noise over the scored rows. It is the error that the true model would have.
    pub true_noise_um: Option<f64>,
    /// Ratio of the error on the scored cycle to the true noise; it is 1 for the true model. A misfit of f times the noise gives √(1 + f²), unless it
    /// correlates with the noise.
    pub heldout_over_true_noise: Option<f64>,
    /// Ratio of the error on the scored cycle to the noise that the model with the claimed effects predicts; `None` without a claim.
    pub heldout_over_predictive_noise: Option<f64>,
    /// Reason why the diagnosis failed; `None` if it did not.
    pub failure: Option<String>,
}

/// True size of a hidden effect, with the estimate of the diagnosis.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct NamedSize {
    /// Name of the effect's size parameter, with its unit.
    pub name: String,
    /// True value of the size parameter.
    pub value: f64,
    /// Mean of the size parameter's posterior.
    pub mean: f64,
    /// 5 % quantile of the posterior.
    pub q05: f64,
    /// 95 % quantile of the posterior.
    pub q95: f64,
}

impl Play {
    /// True if the diagnosis was right. Every hidden effect must be claimed or equivalent to a claimed effect. The verdict must be `none` if nothing is hidden,
    /// and `unexplained` for physics outside the library.
    pub fn is_right(&self) -> bool {
        match self.sort {
            HiddenKind::None | HiddenKind::Apparatus => self.said == "none",
            // A claim of an effect that is equivalent to the hidden physics is also right.
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
