//! Joint posterior of a specimen that was measured several times. All records share the law's parameters, but each record has its own noise parameters.
//!
//! Records are creep experiments and oscillations. The log-density of a record depends on the law's parameters and on the record's own noise parameters,
//! and includes the priors of both. The joint log-density is the sum over all records, but counts the law's prior only once. A likelihood ratio test shows
//! whether the records agree: it compares a separate law for each record with a common law.

use statrs::distribution::{ChiSquared, ContinuousCDF};

use base::error::{Error, InputPlace, Result, Setting};
use base::parameter::ParameterSpec;
use base::quantities::Quantities;
use documents::joint::{Agreement, JointRecord, JointSummary, LawEstimate};
use documents::posterior::{ModelSummary, Warning, WarningKind};
use posterior::monitor::Monitor;
use posterior::prior::{Prior, PriorSet};
use posterior::sample::{
    natural_columns, plain_summaries, sample_without_checkpoint, sampler_summary, with_parameter_names,
};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use sampling::diagnostics::DrawColumn;
use sampling::ensemble::SampleOutcome;
use sampling::optimum::{Mode, find_modes};
use sampling::{LogDensity, SamplerOptions};

use crate::design::files::NEXT;

/// Number of starting points of each search, drawn from the prior.
const N_STARTS: usize = 48;
/// p of the agreement test below which the records count as disagreeing.
const LEAST_P: f64 = 0.01;
/// Ratio of the learnt to the known noise above which the noise has absorbed a misfit.
const ABSORBED: f64 = 1.5;
/// Largest number of records in a joint posterior.
pub const MOST_RECORDS: usize = 20;

/// One record of a joint posterior. The first coordinates of the record are the law's parameters; its noise parameters follow.
pub struct JointMember<'a> {
    /// Specimen identifier.
    pub id: String,
    /// Kind of the record: `creep`, `relaxation` or `oscillation`.
    pub kind: &'static str,
    /// Words and units of the record's quantities; `None` for a commanded force and a measured position, and for an oscillation.
    pub quantities: Option<Quantities>,
    /// Noise standard deviation of the record's measured quantity, given or estimated, in the unit of `noise_um`; `None` if unknown, and for an oscillation.
    pub noise_um: Option<f64>,
    /// Log posterior density over the record's coordinates, including their priors.
    pub density: &'a dyn LogDensity,
    /// Priors of the record's coordinates, in their order.
    pub priors: &'a PriorSet,
}

/// Several records that share the law's parameters.
pub struct Joint<'a> {
    /// The records.
    pub members: Vec<JointMember<'a>>,
    /// Priors of the law's parameters.
    law: PriorSet,
    /// Priors of all parameters: those of the law, then the noise parameters of each record. The name of a noise parameter begins with the record's
    /// number.
    pub priors: PriorSet,
}

/// Joint posterior with its draws.
pub struct JointResult {
    /// Document that describes the posterior.
    pub summary: JointSummary,
    /// Draws of each sampled parameter, in its natural unit.
    pub columns: Vec<DrawColumn>,
}

impl<'a> Joint<'a> {
    /// Joins records to a joint posterior. The first coordinates of each record must be the parameters of `law`.
    ///
    /// # Errors
    /// [`Error::Input`] for fewer than two records, for too many, or if the priors of their laws differ.
    pub fn new(members: Vec<JointMember<'a>>, law: &[ParameterSpec]) -> Result<Self> {
        let refuse = |found: String, remedy: &str| Err(Error::input(InputPlace::default(), found, remedy));
        if members.len() < 2 || members.len() > MOST_RECORDS {
            return refuse(
                format!("{} records cannot be joined", members.len()),
                "give from 2 to 20 records of one specimen",
            );
        }
        let is_of_law = |name: &str| law.iter().any(|spec| spec.name == name);
        let first = members[0].priors;
        let names: Vec<&str> = first.names().filter(|name| !is_of_law(name)).collect();
        let of_law = first.without(&names);
        if of_law.priors().is_empty() {
            return refuse("every parameter of the law is fixed".into(), "leave at least one parameter free");
        }
        let n_law = of_law.priors().len();
        if members.iter().any(|member| member.priors.priors()[..n_law] != *of_law.priors()) {
            return refuse(
                "the records' laws have different priors".into(),
                &format!("name one prior for all records with {}", Setting::Prior),
            );
        }
        let named = |(number, member): (usize, &JointMember<'_>)| -> Vec<Prior> {
            let translated = |prior: &Prior| match member.quantities {
                Some(quantities) => (quantities.key(&prior.name), quantities.translate(&prior.unit).into_owned()),
                None => (prior.name.clone(), prior.unit.clone()),
            };
            let of_record = |prior: &Prior| {
                let (name, unit) = translated(prior);
                Prior { name: format!("record {}: {name}", number + 1), unit, ..prior.clone() }
            };
            member.priors.priors()[n_law..].iter().map(of_record).collect()
        };
        let of_records: Vec<Prior> = members.iter().enumerate().flat_map(named).collect();
        let priors = of_law.with(&of_records);
        Ok(Self { members, law: of_law, priors })
    }

