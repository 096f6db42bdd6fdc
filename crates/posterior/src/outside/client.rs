//! HTTP client for an external program. Each request uses a new unencrypted connection, so that a response depends only on its request.

use std::io::ErrorKind;
use std::time::Duration;

use serde_json::Value;
use ureq::Agent;
use ureq::http::Uri;

use super::endpoint::Endpoint;
use base::error::{Error, InputPlace, Result, Setting};

/// Longest wait for a connection to the server.
const CONNECT_TIMEOUT: Duration = Duration::from_secs(10);
/// Longest wait for a response of the server.
const RESPONSE_TIMEOUT: Duration = Duration::from_secs(600);
/// Largest size of a response in bytes, enough for ten million values.
const MOST_BYTES: u64 = 1 << 28;
/// Largest number of characters of a server's message that the program shows.
const MOST_CHARACTERS: usize = 300;

/// HTTP client of one server, with the server's address.
#[derive(Debug, Clone)]
pub struct Client {
    url: String,
    agent: Agent,
}

fn refuse(found: impl Into<String>, remedy: impl Into<String>) -> Error {
    Error::input(InputPlace::setting(Setting::Forward), found, remedy)
}

impl Client {
    /// Creates a client for an address `http://HOST[:PORT][/PATH]`.
    ///
    /// # Errors
    /// [`Error::Input`] for any other address.
    pub fn new(url: &str) -> Result<Self> {
        if url.starts_with("https://") {
            return Err(refuse(
                format!("{url}: encrypted connections are not supported"),
                "give an http:// address: on this machine, or of the local end of a tunnel (`ssh -L 4242:localhost:4242 HOST`)",
            ));
        }
        // The address must have only a host and a port, and no user name.
        let is_plain = |uri: &Uri| {
            let host = uri.host().unwrap_or_default();
            let whole = uri.port_u16().map_or(host.to_string(), |port| format!("{host}:{port}"));
            let authority = uri.authority().map_or("", |authority| authority.as_str());
            uri.scheme_str() == Some("http") && !host.is_empty() && whole == authority && uri.query().is_none()
        };
        if url.contains('#') || !url.parse::<Uri>().is_ok_and(|uri| is_plain(&uri)) {
            return Err(refuse(
                format!("`{url}` is no address of a server"),
                "give an address such as http://127.0.0.1:4242",
            ));
        }
        let agent = Agent::config_builder()
            .http_status_as_error(false)
            .max_idle_connections(0)
            .max_redirects(0)
            .max_redirects_will_error(false)
            .proxy(None)
            .timeout_connect(Some(CONNECT_TIMEOUT))
            .timeout_global(Some(RESPONSE_TIMEOUT))
            .build()
            .new_agent();
        Ok(Self { url: url.trim_end_matches('/').to_string(), agent })
    }

    /// Address of the server.
    pub fn url(&self) -> &str {
        &self.url
    }

    /// Sends a request to an endpoint and returns the response. A `Null` request is sent by GET, any other by POST.
    ///
    /// # Errors
    /// [`Error::Numerical`] if the server cannot be reached, does not respond in time, or responds with an error or without JSON.
    pub fn send(&self, endpoint: Endpoint, request: &Value) -> Result<Value> {
        let (status, body) = self.exchange(endpoint, request).map_err(|error| self.unreachable(endpoint, &error))?;
        let text = String::from_utf8_lossy(&body);
        let answer: Option<Value> = serde_json::from_str(&text).ok();
        let error = answer.as_ref().and_then(|answer| answer.get("error"));
        if status != 200 || error.is_some() {
            let name = error.and_then(|error| error.get("message").unwrap_or(error).as_str()).unwrap_or(&text);
            return Err(Error::numerical(
                format!("{} responds to {} with {status}: {}", self.url, endpoint.path(), shortened(name)),
                "read the server's message and log; docs/serve.md describes the requests",
            ));
        }
        answer.ok_or_else(|| match ["NaN", "Infinity"].iter().find(|word| text.contains(**word)) {
            Some(word) => self.not_finite(word),
            None => Error::numerical(
                format!("{} responds to {} with text that is no JSON: {}", self.url, endpoint.path(), shortened(&text)),
                "give the address of a UM-Bridge server of protocol 1.0",
            ),
        })
    }

    /// Returns the error for a response with a value `found` that is not a finite number.
    pub fn not_finite(&self, found: &str) -> Error {
        Error::numerical(
            format!("{} responds with {found} among its positions", self.url),
            format!(
                "let the model return a number everywhere in the prior, or narrow the prior ({}) to the range in which it does",
                Setting::Prior
            ),
        )
    }

