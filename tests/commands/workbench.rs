//! Server of the workbench: access, protected files, and resistance to any client input. Browser tests cover the page itself (tests/browser).

use std::io::{BufRead, BufReader};
use std::net::SocketAddr;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use crate::http;

use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde_json::{Value, json};

use crate::program::write_instrument_experiment;

/// A workbench in its own folder that ends with the test.
pub struct Bench {
    child: Child,
    pub address: SocketAddr,
    pub token: String,
    _outside: tempfile::TempDir,
    home: std::path::PathBuf,
}

impl Drop for Bench {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

impl Bench {
    pub fn start() -> Self {
        let outside = tempfile::tempdir().unwrap();
        std::fs::create_dir(outside.path().join("home")).unwrap();
        Self::start_in(outside)
    }

    /// Starts in the folder `home` of a directory that has a secret beside it.
    fn start_in(outside: tempfile::TempDir) -> Self {
        let home = outside.path().join("home");
        std::fs::write(outside.path().join("secret.json"), "{\"secret\": 1}").unwrap();
        let (child, address, token) = Self::begin(&home);
        Self { child, address, token, _outside: outside, home }
    }

    /// Starts another workbench of the same folder after this one has ended.
    fn restart(&mut self) {
        (self.child, self.address, self.token) = Self::begin(&self.home);
    }

    fn begin(home: &Path) -> (Child, SocketAddr, String) {
        let mut child = Command::new(env!("CARGO_BIN_EXE_vitreo-uq"))
            .args(["workbench", "--port", "0", "--quiet"])
            .current_dir(home)
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let mut link = String::new();
        BufReader::new(child.stdout.take().unwrap()).read_line(&mut link).unwrap();
        let (address, token) = link.trim().trim_start_matches("http://").split_once('/').unwrap();
        let (address, token) = (address.parse().unwrap(), token.trim_end_matches('/').to_string());
        (child, address, token)
    }

    fn send(&self, bytes: &[u8], patience: Duration) -> Vec<u8> {
        http::send(self.address, bytes, patience)
    }

    /// Status and body of a request with the given headers.
    fn ask(&self, method: &str, path: &str, headers: &str, body: &[u8]) -> (u16, String) {
        http::ask(self.address, method, path, headers, body, Duration::from_secs(5))
    }

    fn get(&self, path: &str) -> (u16, String) {
        self.ask("GET", &format!("/{}/{path}", self.token), "", b"")
    }

    fn post(&self, path: &str, document: &Value) -> (u16, Value) {
        let headers = "Content-Type: application/json\r\n";
        let patience = Duration::from_secs(60);
        let path = format!("/{}/{path}", self.token);
        let (status, body) = http::ask(self.address, "POST", &path, headers, document.to_string().as_bytes(), patience);
        (status, serde_json::from_str(&body).unwrap_or_else(|_| panic!("{status} {body}")))
    }

    /// The job as stored on disk; `None` before the first job.
    fn job(&self) -> Option<Value> {
        let bytes = std::fs::read(self.home.join(".vitreo-uq-workbench/job.json")).ok()?;
        serde_json::from_slice(&bytes).ok()
    }

    /// Runs a requested job to its end.
    #[track_caller]
    fn does(&self, wish: &Value) {
        let (status, answer) = self.post("api/job", wish);
        assert_eq!(status, 200, "{answer}");
        let began = Instant::now();
        loop {
            let job = self.job().filter(|job| job["began_s"] == answer["began_s"] && job["kind"] == wish["kind"]);
            match job.as_ref().and_then(|job| job["standing"].as_str()) {
                Some("done") => return,
                Some("running") | None => {}
                Some(_) => panic!("{job:?}"),
            }
            assert!(began.elapsed() < Duration::from_secs(300), "{wish} does not end: {job:?}");
            std::thread::sleep(Duration::from_millis(20));
        }
    }

    pub fn lives(&self) {
        let (status, body) = self.get("api/items");
        assert_eq!(status, 200, "{body}");
    }
}

fn files(place: &Path) -> Vec<std::path::PathBuf> {
    let mut all = Vec::new();
    for entry in std::fs::read_dir(place).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            all.extend(files(&path));
        }
        all.push(path);
    }
    all.sort();
    all
}

