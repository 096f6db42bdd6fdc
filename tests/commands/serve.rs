//! Models over HTTP: the protocol's answers against closed forms in this file and against the library.

use crate::{http, program};

use std::io::{BufRead, BufReader, Read};
use std::net::SocketAddr;
use std::path::Path;
use std::process::{Child, ChildStdout, Command, Stdio};
use std::time::Duration;

use serde_json::{Value, json};
use vitreo_uq::models::model::{Compliance, Forward};
use vitreo_uq::posterior::advice::check_warning;
use vitreo_uq::posterior::monitor::SilentMonitor;
use vitreo_uq::posterior::prepared::PreparedModel;
use vitreo_uq::posterior::prior::PriorSet;
use vitreo_uq::posterior::problem::Problem;
use vitreo_uq::posterior::study::ModelSpecification;
use vitreo_uq::record::Experiment;

/// A server that ends with the test.
pub struct Server {
    child: Child,
    pub address: SocketAddr,
    /// Standard output of the server after its link.
    words: BufReader<ChildStdout>,
    place: tempfile::TempDir,
}

impl Drop for Server {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

impl Server {
    /// Starts a server in an empty directory, which `prepare` may fill. `arguments` come after `serve`.
    pub fn start(prepare: impl FnOnce(&Path), arguments: &[&str]) -> Self {
        let place = tempfile::tempdir().unwrap();
        prepare(place.path());
        let mut child = Command::new(env!("CARGO_BIN_EXE_vitreo-uq"))
            .arg("serve")
            .args(arguments)
            .args(["--port", "0"])
            .current_dir(place.path())
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        let mut words = BufReader::new(child.stdout.take().unwrap());
        let mut link = String::new();
        words.read_line(&mut link).unwrap();
        let address = link.trim().trim_start_matches("http://").parse().unwrap();
        Self { child, address, words, place }
    }

    /// Server of the instrument's experiment, whose trajectory is a closed form.
    fn of_instrument(arguments: &[&str]) -> Self {
        let prepare = |place: &Path| program::write_instrument_experiment(&place.join("gel"), true, 0.0);
        Self::start(prepare, &[&["gel"], arguments].concat())
    }

    fn ask(&self, path: &str, request: &Value) -> (u16, Value) {
        let method = if path == "Info" { "GET" } else { "POST" };
        let body = request.to_string();
        let patience = Duration::from_secs(60);
        let (status, answer) = http::ask(self.address, method, &format!("/{path}"), "", body.as_bytes(), patience);
        (status, serde_json::from_str(&answer).unwrap_or_else(|error| panic!("{path} {request}: {error} in {answer}")))
    }

    #[track_caller]
    fn answers(&self, path: &str, request: Value) -> Value {
        let (status, answer) = self.ask(path, &request);
        assert_eq!(status, 200, "{request}: {answer}");
        answer
    }

    /// The output vector at a point.
    #[track_caller]
    fn evaluate(&self, name: &str, point: &[f64], config: Value) -> Vec<f64> {
        let answer = self.answers("Evaluate", json!({ "name": name, "input": [point], "config": config }));
        numbers(&answer["output"][0])
    }

    #[track_caller]
    fn gradient(&self, name: &str, point: &[f64], sens: &[f64]) -> Vec<f64> {
        let request = json!({ "name": name, "input": [point], "outWrt": 0, "inWrt": 0, "sens": sens, "config": {} });
        numbers(&self.answers("Gradient", request)["output"])
    }

    #[track_caller]
    fn apply_jacobian(&self, name: &str, point: &[f64], vec: &[f64]) -> Vec<f64> {
        let request = json!({ "name": name, "input": [point], "outWrt": 0, "inWrt": 0, "vec": vec });
        numbers(&self.answers("ApplyJacobian", request)["output"])
    }

    #[track_caller]
    fn refuses(&self, path: &str, request: Value, kind: &str, words: &str) {
        let (status, answer) = self.ask(path, &request);
        let error = &answer["error"];
        assert_eq!((status, error["type"].as_str()), (400, Some(kind)), "{request}: {answer}");
        assert!(error["message"].as_str().unwrap().contains(words), "`{words}` is missing in {answer}");
    }
}

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().unwrap_or_else(|| panic!("{value}")).iter().map(|x| x.as_f64().unwrap()).collect()
}

