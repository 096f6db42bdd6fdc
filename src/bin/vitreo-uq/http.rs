//! Accepts connections for all local servers of the program, and prevents slow clients from blocking others.
//!
//! At any time, either the peer or the program has to act on a connection. The peer sends a request or reads a response, and has a limited time for each step.
//! The program computes a response. If the maximum number of connections is reached, the connection whose peer has the least time left is closed. Any number of
//! slow clients therefore cannot block others. Event streams stay open and are counted separately.

use std::future::{Future, poll_fn};
use std::net::{IpAddr, SocketAddr, TcpListener};
use std::pin::{Pin, pin};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::task::{Context, Poll};
use std::time::Duration;

use axum::body::{Body, Bytes};
use axum::extract::{Extension, Request};
use axum::http::StatusCode;
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};
use axum::{RequestExt, Router};
use hyper::service::{Service, service_fn};
use hyper_util::rt::TokioIo;
use hyper_util::service::TowerToHyperService;
use tokio::io::{AsyncRead, AsyncWrite, ReadBuf};
use tokio::net::TcpStream;
use tokio::sync::Notify;
use tokio::time::Instant;
use vitreo_uq::base::error::{Error, InputPlace, Result};

/// Maximum number of connections, of connections from one peer, and of event streams.
const MOST_CONNECTIONS: usize = 512;
const MOST_OF_PEER: usize = 256;
const MOST_STREAMS: usize = 64;
/// Maximum time to send the head of a connection's first request, and (`NEXT_HEAD`) of each further request.
const HEAD: Duration = Duration::from_secs(10);
const NEXT_HEAD: Duration = Duration::from_secs(30);
/// Maximum time to send the body of a request.
const BODY: Duration = Duration::from_secs(30);
/// Maximum time between two reads of a response by the peer.
const ANSWER: Duration = Duration::from_secs(30);
/// Maximum size of a request's head, in bytes.
const MOST_HEAD_BYTES: usize = 1 << 15;
/// Response to a new peer if the server has too many connections and can close none of them.
const BUSY: &[u8] =
    b"HTTP/1.1 503 Service Unavailable\r\nRetry-After: 1\r\nContent-Length: 0\r\nConnection: close\r\n\r\n";

/// Listens on the first of `ports` that is free; port 0 stands for any free port. Returns the listener and its address.
pub fn listen(address: IpAddr, ports: &[u16]) -> Result<(TcpListener, SocketAddr)> {
    let mut refusal = None;
    for &port in ports {
        let bound = TcpListener::bind(SocketAddr::new(address, port));
        let error = match bound.and_then(|listener| listener.local_addr().map(|socket_addr| (listener, socket_addr))) {
            Ok(listening) => return Ok(listening),
            Err(error) => error,
        };
        let is_taken = error.kind() == std::io::ErrorKind::AddrInUse;
        refusal.get_or_insert(Error::input(
            InputPlace::default().at_key("--port"),
            format!("cannot listen on {address}:{port}: {error}"),
            "give another port, or `--port 0` for any free port",
        ));
        if !is_taken {
            break;
        }
    }
    Err(refusal
        .unwrap_or_else(|| Error::input(InputPlace::default().at_key("--port"), "no port is given", "give a port")))
}

/// Serves requests until the program ends. `router` is called inside the asynchronous runtime, so that it may start tasks there.
pub fn serve(listener: TcpListener, router: impl FnOnce() -> Router) -> std::io::Result<()> {
    let runtime = tokio::runtime::Builder::new_current_thread().enable_io().enable_time().build()?;
    listener.set_nonblocking(true)?;
    runtime.block_on(async move {
        let listener = tokio::net::TcpListener::from_std(listener)?;
        accept(listener, router()).await;
        Ok(())
    })
}

/// Side of a connection that has to act next: the peer or the program.
#[derive(Debug, Clone, Copy, PartialEq)]
enum NextActor {
    /// The peer has to act, until this time.
    Peer { until: Instant },
    /// The program has to act.
    Program,
    /// Nobody has to act, because the response is an event stream. It has been open since this time.
    Stream { since: Instant },
}

