//! What the data write: every pair fitted, the leading one judged, drawn and written as a formula.

use super::distil::{Distilled, NORMAL_90, distil};
use super::fit::{Base, Learnt, Screen, fit_all, fit_under, largest_gain};
use super::function::Function;
use super::pairs::{Kind, Pair, pairs};
use crate::critique::bootstrap::{Bootstrap, Simulations, simulated};
use crate::critique::leftover::misfit;
use crate::critique::outliers;
use crate::critique::refit::{Refitted, refit_all};
use crate::critique::{Candidate, Fitted, Search, Subject};
use crate::documents::learned::{
    EquivalentPair, Learned, LearnedErrors, LearnedFormula, LearnedFunction, LearnedKind, LearnedPair, LearnedPoint,
    LearnedVerdict, QuantityAtReference, Retardation,
};
use crate::error::Result;
use crate::report::number::significant;
use crate::workflow::{Counter, Monitor};

/// What a caller decides.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Request {
    /// Most simulated searches.
    pub n_simulations: usize,
    /// Seed of all random numbers.
    pub seed: u64,
}

impl Default for Request {
    fn default() -> Self {
        Self { n_simulations: 99, seed: 1 }
    }
}

/// What was learnt, with the file of its formula.
pub struct Outcome {
    /// The document.
    pub learned: Learned,
    /// The effect's file; `None` where there is no formula.
    pub file: Option<String>,
}

/// Largest p, least evidence (nats; e⁵ is 150 to 1), least gain (nats) in the log score of unseen cycles, most that the last of them may lose, and the least change of a position over the noise.
const LARGEST_P: f64 = 0.02;
const LEAST_EVIDENCE_NATS: f64 = 5.0;
const LEAST_FUTURE_NATS: f64 = 3.0;
const LARGEST_LOSS_NATS: f64 = 0.1;
const SMALLEST_CHANGE: f64 = 0.25;
/// Pairs whose evidence is nearer to the leading one's are its equals: e⁶ is 400 to 1.
const EQUAL_NATS: f64 = 6.0;
/// What a formula may lose of the function's own log score of unseen cycles: nats, and a share of what that gains.
const FORMULA_LOSS_NATS: f64 = 3.0;
const FORMULA_LOSS: f64 = 0.05;
/// Pairs whose evidence is this near to the leading one's may have a simpler formula that predicts as well.
const SIMPLER_WITHIN_NATS: f64 = 40.0;
/// What an effect of the library may lack of the function's log score of unseen cycles to be preferred: nats, and a share of what that gains. A formula has a few parameters, and the function eight.
const LIBRARY_NATS: f64 = 4.0;
const LIBRARY_SHARE: f64 = 0.02;
/// Streams of the simulated searches, apart from others of the seed.
const STREAM: u64 = 0x1ea4;
/// Points of a function.
const N_POINTS: usize = 61;

/// A search among pairs.
struct Found {
    subject: Subject,
    pairs: Vec<Pair>,
    candidates: Vec<Option<Candidate>>,
    base: Refitted,
    /// Best first.
    learnt: Vec<Learnt>,
}

impl Found {
    /// Every pair fitted beside a base model.
    fn new(subject: &Subject, base: Refitted, monitor: &dyn Monitor) -> Result<Self> {
        let pairs = pairs(subject, &base)?;
        let library = subject.library().clone().beside(pairs.iter().map(|pair| pair.effect));
        let subject = subject.with_library(&library)?;
        let candidates: Vec<Option<Candidate>> =
            pairs.iter().map(|pair| subject.extended(&[pair.effect.slug()]).ok()).collect();
        monitor.stage("fitting every quantity as a function of every state");
        let mut learnt = fit_all(&subject, &Base::new(&subject, &base)?, &pairs, &candidates);
        learnt.sort_by(|a, b| b.evidence_nats.total_cmp(&a.evidence_nats));
        Ok(Self { subject, pairs, candidates, base, learnt })
    }
}

