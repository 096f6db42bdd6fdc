//! The workbench's server: who may ask, what is never read or written, and that nothing a client sends brings it down. The page itself is tested in a browser (tests/browser).

use std::io::{BufRead, BufReader, Write};
use std::net::{SocketAddr, TcpStream};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use crate::http;

use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// A workbench in a folder of its own, ended with the test.
struct Bench {
    child: Child,
    address: SocketAddr,
    token: String,
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
    fn start() -> Self {
        let outside = tempfile::tempdir().unwrap();
        let home = outside.path().join("home");
        std::fs::create_dir(&home).unwrap();
        std::fs::write(outside.path().join("secret.json"), "{\"secret\": 1}").unwrap();
        let mut child = Command::new(env!("CARGO_BIN_EXE_vitreo-uq"))
            .args(["workbench", "--port", "0", "--quiet"])
            .current_dir(&home)
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let mut link = String::new();
        BufReader::new(child.stdout.take().unwrap()).read_line(&mut link).unwrap();
        let (address, token) = link.trim().trim_start_matches("http://").split_once('/').unwrap();
        let (address, token) = (address.parse().unwrap(), token.trim_end_matches('/').to_string());
        Self { child, address, token, _outside: outside, home }
    }

    fn send(&self, bytes: &[u8], patience: Duration) -> Vec<u8> {
        http::send(self.address, bytes, patience)
    }

    /// Status and body of a request with headers of the page's own, or others.
    fn ask(&self, method: &str, path: &str, headers: &str, body: &[u8]) -> (u16, String) {
        http::ask(self.address, method, path, headers, body, Duration::from_secs(5))
    }

    fn get(&self, path: &str) -> (u16, String) {
        self.ask("GET", &format!("/{}/{path}", self.token), "", b"")
    }

    fn lives(&self) {
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
    let own = format!("/{}/", bench.token);
    assert_eq!(bench.ask("GET", &own, "", b"").0, 200);
    assert!(bench.get("app.js").1.contains("workbench"));
    for path in ["/", "/api/items", "/0123456789abcdef0123456789abcdef/", &own[..own.len() - 2]] {
        assert_eq!(bench.ask("GET", path, "", b"").0, 404, "{path}");
    }
    // A name of another site that leads here, and a script of another site.
    for headers in [
        "Host: evil.example\r\n".to_string(),
        format!("Host: evil.example:{}\r\n", bench.address.port()),
        format!("Host: {}\r\nOrigin: http://evil.example\r\n", bench.address),
        format!("Host: {}\r\nOrigin: null\r\n", bench.address),
    ] {
        assert_eq!(bench.ask("GET", &own, &headers, b"").0, 403, "{headers}");
        assert_eq!(bench.ask("DELETE", &format!("{own}api/job"), &headers, b"").0, 403, "{headers}");
    }
    let origin = format!("Origin: http://{}\r\n", bench.address);
    assert_eq!(bench.ask("GET", &own, &origin, b"").0, 200);
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
    let before = files(bench.home.parent().unwrap());
    for name in
        ["../x.csv", "..%2fx.csv", "%2e%2e%2fx.csv", ".hidden.csv", "a%00b.csv", "", "x%5cy.csv", &"x".repeat(300)]
    {
        let (status, body) =
            bench.ask("POST", &format!("/{}/api/table?name={name}", bench.token), "", b"t,f,x\n0,1,2\n");
        assert_eq!(status, 422, "{name}: {body}");
    }
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
    // More connections than are served at once, none of which says what it wants: each is closed in its turn, and a page is answered in the end.
    let began = Instant::now();
    let idle: Vec<TcpStream> = (0..80)
        .map(|_| {
            let mut stream = TcpStream::connect(bench.address).unwrap();
            stream.write_all(b"GET / HTTP/1.1\r\nHost: ").unwrap();
            stream
        })
        .collect();
    let is_answered = || bench.get("api/items").0 == 200;
    while !is_answered() {
        assert!(began.elapsed() < Duration::from_secs(60), "idle connections keep the page out");
    }
    drop(idle);
    bench.lives();
}

/// 10,000 requests that are nearly right: parts of good ones changed, cut and put together at random (seed 8421).
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
        // One in 200 promises more than it sends.
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
