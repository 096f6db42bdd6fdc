//! Formats the results of `challenge` as text and tables.

use std::collections::BTreeMap;
use std::path::Path;

use vitreo_uq::documents::diagnosis::Diagnosis;
use vitreo_uq::figures::page::ChallengeResultsPage;
use vitreo_uq::validation::challenge::files::OpenedChallenge;
use vitreo_uq::validation::challenge::play::Play;
use vitreo_uq::validation::challenge::tally::{Group, Tally};
use vitreo_uq::validation::challenge::{Disturbance, DisturbanceKind};

use crate::child::in_shell;
use crate::text::significant;

/// Text after `challenge new`: the directory, the hashes that seal the answers, and the next commands.
pub fn format_new_challenges(out: &Path, commitments: &[String]) -> String {
    let dir = in_shell(out);
    if let [commitment] = commitments {
        return format!(
            "The challenge is in {dir}. Its answer is sealed (SHA-256 {commitment}).\n\
             Where does the model fail?   vitreo-uq compare {dir}\n\
             What is missing?             vitreo-uq diagnose {dir}\n\
             Was that right?              vitreo-uq challenge reveal {dir}\n"
        );
    }
    let n = commitments.len();
    format!(
        "{n} challenges are in {dir}, each in its own directory. Their answers are sealed (SHA-256 in `commitment.sha256`).\n\
         What is missing in all?      vitreo-uq diagnose {dir}\n\
         What was hidden in one?      vitreo-uq challenge reveal {dir}/{:0width$}\n",
        1,
        width = n.to_string().len()
    )
}

/// Text of a challenge's answer, followed by the judgement of its diagnosis. Without a diagnosis, the text says that the study in the directory `looked_in`
/// contains none.
pub fn format_truth(
    opened: &OpenedChallenge,
    judged: Option<&(Play, Diagnosis)>,
    challenge: &Path,
    looked_in: &Path,
) -> String {
    let truth = &opened.answer.truth;
    let mut lines = vec![format!("The seal is intact: the answer's hash is {}.", opened.commitment_sha256)];
    let [e, c1, c2] = truth.law.map(significant);
    match &truth.outside {
        Some(outside) => {
            let sigma = truth
                .outside_sigma
                .map_or(String::new(), |sigma| format!(", a signal of {} standard deviations", significant(sigma)));
            let (name, size) = (outside.kind.name(), size_of(outside));
            lines.push(format!("Hidden: {name}, which is not in the library{sigma}{size}."));
            if !truth.ideal_class.is_empty() {
                lines.push(format!("This experiment cannot distinguish it from {}.", truth.ideal_class.join(" or ")));
            }
        }
        None if truth.effects.is_empty() => lines.push("Hidden: nothing.".into()),
        None => {}
    }
    for effect in &truth.effects {
        let values: Vec<String> =
            effect.parameters.iter().map(|p| format!("{} = {}", p.name, significant(p.value))).collect();
        lines.push(format!(
            "Hidden: {} ({}), a signal of {} standard deviations.",
            effect.slug,
            values.join(", "),
            significant(effect.signal_sigma)
        ));
    }
    if truth.outside.is_none() && truth.ideal_class.len() > truth.effects.len() {
        lines.push(format!("This experiment cannot distinguish these effects: {}.", truth.ideal_class.join(", ")));
    }
    if !truth.not_compared.is_empty() {
        lines.push(format!("Not compared yet: {}. Run a diagnosis to compare them.", truth.not_compared.join(", ")));
    }
    lines.push(format!(
        "Law: E = {e} Pa, c1 = {c1} Pa s, c2 = {c2} Pa s; noise: {}{}; protocol: {}.",
        truth.noise.name(),
        if truth.is_noise_given { "" } else { ", not stated" },
        truth.protocol.name()
    ));
    match judged {
        None => lines.push(format!(
            "{} has no diagnosis of these data. Run `vitreo-uq diagnose {}`, or give the study with `--study DIR`.",
            looked_in.display(),
            in_shell(challenge)
        )),
        Some((play, diagnosis)) => {
            lines.push(String::new());
            lines.push(format!("Diagnosis: {}", diagnosis.verdict.sentence));
            lines.push(if play.is_right() {
                "The diagnosis is right.".into()
            } else {
                "The diagnosis is wrong.".into()
            });
            lines.extend(play.size_covered.map(|covered| {
                let word = if covered { "is" } else { "is not" };
                format!("The true size {word} within its 90 % interval.")
            }));
            lines.extend(error_of(play));
        }
    }
    lines.join("\n") + "\n"
}

/// Sentence that compares the error on the last held-out cycle with the added noise, and with the noise that the diagnosis predicts. `None` if no cycle is held
/// out.
fn error_of(play: &Play) -> Option<String> {
    let what = if play.class.is_empty() { "without an added effect" } else { "with the claimed effects" };
    let error = format!("The error on the last held-out cycle, {what}, is {} µm", significant(play.rmse_heldout_um?));
    let of_truth = match (play.heldout_over_true_noise, play.true_noise_um) {
        (Some(ratio), Some(noise_um)) => {
            format!("{ratio:.2} times the added noise of {} µm", significant(noise_um))
        }
        _ => "the seal does not contain the added noise".into(),
    };
    let of_diagnosis = play
        .heldout_over_predictive_noise
        .map_or(String::new(), |ratio| format!(", {ratio:.2} times the noise that the diagnosis predicts"));
    Some(format!("{error}: {of_truth}{of_diagnosis}."))
}