/// Learns.
///
/// # Errors
/// Whatever fitting the base model refuses.
pub fn learn(subject: &Subject, request: &Request, monitor: &dyn Monitor) -> Result<Outcome> {
    monitor.stage("fitting the model");
    let (subject, fitted, _) = outliers::without(subject, &subject.base())?;
    let base = Refitted::at(&subject, subject.base(), fitted)?;
    let found = Found::new(&subject, base, monitor)?;
    let Some(leading) = found.learnt.first() else { return Ok(found.nothing(1.0, "no pair has a model here")) };
    monitor.stage("simulating searches where nothing is to be learnt");
    let p = found.p(leading.evidence_nats, request, monitor)?;
    let Some(chosen) = found.chosen(p) else {
        let why = if p > LARGEST_P { "no more than chance gives" } else { "nothing that predicts unseen cycles" };
        return Ok(found.nothing(p, why));
    };
    monitor.stage("comparing with the library");
    let preferred = found.preferred(chosen, monitor);
    monitor.stage("writing it as a formula");
    let (chosen, distilled) = found.written(chosen);
    monitor.stage("averaging it over priors");
    let function = Function::averaged(&found.subject, chosen, &found.pairs[chosen.pair])?;
    found.learned(chosen, distilled, function.as_ref(), (p, preferred))
}

/// What `learn` would give for what a model at its fit leaves, outliers left out, in words, without the simulated searches that would confirm it; `None` where nothing helps.
///
/// # Errors
/// As [`learn`].
pub fn first_look(subject: &Subject, base: &Refitted, monitor: &dyn Monitor) -> Result<Option<String>> {
    let found = Found::new(subject, base.clone(), monitor)?;
    let Some(chosen) = found.chosen(0.0) else { return Ok(None) };
    let pair = &found.pairs[chosen.pair];
    let Some(share) = found.explained(&chosen.fitted).filter(|share| *share > 0.0) else { return Ok(None) };
    let function = Function::of_search(&found.subject, chosen, pair)?;
    let rises = function.and_then(|own| drawn(&found.subject, &own, pair)).map(|own| rises(&own));
    Ok(Some(format!(
        "{} explains {:.0} % of what is left; `vitreo-uq learn STUDY` writes it",
        words(pair, rises),
        100.0 * share
    )))
}

impl Found {
    /// p of a gain, by searches in data that were simulated from the base.
    fn p(&self, gain: f64, request: &Request, monitor: &dyn Monitor) -> Result<f64> {
        let screen = Screen::new(&self.subject, &self.base, &self.candidates)?;
        let simulations = Simulations { most: request.n_simulations, only_for: Some(LARGEST_P) };
        let counter = Counter::new(monitor, request.n_simulations);
        let largest = |number: usize| {
            let data = simulated(&self.subject, &self.base, request.seed ^ STREAM, number);
            let gain = largest_gain(&data, &self.base, &screen, &self.candidates);
            counter.add_one();
            gain
        };
        Ok(Bootstrap::of(gain, simulations, largest).p(gain))
    }

    /// The leading pair that predicts what was not seen.
    fn chosen(&self, p: f64) -> Option<&Learnt> {
        let predicts = |learnt: &&Learnt| match learnt.future.zip(self.base.future) {
            Some((own, base)) => own.all - base.all > LEAST_FUTURE_NATS && own.last - base.last > -LARGEST_LOSS_NATS,
            None => false,
        };
        let shows = |learnt: &&Learnt| {
            let changes = learnt.fitted.position_m.iter().zip(&self.base.fitted.position_m);
            let largest_m = changes.fold(0.0_f64, |largest, (a, b)| largest.max((a - b).abs()));
            largest_m >= SMALLEST_CHANGE * self.subject.yardstick_m()
        };
        let chosen = self.learnt.iter().filter(predicts).find(shows)?;
        let is_near = self.learnt[0].evidence_nats - chosen.evidence_nats <= EQUAL_NATS;
        (p <= LARGEST_P && is_near && chosen.evidence_nats >= LEAST_EVIDENCE_NATS).then_some(chosen)
    }

