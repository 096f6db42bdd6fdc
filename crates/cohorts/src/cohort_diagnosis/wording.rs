//! Sentences on the diagnosis of a cohort.

use documents::cohort::{CohortContrast, CohortEffect, CohortErrors, CohortGroup, CohortSpecimen, NullSide};
use documents::diagnosis::{Status, VerdictKind, group_by_reason};
use documents::groups::RatioVerdict;
use figures::labels::parameter_label;
use figures::number::format_significant;

/// Largest number of names that a sentence lists.
const MOST_NAMES: usize = 8;
/// Largest fraction of specimens with the effect in a group that shows no sign of this effect.
const SMALL_SHARE: f64 = 0.35;
/// Largest gain in log likelihood (nats) of a group that shows no sign of the effect.
const NOTHING_NATS: f64 = 1.0;

fn percent(share: f64) -> String {
    format!("{:.0} %", 100.0 * share)
}

/// Joins at most [`MOST_NAMES`] names, and adds the number of the remaining names.
fn listed(names: &[&str]) -> String {
    let more = names.len().saturating_sub(MOST_NAMES);
    let shown = names.iter().take(MOST_NAMES).copied().collect::<Vec<_>>().join(", ");
    if more > 0 { format!("{shown} and {more} more") } else { shown }
}

/// Describes the sizes in a group, such as "β 2.1 (1.8 to 2.4) m/s, ×/÷ 1.30 between specimens; 95 % (80 % to 100 %) of the records have it".
pub fn sizes(group: &CohortGroup) -> String {
    let label = parameter_label(&group.parameter);
    let unit = if label.unit == "–" { String::new() } else { format!(" {}", label.unit) };
    let [median, q05, q95] = [group.median, group.q05, group.q95].map(|x| format_significant(x, 3));
    let sides = match group.sides {
        NullSide::Above => "",
        NullSide::Below => " below its null",
        NullSide::Either => " of either sign",
    };
    format!(
        "{} {median} ({q05} to {q95}){unit}{sides}, ×/÷ {:.2} between specimens; {} ({} to {}) of the records have it",
        label.symbol,
        group.between_specimen_log_sd.exp(),
        percent(group.share),
        percent(group.share_q05),
        percent(group.share_q95)
    )
}

/// Sentence that states the verdict. `left` holds the error with the leading effect (µm) on all held-out cycles, and the ratio of this error to the error
/// that the predictive noise allows.
pub fn verdict(
    (kind, leading, equivalent): (VerdictKind, Option<&CohortEffect>, &[String]),
    (pooled, groups, specimens): (Option<&CohortGroup>, &[CohortGroup], &[CohortSpecimen]),
    left: Option<(f64, f64)>,
    base: CohortErrors,
) -> String {
    let n = specimens.len();
    let gained = leading.map(|cohort_effect| {
        let heldout = cohort_effect
            .heldout_gain_nats
            .map_or("no cycle is held out".into(), |gain| format!("{gain:.1} nats on held-out cycles"));
        format!(
            "{:.1} nats over {n} records, p {}, {heldout}",
            cohort_effect.gain_nats,
            format_significant(cohort_effect.p_familywise, 2)
        )
    });
    match (kind, leading, gained) {
        (VerdictKind::Missing, Some(leading), Some(gained)) => {
            let alike = if equivalent.is_empty() {
                String::new()
            } else {
                format!(" These records cannot distinguish it from {}.", equivalent.join(", "))
            };
            let sizes = pooled.map_or_else(String::new, |cohort_group| format!(" {}.", sizes(cohort_group)));
            let absent: Vec<&str> =
                groups.iter().filter(|group| has_none(group)).map(|cohort_group| cohort_group.name.as_str()).collect();
            let absent = if absent.is_empty() || groups.len() < 2 {
                String::new()
            } else {
                format!(" No sign of it in {}.", listed(&absent))
            };
            format!("{} is missing: {gained}.{sizes}{absent}{alike}", leading.effect)
        }
        (VerdictKind::Unexplained, Some(leading), Some(gained)) if left.is_some() => {
            let (error_um, factor) = left.unwrap_or_default();
            let error = format_significant(error_um, 3);
            let but = match base.rmse_heldout_um.filter(|_| factor.is_infinite()) {
                Some(base_um) => format!(
                    "the error on the held-out cycles does not fall ({} µm before, {error} µm with it)",
                    format_significant(base_um, 3)
                ),
                None => format!(
                    "leaves an error of {error} µm on the held-out cycles, {factor:.1} times the error that noise and parameters allow"
                ),
            };
            format!(
                "the law is wrong, and no effect of the library explains it. {} helps most ({gained}), but {but}. Do not interpret its size as a property.",
                leading.effect
            )
        }
        (VerdictKind::Unexplained, ..) => {
            let left: Vec<&str> = too_much(specimens);
            format!(
                "the residuals of {} of {n} records exceed the noise ({}), and no effect that these records share explains them",
                left.len(),
                listed(&left)
            )
        }
        (_, Some(leading), Some(gained)) => {
            let verb = if leading.status == Status::Suggestive {
                "is suggested by the data"
            } else {
                "is the nearest candidate"
            };
            format!("no missing effect can be claimed; {} {verb}: {gained}", leading.effect)
        }
        _ => "no missing effect can be claimed: no effect gains anything over all records".into(),
    }
}

