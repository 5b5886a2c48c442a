//! A static server for the gallery and the tests: www/ over pkg/, range requests, no compression, limited byte rates.
//!
//! `/empty` is a page with nothing in it, for tests to fill.
//! `?rate=200k` limits the rate of one response, `?cut=50000` breaks its connection after so many bytes.

use crate::shell::{Result, root};
use axum::Router;
use axum::body::{Body, Bytes};
use axum::extract::{Query, Request};
use axum::http::{HeaderValue, header};
use axum::response::{Html, Response};
use axum::routing::get;
use futures_util::{Stream, StreamExt, stream};
use serde::Deserialize;
use std::io;
use std::time::Duration;
use tower::ServiceExt;
use tower_http::services::ServeDir;

/// Slices of a second in which a limited response is sent.
const SLICES: u64 = 20;

/// "200k", "2M" or plain bytes a second.
pub fn parse_rate(text: &str) -> std::result::Result<u64, String> {
    let (digits, factor) = match text.strip_suffix(['k', 'K']) {
        Some(d) => (d, 1000),
        None => text.strip_suffix(['m', 'M']).map_or((text, 1), |d| (d, 1_000_000)),
    };
    let rate = digits.parse::<u64>().ok().and_then(|n| n.checked_mul(factor)).filter(|&r| r >= SLICES);
    rate.ok_or(format!("{text:?} is not a byte rate such as 200k or 2M"))
}

#[derive(Deserialize, Default)]
struct Limits {
    rate: Option<String>,
    cut: Option<u64>,
}

/// Serves until interrupted; prints the address first.
pub fn run(port: u16, throttle: Option<u64>) -> Result<()> {
    let runtime = tokio::runtime::Runtime::new().map_err(|e| e.to_string())?;
    runtime.block_on(async {
        let empty = || async { Html("<!doctype html><title>empty</title><body></body>") };
        let app = Router::new().route("/empty", get(empty)).fallback(move |query, request| answer(query, request, throttle));
        let listener = tokio::net::TcpListener::bind(("127.0.0.1", port)).await;
        let listener = listener.map_err(|e| format!("port {port}: {e}; choose another with --port"))?;
        let address = listener.local_addr().map_err(|e| e.to_string())?;
        println!("\nserving http://{address}/ (Ctrl-C ends)");
        let stop = async {
            // Without a signal handler there is nothing to wait for; the server is then ended from outside.
            let _ = tokio::signal::ctrl_c().await;
        };
        axum::serve(listener, app).with_graceful_shutdown(stop).await.map_err(|e| e.to_string())
    })
}

async fn answer(Query(limits): Query<Limits>, request: Request, throttle: Option<u64>) -> Response {
    let path = request.uri().path().to_string();
    let files = ServeDir::new(root().join("www")).fallback(ServeDir::new(root().join("pkg")));
    let mut response = match files.oneshot(request).await {
        Ok(response) => response.map(Body::new),
        Err(never) => match never {},
    };
    let headers = response.headers_mut();
    headers.insert(header::CACHE_CONTROL, HeaderValue::from_static("no-cache"));
    let is_stream =
        [".pmesh", ".lod", ".gz", ".slod", ".pits", ".pfs", ".wrl", ".x3d", ".x3dv"].iter().any(|e| path.ends_with(e));
    let rate = limits.rate.and_then(|r| parse_rate(&r).ok()).or(throttle.filter(|_| is_stream));
    if rate.is_none() && limits.cut.is_none() {
        return response;
    }
    response.map(|body| limited(body, rate, limits.cut))
}

fn limited(body: Body, rate: Option<u64>, cut: Option<u64>) -> Body {
    let step = rate.map_or(64 * 1024, |r| (r / SLICES).max(1)) as usize;
    let pieces = body.into_data_stream().map(|r| r.map_err(io::Error::other)).flat_map(move |chunk| match chunk {
        Ok(bytes) => stream::iter(split(bytes, step).into_iter().map(Ok).collect::<Vec<_>>()),
        Err(e) => stream::iter(vec![Err(e)]),
    });
    Body::from_stream(paced(Box::pin(pieces), rate.is_some(), cut))
}

fn split(mut bytes: Bytes, step: usize) -> Vec<Bytes> {
    let mut pieces = Vec::new();
    while bytes.len() > step {
        pieces.push(bytes.split_to(step));
    }
    pieces.push(bytes);
    pieces
}

type Piece = io::Result<Bytes>;

fn paced(pieces: impl Stream<Item = Piece> + Unpin, wait: bool, cut: Option<u64>) -> impl Stream<Item = Piece> {
    stream::unfold((pieces, cut), move |(mut pieces, left)| async move {
        if left == Some(0) {
            return Some((Err(io::Error::other("cut as asked for")), (pieces, Some(0))));
        }
        let mut piece = pieces.next().await?;
        if wait {
            tokio::time::sleep(Duration::from_millis(1000 / SLICES)).await;
        }
        let mut after = left;
        if let (Some(left), Ok(bytes)) = (left, &mut piece) {
            bytes.truncate(left as usize);
            after = Some(left - bytes.len() as u64);
        }
        Some((piece, (pieces, after)))
    })
}