    /// Effects of the library that predict what was not seen as well as the function.
    fn preferred(&self, chosen: &Learnt, monitor: &dyn Monitor) -> Vec<String> {
        let own: Vec<&str> = self.pairs.iter().map(|pair| pair.effect.slug()).collect();
        let others = self.subject.library().effects().iter().filter(|effect| !own.contains(&effect.slug()));
        let candidates: Vec<Candidate> =
            others.filter_map(|effect| self.subject.extended(&[effect.slug()]).ok()).collect();
        let refitted = refit_all(&self.subject, &candidates, &[&self.base], Search::Wide, monitor);
        let Some((learnt, base)) = chosen.future.zip(self.base.future) else { return Vec::new() };
        let allowed = LIBRARY_NATS + LIBRARY_SHARE * (learnt.all - base.all).max(0.0);
        let mut good: Vec<(f64, String)> = refitted
            .into_iter()
            .flatten()
            .filter_map(|own| Some((own.future?.all, own.candidate.effects.last()?.clone())))
            .filter(|(score, _)| *score >= learnt.all - allowed)
            .collect();
        good.sort_by(|a, b| b.0.total_cmp(&a.0));
        good.into_iter().map(|(_, slug)| slug).collect()
    }

    /// Share of the squared error that goes, the noise's taken off.
    fn explained(&self, fitted: &Fitted) -> Option<f64> {
        let is_scored = self.subject.scored_m.iter().any(Option::is_some);
        let rows = if is_scored { &self.subject.scored_m } else { &self.subject.fitted_m };
        let noise = self.subject.yardstick_m().powi(2);
        let [before, after] =
            [&self.base.fitted, fitted].map(|own| own.rmse_m(rows).map(|rmse| (rmse * rmse - noise).max(0.0)));
        let (before, after) = (before?, after?);
        (before > 0.0).then(|| (1.0 - after / before).clamp(-1.0, 1.0))
    }

    fn errors(&self, fitted: &Fitted) -> LearnedErrors {
        LearnedErrors {
            rmse_fitted_um: 1e6 * fitted.rmse_m(&self.subject.fitted_m).unwrap_or(f64::NAN),
            rmse_heldout_um: fitted.rmse_m(&self.subject.scored_m).map(|rmse| 1e6 * rmse),
        }
    }

    fn document(&self, p: f64, verdict: LearnedVerdict) -> Learned {
        let experiment = self.subject.experiment();
        let of_base = self.base.future;
        let entry = |learnt: &Learnt| {
            let pair = &self.pairs[learnt.pair];
            let future = learnt.future.zip(of_base);
            LearnedPair {
                quantity: pair.quantity.into(),
                state: pair.state.into(),
                evidence_nats: learnt.evidence_nats,
                heldout_gain_nats: future.map(|(own, base)| own.all - base.all),
                last_cycle_gain_nats: future.map(|(own, base)| own.last - base.last),
                rmse_heldout_um: self.errors(&learnt.fitted).rmse_heldout_um,
            }
        };
        Learned {
            experiment: experiment.specimen_id.clone(),
            verdict,
            fitted_cycles: experiment.calibration_cycles.clone(),
            heldout_cycles: experiment.heldout_cycles.clone(),
            function: None,
            formula: None,
            memory: Vec::new(),
            base: self.errors(&self.base.fitted),
            learned: None,
            with_formula: None,
            noise_um: 1e6 * self.subject.yardstick_m(),
            p_familywise: p,
            explained_fraction: None,
            pairs: self.learnt.iter().map(entry).collect(),
        }
    }

    fn nothing(&self, p: f64, why: &str) -> Outcome {
        let sentence = format!(
            "Nothing was learnt: no quantity that depends on a state explains more than the model does ({why})."
        );
        let verdict = LearnedVerdict {
            kind: LearnedKind::Nothing,
            quantity: String::new(),
            state: String::new(),
            equivalent: Vec::new(),
            library: Vec::new(),
            sentence,
        };
        Outcome { learned: self.document(p, verdict), file: None }
    }

