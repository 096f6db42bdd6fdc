//! Somebody else's model in the place of ours: learnt for a record before anything is fitted, kept, and asked again for draws that are checked.

mod client;
mod http;

use std::sync::Arc;

use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use super::problem::Problem;
use super::{Monitor, cache};
use crate::error::{Error, Place, Result};
use crate::model::{Compliance, Forward, Response, TrainedRange};
use crate::number::Dual;
use crate::parameter::ParameterSpec;
use crate::rheology::OutsideLaw;
use crate::stages::{Learnt, LearntRecord, Load, Spread, Stages};
use crate::surrogate::trajectory::{Drive, OutsideModel, OutsideRecord, OutsideSurface};
use client::Client;

/// Share of the noise that the error may have.
const SHARE_OF_NOISE: f64 = 0.1;
/// The noise is taken as this where nothing is known and nothing can be estimated, relative to the range of positions.
const UNKNOWN_NOISE: f64 = 0.005;
/// Quantile of the priors at which an effect does something.
const OFF_NULL: f64 = 0.7;
/// Learning aims at this share of what is accepted, so that what is kept serves a record whose noise is estimated a little lower.
const AIM: f64 = 0.8;

/// What stands for a law that another program computes.
pub(super) struct OutsideReduced {
    /// Completes stages by what was learnt.
    pub compliance: Compliance,
    /// Ranges over which it was.
    pub trained: Vec<TrainedRange>,
    /// Its root mean square error over the range of positions.
    pub relative_error: Option<f64>,
}

/// The reduced model of a problem whose law another program computes: kept, or learnt now.
///
/// # Errors
/// [`Error::Input`] where no URL is given; what asking the program, and learning, refuse.
pub(super) fn reduced(problem: &Problem, law: &OutsideLaw, monitor: &dyn Monitor) -> Result<OutsideReduced> {
    let record = &problem.experiment.record;
    let (time_s, force) = (&record.time_s[..], record.force());
    let ranges = problem.training_ranges();
    let scales = problem.experiment.scales();
    let yardstick = problem.experiment.noise_yardstick();
    let noise_m = yardstick.map_or(UNKNOWN_NOISE * scales.position_range_m, |yardstick| yardstick.sd_m);
    let tolerance_m = SHARE_OF_NOISE * noise_m;
    let hash = hash_of(law, &format!("{ranges:?}"), &Drive::commanded(time_s, force));
    let kept = cache::read::<OutsideSurface>(&hash);
    let kept = kept.filter(|kept| kept.is_whole(record.n_rows()) && kept.error_m <= tolerance_m);
    let surface = match kept {
        Some(kept) => {
            monitor.stage("taking what was learnt of somebody else's model");
            kept
        }
        None => {
            if law.url().is_empty() {
                return Err(Error::input(
                    Place::option("--forward"),
                    "nothing says where somebody else's model answers",
                    "give its address, as in `--forward http://127.0.0.1:4242`, or `url` in [base.forward]",
                ));
            }
            monitor.stage(&format!("learning somebody else's model at {}", law.url()));
            let client = Client::new(law, monitor.stop());
            client.greet(&Drive::commanded(time_s, force))?;
            let late_s = (2.0 * scales.sample_interval_s).max(0.05 * scales.hold_s);
            let wanted = OutsideRecord { time_s, force, tolerance_m: AIM * tolerance_m, late_s };
            let ask = |parameters: &[f64], drive: &Drive| client.evaluate(parameters, drive);
            let learnt = OutsideSurface::learn(&ranges, &wanted, &ask)?;
            cache::write(&hash, &learnt);
            learnt
        }
    };
    monitor.stage(&said(&surface));
    let relative_error = (scales.position_range_m > 0.0).then(|| surface.error_m / scales.position_range_m);
    let model = Arc::new(OutsideModel::new(surface, time_s, force)?);
    let compliance = Compliance::given(1.0).with_spread(move |stages| model.spread(stages));
    refuse_not_followed(problem, &compliance)?;
    Ok(OutsideReduced { compliance, trained: ranges, relative_error })
}