/// Positions (µm) of the instrument's experiment of tests/program by the Lethersich law's closed form.
fn closed_form_um([young_pa, viscosity_1_pa_s, viscosity_2_pa_s]: [f64; 3]) -> Vec<f64> {
    let (compliance_per_m, step_s, force_n) = (549.0, 0.04, 1e-6);
    let creep = |time_s: f64| {
        if time_s <= 0.0 {
            return 0.0;
        }
        (1.0 - f64::exp(-time_s * young_pa / viscosity_1_pa_s)) / young_pa + time_s / viscosity_2_pa_s
    };
    // +F, then −F after 50 rows, and so on: a step of F and three of ∓2F.
    let steps = [(0.0, 1.0), (2.0, -2.0), (4.0, 2.0), (6.0, -2.0)];
    let position_um = |row: i32| {
        let time_s = step_s * f64::from(row);
        let sum: f64 = steps.iter().map(|(start_s, size)| size * creep(time_s - start_s)).sum();
        1e6 * compliance_per_m * force_n * sum
    };
    (0..200).map(position_um).collect()
}

const POINT: [f64; 4] = [3.3, 1.5, 44.0, 0.7];

/// Asserts that numbers differ by at most the fraction `part` of the largest expected number.
fn close(values: &[f64], expected: &[f64], part: f64) {
    assert_eq!(values.len(), expected.len());
    let largest = expected.iter().fold(0.0_f64, |largest, x| largest.max(x.abs()));
    for (index, (a, b)) in values.iter().zip(expected).enumerate() {
        assert!((a - b).abs() <= part * largest, "{index}: {a} {b} of {largest}");
    }
}

#[test]
fn the_trajectory_is_the_closed_form_and_its_derivatives_are_differences() {
    let server = Server::of_instrument(&["--quiet"]);
    assert_eq!(
        server.answers("Info", json!({})),
        json!({ "protocolVersion": 1.0, "models": ["trajectory", "posterior"] })
    );
    for (name, sizes) in [("trajectory", [3, 200]), ("posterior", [4, 1])] {
        let value = json!({ "name": name });
        assert_eq!(server.answers("InputSizes", value.clone()), json!({ "inputSizes": [sizes[0]] }));
        assert_eq!(server.answers("OutputSizes", value.clone()), json!({ "outputSizes": [sizes[1]] }));
        let support = json!({ "Evaluate": true, "Gradient": true, "ApplyJacobian": true, "ApplyHessian": false });
        assert_eq!(server.answers("ModelInfo", value), json!({ "support": support }));
    }
    let law = [POINT[0], POINT[1], POINT[2]];
    let position_um = server.evaluate("trajectory", &law, Value::Null);
    close(&position_um, &closed_form_um(law), 1e-11);
    assert_eq!(position_um, server.evaluate("trajectory", &law, json!({ "model": "reduced" })));
    // Comparison with differences of the closed form.
    let direction = [0.3, -0.2, 5.0];
    let moved = |step: f64| closed_form_um(std::array::from_fn(|d| law[d] + step * direction[d]));
    let pairs = moved(1e-5).into_iter().zip(moved(-1e-5));
    let difference: Vec<f64> = pairs.map(|(up, down)| (up - down) / 2e-5).collect();
    let along = server.apply_jacobian("trajectory", &law, &direction);
    close(&along, &difference, 1e-8);
    // Σ sens · (J v) = (Σ sens · J) · v.
    let sens: Vec<f64> = (0..200).map(|row| f64::from(row).cos()).collect();
    let gradient = server.gradient("trajectory", &law, &sens);
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let (left, right) = (dot(&sens, &along), dot(&gradient, &direction));
    assert!((left / right - 1.0).abs() < 1e-11, "{left} {right}");
}