#[test]
fn only_the_page_of_this_link_is_answered() {
    let bench = Bench::start();
    bench.lives();
    let label = format!("/{}/", bench.token);
    assert_eq!(bench.ask("GET", &label, "", b"").0, 200);
    assert!(bench.get("app.js").1.contains("workbench"));
    for path in ["/", "/api/items", "/0123456789abcdef0123456789abcdef/", &label[..label.len() - 2]] {
        assert_eq!(bench.ask("GET", path, "", b"").0, 404, "{path}");
    }
    // A host name of another site that leads here, and a script of another site.
    for headers in [
        "Host: evil.example\r\n".to_string(),
        format!("Host: evil.example:{}\r\n", bench.address.port()),
        format!("Host: {}\r\nOrigin: http://evil.example\r\n", bench.address),
        format!("Host: {}\r\nOrigin: null\r\n", bench.address),
    ] {
        assert_eq!(bench.ask("GET", &label, &headers, b"").0, 403, "{headers}");
        assert_eq!(bench.ask("DELETE", &format!("{label}api/job"), &headers, b"").0, 403, "{headers}");
    }
    let origin = format!("Origin: http://{}\r\n", bench.address);
    assert_eq!(bench.ask("GET", &label, &origin, b"").0, 200);
}

#[test]
fn nothing_outside_is_read_or_written() {
    let bench = Bench::start();
    let secret = bench.home.parent().unwrap().join("secret.json");
    for path in [
        "../secret.json",
        "%2e%2e/secret.json",
        "..%2fsecret.json",
        &secret.display().to_string(),
        "m0/../../secret.json",
    ] {
        for item in ["", ".", "..", "home", "../home"] {
            let (status, body) = bench.get(&format!("file?item={item}&path={path}"));
            assert!(status >= 400 && !body.contains("secret\": 1"), "{item} {path}: {status} {body}");
        }
    }
    // A table is stored in the workbench's own folder under a plain name, for any original name.
    for name in
        ["../x.csv", "..%2fx.csv", "%2e%2e%2fx.csv", ".hidden.csv", "a%00b.csv", "", "x%5cy.csv", &"x".repeat(300)]
    {
        let (status, body) =
            bench.ask("POST", &format!("/{}/api/table?name={name}", bench.token), "", b"t,f,x\n0,1,2\n");
        assert_eq!(status, 200, "{name}: {body}");
    }
    let before = files(bench.home.parent().unwrap());
    let entry = bench.home.join(".vitreo-uq-workbench");
    let is_plain = |path: &&std::path::PathBuf| {
        let name = path.file_name().unwrap().to_str().unwrap();
        name.starts_with(|c: char| c.is_alphanumeric()) && name.len() < 100
    };
    assert_eq!(before.iter().filter(|path| path.starts_with(&entry)).filter(is_plain).count(), 16, "{before:?}");
    let elsewhere = before.iter().filter(|path| !path.starts_with(&entry)).collect::<Vec<_>>();
    assert_eq!(elsewhere, [&bench.home, &secret]);
    let document = "Content-Type: application/json\r\n";
    for (upload, file) in
        [("upload-0", "../../secret.json"), ("../..", "secret.json"), ("upload-0/..", "x"), ("upload-99", "x.csv")]
    {
        let body = format!("{{\"upload\": \"{upload}\", \"file\": \"{file}\"}}");
        assert_eq!(
            bench.ask("POST", &format!("/{}/api/init", bench.token), document, body.as_bytes()).0,
            422,
            "{body}"
        );
    }
    for body in [
        "{\"item\": \"..\", \"kind\": \"sample\"}",
        "{\"item\": \"x\", \"kind\": \"rm\"}",
        "{\"item\": \"x\", \"kind\": \"extend\", \"with\": [\"--out\"]}",
    ] {
        assert_eq!(bench.ask("POST", &format!("/{}/api/job", bench.token), document, body.as_bytes()).0, 422, "{body}");
    }
    assert_eq!(files(bench.home.parent().unwrap()), before);
}

