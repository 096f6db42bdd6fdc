//! Learns a correction of the law from half of a cohort's records, and confirms it on the other half, which the learning does not use.
//!
//! Every second record is used for learning. A correction is a function of a state that changes a quantity of the law. Each pair of quantity and state is
//! scored by the sum of its gains over the learning records, with a separate function for each record. The formula is the simplest formula that predicts
//! unseen cycles of these records nearly as well as the separate functions.
//!
//! The last cycle of each other record is then predicted from the cycles before it, with and without the formula. Both predictions are probability
//! densities of the same data. For records without the effect, a gain of G nats or more therefore has a probability of at most e^−G (Markov's inequality
//! for the ratio of densities). No simulations are needed.

use std::path::{Path, PathBuf};

use super::artefacts::refuse_other;
use super::cohort::Measurement;
use super::cohort_diagnosis::apparatus::Apparatuses;
use super::cohort_diagnosis::job::{FEWEST_RECORDS, check_interrupt};
use base::error::{Error, InputPlace, Result, Setting};
use base::files::{remove_if_there, write_atomically};
use documents::learned::EquivalentPair;
use documents::learned_cohort::{
    CohortFormula, CohortPair, ConfirmedOn, LearnedCohort, LearnedCohortKind, LearnedCohortVerdict, TrainingRecord,
};
use figures::number::format_significant;
use learning::record::{Formula, LearningRecord, PairGain, test_formula};
use learning::{
    EQUAL_NATS, FILE_NAME, FORMULA_LOSS, FORMULA_LOSS_NATS, LARGEST_P, LEAST_EVIDENCE_NATS, LEAST_FUTURE_NATS,
    quantity_words,
};
use posterior::monitor::{Counter, Monitor};
use posterior::study::{Provenance, RevisionWriter, WithProvenance};

/// Gain in log likelihood (nats) per record that each further parameter of a formula must bring.
const NATS_PER_PARAMETER: f64 = 1.0;
/// Folder of the results, inside the output directory.
const FOLDER: &str = "learned";
/// File name of the document in this folder.
const DOCUMENT: &str = "learned-cohort.json";

/// Learned correction of the law, with the file of its formula.
pub struct Outcome {
    /// Document of the learned correction and its confirmation.
    pub learned: LearnedCohort,
    /// Text of the effect's file; `None` if nothing was learned.
    pub file: Option<String>,
}

/// Learns a correction from half of the records, and confirms it on the other half.
///
/// # Errors
/// [`Error::Input`] for too few records or records of one cycle, [`Error::Interrupted`] if stopped, and errors of reading a record.
pub fn run(measurements: &[Measurement], is_monotone: bool, monitor: &dyn Monitor) -> Result<Outcome> {
    if measurements.len() < 2 * FEWEST_RECORDS {
        return Err(Error::input(
            InputPlace::default(),
            format!("{} records are too few: one half is for learning, the other for confirming", measurements.len()),
            format!("give at least {} records, or learn from a single record", 2 * FEWEST_RECORDS),
        ));
    }
    monitor.stage("preparing the models of every apparatus");
    let apparatuses = Apparatuses::of(measurements, monitor)?;
    let (from, on): (Vec<_>, Vec<_>) = measurements.iter().enumerate().partition(|(number, _)| number % 2 == 0);
    monitor.stage("fitting every quantity as a function of every state to half of the records");
    let counter = Counter::new(monitor, from.len());
    let mut records = Vec::new();
    for (_, measurement) in from {
        check_interrupt(monitor)?;
        let record = apparatuses
            .subject(measurement)
            .and_then(|subject| LearningRecord::new(&subject, is_monotone, &posterior::monitor::SilentMonitor));
        records.push((measurement, record.map_err(|error| measurement.with_name(error))?));
        counter.add_one();
    }
    let half = LearningRecords::new(records);
    let Some(leading) = half.leading() else { return Ok(half.nothing()) };
    monitor.stage("writing the function as a formula");
    let Some((formula, gain_nats)) = half.formula(leading, monitor)? else { return Ok(half.nothing()) };
    monitor.stage("confirming the formula on the other half");
    let counter = Counter::new(monitor, on.len());
    let mut confirmed_on = Vec::new();
    for (_, measurement) in on {
        check_interrupt(monitor)?;
        let tried = apparatuses.subject(measurement).and_then(|subject| test_formula(&subject, &formula));
        counter.add_one();
        // If the formula cannot be added to a record's model, the record contributes no evidence.
        let Some(tried) = tried.map_err(|error| measurement.with_name(error))? else { continue };
        let [rmse_before_um, rmse_after_um] = tried.rmse_um;
        let (experiment, values) = (measurement.name(), tried.values);
        let last_cycle_gain_nats = tried.last_cycle_gain_nats;
        confirmed_on.push(ConfirmedOn { experiment, last_cycle_gain_nats, rmse_before_um, rmse_after_um, values });
    }
    Ok(half.learned(leading, (formula, gain_nats), confirmed_on))
}