/// Text of a disturbance by large displacements: how far the robot moves, and in which fluid. Empty for other disturbances.
fn size_of(outside: &Disturbance) -> String {
    match outside.kind {
        DisturbanceKind::LargeDisplacement => {
            let mobility = outside.shape.first().copied().unwrap_or(0.0);
            format!(
                "; the gel is a Giesekus fluid of mobility {}, and in a linear gel the robot would move {} of its radii",
                significant(mobility),
                significant(outside.size)
            )
        }
        _ => String::new(),
    }
}

/// One row for each hidden truth: its name, the number of challenges with it, and the verdicts with their counts.
fn verdict_rows(tally: &Tally) -> Vec<(&str, usize, String)> {
    let mut rows: BTreeMap<&str, Vec<(&str, usize)>> = BTreeMap::new();
    for entry in &tally.confusion {
        rows.entry(&entry.truth).or_default().push((&entry.said, entry.count));
    }
    let row = |(truth, mut said): (_, Vec<(&str, usize)>)| {
        said.sort_by(|a, b| b.1.cmp(&a.1).then(a.0.cmp(b.0)));
        let total = said.iter().map(|(_, count)| count).sum();
        let said: Vec<String> = said.iter().map(|(what, count)| format!("{what} {count}")).collect();
        (truth, total, said.join(", "))
    };
    rows.into_iter().map(row).collect()
}

/// Name and value of each rate over all challenges played.
fn rates(tally: &Tally) -> Vec<(&'static str, String)> {
    let percent = |value: f64| format!("{:.1} %", 100.0 * value);
    let rates = [
        ("one hidden effect: claimed, or equivalent to the claim", tally.class_coverage),
        ("one hidden effect: first in rank, or equivalent to the first", tally.first_place_separated),
        ("one hidden effect: true size in the 90 % interval", tally.interval_coverage_90),
        ("two hidden effects: both claimed, or equivalent to a claim", tally.pair_coverage),
        ("right claims: held-out error at most 1.1 × true noise", tally.heldout_at_true_noise),
        ("right claims: held-out error at most 1.1 × predicted noise", tally.heldout_at_predictive_noise),
        ("nothing hidden: an effect claimed", tally.false_claims),
        ("nothing hidden: verdict unexplained", tally.false_unexplained),
        ("outside the library: verdict unexplained", tally.unexplained_called),
        ("outside the library: wrongly claimed as an effect", tally.misattributed),
    ];
    let mut rates: Vec<_> = rates.into_iter().filter_map(|(what, rate)| Some((what, percent(rate?)))).collect();
    if let (Some(size), Some(ideal)) = (tally.mean_class_size, tally.ideal_class_size) {
        rates.push(("mean number of claimed effects, equivalent ones included", format!("{size:.2}")));
        rates.push(("  smallest number that these experiments allow", format!("{ideal:.2}")));
    }
    rates
}

const GROUP_HEADS: [&str; 7] = ["sort", "protocol", "noise", "signal", "played", "right", "claimed"];

/// One row for each combination of hidden sort, protocol, noise and signal, with the numbers of challenges, right diagnoses and claims.
fn groups(tally: &Tally) -> Vec<[String; 7]> {
    let row = |group: &Group| {
        [
            group.sort.name().into(),
            group.protocol.name().into(),
            group.noise.name().into(),
            group.signal_sigma.map_or("–".into(), |sigma| sigma.to_string()),
            group.played.to_string(),
            group.right.to_string(),
            group.claimed.to_string(),
        ]
    };
    tally.groups.iter().map(row).collect()
}

/// Text of the results of a run of challenges.
pub fn format_plays(tally: &Tally) -> String {
    let mut lines = vec![format!("{} challenges were played.", tally.played), String::new()];
    lines.push(format!("  {:<44}{:>6}   verdicts", "hidden", "played"));
    lines.extend(verdict_rows(tally).iter().map(|(truth, total, said)| format!("  {truth:<44}{total:>6}   {said}")));
    lines.push(String::new());
    lines.extend(rates(tally).iter().map(|(what, rate)| format!("  {what:<64}{rate:>8}")));
    if tally.failed > 0 {
        lines.push(format!("  {} diagnoses failed; `--json` lists the reasons.", tally.failed));
    }
    lines.push(String::new());
    let line = |[sort, protocol, noise, signal, played, right, claimed]: &[String; 7]| {
        format!("  {sort:<11}{protocol:<9}{noise:<10}{signal:>8}{played:>8}{right:>8}{claimed:>9}")
    };
    lines.push(line(&GROUP_HEADS.map(String::from)));
    lines.extend(groups(tally).iter().map(line));
    lines.join("\n") + "\n"
}

/// The results of a run of challenges as tables for an HTML page.
pub fn plays_page(tally: &Tally) -> ChallengeResultsPage {
    let hidden =
        verdict_rows(tally).into_iter().map(|(truth, total, said)| vec![truth.into(), total.to_string(), said]);
    let rates = rates(tally).into_iter().map(|(what, rate)| vec![what.trim().into(), rate]);
    ChallengeResultsPage {
        played: tally.played,
        failed: tally.failed,
        verdicts: hidden.collect(),
        rates: rates.collect(),
        group_heads: GROUP_HEADS.to_vec(),
        groups: groups(tally).into_iter().map(Vec::from).collect(),
    }
}
