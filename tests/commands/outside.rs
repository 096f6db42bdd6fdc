//! Another program's model in place of the base law: a server in this file, whose physics shares no code with the program's.

use crate::program;

use std::io::{BufRead, BufReader, Read, Write};
use std::net::{TcpListener, TcpStream};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::{Duration, Instant};

use program::{Run, normals, tree};
use serde_json::{Value, json};

const COMPLIANCE_PER_M: f64 = 549.0;
/// True parameters: E (Pa), c₁ and c₂ (Pa s).
const LAW: [f64; 3] = [3.5, 1.4, 47.0];
const NOISE_UM: f64 = 0.5;
/// Time limit above every test's duration.
const PATIENCE: Duration = Duration::from_secs(120);
/// Longest step of the server's integrator, in s.
const STEP_S: f64 = 0.004;

/// Positions in µm of a Kelvin–Voigt body and a dashpot by the Runge–Kutta method, under a force (N) that holds between times (s).
fn stepped_um([young, viscosity_1, viscosity_2]: [f64; 3], time_s: &[f64], force_n: &[f64]) -> Vec<f64> {
    let rate = |x: [f64; 2], force_n: f64| {
        let pull = COMPLIANCE_PER_M * force_n;
        [(pull - young * x[0]) / viscosity_1, pull / viscosity_2]
    };
    let along = |x: [f64; 2], k: [f64; 2], step: f64| [x[0] + step * k[0], x[1] + step * k[1]];
    let mut x = [0.0; 2];
    let mut position_um = vec![0.0];
    for row in 1..time_s.len() {
        let n = ((time_s[row] - time_s[row - 1]) / STEP_S).ceil().max(1.0);
        let step = (time_s[row] - time_s[row - 1]) / n;
        for _ in 0..n as usize {
            let force_n = force_n[row - 1];
            let k1 = rate(x, force_n);
            let k2 = rate(along(x, k1, 0.5 * step), force_n);
            let k3 = rate(along(x, k2, 0.5 * step), force_n);
            let k4 = rate(along(x, k3, step), force_n);
            for d in 0..2 {
                x[d] += step / 6.0 * (k1[d] + 2.0 * k2[d] + 2.0 * k3[d] + k4[d]);
            }
        }
        position_um.push(1e6 * (x[0] + x[1]));
    }
    position_um
}

/// Runs the program with a cache beside the experiment, because answers of a past server are useless to others.
fn vitreo(dir: &Path, arguments: &[&str]) -> Run {
    let cache = dir.join("cache");
    program::run(
        Command::new(env!("CARGO_BIN_EXE_vitreo-uq")).current_dir(dir).args(arguments).env("VITREO_UQ_CACHE", cache),
    )
}

/// Deviation of a server from docs/serve.md.
#[derive(Clone, Copy, PartialEq)]
enum Kind {
    Sound,
    /// Takes forces as the second input vector.
    TakesForce,
    /// Returns one position too few.
    Short,
    /// Returns NaN if E is above 3.9 Pa, as at its prior's median.
    Broken,
    /// Uses the record's own force for every request.
    Deaf,
    /// Never answers.
    Silent,
}

struct Server {
    url: String,
    n_evaluations: Arc<AtomicUsize>,
}

impl Server {
    /// Starts a server that runs until the test's process ends.
    fn start(kind: Kind) -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let url = format!("http://{}", listener.local_addr().unwrap());
        let n_evaluations = Arc::new(AtomicUsize::new(0));
        let counted = n_evaluations.clone();
        std::thread::spawn(move || {
            for stream in listener.incoming().flatten() {
                let counted = counted.clone();
                std::thread::spawn(move || answer(stream, kind, &counted));
            }
        });
        Self { url, n_evaluations }
    }

    fn n_evaluations(&self) -> usize {
        self.n_evaluations.load(Ordering::SeqCst)
    }
}