/// Compares with ln(prior × likelihood) written out: normal errors around the closed form on the first cycle's rows, and the prior's densities over the
/// untransformed parameters.
#[test]
fn the_posterior_is_the_formula_and_its_gradient_a_difference() {
    let server = Server::of_instrument(&["--quiet"]);
    let csv = std::fs::read_to_string(server.place.path().join("gel/trajectory.csv")).unwrap();
    let observed_um: Vec<f64> =
        csv.lines().skip(1).take(100).map(|line| line.split(',').nth(2).unwrap().parse().unwrap()).collect();
    let priors = PriorSet::named("porcine").unwrap();
    let expected = |point: [f64; 4]| {
        let [young, viscosity_1, viscosity_2, sd_um] = point;
        let predicted = closed_form_um([young, viscosity_1, viscosity_2]);
        // Density of positions in m, as in the documents.
        let normal = |(y, x): (&f64, &f64)| {
            -0.5 * ((y - x) / sd_um).powi(2) - (1e-6 * sd_um * (2.0 * std::f64::consts::PI).sqrt()).ln()
        };
        let likelihood: f64 = observed_um.iter().zip(&predicted).map(normal).sum();
        let prior: f64 = priors.priors().iter().zip(point).map(|(prior, x)| prior.distribution.ln_pdf(x)).sum();
        likelihood + prior
    };
    let log_density = server.evaluate("posterior", &POINT, Value::Null)[0];
    assert!((log_density / expected(POINT) - 1.0).abs() < 1e-9, "{log_density} {}", expected(POINT));
    let slope = |d: usize| {
        let at = |step: f64| {
            let mut moved = POINT;
            moved[d] *= 1.0 + step;
            expected(moved)
        };
        (at(1e-5) - at(-1e-5)) / (2e-5 * POINT[d])
    };
    let gradient = server.gradient("posterior", &POINT, &[2.0]);
    for (d, value) in gradient.iter().enumerate() {
        assert!((value - 2.0 * slope(d)).abs() < 1e-5 * (1.0 + value.abs()), "{d}: {value} {}", 2.0 * slope(d));
    }
    let direction = [0.1, 0.2, -3.0, 0.05];
    let along: f64 = gradient.iter().zip(direction).map(|(value, v)| 0.5 * value * v).sum();
    let number = server.apply_jacobian("posterior", &POINT, &direction)[0];
    assert!((number / along - 1.0).abs() < 1e-12, "{number} {along}");
    // Several points in one request, one of them outside the support: each has the value that it has alone.
    let points = [[3.3, 1.5, 44.0, 0.7], [3.3, 1.5, -44.0, 0.7], [2.0, 1.0, 70.0, 5.0]];
    let config = json!({ "points": 3 });
    let sizes = json!({ "name": "posterior", "config": config });
    assert_eq!(server.answers("InputSizes", sizes.clone()), json!({ "inputSizes": [12] }));
    assert_eq!(server.answers("OutputSizes", sizes), json!({ "outputSizes": [3] }));
    let many = server.evaluate("posterior", points.as_flattened(), config);
    let alone: Vec<f64> = points.iter().map(|point| server.evaluate("posterior", point, json!({}))[0]).collect();
    assert_eq!(many, alone);
    assert_eq!(many[1], f64::MIN);
    assert_eq!(server.gradient("posterior", &points[1], &[1.0]), [0.0; 4]);
}

#[test]
fn fixed_parameters_are_no_inputs_and_other_noise_has_its_own() {
    let server = Server::of_instrument(&["--quiet", "--set", "viscosity_1_pa_s=1.5", "--noise", "white,ou"]);
    let value = json!({ "name": "trajectory" });
    assert_eq!(server.answers("InputSizes", value), json!({ "inputSizes": [2] }));
    let position_um = server.evaluate("trajectory", &[3.3, 44.0], Value::Null);
    close(&position_um, &closed_form_um([3.3, 1.5, 44.0]), 1e-11);
    let point = [3.3, 44.0, 0.7, 0.4, 0.5];
    let gradient = server.gradient("posterior", &point, &[1.0]);
    for (d, value) in gradient.iter().enumerate() {
        let at = |step: f64| {
            let mut moved = point;
            moved[d] *= 1.0 + step;
            server.evaluate("posterior", &moved, Value::Null)[0]
        };
        let difference = (at(1e-5) - at(-1e-5)) / (2e-5 * point[d]);
        assert!((value - difference).abs() < 1e-4 * (1.0 + value.abs()), "{d}: {value} {difference}");
    }
}

