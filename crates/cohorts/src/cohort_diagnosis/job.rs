//! Diagnosis of a cohort: reads each record, searches for the missing effect, finds effects that could replace it (rivals), and compares the effect's
//! sizes between groups.

use rayon::prelude::*;

use super::apparatus::Apparatuses;
use super::class::rivals;
use super::compare::{GroupComparison, GroupSizes, compare_groups, fine_laws, group_sizes};
use super::judge::{EffectGain, EffectSearch, N_COHORTS, search_effects};
use super::law::{LikelihoodRatios, Nodes, Sides, SizeLawGrid};
use super::likelihood::SizeLikelihood;
use super::refit::{SizeFit, SizedPrediction, fit_size, gain_nats, law_of, predict_at_cohort_size};
use super::scan::EffectScan;
use super::wording;
use crate::cohort::{self, Key, Measurement};
use crate::design::Labels;
use base::error::{Error, InputPlace, Result};
use criticism::Subject;
use criticism::criteria::Criteria;
use criticism::sketch::{BaseFit, RecordScores, SignatureScore, sketch, with_all_cycles_fitted};
use criticism::verdict::{
    Addition, ClaimProposal, EffectEvidence, Evidence, Residual, ResidualTest, Verdict, decide_verdict,
};
use documents::cohort::{
    CohortContrast, CohortDiagnosis, CohortEffect, CohortErrors, CohortGain, CohortGroup, CohortLaw, CohortSimulations,
    CohortSpecimen, CohortVerdict, NullSide, SizeDistribution,
};
use posterior::monitor::{Counter, Monitor, refuse_if_stopped};

/// Settings for the diagnosis of a cohort.
#[derive(Debug, Clone, PartialEq)]
pub struct CohortRequest {
    /// Keys that define the groups; empty for a diagnosis without groups.
    pub keys: Vec<Key>,
    /// Margin of practical equivalence: ratios from 1/(1 + margin) to 1 + margin count as no difference.
    pub margin: f64,
    /// Number of simulated records per record.
    pub n_simulations: usize,
    /// Seed of all random numbers.
    pub seed: u64,
}

const CRITERIA: Criteria = Criteria::COHORT;
/// Constant that separates the random streams of the records' simulations from other streams.
const RECORD_STREAMS: u64 = 0x5eed_c040;
const STREAM_OF_RECORD: u32 = 24;
/// Smallest number of records that make a cohort.
pub const FEWEST_RECORDS: usize = 2;

/// Diagnoses a cohort.
///
/// # Errors
/// [`Error::Input`] for fewer than two records or missing labels, [`Error::Interrupted`] if stopped, and errors of reading a record.
pub fn run(measurements: &[Measurement], request: &CohortRequest, monitor: &dyn Monitor) -> Result<CohortDiagnosis> {
    if measurements.len() < FEWEST_RECORDS {
        return Err(Error::input(
            InputPlace::default(),
            format!("{} record is too few for a cohort", measurements.len()),
            "give at least two experiments or studies, or a directory that holds them",
        ));
    }
    // Missing labels are refused before the computation starts.
    let labels = cohort::labels(measurements, &request.keys)?;
    monitor.stage("preparing the models of every apparatus");
    let apparatuses = Apparatuses::of(measurements, monitor)?;
    monitor.stage("scoring every effect in every record");
    let (said, based) = read(measurements, &apparatuses, request, monitor)?;
    monitor.stage("simulating cohorts without a missing effect");
    let judged = search_effects(&said, request.seed, monitor);
    let mut found = DiagnosisState {
        measurements,
        labels: &labels,
        request,
        said: &said,
        based: &based,
        judged: &judged,
        claim: None,
    };
    let leading = match found.leading() {
        Some(leading) => Some(found.leading_after_fits(leading, &apparatuses, monitor)?),
        None => None,
    };
    let mut evidence = found.evidence(leading);
    if let Some(claimed) = evidence.claim(&CRITERIA).and(leading) {
        check_interrupt(monitor)?;
        monitor.stage("comparing the claim with its rivals");
        evidence.rivals = rivals(&said, &CRITERIA, &judged.effects, claimed, request.seed);
        monitor.stage("fitting the claim to every record");
        let claim = Claim::new(&found, &apparatuses, claimed, monitor)?;
        if let Some(proposal) = evidence.proposals.first_mut() {
            let residual = Some(Residual::CohortClaim(claim.error_ratio(found.base_errors())));
            proposal.test = Some(ResidualTest { residual, ..ResidualTest::default() });
        }
        found.claim = Some(claim);
    }
    Ok(found.document(leading, decide_verdict(&evidence, &CRITERIA)))
}

