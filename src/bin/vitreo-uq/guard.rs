//! Who may ask a local server: programs, and its own page, under names that are its own.

use std::net::SocketAddr;

use axum::extract::{Request, State};
use axum::http::{HeaderMap, HeaderValue, StatusCode, header};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};

/// What the page may load: its own files, and drawings.
const POLICY: &str = "default-src 'self'; img-src 'self' data:; style-src 'self' 'unsafe-inline'; frame-ancestors 'none'; base-uri 'none'; form-action 'none'";

/// Names under which a browser reaches this server.
#[derive(Debug, Clone)]
pub struct Guard {
    /// `host:port`; empty where other machines may reach it, under names that it does not know.
    hosts: Vec<String>,
}

impl Guard {
    /// Of a server at this address.
    pub fn of(address: SocketAddr) -> Self {
        let names = [address.to_string(), format!("localhost:{}", address.port())];
        Self { hosts: if address.ip().is_loopback() { names.to_vec() } else { Vec::new() } }
    }

    /// Whether headers are those of a page of this server: a name that another site has turned to this address (DNS rebinding) is not, nor is a request that another site's script makes.
    fn admits(&self, headers: &HeaderMap) -> bool {
        let text = |name| headers.get(name).and_then(|value| value.to_str().ok());
        let Some(host) = text(header::HOST) else { return false };
        let is_known = self.hosts.is_empty() || self.hosts.iter().any(|own| own == host);
        let is_own = |origin: &str| origin.strip_prefix("http://") == Some(host);
        is_known && headers.get(header::ORIGIN).is_none_or(|_| text(header::ORIGIN).is_some_and(is_own))
    }
}

/// Lets requests of the page through, and tells browsers what the page may do.
pub async fn guard(State(guard): State<Guard>, request: Request, next: Next) -> Response {
    if !guard.admits(request.headers()) {
        return (StatusCode::FORBIDDEN, "This server is asked under another name than its own.\n").into_response();
    }
    let mut response = next.run(request).await;
    let headers = response.headers_mut();
    for (name, value) in [
        (header::CONTENT_SECURITY_POLICY, POLICY),
        (header::X_CONTENT_TYPE_OPTIONS, "nosniff"),
        (header::REFERRER_POLICY, "no-referrer"),
        (header::CACHE_CONTROL, "no-store"),
    ] {
        headers.insert(name, HeaderValue::from_static(value));
    }
    response
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn other_names_and_other_sites_are_refused() {
        let guard = Guard::of(SocketAddr::from(([127, 0, 0, 1], 8421)));
        let admits = |pairs: &[(header::HeaderName, &'static str)]| {
            let own = pairs.iter().map(|(name, value)| (name.clone(), HeaderValue::from_static(value)));
            guard.admits(&own.collect())
        };
        assert!(admits(&[(header::HOST, "localhost:8421")]));
        assert!(admits(&[(header::HOST, "localhost:8421"), (header::ORIGIN, "http://localhost:8421")]));
        assert!(!admits(&[]));
        assert!(!admits(&[(header::HOST, "evil.example:8421")]));
        assert!(!admits(&[(header::HOST, "localhost:8421"), (header::ORIGIN, "http://evil.example")]));
        assert!(!admits(&[(header::HOST, "localhost:8421"), (header::ORIGIN, "null")]));
    }
}
