//! Diagnoses and extends models of robots that move by several radii, for which small-strain models fail. It is the program of `campaigns/large`.
//!
//! `cargo run --release --example large_displacements -- COUNT FIRST SEED` prints one JSON document. For every record it gives the truth, the result of
//! `diagnose`, and the posterior with `large-displacement`.
//!
//! Positions are the linear response in closed form (a sphere in a sphere, compressible) plus the deviation of an Oldroyd-B fluid. The fluid's mesh and time
//! steps are finer than those of the training. Laws are random, with times within a factor of two of Table I; the force is the paper's.

use rayon::prelude::*;
use serde_json::{Value, json};
use vitreo_uq::base::error::Result;
use vitreo_uq::base::number::Dual;
use vitreo_uq::criticism::Subject;
use vitreo_uq::criticism::diagnose::{DiagnosisRequest, diagnose};
use vitreo_uq::documents::posterior::{ParameterSummary, PosteriorSummary};
use vitreo_uq::elements::fe::exact::SphereInContainer;
use vitreo_uq::elements::fe::oldroyd::{Discretisation, FiniteGel, FiniteInput, FiniteLaw};
use vitreo_uq::laws::rheology::BaseLaw;
use vitreo_uq::models::effects::{Library, Stages};
use vitreo_uq::models::model::Response;
use vitreo_uq::posterior::monitor::SilentMonitor;
use vitreo_uq::posterior::problem::Problem;
use vitreo_uq::posterior::replica::{TABLE_I, embedded};
use vitreo_uq::posterior::sample::{SampleRequest, run};
use vitreo_uq::posterior::study::ModelSpecification;
use vitreo_uq::record::{Apparatus, Experiment};
use vitreo_uq::sampling::SamplerOptions;
use vitreo_uq::sampling::ensemble::RandomStream;
use vitreo_uq::validation::challenge::Protocol;

/// Largest distances of the robot from its start in a linear gel, in robot radii.
const RADII: [f64; 3] = [2.0, 3.0, 3.6];
/// Standard deviations of the white noise of one position, in m; the records state them.
const NOISES_M: [f64; 3] = [2e-6, 4e-6, 8e-6];
const RADIUS_M: f64 = 0.275e-3;
const OUTER_RADIUS_M: f64 = 10e-3;
const POISSON_RATIO: f64 = 0.48;
/// Largest factor between the law's times and those of Table I.
const FACTOR: f64 = 2.0;
/// Resolution of the gel in space and time, finer than in the training of the surrogate.
const FINENESS: Discretisation = Discretisation { order: 6, n_angles: 6, layer_ratio: 2.0, steps_per_doubling: 6 };

struct Hidden {
    protocol: Protocol,
    radii: f64,
    noise_m: f64,
    law: [f64; 3],
}

impl Hidden {
    fn draw(number: usize, stream: &mut RandomStream) -> Result<Self> {
        let protocol = Protocol::ALL[number % 2];
        let (radii, noise_m) = (RADII[number / 2 % 3], NOISES_M[number / 6 % 3]);
        let mut factor = || FACTOR.powf(2.0 * stream.unit() - 1.0);
        let times_s = [TABLE_I[1] / TABLE_I[0] * factor(), TABLE_I[2] / TABLE_I[0] * factor()];
        let unit = [1.0, times_s[0], times_s[1]];
        let linear_m = linear_m(unit, protocol)?;
        let modulus_pa = linear_m.iter().fold(0.0_f64, |most, x| most.max(x.abs())) / (radii * RADIUS_M);
        Ok(Self { protocol, radii, noise_m, law: unit.map(|x| x * modulus_pa) })
    }

    /// Positions (m) without noise.
    fn position_m(&self) -> Result<Vec<f64>> {
        let record = self.protocol.record();
        let elements = BaseLaw::Lethersich.elements(&self.law.map(Dual::constant));
        let law = FiniteLaw::new(&elements, 0.0).expect("no springpot");
        let gel = FiniteGel::around_sphere(RADIUS_M, OUTER_RADIUS_M, FINENESS)?;
        let load = Stages::of_law(Vec::new()).load;
        let what = FiniteInput { law: &law, load: &load, time_s: &record.time_s, force: record.force() };
        let deviation_m = gel.run(&what)?.deviation_m;
        Ok(linear_m(self.law, self.protocol)?.iter().zip(deviation_m).map(|(x, more)| x + more).collect())
    }
}

