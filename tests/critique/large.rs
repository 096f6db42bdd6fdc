//! The loop on data from a gel with large strains: the effect is named and sized, and the law's parameters are recovered.

use std::time::Instant;

use vitreo_uq::base::number::Dual;
use vitreo_uq::criticism::Subject;
use vitreo_uq::criticism::diagnose::{DiagnosisRequest, diagnose};
use vitreo_uq::elements::fe::exact::SphereInContainer;
use vitreo_uq::elements::fe::oldroyd::{Discretisation, FiniteGel, FiniteInput, FiniteLaw};
use vitreo_uq::laws::rheology::BaseLaw;
use vitreo_uq::models::effects::{Library, Stages};
use vitreo_uq::models::model::Response;
use vitreo_uq::posterior::monitor::SilentMonitor;
use vitreo_uq::posterior::problem::Problem;
use vitreo_uq::posterior::replica;
use vitreo_uq::posterior::sample::{SampleRequest, run};
use vitreo_uq::posterior::study::ModelSpecification;
use vitreo_uq::record::{Experiment, Record};
use vitreo_uq::sampling::SamplerOptions;
use vitreo_uq::sampling::ensemble::RandomStream;
use vitreo_uq::validation::challenge::Protocol;

/// Keeps the first two cycles of a record.
fn keep_two_cycles(record: &mut Record) {
    let n_rows = record.cycle.partition_point(|cycle| *cycle <= 2);
    record.time_s.truncate(n_rows);
    record.force_n.truncate(n_rows);
    record.position_m.truncate(n_rows);
    record.cycle.truncate(n_rows);
}

/// The replica's experiment with two cycles and the positions of the fluid instead of the linear model's. Its mesh and steps are finer than those of the training.
fn experiment() -> Experiment {
    let (mut experiment, _) = replica::embedded().expect("the replica");
    keep_two_cycles(&mut experiment.record);
    experiment.calibration_cycles = vec![1];
    experiment.heldout_cycles = vec![2];
    let law = FiniteLaw::new(&BaseLaw::Lethersich.elements(&replica::TABLE_I.map(Dual::constant)), 0.0);
    let law = law.expect("no springpot");
    let gel = FiniteGel::around_sphere(0.275e-3, 10e-3, Discretisation::default()).expect("a mesh");
    let (record, load) = (&experiment.record, Stages::of_law(Vec::new()).load);
    let what = FiniteInput { law: &law, load: &load, time_s: &record.time_s, force: record.force() };
    let deviation_m = gel.run(&what).expect("a run").deviation_m;
    for (position, deviation_m) in experiment.record.position_m.iter_mut().zip(&deviation_m) {
        *position = position.map(|x| x + deviation_m);
    }
    experiment
}

