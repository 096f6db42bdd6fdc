//! Clients that send or read slowly, or not at all, do not delay other clients, however many there are.

use std::io::{ErrorKind, Read, Write};
use std::net::{SocketAddr, TcpStream};
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use crate::serve::Server;
use crate::workbench::Bench;
use crate::{http, program};

/// Time limit: one second, plus a margin for a busy test machine.
const SOON: Duration = Duration::from_secs(1 + 4);
/// Time between two bytes of a slow client.
const DRIP: Duration = Duration::from_millis(300);
/// Number of consecutive requests of a good client while the slow ones are connected.
const N_GOOD: usize = 8;

/// Behaviour of a slow client: bytes sent at once, the byte repeated afterwards, and the size of its receive buffer.
struct Slow {
    first: Vec<u8>,
    then: u8,
    receive_buffer: Option<u32>,
}

fn slow_head(address: SocketAddr) -> Slow {
    Slow { first: format!("GET / HTTP/1.1\r\nHost: {address}\r\nX: ").into_bytes(), then: b'x', receive_buffer: None }
}

fn slow_body(address: SocketAddr, path: &str) -> Slow {
    let head = format!(
        "POST {path} HTTP/1.1\r\nHost: {address}\r\nContent-Type: application/json\r\nContent-Length: 10000\r\n\r\n{{"
    );
    Slow { first: head.into_bytes(), then: b' ', receive_buffer: None }
}

/// Requests more data than the system buffers for a client that does not read.
fn never_reading(request: &str, n_requests: usize) -> Slow {
    Slow { first: request.repeat(n_requests).into_bytes(), then: b' ', receive_buffer: Some(4096) }
}

fn connect(address: SocketAddr, slow: &Slow) -> TcpStream {
    let stream = match slow.receive_buffer {
        None => TcpStream::connect(address).unwrap(),
        Some(bytes) => {
            let runtime = tokio::runtime::Builder::new_current_thread().enable_io().build().unwrap();
            runtime.block_on(async {
                let socket = tokio::net::TcpSocket::new_v4().unwrap();
                socket.set_recv_buffer_size(bytes).unwrap();
                socket.connect(address).await.unwrap().into_std().unwrap()
            })
        }
    };
    stream.set_nonblocking(true).unwrap();
    stream
}

/// Returns the longest wait of a good client while slow clients, connected before it, stay connected.
fn longest_wait(address: SocketAddr, crowd: &[Slow], good: &dyn Fn()) -> Duration {
    let is_over = &AtomicBool::new(false);
    let mut streams: Vec<(TcpStream, &Slow)> = crowd.iter().map(|slow| (connect(address, slow), slow)).collect();
    for (stream, slow) in &mut streams {
        // A server may already have closed the connection.
        let mut rest = &slow.first[..];
        while let Ok(n) = stream.write(rest) {
            rest = &rest[n..];
            if rest.is_empty() {
                break;
            }
        }
    }
    std::thread::scope(|scope| {
        let _over = EndsWithScope(is_over);
        scope.spawn(move || {
            while !is_over.load(Ordering::SeqCst) {
                std::thread::sleep(DRIP);
                streams.iter_mut().for_each(|(stream, slow)| drop(stream.write(&[slow.then])));
            }
        });
        let wait = |_| {
            let began = Instant::now();
            good();
            let took = began.elapsed();
            std::thread::sleep(DRIP);
            took
        };
        (0..N_GOOD).map(wait).max().unwrap()
    })
}

/// Ends the slow clients, also if the good client fails.
struct EndsWithScope<'a>(&'a AtomicBool);

impl Drop for EndsWithScope<'_> {
    fn drop(&mut self) {
        self.0.store(true, Ordering::SeqCst);
    }
}

/// An instrument's experiment with many rows, whose trajectory is a large answer.
fn long_experiment(dir: &Path) {
    program::write_instrument_experiment(dir, true, 0.0);
    let csv: String = (0..20_000)
        .map(|row| {
            format!("{:.2},{},{},{}\n", 0.04 * f64::from(row), 1 - 2 * (row / 50 % 2), row % 7, 1 + row / 10_000)
        })
        .collect();
    std::fs::write(dir.join("trajectory.csv"), "time_s,force_uN,position_um,cycle\n".to_string() + &csv).unwrap();
}