fn linear_m(law: [f64; 3], protocol: Protocol) -> Result<Vec<f64>> {
    let record = protocol.record();
    let stages = Stages::of_law(BaseLaw::Lethersich.elements(&law.map(Dual::constant)));
    let stiffness_m = SphereInContainer::new(POISSON_RATIO, RADIUS_M, OUTER_RADIUS_M).stiffness_n_per_m(1.0);
    Response::new(&record.time_s, record.force(), record.n_rows()).trajectory_m(&stages, 1.0 / stiffness_m)
}

fn problem(experiment: &Experiment, effects: &[&str]) -> Result<Problem> {
    let effects = effects.iter().map(|slug| slug.to_string()).collect();
    Problem::new(
        experiment.clone(),
        ModelSpecification { effects, ..ModelSpecification::default() },
        None,
        &SilentMonitor,
    )
}

fn counted(number: usize, seed: u64, apparatus: &Apparatus) -> Result<Value> {
    let mut stream = RandomStream::new(seed, number as u64);
    let hidden = Hidden::draw(number, &mut stream)?;
    let measured: Vec<Option<f64>> =
        hidden.position_m()?.iter().map(|x| Some(x + hidden.noise_m * stream.normal())).collect();
    let experiment = hidden.protocol.experiment("large", apparatus.clone(), &measured, Some(hidden.noise_m));
    let subject = Subject::new(&problem(&experiment, &[])?, &Library::default(), None, &SilentMonitor)?;
    let diagnosis = diagnose(&subject, &DiagnosisRequest::default(), &SilentMonitor)?.diagnosis;
    let entry = diagnosis.candidates.iter().find(|candidate| candidate.effect == "large-displacement");
    let refit = entry.and_then(|entry| entry.refit.as_ref());
    let posterior = |effects: &[&str]| {
        let options = SamplerOptions::default();
        let request = SampleRequest { options, kept_surrogate: None, checkpoint: None, resume: false };
        run(&problem(&experiment, effects)?, &request, &SilentMonitor).map(|outcome| outcome.summary)
    };
    let parameters = |posterior: &PosteriorSummary| -> Vec<Value> {
        let truth = hidden.law.into_iter().chain([1.0]);
        let told = |(p, truth): (&ParameterSummary, f64)| json!({"name": p.name, "truth": truth, "mean": p.mean, "sd": p.sd, "q05": p.q05, "q95": p.q95});
        posterior.parameters.iter().zip(truth).map(told).collect()
    };
    let (linear, posterior) = (posterior(&[])?, posterior(&["large-displacement"])?);
    Ok(json!({
        "number": number, "protocol": hidden.protocol.name(), "radii": hidden.radii, "noise_um": 1e6 * hidden.noise_m, "law": hidden.law,
        "kind": diagnosis.verdict.kind, "effects": diagnosis.verdict.effects, "equivalent": diagnosis.verdict.equivalent, "sentence": diagnosis.verdict.sentence,
        "z": entry.map(|entry| entry.z), "why_not": entry.and_then(|entry| entry.refused.clone()),
        "gain_nats": refit.map(|refit| refit.gain_nats), "heldout_gain_nats": refit.and_then(|refit| refit.heldout_gain_nats),
        "rmse_heldout_um": refit.and_then(|refit| refit.rmse_heldout_um), "refit": refit.map(|refit| &refit.parameters),
        "converged": posterior.converged, "parameters": parameters(&posterior), "linear": parameters(&linear)[..hidden.law.len()],
    }))
}

fn main() -> Result<()> {
    let argument = |place: usize, default: u64| -> u64 {
        std::env::args().nth(place).and_then(|text| text.parse().ok()).unwrap_or(default)
    };
    let (count, first, seed) = (argument(1, 36), argument(2, 0), argument(3, 1));
    let (replica, _) = embedded()?;
    let records: Vec<Value> = (first..first + count)
        .into_par_iter()
        .map(|number| {
            let found = counted(number as usize, seed, &replica.apparatus);
            let found = found.unwrap_or_else(|error| json!({"number": number, "failure": error.to_string()}));
            eprintln!("{found}");
            found
        })
        .collect();
    println!("{:#}", json!({ "records": records }));
    Ok(())
}