/// Returns `true` if the group's own records show no sign of the effect.
fn has_none(group: &CohortGroup) -> bool {
    group.gain_nats < NOTHING_NATS && group.share < SMALL_SHARE
}

fn too_much(specimens: &[CohortSpecimen]) -> Vec<&str> {
    specimens
        .iter()
        .filter(|specimen| specimen.leaves_too_much)
        .map(|cohort_specimen| cohort_specimen.experiment.as_str())
        .collect()
}

/// Sentence that compares the sizes of an effect in two groups.
pub fn contrast(cohort_contrast: &CohortContrast, [a, b]: [&CohortGroup; 2], margin: f64) -> String {
    let (more, less, ratio) = if cohort_contrast.ratio_median >= 1.0 {
        (a, b, [cohort_contrast.ratio_median, cohort_contrast.q05, cohort_contrast.q95])
    } else {
        (b, a, [1.0 / cohort_contrast.ratio_median, 1.0 / cohort_contrast.q95, 1.0 / cohort_contrast.q05])
    };
    let effect = &cohort_contrast.effect;
    if has_none(less) && cohort_contrast.is_declared {
        return format!("{} has {effect}, {} shows no sign of it", more.name, less.name);
    }
    let times = format!(
        "{} × ({} to {})",
        format_significant(ratio[0], 2),
        format_significant(ratio[1], 2),
        format_significant(ratio[2], 2)
    );
    match cohort_contrast.verdict {
        RatioVerdict::Greater | RatioVerdict::Less => format!(
            "{} has more {effect} than {}, by more than {} ({times} on average)",
            more.name,
            less.name,
            percent(margin)
        ),
        RatioVerdict::Equivalent => {
            format!("{effect}: no difference beyond {} between {} and {}", percent(margin), more.name, less.name)
        }
        RatioVerdict::Undecided if cohort_contrast.is_declared => {
            format!("{} has more {effect} than {}, by an undecided amount ({times})", more.name, less.name)
        }
        RatioVerdict::Undecided => format!("{effect}: undecided if {} and {} differ ({times})", more.name, less.name),
    }
}

/// Remarks on the diagnosis for the reader.
pub fn remarks(effects: &[CohortEffect], specimens: &[CohortSpecimen], kind: VerdictKind) -> Vec<String> {
    let mut remarks = Vec::new();
    let refused = effects.iter().map(|effect| (effect.effect.as_str(), effect.refused.as_deref()));
    let not =
        |(why, effects): (&str, Vec<&str>)| format!("{} cannot be tested in any record ({why})", listed(&effects));
    remarks.extend(group_by_reason(refused).into_iter().map(not));
    let left = too_much(specimens);
    if !left.is_empty() && kind == VerdictKind::Missing {
        remarks.push(format!(
            "before an effect is added, the residuals of {} of {} records exceed the noise ({})",
            left.len(),
            specimens.len(),
            listed(&left)
        ));
    }
    if kind == VerdictKind::Unexplained {
        remarks.push("run `vitreo-uq diagnose` on each of these records to find its own missing effect".into());
    }
    let outliers: usize = specimens.iter().map(|specimen| specimen.outliers).sum();
    if outliers > 0 {
        remarks.push(format!("{outliers} positions are isolated tracker errors and are left out"));
    }
    remarks
}
