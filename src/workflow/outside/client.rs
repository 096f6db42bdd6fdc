//! Requests to another program, by HTTP over a plain connection: one a request, so that an answer depends on its request alone.

use std::io::{ErrorKind, Read, Write};
use std::net::{TcpStream, ToSocketAddrs};
use std::time::Duration;

use serde_json::Value;

use crate::error::{Error, Place, Result};
use crate::workflow::bridge::Endpoint;

/// How long a connection, and then an answer, is waited for.
const CONNECTING: Duration = Duration::from_secs(10);
const ANSWERING: Duration = Duration::from_secs(600);
/// Largest answer that is read: ten million numbers.
const MOST_BYTES: u64 = 1 << 28;
/// Letters of a server's own words that are shown.
const MOST_WORDS: usize = 300;

/// A server's address.
#[derive(Debug, Clone, PartialEq)]
pub struct Client {
    url: String,
    /// Host and port, as a connection and the header take them.
    authority: String,
    /// What stands before an endpoint's path.
    prefix: String,
}

fn refuse(found: impl Into<String>, remedy: impl Into<String>) -> Error {
    Error::input(Place::option("--forward"), found, remedy)
}

impl Client {
    /// Of an address `http://HOST[:PORT][/PATH]`.
    ///
    /// # Errors
    /// [`Error::Input`] for any other.
    pub fn new(url: &str) -> Result<Self> {
        const EXAMPLE: &str = "give an address such as http://127.0.0.1:4242";
        if url.starts_with("https://") {
            return Err(refuse(
                format!("{url}: encrypted connections are not spoken"),
                "give an http:// address: on this machine, or this end of a tunnel (`ssh -L 4242:localhost:4242 HOST`)",
            ));
        }
        let Some(rest) = url.strip_prefix("http://") else {
            return Err(refuse(format!("`{url}` is no address of a server"), EXAMPLE));
        };
        let (authority, path) = rest.split_once('/').unwrap_or((rest, ""));
        let is_plain = |text: &str| text.chars().all(|c| c.is_ascii_graphic());
        let port = authority.rsplit_once(':').filter(|(host, _)| !host.starts_with('[') || host.ends_with(']'));
        let is_sound = match port {
            Some((host, port)) => !host.is_empty() && port.parse::<u16>().is_ok(),
            None => !authority.is_empty(),
        };
        if !is_sound || !is_plain(rest) || rest.contains(['@', '?', '#']) {
            return Err(refuse(format!("`{url}` is no address of a server"), EXAMPLE));
        }
        let authority = if port.is_some() { authority.to_string() } else { format!("{authority}:80") };
        let path = path.trim_end_matches('/');
        let prefix = if path.is_empty() { String::new() } else { format!("/{path}") };
        Ok(Self { url: url.to_string(), authority, prefix })
    }

    /// The address.
    pub fn url(&self) -> &str {
        &self.url
    }

    /// What the server answers; with `Null` it is only asked.
    ///
    /// # Errors
    /// [`Error::Numerical`] where it cannot be reached, does not answer in time, answers an error, or no JSON.
    pub fn ask(&self, endpoint: Endpoint, request: &Value) -> Result<Value> {
        let (status, body) = self.exchange(endpoint, request).map_err(|error| self.unreachable(endpoint, &error))?;
        let text = String::from_utf8_lossy(&body);
        let answer: Option<Value> = serde_json::from_str(&text).ok();
        let error = answer.as_ref().and_then(|answer| answer.get("error"));
        if status != 200 || error.is_some() {
            let own = error.and_then(|error| error.get("message").unwrap_or(error).as_str()).unwrap_or(&text);
            return Err(Error::numerical(
                format!("{} answers {} with {status}: {}", self.url, endpoint.path(), shortened(own)),
                "read the server's own words and log; what it is asked is in docs/serve.md",
            ));
        }
        answer.ok_or_else(|| match ["NaN", "Infinity"].iter().find(|word| text.contains(**word)) {
            Some(word) => self.not_finite(word),
            None => Error::numerical(
                format!("{} answers {} with no JSON: {}", self.url, endpoint.path(), shortened(&text)),
                "give the address of an UM-Bridge server, of protocol 1.0",
            ),
        })
    }

