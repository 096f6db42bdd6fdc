//! The document of a diagnosis: candidates, claim, remarks and their sentences.

use super::bayes_factors::{BayesFactor, EvidenceSet};
use super::detectable::{Detectability, find_smallest_detectable};
use super::outside::OutsideStructure;
use super::own_errors::own_errors;
use super::predicted::predictive_noise_um;
use super::refit::{Gain, Refitted};
use super::request::DiagnosisRequest;
use super::residual_structure::{UnexplainedResidual, event_remark};
use super::search::{SearchResult, Single};
use super::verdict::{EffectEvidence, Verdict};
use super::{Candidate, Fitted, Subject, noise_learning, protocol, rank};
use base::error::Result;
use documents::diagnosis::{
    BaseErrors, CandidateEntry, Diagnosis, Errors, PairEntry, PosteriorMode, Refit, RefitParameter, SmallestDetectable,
    Status, UnexplainedMisfit, VerdictKind,
};
use documents::errors::ModelErrors;
use figures::number::format_significant;
use models::effects::AMPLITUDE;
use posterior::large_displacement::interpretation;
use posterior::misfit::Misfit;
use posterior::monitor::Monitor;
use posterior::patterns::Pattern;
use rayon::prelude::*;

/// Number of simulated repetitions of the experiment that confirm a change of the protocol.
const N_REPEATS: usize = 40;
/// Ratio of an error to the error after removal of each cycle's gain and offset. From this ratio on, a sentence mentions the second error: it tells why an error far above the noise
/// may be acceptable.
const WORTH_SAYING: f64 = 1.1;
/// Number of pairs of effects that the document lists.
const N_PAIRS: usize = 5;
/// Size of a pattern, as a part of the noise, from which predictions depend on its cause.
const LARGE_PATTERN: f64 = 0.5;

/// Results from which the document of a diagnosis is written.
pub(super) struct Report<'a> {
    pub subject: &'a Subject,
    pub request: &'a DiagnosisRequest,
    pub found: &'a SearchResult,
    pub verdict: &'a Verdict,
    /// Model of the verdict's effects; `None` if the verdict names none.
    pub model: Option<&'a Refitted>,
    /// Structure outside the library, the leading one first.
    pub unexplained: &'a [OutsideStructure],
    /// Misfit on which the verdict rests.
    pub left: &'a Misfit,
    /// Pattern in the base model's residual, if the verdict names nothing.
    pub pattern: Option<Pattern>,
    /// Error on the last held-out cycle, divided by the predictive noise; `None` if this ratio is small enough.
    pub over_predicted: Option<f64>,
    /// Summary of the unexplained residual; `None` if nothing is unexplained or the request is not in full.
    pub leftover: Option<UnexplainedResidual>,
    /// Leading significant event in any cycle, the scored one included; `None` if there is none.
    pub event: Option<OutsideStructure>,
    /// Models of the effects that are equivalent to the claim.
    pub equivalent: &'a [Refitted],
    /// The subject with its outliers, for errors over every position.
    pub every_position: &'a Subject,
}

