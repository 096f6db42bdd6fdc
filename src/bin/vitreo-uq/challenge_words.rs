//! What `challenge` says.

use std::collections::BTreeMap;
use std::path::Path;

use vitreo_uq::documents::diagnosis::Diagnosis;
use vitreo_uq::figures::page::PlaysPage;
use vitreo_uq::validation::challenge::files::Opened;
use vitreo_uq::validation::challenge::play::Play;
use vitreo_uq::validation::challenge::tally::{Group, Tally};
use vitreo_uq::validation::challenge::{Disturbance, OutsideKind};

use crate::text::significant;

/// What was made in a directory, of which nothing but hashes may be told, and what can be done with it.
pub fn words_of_made(out: &Path, commitments: &[String]) -> String {
    let dir = out.display();
    if let [commitment] = commitments {
        return format!(
            "A challenge is in {dir}; its answer is sealed (SHA-256 {commitment}).\n\
             Where does the model fail?   vitreo-uq compare {dir}\n\
             What is missing?             vitreo-uq diagnose {dir}\n\
             Was that right?              vitreo-uq challenge reveal {dir}\n"
        );
    }
    let n = commitments.len();
    format!(
        "{n} challenges are in {dir}, each in a directory of its own; their answers are sealed (SHA-256 in `commitment.sha256`).\n\
         What do they lack together?  vitreo-uq diagnose {dir}\n\
         What was hidden in one?      vitreo-uq challenge reveal {dir}/{:0width$}\n",
        1,
        width = n.to_string().len()
    )
}

