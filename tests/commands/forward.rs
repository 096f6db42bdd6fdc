//! Somebody else's model in place of ours: a server of UM-Bridge that is written here, whose physics shares no code with the library's.

use crate::program;

use std::io::{Read, Write};
use std::net::{TcpListener, TcpStream};
use std::path::Path;
use std::process::Command;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

use program::{Run, normals};
use serde_json::{Value, json};

/// E in Pa, c₁ and c₂ in Pa·s of the records.
const TRUTH: [f64; 3] = [3.5, 1.4, 47.0];
const COMPLIANCE_PER_M: f64 = 549.0;
const NOISE_UM: f64 = 0.5;
/// Hidden force over the largest commanded one.
const BIAS: f64 = 0.08;

/// Positions (µm) of a spring beside a dashpot, before a dashpot, by the classical Runge–Kutta method; the force holds between times.
fn positions_um([modulus, beside, before]: [f64; 3], time_s: &[f64], force_n: &[f64]) -> Vec<f64> {
    let slope = |strain: f64, force: f64| (force - modulus * strain) / beside;
    let (mut strain, mut flow) = (0.0, 0.0);
    let mut positions = Vec::new();
    for (row, now) in time_s.iter().enumerate() {
        positions.push(1e6 * COMPLIANCE_PER_M * (strain + flow));
        let Some(next) = time_s.get(row + 1) else { break };
        let (force, whole) = (force_n[row], next - now);
        let n = (whole / (0.1 * beside / modulus)).ceil().max(1.0);
        let h = whole / n;
        for _ in 0..n as usize {
            let k1 = slope(strain, force);
            let k2 = slope(strain + 0.5 * h * k1, force);
            let k3 = slope(strain + 0.5 * h * k2, force);
            let k4 = slope(strain + h * k3, force);
            strain += h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4);
        }
        flow += force * whole / before;
    }
    positions
}

/// A server of one model; it stops listening when it is dropped.
struct Server {
    url: String,
    calls: Arc<AtomicUsize>,
    ends: Arc<AtomicBool>,
    thread: Option<std::thread::JoinHandle<()>>,
}

