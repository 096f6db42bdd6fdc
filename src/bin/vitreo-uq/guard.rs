//! Access rule of a local server. Only programs and the server's own page may send requests, and every request must use one of the server's names.

use std::net::{IpAddr, SocketAddr};
use std::sync::Arc;

use axum::extract::{Request, State};
use axum::http::{HeaderMap, HeaderValue, StatusCode, header};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};

/// Content security policy of the server's page. The page may load files of this server, and images that are embedded as data.
const POLICY: &str = "default-src 'self'; img-src 'self' data:; style-src 'self' 'unsafe-inline'; frame-ancestors 'none'; base-uri 'none'; form-action 'none'";

/// Text of the response to a request that is refused.
const REFUSAL: &str = "This request names another host, or comes from another site's page. Use the server's IP address, or start the server with `--allow-host NAME`.\n";

/// Host names that requests may use. Numeric addresses are always allowed, because no other site can redirect them.
#[derive(Debug, Clone)]
pub struct Guard {
    names: Arc<[String]>,
}

impl Guard {
    /// Creates the guard of a server that listens on `address`. If other machines can reach this address, the machine's own name is allowed. `others` are
    /// further allowed names.
    pub fn new(address: SocketAddr, others: &[String]) -> Self {
        let machine = if address.ip().is_loopback() { None } else { machine_name() };
        let short = machine.as_ref().and_then(|name| name.split('.').next()).map(String::from);
        let names = ["localhost".to_string()].into_iter().chain(machine).chain(short).chain(others.iter().cloned());
        Self { names: names.collect() }
    }

    /// Returns whether a request comes from this server's page or from a program. Other requests come from names redirected by DNS rebinding, or from scripts
    /// of other sites.
    fn admits(&self, headers: &HeaderMap) -> bool {
        let text = |name| headers.get(name).and_then(|value| value.to_str().ok());
        let Some(host) = text(header::HOST) else { return false };
        let is_own = |origin: &str| origin.strip_prefix("http://") == Some(host);
        self.knows(host) && headers.get(header::ORIGIN).is_none_or(|_| text(header::ORIGIN).is_some_and(is_own))
    }

    /// Returns whether `host`, with or without a port, is one of the server's names.
    fn knows(&self, host: &str) -> bool {
        if host.parse::<SocketAddr>().is_ok() || host.trim_matches(['[', ']']).parse::<IpAddr>().is_ok() {
            return true;
        }
        let name = match host.rsplit_once(':') {
            Some((name, port)) if port.parse::<u16>().is_ok() => name,
            _ => host,
        };
        self.names.iter().any(|known| known.eq_ignore_ascii_case(name.trim_end_matches('.')))
    }
}

/// Name of this machine, from the command `hostname`; `None` if the command fails.
fn machine_name() -> Option<String> {
    let output = std::process::Command::new("hostname").stdin(std::process::Stdio::null()).output().ok()?;
    let name = String::from_utf8(output.stdout).ok()?.trim().to_string();
    (!name.is_empty()).then_some(name)
}

/// Middleware that refuses requests according to the guard. It adds the page's security policy to responses.
pub async fn guard(State(guard): State<Guard>, request: Request, next: Next) -> Response {
    if !guard.admits(request.headers()) {
        return (StatusCode::FORBIDDEN, REFUSAL).into_response();
    }
    let mut response = next.run(request).await;
    let headers = response.headers_mut();
    for (name, value) in [
        (header::CONTENT_SECURITY_POLICY, POLICY),
        (header::X_CONTENT_TYPE_OPTIONS, "nosniff"),
        (header::REFERRER_POLICY, "no-referrer"),
        (header::CACHE_CONTROL, "no-store"),
    ] {
        // A response may have a stricter policy.
        headers.entry(name).or_insert(HeaderValue::from_static(value));
    }
    response
}

#[cfg(test)]
mod tests {
    use super::*;

    fn admits(guard: &Guard, pairs: &[(header::HeaderName, &'static str)]) -> bool {
        let headers = pairs.iter().map(|(name, value)| (name.clone(), HeaderValue::from_static(value)));
        guard.admits(&headers.collect())
    }

    #[test]
    fn other_names_and_other_sites_are_refused() {
        for address in [[127, 0, 0, 1], [0, 0, 0, 0], [192, 168, 0, 7]] {
            let guard = Guard::new(SocketAddr::from((address, 8421)), &[]);
            assert!(admits(&guard, &[(header::HOST, "localhost:8421")]));
            assert!(admits(&guard, &[(header::HOST, "localhost:8421"), (header::ORIGIN, "http://localhost:8421")]));
            for host in ["127.0.0.1:8421", "192.168.0.7", "[::1]:8421", "[fe80::1]", "LOCALHOST."] {
                assert!(admits(&guard, &[(header::HOST, host)]), "{host}");
            }
            assert!(!admits(&guard, &[]));
            for host in
                ["evil.example:8421", "evil.example", "localhost.evil.example", "127.0.0.1.evil.example:8421", ""]
            {
                assert!(!admits(&guard, &[(header::HOST, host)]), "{host} at {address:?}");
            }
            assert!(!admits(&guard, &[(header::HOST, "localhost:8421"), (header::ORIGIN, "http://evil.example")]));
            assert!(!admits(&guard, &[(header::HOST, "localhost:8421"), (header::ORIGIN, "null")]));
        }
    }

    #[test]
    fn further_names_are_those_that_were_given() {
        let guard = Guard::new(SocketAddr::from(([0, 0, 0, 0], 8421)), &["gel.example".into()]);
        assert!(admits(&guard, &[(header::HOST, "gel.example:8421"), (header::ORIGIN, "http://gel.example:8421")]));
        assert!(!admits(&guard, &[(header::HOST, "bad.gel.example:8421")]));
    }
}