    /// The simplest formula that predicts unseen cycles nearly as well as the function: of the leading pair, or with one parameter of another pair that is within reach. Eight weights may hide
    /// that a line of something else does as well. All of it beside the noise that the model is written with, since that is what a formula is added to: slow noise that only a search allows
    /// takes up levels, and leaves a formula to follow increments alone.
    fn written<'a>(&'a self, chosen: &'a Learnt) -> (&'a Learnt, Option<Distilled>) {
        let subject = self.subject.clone().with_own_noise();
        let Refitted { candidate, fitted, .. } = &self.base;
        let fitted = subject.fit(candidate, &[(fitted.theta.clone(), fitted.noise)], Search::Local);
        let Some(base) = fitted.and_then(|fitted| Refitted::at(&subject, candidate.clone(), fitted)).ok() else {
            return (chosen, None);
        };
        let Some(((function, of_function), of_base)) = fit_under(&subject, chosen).zip(base.future) else {
            return (chosen, None);
        };
        // What even the function leaves beyond the noise is the model's error, whose rows are not independent: nats weigh as much less.
        let left = (1e-6 * function.noise[0] / subject.yardstick_m()).powi(2).max(1.0);
        let gain = of_function.all - of_base.all;
        let least = of_function.all - FORMULA_LOSS_NATS * left - FORMULA_LOSS * gain;
        let is_within = |other: &&Learnt| other.evidence_nats > chosen.evidence_nats - SIMPLER_WITHIN_NATS;
        let formulas = self.learnt.iter().filter(is_within).filter_map(|own| {
            let (pair, most) = (&self.pairs[own.pair], if own.pair == chosen.pair { usize::MAX } else { 1 });
            Some((own, distil(&subject, &base, pair, (least, most))?))
        });
        let simplest = formulas.min_by(|(_, a), (_, b)| {
            let n = |own: &Distilled| own.parameters.len();
            n(a).cmp(&n(b)).then(b.score.total_cmp(&a.score))
        });
        simplest.map_or((chosen, None), |(own, formula)| (own, Some(formula)))
    }

    fn learned(
        &self,
        chosen: &Learnt,
        distilled: Option<Distilled>,
        function: Option<&Function>,
        (p, library): (f64, Vec<String>),
    ) -> Result<Outcome> {
        let pair = &self.pairs[chosen.pair];
        let (candidate, fitted) = function.map_or((&chosen.candidate, &chosen.fitted), Function::best);
        let model = Refitted { candidate: candidate.clone(), fitted: fitted.clone(), future: chosen.future };
        let drawn = function.and_then(|own| drawn(&self.subject, own, pair));
        let formula = distilled.as_ref().zip(drawn.as_ref()).map(|(own, drawn)| own.document(drawn));
        let is_equal =
            |other: &&Learnt| other.pair != chosen.pair && other.evidence_nats >= chosen.evidence_nats - EQUAL_NATS;
        let equal = self.learnt.iter().filter(is_equal).map(|other| {
            let pair = &self.pairs[other.pair];
            EquivalentPair { quantity: pair.quantity.into(), state: pair.state.into() }
        });
        let equivalent: Vec<EquivalentPair> = equal.collect();
        let mut sentence = self.gain_in_words(pair, &model, drawn.as_ref());
        sentence += &self.formula_in_words(pair, distilled.as_ref(), formula.as_ref().zip(drawn.as_ref()));
        sentence += &self.limits_in_words(chosen, &model, &library)?;
        let verdict = LearnedVerdict {
            kind: LearnedKind::Learned,
            quantity: pair.quantity.into(),
            state: pair.state.into(),
            equivalent,
            library,
            sentence,
        };
        let mut learned = self.document(p, verdict);
        learned.learned = Some(self.errors(&model.fitted));
        learned.explained_fraction = self.explained(&model.fitted);
        learned.function = drawn;
        if let Kind::Memory(creep) = &pair.kind {
            let shares = chosen.candidate.parameters(&chosen.fitted.theta);
            let first = shares.len() - creep.times_s.len();
            let all = creep.times_s.iter().zip(&shares[first..]);
            learned.memory = all.map(|(time_s, share)| Retardation { time_s: *time_s, share: *share }).collect();
        }
        learned.with_formula = distilled.as_ref().map(|own| self.errors(&own.refitted.fitted));
        learned.formula = formula;
        Ok(Outcome { learned, file: distilled.map(|own| own.file) })
    }

    /// What depends on what, and what that gains.
    fn gain_in_words(&self, pair: &Pair, model: &Refitted, drawn: Option<&LearnedFunction>) -> String {
        let [before, after] = [&self.base.fitted, &model.fitted].map(|own| self.errors(own));
        let error = |own: LearnedErrors| own.rmse_heldout_um.unwrap_or(own.rmse_fitted_um);
        let cycle = if after.rmse_heldout_um.is_some() { "held-out cycle" } else { "fitted cycles" };
        let words = words(pair, drawn.map(rises));
        let first = words.chars().next().map_or(String::new(), |c| c.to_uppercase().to_string());
        format!(
            "{first}{} brings the error on the {cycle} from {} to {} µm (noise {} µm).",
            words.chars().skip(1).collect::<String>(),
            significant(error(before), 3),
            significant(error(after), 3),
            significant(1e6 * self.subject.yardstick_m(), 3)
        )
    }

    fn formula_in_words(
        &self,
        pair: &Pair,
        distilled: Option<&Distilled>,
        written: Option<(&LearnedFormula, &LearnedFunction)>,
    ) -> String {
        let mut sentence = String::new();
        match distilled.zip(written) {
            Some((own, (formula, drawn))) => {
                let errors = self.errors(&own.refitted.fitted);
                let left = errors.rmse_heldout_um.unwrap_or(errors.rmse_fitted_um);
                sentence += &format!(" As a formula: {}, {} µm.", formula.product(pair.quantity), significant(left, 3));
                if leaves_band(&formula.factors, &drawn.points) {
                    sentence += " It leaves the function's band: the formula is fitted with the noise of the study's model, the function beside every kind of noise.";
                }
            }
            None if matches!(pair.kind, Kind::Function { .. }) => {
                sentence += " No short formula predicts unseen cycles as well.";
            }
            None => {}
        }
        if let Kind::Function { visited, .. } = &pair.kind {
            let beyond = share_beyond(&self.subject, visited);
            if beyond > MOST_BEYOND {
                sentence += &format!(
                    " In {:.0} % of the held-out rows the {} lies beyond what fitted rows visit: there the data say nothing, and the prediction goes on by itself.",
                    100.0 * beyond,
                    pair.state.replace('_', " ")
                );
            }
        }
        sentence
    }

    /// What else would do, and what is left.
    fn limits_in_words(&self, chosen: &Learnt, model: &Refitted, library: &[String]) -> Result<String> {
        let mut sentence = String::new();
        if !library.is_empty() {
            sentence += &format!(" The library's {} does as well and is to be preferred.", quoted(library));
        }
        let is_near = |other: &&Learnt| {
            other.pair != chosen.pair && (other.evidence_nats - chosen.evidence_nats).abs() <= EQUAL_NATS
        };
        let named = |other: &Learnt| {
            let pair = &self.pairs[other.pair];
            format!("{} by {}", pair.quantity, pair.state.replace('_', " "))
        };
        let leading = &self.learnt[0];
        let ahead_nats = leading.evidence_nats - chosen.evidence_nats;
        if ahead_nats > EQUAL_NATS {
            sentence += &format!(
                " Evidence alone prefers {}, by {ahead_nats:.0} nats, for which no formula as short predicts better.",
                named(leading)
            );
        }
        let near: Vec<String> = self.learnt.iter().filter(is_near).map(named).collect();
        if !near.is_empty() {
            sentence += &format!(" This experiment cannot tell it from {}.", near.join(", "));
        }
        if misfit(&self.subject, model, &[])?.is_too_large() {
            sentence += " What it leaves is still more than noise.";
        }
        Ok(sentence)
    }
}