/// Refuses effects of load that cannot be followed beside a law that another program computes.
///
/// # Errors
/// [`Error::Input`] with the reason.
pub(crate) fn refuse_not_followed(problem: &Problem, compliance: &Compliance) -> Result<()> {
    let value = |spec: &ParameterSpec| {
        let prior = || problem.priors.get(spec.name).map_or(f64::NAN, |prior| prior.distribution.quantile(OFF_NULL));
        problem.specification.fixed.get(spec.name).copied().unwrap_or_else(prior).into()
    };
    let parameters: Vec<Dual> = problem.model.parameters().iter().map(value).collect();
    match compliance.resolve(&mut problem.model.stages(&parameters)?) {
        Err(Error::Numerical { what, remedy }) => Err(Error::input(Place::option("--with"), what, remedy)),
        other => other.map(|_| ()),
    }
}

fn said(surface: &OutsideSurface) -> String {
    let loads =
        surface.load_error_m().map_or(String::new(), |error_m| format!(", under loads {:.3} µm", 1e6 * error_m));
    format!("somebody else's model is learnt from {} calls to {:.3} µm{loads}", surface.n_calls, 1e6 * surface.error_m)
}

/// SHA-256 over the program's version, the law, what else counts, and the force.
fn hash_of(law: &OutsideLaw, rest: &str, drive: &Drive) -> String {
    let mut hash = Sha256::new();
    hash.update(env!("CARGO_PKG_VERSION"));
    let names: Vec<(&str, &str)> = law.parameters().iter().map(|spec| (spec.name, spec.unit)).collect();
    hash.update(format!("outside {:?} {:?} {names:?} {rest} {:?} ", law.url(), law.model(), drive.force.rule));
    drive.time_s.iter().chain(&drive.force.at_rows_n).for_each(|x| hash.update(x.to_le_bytes()));
    hash.finalize().iter().map(|byte| format!("{byte:02x}")).collect()
}

/// An answer as it is kept: positions (m) at every row.
#[derive(Serialize, Deserialize)]
struct Answered {
    position_m: Vec<f64>,
}

/// The program itself as a forward model of a problem; answers are kept.
pub(super) struct OutsideForward<'a> {
    problem: &'a Problem,
    law: &'a OutsideLaw,
    response: Response,
}

impl<'a> OutsideForward<'a> {
    /// Over the whole record; `None` for laws of this program.
    pub fn new(problem: &'a Problem) -> Option<Self> {
        let record = &problem.experiment.record;
        let law = problem.model.base().outside()?;
        Some(Self { problem, law, response: Response::new(&record.time_s, record.force(), record.n_rows()) })
    }
}

impl Forward for OutsideForward<'_> {
    fn trajectory_m(&self, parameters: &[f64]) -> Result<Vec<f64>> {
        let constants: Vec<Dual> = parameters.iter().copied().map(Dual::constant).collect();
        let stages = self.problem.model.stages(&constants)?;
        let record = &self.problem.experiment.record;
        let drive = Drive::behind(&stages.load, &record.time_s, record.force());
        let own = &parameters[..self.law.parameters().len()];
        let hash = hash_of(self.law, &format!("at {own:?}"), &drive);
        let position_m = match cache::read::<Answered>(&hash).filter(|kept| kept.position_m.len() == record.n_rows()) {
            Some(kept) => kept.position_m,
            None => {
                let position_m = Client::new(self.law, None).evaluate(own, &drive)?;
                let answered = Answered { position_m };
                cache::write(&hash, &answered);
                answered.position_m
            }
        };
        // Only what comes after the law is left to do: its answer stands for it, under no load.
        let answer = LearntRecord {
            time_s: record.time_s.clone(),
            force: record.force().into(),
            rates_per_s: Vec::new(),
            laws: vec![vec![0.0; 2]],
            left_m: vec![position_m],
        };
        let spread = Spread::Learnt(Learnt { record: Arc::new(answer), amplitudes: vec![Dual::ONE] });
        let load: Load = Stages::of_law(Vec::new()).load;
        self.response.trajectory_m(&Stages { load, spread: Some(spread), ..stages }, 1.0)
    }
}