#[test]
fn what_is_too_large_or_too_slow_is_cut_off() {
    let bench = Bench::start();
    let document = "Content-Type: application/json\r\n";
    let large = format!("{{\"item\": \"{}\"}}", "x".repeat(1 << 17));
    let (status, _) = bench.ask("POST", &format!("/{}/api/try", bench.token), document, large.as_bytes());
    assert_eq!(status, 413);
    let long = format!("/{}/{}", bench.token, "x".repeat(1 << 16));
    assert!([414, 431].contains(&bench.ask("GET", &long, "", b"").0));
    bench.lives();
}

/// A signal to the workbench alone ends the command that it has started, and leaves nothing half-written.
#[cfg(unix)]
#[test]
fn a_signal_to_the_workbench_ends_its_job() {
    let mut bench = Bench::start();
    crate::program::write_instrument_experiment(&bench.home.join("gel"), true, 0.0);
    let wish = b"{\"item\": \"gel\", \"kind\": \"sample\"}";
    let path = format!("/{}/api/job", bench.token);
    let (status, answer) = bench.ask("POST", &path, "Content-Type: application/json\r\n", wish);
    assert_eq!(status, 200, "{answer}");
    let kept = bench.home.join(".vitreo-uq-workbench/job.json");
    let process = || -> Option<u64> {
        let job: serde_json::Value = serde_json::from_slice(&std::fs::read(&kept).ok()?).ok()?;
        job["process"]["number"].as_u64().filter(|process| *process > 0)
    };
    let began = Instant::now();
    let job = loop {
        assert!(began.elapsed() < Duration::from_secs(60), "no job has begun");
        if let Some(process) = process() {
            break process;
        }
        std::thread::sleep(Duration::from_millis(5));
    };
    let name = format!("/proc/{job}/cmdline");
    assert!(!std::fs::read(&name).unwrap().is_empty(), "the job is over before it could be stopped");
    let sent = Command::new("kill").args(["-TERM", &bench.child.id().to_string()]).status().unwrap();
    assert!(sent.success());
    assert_eq!(bench.child.wait().unwrap().code(), Some(143));
    // A process that nobody has waited for is listed without a command line.
    let is_gone = || std::fs::read(&name).map_or(true, |line| line.is_empty());
    let began = Instant::now();
    while !is_gone() {
        assert!(began.elapsed() < Duration::from_secs(5), "the job goes on");
        std::thread::sleep(Duration::from_millis(5));
    }
    let job: serde_json::Value = serde_json::from_slice(&std::fs::read(&kept).unwrap()).unwrap();
    assert_eq!((&job["standing"], &job["process"]["number"]), (&"stopped".into(), &0.into()), "{job}");
    let left = files(&bench.home);
    assert!(!left.iter().any(|path| path.to_string_lossy().contains(".partial-")), "{left:?}");
}

