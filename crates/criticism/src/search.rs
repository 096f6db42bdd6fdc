//! Search for missing effects: single effects, pairs, and more if the data require them. Effects that are not needed are then removed.

use rayon::prelude::*;

use super::bootstrap::{Bootstrap, Simulations};
use super::criteria::Criteria;
use super::rank::{Score, pair_score};
use super::refit::{Gain, Refitted, refit_all};
use super::request::DiagnosisRequest;
use super::screen::Screen;
use super::verdict::Addition;
use super::{Candidate, Search, Subject, large};
use crate::NoiseValues;
use base::error::Result;
use posterior::monitor::Monitor;

/// Number of pairs of effects that are refitted because of their joint first-order score. All pairs with the best single effect are candidates as well.
const N_LEADING_PAIRS: usize = 10;
/// Least first-order bound ([`Screen`]) on the gain of a second effect that is refitted, in nats. An effect with a smaller bound gains too little for a larger model under
/// [`Criteria::larger_nats`].
const LEAST_BOUND_NATS: f64 = 4.0;
/// Number of leading pairs of effects that are refitted with a wide search, from every starting point.
const N_WIDE_PAIRS: usize = 6;

/// Result of adding one effect of the library to the base model.
pub struct Single {
    /// Slug of the effect.
    pub slug: &'static str,
    /// Reason why the effect cannot be added to the base model; `None` if it can.
    pub refused: Option<String>,
    /// The base model with the effect, at its best fit; `None` if the effect cannot be added or evaluated.
    pub refitted: Option<Refitted>,
    /// Gain of the model with the effect over the base model.
    pub gain: Option<Gain>,
    /// First-order score of the effect, computed at the fit of the base model.
    pub score: Option<Score>,
}

/// Model that one round of the search proposes.
#[derive(Clone)]
pub struct SearchStep {
    /// Effects of the model, with gains and p.
    pub addition: Addition,
    /// The model at its fit.
    pub refitted: Refitted,
}

/// Result of a search.
pub struct SearchResult {
    /// The base model at its best fit.
    pub base: Refitted,
    /// Result for every effect of the library, in its order.
    pub singles: Vec<Single>,
    /// Largest gains of searches in data that were simulated from the base model.
    pub bootstrap: Bootstrap,
    /// Pairs of effects, best first, with their gains over the base model.
    pub pairs: Vec<(Refitted, Gain)>,
    /// Model that each round proposes, in order; the last one may fail the criteria.
    pub steps: Vec<SearchStep>,
    /// The largest model that passes the criteria, without the effects that it does not need; `None` if no model passes.
    pub largest: Option<SearchStep>,
}

impl SearchResult {
    /// Returns the slugs of the effects that a model has in addition to the base model.
    pub fn added<'a>(&self, model: &'a Refitted) -> Vec<&'a str> {
        let n_base = self.base.candidate.effects.len();
        model.candidate.effects[n_base..].iter().map(String::as_str).collect()
    }

    /// Returns the first round's model, with the best single effect, if it passes the criteria.
    pub fn leading(&self, criteria: &Criteria) -> Option<&SearchStep> {
        self.steps.first().filter(|step| criteria.passes(&step.addition))
    }

    /// Returns the result of a single effect by its slug.
    pub fn single(&self, slug: &str) -> Option<&Single> {
        self.singles.iter().find(|single| single.slug == slug)
    }
}

/// Searches for missing effects.
///
/// # Errors
/// Errors of fitting the base.
pub fn search(subject: &Subject, request: &DiagnosisRequest, monitor: &dyn Monitor) -> Result<SearchResult> {
    monitor.stage("fitting the model");
    let mut base = Refitted::new(subject, subject.base(), &[], Search::Wide)?;
    large::prepare(subject, &base, monitor);
    monitor.stage("fitting the model with every effect");
    let slugs: Vec<&'static str> = subject.library().effects().iter().map(|effect| effect.slug()).collect();
    let candidates: Vec<_> = slugs.iter().map(|slug| extend_base(subject, slug)).collect();
    let models: Vec<Candidate> = candidates.iter().flatten().cloned().collect();
    let mut refitted = refit_all(subject, &models, &[&base], Search::Wide, monitor);
    if let Some(better) = base_from(subject, &base, &refitted) {
        base = better;
        // Wide searches are done: local ones suffice for the improved base.
        let again = refit_all(subject, &models, &[&base], Search::Local, monitor);
        refitted = refitted.into_iter().zip(again).map(|(first, again)| better_of(first, again)).collect();
    }
    let scores =
        super::rank::scores(subject, &base.candidate, &base.fitted, &models.iter().collect::<Vec<_>>(), request.seed)?;
    let mut results = refitted.into_iter().zip(scores);
    let singles: Vec<Single> = slugs
        .into_iter()
        .zip(candidates)
        .map(|(slug, candidate)| {
            let result = candidate.as_ref().ok().and_then(|_| results.next());
            let (refitted, score) = result.map_or((None, None), |(refitted, score)| (refitted, Some(score)));
            let score = score.or_else(|| large::score_where_not_learnt(subject, slug));
            let gain = refitted.as_ref().map(|refitted| refitted.gain_over(&base, subject));
            Single { slug, refused: candidate.err(), refitted, gain, score }
        })
        .collect();
    monitor.stage("repeating the search on simulated records without a missing effect");
    // Simulates as many searches as are needed to decide about the largest gain of a single effect.
    let judged = best_single(&singles).and_then(|single| single.gain).map_or(0.0, |gain| gain.fitted);
    let decides = (!request.in_full).then_some(request.criteria.p_of_round(0));
    let simulations = Simulations { most: request.n_simulations, only_for: decides };
    let bootstrap = Bootstrap::run(subject, &base, &models, judged, simulations, request.seed ^ 0x5eed, monitor);
    let mut found = SearchResult { base, singles, bootstrap, pairs: Vec::new(), steps: Vec::new(), largest: None };
    monitor.stage("refitting pairs of effects");
    found.pairs = pairs(subject, &request.criteria, &found, monitor);
    rounds(subject, request, &mut found, monitor);
    Ok(found)
}