/// A connection of a local server. The handler of a request finds its connection among the request's extensions.
#[derive(Clone)]
pub struct Connection {
    state: Arc<ConnectionState>,
    all: Arc<Connections>,
}

struct ConnectionState {
    peer: IpAddr,
    turn: Mutex<NextActor>,
    is_closed: Notify,
}

impl ConnectionState {
    fn turn(&self) -> NextActor {
        *lock(&self.turn)
    }

    fn pass_to(&self, next: NextActor) {
        *lock(&self.turn) = next;
    }
}

/// Locks a mutex, even if another thread panicked while it held the lock. The state of connections stays valid then.
fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Connection {
    fn new(peer: IpAddr, all: &Arc<Connections>) -> Self {
        let turn = Mutex::new(NextActor::Peer { until: Instant::now() + HEAD });
        Self { state: Arc::new(ConnectionState { peer, turn, is_closed: Notify::new() }), all: Arc::clone(all) }
    }

    /// Gives the peer the time `time` for its next step, from now on.
    pub fn give_time(&self, time: Duration) {
        self.state.pass_to(NextActor::Peer { until: Instant::now() + time });
    }

    /// Records that the complete request has arrived. The program has to act next.
    pub fn mark_request_complete(&self) {
        self.state.pass_to(NextActor::Program);
    }

    /// Records that the response is an event stream. If there are too many streams, the oldest one ends.
    pub fn mark_as_stream(&self) {
        self.state.pass_to(NextActor::Stream { since: Instant::now() });
        self.all.keep_streams();
    }

    /// Records that a response is complete. The peer has to read it next.
    fn mark_answered(&self) {
        if self.state.turn() == NextActor::Program {
            self.give_time(NEXT_HEAD);
        }
    }

    /// Records that the peer has read some bytes of the response.
    fn has_written(&self) {
        if let NextActor::Peer { until } = self.state.turn() {
            self.state.pass_to(NextActor::Peer { until: until.max(Instant::now() + ANSWER) });
        }
    }

    /// Waits until the peer exceeds its time limit, or until the server closes this connection to make room for another.
    async fn wait_until_expired(&self) {
        let is_late = async {
            loop {
                // No time limit applies while the program computes a response or a stream is open.
                let look_at = match self.state.turn() {
                    NextActor::Peer { until } if until <= Instant::now() => return,
                    NextActor::Peer { until } => until,
                    NextActor::Program | NextActor::Stream { .. } => Instant::now() + HEAD,
                };
                tokio::time::sleep_until(look_at).await;
            }
        };
        wait_for_first(is_late, self.state.is_closed.notified()).await;
    }
}

/// All open connections of a server.
#[derive(Default)]
struct Connections(Mutex<Vec<Arc<ConnectionState>>>);

impl Connections {
    /// Registers a new connection from `peer`. If a maximum number is reached, it closes another connection that waits for its peer. Returns `None` if there is
    /// no such connection.
    fn place_for(self: &Arc<Self>, peer: IpAddr) -> Option<Connection> {
        let mut all = lock(&self.0);
        let of_peer = |state: &ConnectionState| state.peer == peer;
        for (most, is_meant) in
            [(MOST_OF_PEER, &of_peer as &dyn Fn(&ConnectionState) -> bool), (MOST_CONNECTIONS, &|_| true)]
        {
            let is_counted =
                |state: &&Arc<ConnectionState>| is_meant(state) && !matches!(state.turn(), NextActor::Stream { .. });
            if all.iter().filter(is_counted).count() >= most && !close_latest(&mut all, is_meant) {
                return None;
            }
        }
        let connection = Connection::new(peer, self);
        all.push(Arc::clone(&connection.state));
        Some(connection)
    }

    /// Closes the connection whose peer has the least time left, if there is a connection whose peer has to act.
    fn make_room(&self) {
        close_latest(&mut lock(&self.0), &|_| true);
    }

    fn keep_streams(&self) {
        let mut all = lock(&self.0);
        let since = |state: &ConnectionState| match state.turn() {
            NextActor::Stream { since } => Some(since),
            _ => None,
        };
        while all.iter().filter(|state| since(state).is_some()).count() > MOST_STREAMS {
            let streams = all.iter().enumerate().filter_map(|(index, state)| Some((since(state)?, index)));
            let Some((_, oldest)) = streams.min() else { return };
            all.swap_remove(oldest).is_closed.notify_one();
        }
    }