    /// An answer that holds no number.
    pub fn not_finite(&self, found: &str) -> Error {
        Error::numerical(
            format!("{} answers with {found} among its positions", self.url),
            "let the model give a number wherever the prior leads, or narrow the prior (--prior) to where it does",
        )
    }

    fn exchange(&self, endpoint: Endpoint, request: &Value) -> std::io::Result<(u16, Vec<u8>)> {
        let mut stream = self.connect()?;
        stream.set_read_timeout(Some(ANSWERING))?;
        stream.set_write_timeout(Some(ANSWERING))?;
        let (method, body) = match request {
            Value::Null => ("GET", String::new()),
            request => ("POST", request.to_string()),
        };
        let head = format!(
            "{method} {}{} HTTP/1.1\r\nHost: {}\r\nContent-Type: application/json\r\nAccept: application/json\r\nConnection: close\r\nContent-Length: {}\r\n\r\n",
            self.prefix,
            endpoint.path(),
            self.authority,
            body.len()
        );
        stream.write_all(&[head.as_bytes(), body.as_bytes()].concat())?;
        let mut answer = Vec::new();
        let ended = stream.take(MOST_BYTES).read_to_end(&mut answer);
        match (read(&answer), ended) {
            (Some(read), _) => Ok(read),
            (None, Err(error)) => Err(error),
            (None, Ok(_)) => Err(std::io::Error::new(ErrorKind::InvalidData, "this is no answer by HTTP")),
        }
    }

    fn connect(&self) -> std::io::Result<TcpStream> {
        let mut last = std::io::Error::new(ErrorKind::NotFound, "there is no such host");
        for address in self.authority.to_socket_addrs()? {
            match TcpStream::connect_timeout(&address, CONNECTING) {
                Ok(stream) => return Ok(stream),
                Err(error) => last = error,
            }
        }
        Err(last)
    }

    fn unreachable(&self, endpoint: Endpoint, error: &std::io::Error) -> Error {
        let (url, path) = (&self.url, endpoint.path());
        match error.kind() {
            ErrorKind::WouldBlock | ErrorKind::TimedOut => Error::numerical(
                format!("{url} does not answer {path} in time ({} s)", ANSWERING.as_secs()),
                "see whether the server still computes; give it a coarser model, or a shorter record",
            ),
            ErrorKind::InvalidData => Error::numerical(
                format!("{url} does not answer {path} whole: {error}"),
                "give the address of an UM-Bridge server, and read its log",
            ),
            _ => Error::numerical(
                format!("{url} cannot be reached: {error}"),
                "start the server, and compare its address and port with --forward",
            ),
        }
    }
}

fn shortened(text: &str) -> String {
    let text = text.trim();
    match text.char_indices().nth(MOST_WORDS) {
        Some((end, _)) => format!("{} …", &text[..end]),
        None if text.is_empty() => "nothing".into(),
        None => text.into(),
    }
}

/// Status and body of a whole answer.
fn read(answer: &[u8]) -> Option<(u16, Vec<u8>)> {
    let end = answer.windows(4).position(|four| four == b"\r\n\r\n")?;
    let (head, body) = (std::str::from_utf8(&answer[..end]).ok()?, &answer[end + 4..]);
    let mut lines = head.split("\r\n");
    let status = lines.next()?.strip_prefix("HTTP/")?.split(' ').nth(1)?.parse().ok()?;
    let headers: Vec<(String, &str)> =
        lines.filter_map(|line| line.split_once(':')).map(|(name, own)| (name.to_lowercase(), own.trim())).collect();
    let header = |name: &str| headers.iter().find(|(own, _)| own == name).map(|(_, value)| *value);
    if header("transfer-encoding").is_some_and(|own| own.eq_ignore_ascii_case("chunked")) {
        return Some((status, joined(body)?));
    }
    match header("content-length") {
        Some(length) => Some((status, body.get(..length.parse().ok()?)?.to_vec())),
        None => Some((status, body.to_vec())),
    }
}