    fn exchange(&self, endpoint: Endpoint, request: &Value) -> std::result::Result<(u16, Vec<u8>), ureq::Error> {
        let url = format!("{}{}", self.url, endpoint.path());
        let mut answer = match request {
            Value::Null => self.agent.get(&url).call()?,
            request => self.agent.post(&url).content_type("application/json").send(request.to_string())?,
        };
        let body = answer.body_mut().with_config().limit(MOST_BYTES).read_to_vec()?;
        Ok((answer.status().as_u16(), body))
    }

    fn unreachable(&self, endpoint: Endpoint, error: &ureq::Error) -> Error {
        let (url, path) = (&self.url, endpoint.path());
        let is_cut = |error: &std::io::Error| matches!(error.kind(), ErrorKind::UnexpectedEof | ErrorKind::InvalidData);
        match error {
            ureq::Error::Timeout(ureq::Timeout::Connect | ureq::Timeout::Resolve) => self.not_reached(error),
            ureq::Error::Timeout(_) => Error::numerical(
                format!("{url} does not respond to {path} in time ({} s)", RESPONSE_TIMEOUT.as_secs()),
                "check whether the server still computes; give it a coarser model, or a shorter record",
            ),
            ureq::Error::Io(error) if !is_cut(error) => self.not_reached(error),
            ureq::Error::HostNotFound | ureq::Error::ConnectionFailed => self.not_reached(error),
            _ => Error::numerical(
                format!("{url} sends an incomplete response to {path}: {error}"),
                "give the address of a UM-Bridge server, and read its log",
            ),
        }
    }

    fn not_reached(&self, error: &dyn std::error::Error) -> Error {
        Error::numerical(
            format!("{} cannot be reached: {error}", self.url),
            format!("start the server, and compare its address and port with {}", Setting::Forward),
        )
    }
}

fn shortened(text: &str) -> String {
    let text = text.trim();
    match text.char_indices().nth(MOST_CHARACTERS) {
        Some((end, _)) => format!("{} …", &text[..end]),
        None if text.is_empty() => "nothing".into(),
        None => text.into(),
    }
}

#[cfg(test)]
mod tests {
    use std::io::{Read, Write};
    use std::net::TcpListener;

    use super::*;

    #[test]
    fn addresses_are_read_or_refused() {
        let of = |url: &str| Client::new(url).map(|client| client.url);
        assert_eq!(of("http://127.0.0.1:4242").unwrap(), "http://127.0.0.1:4242");
        assert_eq!(of("http://gel.org/models/").unwrap(), "http://gel.org/models");
        assert_eq!(of("http://[::1]:80").unwrap(), "http://[::1]:80");
        for (url, words) in [
            ("https://gel.org", "tunnel"),
            ("gel.org:4242", "no address"),
            ("http://", "no address"),
            ("http://gel.org:port", "no address"),
            ("http://:4242", "no address"),
            ("http://a@b:1", "no address"),
            ("http://gel org", "no address"),
            ("http://gel.org?model=2", "no address"),
            ("http://gel.org#2", "no address"),
        ] {
            let message = of(url).unwrap_err().to_string();
            assert!(message.contains(words) && message.contains("forward"), "{url}: {message}");
        }
    }

    /// Starts a server that responds to one request with `bytes`, and returns the client's result.
    fn answered(bytes: &'static [u8]) -> Result<Value> {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let client = Client::new(&format!("http://{}", listener.local_addr().unwrap())).unwrap();
        let server = std::thread::spawn(move || {
            let (mut stream, _) = listener.accept().unwrap();
            // An unread request would break the connection before its response is read.
            let mut request = Vec::new();
            while !request.ends_with(b"}") {
                let mut part = [0; 4096];
                let n = stream.read(&mut part).unwrap();
                request.extend_from_slice(&part[..n]);
            }
            stream.write_all(bytes).unwrap();
        });
        let answer = client.send(Endpoint::Evaluate, &serde_json::json!({ "name": "forward" }));
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
            (b"HTTP/1.1 200 OK\r\nContent-Length: 900\r\n\r\n{\"out", "incomplete response to /Evaluate"),
            (b"SSH-2.0", "incomplete response to /Evaluate"),
        ];
        for (answer, words) in cases {
            let message = answered(answer).unwrap_err().to_string();
            assert!(message.contains(words) && message.contains("what to do"), "{message}");
        }
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let client = Client::new(&format!("http://{}", listener.local_addr().unwrap())).unwrap();
        drop(listener);
        let message = client.send(Endpoint::Info, &Value::Null).unwrap_err().to_string();
        assert!(message.contains("cannot be reached") && message.contains("start the server"), "{message}");
    }
}