#[test]
fn what_is_wrong_is_refused_by_the_protocols_objects() {
    let server = Server::of_instrument(&["--quiet"]);
    let law = [3.3, 1.5, 44.0];
    let at = |input: Value| json!({ "name": "trajectory", "input": input });
    for path in ["ModelInfo", "InputSizes", "OutputSizes", "Evaluate", "Gradient", "ApplyJacobian", "ApplyHessian"] {
        server.refuses(path, json!({ "name": "trajectories" }), "ModelNotFound", "trajectory, posterior");
    }
    server.refuses("ApplyHessian", json!({ "name": "posterior" }), "UnsupportedFeature", "second derivatives");
    server.refuses("Evaluate", at(json!([POINT])), "InvalidInput", "4 numbers, but the model takes 3");
    server.refuses("Evaluate", at(json!([law, law])), "InvalidInput", "2 vectors");
    server.refuses("Evaluate", at(json!([[-3.3, 1.5, 44.0]])), "InvalidInput", "young_modulus_pa = -3.3 Pa");
    let gradient = |out: i32, sens: &[f64]| json!({ "name": "trajectory", "input": [law], "outWrt": out, "inWrt": 0, "sens": sens });
    server.refuses("Gradient", gradient(1, &[0.0; 200]), "InvalidInput", "`outWrt` is 1");
    server.refuses("Gradient", gradient(0, &[0.0; 199]), "InvalidInput", "199 numbers");
    let config = |name: &str, config: Value| json!({ "name": name, "input": [law], "config": config });
    server.refuses("Evaluate", config("trajectory", json!({ "model": "ful" })), "InvalidInput", "`reduced` or `full`");
    server.refuses("Evaluate", config("trajectory", json!({ "model": "full" })), "InvalidInput", "no full model");
    server.refuses("InputSizes", config("posterior", json!({ "points": 0 })), "InvalidInput", "`points` is 0");
    server.refuses("InputSizes", config("posterior", json!({ "point": 2 })), "InvalidInput", "`points`");
    // Malformed requests, and requests from another site's page.
    let patience = Duration::from_secs(10);
    let ask = |headers: &str, body: &[u8]| http::ask(server.address, "POST", "/Evaluate", headers, body, patience);
    assert_eq!(ask("", b"{").0, 400);
    assert_eq!(ask("Host: evil.example\r\n", b"{}").0, 403);
    // One byte more than 10,000 points and the record's rows take.
    assert_eq!(ask("", &vec![b' '; (1 << 16) + 32 * (200 + 4 + 10_000 * 5) + 1]).0, 413);
    assert_eq!(server.evaluate("trajectory", &law, Value::Null).len(), 200);
}

/// Interleaved requests of several clients get the same answers as sequential ones.
#[test]
fn answers_do_not_depend_on_their_order() {
    let server = Server::of_instrument(&["--quiet", "--threads", "2"]);
    let point = |k: usize| [2.0 + 0.01 * k as f64, 1.5, 44.0, 0.7];
    let one_by_one: Vec<f64> = (0..24).map(|k| server.evaluate("posterior", &point(k), Value::Null)[0]).collect();
    let server = &server;
    let at_once: Vec<Vec<f64>> = std::thread::scope(|scope| {
        let client = |first: usize| {
            let function = move |k: usize| (k * 5 + first) % 24;
            scope.spawn(move || {
                let mut answers = vec![0.0; 24];
                for k in (0..24).map(function) {
                    answers[k] = server.evaluate("posterior", &point(k), Value::Null)[0];
                }
                answers
            })
        };
        let clients: Vec<_> = (0..6).map(client).collect();
        clients.into_iter().map(|client| client.join().unwrap()).collect()
    });
    assert!(at_once.iter().all(|values| *values == one_by_one));
}

