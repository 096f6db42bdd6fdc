//! Sentences and warnings on a comparison of groups.

use super::hierarchy::{FEWEST_EFFECTIVE_DRAWS, LARGEST_RHAT};
use documents::groups::{
    ContrastSummary, ExperimentSummary, GroupSummary, GroupsSummary, RatioVerdict, SampleSizePlan,
};
use documents::posterior::{Warning, WarningKind};
use figures::labels::parameter_label;

/// Largest number of pairs of groups in a sentence.
const MOST_PAIRS: usize = 3;
/// Largest number of names in a sentence.
const MOST_NAMES: usize = 8;

/// Returns one line of heading: the numbers of specimens, experiments and groups, and the model of the comparison.
pub fn heading(summary: &GroupsSummary) -> String {
    let measured: Vec<&GroupSummary> = summary.groups.iter().filter(|group| group.specimens > 0).collect();
    let model = match summary.effects.len() {
        0 => format!("{} law", summary.law),
        _ => format!("{} law with {}", summary.law, summary.effects.join(", ")),
    };
    format!(
        "{} from {} in {} by {}; {model}",
        counted(summary.n_specimens, "specimen"),
        counted(summary.experiments.len(), "experiment"),
        counted(measured.len(), "group"),
        summary.by.join(" and ")
    )
}

/// Number with its noun, such as "1 specimen" or "21 specimens".
fn counted(n: usize, what: &str) -> String {
    format!("{n} {what}{}", if n == 1 { "" } else { "s" })
}

/// Conclusions, one sentence per parameter: which pairs of groups are different, equivalent or undecided.
pub fn conclusions(summary: &GroupsSummary) -> Vec<String> {
    let margin = format!("{:.0} %", 100.0 * summary.margin);
    let names = summary.groups.first().map_or(&[][..], |group| &group.parameters);
    let of_parameter_named = |name: &str| {
        let contrast: Vec<&ContrastSummary> =
            summary.contrasts.iter().filter(|contrast| contrast.parameter == name).collect();
        let part = |is: &dyn Fn(&ContrastSummary) -> bool, before: &str, after: &str| {
            let list: Vec<String> = contrast
                .iter()
                .filter(|contrast_summary| is(contrast_summary))
                .map(|contrast_summary| as_greater(contrast_summary))
                .collect();
            (!list.is_empty()).then(|| format!("{before}{}{after}", at_most(MOST_PAIRS, &list)))
        };
        let is_beyond = |contrast_summary: &ContrastSummary| {
            matches!(contrast_summary.verdict, RatioVerdict::Greater | RatioVerdict::Less)
        };
        let is_open = |contrast_summary: &ContrastSummary| contrast_summary.verdict == RatioVerdict::Undecided;
        let parts = [
            part(&is_beyond, "", &format!(" by more than {margin}")),
            part(
                &|contrast_summary| is_open(contrast_summary) && contrast_summary.is_declared,
                "",
                " by an undecided amount",
            ),
            part(
                &|contrast_summary| contrast_summary.verdict == RatioVerdict::Equivalent,
                &format!("no difference beyond {margin}: "),
                "",
            ),
            part(&|contrast_summary| is_open(contrast_summary) && !contrast_summary.is_declared, "undecided: ", ""),
        ];
        format!("{}: {}.", parameter_label(name).symbol, parts.into_iter().flatten().collect::<Vec<_>>().join("; "))
    };
    if summary.contrasts.is_empty() {
        return Vec::new();
    }
    names.iter().map(|name| of_parameter_named(&name.name)).collect()
}

/// Describes a ratio between two groups with the greater group first, such as "bovine above porcine (2.4 ×)".
fn as_greater(contrast_summary: &ContrastSummary) -> String {
    let (greater, less, ratio) = if contrast_summary.ratio_median >= 1.0 {
        (&contrast_summary.a, &contrast_summary.b, contrast_summary.ratio_median)
    } else {
        (&contrast_summary.b, &contrast_summary.a, 1.0 / contrast_summary.ratio_median)
    };
    format!("{greater} above {less} ({ratio:.2} ×)")
}

/// Describes how many more specimens would decide whether two groups differ.
pub fn required_specimens(plan: &SampleSizePlan) -> String {
    match plan.specimens_per_group {
        Some(n) => {
            format!("undecided: {n} more specimens per group settle it with {:.0} % probability", 100.0 * plan.chance)
        }
        None => format!(
            "undecided: 512 more specimens per group settle it with only {:.0} % probability",
            100.0 * plan.chance
        ),
    }
}

/// Joins at most [`MOST_NAMES`] names, and adds the number of the remaining names.
fn join_names(names: &[&str]) -> String {
    at_most(MOST_NAMES, names)
}