fn answer(mut stream: TcpStream, kind: Kind, counted: &AtomicUsize) -> Option<()> {
    let mut reader = BufReader::new(stream.try_clone().ok()?);
    let (mut first, mut length) = (String::new(), 0);
    reader.read_line(&mut first).ok()?;
    loop {
        let mut line = String::new();
        reader.read_line(&mut line).ok()?;
        if line.trim().is_empty() {
            break;
        }
        if let Some(value) = line.to_lowercase().strip_prefix("content-length:") {
            length = value.trim().parse().ok()?;
        }
    }
    let mut body = vec![0; length];
    reader.read_exact(&mut body).ok()?;
    let request: Value = serde_json::from_slice(&body).unwrap_or(Value::Null);
    let path = first.split(' ').nth(1)?;
    let text = match path {
        "/Info" => json!({ "protocolVersion": 1.0, "models": ["forward"] }).to_string(),
        "/ModelInfo" => json!({ "support": { "Evaluate": true, "Gradient": false } }).to_string(),
        "/InputSizes" if kind == Kind::TakesForce => json!({ "inputSizes": [3, n_times(&request)] }).to_string(),
        "/InputSizes" => json!({ "inputSizes": [3] }).to_string(),
        "/OutputSizes" => json!({ "outputSizes": [n_times(&request)] }).to_string(),
        _ => {
            counted.fetch_add(1, Ordering::SeqCst);
            if kind == Kind::Silent {
                std::thread::sleep(PATIENCE);
            }
            evaluated(&request, kind)
        }
    };
    let head = format!("HTTP/1.1 200 OK\r\nContent-Length: {}\r\n\r\n", text.len());
    stream.write_all(&[head.as_bytes(), text.as_bytes()].concat()).ok()
}

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().map_or(Vec::new(), |list| list.iter().filter_map(Value::as_f64).collect())
}

fn n_times(request: &Value) -> usize {
    numbers(&request["config"]["time_s"]).len()
}

fn evaluated(request: &Value, kind: Kind) -> String {
    let (config, input) = (&request["config"], &request["input"]);
    assert_eq!(config["parameters"], json!(["young_modulus_pa", "viscosity_1_pa_s", "viscosity_2_pa_s"]));
    let law = numbers(&input[0]);
    let time_s = numbers(&config["time_s"]);
    let force_n = match kind {
        Kind::TakesForce => numbers(&input[1]),
        Kind::Deaf => time_s.iter().map(|t| commanded_n(*t)).collect(),
        _ => numbers(&config["force_n"]),
    };
    let mut position_um = stepped_um([law[0], law[1], law[2]], &time_s, &force_n);
    if kind == Kind::Short {
        position_um.pop();
    }
    if kind == Kind::Broken && law[0] > 3.9 {
        return "{\"output\": [[NaN]]}".into();
    }
    json!({ "output": [position_um] }).to_string()
}

/// Two cycles of ±1 µN for 2 s each.
fn commanded_n(time_s: f64) -> f64 {
    if ((time_s + 1e-9) / 2.0).floor() as i64 % 2 == 0 { 1e-6 } else { -1e-6 }
}

/// Writes an experiment that is simulated by the server's physics, and a prior that names the law's parameters. The force lags by `lag_s`, which the
/// description does not state.
fn lagging(dir: &Path, lag_s: f64) -> PathBuf {
    let experiment = dir.join("gel");
    std::fs::create_dir_all(&experiment).unwrap();
    std::fs::write(
        experiment.join("experiment.toml"),
        format!(
            "[specimen]\nid = \"gel\"\n[instrument]\ncompliance_per_m = {COMPLIANCE_PER_M}\n[measurement]\nfile = \"trajectory.csv\"\ncalibration_cycles = [1]\nheldout_cycles = [2]\nnoise_um = {NOISE_UM}\nsource = \"synthetic: Runge and Kutta\"\n"
        ),
    )
    .unwrap();
    // The acting force is computed at 40 times per row, so it may be constant between these times.
    let (n_between, step_s) = (40, 0.04);
    let fine_s: Vec<f64> = (0..200 * n_between).map(|k| step_s * k as f64 / n_between as f64).collect();
    let mut acting_n = Vec::new();
    let mut lagged_n = 0.0;
    for t in &fine_s {
        let command_n = commanded_n(*t);
        let next_n = if lag_s > 0.0 {
            command_n + (lagged_n - command_n) * f64::exp(-step_s / n_between as f64 / lag_s)
        } else {
            command_n
        };
        acting_n.push(if lag_s > 0.0 { 0.5 * (lagged_n + next_n) } else { command_n });
        lagged_n = next_n;
    }
    let position_um = stepped_um(LAW, &fine_s, &acting_n);
    let mut normal = normals();
    let mut csv = String::from("time_s,force_uN,position_um,cycle\n");
    for row in 0..200 {
        let (t, x) = (step_s * row as f64, position_um[row * n_between] + NOISE_UM * normal());
        csv += &format!("{t:.2},{},{x:.4},{}\n", 1e6 * commanded_n(t), 1 + row / 100);
    }
    std::fs::write(experiment.join("trajectory.csv"), csv).unwrap();
    let priors = prior_toml("young_modulus_pa", 4.0, 0.7, "Pa")
        + &prior_toml("viscosity_1_pa_s", 1.2, 0.7, "Pa s")
        + &prior_toml("viscosity_2_pa_s", 40.0, 0.7, "Pa s")
        + &prior_toml("noise_sd_um", 0.5, 0.5, "um");
    std::fs::write(dir.join("prior.toml"), priors).unwrap();
    experiment
}