/// Records from which the correction is learned.
struct LearningRecords<'a> {
    records: Vec<(&'a Measurement, LearningRecord)>,
    /// Gains of all pairs of a law's quantity and a state on which it may depend, one list per record.
    told: Vec<Vec<PairGain>>,
    /// Pairs of quantity and state that all records have, largest gain first.
    pairs: Vec<(&'static str, CohortPair)>,
}

impl<'a> LearningRecords<'a> {
    fn new(records: Vec<(&'a Measurement, LearningRecord)>) -> Self {
        let told: Vec<Vec<PairGain>> = records.iter().map(|(_, record)| record.pair_gains()).collect();
        let sum = |first: &PairGain| {
            let of =
                |pair_gains: &Vec<PairGain>| pair_gains.iter().find(|pair_gain| pair_gain.slug == first.slug).cloned();
            let all: Vec<PairGain> = told.iter().map(of).collect::<Option<_>>()?;
            let pair = CohortPair {
                quantity: first.quantity.into(),
                state: first.state.into(),
                evidence_nats: all.iter().map(|pair_gain| pair_gain.evidence_nats).sum(),
                heldout_gain_nats: all.iter().map(|pair_gain| pair_gain.heldout_gain_nats).sum::<Option<f64>>()?,
            };
            Some((first.slug, pair))
        };
        let mut pairs: Vec<(&'static str, CohortPair)> = told[0].iter().filter_map(sum).collect();
        pairs.sort_by(|(_, a), (_, b)| b.evidence_nats.total_cmp(&a.evidence_nats));
        Self { records, told, pairs }
    }

    /// Index of the pair of quantity and state with the largest gain among those that predict unseen cycles. `None` if no pair predicts them, or if its
    /// gain is too small or far below the largest gain.
    fn leading(&self) -> Option<usize> {
        let best = self.pairs.first()?.1.evidence_nats;
        let place = self.pairs.iter().position(|(_, pair)| pair.heldout_gain_nats > LEAST_FUTURE_NATS)?;
        let cohort_pair = &self.pairs[place].1;
        (cohort_pair.evidence_nats >= LEAST_EVIDENCE_NATS.max(best - EQUAL_NATS)).then_some(place)
    }

    /// Finds the simplest formula that predicts unseen cycles nearly as well as separate functions for each record. If no formula does, finds the formula
    /// with the best prediction. Returns the formula with its gain (nats) on unseen cycles.
    fn formula(&self, leading: usize, monitor: &dyn Monitor) -> Result<Option<(Formula, f64)>> {
        let slug = self.pairs[leading].0;
        let ranges: Option<Vec<_>> = self.records.iter().map(|(_, record)| record.range(slug)).collect();
        let Some(ranges) = ranges else { return Ok(None) };
        let state = ranges[0].0;
        let range = ranges.iter().fold([0.0_f64; 2], |[low, high], (_, range)| [low.min(range[0]), high.max(range[1])]);
        let formulas = self.records[0].1.formulas(slug, state, range);
        let mut sums: Vec<Option<f64>> = vec![Some(0.0); formulas.len()];
        let (mut of_functions, counter) = (0.0, Counter::new(monitor, self.records.len()));
        for (_, record) in &self.records {
            check_interrupt(monitor)?;
            let Some(gain) = record.function_gain_nats(slug) else { return Ok(None) };
            of_functions += gain;
            let values = record.gains_nats(&formulas);
            sums.iter_mut().zip(values).for_each(|(sum, value)| *sum = sum.zip(value).map(|(sum, value)| sum + value));
            counter.add_one();
        }
        let n_records = self.records.len() as f64;
        let mut scored: Vec<(Formula, f64, f64)> = formulas
            .into_iter()
            .zip(sums)
            .filter_map(|(formula, sum)| {
                let beyond = formula.written.parameters.len().saturating_sub(1) as f64;
                Some((formula, sum?, sum? - NATS_PER_PARAMETER * beyond * n_records))
            })
            .collect();
        scored.sort_by(|(_, _, a), (_, _, b)| b.total_cmp(a));
        let Some(best) = scored.first().map(|(_, _, score)| *score) else { return Ok(None) };
        let least = (of_functions - FORMULA_LOSS_NATS - FORMULA_LOSS * of_functions.max(0.0)).min(best);
        let n = |formula: &Formula| formula.written.parameters.len();
        let good = scored.into_iter().filter(|(_, _, score)| *score >= least);
        Ok(good.min_by_key(|(formula, _, _)| n(formula)).map(|(formula, sum, _)| (formula, sum)))
    }

    fn document(&self, sentence: String) -> LearnedCohort {
        LearnedCohort {
            verdict: LearnedCohortVerdict { kind: LearnedCohortKind::Nothing, sentence },
            quantity: String::new(),
            state: String::new(),
            equivalent: Vec::new(),
            evidence_nats: 0.0,
            heldout_gain_nats: 0.0,
            formula: None,
            learnt_from: Vec::new(),
            confirmed_on: Vec::new(),
            confirmation_nats: None,
            largest_p: None,
            pairs: self.pairs.iter().map(|(_, pair)| pair.clone()).collect(),
        }
    }

    fn nothing(&self) -> Outcome {
        let sentence = format!(
            "Nothing was learnt from {} records: no quantity that depends on a state predicts their unseen cycles better than the model does.",
            self.records.len()
        );
        Outcome { learned: self.document(sentence), file: None }
    }

    fn learned(&self, leading: usize, (formula, gain_nats): (Formula, f64), on: Vec<ConfirmedOn>) -> Outcome {
        let (slug, pair) = &self.pairs[leading];
        let gain: f64 = on.iter().map(|confirmed_on| confirmed_on.last_cycle_gain_nats).sum();
        let largest_p = (-gain).exp().min(1.0);
        let kind = if largest_p <= LARGEST_P { LearnedCohortKind::Confirmed } else { LearnedCohortKind::NotConfirmed };
        let equals = self.pairs.iter().enumerate().filter(|(place, (_, other))| {
            *place != leading
                && (&other.quantity, &other.state) != (&pair.quantity, &pair.state)
                && other.evidence_nats >= pair.evidence_nats - EQUAL_NATS
        });
        let equivalent: Vec<EquivalentPair> = equals
            .map(|(_, (_, cohort_pair))| EquivalentPair {
                quantity: cohort_pair.quantity.clone(),
                state: cohort_pair.state.clone(),
            })
            .collect();
        let told = self.told.iter().zip(&self.records).filter_map(|(told, (measurement, _))| {
            let told = told.iter().find(|told| told.slug == *slug)?;
            Some(TrainingRecord {
                experiment: measurement.name(),
                evidence_nats: told.evidence_nats,
                heldout_gain_nats: told.heldout_gain_nats.unwrap_or(0.0),
            })
        });
        let n_better = on.iter().filter(|confirmed_on| confirmed_on.last_cycle_gain_nats > 0.0).count();
        let mut sentence = format!(
            "Learnt from {} records: {} changes with the {} (gain {} nats on their unseen cycles). The formula is {} × ({}).",
            self.records.len(),
            quantity_words(&pair.quantity),
            pair.state.replace('_', " "),
            format_significant(pair.heldout_gain_nats, 3),
            pair.quantity,
            formula.written.text,
        );
        sentence += &match kind {
            LearnedCohortKind::Confirmed => format!(
                " The other {} records confirm it: {n_better} of them predict their last cycle better with it, by {} nats in total. Records without the effect gain as \
                 much with a probability of at most {largest_p:.1e}.",
                on.len(),
                format_significant(gain, 3)
            ),
            _ => format!(
                " The other {} records do not confirm it: {n_better} of them predict their last cycle better with it, by {} nats in total; {} nats are required.",
                on.len(),
                format_significant(gain, 3),
                format_significant(-LARGEST_P.ln(), 2)
            ),
        };
        if !equivalent.is_empty() {
            let names: Vec<String> = equivalent
                .iter()
                .map(|equivalent_pair| {
                    format!("{} by {}", equivalent_pair.quantity, equivalent_pair.state.replace('_', " "))
                })
                .collect();
            sentence += &format!(" These records cannot distinguish it from {}.", names.join(", "));
        }
        let learned = LearnedCohort {
            verdict: LearnedCohortVerdict { kind, sentence },
            quantity: pair.quantity.clone(),
            state: pair.state.clone(),
            equivalent,
            evidence_nats: pair.evidence_nats,
            heldout_gain_nats: pair.heldout_gain_nats,
            formula: Some(CohortFormula {
                text: formula.written.text.clone(),
                parameters: formula.written.parameters.iter().map(|parameter| parameter.name.into()).collect(),
                units: formula.written.parameters.iter().map(|parameter| parameter.unit.clone()).collect(),
                file: FILE_NAME.into(),
                heldout_gain_nats: gain_nats,
            }),
            learnt_from: told.collect(),
            confirmed_on: on,
            confirmation_nats: Some(gain),
            largest_p: Some(largest_p),
            ..self.document(String::new())
        };
        Outcome { learned, file: Some(formula.file) }
    }
}

/// Refuses an output folder that holds a correction learned from other records.
///
/// # Errors
/// [`Error::Input`] unless `force` is set.
pub fn check_place(out: &Path, provenance: &Provenance, force: bool) -> Result<()> {
    let (found, remedy) = (
        "this correction was learned from other records",
        format!("choose another directory with `{}`, or replace it with `{}`", Setting::Out, Setting::Force),
    );
    refuse_other(out.join(FOLDER).join(DOCUMENT), provenance, force, (found, &remedy))
}

/// Writes the document of the correction and the file of its formula, completely or not at all. Returns the folder of both.
///
/// # Errors
/// [`Error::File`] if the file system refuses.
pub fn write(out: &Path, outcome: &Outcome, provenance: Provenance) -> Result<PathBuf> {
    let remedy = format!("choose a writable place with `{}`", Setting::Out);
    std::fs::create_dir_all(out).map_err(|source| Error::at_path("create", out, source, remedy))?;
    let document = WithProvenance { provenance, body: &outcome.learned };
    RevisionWriter::begin(out, FOLDER)?.publish(DOCUMENT, &document, |dir| match &outcome.file {
        Some(text) => write_atomically(&dir.join(FILE_NAME), text.as_bytes()),
        None => remove_if_there(&dir.join(FILE_NAME)),
    })
}