/// Joins at most `most` entries of a list, and adds the number of the remaining entries.
fn at_most(most: usize, names: &[impl AsRef<str>]) -> String {
    let shown: Vec<&str> = names.iter().take(most).map(AsRef::as_ref).collect();
    let more = if names.len() > most { format!(" and {} more", names.len() - most) } else { String::new() };
    shown.join(", ") + &more
}

/// All warnings that apply to the comparison, most serious first.
pub fn warnings(summary: &GroupsSummary) -> Vec<Warning> {
    let mut all = Vec::new();
    let mut add = |kind, text: String, advice: &str| all.push(Warning { kind, text, advice: advice.into() });
    let sampler = &summary.sampler;
    if !summary.converged {
        let text = format!(
            "the population's draws have not converged: R̂ {:.3} (at most {LARGEST_RHAT}), {:.0} effective draws (at least {FEWEST_EFFECTIVE_DRAWS})",
            sampler.rhat, sampler.ess
        );
        add(WarningKind::NotConverged, text, "give more sweeps (--sweeps)");
    }
    let names = |is: &dyn Fn(&ExperimentSummary) -> bool| -> Vec<&str> {
        summary
            .experiments
            .iter()
            .filter(|experiment| is(experiment))
            .map(|experiment_summary| experiment_summary.name.as_str())
            .collect()
    };
    let unconverged = names(&|experiment_summary| !experiment_summary.converged);
    if !unconverged.is_empty() {
        let text = format!("the draws of {} have not converged", join_names(&unconverged));
        add(
            WarningKind::NotConverged,
            text,
            "check each with `vitreo-uq sample`; give more steps (--steps), a narrower prior (--prior), or leave it out (--leave-out)",
        );
    }
    let mut kinds: Vec<WarningKind> = Vec::new();
    for warning in summary.experiments.iter().flat_map(|experiment| &experiment.residual_warnings) {
        if !kinds.contains(&warning.kind) {
            kinds.push(warning.kind);
        }
    }
    for kind in kinds {
        let of_kind = |experiment: &ExperimentSummary| {
            experiment.residual_warnings.iter().find(|warning| warning.kind == kind).cloned()
        };
        let failing = names(&|experiment| of_kind(experiment).is_some());
        let Some(first) = summary.experiments.iter().find_map(of_kind) else { continue };
        let (n, all, of, in_first) = (failing.len(), summary.experiments.len(), join_names(&failing), failing[0]);
        let (text, advice) = if kind == WarningKind::MisfitAboveNoise {
            let advice = "run `vitreo-uq diagnose` on them, extend their studies and give the studies here, or leave them out (--leave-out)";
            (
                format!("the models of {n} of {all} experiments do not fit: {of}. In {in_first}, {}", first.text),
                advice.to_string(),
            )
        } else {
            (format!("{n} of {all} experiments need a second look: {of}. In {in_first}, {}", first.text), first.advice)
        };
        add(kind, text, &advice);
    }
    let unknown = names(&|experiment_summary| experiment_summary.noise_um.is_none());
    if !unknown.is_empty() {
        let text = format!("the noise of {} is unknown: it is not given and cannot be estimated", join_names(&unknown));
        add(WarningKind::ResidualsUntested, text, "give `noise_um` in [measurement]");
    }
    let alone: Vec<&str> = summary
        .groups
        .iter()
        .filter(|group| group.specimens == 1)
        .map(|group_summary| group_summary.name.as_str())
        .collect();
    if !alone.is_empty() {
        let text = format!("only one specimen was measured in {}", join_names(&alone));
        add(
            WarningKind::GroupOfOne,
            text,
            "the group's spread comes from the prior and the other groups; measure more specimens before you interpret the group's differences",
        );
    }
    let predicted: Vec<&str> = summary
        .groups
        .iter()
        .filter(|group| group.specimens == 0)
        .map(|group_summary| group_summary.name.as_str())
        .collect();
    if !predicted.is_empty() {
        let text = format!("nothing was measured in {}", join_names(&predicted));
        add(
            WarningKind::GroupPredicted,
            text,
            "the group's values are predicted from the other groups, so the group is not compared with them",
        );
    }
    let mut outlying: Vec<&str> = summary
        .specimens
        .iter()
        .filter(|specimen| specimen.is_outlying)
        .map(|specimen_summary| specimen_summary.name.as_str())
        .collect();
    outlying.sort_unstable();
    outlying.dedup();
    if !outlying.is_empty() {
        let text = format!("{} lies far from its group", join_names(&outlying));
        let advice = match summary.student_dof {
            Some(_) => "check its measurement; heavy tails keep it from widening the spread of its group",
            None => "check its measurement; with --heavy-tails it does not widen the spread of its group",
        };
        add(WarningKind::OutlyingSpecimen, text, advice);
    }
    all
}