fn prior_toml(name: &str, median: f64, log_sd: f64, unit: &str) -> String {
    format!(
        "[{name}]\ndistribution = \"log_normal\"\nmedian = {median}\nlog_sd = {log_sd}\nunit = \"{unit}\"\nsource = \"chosen\"\n"
    )
}

/// Mean and standard deviation of a parameter.
fn moments(document: &Value, name: &str) -> (f64, f64) {
    let parameters = document["parameters"].as_array().unwrap_or_else(|| panic!("{document}"));
    let value = parameters.iter().find(|p| p["name"] == name).unwrap_or_else(|| panic!("no {name} in {document}"));
    (value["mean"].as_f64().unwrap(), value["sd"].as_f64().unwrap())
}

/// An external model with the built-in law's equations has the built-in law's posterior, checked by its own answers. A second run repeats no request, and the
/// number of threads does not matter.
#[test]
fn an_outside_model_is_sampled_as_our_own() {
    let dir = tempfile::tempdir().unwrap();
    lagging(dir.path(), 0.0);
    for kind in [Kind::Sound, Kind::TakesForce] {
        let server = Server::start(kind);
        let sample = |out: &str, more: &[&str]| {
            let arguments = ["sample", "gel", "--prior", "prior.toml", "--out", out, "--json", "-", "--quiet"];
            vitreo(dir.path(), &[&arguments[..], more].concat()).exits(0).json()
        };
        let outside = sample("outside", &["--forward", &server.url]);
        let (heldout, n) = (&outside["heldout"], server.n_evaluations());
        assert!(n < 500, "{n} evaluations");
        assert_eq!(heldout["fe_runs"], 128, "{heldout}");
        // A fraction of the noise of half a micrometre.
        let distance_um = heldout["surrogate_vs_fe_max_um"].as_f64().unwrap();
        assert!(distance_um > 0.0 && distance_um < 0.05 * NOISE_UM, "{distance_um}");
        let value = sample("own", &[]);
        for name in ["young_modulus_pa", "viscosity_1_pa_s", "viscosity_2_pa_s", "noise_sd_um"] {
            let ((mean, sd), (own_mean, own_sd)) = (moments(&outside, name), moments(&value, name));
            assert!((mean - own_mean).abs() < 0.15 * own_sd, "{name}: {mean} {own_mean} ± {own_sd}");
            assert!((sd / own_sd - 1.0).abs() < 0.15, "{name}: {sd} {own_sd}");
        }
        let first = tree(&dir.path().join("outside"));
        sample("outside", &["--forward", &server.url, "--threads", "1"]);
        assert_eq!(server.n_evaluations(), n + 1, "all but the answer by which the model is known is kept");
        let same = |name: &str| tree(&dir.path().join("outside")).get(Path::new(name)) == first.get(Path::new(name));
        assert!(same("m0/draws.csv") && same("m0/model.toml"));
        for study in ["outside", "own"] {
            std::fs::remove_dir_all(dir.path().join(study)).unwrap();
        }
    }
}

/// A hidden lag is found by calling the server with other forces. If the server ignores them, effects of load are left out with the reason.
#[test]
fn a_hidden_lag_is_diagnosed_with_an_outside_model() {
    let dir = tempfile::tempdir().unwrap();
    lagging(dir.path(), 0.1);
    let diagnosed = |server: &Server, out: &str| {
        let arguments = ["diagnose", "gel", "--prior", "prior.toml", "--forward", &server.url, "--out", out];
        vitreo(dir.path(), &[&arguments[..], &["--json", "-", "--quiet", "--simulations", "99"]].concat())
            .exits(0)
            .json()
    };
    let refusal = |document: &Value, slug: &str| {
        let candidates = document["candidates"].as_array().unwrap().iter();
        let value =
            candidates.clone().find(|value| value["effect"] == slug).unwrap_or_else(|| panic!("{slug} in {document}"));
        value["refused"].as_str().map(String::from)
    };
    let document = diagnosed(&Server::start(Kind::Sound), "study");
    let verdict = &document["verdict"];
    assert_eq!((&verdict["kind"], &verdict["effects"]), (&json!("missing"), &json!(["actuator-lag"])), "{verdict}");
    let parameters = document["candidates"].as_array().unwrap().iter().find(|value| value["effect"] == "actuator-lag");
    let lag_s = parameters.unwrap()["refit"]["parameters"]
        .as_array()
        .unwrap()
        .iter()
        .find(|p| p["name"] == "actuator-lag.time_s");
    let lag_s = lag_s.unwrap()["mean"].as_f64().unwrap();
    assert!((lag_s - 0.1).abs() < 0.01, "{lag_s}");
    assert_eq!(refusal(&document, "actuator-lag"), None);
    for slug in ["second-retardation", "strain-stiffening", "softening", "compressibility"] {
        assert!(refusal(&document, slug).is_some_and(|why| why.contains("the other program computes")), "{slug}");
    }
    let server = Server::start(Kind::Sound);
    let arguments = ["learn", "gel", "--prior", "prior.toml", "--forward", &server.url, "--out", "learnt"];
    let learnt = vitreo(dir.path(), &[&arguments[..], &["--json", "-", "--quiet"]].concat()).exits(0).json();
    let sentence = learnt["verdict"]["sentence"].as_str().unwrap();
    assert!(sentence.contains("another program computes the law") && sentence.contains("diagnose"), "{sentence}");
    let deaf = diagnosed(&Server::start(Kind::Deaf), "deaf");
    assert_ne!(deaf["verdict"]["effects"], json!(["actuator-lag"]));
    assert!(refusal(&deaf, "actuator-lag").is_some_and(|why| why.contains("ignores the forces")), "{deaf}");
    assert_eq!(refusal(&deaf, "tracking-drift"), None);
}