/// The answer of one challenge, and what a diagnosis said of it, which was looked for in a study.
pub fn words_of_truth(
    opened: &Opened,
    judged: Option<&(Play, Diagnosis)>,
    challenge: &Path,
    looked_in: &Path,
) -> String {
    let truth = &opened.answer.truth;
    let mut lines = vec![format!("The seal is whole: the answer has the hash {}.", opened.commitment_sha256)];
    let [e, c1, c2] = truth.law.map(significant);
    match &truth.outside {
        Some(outside) => {
            let sigma = truth
                .outside_sigma
                .map_or(String::new(), |sigma| format!(", a signal of {} standard deviations", significant(sigma)));
            let (name, size) = (outside.kind.name(), size_of(outside));
            lines.push(format!("Hidden: {name}, which is not of the library{sigma}{size}."));
            if !truth.ideal_class.is_empty() {
                lines.push(format!("In this experiment it looks like {}.", truth.ideal_class.join(" or ")));
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
        lines.push(format!("This experiment cannot tell these apart: {}.", truth.ideal_class.join(", ")));
    }
    if !truth.not_compared.is_empty() {
        lines.push(format!("Not compared with it yet: {}. With a diagnosis they are.", truth.not_compared.join(", ")));
    }
    lines.push(format!(
        "Law: E = {e} Pa, c1 = {c1} Pa s, c2 = {c2} Pa s; noise: {}{}; protocol: {}.",
        truth.noise.name(),
        if truth.is_noise_given { "" } else { ", not stated" },
        truth.protocol.name()
    ));
    match judged {
        None => lines.push(format!(
            "No diagnosis of these data was found in {}: `vitreo-uq diagnose {}` makes one; if it was written elsewhere, say where with `--study DIR`.",
            looked_in.display(),
            challenge.display()
        )),
        Some((play, diagnosis)) => {
            lines.push(String::new());
            lines.push(format!("The diagnosis said: {}", diagnosis.verdict.sentence));
            lines.push(if play.is_right() { "That is right.".into() } else { "That is not right.".into() });
            lines.extend(play.size_covered.map(|covered| {
                let word = if covered { "lies" } else { "does not lie" };
                format!("The true size {word} in its 90 % interval.")
            }));
            lines.extend(error_of(play));
        }
    }
    lines.join("\n") + "\n"
}

/// The error on the scored cycle beside the noise that was drawn and the noise that the diagnosis predicts; `None` where no cycle was scored.
fn error_of(play: &Play) -> Option<String> {
    let what = if play.class.is_empty() { "without anything added" } else { "with what was named" };
    let error = format!("The error on the last held-out cycle, {what}, is {} µm", significant(play.rmse_heldout_um?));
    let of_truth = match (play.heldout_over_true_noise, play.true_noise_um) {
        (Some(ratio), Some(noise_um)) => {
            format!("{ratio:.2} of the {} µm of noise that were put there", significant(noise_um))
        }
        _ => "this seal does not hold the noise that was put there".into(),
    };
    let of_diagnosis = play
        .heldout_over_predictive_noise
        .map_or(String::new(), |ratio| format!(", {ratio:.2} of the noise that the diagnosis predicts"));
    Some(format!("{error}: {of_truth}{of_diagnosis}."))
}

/// How far the robot would go, where that is what is hidden.
fn size_of(outside: &Disturbance) -> String {
    match outside.kind {
        OutsideKind::LargeDisplacement => {
            let mobility = outside.shape.first().copied().unwrap_or(0.0);
            format!(
                "; the gel is Giesekus's fluid of mobility {}, and the robot would come {} of its radii away, if the gel were linear",
                significant(mobility),
                significant(outside.size)
            )
        }
        _ => String::new(),
    }
}

/// What was said of every truth, and how often.
fn said_of(tally: &Tally) -> Vec<(&str, usize, String)> {
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

/// Rates of what was played.
fn rates(tally: &Tally) -> Vec<(&'static str, String)> {
    let percent = |value: f64| format!("{:.1} %", 100.0 * value);
    let rates = [
        ("one hidden effect: in the reported class", tally.class_coverage),
        ("one hidden effect: first, but for what cannot be told from it", tally.first_place_separated),
        ("its true size in the 90 % interval", tally.interval_coverage_90),
        ("two hidden effects: both in the reported class", tally.pair_coverage),
        ("rightly named: held-out error within 1.1 of the true noise", tally.heldout_at_true_noise),
        ("rightly named: within 1.1 of the predictive noise", tally.heldout_at_predictive_noise),
        ("nothing hidden: an effect claimed", tally.false_claims),
        ("nothing hidden: called unexplained", tally.false_unexplained),
        ("outside the library: called unexplained", tally.unexplained_called),
        ("outside the library: silently called an effect", tally.misattributed),
    ];
    let mut rates: Vec<_> = rates.into_iter().filter_map(|(what, rate)| Some((what, percent(rate?)))).collect();
    if let (Some(size), Some(ideal)) = (tally.mean_class_size, tally.ideal_class_size) {
        rates.push(("mean size of the class", format!("{size:.2}")));
        rates.push(("  as large as this experiment makes it", format!("{ideal:.2}")));
    }
    rates
}

const GROUP_HEADS: [&str; 7] = ["sort", "protocol", "noise", "signal", "played", "right", "claimed"];

/// A row a group: its sort, protocol, noise and signal, and how many were played, right and claimed.
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

/// What many plays came to.
pub fn words_of_plays(tally: &Tally) -> String {
    let mut lines = vec![format!("{} challenges were played.", tally.played), String::new()];
    lines.push(format!("  {:<44}{:>6}   said", "hidden", "played"));
    lines.extend(said_of(tally).iter().map(|(truth, total, said)| format!("  {truth:<44}{total:>6}   {said}")));
    lines.push(String::new());
    lines.extend(rates(tally).iter().map(|(what, rate)| format!("  {what:<64}{rate:>8}")));
    if tally.failed > 0 {
        lines.push(format!("  {} diagnoses failed; `--json` says why.", tally.failed));
    }
    lines.push(String::new());
    let line = |[sort, protocol, noise, signal, played, right, claimed]: &[String; 7]| {
        format!("  {sort:<11}{protocol:<9}{noise:<10}{signal:>8}{played:>8}{right:>8}{claimed:>9}")
    };
    lines.push(line(&GROUP_HEADS.map(String::from)));
    lines.extend(groups(tally).iter().map(line));
    lines.join("\n") + "\n"
}

/// The same as tables of a page.
pub fn page_of_plays(tally: &Tally) -> PlaysPage {
    let hidden = said_of(tally).into_iter().map(|(truth, total, said)| vec![truth.into(), total.to_string(), said]);
    let rates = rates(tally).into_iter().map(|(what, rate)| vec![what.trim().into(), rate]);
    PlaysPage {
        played: tally.played,
        failed: tally.failed,
        said: hidden.collect(),
        rates: rates.collect(),
        group_heads: GROUP_HEADS.to_vec(),
        groups: groups(tally).into_iter().map(Vec::from).collect(),
    }
}
