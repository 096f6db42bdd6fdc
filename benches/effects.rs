//! Measures the time of one likelihood with each effect and each noise model: batches of 32 points around the reference, 800 equidistant rows, one thread.
//!
//! Limits: with any effect at most ten times the time of the base model, or twenty times if the effect changes the displacement field. With all noise terms the
//! limit is 20 µs. Times include priors, stages and spectra.

use std::collections::BTreeMap;
use std::hint::black_box;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use vitreo_uq::models::effects::Library;
use vitreo_uq::posterior::monitor::SilentMonitor;
use vitreo_uq::posterior::prepared::PreparedModel;
use vitreo_uq::posterior::problem::Problem;
use vitreo_uq::posterior::replica::{TABLE_I, embedded};
use vitreo_uq::posterior::study::ModelSpecification;
use vitreo_uq::record::Experiment;
use vitreo_uq::sampling::LogDensity;
use vitreo_uq::sampling::ensemble::RandomStream;

const N_POINTS: usize = 32;

/// Returns the replica with all four cycles fitted.
fn experiment() -> Experiment {
    let (mut experiment, _) = embedded().expect("embedded");
    experiment.calibration_cycles = vec![1, 2, 3, 4];
    experiment.heldout_cycles.clear();
    experiment
}

/// Returns points around the law of Table I; other parameters are near the 40 % quantiles of their priors. Coordinate d of point i is at index `d * N_POINTS +
/// i`.
fn batch(problem: &Problem) -> Vec<f64> {
    let reference = |name: &str| {
        let law = problem.model.base().parameters();
        let of_law = law.iter().position(|p| p.name == name).and_then(|i| TABLE_I.get(i).copied());
        of_law.unwrap_or_else(|| problem.priors.get(name).expect("a prior").distribution.quantile(0.4))
    };
    let natural: Vec<f64> = problem.priors.names().map(reference).collect();
    let mut stream = RandomStream::new(7, 0);
    let centre = problem.priors.to_unconstrained(&natural);
    centre.iter().flat_map(|z| (0..N_POINTS).map(|_| z + 0.01 * stream.normal()).collect::<Vec<_>>()).collect()
}

fn measure(criterion: &mut Criterion, group: &str, name: &str, problem: &Problem) {
    let prepared = PreparedModel::unverified(problem, None, &SilentMonitor).expect("training succeeds");
    let posterior = prepared.posterior();
    let (points, mut values) = (batch(problem), vec![0.0; N_POINTS]);
    posterior.log_density(&points, &mut values);
    assert!(values.iter().all(|value| value.is_finite()), "{name}: {values:?}");
    let mut group = criterion.benchmark_group(group);
    group.throughput(Throughput::Elements(N_POINTS as u64));
    group.bench_function(name, |bencher| {
        bencher.iter(|| posterior.log_density(black_box(&points), black_box(&mut values)));
    });
    group.finish();
}

fn all(criterion: &mut Criterion) {
    let library = Library::default();
    let base = Problem::new(experiment(), ModelSpecification::default(), None, &SilentMonitor).expect("sound");
    measure(criterion, "effect", "none", &base);
    for effect in library.effects() {
        let effects = vec![effect.slug().to_string()];
        let specification = ModelSpecification { effects, fixed: BTreeMap::new(), ..ModelSpecification::default() };
        let problem = base.with_model(specification, &library).expect("an effect alone is a model");
        measure(criterion, "effect", effect.slug(), &problem);
    }
    for terms in [&["white", "ou"][..], &["white", "gain"], &["white", "student"], &["white", "ou", "gain", "student"]]
    {
        let noise = terms.iter().map(ToString::to_string).collect();
        let specification = ModelSpecification { noise, ..ModelSpecification::default() };
        let problem = base.with_model(specification, &library).expect("a model");
        measure(criterion, "noise", &terms.join(" "), &problem);
    }
}

criterion_group!(benches, all);
criterion_main!(benches);
