//! A job that is stopped and resumed gives the same bytes as an uninterrupted one.

use crate::program;

use std::path::Path;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

use program::write_instrument_experiment;
use vitreo_uq::Error;
use vitreo_uq::posterior::monitor::{Monitor, SilentMonitor};
use vitreo_uq::posterior::problem::Problem;
use vitreo_uq::posterior::sample::{SampleRequest, SampleResult, run};
use vitreo_uq::posterior::study::ModelSpecification;
use vitreo_uq::record::Experiment;
use vitreo_uq::sampling::SamplerOptions;
use vitreo_uq::sampling::ensemble::Progress;

/// Sets the stop flag after a number of the sampler's reports; 0 stops at the start.
struct Impatient {
    stop: AtomicBool,
    reports_left: AtomicU64,
}

impl Impatient {
    fn after(reports: u64) -> Self {
        Self { stop: AtomicBool::new(reports == 0), reports_left: AtomicU64::new(reports) }
    }
}

impl Monitor for Impatient {
    fn sampling(&self, _progress: &Progress) {
        if self.reports_left.fetch_sub(1, Ordering::Relaxed) <= 1 {
            self.stop.store(true, Ordering::Relaxed);
        }
    }
    fn stop(&self) -> Option<&AtomicBool> {
        Some(&self.stop)
    }
}

fn options() -> SamplerOptions {
    // Convergence does not end the run, so it is long enough to be stopped.
    SamplerOptions { max_steps: 12_000, stop_when_converged: false, ..SamplerOptions::default() }
}

fn job(problem: &Problem, checkpoint: Option<&Path>, monitor: &dyn Monitor) -> vitreo_uq::Result<SampleResult> {
    run(problem, &SampleRequest { options: options(), kept_surrogate: None, checkpoint, resume: true }, monitor)
}

#[test]
fn a_stopped_and_resumed_job_gives_the_same_bytes() {
    let place = tempfile::tempdir().unwrap();
    write_instrument_experiment(&place.path().join("gel"), true, 0.0);
    let (experiment, _) = Experiment::read(&place.path().join("gel")).unwrap();
    let problem = Problem::new(experiment, ModelSpecification::default(), None, &SilentMonitor).unwrap();
    let uninterrupted = job(&problem, None, &SilentMonitor).unwrap();
    let checkpoint = place.path().join("sampler.state");
    let mut interruptions = 0;
    let mut resumed = None;
    for attempt in 0..1_000 {
        match job(&problem, Some(&checkpoint), &Impatient::after(attempt)) {
            Err(Error::Interrupted { kept }) => {
                interruptions += 1;
                assert!(checkpoint.is_file(), "nothing was kept, though the message says: {kept}");
            }
            Err(other) => panic!("{other}"),
            Ok(result) => {
                resumed = Some(result);
                break;
            }
        }
    }
    let resumed = resumed.expect("each attempt goes on from the one before");
    assert!(interruptions > 0, "the job was never stopped");
    assert_eq!(resumed.summary, uninterrupted.summary);
    let bits = |result: &SampleResult| -> Vec<u64> {
        result.columns.iter().flat_map(|column| column.values.iter().map(|value| value.to_bits())).collect()
    };
    assert!(bits(&resumed) == bits(&uninterrupted));
}
