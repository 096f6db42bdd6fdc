//! One request of HTTP/1.1 over TCP, and its answer: no more than a model that is asked needs.

use std::io::{ErrorKind, Read, Write};
use std::net::{TcpStream, ToSocketAddrs};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// Time between two looks whether the job is to stop.
const LOOK: Duration = Duration::from_millis(100);
/// Time in which a host must take up a connection.
const CONNECTING: Duration = Duration::from_secs(5);
/// Longest answer, in bytes.
const LONGEST: usize = 1 << 28;

/// Where a model answers.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Address {
    /// Host with port, as in the header.
    host: String,
    /// What to connect to.
    endpoint: String,
    /// What stands before every path, without a slash at its end.
    base: String,
}

impl Address {
    /// Of a URL that begins with `http://`.
    pub fn of(url: &str) -> Self {
        let rest = url.strip_prefix("http://").unwrap_or(url);
        let (host, base) = rest.split_once('/').map_or((rest, ""), |(host, path)| (host, path));
        let has_port = host.rsplit_once(':').is_some_and(|(_, port)| port.parse::<u16>().is_ok());
        let endpoint = if has_port { host.to_string() } else { format!("{host}:80") };
        let base = base.trim_end_matches('/');
        let base = if base.is_empty() { String::new() } else { format!("/{base}") };
        Self { host: host.to_string(), endpoint, base }
    }
}

/// What came back.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Answer {
    /// Status.
    pub status: u16,
    /// Body as text.
    pub body: String,
}

/// Why nothing came back.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Failure {
    /// Nobody answers there.
    Unreachable(String),
    /// It has been asked for longer than it may take.
    TimeOut,
    /// What came is no answer of HTTP.
    NotHttp(String),
    /// The job is to stop.
    Stopped,
}

/// Asks: a body makes it a POST, none a GET.
pub(super) fn request(
    address: &Address,
    path: &str,
    body: Option<&str>,
    patience: Duration,
    stop: Option<&AtomicBool>,
) -> Result<Answer, Failure> {
    let began = Instant::now();
    let mut stream = connect(address)?;
    let lost = |error: std::io::Error| Failure::Unreachable(error.to_string());
    stream.set_read_timeout(Some(LOOK)).map_err(lost)?;
    stream.set_write_timeout(Some(patience)).map_err(lost)?;
    let _ = stream.set_nodelay(true);
    let method = if body.is_some() { "POST" } else { "GET" };
    let body = body.unwrap_or_default();
    let head = format!(
        "{method} {}{path} HTTP/1.1\r\nHost: {}\r\nContent-Type: application/json\r\nAccept: application/json\r\nContent-Length: {}\r\nConnection: close\r\n\r\n",
        address.base,
        address.host,
        body.len()
    );
    stream.write_all(head.as_bytes()).and_then(|()| stream.write_all(body.as_bytes())).map_err(lost)?;
    let (mut received, mut buffer) = (Vec::new(), vec![0_u8; 1 << 16]);
    loop {
        if stop.is_some_and(|stop| stop.load(Ordering::Relaxed)) {
            return Err(Failure::Stopped);
        }
        match stream.read(&mut buffer) {
            Ok(0) => {
                return parsed(&received, true)
                    .unwrap_or_else(|| Err(Failure::NotHttp("the answer ends early".into())));
            }
            Ok(n) => received.extend_from_slice(&buffer[..n]),
            Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => {
                if began.elapsed() > patience {
                    return Err(Failure::TimeOut);
                }
            }
            Err(error) if error.kind() == ErrorKind::Interrupted => {}
            Err(error) => return Err(lost(error)),
        }
        if received.len() > LONGEST {
            return Err(Failure::NotHttp("the answer is longer than any trajectory".into()));
        }
        if let Some(answer) = parsed(&received, false) {
            return answer;
        }
    }
}

fn connect(address: &Address) -> Result<TcpStream, Failure> {
    let addresses = address.endpoint.to_socket_addrs().map_err(|error| Failure::Unreachable(error.to_string()))?;
    let mut why = "the host has no address".to_string();
    for address in addresses {
        match TcpStream::connect_timeout(&address, CONNECTING) {
            Ok(stream) => return Ok(stream),
            Err(error) => why = error.to_string(),
        }
    }
    Err(Failure::Unreachable(why))
}