    fn forget(&self, connection: &Connection) {
        lock(&self.0).retain(|state| !Arc::ptr_eq(state, &connection.state));
    }
}

/// Of the connections that `is_meant` selects and that wait for their peer, closes the one with the least time left. Returns false if there is none.
fn close_latest(all: &mut Vec<Arc<ConnectionState>>, is_meant: &dyn Fn(&ConnectionState) -> bool) -> bool {
    let until = |(index, state): (usize, &Arc<ConnectionState>)| match state.turn() {
        NextActor::Peer { until } if is_meant(state) => Some((until, index)),
        _ => None,
    };
    let Some((_, index)) = all.iter().enumerate().filter_map(until).min() else { return false };
    all.swap_remove(index).is_closed.notify_one();
    true
}

async fn accept(listener: tokio::net::TcpListener, app: Router) {
    let all = Arc::new(Connections::default());
    loop {
        let Ok((stream, address)) = listener.accept().await else {
            // Accepting a connection fails if no file handles are left, or if the peer has closed the connection already.
            all.make_room();
            tokio::time::sleep(Duration::from_millis(50)).await;
            continue;
        };
        let Some(connection) = all.place_for(address.ip()) else {
            let _ = stream.try_write(BUSY);
            continue;
        };
        tokio::spawn(answer(stream, connection, app.clone()));
    }
}

/// Serves the requests of one connection until the connection ends.
async fn answer(stream: TcpStream, connection: Connection, app: Router) {
    let app = TowerToHyperService::new(app);
    let each = service_fn(|mut request: hyper::Request<hyper::body::Incoming>| {
        connection.give_time(BODY);
        request.extensions_mut().insert(connection.clone());
        let (response, connection) = (app.call(request), connection.clone());
        async move {
            let response = response.await;
            connection.mark_answered();
            response
        }
    });
    let mut builder = hyper::server::conn::http1::Builder::new();
    // The time limit of the library Hyper for heads is disabled, because it would also end responses that are read slowly.
    builder.header_read_timeout(None).max_buf_size(MOST_HEAD_BYTES);
    let io = TokioIo::new(WatchedStream { stream, connection: connection.clone() });
    // The result is ignored, because a peer may close its connection at any time.
    wait_for_first(builder.serve_connection(io, each), connection.wait_until_expired()).await;
    connection.all.forget(&connection);
}

/// Waits until one of two futures ends, and drops the other.
async fn wait_for_first(first: impl Future, second: impl Future) {
    let (mut first, mut second) = (pin!(first), pin!(second));
    poll_fn(|cx| {
        let is_over = first.as_mut().poll(cx).is_ready() || second.as_mut().poll(cx).is_ready();
        if is_over { Poll::Ready(()) } else { Poll::Pending }
    })
    .await;
}

/// Middleware that reads the whole body of a request before the handler starts. A slow sender then blocks only its own connection.
pub async fn whole_body(Extension(connection): Extension<Connection>, request: Request, next: Next) -> Response {
    let (parts, body) = request.into_parts();
    match Request::from_parts(parts.clone(), body).extract::<Bytes, _>().await {
        Ok(bytes) => {
            connection.mark_request_complete();
            next.run(Request::from_parts(parts, Body::from(bytes))).await
        }
        Err(rejection) => rejection.into_response(),
    }
}

/// Makes a response from a document as JSON. Serializing takes time, so call this on the thread that made the document, not on the server's thread.
pub fn json_body(status: StatusCode, document: &impl serde::Serialize) -> Response {
    match serde_json::to_vec(document) {
        Ok(bytes) => (status, [(axum::http::header::CONTENT_TYPE, "application/json")], bytes).into_response(),
        Err(error) => (StatusCode::INTERNAL_SERVER_ERROR, error.to_string()).into_response(),
    }
}

/// TCP stream that informs its [`Connection`] whenever the peer has read bytes of a response.
struct WatchedStream {
    stream: TcpStream,
    connection: Connection,
}