fn better_of(first: Option<Refitted>, again: Option<Refitted>) -> Option<Refitted> {
    match (first, again) {
        (Some(first), Some(again)) if first.fitted.objective >= again.fitted.objective => Some(first),
        (first, again) => again.or(first),
    }
}

/// Returns the base model with an effect of the library, or the reason why the effect cannot be added.
fn extend_base(subject: &Subject, slug: &str) -> std::result::Result<Candidate, String> {
    subject.extended(&[slug]).map_err(|error| match error {
        base::Error::Input { found, .. } => found,
        other => other.to_string(),
    })
}

/// Refits the base model from the noises of larger models, and returns the fit if it is better. Otherwise a larger model could gain only because its noise was searched
/// better.
fn base_from(subject: &Subject, base: &Refitted, larger: &[Option<Refitted>]) -> Option<Refitted> {
    let noises = larger.iter().flatten().map(|model| (base.fitted.theta.clone(), model.fitted.noise));
    let starts: Vec<(Vec<f64>, NoiseValues)> = noises.collect();
    let fitted = subject.fit(&base.candidate, &starts, Search::Local).ok()?;
    if fitted.objective < base.fitted.objective + 1e-3 {
        return None;
    }
    let future = super::future::future_score(subject, &base.candidate, &fitted).ok()?;
    Some(Refitted { candidate: base.candidate.clone(), fitted, future })
}

/// Returns the pairs with the best joint scores, and the pairs of the best single effect with promising other effects ([`select_promising`]). The best pair comes first.
fn pairs(subject: &Subject, criteria: &Criteria, found: &SearchResult, monitor: &dyn Monitor) -> Vec<(Refitted, Gain)> {
    let usable: Vec<&Single> = found.singles.iter().filter(|single| single.refitted.is_some()).collect();
    let mut scored: Vec<(f64, [&str; 2])> = Vec::new();
    for (i, a) in usable.iter().enumerate() {
        for b in &usable[i + 1..] {
            if let (Some(x), Some(y)) = (&a.score, &b.score) {
                scored.push((pair_score(x, y), [a.slug, b.slug]));
            }
        }
    }
    scored.sort_by(|a, b| b.0.total_cmp(&a.0));
    let mut wanted: Vec<[&str; 2]> = scored.iter().take(N_LEADING_PAIRS).map(|(_, pair)| *pair).collect();
    if let Some((best, refitted)) = best_single(&found.singles).and_then(|best| Some((best, best.refitted.as_ref()?))) {
        let others: Vec<&str> = usable.iter().map(|other| other.slug).filter(|slug| *slug != best.slug).collect();
        wanted.extend(
            select_promising(subject, best.slug, refitted, &others).into_iter().map(|other| [best.slug, other]),
        );
    }
    wanted.iter_mut().for_each(|pair| pair.sort_unstable());
    wanted.sort_unstable();
    wanted.dedup();
    let candidates: Vec<Candidate> = wanted.iter().filter_map(|pair| subject.extended(pair).ok()).collect();
    let contained: Vec<&Refitted> =
        std::iter::once(&found.base).chain(usable.iter().filter_map(|single| single.refitted.as_ref())).collect();
    let ranked = |refitted: Vec<Option<Refitted>>| {
        let with_gain = refitted.into_iter().flatten().map(|pair| {
            let gain = pair.gain_over(&found.base, subject);
            (pair, gain)
        });
        let mut list: Vec<(Refitted, Gain)> = with_gain.collect();
        list.sort_by(|a, b| b.1.rank.total_cmp(&a.1.rank));
        list
    };
    let mut list = ranked(refit_all(subject, &candidates, &contained, Search::Local, monitor));
    // If a pair is near the threshold, the leading pairs are refitted with a wide search.
    let wanted_rank = criteria.rank_of_larger(best_single(&found.singles).map_or(0.0, rank_of));
    if list.first().is_some_and(|(_, gain)| gain.rank > 0.5 * wanted_rank) {
        let n_wide = N_WIDE_PAIRS.min(list.len());
        let leaders: Vec<Candidate> = list[..n_wide].iter().map(|(pair, _)| pair.candidate.clone()).collect();
        let locals: Vec<&Refitted> =
            contained.iter().copied().chain(list[..n_wide].iter().map(|(pair, _)| pair)).collect();
        let wide = ranked(refit_all(subject, &leaders, &locals, Search::Wide, monitor));
        list.splice(..n_wide, wide);
        list.sort_by(|a, b| b.1.rank.total_cmp(&a.1.rank));
    }
    list
}