/// What depends on what, and which way.
fn words(pair: &Pair, rises: Option<bool>) -> String {
    let quantity = match pair.quantity {
        "creep" => return "a memory at more times than the law has".into(),
        "force" => "the force".to_string(),
        "position" => "the scale of the observed position".to_string(),
        name => format!("`{name}`"),
    };
    let way = match rises {
        Some(true) => "rising",
        Some(false) => "falling",
        None => "changing",
    };
    format!("{quantity} {way} with the {}", pair.state.replace('_', " "))
}

/// Whether a function rises from the state that is nearest to 0 to the one that is farthest from it.
fn rises(function: &LearnedFunction) -> bool {
    let by_size = |a: &&LearnedPoint, b: &&LearnedPoint| a.state.abs().total_cmp(&b.state.abs());
    let [near, far] = [function.points.iter().min_by(by_size), function.points.iter().max_by(by_size)];
    near.zip(far).is_some_and(|(near, far)| far.factor > near.factor)
}

fn quoted(slugs: &[String]) -> String {
    slugs.iter().map(|slug| format!("`{slug}`")).collect::<Vec<_>>().join(" or ")
}

/// By how much a function is written beyond what fitted rows visit, as a share of that, where the record goes there.
const BEYOND: f64 = 0.15;

/// Quantiles of the fitted states among which the reference is looked for.
const N_QUANTILES: usize = 21;
/// Share of held-out rows beyond the fitted states that a verdict speaks of.
const MOST_BEYOND: f64 = 0.1;
/// Share of states at which a formula may lie outside the function's 90 % band.
const MOST_OUTSIDE: f64 = 0.3;