/// Returns an error if the user has stopped the run.
///
/// # Errors
/// [`Error::Interrupted`] if stopped.
pub fn check_interrupt(monitor: &dyn Monitor) -> Result<()> {
    refuse_if_stopped(monitor, "no result was written; finished reduced models are kept")
}

/// Computes the signature scores of each record, and the record's fit without any effect. Records are processed one after another, because the simulations
/// of one record use all threads.
fn read(
    measurements: &[Measurement],
    apparatuses: &Apparatuses,
    request: &CohortRequest,
    monitor: &dyn Monitor,
) -> Result<(Vec<RecordScores>, Vec<BaseFit>)> {
    let counter = Counter::new(monitor, measurements.len());
    let of = |(number, measurement): (usize, &Measurement)| {
        check_interrupt(monitor)?;
        let seed = request.seed ^ RECORD_STREAMS ^ ((number as u64) << STREAM_OF_RECORD);
        let read = apparatuses.subject(measurement).and_then(|subject| sketch(&subject, request.n_simulations, seed));
        counter.add_one();
        read.map_err(|error| measurement.with_name(error))
    };
    let read: Vec<(RecordScores, BaseFit)> = measurements.iter().enumerate().map(of).collect::<Result<_>>()?;
    Ok(read.into_iter().unzip())
}

/// Intermediate results of a diagnosis, from which the document is made.
struct DiagnosisState<'a> {
    measurements: &'a [Measurement],
    labels: &'a [Labels],
    request: &'a CohortRequest,
    said: &'a [RecordScores],
    based: &'a [BaseFit],
    judged: &'a EffectSearch,
    claim: Option<Claim>,
}

/// Claimed effect with its fits to all records.
struct Claim {
    /// Index of the claimed effect among the searched effects.
    claimed: usize,
    /// Results for each record, with the effect at the size that the cohort predicts for the record.
    predicted: Vec<SizedPrediction>,
    /// Sizes of the effect over all records.
    all: GroupSizes,
    /// Sizes of the effect in each group, and their ratios between groups; `None` unless there are several groups.
    compared: Option<GroupComparison>,
}

impl Claim {
    fn new(found: &DiagnosisState, apparatuses: &Apparatuses, claimed: usize, monitor: &dyn Monitor) -> Result<Self> {
        let (said, based) = (found.said, found.based);
        let gained = &found.judged.effects[claimed];
        let counter = Counter::new(monitor, 3 * said.len());
        let subject = |number: usize| found.subject(number, apparatuses, &counter, monitor);
        // The prediction of the last cycle uses only the fitted cycles. The sizes in the document use all cycles.
        let fitted = Fits::new(found, gained, &subject, |said| &said.told.fitted)?;
        let (_, place) = fitted.laws.best(&fitted.ratios().iter().collect::<Vec<_>>());
        let predict = |number: usize| -> Result<SizedPrediction> {
            let of = (&said[number].effects[gained.effect], &fitted.sized[number]);
            let at = (&fitted.laws, &fitted.nodes[number], place);
            let predicted = predict_at_cohort_size(&subject(number)?, &based[number], of, at);
            predicted.map_err(|error| found.measurements[number].with_name(error))
        };
        let predicted = (0..said.len()).into_par_iter().map(predict).collect::<Result<_>>()?;
        let all = Fits::new(found, gained, &|number| with_all_cycles_fitted(&subject(number)?), |said| &said.whole)?;
        let groups = found.groups();
        let of_group = |(_, members): &(String, Vec<usize>)| members.iter().map(|number| &all.nodes[*number]).collect();
        let each_group: Vec<Vec<&Nodes>> = groups.iter().map(of_group).collect();
        let compared = (groups.len() > 1).then(|| compare_groups(&all.laws, &each_group, found.request.margin));
        let all = group_sizes(&all.laws, &all.nodes.iter().collect::<Vec<_>>());
        Ok(Self { claimed, predicted, all, compared })
    }

