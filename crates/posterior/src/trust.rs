//! Trust level of a result, which depends only on its warnings (formats §4).

use documents::posterior::{Warning, WarningKind};
use documents::trust::{Trust, TrustLevel};

/// Trust level of a result with these warnings: the lowest level that any warning allows. The reasons are the texts of the warnings that determine the level.
pub fn trust<'a>(warnings: impl IntoIterator<Item = &'a Warning>) -> Trust {
    let warnings: Vec<&Warning> = warnings.into_iter().collect();
    let level = warnings.iter().map(|warning| warning.kind.level()).max().unwrap_or(TrustLevel::Trusted);
    if level > TrustLevel::Trusted {
        let mut reasons: Vec<&str> = Vec::new();
        for warning in warnings.iter().filter(|warning| warning.kind.level() == level) {
            // Text after a colon explains the warning and is left out of the reason.
            let finding = warning.text.split_once(": ").map_or(warning.text.as_str(), |(finding, _)| finding);
            if !reasons.contains(&finding) {
                reasons.push(finding);
            }
        }
        return Trust { level, reason: reasons.join("; ") };
    }
    let has = |kind: WarningKind| warnings.iter().any(|warning| warning.kind == kind);
    let heldout = if has(WarningKind::NothingHeldOut) {
        "the model describes the fitted cycles down to the noise; no cycle is held out, so no prediction was tested"
    } else {
        "the model describes the fitted and the held-out cycles down to the noise"
    };
    Trust { level, reason: heldout.into() }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(kinds: &[WarningKind]) -> Trust {
        let warning = |kind: &WarningKind| Warning { kind: *kind, text: format!("{kind:?}"), advice: String::new() };
        trust(&kinds.iter().map(warning).collect::<Vec<_>>())
    }

    #[test]
    fn a_reason_is_a_finding_without_its_explanation() {
        let text = "the draws have not converged: R̂ 1.2".into();
        let found = trust(&[Warning { kind: WarningKind::NotConverged, text, advice: String::new() }]);
        assert_eq!(found.to_string(), "Not to be trusted as it stands: the draws have not converged.");
    }

    #[test]
    fn the_gravest_warnings_set_the_level_and_the_reason() {
        use WarningKind::*;
        assert_eq!(of(&[]).level, TrustLevel::Trusted);
        let untested = of(&[NothingHeldOut, MeshTooCoarse]);
        assert!(untested.level == TrustLevel::Trusted && untested.reason.contains("no prediction was tested"));
        let large = of(&[NothingHeldOut, LargeStrain, LargeDisplacement, LargeStrain]);
        assert_eq!((large.level, large.reason.as_str()), (TrustLevel::Effective, "LargeStrain; LargeDisplacement"));
        assert!(large.is_sound());
        let wrong = of(&[LargeStrain, MisfitAboveNoise]);
        assert_eq!((wrong.level, wrong.reason.as_str()), (TrustLevel::Untrusted, "MisfitAboveNoise"));
        assert!(!wrong.is_sound() && !Trust::default().is_sound());
        // Unknown noise never gives the highest level.
        assert_eq!(of(&[NoiseUnknown]).level, TrustLevel::Effective);
        assert_eq!(of(&[ResidualsUntested]).level, TrustLevel::Untrusted);
        assert_eq!(of(&[SystematicResidual, NoiseUnknown]).level, TrustLevel::Untrusted);
    }
}
