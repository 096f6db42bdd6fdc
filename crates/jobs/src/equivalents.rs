//! Equivalents of a revision's effects: other effects that a diagnosis of the study cannot distinguish from them.
//!
//! Each call reads the diagnoses that are on disk. If a new diagnosis distinguishes two effects, later documents no longer list them as equivalent.

use base::error::Result;
use documents::diagnosis::{CandidateEntry, Diagnosis};
use documents::extension::{EquivalentEffects, EquivalentRefit, ExtensionSummary};
use documents::posterior::{ParameterSummary, Warning, WarningKind};
use posterior::study::{DIAGNOSIS_NAME, EXTENSION_NAME, Study};
use serde::de::DeserializeOwned;

use crate::last_cycle::read_document;

/// Equivalents of all effects that were added from the first revision up to `revision`, in order of addition.
///
/// # Errors
/// [`base::Error::Input`] if the study has no such revision.
pub fn revision_equivalents(study: &Study, revision: &str) -> Result<Vec<EquivalentEffects>> {
    let extension: Option<ExtensionSummary> = document(study, revision, EXTENSION_NAME)?;
    // A revision can only extend an earlier revision. An extension document that names a later revision is ignored.
    let number = |name: &str| name.get(1..).and_then(|digits| digits.parse::<u32>().ok());
    let Some(extension) = extension.filter(|extension_summary| number(&extension_summary.from) < number(revision))
    else {
        return Ok(Vec::new());
    };
    let mut list = revision_equivalents(study, &extension.from)?;
    let diagnosis: Option<Diagnosis> = document(study, &extension.from, DIAGNOSIS_NAME)?;
    let as_written = extension.equivalents.iter().filter(|equivalent| equivalent.revision == revision);
    match &diagnosis {
        // The diagnosis was removed, so the list in the extension's document is used.
        None if as_written.clone().next().is_some() => list.extend(as_written.cloned()),
        _ => list.extend(added_equivalents(diagnosis.as_ref(), &extension.from, revision, &extension.effects)),
    }
    Ok(list)
}

/// Equivalents of the effects of the revision `from`, and of the effects `added` to it in `revision`.
///
/// # Errors
/// As [`revision_equivalents`].
pub fn extension_equivalents(
    study: &Study,
    from: &str,
    revision: &str,
    added: &[String],
) -> Result<Vec<EquivalentEffects>> {
    let mut list = revision_equivalents(study, from)?;
    let diagnosis: Option<Diagnosis> = document(study, from, DIAGNOSIS_NAME)?;
    list.extend(added_equivalents(diagnosis.as_ref(), from, revision, added));
    Ok(list)
}

/// Equivalents of added effects according to a diagnosis. The list has one entry for the added effects that the diagnosis claims, and one for the other
/// added effects.
fn added_equivalents(
    diagnosis: Option<&Diagnosis>,
    from: &str,
    revision: &str,
    added: &[String],
) -> Vec<EquivalentEffects> {
    let class = diagnosis.map(equivalence_class).unwrap_or_default();
    let is_claimed = |slug: &&String| class.claimed.contains(slug);
    let (claimed, others): (Vec<&String>, Vec<&String>) = added.iter().partition(is_claimed);
    let rivals: Vec<String> = class.rivals(&claimed);
    let refits = match diagnosis {
        Some(diagnosis) if !rivals.is_empty() => {
            let all = claimed.iter().copied().chain(&rivals);
            all.filter_map(|slug| diagnosis.candidates.iter().find(|candidate| candidate.effect == **slug))
                .map(refit)
                .collect()
        }
        _ => Vec::new(),
    };
    let entry = |effects: Vec<&String>, diagnosis_of: Option<&str>, rivals, refits| EquivalentEffects {
        revision: revision.into(),
        effects: effects.into_iter().cloned().collect(),
        rivals,
        diagnosis_of: diagnosis_of.map(String::from),
        refits,
    };
    let tested = (!claimed.is_empty()).then(|| entry(claimed, Some(from), rivals, refits));
    let untested = (!others.is_empty()).then(|| entry(others, None, Vec::new(), Vec::new()));
    tested.into_iter().chain(untested).collect()
}

/// Effects that a diagnosis claims as missing, and equivalent effects, which the diagnosis cannot distinguish from the claimed effects.
#[derive(Default)]
struct EquivalenceClass {
    claimed: Vec<String>,
    equivalent: Vec<String>,
    /// `true` if the diagnosis claims a single effect. Each equivalent effect can then replace the claimed effect.
    is_single: bool,
}