    /// Index of each coordinate of one record in a point of the joint posterior.
    fn places(&self, record: usize) -> Vec<usize> {
        let n_law = self.law.priors().len();
        let n_own = |member: &JointMember<'_>| member.priors.priors().len() - n_law;
        let before: usize = self.members[..record].iter().map(n_own).sum();
        let range = n_law + before..n_law + before + n_own(&self.members[record]);
        (0..n_law).chain(range).collect()
    }

    /// Log-density of one record at a point, without the prior of the law's parameters.
    fn without_prior(&self, density: &dyn LogDensity, point: &[f64]) -> f64 {
        let (mut value, mut prior) = ([0.0], [0.0]);
        density.log_density(point, &mut value);
        self.law.add_ln_pdf_unconstrained(&point[..self.law.priors().len()], &mut prior);
        value[0] - prior[0]
    }

    /// Tests whether the records agree: compares a separate law for each record with a common law. Returns the test and the law of each record.
    fn agreement(&self, seed: u64) -> Result<(Agreement, Vec<JointRecord>)> {
        let highest = |density: &dyn LogDensity, priors: &PriorSet| -> Result<Mode> {
            let mut rng = ChaCha8Rng::seed_from_u64(seed);
            let starts: Vec<Vec<f64>> =
                (0..N_STARTS).map(|_| priors.to_unconstrained(&priors.draw(&mut rng))).collect();
            let modes = find_modes(density, &starts)?;
            let best =
                modes.iter().filter(|mode| mode.converged).max_by(|a, b| a.log_density.total_cmp(&b.log_density));
            best.cloned()
                .ok_or_else(|| Error::numerical("no best fit was found", "check the records one by one with `sample`"))
        };
        let joint = highest(self, &self.priors)?;
        let mut apart = 0.0;
        let mut records = Vec::new();
        for member in &self.members {
            let mode = highest(member.density, member.priors)?;
            apart += self.without_prior(member.density, &mode.location);
            records.push(JointRecord { id: member.id.clone(), kind: member.kind.into(), law: self.estimates(&mode) });
        }
        let together: f64 = (0..self.members.len())
            .map(|record| {
                let point: Vec<f64> = self.places(record).iter().map(|place| joint.location[*place]).collect();
                self.without_prior(self.members[record].density, &point)
            })
            .sum();
        let statistic = (2.0 * (apart - together)).max(0.0);
        let degrees = (self.members.len() - 1) * self.law.priors().len();
        let p = ChiSquared::new(degrees as f64).map_or(f64::NAN, |chi| 1.0 - chi.cdf(statistic));
        Ok((Agreement { statistic, degrees_of_freedom: degrees, p }, records))
    }

    /// Estimates of the law's parameters from one record: the value at the record's own mode, and at one standard deviation to either side.
    fn estimates(&self, mode: &Mode) -> Vec<LawEstimate> {
        let n = mode.location.len();
        let covariance = nalgebra::DMatrix::from_row_slice(n, n, &mode.precision).try_inverse();
        let estimate = |(k, prior): (usize, &Prior)| {
            let sd = covariance.as_ref().map_or(f64::NAN, |c| c[(k, k)].max(0.0).sqrt());
            let at = |z: f64| prior.distribution.from_unconstrained(z);
            let z = mode.location[k];
            LawEstimate { name: prior.name.clone(), value: at(z), lower: at(z - sd), upper: at(z + sd) }
        };
        self.law.priors().iter().enumerate().map(estimate).collect()
    }

    /// Samples the joint posterior.
    ///
    /// # Errors
    /// [`Error::Interrupted`] when stopped; otherwise the errors of the search for modes and of sampling.
    pub fn run(&self, model: ModelSummary, options: &SamplerOptions, monitor: &dyn Monitor) -> Result<JointResult> {
        monitor.stage("testing the records' agreement");
        let (agreement, records) = self.agreement(options.seed)?;
        monitor.stage("sampling the joint posterior");
        let mut rng = ChaCha8Rng::seed_from_u64(options.seed);
        let priors = &self.priors;
        let starts: Vec<Vec<f64>> = (0..N_STARTS).map(|_| priors.to_unconstrained(&priors.draw(&mut rng))).collect();
        let outcome = sample_without_checkpoint(self, &starts, options, monitor)?;
        let columns = natural_columns(priors, &outcome);
        let mut warnings = warnings(&agreement, &records, &outcome, &with_parameter_names(&outcome.messages, priors));
        warnings.extend((0..self.members.len()).filter_map(|record| self.misfit_warning(record, &columns)));
        let summary = JointSummary {
            model,
            parameters: plain_summaries(priors, &columns),
            sampler: sampler_summary(options, &outcome),
            records,
            agreement,
            converged: outcome.converged,
            warnings,
        };
        Ok(JointResult { summary, columns })
    }
}