    /// Held-out error with the effect, divided by the held-out error that the predictive noise allows. Both errors are over all records. Infinite if the
    /// effect does not lower the error of the base models, `None` if no cycle is held out.
    fn error_ratio(&self, base: CohortErrors) -> Option<f64> {
        let rows = |sized_prediction: &SizedPrediction| sized_prediction.heldout.map(|(_, n)| n);
        let allowed = root_mean_square(
            self.predicted.iter().map(|sized_prediction| sized_prediction.allowed_um.zip(rows(sized_prediction))),
        );
        let error_um = self.errors().rmse_heldout_um?;
        let is_lower = base.rmse_heldout_um.is_none_or(|base_um| error_um < base_um);
        Some(if is_lower { error_um / allowed.rmse_heldout_um? } else { f64::INFINITY })
    }

    /// Held-out errors over all records, with the effect.
    fn errors(&self) -> CohortErrors {
        root_mean_square(self.predicted.iter().map(|sized_prediction| sized_prediction.heldout))
    }
}

/// Fits of the claimed effect's size in each record, and the size laws that follow from these fits.
struct Fits {
    sized: Vec<SizeFit>,
    laws: SizeLawGrid,
    nodes: Vec<Nodes>,
}

impl Fits {
    /// Fits the claimed effect to the fitted cycles of each record; `subject` returns a record by its number. `readings` must return the record's
    /// signature scores from the same cycles.
    fn new(
        found: &DiagnosisState,
        gained: &EffectGain,
        subject: &(dyn Fn(usize) -> Result<Subject> + Sync),
        readings: fn(&RecordScores) -> &Vec<SignatureScore>,
    ) -> Result<Self> {
        let (said, based) = (found.said, found.based);
        let scan = EffectScan::new(said, gained.effect).ok_or_else(|| nothing_shows(found, gained))?;
        let asked = |number: usize| &said[number].effects[gained.effect];
        let fit = |number: usize| -> Result<SizeFit> {
            let sized = fit_size(&subject(number)?, &based[number], asked(number));
            sized.map_err(|error| found.measurements[number].with_name(error))
        };
        let sized: Vec<SizeFit> = (0..said.len()).into_par_iter().map(fit).collect::<Result<_>>()?;
        // First-order likelihoods of the size in one record, at the grid points of the effect's other parameters that the search found.
        let points = |number: usize| -> Vec<SizeLikelihood> {
            let n = asked(number).readings.len();
            let points = gained.shape.map_or(0..n, |point| point..(point + 1).min(n));
            points.map(|point| scan.likelihood(number, readings(&said[number]), point)).collect()
        };
        let told = |number: usize| {
            sized[number].likelihood.map_or_else(|| points(number), |size_likelihood| vec![size_likelihood])
        };
        let each: Vec<Vec<SizeLikelihood>> = (0..said.len()).map(told).collect();
        let laws = fine_laws(&each.concat()).ok_or_else(|| nothing_shows(found, gained))?;
        let nodes = each.iter().map(|size_likelihoods| nodes_of(&laws, size_likelihoods)).collect();
        Ok(Self { sized, laws, nodes })
    }

    fn ratios(&self) -> Vec<LikelihoodRatios> {
        self.nodes.iter().map(|nodes| self.laws.ratios(nodes)).collect()
    }
}