impl EquivalenceClass {
    /// Effects of this class that could replace the effects in `added`, which belong to this class too.
    fn rivals(&self, added: &[&String]) -> Vec<String> {
        if added.is_empty() {
            return Vec::new();
        }
        let all = if self.is_single { &self.claimed } else { &self.equivalent };
        all.iter().filter(|slug| !added.contains(slug)).cloned().collect()
    }
}

/// Claimed effects of a diagnosis and their equivalents. A single claimed effect and its equivalents form one class, in which each effect can replace each
/// other effect.
fn equivalence_class(diagnosis: &Diagnosis) -> EquivalenceClass {
    let verdict = &diagnosis.verdict;
    let is_single = verdict.effects.len() == 1;
    let mut claimed = verdict.effects.clone();
    if is_single {
        claimed.extend(verdict.equivalent.iter().cloned());
    }
    EquivalenceClass { claimed, equivalent: verdict.equivalent.clone(), is_single }
}

/// Warning that parameters of the law depend on which of the equivalent effects is true, or that this was not tested. `None` if the diagnosis finds the same values with each,
/// within their 90 % intervals.
pub fn law_depends_on_effect(equivalents: &[EquivalentEffects], parameters: &[ParameterSummary]) -> Option<Warning> {
    let mut found: Vec<String> = Vec::new();
    for of_revision in equivalents.iter().filter(|of_revision| of_revision.diagnosis_of.is_none()) {
        found.push(format!(
            "the equivalents of {} were not tested, so that the law's parameters may depend on it",
            of_revision.effects.join(" and ")
        ));
    }
    for of_revision in equivalents {
        let [own, rivals @ ..] = &of_revision.refits[..] else { continue };
        for rival in rivals.iter().filter(|rival| of_revision.rivals.contains(&rival.effect)) {
            let moved = |parameter: &&ParameterSummary| {
                let mean = |refit: &EquivalentRefit| {
                    refit.parameters.iter().find(|of_refit| of_refit.name == parameter.name).map(|found| found.mean)
                };
                let by = mean(own).zip(mean(rival)).map(|(own, rival)| (rival - own).abs());
                !parameter.name.contains('.') && by.is_some_and(|by| by > 0.5 * (parameter.q95 - parameter.q05))
            };
            let names: Vec<&str> = parameters.iter().filter(moved).map(|parameter| parameter.name.as_str()).collect();
            if !names.is_empty() {
                found.push(format!(
                    "{} {} another value with {} in place of {}, which the record cannot tell apart",
                    names.join(", "),
                    if names.len() > 1 { "have" } else { "has" },
                    rival.effect,
                    own.effect
                ));
            }
        }
    }
    (!found.is_empty()).then(|| Warning {
        kind: WarningKind::ModelIncomplete,
        text: found.join("; "),
        advice: "diagnose the revision before the effect, if that was not done; then record the experiment that tells the effects apart (`vitreo-uq design`), or state the parameters with each effect".into(),
    })
}

fn refit(candidate: &CandidateEntry) -> EquivalentRefit {
    let entry = candidate.refit.as_ref();
    EquivalentRefit {
        effect: candidate.effect.clone(),
        rmse_heldout_um: entry.and_then(|refit| refit.rmse_heldout_um),
        parameters: entry
            .map_or(Vec::new(), |refit| refit.parameters.iter().chain(&refit.law_parameters).cloned().collect()),
    }
}

/// Reads a document of a revision; `None` if it is missing or unreadable.
fn document<T: DeserializeOwned>(study: &Study, revision: &str, name: &str) -> Result<Option<T>> {
    Ok(read_document(&study.revision_dir(revision)?.join(name)).map(|document| document.body))
}

#[cfg(test)]
mod tests {
    use super::*;
    use documents::diagnosis::{BaseErrors, Refit, RefitParameter, Status, Verdict, VerdictKind};

    fn candidate(effect: &str, status: Status) -> CandidateEntry {
        let parameters = vec![RefitParameter { name: format!("{effect}.x"), mean: 1.0, q05: 0.5, q95: 1.5 }];
        CandidateEntry {
            effect: effect.into(),
            status,
            z: 5.0,
            p_familywise: 0.01,
            visible_fraction: 0.5,
            expected_parameter: None,
            refit: Some(Refit {
                gain_nats: 20.0,
                heldout_gain_nats: None,
                last_cycle_gain_nats: None,
                rmse_heldout_um: Some(4.0),
                largest_change: 1.0,
                log_bayes_factor: None,
                log_bayes_factor_at_most: None,
                parameters,
                law_parameters: Vec::new(),
                answers: Vec::new(),
            }),
            twins: Vec::new(),
            refused: None,
        }
    }