impl Server {
    /// `hears` the forces that it is told, or takes those of the first call always.
    fn start(hears: bool) -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let url = format!("http://{}", listener.local_addr().unwrap());
        let (calls, ends) = (Arc::new(AtomicUsize::new(0)), Arc::new(AtomicBool::new(false)));
        let (counted, ended) = (calls.clone(), ends.clone());
        let thread = std::thread::spawn(move || {
            for stream in listener.incoming() {
                if ended.load(Ordering::SeqCst) {
                    break;
                }
                answer(stream.unwrap(), &counted, hears);
            }
        });
        Self { url, calls, ends, thread: Some(thread) }
    }

    fn n_calls(&self) -> usize {
        self.calls.load(Ordering::SeqCst)
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        self.ends.store(true, Ordering::SeqCst);
        let _ = TcpStream::connect(self.url.trim_start_matches("http://"));
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

fn answer(mut stream: TcpStream, calls: &AtomicUsize, hears: bool) {
    let (mut received, mut buffer) = (Vec::new(), [0; 65536]);
    let (path, body) = loop {
        let n = stream.read(&mut buffer).unwrap();
        if n == 0 {
            return;
        }
        received.extend_from_slice(&buffer[..n]);
        let text = String::from_utf8(received.clone()).unwrap();
        let Some((head, body)) = text.split_once("\r\n\r\n") else { continue };
        let length = head.lines().find_map(|line| line.strip_prefix("Content-Length: ")?.parse::<usize>().ok());
        if body.len() >= length.unwrap_or(0) {
            break (head.split(' ').nth(1).unwrap().to_string(), body.to_string());
        }
    };
    let request: Value = serde_json::from_str(&body).unwrap_or_default();
    let numbers =
        |value: &Value| -> Vec<f64> { value.as_array().unwrap().iter().map(|x| x.as_f64().unwrap()).collect() };
    let said = match path.as_str() {
        "/Info" => json!({ "protocolVersion": 1.0, "models": ["forward"] }),
        "/InputSizes" => json!({ "inputSizes": [3] }),
        "/OutputSizes" => json!({ "outputSizes": [request["config"]["time_s"].as_array().unwrap().len()] }),
        "/Evaluate" => {
            calls.fetch_add(1, Ordering::SeqCst);
            assert_eq!(
                request["config"]["parameters"],
                json!(["young_modulus_pa", "viscosity_1_pa_s", "viscosity_2_pa_s"])
            );
            let point: [f64; 3] = numbers(&request["input"][0]).try_into().unwrap();
            let (time_s, mut force_n) = (numbers(&request["config"]["time_s"]), numbers(&request["config"]["force_n"]));
            if !hears {
                force_n = time_s.iter().map(|at_s| command_n(*at_s)).collect();
            }
            json!({ "output": [positions_um(point, &time_s, &force_n)] })
        }
        other => panic!("{other} was asked"),
    };
    let body = said.to_string();
    let head = format!("HTTP/1.1 200 OK\r\nContent-Type: application/json\r\nContent-Length: {}\r\n\r\n", body.len());
    stream.write_all((head + &body).as_bytes()).unwrap();
}

/// Two cycles of ±1 µN for 2 s each.
fn command_n(at_s: f64) -> f64 {
    if (((at_s + 1e-9) / 2.0) as u32).is_multiple_of(2) { 1e-6 } else { -1e-6 }
}

/// The record of [`TRUTH`] by the server's own physics, with noise, and a force that nobody knows of.
fn write_experiment(dir: &Path, bias: f64) {
    std::fs::create_dir_all(dir).unwrap();
    let toml = format!(
        "[specimen]\nid = \"gel\"\n[instrument]\ncompliance_per_m = {COMPLIANCE_PER_M}\n[measurement]\nfile = \"trajectory.csv\"\ncalibration_cycles = [1, 2]\nheldout_cycles = [3]\nnoise_um = {NOISE_UM}\nsource = \"synthetic\"\n"
    );
    std::fs::write(dir.join("experiment.toml"), toml).unwrap();
    let time_s: Vec<f64> = (0..300).map(|row| 0.04 * f64::from(row)).collect();
    let acting_n: Vec<f64> = time_s.iter().map(|at_s| command_n(*at_s) + bias * 1e-6).collect();
    let mut normal = normals();
    let mut csv = String::from("time_s,force_uN,position_um,cycle\n");
    for (row, exact_um) in positions_um(TRUTH, &time_s, &acting_n).iter().enumerate() {
        let force_un = 1e6 * command_n(time_s[row]);
        csv += &format!("{:.2},{force_un},{:.4},{}\n", time_s[row], exact_um + NOISE_UM * normal(), 1 + row / 100);
    }
    std::fs::write(dir.join("trajectory.csv"), csv).unwrap();
}

/// The law's parameters as both ways take them: the base's file, and a prior's.
fn write_priors(dir: &Path) {
    let mut base = String::from("[base.forward]\nmodel = \"forward\"\n");
    let mut prior = String::from(
        "[noise_sd_um]\ndistribution = \"log_normal\"\nmedian = 0.5\nlog_sd = 0.5\nunit = \"um\"\nsource = \"chosen\"\n",
    );
    for (name, unit, median) in
        [("young_modulus_pa", "Pa", 3.2), ("viscosity_1_pa_s", "Pa s", 1.6), ("viscosity_2_pa_s", "Pa s", 43.0)]
    {
        let numbers = format!("distribution = \"log_normal\", median = {median}, log_sd = 0.25");
        base += &format!("[base.forward.parameters.{name}]\nunit = \"{unit}\"\nprior = {{ {numbers} }}\n");
        let lines = numbers.replace(", ", "\n");
        prior += &format!("[{name}]\n{lines}\nunit = \"{unit}\"\nsource = \"as declared\"\n");
    }
    std::fs::write(dir.join("outside.toml"), base).unwrap();
    std::fs::write(dir.join("prior.toml"), prior).unwrap();
}

/// Runs the program with a cache of its own.
fn vitreo(dir: &Path, arguments: &[&str]) -> Run {
    let output = Command::new(env!("CARGO_BIN_EXE_vitreo-uq"))
        .current_dir(dir)
        .args(arguments)
        .env("VITREO_UQ_CACHE", dir.join("cache"))
        .output()
        .unwrap();
    let text = |bytes: Vec<u8>| String::from_utf8(bytes).unwrap();
    Run { code: output.status.code().unwrap_or(-1), stdout: text(output.stdout), stderr: text(output.stderr) }
}

/// Mean and standard deviation of a parameter.
fn found(document: &Value, name: &str) -> [f64; 2] {
    let all = document["parameters"].as_array().unwrap();
    let own = all.iter().find(|own| own["name"] == name).unwrap();
    ["mean", "sd"].map(|key| own[key].as_f64().unwrap())
}

/// Posteriors by the program's own law and by the server's, of one record: means agree to a tenth of a standard deviation (Monte-Carlo errors of some hundredths on both sides), and so do spreads. A second
/// run, and a fit, need no server; without the cache the same fit says what to do.
#[test]
fn a_posterior_is_that_of_the_same_physics_and_needs_no_server_twice() {
    let place = tempfile::tempdir().unwrap();
    let dir = place.path();
    write_experiment(&dir.join("gel"), 0.0);
    write_priors(dir);
    let own = vitreo(dir, &["sample", "gel", "--prior", "prior.toml", "--out", "own", "--json", "-", "--quiet"])
        .exits(0)
        .json();
    let server = Server::start(true);
    let url = server.url.clone();
    let model = ["--base", "outside.toml", "--forward", &url, "--prior", "prior.toml"];
    let sample =
        |out: &str| vitreo(dir, &[&["sample", "gel"][..], &model, &["--out", out, "--json", "-", "--quiet"]].concat());
    let outside = sample("outside").exits(0).json();
    for name in ["young_modulus_pa", "viscosity_1_pa_s", "viscosity_2_pa_s", "noise_sd_um"] {
        let ([mean, sd], [own_mean, own_sd]) = (found(&outside, name), found(&own, name));
        assert!((mean - own_mean).abs() < 0.1 * own_sd, "{name}: {mean} ± {sd}, {own_mean} ± {own_sd}");
        assert!((sd / own_sd - 1.0).abs() < 0.1, "{name}: {mean} ± {sd}, {own_mean} ± {own_sd}");
    }
    // The server itself was asked at draws: a tenth of the noise is what learning may miss.
    let apart_um = outside["heldout"]["surrogate_vs_fe_max_um"].as_f64().unwrap();
    assert!(apart_um > 0.0 && apart_um < 0.1 * NOISE_UM, "{apart_um}");
    assert_eq!(outside["heldout"]["fe_runs"], 16);
    let n_calls = server.n_calls();
    assert!((50..2000).contains(&n_calls), "{n_calls}");
    drop(server);
    let again = sample("again").exits(0).json();
    assert_eq!(again["parameters"], outside["parameters"]);
    assert_eq!(again["heldout"], outside["heldout"]);
    // The study knows where the model was, and what it takes in which order.
    let model = std::fs::read_to_string(dir.join("outside/m0/model.toml")).unwrap();
    let places =
        ["url = ", "parameters.young", "parameters.viscosity_1", "parameters.viscosity_2"].map(|word| model.find(word));
    assert!(places.is_sorted() && places[0].is_some(), "{model}");
    vitreo(dir, &["fit", "outside", "--quiet"]).exits(0);
    std::fs::remove_dir_all(dir.join("cache")).unwrap();
    let lost = vitreo(dir, &["fit", "outside", "--quiet"]).exits(1);
    assert!(lost.stderr.contains("cannot be reached") && lost.stderr.contains("--forward"), "{lost}");
}

/// A hidden force is named beside somebody else's law; of effects that would need its equations every one is listed with the reason.
#[test]
fn a_hidden_load_is_named_beside_somebody_elses_law() {
    let place = tempfile::tempdir().unwrap();
    let dir = place.path();
    write_experiment(&dir.join("gel"), BIAS);
    write_priors(dir);
    let server = Server::start(true);
    let common = ["gel", "--base", "outside.toml", "--forward", &server.url, "--quiet", "--json", "-"];
    let document = vitreo(dir, &[&["diagnose"][..], &common, &["--simulations", "99"]].concat()).exits(0).json();
    let verdict = &document["verdict"];
    assert_eq!(verdict["kind"], "missing", "{verdict}");
    assert!(verdict["effects"].to_string().contains("force-bias"), "{verdict}");
    let text = document.to_string();
    assert!(text.contains("somebody else's"), "{text}");
}

/// A server that is deaf to forces: load effects are refused with the reason, others are not.
#[test]
fn a_server_that_ignores_the_force_has_no_load_effects() {
    let place = tempfile::tempdir().unwrap();
    let dir = place.path();
    write_experiment(&dir.join("gel"), 0.0);
    write_priors(dir);
    let server = Server::start(false);
    let fit = |effect: &str| {
        vitreo(
            dir,
            &[
                "fit",
                "gel",
                "--base",
                "outside.toml",
                "--forward",
                &server.url,
                "--with",
                effect,
                "--out",
                effect,
                "--quiet",
            ],
        )
    };
    fit("tracking-drift").exits(0);
    fit("force-bias").refuses(&["same answer for two different forces", "leave this effect of the load out"]);
    fit("second-retardation").refuses(&["the law is somebody else's", "leave it out"]);
}

/// What stands wrongly in the file or on the command line is refused before anybody is asked.
#[test]
fn mistakes_are_refused_with_their_remedy() {
    let place = tempfile::tempdir().unwrap();
    let dir = place.path();
    write_experiment(&dir.join("gel"), 0.0);
    write_priors(dir);
    vitreo(dir, &["fit", "gel", "--forward", "http://127.0.0.1:9"])
        .refuses(&["`--forward`", "[base.forward.parameters"]);
    let with = |url: &str| vitreo(dir, &["fit", "gel", "--base", "outside.toml", "--forward", url]);
    with("https://gel.org").refuses(&["plain HTTP", "http://127.0.0.1:4242"]);
    with("gel.org").refuses(&["does not begin with `http://`"]);
    vitreo(dir, &["fit", "gel", "--base", "outside.toml"])
        .refuses(&["where somebody else's model answers", "--forward"]);
    let text = std::fs::read_to_string(dir.join("outside.toml")).unwrap();
    for (old, new, words) in [
        ("unit = \"Pa\"\n", "", &["line 3", "unit = \"N/m\""][..]),
        ("young_modulus_pa]", "Young]", &["`Young` cannot be the name", "lower-case"]),
        ("young_modulus_pa]", "noise_sd_um]", &["a parameter of the noise"]),
        ("model = \"forward\"", "modell = \"forward\"", &["did you mean `model`"]),
        ("unit = \"Pa\"\n", "unit = \"Pa\"\nsupport = [1.0, 9.0]\n", &["the prior reaches"]),
    ] {
        std::fs::write(dir.join("wrong.toml"), text.replacen(old, new, 1)).unwrap();
        vitreo(dir, &["fit", "gel", "--base", "wrong.toml"]).refuses(words);
    }
}