impl WatchedStream {
    fn tell(&self, written: Poll<std::io::Result<usize>>) -> Poll<std::io::Result<usize>> {
        if matches!(written, Poll::Ready(Ok(n)) if n > 0) {
            self.connection.has_written();
        }
        written
    }
}

impl AsyncRead for WatchedStream {
    fn poll_read(
        mut self: Pin<&mut Self>,
        cx: &mut Context<'_>,
        buffer: &mut ReadBuf<'_>,
    ) -> Poll<std::io::Result<()>> {
        Pin::new(&mut self.stream).poll_read(cx, buffer)
    }
}

impl AsyncWrite for WatchedStream {
    fn poll_write(mut self: Pin<&mut Self>, cx: &mut Context<'_>, bytes: &[u8]) -> Poll<std::io::Result<usize>> {
        let written = Pin::new(&mut self.stream).poll_write(cx, bytes);
        self.tell(written)
    }

    fn poll_write_vectored(
        mut self: Pin<&mut Self>,
        cx: &mut Context<'_>,
        parts: &[std::io::IoSlice<'_>],
    ) -> Poll<std::io::Result<usize>> {
        let written = Pin::new(&mut self.stream).poll_write_vectored(cx, parts);
        self.tell(written)
    }

    fn is_write_vectored(&self) -> bool {
        self.stream.is_write_vectored()
    }

    fn poll_flush(mut self: Pin<&mut Self>, cx: &mut Context<'_>) -> Poll<std::io::Result<()>> {
        Pin::new(&mut self.stream).poll_flush(cx)
    }

    fn poll_shutdown(mut self: Pin<&mut Self>, cx: &mut Context<'_>) -> Poll<std::io::Result<()>> {
        Pin::new(&mut self.stream).poll_shutdown(cx)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const A: IpAddr = IpAddr::V4(std::net::Ipv4Addr::new(10, 0, 0, 1));
    const B: IpAddr = IpAddr::V4(std::net::Ipv4Addr::new(10, 0, 0, 2));

    fn is_open(connection: &Connection) -> bool {
        lock(&connection.all.0).iter().any(|state| Arc::ptr_eq(state, &connection.state))
    }

    #[test]
    fn a_peer_gives_up_its_own_slowest_connection() {
        let all = Arc::new(Connections::default());
        let of_b = all.place_for(B).unwrap();
        of_b.give_time(Duration::ZERO);
        let of_a: Vec<Connection> = (0..MOST_OF_PEER).map(|_| all.place_for(A).unwrap()).collect();
        of_a.iter().for_each(|connection| connection.give_time(BODY));
        of_a[0].mark_request_complete();
        of_a[7].give_time(Duration::from_secs(1));
        assert!(all.place_for(A).is_some());
        let closed: Vec<usize> = (0..of_a.len()).filter(|index| !is_open(&of_a[*index])).collect();
        assert_eq!((closed, is_open(&of_b)), (vec![7], true));
    }

    #[test]
    fn requests_that_are_being_answered_keep_their_places() {
        let all = Arc::new(Connections::default());
        let of_a: Vec<Connection> = (0..MOST_OF_PEER).map(|_| all.place_for(A).unwrap()).collect();
        of_a.iter().for_each(Connection::mark_request_complete);
        assert!(all.place_for(A).is_none() && all.place_for(B).is_some() && of_a.iter().all(is_open));
        of_a[3].mark_answered();
        assert!(all.place_for(A).is_some() && !is_open(&of_a[3]));
    }

    #[test]
    fn event_streams_take_no_place_and_the_oldest_of_too_many_ends() {
        let all = Arc::new(Connections::default());
        let streams: Vec<Connection> = (0..=MOST_STREAMS).map(|_| all.place_for(A).unwrap()).collect();
        streams.iter().for_each(Connection::mark_as_stream);
        assert!(!is_open(&streams[0]) && streams[1..].iter().all(is_open));
        let of_a: Vec<Connection> = (0..MOST_OF_PEER).map(|_| all.place_for(A).unwrap()).collect();
        assert!(of_a.iter().all(is_open) && streams[1..].iter().all(is_open));
    }
}