/// The answer, if all of it is there; `is_end` where no more will come.
fn parsed(received: &[u8], is_end: bool) -> Option<Result<Answer, Failure>> {
    let end_of_head = received.windows(4).position(|four| four == b"\r\n\r\n")?;
    let head = String::from_utf8_lossy(&received[..end_of_head]);
    let mut lines = head.split("\r\n");
    let status_line = lines.next().unwrap_or_default();
    let status = status_line.strip_prefix("HTTP/1.").and_then(|rest| rest.split(' ').nth(1)?.parse::<u16>().ok());
    let Some(status) = status else {
        return Some(Err(Failure::NotHttp(format!(
            "it begins with `{}`",
            status_line.chars().take(60).collect::<String>()
        ))));
    };
    let header = |name: &str| {
        head.split("\r\n").skip(1).find_map(|line| {
            let (key, value) = line.split_once(':')?;
            key.eq_ignore_ascii_case(name).then(|| value.trim().to_string())
        })
    };
    let rest = &received[end_of_head + 4..];
    let body = if header("transfer-encoding").is_some_and(|value| value.eq_ignore_ascii_case("chunked")) {
        unchunked(rest)?
    } else {
        match header("content-length").and_then(|value| value.parse::<usize>().ok()) {
            Some(length) => rest.get(..length)?.to_vec(),
            None if is_end => rest.to_vec(),
            None => return None,
        }
    };
    Some(Ok(Answer { status, body: String::from_utf8_lossy(&body).into_owned() }))
}

/// A body that came in chunks, if its last is there.
fn unchunked(mut rest: &[u8]) -> Option<Vec<u8>> {
    let mut body = Vec::new();
    loop {
        let end = rest.windows(2).position(|two| two == b"\r\n")?;
        let line = std::str::from_utf8(&rest[..end]).ok()?;
        let length = usize::from_str_radix(line.split(';').next()?.trim(), 16).ok()?;
        rest = &rest[end + 2..];
        if length == 0 {
            return Some(body);
        }
        body.extend_from_slice(rest.get(..length)?);
        rest = rest.get(length.checked_add(2)?..)?;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn answer(text: &str, is_end: bool) -> Option<Result<Answer, Failure>> {
        parsed(text.as_bytes(), is_end)
    }

    #[test]
    fn an_answer_is_read_when_it_is_whole() {
        let own = |body: &str| Some(Ok(Answer { status: 200, body: body.into() }));
        let head = "HTTP/1.1 200 OK\r\ncontent-length: 5\r\n\r\n";
        assert_eq!(answer(&head[..20], false), None);
        assert_eq!(answer(&format!("{head}1234"), false), None);
        assert_eq!(answer(&format!("{head}12345"), false), own("12345"));
        let chunked = "HTTP/1.1 200 OK\r\nTransfer-Encoding: chunked\r\n\r\n3\r\n123\r\n2;x\r\n45\r\n";
        assert_eq!(answer(chunked, false), None);
        assert_eq!(answer(&format!("{chunked}0\r\n\r\n"), false), own("12345"));
        assert_eq!(answer("HTTP/1.0 200 OK\r\n\r\n12345", false), None);
        assert_eq!(answer("HTTP/1.0 200 OK\r\n\r\n12345", true), own("12345"));
        assert!(matches!(answer("SSH-2.0-x\r\n\r\n", true), Some(Err(Failure::NotHttp(_)))));
    }

    #[test]
    fn a_url_is_a_host_and_what_stands_before_paths() {
        let of = |url: &str| {
            let Address { host, endpoint, base } = Address::of(url);
            [host, endpoint, base]
        };
        assert_eq!(of("http://127.0.0.1:4242"), ["127.0.0.1:4242", "127.0.0.1:4242", ""]);
        assert_eq!(of("http://gel/models/a/"), ["gel", "gel:80", "/models/a"]);
    }
}
