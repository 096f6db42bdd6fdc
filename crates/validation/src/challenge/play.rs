//! One challenge as it was played.

use serde::{Deserialize, Serialize};

use super::Truth;

/// Kinds of hidden things.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
#[serde(rename_all = "lowercase")]
pub enum Sort {
    /// Nothing.
    None,
    /// One effect of the library.
    Single,
    /// Two.
    Pair,
    /// Something outside the library.
    Outside,
    /// A wrong constant of the apparatus, which the law absorbs.
    Apparatus,
}

impl Sort {
    /// Of a truth.
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

/// One challenge as it was played.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct Play {
    /// Number, from 0.
    pub number: usize,
    /// Sort.
    pub sort: Sort,
    /// What it was made from.
    pub truth: Truth,
    /// What a right diagnosis names.
    pub label: String,
    /// What was said: slugs joined by `+`, `none`, `unexplained`, or `failed`.
    pub said: String,
    /// The effects that were named, and those that were called equivalent.
    pub class: Vec<String>,
    /// Kinds of structure that were called unexplained.
    pub unexplained: Vec<String>,
    /// The effect that stood first: the first that was named, else the one whose refit gained most.
    pub first: Option<String>,
    /// Gain in nats of each effect's refit, best first, with that on the last cycle.
    pub gains: Vec<(String, f64, Option<f64>)>,
    /// The verdict in its own words; empty where there is none.
    pub sentence: String,
    /// Seed of the diagnosis; 0 where it is not known.
    pub seed: u64,
    /// Whether the size of the hidden effect lies in its 90 % interval; `None` where it was not named or nothing was hidden.
    pub size_covered: Option<bool>,
    /// The size of every hidden effect that was named.
    pub sizes: Vec<NamedSize>,
    /// Noise (µm) that the diagnosis measured misfits against, given or estimated.
    pub yardstick_um: Option<f64>,
    /// Root mean square error (µm) on the scored cycle with what was named, of the base model where nothing was.
    pub rmse_heldout_um: Option<f64>,
    /// Root mean square (µm) of the noise that was drawn, over the rows on which that error was taken: what the true model leaves.
    pub true_noise_um: Option<f64>,
    /// The error over the true noise. The true model reads 1, whatever was drawn, and a misfit of f times the noise √(1 + f²), but for what it shares with it.
    pub heldout_over_true_noise: Option<f64>,
    /// The error over the total predictive noise that the diagnosis gives the model that it named; `None` where it named none.
    pub heldout_over_predictive_noise: Option<f64>,
    /// Why there is no diagnosis.
    pub failure: Option<String>,
}

/// The size of a hidden effect beside what the diagnosis says of it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct NamedSize {
    /// Name of the parameter, with unit.
    pub name: String,
    /// What was hidden.
    pub value: f64,
    /// Posterior mean.
    pub mean: f64,
    /// 5 % quantile.
    pub q05: f64,
    /// 95 % quantile.
    pub q95: f64,
}

impl Play {
    /// Whether the diagnosis was right: the hidden effects in the class, `none` where nothing is hidden, `unexplained` of what is outside.
    pub fn is_right(&self) -> bool {
        match self.sort {
            Sort::None | Sort::Apparatus => self.said == "none",
            // Where an effect of the library does the same, it may be named.
            Sort::Outside => {
                self.said == "unexplained" || self.class.iter().any(|slug| self.truth.ideal_class.contains(slug))
            }
            Sort::Single | Sort::Pair => self.is_in_class(),
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