/// At 3.6 radii and 4 µm of noise the geometry is named and its size is 1. The law's parameters are those of the gel; small strains miss them by 30 standard deviations. Data and seeds are fixed; with others a
/// normal error exceeds four standard deviations once in 16,000.
#[test]
#[ignore = "campaigns/long-tests"]
fn large_displacements_are_named_and_come_out_at_one() {
    let experiment = experiment();
    let small = ModelSpecification::default();
    let problem = Problem::new(experiment.clone(), small.clone(), None, &SilentMonitor).expect("a problem");
    let subject = Subject::new(&problem, &Library::default(), None, &SilentMonitor).expect("a subject");
    let begun = Instant::now();
    let diagnosis = diagnose(&subject, &DiagnosisRequest::default(), &SilentMonitor).expect("a diagnosis").diagnosis;
    println!("{} ({:.1} s)", diagnosis.verdict.sentence, begun.elapsed().as_secs_f64());
    for candidate in &diagnosis.candidates {
        let refit = candidate.refit.as_ref();
        let gain = refit.map(|refit| (refit.gain_nats, refit.heldout_gain_nats, refit.rmse_heldout_um));
        println!(
            "  {} z {:.1} p {:.3} {gain:?} {:?}",
            candidate.effect, candidate.z, candidate.p_familywise, candidate.refused
        );
    }
    assert_eq!(diagnosis.verdict.effects, ["large-displacement"], "{}", diagnosis.verdict.sentence);
    let found = diagnosis.candidates.iter().find(|candidate| candidate.effect == "large-displacement");
    let refit = found.and_then(|candidate| candidate.refit.as_ref()).expect("a refit");
    println!("{:?}", refit.parameters);
    assert!(refit.rmse_heldout_um.expect("a held-out cycle") < 1.1 * 4.0, "{refit:?}");

    let large = ModelSpecification { effects: vec!["large-displacement".into()], ..small };
    let problem = Problem::new(experiment, large, None, &SilentMonitor).expect("a problem");
    let request =
        SampleRequest { options: SamplerOptions::default(), kept_surrogate: None, checkpoint: None, resume: false };
    let begun = Instant::now();
    let summary = run(&problem, &request, &SilentMonitor).expect("a posterior").summary;
    println!("sampled in {:.1} s; {:?}", begun.elapsed().as_secs_f64(), summary.warnings);
    assert!(summary.converged, "{:?}", summary.warnings);
    let exact = [replica::TABLE_I[0], replica::TABLE_I[1], replica::TABLE_I[2], 1.0];
    for (parameter, exact) in summary.parameters.iter().zip(exact) {
        println!("{}: {:.5} ± {:.5}, exactly {exact}", parameter.name, parameter.mean, parameter.sd);
        assert!((parameter.mean - exact).abs() < 4.0 * parameter.sd, "{parameter:?}");
    }
}

/// Two cycles of three force levels and rests: closed-form positions with the deviation of the finer fluid, and white noise of 2 µm. The geometry is among the equivalent effects. Tests of other forces,
/// such as a force quadratic in its command, do not stop the diagnosis. With other seeds it would fail once in a thousand: the signal exceeds 6 standard deviations.
#[test]
#[ignore = "campaigns/long-tests"]
fn a_protocol_of_levels_is_learnt_too() {
    const NOISE_M: f64 = 2e-6;
    let (replica, _) = replica::embedded().expect("the replica");
    let mut record = Protocol::Levels.record();
    keep_two_cycles(&mut record);
    let n_rows = record.n_rows();
    let stages = Stages::of_law(BaseLaw::Lethersich.elements(&replica::TABLE_I.map(Dual::constant)));
    let gel = FiniteGel::around_sphere(0.275e-3, 10e-3, Discretisation::default()).expect("a mesh");
    let stiffness_m = SphereInContainer::new(0.48, 0.275e-3, 10e-3).stiffness_n_per_m(1.0);
    let linear_m = Response::new(&record.time_s, record.force(), n_rows).trajectory_m(&stages, 1.0 / stiffness_m);
    let law = FiniteLaw::new(&stages.law, 0.0).expect("no springpot");
    let what = FiniteInput { law: &law, load: &stages.load, time_s: &record.time_s, force: record.force() };
    let deviation_m = gel.run(&what).expect("a run").deviation_m;
    let mut stream = RandomStream::new(21, 0);
    let positions = linear_m.expect("a law").into_iter().zip(deviation_m);
    record.position_m = positions.map(|(x, more)| Some(x + more + NOISE_M * stream.normal())).collect();
    let experiment = Experiment {
        record,
        calibration_cycles: vec![1],
        heldout_cycles: vec![2],
        noise_sd_m: Some(NOISE_M),
        ..replica
    };
    let problem = Problem::new(experiment, ModelSpecification::default(), None, &SilentMonitor).expect("a problem");
    let subject = Subject::new(&problem, &Library::default(), None, &SilentMonitor).expect("a subject");
    let verdict =
        diagnose(&subject, &DiagnosisRequest::default(), &SilentMonitor).expect("a diagnosis").diagnosis.verdict;
    println!("{}", verdict.sentence);
    let class: Vec<&String> = verdict.effects.iter().chain(&verdict.equivalent).collect();
    assert!(class.iter().any(|slug| *slug == "large-displacement"), "{}", verdict.sentence);
}