/// Effects that may gain [`LEAST_BOUND_NATS`] in addition to the best single effect at its fit; all effects if there are no first-order values.
fn select_promising<'a>(subject: &Subject, best: &str, fitted: &Refitted, others: &[&'a str]) -> Vec<&'a str> {
    let candidate = |other: &&'a str| Some((*other, subject.extended(&[best, other]).ok()?));
    let (others, candidates): (Vec<&str>, Vec<Candidate>) = others.iter().filter_map(candidate).unzip();
    let Ok(screen) = Screen::new(subject, fitted, &candidates) else { return others };
    let bounds = screen.bounds_nats(subject);
    others.into_iter().zip(bounds).filter(|(_, bound)| *bound >= LEAST_BOUND_NATS).map(|(other, _)| other).collect()
}

fn best_single(singles: &[Single]) -> Option<&Single> {
    let ranked = singles.iter().filter(|single| single.gain.is_some());
    ranked.max_by(|a, b| rank_of(a).total_cmp(&rank_of(b)))
}

fn rank_of(single: &Single) -> f64 {
    single.gain.map_or(f64::NEG_INFINITY, |gain| gain.rank)
}

/// Adds one effect in each round as long as the larger model passes the criteria. Then removes the effects that are not needed.
fn rounds(subject: &Subject, request: &DiagnosisRequest, found: &mut SearchResult, monitor: &dyn Monitor) {
    let criteria = &request.criteria;
    let Some(first) = best_single(&found.singles) else { return };
    let (Some(refitted), Some(gain)) = (first.refitted.clone(), first.gain) else { return };
    let addition = Addition::single(first.slug, gain, found.bootstrap.p(gain.fitted));
    found.steps.push(SearchStep { addition, refitted: refitted.clone() });
    found.largest = found.leading(criteria).cloned();
    let mut current = refitted;
    for round in 1..criteria.most_effects {
        let Some((larger, gain)) = next_larger(subject, found, &current, round, monitor) else { break };
        let over_base = larger.gain_over(&found.base, subject);
        if over_base.rank < criteria.rank_of_larger(current.gain_over(&found.base, subject).rank) {
            break;
        }
        monitor.stage("repeating the search for one more effect on simulated records");
        let additions = additions_to(subject, &current);
        // Later rounds need only their decision, so their p is not computed in full.
        let simulations = Simulations { most: request.n_simulations, only_for: Some(criteria.p_of_round(round)) };
        let seed = request.seed ^ (0xb007 + round as u64);
        let simulated = Bootstrap::run(subject, &current, &additions, gain.fitted, simulations, seed, monitor);
        let effects = found.added(&larger).into_iter().map(String::from).collect();
        let addition = Addition { effects, gain, over_base, p: simulated.p(gain.fitted), round };
        let step = SearchStep { addition, refitted: larger.clone() };
        found.steps.push(step.clone());
        if !criteria.passes(&step.addition) {
            break;
        }
        (current, found.largest) = (larger, Some(step));
    }
    found.largest = found.largest.take().map(|largest| remove_needless_effects(subject, criteria, found, largest));
}