/// Whether a formula's factors lie outside the function's 90 % band at more states than chance puts there.
fn leaves_band(factors: &[f64], points: &[LearnedPoint]) -> bool {
    let is_inside = |(factor, point): &(&f64, &LearnedPoint)| (point.q05..=point.q95).contains(*factor);
    let n_inside = factors.iter().zip(points).filter(is_inside).count();
    ((factors.len() - n_inside) as f64) > MOST_OUTSIDE * factors.len() as f64
}

/// States of rows that are fitted.
fn of_fitted_rows(subject: &Subject, visited: &[f64]) -> impl Iterator<Item = f64> {
    visited.iter().zip(&subject.fitted_m).filter(|(_, y)| y.is_some()).map(|(s, _)| *s)
}

/// The least and the largest state of rows that are fitted.
fn seen(subject: &Subject, visited: &[f64]) -> [f64; 2] {
    let fitted = of_fitted_rows(subject, visited);
    fitted.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], s| [low.min(s), high.max(s)])
}

/// Share of the held-out rows whose state lies beyond those of fitted rows; 0 where none is held out.
fn share_beyond(subject: &Subject, visited: &[f64]) -> f64 {
    let [low, high] = seen(subject, visited);
    let margin = 0.02 * (high - low);
    let scored = visited.iter().zip(&subject.scored_m).filter(|(_, y)| y.is_some()).map(|(s, _)| *s);
    let (n, n_beyond) = scored.fold((0_usize, 0_usize), |(n, beyond), s| {
        (n + 1, beyond + usize::from(!(low - margin..=high + margin).contains(&s)))
    });
    if n == 0 { 0.0 } else { n_beyond as f64 / n as f64 }
}

/// A function with its band over the states that the record visits; `None` where no row is fitted.
fn drawn(subject: &Subject, function: &Function, pair: &Pair) -> Option<LearnedFunction> {
    let Kind::Function { state, visited, .. } = &pair.kind else { return None };
    let reference_state = function.best_known(&quantiles_of(subject, visited))?;
    let quantiles = |[mean, sd]: [f64; 2]| [0.0, -NORMAL_90, NORMAL_90].map(|z| (mean + z * sd).exp());
    let point = |(state, ln_factor): (&f64, &[f64; 2])| {
        let [factor, q05, q95] = quantiles(*ln_factor);
        LearnedPoint { state: *state, factor, q05, q95 }
    };
    let states = states_of(subject, visited);
    let at_reference = function.ln_quantity(reference_state).map(|own| {
        let [value, q05, q95] = quantiles(own);
        QuantityAtReference { value, q05, q95 }
    });
    Some(LearnedFunction {
        state_unit: state.unit().into(),
        visited: seen(subject, visited),
        reference_state,
        at_reference,
        points: states.iter().zip(&function.curve(&states, reference_state)).map(point).collect(),
    })
}

/// States of the fitted rows, thinned: among them the state is looked for at which the factor is 1.
fn quantiles_of(subject: &Subject, visited: &[f64]) -> Vec<f64> {
    let mut states: Vec<f64> = of_fitted_rows(subject, visited).collect();
    states.sort_by(f64::total_cmp);
    let Some(last) = states.len().checked_sub(1) else { return states };
    let mut quantiles: Vec<f64> = (0..N_QUANTILES).map(|k| states[k * last / (N_QUANTILES - 1)]).collect();
    quantiles.dedup();
    quantiles
}

/// States at which a function is written: those that fitted rows visit, and a little more.
fn states_of(subject: &Subject, visited: &[f64]) -> Vec<f64> {
    let all = visited.iter().fold([0.0_f64; 2], |[low, high], s| [low.min(*s), high.max(*s)]);
    let [low, high] = seen(subject, visited);
    let seen = [low.min(0.0), high.max(0.0)];
    let more = BEYOND * (seen[1] - seen[0]);
    let (low, high) = (all[0].max(seen[0] - more), all[1].min(seen[1] + more));
    (0..N_POINTS).map(|k| low + (high - low) * k as f64 / (N_POINTS - 1) as f64).collect()
}
