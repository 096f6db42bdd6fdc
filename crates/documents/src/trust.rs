//! Trust in a result: the three levels that every result shows first (formats §4).

use serde::{Deserialize, Serialize};

base::named_enum! {
    /// Levels of trust, best first.
    #[derive(PartialOrd, Ord, Serialize, Deserialize)]
    #[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
    #[serde(rename_all = "lowercase")]
    pub enum TrustLevel {
        /// Parameters can be trusted.
        Trusted = "Parameters can be trusted",
        /// Predictions can be trusted. Parameters are effective values that hold only in the experiment of this record.
        Effective = "Predictions can be trusted; parameters are effective values",
        /// Neither parameters nor predictions can be trusted.
        Untrusted = "Not to be trusted as it stands",
    }
    /// The level of trust in words, for people.
    pub fn words
}

/// A level of trust with its reason.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct Trust {
    /// The level of trust.
    pub level: TrustLevel,
    /// Reason for the level, in plain words.
    pub reason: String,
}

impl Default for Trust {
    /// Trust in a result of an earlier version that states no level: untrusted.
    fn default() -> Self {
        Self { level: TrustLevel::Untrusted, reason: "an earlier version made this result and did not judge it".into() }
    }
}

impl Trust {
    /// True unless the level is untrusted. The program exits with code 0 for such results.
    pub fn is_sound(&self) -> bool {
        self.level != TrustLevel::Untrusted
    }
}

impl std::fmt::Display for Trust {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}: {}.", self.level.words(), self.reason)
    }
}