/// 10,000 requests that are nearly valid: parts of valid ones, randomly changed, cut and combined (seed 8421).
#[test]
fn no_request_brings_it_down() {
    let bench = Bench::start();
    let random = &mut ChaCha8Rng::seed_from_u64(8421);
    let before = files(bench.home.parent().unwrap());
    let paths =
        ["", "api/items", "api/study", "api/rows", "api/knobs", "api/try", "api/init", "api/job", "file", "app.js"];
    let words = [
        "item=x",
        "path=m0/posterior.json",
        "from_s=1",
        "to_s=NaN",
        "points=-1",
        "points=99999999999999999999",
        "revision=m0",
        "%",
        "%ff",
        "%00",
        "..",
        "/",
        "?",
        "&",
        "=",
        "\"",
        "{",
        "}",
        "[",
        "]",
        "null",
        "1e999",
        "{\"item\":\"x\"",
        ",\"kind\":\"sample\"",
        "\r\n",
        "眼",
        "\u{0}",
    ];
    let text = |random: &mut ChaCha8Rng| {
        (0..random.random_range(0..6)).map(|_| words[random.random_range(0..words.len())]).collect::<String>()
    };
    let mut n_answered = 0;
    for _ in 0..10_000 {
        let method = ["GET", "POST", "DELETE", "PUT", "HEAD", "OPTIONS", "X"][random.random_range(0..7)];
        let path = paths[random.random_range(0..paths.len())];
        let body = text(random);
        // One in 200 announces more bytes than it sends.
        let length =
            if random.random_range(0..200) == 0 { body.len() + 7 } else { random.random_range(0..=body.len()) };
        let kind = if random.random_range(0..2) == 0 { "Content-Type: application/json\r\n" } else { "" };
        let mut request = format!(
            "{method} /{}/{path}?{} HTTP/1.1\r\nHost: {}\r\n{kind}Connection: close\r\nContent-Length: {length}\r\n\r\n{body}",
            bench.token,
            text(random),
            bench.address
        )
        .into_bytes();
        if random.random_range(0..4) == 0 {
            let place = random.random_range(0..request.len());
            request[place] = (random.next_u32() & 0xff) as u8;
        }
        let answer = bench.send(&request, Duration::from_millis(100));
        n_answered += usize::from(answer.starts_with(b"HTTP/1.1 "));
        assert!(
            !answer.starts_with(b"HTTP/1.1 500"),
            "{}\n{}",
            String::from_utf8_lossy(&request),
            String::from_utf8_lossy(&answer)
        );
    }
    assert!(n_answered > 9_000, "{n_answered}");
    bench.lives();
    assert_eq!(files(bench.home.parent().unwrap()), before);
}

/// A name in the form of a query.
fn in_query(name: &str) -> String {
    name.bytes().map(|byte| format!("%{byte:02x}")).collect()
}

/// Tables whose names are options or paths, from the upload to the second revision: the results are the table's, and nothing else is written.
#[test]
#[ignore = "thorough"]
fn hostile_names_go_all_the_way() {
    let bench = Bench::start();
    write_instrument_experiment(&bench.home.parent().unwrap().join("gel"), true, 0.3);
    let gel = |name: &str| std::fs::read_to_string(bench.home.parent().unwrap().join("gel").join(name)).unwrap();
    let mut items = Vec::new();
    for name in ["--force.csv", "../$(touch pwned)\n\u{202e}--json=pwned.json.csv"] {
        let path = format!("/{}/api/table?name={}", bench.token, in_query(name));
        let (status, body) = bench.ask("POST", &path, "", gel("trajectory.csv").as_bytes());
        assert_eq!(status, 200, "{body}");
        let upload = serde_json::from_str::<Value>(&body).unwrap()["upload"].clone();
        let mut answers = serde_json::Map::new();
        let item = loop {
            let (status, answer) = bench.post("api/init", &json!({"upload": upload, "file": name, "answers": answers}));
            assert_eq!(status, 200, "{answer}");
            let Some(questions) = answer["questions"].as_array() else {
                break answer["item"].as_str().unwrap().to_string();
            };
            for question in questions {
                let answer = question["proposal"].as_str().or(question["choices"][0].as_str()).unwrap_or("1");
                assert!(
                    answers.insert(question["text"].as_str().unwrap().into(), answer.into()).is_none(),
                    "{question}"
                );
            }
        };
        items.push(item);
    }
    assert_eq!(items, ["force", "touch-pwned-----json-pwned.json"]);
    // A folder that was not made by the page.
    std::fs::create_dir(bench.home.join("--json=pwned.json")).unwrap();
    items.push("--json=pwned.json".into());
    for item in &items {
        // The table on an instrument, whose models are cheap.
        let id = format!("id = \"{}\"", item.replace("json=", "of-"));
        std::fs::write(
            bench.home.join(item).join("experiment.toml"),
            gel("experiment.toml").replace("id = \"gel\"", &id),
        )
        .unwrap();
        std::fs::write(bench.home.join(item).join("trajectory.csv"), gel("trajectory.csv")).unwrap();
        for wish in [
            json!({"item": item, "kind": "sample"}),
            json!({"item": item, "kind": "diagnose"}),
            json!({"item": item, "kind": "extend", "with": ["tracking-drift"]}),
        ] {
            bench.does(&wish);
        }
        let (status, study) = bench.get(&format!("api/study?item={}", in_query(item)));
        let study: Value = serde_json::from_str(&study).unwrap();
        assert_eq!(status, 200, "{study}");
        assert_eq!(study["revisions"].as_array().unwrap().len(), 2, "{study}");
        let inputs = bench.home.join(study["item"]["study"].as_str().unwrap()).join("inputs.sha256");
        assert!(std::fs::read_to_string(inputs).unwrap().contains("trajectory.csv"));
    }
    let mut names: Vec<_> = std::fs::read_dir(&bench.home).unwrap().map(|dir| dir.unwrap().file_name()).collect();
    names.sort();
    let mut expected = [&items[..], &[".vitreo-uq-workbench".into(), "vitreo-uq-out".into()]].concat();
    expected.sort();
    assert_eq!(names, expected.iter().map(std::ffi::OsString::from).collect::<Vec<_>>());
    let studies = bench.home.join("vitreo-uq-out");
    let studies: Vec<_> = std::fs::read_dir(studies).unwrap().map(|dir| dir.unwrap().file_name()).collect();
    assert!(
        studies.len() == 3 && studies.iter().all(|name| !name.to_string_lossy().starts_with(['-', '.'])),
        "{studies:?}"
    );
}