#[test]
fn servers_that_do_not_do_are_refused_in_words() {
    let dir = tempfile::tempdir().unwrap();
    lagging(dir.path(), 0.0);
    let fit = |url: &str, more: &[&str]| {
        let arguments = ["fit", "gel", "--prior", "prior.toml", "--forward", url, "--out", "study"];
        vitreo(dir.path(), &[&arguments[..], more].concat())
    };
    let fails = |url: &str, words: &[&str]| {
        let run = fit(url, &[]);
        assert!(run.code != 0 && run.stdout.is_empty(), "{run}");
        for word in [words, &["what to do:"]].concat() {
            assert!(run.stderr.contains(word), "`{word}` is missing in {run}");
        }
        assert!(!dir.path().join("study").exists(), "something was written");
    };
    let gone = TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap();
    fails(&format!("http://{gone}"), &["cannot be reached", "start the server"]);
    fails(&Server::start(Kind::Short).url, &["199 positions, but the request has 200 times"]);
    fails(&Server::start(Kind::Broken).url, &["NaN among its positions", "young_modulus_pa ="]);
    fails("https://127.0.0.1:1", &["encrypted", "tunnel"]);
    let server = Server::start(Kind::Sound);
    let refused = fit(&server.url, &["--forward-model", "gel"]);
    assert!(refused.stderr.contains("no model `gel`") && refused.stderr.contains("it has forward"), "{refused}");
    fit(&server.url, &["--with", "softening"]).refuses(&["softening", "which the other program computes"]);
    fit(&server.url, &["--base", "burgers"]).exits(2);
    // One parameter fewer than the model takes.
    let fewer = prior_toml("young_modulus_pa", 4.0, 0.7, "Pa") + &prior_toml("noise_sd_um", 0.5, 0.5, "um");
    std::fs::write(dir.path().join("fewer.toml"), fewer).unwrap();
    let refused = vitreo(dir.path(), &["fit", "gel", "--prior", "fewer.toml", "--forward", &server.url]);
    for words in ["inputs of sizes [3]", "names 1 parameters (young_modulus_pa)", "in the model's order"] {
        assert!(refused.code != 0 && refused.stderr.contains(words), "`{words}` is missing in {refused}");
    }
}

/// Ctrl-C ends a program that waits for an answer within a second. The rest of the limit is for a busy machine.
#[cfg(unix)]
#[test]
fn waiting_for_a_server_can_be_interrupted() {
    let dir = tempfile::tempdir().unwrap();
    lagging(dir.path(), 0.0);
    let server = Server::start(Kind::Silent);
    let mut child = Command::new(env!("CARGO_BIN_EXE_vitreo-uq"))
        .args(["fit", "gel", "--prior", "prior.toml", "--forward", &server.url, "--quiet"])
        .current_dir(dir.path())
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    let began = Instant::now();
    while server.n_evaluations() == 0 {
        assert!(began.elapsed() < PATIENCE && child.try_wait().unwrap().is_none(), "the server was not asked");
        std::thread::sleep(Duration::from_millis(10));
    }
    assert!(Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap().success());
    let interrupted = Instant::now();
    let status = loop {
        match child.try_wait().unwrap() {
            Some(status) => break status,
            None if interrupted.elapsed() > PATIENCE => {
                let _ = child.kill();
                panic!("the program goes on");
            }
            None => std::thread::sleep(Duration::from_millis(10)),
        }
    };
    assert_eq!(status.code(), Some(130));
    assert!(interrupted.elapsed() < Duration::from_secs(1 + 4), "{:?}", interrupted.elapsed());
}