/// Best model with one effect more than `current`, and its gain over `current`. The second round accepts any pair of effects, even without the best single effect. That
/// effect may only have compensated for the lack of two others.
fn next_larger(
    subject: &Subject,
    found: &SearchResult,
    current: &Refitted,
    round: usize,
    monitor: &dyn Monitor,
) -> Option<(Refitted, Gain)> {
    if round == 1 {
        let (pair, gain) = found.pairs.first()?;
        let of_current = current.gain_over(&found.base, subject);
        // Gain over `current`, which the pair need not contain.
        let difference = Gain {
            fitted: gain.fitted - of_current.fitted,
            future: gain.future.zip(of_current.future).map(|(a, b)| a - b),
            last: gain.last.zip(of_current.last).map(|(a, b)| a - b),
            rank: gain.rank - of_current.rank,
            largest_change: largest_change(subject, pair, current),
        };
        return Some((pair.clone(), difference));
    }
    monitor.stage("refitting with one more effect");
    let candidates = additions_to(subject, current);
    let pairs = found.pairs.iter().map(|(pair, _)| pair);
    let contained: Vec<&Refitted> = std::iter::once(current).chain(pairs).collect();
    let refitted = refit_all(subject, &candidates, &contained, Search::Wide, monitor).into_iter().flatten();
    let with_gain = refitted.map(|larger| {
        let gain = larger.gain_over(current, subject);
        (larger, gain)
    });
    with_gain.max_by(|a, b| a.1.rank.total_cmp(&b.1.rank))
}

fn largest_change(subject: &Subject, a: &Refitted, b: &Refitted) -> f64 {
    let pairs = a.fitted.position_m.iter().zip(&b.fitted.position_m);
    pairs.fold(0.0, |largest: f64, (x, y)| largest.max((x - y).abs())) / subject.reference_noise_m()
}

/// All models with one effect of the library added to `model`.
fn additions_to(subject: &Subject, model: &Refitted) -> Vec<Candidate> {
    let n_base = subject.specification().effects.len();
    let names: Vec<&str> = model.candidate.effects[n_base..].iter().map(String::as_str).collect();
    let others = subject.library().effects().iter().map(|effect| effect.slug()).filter(|slug| !names.contains(slug));
    others.filter_map(|slug| subject.extended(&[&names[..], &[slug]].concat()).ok()).collect()
}

/// Removes, one by one, effects whose removal costs less than [`Criteria::least_removal_nats`], as long as the remaining model passes the criteria.
fn remove_needless_effects(
    subject: &Subject,
    criteria: &Criteria,
    found: &SearchResult,
    mut step: SearchStep,
) -> SearchStep {
    loop {
        let names = &step.addition.effects;
        if names.len() < 2 {
            return step;
        }
        let smaller: Vec<SearchStep> = names
            .par_iter()
            .filter_map(|slug| {
                let rest: Vec<&str> = names.iter().filter(|other| *other != slug).map(String::as_str).collect();
                let candidate = subject.extended(&rest).ok()?;
                let refitted = Refitted::new(subject, candidate, &[&found.base], Search::Wide).ok()?;
                let gain = refitted.gain_over(&found.base, subject);
                let effects = found.added(&refitted).into_iter().map(String::from).collect();
                let p = found.bootstrap.p(gain.fitted);
                Some(SearchStep { addition: Addition { effects, gain, over_base: gain, p, round: 0 }, refitted })
            })
            .collect();
        let cost = |smaller: &SearchStep| step.refitted.fitted.objective - smaller.refitted.fitted.objective;
        let is_needless =
            |smaller: &SearchStep| cost(smaller) < criteria.least_removal_nats && criteria.passes(&smaller.addition);
        let needless = smaller.into_iter().filter(is_needless);
        match needless.min_by(|a, b| cost(a).total_cmp(&cost(b))) {
            Some(smaller) => step = smaller,
            None => return step,
        }
    }
}

/// Models in which another effect replaces one effect of a claim, with the slug of the new effect.
pub fn replacements(subject: &Subject, found: &SearchResult, claimed: &Refitted) -> Vec<(&'static str, Refitted)> {
    let names = found.added(claimed);
    let others: Vec<&'static str> =
        found.singles.iter().filter(|s| s.refitted.is_some() && !names.contains(&s.slug)).map(|s| s.slug).collect();
    let mut wanted: Vec<(&'static str, Vec<&str>)> = Vec::new();
    for replaced in &names {
        for slug in &others {
            let rest = names.iter().filter(|other| *other != replaced).copied();
            wanted.push((slug, rest.chain([*slug]).collect()));
        }
    }
    let single_models: Vec<&Refitted> = found.singles.iter().filter_map(|single| single.refitted.as_ref()).collect();
    let refit = |(slug, effects): &(&'static str, Vec<&str>)| {
        if let ([_], Some(single)) = (&effects[..], found.single(slug)) {
            return single.refitted.clone().map(|refitted| (*slug, refitted));
        }
        let is_inside = |model: &&&Refitted| found.added(model).iter().all(|name| effects.contains(name));
        let contained: Vec<&Refitted> = single_models.iter().filter(is_inside).copied().chain([&found.base]).collect();
        let candidate = subject.extended(effects).ok()?;
        Refitted::new(subject, candidate, &contained, Search::Wide).ok().map(|refitted| (*slug, refitted))
    };
    wanted.par_iter().filter_map(refit).collect()
}

#[cfg(test)]
#[path = "search_tests.rs"]
pub(super) mod tests;