impl Joint<'_> {
    /// Warning if the learnt noise of a record is far above its given or estimated noise: it then contains what the common law misses.
    fn misfit_warning(&self, record: usize, columns: &[DrawColumn]) -> Option<Warning> {
        let JointMember { noise_um, quantities, .. } = &self.members[record];
        let noise_um = (*noise_um)?;
        let begin = format!("record {}: noise_sd", record + 1);
        let place = self.priors.names().position(|name| name.starts_with(&begin))?;
        let mut draws = columns.get(place)?.values.clone();
        draws.sort_by(f64::total_cmp);
        let learnt_um = *draws.get(draws.len() / 2)?;
        let factor = learnt_um / noise_um;
        (factor > ABSORBED).then(|| {
            let text = format!(
                "record {}: the learnt noise of {} µm is {factor:.1} × the noise of {} µm that is given or estimated: the common law misses this record",
                record + 1,
                figures::number::format_significant(learnt_um, 3),
                figures::number::format_significant(noise_um, 3)
            );
            Warning {
                kind: WarningKind::MisfitAboveNoise,
                text: quantities.map_or(text.clone(), |quantities| quantities.translate(&text).into_owned()),
                advice: "fit the record alone with `sample`, and choose the law with `compare --laws`".into(),
            }
        })
    }
}

fn warnings(
    agreement: &Agreement,
    records: &[JointRecord],
    outcome: &SampleOutcome,
    messages: &[String],
) -> Vec<Warning> {
    let mut warnings = Vec::new();
    let mut warn = |kind, text: String, advice: &str| warnings.push(Warning { kind, text, advice: advice.into() });
    if !outcome.converged {
        warn(
            WarningKind::NotConverged,
            "the draws have not converged".into(),
            "give more steps (--steps), or a narrower prior",
        );
    }
    messages.iter().for_each(|text| warn(WarningKind::Sampler, text.clone(), "check the corner plot"));
    if agreement.p < LEAST_P {
        let text = format!(
            "the records do not agree on one law: separate laws gain {:.1} nats more than by chance (p {})",
            0.5 * (agreement.statistic - agreement.degrees_of_freedom as f64),
            if agreement.p < 1e-10 { "< 1e-10".into() } else { format!("= {:.1e}", agreement.p) }
        );
        let advice = "compare the records' own laws above: if all moduli and viscosities differ by one factor, check units, sizes and Poisson ratios first; then `diagnose` each record, because a missing effect biases its law";
        warn(WarningKind::MisfitAboveNoise, text, advice);
    }
    // A record that `design` has prepared has the name of its specimen with an ending.
    let specimen = |record: &'_ JointRecord| record.id.trim_end_matches(NEXT).to_string();
    let mut ids: Vec<String> = records.iter().map(specimen).collect();
    ids.sort_unstable();
    ids.dedup();
    if ids.len() > 1 {
        let text = format!("the records name different specimens: {}", ids.join(", "));
        warn(WarningKind::Sampler, text, "join records of one specimen; `groups` compares several");
    }
    warnings
}

impl LogDensity for Joint<'_> {
    fn dimension(&self) -> usize {
        self.priors.priors().len()
    }

    fn log_density(&self, points: &[f64], log_density: &mut [f64]) {
        let n = log_density.len();
        log_density.fill(0.0);
        let mut values = vec![0.0; n];
        for (record, member) in self.members.iter().enumerate() {
            let columns = self.places(record).into_iter().flat_map(|place| &points[place * n..(place + 1) * n]);
            let columns: Vec<f64> = columns.copied().collect();
            member.density.log_density(&columns, &mut values);
            log_density.iter_mut().zip(&values).for_each(|(sum, value)| *sum += value);
        }
        // The sum contains the law's prior once per record, but it must count only once.
        let mut prior = vec![0.0; n];
        self.law.add_ln_pdf_unconstrained(&points[..self.law.priors().len() * n], &mut prior);
        let others = (self.members.len() - 1) as f64;
        let inside = log_density.iter_mut().zip(&prior).filter(|(sum, _)| **sum > f64::NEG_INFINITY);
        inside.for_each(|(sum, prior)| *sum -= others * prior);
    }
}