    fn diagnosis(effects: &[&str], equivalent: &[&str]) -> Diagnosis {
        let names = |list: &[&str]| -> Vec<String> { list.iter().map(|slug| slug.to_string()).collect() };
        Diagnosis {
            experiment: "gel".into(),
            verdict: Verdict {
                kind: VerdictKind::Missing,
                effects: names(effects),
                equivalent: names(equivalent),
                base_law: None,
                sentence: String::new(),
            },
            fitted_cycles: vec![1, 2],
            heldout_cycles: vec![3],
            base: BaseErrors { rmse_fitted_um: 5.0, rmse_heldout_um: Some(6.0), noise_um: Some(4.0) },
            extended: None,
            search_noise_um: 4.2,
            candidates: [effects, equivalent].concat().iter().map(|slug| candidate(slug, Status::Claimed)).collect(),
            pairs: Vec::new(),
            blind_spots: Vec::new(),
            smallest_detectable: Vec::new(),
            separating_protocol: String::new(),
            noise: Vec::new(),
            unexplained: Vec::new(),
            discrepancy: None,
            outlier_rows: Vec::new(),
            remarks: Vec::new(),
        }
    }

    fn added(diagnosis: Option<&Diagnosis>, effects: &[&str]) -> Vec<EquivalentEffects> {
        let effects: Vec<String> = effects.iter().map(|slug| slug.to_string()).collect();
        added_equivalents(diagnosis, "m0", "m1", &effects)
    }

    #[test]
    fn a_claim_keeps_its_equivalents_with_both_refits() {
        let found = &added(Some(&diagnosis(&["clock-offset"], &["actuator-lag"])), &["clock-offset"])[..];
        let [equivalent_effects] = found else { panic!("{found:?}") };
        assert_eq!(
            (equivalent_effects.rivals.clone(), equivalent_effects.diagnosis_of.as_deref()),
            (vec!["actuator-lag".to_string()], Some("m0"))
        );
        let refits: Vec<&str> = equivalent_effects.refits.iter().map(|refit| refit.effect.as_str()).collect();
        assert_eq!(refits, ["clock-offset", "actuator-lag"]);
        assert_eq!(equivalent_effects.alternative().as_deref(), Some("or: actuator-lag"));
        assert!(equivalent_effects.sentence().expect("a rival").contains("cannot tell clock-offset from actuator-lag"));
    }

    /// If an equivalent effect is added instead of the claimed effect, the claimed effect is listed as its equivalent.
    #[test]
    fn a_rival_that_is_added_has_the_claim_for_a_rival() {
        let found = added(Some(&diagnosis(&["clock-offset"], &["actuator-lag"])), &["actuator-lag"]);
        assert_eq!((found.len(), &found[0].rivals[..]), (1, &["clock-offset".to_string()][..]));
    }

    #[test]
    fn rivals_of_a_pair_stand_for_one_of_it() {
        let of_pair = diagnosis(&["clock-offset", "force-bias"], &["actuator-lag"]);
        let found = added(Some(&of_pair), &["clock-offset", "force-bias"]);
        assert_eq!((found.len(), &found[0].rivals[..]), (1, &["actuator-lag".to_string()][..]));
        assert!(found[0].sentence().expect("a rival").contains("one of clock-offset and force-bias"));
    }

    #[test]
    fn what_no_diagnosis_claimed_was_not_tested() {
        let separated = diagnosis(&["clock-offset"], &[]);
        for (diagnosis, effect) in [(None, "clock-offset"), (Some(&separated), "force-bias")] {
            let found = &added(diagnosis, &[effect])[..];
            let [equivalent_effects] = found else { panic!("{found:?}") };
            assert!(
                equivalent_effects.diagnosis_of.is_none()
                    && equivalent_effects.rivals.is_empty()
                    && equivalent_effects.alternative().is_none()
            );
            assert!(
                equivalent_effects.sentence().expect("untested").contains("were not tested"),
                "{equivalent_effects:?}"
            );
        }
        // The diagnosis distinguishes this effect from the others, so there is no remark.
        let found = added(Some(&separated), &["clock-offset"]);
        assert!(found[0].sentence().is_none() && found[0].refits.is_empty());
    }
}