fn nothing_shows(found: &DiagnosisState, gained: &EffectGain) -> Error {
    let slug = found.slug(gained);
    Error::numerical(format!("no record shows {slug} when the effect is fitted"), "diagnose the records one by one")
}

/// Likelihood ratio of each size for one record. For a record without information, all sizes are as likely as no effect.
fn nodes_of(laws: &SizeLawGrid, likelihoods: &[SizeLikelihood]) -> Nodes {
    let of: Vec<Nodes> = likelihoods.iter().map(|likelihood| laws.nodes(likelihood)).collect();
    if of.is_empty() {
        let blind = SizeLikelihood { height: 0.0, z: 0.0, norm: 0.0, unit: 1.0, power: 1.0, reach: [f64::INFINITY; 2] };
        return laws.nodes(&blind);
    }
    super::law::averaged(&of)
}

impl DiagnosisState<'_> {
    fn slug(&self, gained: &EffectGain) -> &'static str {
        self.said[0].effects[gained.effect].slug
    }

    fn parameter(&self, effect: usize) -> &'static str {
        let names = self.said.iter().map(|said| said.effects[effect].parameter);
        names.into_iter().find(|name| !name.is_empty()).unwrap_or("")
    }

    /// Index of the effect with the largest gain in log likelihood on the fitted and the held-out cycles together; `None` if no effect has a gain.
    fn leading(&self) -> Option<usize> {
        let rank = |k: usize| self.judged.effects[k].best.rank_nats();
        let effects = &self.judged.effects;
        let of = |best: usize, other: usize| if rank(other) > rank(best) { other } else { best };
        (0..effects.len()).filter(|k| effects[*k].best.gain_nats > 0.0).reduce(of)
    }

    /// Finds the effect with the largest gain by full fits. Effects with nearly the gain of `leading` are fitted to each record. The gains of these fits
    /// replace the first-order gains, which are wrong at sizes for which an effect is not linear.
    fn leading_after_fits(&self, leading: usize, apparatuses: &Apparatuses, monitor: &dyn Monitor) -> Result<usize> {
        let effects = &self.judged.effects;
        let rank = |place: usize| effects[place].best.rank_nats();
        let is_near =
            |place: &usize| effects[*place].best.gain_nats > 0.0 && rank(*place) >= CRITERIA.near_rank * rank(leading);
        let near: Vec<usize> = (0..effects.len()).filter(is_near).collect();
        if near.len() < 2 {
            return Ok(leading);
        }
        let scans: Vec<Option<EffectScan>> =
            near.iter().map(|place| EffectScan::new(self.said, effects[*place].effect)).collect();
        monitor.stage("fitting the effects with nearly the largest gain to every record");
        let counter = Counter::new(monitor, self.said.len());
        let more = |number: usize| -> Result<Vec<f64>> {
            let subject = self.subject(number, apparatuses, &counter, monitor)?;
            let (said, based) = (&self.said[number], &self.based[number]);
            let more = |(place, scan): (&usize, &Option<EffectScan>)| -> Result<f64> {
                let first_order = scan.as_ref().map(|scan| scan.own_gain(number, &said.told.fitted));
                let fitted = gain_nats(&subject, based, &said.effects[effects[*place].effect])?;
                Ok(fitted.zip(first_order).map_or(0.0, |(fitted, first_order)| fitted - first_order))
            };
            near.iter()
                .zip(&scans)
                .map(more)
                .collect::<Result<_>>()
                .map_err(|error| self.measurements[number].with_name(error))
        };
        let each: Vec<Vec<f64>> = (0..self.said.len()).into_par_iter().map(more).collect::<Result<_>>()?;
        let total = |k: usize| rank(near[k]) + each.iter().map(|values| values[k]).sum::<f64>();
        // If several effects have the largest gain, the first is chosen.
        let best = (0..near.len()).reduce(|best, other| if total(other) > total(best) { other } else { best });
        Ok(best.map_or(leading, |best| near[best]))
    }

    /// Prepares a record for fits, without its outliers.
    fn subject(
        &self,
        number: usize,
        apparatuses: &Apparatuses,
        counter: &Counter,
        monitor: &dyn Monitor,
    ) -> Result<Subject> {
        check_interrupt(monitor)?;
        counter.add_one();
        let subject = apparatuses.subject(&self.measurements[number])?;
        let rows = &self.based[number].outlier_rows;
        Ok(if rows.is_empty() { subject } else { subject.without_rows(rows) })
    }

    /// Held-out errors of the base models over all records.
    fn base_errors(&self) -> CohortErrors {
        root_mean_square(self.based.iter().map(|base_fit| base_fit.rmse_heldout))
    }

    /// Evidence for the verdict: the leading effect, and the residuals of all records without this effect. Only the leading effect can be claimed. The
    /// residuals with this effect are tested after its fit.
    fn evidence(&self, leading: Option<usize>) -> Evidence {
        let proposal = |place: usize| {
            let gained = &self.judged.effects[place];
            let EffectGain { best, p_familywise, .. } = gained;
            let heldout = [best.heldout_nats; 2];
            let addition = Addition::of_gains(self.slug(gained), best.gain_nats, heldout, *p_familywise);
            ClaimProposal { addition, test: Some(ResidualTest::default()), alone: None }
        };
        let n_too_much = self.based.iter().filter(|base_fit| base_fit.has_misfit).count();
        let base = ResidualTest { residual: Some(Residual::Cohort(n_too_much)), ..ResidualTest::default() };
        Evidence { proposals: leading.map(proposal).into_iter().collect(), base: Some(base), rivals: Vec::new() }
    }

    /// Groups in the order of their names, each with the indices of its records. Empty if no keys define groups.
    fn groups(&self) -> Vec<(String, Vec<usize>)> {
        let mut groups: Vec<(String, Vec<usize>)> = Vec::new();
        if self.request.keys.is_empty() {
            return groups;
        }
        for (number, labels) in self.labels.iter().enumerate() {
            let name = labels.levels.join(", ");
            match groups.iter_mut().find(|(group, _)| *group == name) {
                Some((_, members)) => members.push(number),
                None => groups.push((name, vec![number])),
            }
        }
        groups.sort();
        groups
    }

    fn effect(&self, effect: usize, verdict: &Verdict) -> CohortEffect {
        let gained = self.judged.effects.iter().find(|gained| gained.effect == effect);
        let slug = self.said[0].effects[effect].slug;
        let p = gained.map_or(1.0, |gained| gained.p_familywise);
        let evidence = EffectEvidence {
            effect: slug,
            gain_nats: gained.map(|gained| gained.best.gain_nats),
            p,
            visible_fraction: gained.map(|_| 1.0),
        };
        let asked = |said: &RecordScores| said.effects[effect].clone();
        let can = self.said.iter().filter(|said| asked(said).refused.is_none()).count();
        let law = gained.filter(|gained| gained.best.gain_nats > 0.0).map(|gained| SizeDistribution {
            median: gained.law.ln_median.exp(),
            between_specimen_log_sd: gained.law.log_sd,
            share: gained.law.share,
            sides: side_name(gained.law.sides),
        });
        let refused = (can == 0).then(|| self.said.iter().find_map(|said| asked(said).refused)).flatten();
        CohortEffect {
            effect: slug.into(),
            parameter: Some(self.parameter(effect)).filter(|name| !name.is_empty()).map(String::from),
            status: verdict.status(&evidence, &CRITERIA),
            gain_nats: gained.map_or(0.0, |gained| gained.best.gain_nats),
            p_familywise: p,
            heldout_gain_nats: gained.and_then(|gained| gained.best.heldout_nats),
            law,
            records: can,
            refused,
        }
    }

    fn specimen(&self, number: usize) -> CohortSpecimen {
        let (measurement, based) = (&self.measurements[number], &self.based[number]);
        let gain = |gained: &EffectGain| CohortGain {
            effect: self.slug(gained).into(),
            gain_nats: gained.of_records[number],
            own_gain_nats: gained.by_itself[number],
        };
        let predicted = self.claim.as_ref().map(|claim| &claim.predicted[number]);
        let group = (!self.request.keys.is_empty()).then(|| self.labels[number].levels.join(", "));
        CohortSpecimen {
            id: measurement.experiment.specimen_id.clone(),
            experiment: measurement.name(),
            group,
            gains: self.judged.effects.iter().map(gain).collect(),
            probability: predicted.map(|predicted| predicted.has),
            value: predicted.map(|predicted| predicted.value),
            leaves_too_much: based.has_misfit,
            outliers: based.outlier_rows.len(),
        }
    }

    fn group(&self, claim: &Claim, (name, members): (&str, usize), sizes: &GroupSizes) -> CohortGroup {
        let gained = &self.judged.effects[claim.claimed];
        let [q05, median, q95] = sizes.median;
        let [share_q05, share, share_q95] = sizes.share;
        let likeliest = (0..3).fold(0, |best, k| if sizes.sides[k] > sizes.sides[best] { k } else { best });
        CohortGroup {
            name: name.into(),
            records: members,
            effect: self.slug(gained).into(),
            parameter: self.parameter(gained.effect).into(),
            median,
            q05,
            q95,
            between_specimen_log_sd: sizes.log_sd[1],
            share,
            share_q05,
            share_q95,
            mean: sizes.mean,
            sides: side_name([Sides::Above, Sides::Below, Sides::Both][likeliest]),
            gain_nats: sizes.gain_nats,
        }
    }

    fn contrasts(&self, claim: &Claim, compared: &GroupComparison, groups: &[CohortGroup]) -> Vec<CohortContrast> {
        let gained = &self.judged.effects[claim.claimed];
        let of = |([a, b], ratio): &([usize; 2], super::compare::Ratio)| {
            let [q05, ratio_median, q95] = ratio.ratio;
            let [greater, beyond, below] = ratio.probabilities;
            let mut contrast = CohortContrast {
                effect: self.slug(gained).into(),
                parameter: self.parameter(gained.effect).into(),
                a: groups[*a].name.clone(),
                b: groups[*b].name.clone(),
                ratio_median,
                q05,
                q95,
                probability_greater: greater,
                probability_beyond_margin: beyond,
                probability_below_margin: below,
                is_declared: ratio.is_declared(),
                verdict: ratio.verdict(),
                sentence: String::new(),
            };
            contrast.sentence = wording::contrast(&contrast, [&groups[*a], &groups[*b]], self.request.margin);
            contrast
        };
        compared.ratios.iter().map(of).collect()
    }

    /// Geometric means of the law's parameters without and with the effect. There is one entry per group, or one for all records if there are no groups.
    fn law(&self, claim: &Claim, groups: &[(String, Vec<usize>)]) -> Vec<CohortLaw> {
        let base = self.based[0].base.candidate.model.base();
        let is_same = |base_fit: &BaseFit| base_fit.base.candidate.model.base() == base;
        if !self.based.iter().all(is_same) {
            return Vec::new();
        }
        let everyone = [("all".to_string(), (0..self.said.len()).collect::<Vec<_>>())];
        let groups = if groups.is_empty() { &everyone[..] } else { groups };
        let mean = |members: &[usize], of: &dyn Fn(usize) -> f64| {
            (members.iter().map(|number| of(*number).ln()).sum::<f64>() / members.len() as f64).exp()
        };
        let of_group = |(name, members): &(String, Vec<usize>)| {
            let of_parameter = |(k, spec): (usize, &base::parameter::ParameterSpec)| CohortLaw {
                group: name.clone(),
                parameter: spec.name.into(),
                before: mean(members, &|number| {
                    let fit = &self.based[number];
                    law_of(fit, &fit.base.fitted.theta)[k]
                }),
                after: mean(members, &|number| claim.predicted[number].law[k]),
            };
            base.parameters().iter().enumerate().map(of_parameter).collect::<Vec<_>>()
        };
        groups.iter().flat_map(of_group).collect()
    }

    fn document(&self, leading: Option<usize>, verdict: Verdict) -> CohortDiagnosis {
        let n_effects = self.said[0].effects.len();
        let mut effects: Vec<CohortEffect> = (0..n_effects).map(|effect| self.effect(effect, &verdict)).collect();
        let pooled = self.claim.as_ref().map(|claim| self.group(claim, ("all", self.said.len()), &claim.all));
        // Full fits of the claimed effect replace the sizes of first-order scores.
        if let Some(pooled) = &pooled
            && let Some(claimed) = effects.iter_mut().find(|entry| entry.effect == pooled.effect)
        {
            claimed.law = Some(SizeDistribution {
                median: pooled.median,
                between_specimen_log_sd: pooled.between_specimen_log_sd,
                share: pooled.share,
                sides: pooled.sides,
            });
        }
        let named = self.groups();
        let groups: Vec<CohortGroup> = match &self.claim {
            None => Vec::new(),
            Some(claim) => match &claim.compared {
                Some(compared) => {
                    let pairs = named.iter().zip(&compared.groups);
                    pairs
                        .map(|((name, group_members), sizes)| self.group(claim, (name, group_members.len()), sizes))
                        .collect()
                }
                None => {
                    let name = named.first().map_or("all", |(name, _)| name.as_str());
                    vec![self.group(claim, (name, self.said.len()), &claim.all)]
                }
            },
        };
        let contrasts = match &self.claim {
            Some(claim) => {
                claim.compared.as_ref().map_or_else(Vec::new, |compared| self.contrasts(claim, compared, &groups))
            }
            None => Vec::new(),
        };
        let specimens: Vec<CohortSpecimen> = (0..self.said.len()).map(|number| self.specimen(number)).collect();
        let of_leading = leading.map(|place| &effects[self.judged.effects[place].effect]);
        let Verdict { kind, effects: named_effects, equivalent, .. } = verdict;
        let base = self.base_errors();
        let sentence = wording::verdict(
            (kind, of_leading, &equivalent),
            (pooled.as_ref(), &groups, &specimens),
            self.claim.as_ref().and_then(|claim| Some((claim.errors().rmse_heldout_um?, claim.error_ratio(base)?))),
            base,
        );
        let extended = self.claim.as_ref().map(Claim::errors);
        let threshold = self.judged.threshold();
        CohortDiagnosis {
            remarks: wording::remarks(&effects, &specimens, kind),
            verdict: CohortVerdict { kind, effects: named_effects, equivalent, sentence },
            effects,
            specimens,
            by: self.request.keys.iter().map(|key| key.name().to_string()).collect(),
            margin: self.request.margin,
            law: self.claim.as_ref().map_or_else(Vec::new, |claim| self.law(claim, &named)),
            groups,
            contrasts,
            base,
            extended,
            simulations: CohortSimulations {
                of_each_record: self.request.n_simulations,
                cohorts: N_COHORTS,
                threshold_nats: threshold.is_finite().then_some(threshold),
            },
        }
    }
}

/// Root mean square error over the scored positions of all records. `of` yields the error (µm) and the number of positions of each record.
fn root_mean_square(of: impl Iterator<Item = Option<(f64, usize)>>) -> CohortErrors {
    let (mut squares, mut n) = (0.0, 0);
    for (rmse, n_rows) in of.flatten() {
        squares += rmse * rmse * n_rows as f64;
        n += n_rows;
    }
    CohortErrors { rmse_heldout_um: (n > 0).then(|| (squares / n as f64).sqrt()) }
}

fn side_name(sides: Sides) -> NullSide {
    match sides {
        Sides::Above => NullSide::Above,
        Sides::Below => NullSide::Below,
        Sides::Both => NullSide::Either,
    }
}
