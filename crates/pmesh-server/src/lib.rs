//! Files of a folder, and view-dependent streams of the models among them: `pmesh serve` without its command line.
//!
//! Any path answers with the file; a WebSocket on any path speaks the protocol of docs/PROTOCOL.md, whose hello names the model. Models are prepared when they are first
//! asked for, and kept. A session holds some tens of kilobytes. Servers share nothing: behind a load balancer any of them can go on with any client.

mod metrics;
mod models;
mod session;

pub use models::model_of;

use axum::Router;
use axum::body::Body;
use axum::extract::ws::WebSocketUpgrade;
use axum::extract::ws::rejection::WebSocketUpgradeRejection;
use axum::extract::{Request, State};
use axum::http::{HeaderMap, HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use axum::routing::get;
use metrics::Metrics;
use models::Models;
use std::future::Future;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;
use tokio::net::TcpListener;
use tokio::sync::{Semaphore, watch};
use tower_http::services::ServeDir;

/// What to serve, and how much of it.
#[derive(Clone, Debug)]
pub struct Config {
    /// The folder.
    pub folder: PathBuf,
    /// Bits a coordinate that views get, 8 to 16.
    pub bits: u8,
    /// Most sessions at a time.
    pub sessions: usize,
    /// Bytes a second that a session is sent; `None`: as fast as it goes.
    pub rate: Option<u64>,
    /// Largest message of a client, bytes.
    pub message: usize,
    /// How long a session may say nothing, and how long it may take a message.
    pub idle: Duration,
    /// Origins of pages that may open sessions, beside this server's own; `*`: any.
    pub origins: Vec<String>,
}

struct Shared {
    config: Config,
    models: Models,
    metrics: Metrics,
    places: Arc<Semaphore>,
    closing: watch::Receiver<bool>,
    files: ServeDir,
}

/// Serves until `stop` comes: then no new connection is taken, and sessions are told to connect elsewhere. Errors: those of the listener.
pub async fn serve(
    config: Config,
    listener: TcpListener,
    stop: impl Future<Output = ()> + Send + 'static,
) -> std::io::Result<()> {
    let (close, closing) = watch::channel(false);
    let shared = Arc::new(Shared {
        models: Models::new(&config),
        metrics: Metrics::default(),
        places: Arc::new(Semaphore::new(config.sessions)),
        closing,
        files: ServeDir::new(&config.folder),
        config,
    });
    let places = shared.places.clone();
    let all = u32::try_from(shared.config.sessions).unwrap_or(u32::MAX);
    let app = Router::new()
        .route("/health", get(|| async { "well\n" }))
        .route("/metrics", get(|State(s): State<Arc<Shared>>| async move { s.metrics.text() }))
        .fallback(anything)
        .with_state(shared);
    let stopped = async move {
        stop.await;
        tracing::info!("closing");
        // Nobody listening is no harm.
        let _ = close.send(true);
        // Sessions give their places back; those that do not in time are cut off.
        let _ = tokio::time::timeout(Duration::from_secs(5), places.acquire_many(all)).await;
    };
    axum::serve(listener, app).with_graceful_shutdown(stopped).await
}

/// A session, where one is asked for; else a file.
async fn anything(
    State(shared): State<Arc<Shared>>,
    headers: HeaderMap,
    upgrade: Result<WebSocketUpgrade, WebSocketUpgradeRejection>,
    request: Request,
) -> Response {
    let Ok(upgrade) = upgrade else { return file(&shared, request).await };
    if !may_open(&headers, &shared.config.origins) {
        shared.metrics.refused.inc();
        let origin = headers.get(header::ORIGIN).and_then(|o| o.to_str().ok()).unwrap_or_default();
        tracing::warn!(origin, "a page of another origin was refused a session: --origin allows it");
        return (StatusCode::FORBIDDEN, "pages of this origin may not open sessions; --origin allows it\n").into_response();
    }
    let Ok(place) = shared.places.clone().try_acquire_owned() else {
        shared.metrics.refused.inc();
        return (StatusCode::SERVICE_UNAVAILABLE, [(header::RETRY_AFTER, "5")], "all sessions are taken; try again\n")
            .into_response();
    };
    let limit = shared.config.message;
    upgrade.max_message_size(limit).max_frame_size(limit).on_upgrade(move |socket| async move {
        session::run(socket, &shared).await;
        drop(place);
    })
}

async fn file(shared: &Shared, mut request: Request<Body>) -> Response {
    // Pages elsewhere are told, too.
    let none =
        || (StatusCode::NOT_FOUND, [(header::ACCESS_CONTROL_ALLOW_ORIGIN, "*")], "there is no such file here\n").into_response();
    if request.uri().path().split('/').any(|part| part.starts_with('.') || part.starts_with("%2e") || part.starts_with("%2E")) {
        return none();
    }
    let mut files = shared.files.clone();
    // A part of what has changed since is no use: then the whole comes.
    if let Some(known) = request.headers_mut().remove(header::IF_RANGE) {
        let mut ask = Request::head(request.uri().clone());
        if let Some(headers) = ask.headers_mut() {
            headers.insert(header::ACCEPT, HeaderValue::from_static("*/*"));
        }
        let now = match ask.body(Body::empty()) {
            Ok(head) => files.try_call(head).await.ok(),
            Err(_) => None,
        };
        let is = |name| now.as_ref().and_then(|n| n.headers().get(name)) == Some(&known);
        if !is(header::ETAG) && !is(header::LAST_MODIFIED) {
            request.headers_mut().remove(header::RANGE);
        }
    }
    match files.try_call(request).await {
        Ok(response) => {
            let mut response = response.map(Body::new);
            let whole_or_part = response.status().is_success() || response.status() == StatusCode::NOT_MODIFIED;
            let mut set = |name, value| response.headers_mut().insert(name, HeaderValue::from_static(value));
            // Pages elsewhere may show what is here, and go on where they stopped.
            set(header::ACCESS_CONTROL_ALLOW_ORIGIN, "*");
            set(header::ACCESS_CONTROL_EXPOSE_HEADERS, "content-length, content-range");
            if whole_or_part {
                set(header::CACHE_CONTROL, "public, max-age=60, stale-while-revalidate=3600");
            }
            response
        }
        Err(e) => {
            tracing::debug!(%e, "a file is not read");
            match e.kind() {
                std::io::ErrorKind::NotFound | std::io::ErrorKind::PermissionDenied | std::io::ErrorKind::NotADirectory => none(),
                _ => (StatusCode::INTERNAL_SERVER_ERROR, format!("the file cannot be read: {e}\n")).into_response(),
            }
        }
    }
}

/// True if no page asks, or one of this host or of `allowed`.
fn may_open(headers: &HeaderMap, allowed: &[String]) -> bool {
    let text = |name| headers.get(name).and_then(|v| v.to_str().ok());
    let Some(origin) = text(header::ORIGIN) else { return !headers.contains_key(header::ORIGIN) };
    let own = origin.split_once("://").map(|o| o.1);
    own.is_some() && own == text(header::HOST) || allowed.iter().any(|a| a == "*" || a == origin)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pages_of_other_origins_open_no_sessions() {
        let headers = |origin: &[u8]| {
            let mut headers = HeaderMap::new();
            headers.insert(header::HOST, HeaderValue::from_static("here:80"));
            headers.insert(header::ORIGIN, HeaderValue::from_bytes(origin).expect("a value"));
            headers
        };
        assert!(may_open(&HeaderMap::new(), &[]));
        assert!(may_open(&headers(b"https://here:80"), &[]));
        assert!(!may_open(&headers(b"https://there"), &[]));
        assert!(!may_open(&headers(b"null"), &[]) && !may_open(&headers(b"\xff"), &[]));
        assert!(may_open(&headers(b"https://there"), &["https://there".into()]));
        assert!(may_open(&headers(b"https://there"), &["*".into()]));
    }
}