/// Five hundred slow clients at once on either server; those of the workbench hold its link. The good client's limit is a second.
#[test]
fn five_hundred_slow_clients_keep_nobody_waiting() {
    let server = Server::start(|place| long_experiment(&place.join("gel")), &["gel", "--quiet"]);
    let address = server.address;
    let body = "{\"name\": \"trajectory\", \"input\": [[3.3, 1.5, 44.0]]}";
    let evaluate =
        format!("POST /Evaluate HTTP/1.1\r\nHost: {address}\r\nContent-Length: {}\r\n\r\n{body}", body.len());
    let crowd: Vec<Slow> = (0..500)
        .map(|k| match k % 10 {
            0..=4 => slow_head(address),
            5..=8 => slow_body(address, "/Evaluate"),
            _ => never_reading(&evaluate, 12),
        })
        .collect();
    let asks = || {
        let (status, answer) = http::ask(address, "POST", "/Evaluate", "", body.as_bytes(), 10 * SOON);
        assert_eq!((status, answer.len() > 100_000), (200, true));
    };
    let longest = longest_wait(address, &crowd, &asks);
    assert!(longest < SOON, "serve: {longest:?}");
    println!("serve: {longest:?}");

    let bench = Bench::start();
    let (address, token) = (bench.address, &bench.token);
    let get = |path: &str| format!("GET /{token}/{path} HTTP/1.1\r\nHost: {address}\r\n\r\n");
    let (events, large) = (get("api/events"), get("uPlot.js"));
    let crowd: Vec<Slow> = (0..500)
        .map(|k| match k % 10 {
            0..=2 => slow_head(address),
            3..=4 => slow_body(address, &format!("/{token}/api/try")),
            5 => slow_body(address, &format!("/{token}/api/table?name=x.csv")),
            6..=8 => Slow { first: events.clone().into_bytes(), then: b' ', receive_buffer: None },
            _ => never_reading(&large, 80),
        })
        .collect();
    let asks = || {
        bench.lives();
        let mut page = TcpStream::connect(address).unwrap();
        page.set_read_timeout(Some(10 * SOON)).unwrap();
        page.write_all(events.as_bytes()).unwrap();
        let mut news = Vec::new();
        while !String::from_utf8_lossy(&news).contains("data: ") {
            let mut part = [0; 1024];
            let n = page.read(&mut part).unwrap();
            assert!(n > 0, "no news: {}", String::from_utf8_lossy(&news));
            news.extend_from_slice(&part[..n]);
        }
    };
    let longest = longest_wait(address, &crowd, &asks);
    assert!(longest < SOON, "workbench: {longest:?}");
    println!("workbench: {longest:?}");
}

/// The server ends every incomplete request and every unread answer, even without other clients waiting.
#[test]
#[ignore = "thorough"]
fn slow_requests_and_unread_answers_end() {
    let bench = Bench::start();
    let address = bench.address;
    let large = format!("GET /{}/uPlot.js HTTP/1.1\r\nHost: {address}\r\nConnection: close\r\n\r\n", bench.token);
    let pipelined = format!("GET /{}/uPlot.js HTTP/1.1\r\nHost: {address}\r\n\r\n", bench.token).repeat(100) + &large;
    let slow =
        [slow_head(address), slow_body(address, &format!("/{}/api/try", bench.token)), never_reading(&pipelined, 1)];
    let mut streams: Vec<(TcpStream, &Slow)> = slow.iter().map(|slow| (connect(address, slow), slow)).collect();
    streams.iter_mut().for_each(|(stream, slow)| assert_eq!(stream.write(&slow.first).unwrap(), slow.first.len()));
    let began = Instant::now();
    // A write to a closed connection fails, at the latest the second time.
    let is_open = |(stream, slow): &mut (TcpStream, &Slow)| {
        let written = stream.write(&[slow.then]);
        written.is_ok() || written.is_err_and(|error| error.kind() == ErrorKind::WouldBlock)
    };
    while !streams.is_empty() {
        assert!(began.elapsed() < Duration::from_secs(90), "{} of 3 are still open", streams.len());
        std::thread::sleep(Duration::from_secs(1));
        streams.retain_mut(is_open);
    }
    bench.lives();
}
