//! Measures the whole main job on the embedded replica, without a stored surrogate: mesh, finite elements, surrogate, posterior, full finite-element check,
//! figures.
//!
//! Limit: 5 s on two cores.

use criterion::Criterion;
use vitreo_uq::jobs::artefacts;
use vitreo_uq::posterior::monitor::SilentMonitor;
use vitreo_uq::posterior::problem::Problem;
use vitreo_uq::posterior::replica;
use vitreo_uq::posterior::sample::{SampleRequest, run};
use vitreo_uq::posterior::study::{ModelSpecification, Provenance};
use vitreo_uq::sampling::SamplerOptions;

fn main_job() {
    let (experiment, _) = replica::embedded().expect("the replica is sound");
    let problem =
        Problem::new(experiment, ModelSpecification::default(), None, &SilentMonitor).expect("a sound problem");
    let request =
        SampleRequest { options: SamplerOptions::default(), kept_surrogate: None, checkpoint: None, resume: false };
    let result = run(&problem, &request, &SilentMonitor).expect("the job runs");
    let dir = tempfile::tempdir().expect("a temporary directory");
    let header = |kind: &str| Provenance::new(kind, 1, 1, Default::default());
    artefacts::write(dir.path(), &result, &header).expect("results are written");
}

fn main() {
    let mut criterion = Criterion::default().configure_from_args().sample_size(10);
    criterion.bench_function("main job", |bencher| bencher.iter(main_job));
    criterion.final_summary();
}
