//! One client: its messages in, the session's out.

use crate::Shared;
use axum::body::Bytes;
use axum::extract::ws::{Message, WebSocket};
use pmesh_view::Session;
use pmesh_view::message::{Reply, Request, read_request, reply};
use std::time::Duration;
use tokio::time::{sleep, timeout};

/// Splits of a packet, and nodes looked at, before others have their turn: about a millisecond.
const SPLITS: u32 = 1_000;
const LOOKS: u32 = 20_000;
/// Bytes of a split, about; and the part of a second that a packet takes at most where the rate is limited.
const SPLIT_BYTES: u64 = 10;
const PACKETS_A_SECOND: u64 = 4;

/// Why a session ends, beside a goodbye.
enum End {
    /// The client is told.
    Told(String),
    /// The client is told, and that it need not come back.
    Refused(String),
    /// It is gone.
    Gone,
}

pub(crate) async fn run(mut socket: WebSocket, shared: &Shared) {
    shared.metrics.sessions.inc();
    shared.metrics.opened.inc();
    let end = talk(&mut socket, shared).await;
    shared.metrics.sessions.dec();
    let said = match end {
        Err(End::Told(why)) => Some((reply(&Reply::Error(why.clone())), why)),
        Err(End::Refused(why)) => Some((reply(&Reply::Refused(why.clone())), why)),
        _ => None,
    };
    if let Some((message, why)) = said {
        shared.metrics.failed.inc();
        tracing::info!(why, "a session ends");
        // It may not hear that any more.
        let error = Message::Binary(message.into());
        let _ = timeout(shared.config.idle, socket.send(error)).await;
        let _ = timeout(shared.config.idle, socket.send(Message::Close(None))).await;
    }
}

async fn talk(socket: &mut WebSocket, shared: &Shared) -> Result<(), End> {
    let mut closing = shared.closing.clone();
    let told = |e: pmesh_view::ProtocolError| End::Told(e.to_string());
    let (first, request) = loop {
        let Some(first) = next(socket, shared).await? else { return Ok(()) };
        match read_request(&first).map_err(told)? {
            Request::Catalogue => {
                let names = shared.models.names().await.map_err(End::Told)?;
                send(socket, shared, reply(&Reply::Catalogue(names))).await?;
            }
            request => break (first, request),
        }
    };
    let Some(name) = request.model() else { return Err(End::Told("a session begins with a hello".into())) };
    let model = shared.models.get(name).await.map_err(End::Told)?;
    let mut session = Session::begin(request, first.len(), model).map_err(|e| End::Refused(e.to_string()))?;
    let mut before = session.counts();
    shared.metrics.bytes_up.inc_by(before.bytes_up);
    let slowly = |rate: u64| (rate / (SPLIT_BYTES * PACKETS_A_SECOND)).clamp(16, SPLITS.into()) as u32;
    let most = shared.config.rate.map_or(SPLITS, slowly);
    loop {
        let message = tokio::select! {
            biased;
            _ = closing.wait_for(|&c| c) => return Err(End::Told("the server is going down; connect again".into())),
            message = next(socket, shared) => Some(message?),
            // What there is to do waits for no message.
            () = std::future::ready(()), if !session.is_idle() => None,
        };
        match message {
            Some(None) => return Ok(()),
            Some(Some(message)) => {
                if !session.receive(&message).map_err(told)? {
                    return Ok(());
                }
            }
            None => {
                if let Some(message) = session.work(most, LOOKS) {
                    send(socket, shared, message).await?;
                }
                if session.is_over() {
                    return Ok(());
                }
                tokio::task::yield_now().await;
            }
        }
        let now = session.counts();
        shared.metrics.bytes_up.inc_by(now.bytes_up - before.bytes_up);
        shared.metrics.bytes_down.inc_by(now.bytes_down - before.bytes_down);
        shared.metrics.splits.inc_by(now.splits - before.splits);
        before = now;
    }
}

/// The client's next message; `None` if it has gone.
async fn next(socket: &mut WebSocket, shared: &Shared) -> Result<Option<Bytes>, End> {
    loop {
        match timeout(shared.config.idle, socket.recv()).await {
            Err(_) => return Err(End::Told("nothing was heard for too long; connect again".into())),
            Ok(None | Some(Ok(Message::Close(_)))) => return Ok(None),
            Ok(Some(Err(e))) => {
                tracing::debug!(%e, "a connection broke");
                return Ok(None);
            }
            Ok(Some(Ok(Message::Binary(bytes)))) => return Ok(Some(bytes)),
            Ok(Some(Ok(Message::Text(_)))) => return Err(End::Told("messages are binary".into())),
            // Pings are answered below us.
            Ok(Some(Ok(_))) => {}
        }
    }
}

/// Sends; a client that takes too long for it is let go, so that what waits for it stays small.
async fn send(socket: &mut WebSocket, shared: &Shared, message: Vec<u8>) -> Result<(), End> {
    let pause = shared.config.rate.map(|rate| Duration::from_secs_f64(message.len() as f64 / rate.max(1) as f64));
    match timeout(shared.config.idle, socket.send(Message::Binary(message.into()))).await {
        Ok(Ok(())) => {}
        _ => return Err(End::Gone),
    }
    if let Some(pause) = pause {
        sleep(pause.min(shared.config.idle)).await;
    }
    Ok(())
}