impl Report<'_> {
    /// Writes the document. `outlier_rows` are the excluded rows.
    pub fn document(&self, outlier_rows: Vec<usize>, monitor: &dyn Monitor) -> Result<Diagnosis> {
        let (subject, found) = (self.subject, self.found);
        let experiment = subject.experiment();
        let base = self.request.base_errors.map_or_else(|| self.own_errors(&found.base), Ok)?;
        let extended = self.model.map(|model| self.errors(model)).transpose()?;
        let shown = DocumentSource { base, extended: extended.as_ref() };
        let scored: Vec<&Single> = found.singles.iter().filter(|single| single.score.is_some()).collect();
        let scores: Vec<rank::Score> = scored.iter().filter_map(|single| single.score.clone()).collect();
        let cosines = rank::cosines(&scores);
        let slug = |place: &usize| scored[*place].slug.to_string();
        let twins: Vec<Vec<String>> =
            rank::twins(&cosines).iter().map(|list| list.iter().map(slug).collect()).collect();
        monitor.stage("computing the evidence");
        let weighing = EvidenceSet::new(subject, self.request, (found, self.model), monitor)?;
        let specified_noise_errors = |single: &Single| {
            let refitted = single.refitted.as_ref().filter(|_| self.request.in_full);
            refitted.map(|refitted| self.own_errors(refitted)).transpose()
        };
        let errors_of_singles: Vec<Option<ModelErrors>> =
            found.singles.par_iter().map(specified_noise_errors).collect::<Result<_>>()?;
        let mut candidates = Vec::new();
        for (single, model_errors) in found.singles.iter().zip(errors_of_singles) {
            let place = scored.iter().position(|other| other.slug == single.slug);
            let twins = place.map_or(Vec::new(), |place| twins[place].clone());
            candidates.push(self.candidate(
                single,
                twins,
                model_errors.and_then(|model_errors| model_errors.rmse_heldout_um),
                &weighing,
            )?);
        }
        let learnt = noise_learning::learn(subject, &found.base.candidate, &found.base.fitted)?;
        let mut remarks = self.remarks(&scores, &cosines);
        remarks.extend(self.event.as_ref().map(|event| event_remark(subject, event)));
        let amplitudes = candidates.iter().filter(|entry| entry.status == Status::Claimed);
        let amplitudes = amplitudes.filter_map(|entry| entry.refit.as_ref()).flat_map(|refit| &refit.parameters);
        let amplitude = amplitudes.filter(|found| found.name == AMPLITUDE).map(|p| [p.mean, p.q05, p.q95]);
        remarks.extend(amplitude.map(|amplitude| interpretation(amplitude, false)));
        remarks.extend(learnt.disagreements());
        remarks.extend(weighing.remarks.iter().cloned());
        if self.request.in_full {
            let exact = protocol::exact_degeneracies(subject)?;
            remarks.extend(exact.into_iter().map(|degeneracy| degeneracy.sentence));
        }
        let (mut detectable, mut separating_protocol) = (Vec::new(), String::new());
        if self.request.in_full {
            monitor.stage("computing the smallest detectable size of every effect");
            let base = (&found.base.candidate, &found.base.fitted);
            detectable = find_smallest_detectable(subject, base, self.threshold_sigma())?;
            separating_protocol = self.separating_protocol()?;
        }
        // An effect that is invisible at small sizes may be visible at large ones.
        let of = |slug: &str| detectable.iter().find(|d: &&Detectability| d.effect == slug);
        for entry in candidates.iter_mut().filter(|entry| entry.status == Status::Invisible) {
            if of(&entry.effect).is_some_and(|d| d.smallest.is_some()) {
                entry.status = Status::Unsupported;
            }
        }
        let is_blind = |slug: &str| of(slug).is_some_and(Detectability::is_blind_spot);
        let invisible = |c: &&CandidateEntry| c.status == Status::Invisible || is_blind(&c.effect);
        let blind_spots = candidates.iter().filter(invisible).map(|c| c.effect.clone()).collect();
        let smallest = |d: &Detectability| SmallestDetectable { effect: d.effect.clone(), parameter: d.smallest };
        let pair = |(refitted, gain): &(Refitted, Gain)| PairEntry {
            effects: found.added(refitted).into_iter().map(String::from).collect(),
            gain_nats: gain.fitted,
            heldout_gain_nats: gain.future,
        };
        Ok(Diagnosis {
            experiment: experiment.specimen_id.clone(),
            verdict: self.verdict.document(self.sentence(&candidates, &shown)),
            fitted_cycles: experiment.calibration_cycles.clone(),
            heldout_cycles: experiment.heldout_cycles.clone(),
            base: BaseErrors {
                rmse_fitted_um: base.rmse_fitted_um,
                rmse_heldout_um: base.rmse_heldout_um,
                noise_um: subject.noise_um(),
            },
            extended,
            search_noise_um: self.search_noise_um(),
            candidates,
            pairs: found.pairs.iter().take(N_PAIRS).map(pair).collect(),
            blind_spots,
            smallest_detectable: detectable.iter().map(smallest).collect(),
            separating_protocol,
            noise: learnt.estimates(),
            unexplained: self.unexplained.iter().map(entry).collect(),
            discrepancy: self.leftover.as_ref().map(|leftover| leftover.entry.clone()),
            outlier_rows,
            remarks,
        })
    }

    /// Distance (σ) from which an effect counts as detectable. It is 1 σ more than the distance whose expected gain equals the threshold of the simulated searches.
    fn threshold_sigma(&self) -> f64 {
        (2.0 * self.found.bootstrap.threshold().max(self.request.criteria.least_gain_nats)).sqrt() + 1.0
    }

    /// Describes the change of the protocol that would separate the claim from its equivalent effects; empty if the claim has none.
    fn separating_protocol(&self) -> Result<String> {
        let Some(claimed) = self.model.filter(|_| !self.equivalent.is_empty()) else { return Ok(String::new()) };
        let models = std::iter::once(claimed).chain(self.equivalent);
        let members: Vec<(&Candidate, &Fitted)> = models.map(|model| (&model.candidate, &model.fitted)).collect();
        let advice = protocol::find_best_change(self.subject, &members, N_REPEATS, self.request.seed)?;
        Ok(advice.map_or(String::new(), |advice| advice.sentence))
    }

    fn own_errors(&self, model: &Refitted) -> Result<ModelErrors> {
        own_errors(self.every_position, model)
    }

    fn errors(&self, model: &Refitted) -> Result<Errors> {
        let ModelErrors { rmse_fitted_um, rmse_heldout_um } = self.own_errors(model)?;
        let Refitted { candidate, fitted, .. } = model;
        let predictive_noise_um = predictive_noise_um(self.subject, candidate, fitted, &self.subject.scored_m);
        Ok(Errors { rmse_fitted_um, rmse_heldout_um, predictive_noise_um })
    }

    fn status(&self, single: &Single) -> Status {
        let evidence = EffectEvidence {
            effect: single.slug,
            gain_nats: single.gain.map(|gain| gain.fitted),
            p: self.p(single),
            visible_fraction: single.score.as_ref().map(|score| score.visible_fraction),
        };
        match self.untested() {
            Some((slug, _)) if slug == single.slug => Status::Suggestive,
            _ => self.verdict.status(&evidence, &self.request.criteria),
        }
    }

    /// The effect that explains the residual best and its gain (nats), if only a held-out cycle is missing for a claim: it gains more than all structure outside the library.
    fn untested(&self) -> Option<(&'static str, f64)> {
        if self.model.is_some() || !self.subject.experiment().heldout_cycles.is_empty() {
            return None;
        }
        let gains = self.found.singles.iter().filter_map(|single| Some((single.slug, single.gain?.fitted)));
        let (slug, gain_nats) = gains.max_by(|a, b| a.1.total_cmp(&b.1))?;
        let by_chance = self.found.bootstrap.p(gain_nats) > self.request.criteria.largest_p;
        let is_best = self.unexplained.iter().all(|structure| structure.gain_nats < gain_nats);
        (!by_chance && is_best && gain_nats > self.request.criteria.least_gain_nats).then_some((slug, gain_nats))
    }

    fn p(&self, single: &Single) -> f64 {
        single.gain.map_or(1.0, |gain| self.found.bootstrap.p(gain.fitted))
    }

    fn candidate(
        &self,
        single: &Single,
        twins: Vec<String>,
        rmse_heldout_um: Option<f64>,
        weighing: &EvidenceSet,
    ) -> Result<CandidateEntry> {
        let status = self.status(single);
        let score = single.score.as_ref();
        let refit = match (&single.refitted, single.gain) {
            (Some(refitted), Some(gain)) => {
                Some(Refit { rmse_heldout_um, ..self.refit(single, refitted, gain, weighing)? })
            }
            _ => None,
        };
        Ok(CandidateEntry {
            effect: single.slug.into(),
            status,
            z: score.map_or(0.0, |score| score.z),
            p_familywise: self.p(single),
            visible_fraction: score.map_or(0.0, |score| score.visible_fraction),
            expected_parameter: score.map(|score| score.expected_parameter).filter(|value| value.is_finite()),
            refit,
            twins,
            refused: single.refused.clone(),
        })
    }

    /// Entry of the document for the refit with one effect. For a claim of several effects, the parameters are those of the model with all of them. All other values
    /// refer to the model with this effect alone.
    fn refit(&self, single: &Single, refitted: &Refitted, gain: Gain, weighing: &EvidenceSet) -> Result<Refit> {
        let parameters = weighing.parameters(
            self.subject,
            single,
            self.verdict.effects.iter().any(|effect| effect == single.slug),
        )?;
        let verdict = &self.verdict;
        let has_rivals = !verdict.equivalent.is_empty()
            && verdict.effects.iter().chain(&verdict.equivalent).any(|effect| effect == single.slug);
        let of_base = |name: &str| self.found.base.candidate.free.iter().any(|free| free.name == name);
        let of_law = |parameter: &&RefitParameter| !parameter.name.contains('.') && of_base(&parameter.name);
        let law_parameters =
            if has_rivals { parameters.all.iter().filter(of_law).cloned().collect() } else { Vec::new() };
        let parameters = parameters.of(&self.found.added(refitted));
        let (log_bayes_factor, log_bayes_factor_at_most) = match weighing.factor(single.slug) {
            BayesFactor::Known(value) => (Some(value), None),
            BayesFactor::AtMost(value) => (None, Some(value)),
            BayesFactor::Unknown => (None, None),
        };
        Ok(Refit {
            gain_nats: gain.fitted,
            heldout_gain_nats: gain.future,
            last_cycle_gain_nats: gain.last,
            rmse_heldout_um: None,
            largest_change: gain.largest_change,
            log_bayes_factor,
            log_bayes_factor_at_most,
            parameters: parameters.all,
            law_parameters,
            answers: parameters.modes,
        })
    }

    fn remarks(&self, scores: &[rank::Score], cosines: &nalgebra::DMatrix<f64>) -> Vec<String> {
        let mut list = Vec::new();
        let threshold = rank::largest_score_threshold(scores, cosines, self.request.seed);
        list.push(format!(
            "without any effect, the largest score stays below {threshold:.2} standard deviations in 95 of 100 experiments"
        ));
        list.extend(self.found.bootstrap.sentence());
        match self.subject.experiment().heldout_cycles[..] {
            [] => list.push("no cycle is held out, so effects are \"suggestive\" at most".into()),
            [cycle] if self.subject.problem().experiment.calibration_cycles.len() == 1 => list.push(format!(
                "the fit uses one cycle and only cycle {cycle} is scored: a claim rests on that one cycle"
            )),
            _ => {}
        }
        list
    }

    fn sentence(&self, candidates: &[CandidateEntry], shown: &DocumentSource) -> String {
        match self.verdict.kind {
            VerdictKind::Missing => self.missing_sentence(candidates, shown),
            VerdictKind::Unexplained => self.unexplained_sentence(shown),
            VerdictKind::None => self.none_sentence(candidates, shown),
        }
    }

    /// Returns whether the best model leaves structure outside the library, or a residual above the noise.
    pub fn remains(&self) -> bool {
        self.verdict.has_structure || self.verdict.exceeds_noise
    }

    /// Noise standard deviation (µm) that the search learnt for the best model: white and slow noise together.
    fn search_noise_um(&self) -> f64 {
        let model = self.model.unwrap_or(&self.found.base);
        self.subject.noise().row_sd_um(&model.fitted.noise)
    }

    /// Phrase for the noise standard deviation (µm) of one position. If the noise was not given, the phrase also has the learnt value.
    fn noise_words(&self) -> String {
        let Some(noise_um) = self.subject.noise_um() else { return "unknown".into() };
        let noise = short(noise_um);
        if self.left.is_known {
            return noise;
        }
        format!("{noise}, estimated; {} learnt, slow noise included", short(self.search_noise_um()))
    }

    /// Warning that the size of the noise is unknown; empty if it is known or estimated.
    fn unknown_noise(&self) -> &'static str {
        if self.subject.is_noise_unknown() {
            " The noise is neither given nor can it be estimated, so a misfit that looks like slow noise cannot be ruled out. Give `noise_um` in [measurement]."
        } else {
            ""
        }
    }

    fn missing_sentence(&self, candidates: &[CandidateEntry], shown: &DocumentSource) -> String {
        let effects = &self.verdict.effects;
        let errors = shown.change_in_words();
        let claimed = candidates.iter().filter(|candidate| candidate.status == Status::Claimed);
        let refits: Vec<&Refit> = claimed.filter_map(|candidate| candidate.refit.as_ref()).collect();
        let sizes =
            refits.iter().filter_map(|refit| in_words(&refit.answers).or_else(|| refit.parameters.first().map(size)));
        let sizes: Vec<String> = sizes.collect();
        let class = match &self.verdict.equivalent[..] {
            [] => String::new(),
            class => {
                let which = if effects.len() > 1 { "one of them" } else { "it" };
                format!(" This experiment cannot distinguish {which} from {}.", listed(class, "or"))
            }
        };
        let rest = self.what_remains().map_or(String::new(), |what| format!(" Unexplained in this experiment: {what}"));
        format!(
            "The model lacks {}: with {}, {errors} (noise {}). {}.{class}{rest}",
            listed(effects, "and"),
            if effects.len() > 1 { "them" } else { "it" },
            self.noise_words(),
            sizes.join("; ")
        )
    }

    /// Describes the unexplained residual; `None` if there is none. Without `in_full` of the request, a residual that only its size reveals has no description either.
    fn what_remains(&self) -> Option<String> {
        let first = || self.unexplained.first().map(|first| first.sentence.clone());
        self.leftover.as_ref().map(|leftover| leftover.entry.sentence.clone()).or_else(first)
    }

    fn unexplained_sentence(&self, shown: &DocumentSource) -> String {
        let what = self.what_remains().unwrap_or_default();
        let rest = if what.is_empty() { String::new() } else { format!(" Unexplained in this experiment: {what}") };
        if self.model.is_some() {
            let effects = listed(&self.verdict.effects, "and");
            return format!(
                "No tried effect makes the model right: with {effects}, its residual is {}. The best of the library, {effects}, helps but is not the cause ({}): its size is no property of the gel.{rest}",
                self.excess_words(),
                shown.change_in_words()
            );
        }
        if let Some((effect, gain_nats)) = self.untested() {
            return format!(
                "The model is wrong, and no cycle is held out that would test an effect. Of the library, {effect} explains most (gain {} nats). Hold out a cycle (`heldout_cycles`) and diagnose again. A record of one cycle is divided by its column `cycle`, or by `cycle_starts_s` without this column.",
                short(gain_nats)
            );
        }
        if self.verdict.has_structure {
            return format!("No effect of the library explains the model's residual.{rest}");
        }
        // A residual that only its size reveals may also be noise that is larger than the given one.
        let (wrong, remedy) = match self.left.is_known && self.left.returning_m.is_none() {
            true => (
                "The model or the given noise",
                " If the given noise is not certain, leave out `noise_um`: the program then estimates it.",
            ),
            false => ("The model", ""),
        };
        format!(
            "{wrong} is wrong, and no effect of the library or known structure explains why: its residual is {}.{rest}{remedy}",
            self.excess_words()
        )
    }

    /// Phrase for the ratio of the residual to the noise, and for the cycles where it occurs.
    fn excess_words(&self) -> String {
        if let (false, Some(factor)) = (self.left.is_too_large(), self.over_predicted) {
            let noise = match (self.model, self.left.is_known) {
                (None, _) => "white noise and the model's parameters",
                (Some(_), true) => "the known noise and the model's parameters",
                (Some(_), false) => "the model's own noise and parameters",
            };
            return format!("{factor:.1} times as large on the last held-out cycle as {noise} allow");
        }
        let heldout = self.left.heldout.filter(|size| size.is_too_large);
        let (size, which) = heldout.map_or((self.left.fitted, "fitted cycles"), |size| (size, "last held-out cycle"));
        let noise_m = self.left.noise_m;
        let noise = match self.left.is_known {
            true => format!("the known noise of {} µm", short(1e6 * noise_m)),
            false if noise_m > self.subject.reference_noise_m() => {
                format!("the {} µm that do not recur in every cycle", short(1e6 * noise_m))
            }
            false => format!("the estimated noise of {} µm", short(1e6 * noise_m)),
        };
        let returning = self.left.returning_m.map_or(String::new(), |returning_m| {
            format!("; {} µm of it recur in every cycle, which noise does not", short(1e6 * returning_m))
        });
        let gains = self.left.implausible_gains.map_or(String::new(), |gains| format!("; {}", gains.words()));
        format!("{:.1} times {noise} on the {which}{returning}{gains}", size.rms_m / noise_m)
    }

    fn none_sentence(&self, candidates: &[CandidateEntry], shown: &DocumentSource) -> String {
        let suggestive: Vec<String> =
            candidates.iter().filter(|c| c.status == Status::Suggestive).map(|c| c.effect.clone()).collect();
        let hint = if suggestive.is_empty() {
            String::new()
        } else {
            format!(" Suggestive at most: {}.", listed(&suggestive, "and"))
        };
        let errors = shown.base;
        let rows = if errors.rmse_heldout_um.is_some() { "last held-out cycle" } else { "fitted cycles" };
        let rmse_um = errors.rmse_heldout_um.unwrap_or(errors.rmse_fitted_um);
        let left = self.left.heldout.unwrap_or(self.left.fitted).rms_m;
        if self.verdict.is_doubtful {
            return format!(
                "An effect may be missing: the model's residual is {} times the given noise on the {rows}. No effect of the library explains it, and slow noise in addition to the given noise would look the same.{hint}",
                short(left / self.left.noise_m),
            );
        }
        let has_gains = rmse_um >= WORTH_SAYING * 1e6 * left;
        if let Some(pattern) =
            self.pattern.as_ref().filter(|pattern| pattern.share_of_noise >= LARGE_PATTERN && !has_gains)
        {
            return format!(
                "An effect may be missing: {}. No effect of the library is established: slow noise or a drift of the instrument would look the same. The parameters have absorbed a part of it. The model's error is {} µm on the {rows} (noise {}).{}{hint}",
                pattern.words(),
                short(rmse_um),
                self.noise_words(),
                self.unknown_noise(),
            );
        }
        let shows = match (&self.pattern, has_gains) {
            (None, false) => "This experiment shows no missing effect",
            (Some(_), false) => "This experiment shows no missing effect of a size that matters for predictions",
            (_, true) => {
                "If each cycle may have a gain and an offset of its own, this experiment shows no missing effect"
            }
        };
        let without_gains = match has_gains {
            true => format!(
                " With each cycle's own gain and offset {} µm are left; `sample` allows them only with `--noise white,gain`.",
                short(1e6 * left)
            ),
            false => String::new(),
        };
        let residual = match &self.pattern {
            None if has_gains => "The rest looks like noise.".into(),
            None => "Its residual looks like noise.".into(),
            Some(pattern) => format!("But {}. The parameters have absorbed a part of it.", pattern.words()),
        };
        format!(
            "{shows}. The model's error is {} µm on the {rows} (noise {}).{without_gains} {residual}{}{hint}",
            short(rmse_um),
            self.noise_words(),
            self.unknown_noise(),
        )
    }
}