/// A received folder names a foreign process as its job and has links in place of the workbench's files. No process is ended, and no file is written outside.
#[cfg(target_os = "linux")]
#[test]
fn a_received_folder_ends_no_process_and_writes_no_file_elsewhere() {
    let outside = tempfile::tempdir().unwrap();
    let (home, path) = (outside.path().join("home"), outside.path().join("home/.vitreo-uq-workbench"));
    std::fs::create_dir_all(&path).unwrap();
    write_instrument_experiment(&home.join("gel"), true, 0.0);
    // A foreign process with this program's name in its command line.
    let foreign = outside.path().join("vitreo-uq-of-somebody");
    std::fs::copy("/bin/sleep", &foreign).unwrap();
    let mut foreign = Command::new(foreign).arg("60").spawn().unwrap();
    let stat = std::fs::read_to_string(format!("/proc/{}/stat", foreign.id())).unwrap();
    let started = stat.rsplit_once(')').unwrap().1.split_whitespace().nth(19).unwrap().to_string();
    let job = json!({
        "item": "gel", "kind": "sample", "commands": [["sample"]], "at": 0, "began_s": 1, "standing": "running", "words": "", "progress": null,
        "process": {"number": foreign.id(), "started": started, "token": "0123456789abcdef"}
    });
    std::fs::write(path.join("job.json"), job.to_string()).unwrap();
    let victim = outside.path().join("victim");
    std::fs::write(&victim, "kept").unwrap();
    for name in ["job.log", "job.out", "upload-0"] {
        std::os::unix::fs::symlink(&victim, path.join(name)).unwrap();
    }
    let bench = Bench::start_in(outside);
    let began = Instant::now();
    while bench.job().unwrap()["standing"] != "broken" {
        assert!(began.elapsed() < Duration::from_secs(20), "{:?}", bench.job());
        std::thread::sleep(Duration::from_millis(10));
    }
    assert_eq!(bench.ask("DELETE", &format!("/{}/api/job", bench.token), "", b"").0, 200);
    // Its own job is ended, although it is not in the terminal's process group.
    let (status, answer) = bench.post("api/job", &json!({"item": "gel", "kind": "sample"}));
    assert_eq!(status, 200, "{answer}");
    let running = || bench.job().filter(|job| job["process"]["number"].as_u64().is_some_and(|number| number > 0));
    while running().is_none() {
        assert!(began.elapsed() < Duration::from_secs(40), "{:?}", bench.job());
        std::thread::sleep(Duration::from_millis(2));
    }
    assert_eq!(bench.ask("DELETE", &format!("/{}/api/job", bench.token), "", b"").0, 200);
    while bench.job().unwrap()["standing"] == "running" {
        assert!(began.elapsed() < Duration::from_secs(60), "{:?}", bench.job());
        std::thread::sleep(Duration::from_millis(10));
    }
    assert_eq!(bench.job().unwrap()["standing"], "stopped");
    assert!(foreign.try_wait().unwrap().is_none(), "a foreign process was ended");
    assert_eq!(std::fs::read_to_string(&victim).unwrap(), "kept");
    let log = bench.home.join(".vitreo-uq-workbench/job.log");
    assert!(log.symlink_metadata().unwrap().is_file());
    foreign.kill().unwrap();
    foreign.wait().unwrap();
}

