//! What local servers share: listening, and connections of which none keeps the others out.

use std::net::{IpAddr, SocketAddr, TcpListener};
use std::sync::Arc;
use std::time::Duration;

use axum::Router;
use hyper_util::rt::{TokioIo, TokioTimer};
use hyper_util::service::TowerToHyperService;
use tokio::sync::Semaphore;
use vitreo_uq::base::error::{Error, Place, Result};

/// Connections at once; headers of a request have so long to come.
const MOST_CONNECTIONS: usize = 64;
const HEADERS: Duration = Duration::from_secs(10);
/// Bytes of a request's head.
const MOST_HEAD_BYTES: usize = 1 << 15;

/// Listens at the first of `ports` that nobody else has, of which 0 is any that is free; says where, too.
pub fn listen(address: IpAddr, ports: &[u16]) -> Result<(TcpListener, SocketAddr)> {
    let mut refusal = None;
    for &port in ports {
        let bound = TcpListener::bind(SocketAddr::new(address, port));
        let error = match bound.and_then(|listener| listener.local_addr().map(|own| (listener, own))) {
            Ok(listening) => return Ok(listening),
            Err(error) => error,
        };
        let is_taken = error.kind() == std::io::ErrorKind::AddrInUse;
        refusal.get_or_insert(Error::input(
            Place::default().at_key("--port"),
            format!("{address}:{port} cannot be listened on: {error}"),
            "give another port, or `--port 0` for any that is free",
        ));
        if !is_taken {
            break;
        }
    }
    Err(refusal.unwrap_or_else(|| Error::input(Place::default().at_key("--port"), "no port is given", "give one")))
}

/// Serves until the program is ended. `router` is called inside the runtime, so that it may start tasks of its own.
pub fn serve(listener: TcpListener, router: impl FnOnce() -> Router) -> std::io::Result<()> {
    let runtime = tokio::runtime::Builder::new_current_thread().enable_io().enable_time().build()?;
    listener.set_nonblocking(true)?;
    runtime.block_on(async move {
        let listener = tokio::net::TcpListener::from_std(listener)?;
        connections(listener, router()).await;
        Ok(())
    })
}

/// Connections, so many at once, none of which may hold back its headers.
async fn connections(listener: tokio::net::TcpListener, app: Router) {
    let free = Arc::new(Semaphore::new(MOST_CONNECTIONS));
    loop {
        let Ok(place) = Arc::clone(&free).acquire_owned().await else { return };
        let Ok((stream, _)) = listener.accept().await else {
            // Out of file handles, or a peer that was gone at once.
            tokio::time::sleep(Duration::from_millis(50)).await;
            continue;
        };
        let service = TowerToHyperService::new(app.clone());
        tokio::spawn(async move {
            let mut builder = hyper::server::conn::http1::Builder::new();
            builder.timer(TokioTimer::new()).header_read_timeout(HEADERS).max_buf_size(MOST_HEAD_BYTES);
            // A peer that breaks off is its own affair.
            let _ = builder.serve_connection(TokioIo::new(stream), service).await;
            drop(place);
        });
    }
}