/// Errors that the sentences mention, of the base and of the model with the verdict's effects.
struct DocumentSource<'a> {
    base: ModelErrors,
    extended: Option<&'a Errors>,
}

impl DocumentSource<'_> {
    /// Describes the change of the error from the base to the model with the verdict's effects; empty if the verdict names none.
    fn change_in_words(&self) -> String {
        let Some(after) = self.extended else { return String::new() };
        let (which, was, is) = match (self.base.rmse_heldout_um, after.rmse_heldout_um) {
            (Some(was), Some(is)) => ("last held-out cycle", was, is),
            _ => ("fitted cycles", self.base.rmse_fitted_um, after.rmse_fitted_um),
        };
        format!("the error on the {which} goes from {} to {} µm", short(was), short(is))
    }
}

fn entry(outside: &OutsideStructure) -> UnexplainedMisfit {
    UnexplainedMisfit {
        kind: outside.kind.name().into(),
        sentence: outside.sentence.clone(),
        gain_nats: outside.gain_nats,
        p_familywise: outside.p_familywise,
        size_um: outside.size_um,
    }
}

/// Writes a parameter with its interval: `slug.name = mean (q05 to q95 at 90 %)`.
fn size(parameter: &RefitParameter) -> String {
    format!(
        "{} = {} ({} to {} at 90 %)",
        parameter.name,
        short(parameter.mean),
        short(parameter.q05),
        short(parameter.q95)
    )
}

/// Lists the modes of a posterior, between which the data do not decide; `None` if there are fewer than two.
fn in_words(answers: &[PosteriorMode]) -> Option<String> {
    let of = |answer: &PosteriorMode| {
        Some(format!("{} with probability {:.2}", size(answer.parameters.first()?), answer.probability))
    };
    let each: Vec<String> = answers.iter().filter_map(of).collect();
    let count = if each.len() == 2 { "two" } else { "several" };
    (each.len() > 1).then(|| format!("The posterior has {count} modes: {}", listed(&each, "or")))
}

/// Writes a value with three significant digits.
fn short(value: f64) -> String {
    format_significant(value, 3)
}

/// Joins names as in `a, b and c`; `last` is the word before the last name.
fn listed(names: &[String], last: &str) -> String {
    match names {
        [] => String::new(),
        [one] => one.clone(),
        [rest @ .., end] => format!("{} {last} {end}", rest.join(", ")),
    }
}

#[cfg(test)]
#[path = "document_tests.rs"]
pub(super) mod tests;