/// Ctrl-C ends the workbench and its job. A killed workbench leaves its job to the next one, which finds and stops it.
#[cfg(target_os = "linux")]
#[test]
fn a_job_ends_with_ctrl_c_and_is_found_after_a_kill() {
    let outside = tempfile::tempdir().unwrap();
    let gel = outside.path().join("home/gel");
    write_instrument_experiment(&gel, true, 0.0);
    // A long record, whose diagnosis takes minutes unless it is stopped.
    let (n_rows, step_s, mut retarded_un, mut impulse_un_s) = (100_000_u32, 0.04, 0.0, 0.0);
    let (decay, mut noise) = (f64::exp(-step_s * 3.5 / 1.4), crate::program::normals());
    let mut csv = "time_s,force_uN,position_um,cycle\n".to_string();
    for row in 0..n_rows {
        let force_un = if (row / 50).is_multiple_of(2) { 1.0 } else { -1.0 };
        let position_um = 549.0 * (retarded_un / 3.5 + impulse_un_s / 47.0) + 0.5 * noise();
        let (time_s, cycle) = (step_s * f64::from(row), 1 + row * 2 / n_rows);
        csv += &format!("{time_s:.2},{force_un},{position_um:.4},{cycle}\n");
        retarded_un = decay * retarded_un + (1.0 - decay) * force_un;
        impulse_un_s += step_s * force_un;
    }
    std::fs::write(gel.join("trajectory.csv"), csv).unwrap();
    let home = outside.path().join("home");
    crate::program::vitreo(&home, &["sample", "gel", "--no-report", "--quiet"]).exits(0);
    let mut bench = Bench::start_in(outside);
    // Process of a new job, which differs from that of the job before.
    let process = |bench: &Bench, before: u64| {
        let began = Instant::now();
        let mut answer = bench.post("api/job", &json!({"item": "gel", "kind": "diagnose"}));
        while answer.0 != 200 {
            assert!(began.elapsed() < Duration::from_secs(20), "{answer:?}");
            std::thread::sleep(Duration::from_millis(20));
            answer = bench.post("api/job", &json!({"item": "gel", "kind": "diagnose"}));
        }
        loop {
            let number = bench.job().and_then(|job| job["process"]["number"].as_u64()).unwrap_or(0);
            if number > 0 && number != before {
                return number;
            }
            assert!(began.elapsed() < Duration::from_secs(40));
            std::thread::sleep(Duration::from_millis(2));
        }
    };
    let is_gone = |process: u64| {
        let state = std::fs::read_to_string(format!("/proc/{process}/stat")).unwrap_or_default();
        state.rsplit_once(')').is_none_or(|(_, rest)| rest.trim_start().starts_with('Z'))
    };
    let wait_for_end = |process: u64| {
        let began = Instant::now();
        while !is_gone(process) {
            assert!(began.elapsed() < Duration::from_secs(20), "the job goes on");
            std::thread::sleep(Duration::from_millis(5));
        }
    };
    let first = process(&bench, 0);
    std::thread::sleep(Duration::from_millis(300));
    assert!(!is_gone(first), "the job does not run");
    let signal = |signal: &str, number: u32| {
        assert!(Command::new("kill").args([signal, &number.to_string()]).status().unwrap().success());
    };
    signal("-INT", bench.child.id());
    assert_eq!(bench.child.wait().unwrap().code(), Some(130));
    wait_for_end(first);
    bench.restart();
    let second = process(&bench, first);
    bench.child.kill().unwrap();
    bench.child.wait().unwrap();
    assert!(!is_gone(second), "the job has ended with its workbench");
    bench.restart();
    assert_eq!(bench.ask("DELETE", &format!("/{}/api/job", bench.token), "", b"").0, 200);
    wait_for_end(second);
}