/// The chunks of a body, if the last is there.
fn joined(mut body: &[u8]) -> Option<Vec<u8>> {
    let mut whole = Vec::new();
    loop {
        let end = body.windows(2).position(|two| two == b"\r\n")?;
        let size = std::str::from_utf8(&body[..end]).ok()?.split(';').next()?.trim();
        let (size, rest) = (usize::from_str_radix(size, 16).ok()?, &body[end + 2..]);
        if size == 0 {
            return Some(whole);
        }
        whole.extend_from_slice(rest.get(..size)?);
        body = rest.get(size.checked_add(2)?..)?;
    }
}

#[cfg(test)]
mod tests {
    use std::net::TcpListener;

    use super::*;

    #[test]
    fn addresses_are_read_or_refused() {
        let of = |url: &str| Client::new(url).map(|own| (own.authority, own.prefix));
        assert_eq!(of("http://127.0.0.1:4242").unwrap(), ("127.0.0.1:4242".into(), String::new()));
        assert_eq!(of("http://gel.org/models/").unwrap(), ("gel.org:80".into(), "/models".into()));
        assert_eq!(of("http://[::1]:80").unwrap(), ("[::1]:80".into(), String::new()));
        for (url, words) in [
            ("https://gel.org", "tunnel"),
            ("gel.org:4242", "no address"),
            ("http://", "no address"),
            ("http://gel.org:port", "no address"),
            ("http://:4242", "no address"),
            ("http://a@b:1", "no address"),
            ("http://gel org", "no address"),
        ] {
            let message = of(url).unwrap_err().to_string();
            assert!(message.contains(words) && message.contains("--forward"), "{url}: {message}");
        }
    }

    /// One answer to one request, whatever it is.
    fn answered(bytes: &'static [u8]) -> Result<Value> {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let client = Client::new(&format!("http://{}", listener.local_addr().unwrap())).unwrap();
        let server = std::thread::spawn(move || {
            let (mut stream, _) = listener.accept().unwrap();
            let _ = stream.read(&mut [0; 4096]);
            stream.write_all(bytes).unwrap();
        });
        let answer = client.ask(Endpoint::Evaluate, &serde_json::json!({ "name": "forward" }));
        server.join().unwrap();
        answer
    }

    #[test]
    fn answers_are_read_whole() {
        let expected = serde_json::json!({ "output": [[1.5]] });
        for answer in [
            &b"HTTP/1.1 200 OK\r\nContent-Length: 18\r\n\r\n{\"output\":[[1.5]]}"[..],
            b"HTTP/1.0 200 OK\r\n\r\n{\"output\":[[1.5]]}",
            b"HTTP/1.1 200 OK\r\ntransfer-encoding: chunked\r\n\r\n9\r\n{\"output\"\r\n9;x\r\n:[[1.5]]}\r\n0\r\n\r\n",
        ] {
            assert_eq!(answered(answer).unwrap(), expected);
        }
    }

    #[test]
    fn errors_say_what_the_server_said_and_what_to_do() {
        let cases: [(&'static [u8], &str); 6] = [
            (b"HTTP/1.1 500 No\r\n\r\nthe spring broke", "with 500: the spring broke"),
            (b"HTTP/1.1 400 No\r\n\r\n{\"error\":{\"type\":\"InvalidInput\",\"message\":\"too stiff\"}}", "too stiff"),
            (b"HTTP/1.1 200 OK\r\n\r\n{\"output\": [[NaN]]}", "NaN among its positions"),
            (b"HTTP/1.1 200 OK\r\n\r\n<html>", "no JSON: <html>"),
            (b"HTTP/1.1 200 OK\r\nContent-Length: 900\r\n\r\n{\"out", "does not answer /Evaluate whole"),
            (b"SSH-2.0", "no answer by HTTP"),
        ];
        for (answer, words) in cases {
            let message = answered(answer).unwrap_err().to_string();
            assert!(message.contains(words) && message.contains("what to do"), "{message}");
        }
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let client = Client::new(&format!("http://{}", listener.local_addr().unwrap())).unwrap();
        drop(listener);
        let message = client.ask(Endpoint::Info, &Value::Null).unwrap_err().to_string();
        assert!(message.contains("cannot be reached") && message.contains("start the server"), "{message}");
    }
}