/// The replica by full finite elements and the reduced model, over HTTP. The reduced positions equal the library's bit by bit, and differ from the full ones by
/// at most the stated error. The output gives names and units. The test takes ten seconds, mostly for meshing twice.
#[test]
fn full_and_reduced_agree_within_what_the_reduced_model_states() {
    let mut server = Server::start(|_| {}, &[]);
    let point = [3.527, 1.402, 47.37];
    let reduced_um = server.evaluate("trajectory", &point, Value::Null);
    let full_um = server.evaluate("trajectory", &point, json!({ "model": "full" }));
    server.refuses(
        "Gradient",
        json!({ "name": "trajectory", "input": [point], "outWrt": 0, "inWrt": 0, "sens": vec![0.0; 800], "config": { "model": "full" } }),
        "UnsupportedFeature",
        "no derivatives",
    );
    let outside = json!({ "name": "trajectory", "input": [[1e7, 1.402, 47.37]] });
    server.refuses("Evaluate", outside, "InvalidInput", "outside the surrogate's trained range");
    let replica = Path::new(env!("CARGO_MANIFEST_DIR")).join("data/porcine-replica");
    let (experiment, _) = Experiment::read(&replica).unwrap();
    let observed_um: Vec<f64> = experiment.record.position_m.iter().map(|y| 1e6 * y.unwrap()).collect();
    let problem = Problem::new(experiment, ModelSpecification::default(), None, &SilentMonitor).unwrap();
    let prepared = PreparedModel::new(&problem, None, &SilentMonitor).unwrap();
    let own_m = prepared.forward().trajectory_m(&point).unwrap();
    assert_eq!(reduced_um, own_m.iter().map(|x| 1e6 * x).collect::<Vec<f64>>());
    let amplitude = full_um.iter().fold(0.0_f64, |a, x| a.max(x.abs()));
    let stated = prepared.max_relative_error.unwrap().max(1e-12);
    // The stated error is measured at the start, so a wrong reduced model is detected in spite of its own statement.
    let check = prepared.verify_now(&SilentMonitor).unwrap().unwrap();
    assert!(check.n_runs == 2 && check.relative_error <= stated && check_warning(&check).is_none(), "{check:?}");
    let compliance = Compliance::fixed(0.5 * prepared.compliance.experiment_per_m());
    let wrong =
        PreparedModel::given(&prepared.problem, compliance, Vec::new()).verify_now(&SilentMonitor).unwrap().unwrap();
    assert!((wrong.relative_error - 0.5).abs() < 1e-6, "{wrong:?}");
    let warning = check_warning(&wrong).unwrap();
    assert!(
        warning.text.contains("50 % of the amplitude") && warning.advice.contains("models are kept in"),
        "{warning:?}"
    );
    assert!(reduced_um.iter().zip(&full_um).all(|(r, f)| (r - f).abs() <= stated * amplitude), "{stated}");
    // Independent physics: the data come from another mesh and integrator, with 4 µm of noise.
    let squares: f64 = full_um.iter().zip(&observed_um).map(|(x, y)| (x - y).powi(2)).sum();
    let rmse_um = (squares / 800.0).sqrt();
    assert!((3.6..4.4).contains(&rmse_um), "{rmse_um}");
    let _ = server.child.kill();
    let mut words = String::new();
    server.words.read_to_string(&mut words).unwrap();
    for part in ["porcine-replica: Lethersich", "young_modulus_pa", "Pa s", "noise_sd_um", "800 positions in um", "−∞"]
        .into_iter()
        .chain(["measured at 2 points of the prior"])
    {
        assert!(words.contains(part), "`{part}` is missing in {words}");
    }
}

#[test]
fn a_port_that_is_taken_and_a_study_without_free_parameters_are_refused() {
    let place = tempfile::tempdir().unwrap();
    program::write_instrument_experiment(&place.path().join("gel"), true, 0.0);
    let taken = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let port = taken.local_addr().unwrap().port().to_string();
    program::vitreo(place.path(), &["serve", "gel", "--port", &port]).refuses(&["--port", &port, "--port 0"]);
    let set = |name: &str| format!("{name}=1");
    let names = ["young_modulus_pa", "viscosity_1_pa_s", "viscosity_2_pa_s", "noise_sd_um"].map(set);
    let mut arguments = vec!["serve", "gel", "--port", "0"];
    names.iter().for_each(|name| arguments.extend(["--set", name]));
    program::vitreo(place.path(), &arguments).refuses(&["--set", "every parameter is fixed"]);
    assert_eq!(program::tree(place.path()).len(), 2, "nothing is written");
}
