//! A response body into a [`Model`], in slices that never hold the page up; and resuming by range request.
//!
//! gloo-net makes the requests and reads the responses. Time is read here, not in the codec.

use crate::error::{decode_error, error};
use crate::model::{Model, ModelEvents};
use gloo_net::http::{Request, Response};
use js_sys::{Array, Function, Promise, Reflect, Uint8Array};
use wasm_bindgen::prelude::*;
use wasm_bindgen_futures::JsFuture;

/// Bytes decoded between two looks at the clock: a fraction of a millisecond's work.
const SLICE_BYTES: usize = 2048;
/// Milliseconds of decoding before the page gets its turn; the limit is 8.
const SLICE_MS: f64 = 3.0;

#[wasm_bindgen]
impl Model {
    /// Reads a response to its end. `on_events` is called with what arrived, and with an empty list as bytes come. If the server ignored a range
    /// request (status 200), bytes that are here already are skipped. Aborting `signal` stops it at once. Rejects with an `Error` whose `code` is
    /// `http`, `network`, `aborted` or a decoder's.
    pub async fn stream(
        &self,
        response: web_sys::Response,
        signal: Option<web_sys::AbortSignal>,
        on_events: &Function,
    ) -> Result<(), JsValue> {
        let have = self.state.borrow().bytes();
        self.read(Response::from(response), Part { have, last: true }, signal.as_ref(), on_events).await
    }

    /// Reads the response of one of several files that make up a stream one after the other. `have` bytes of this file are
    /// here already; `last` says that the stream ends with it.
    #[wasm_bindgen(js_name = streamPart)]
    pub async fn stream_part(
        &self,
        response: web_sys::Response,
        have: f64,
        last: bool,
        signal: Option<web_sys::AbortSignal>,
        on_events: &Function,
    ) -> Result<(), JsValue> {
        let part = Part { have: have.max(0.0) as u64, last };
        self.read(Response::from(response), part, signal.as_ref(), on_events).await
    }

    /// Requests what is still missing of `url`, from `bytes` on, and reads it as `stream` does. A single range needs no
    /// CORS preflight.
    pub async fn resume(&self, url: &str, signal: Option<web_sys::AbortSignal>, on_events: &Function) -> Result<(), JsValue> {
        let from = self.state.borrow().bytes();
        if self.state.borrow().is_whole() {
            // Stopped after the last byte: nothing is left to ask for.
            return self.end(on_events);
        }
        let mut request = Request::get(url).abort_signal(signal.as_ref());
        if from > 0 {
            request = request.header("Range", &format!("bytes={from}-"));
        }
        let response = request.send().await.map_err(|e| request_error(&e, signal.as_ref()))?;
        if from > 0 && response.status() == 416 {
            // The server has no more than is here: whole, or cut short, as the decoder will say.
            return self.end(on_events);
        }
        self.read(response, Part { have: from, last: true }, signal.as_ref(), on_events).await
    }

    async fn read(
        &self,
        response: Response,
        part: Part,
        signal: Option<&web_sys::AbortSignal>,
        on_events: &Function,
    ) -> Result<(), JsValue> {
        let mut skip = self.check(&response, part.have)?;
        let body = response.body().ok_or_else(|| error("http", "the response has no body"))?;
        let reader: web_sys::ReadableStreamDefaultReader = body.get_reader().unchecked_into();
        let mut clock = Clock::start();
        loop {
            let result = JsFuture::from(reader.read()).await.map_err(read_error)?;
            clock = Clock::start_after(clock);
            if Reflect::get(&result, &"done".into())?.is_truthy() {
                break;
            }
            let chunk: Uint8Array = Reflect::get(&result, &"value".into())?.unchecked_into();
            let bytes = chunk.to_vec();
            let skipped = skip.min(bytes.len() as u64);
            skip -= skipped;
            for slice in bytes[skipped as usize..].chunks(SLICE_BYTES) {
                // What is already here of an aborted download is not decoded: the page has stopped listening.
                if signal.is_some_and(|s| s.aborted()) {
                    return Err(aborted());
                }
                if let Err(e) = self.slice(slice, on_events) {
                    // Let the connection go; whatever that says, the decoder's error is the news.
                    let _ = reader.cancel();
                    return Err(e);
                }
                clock.pause_if_due().await?;
                while self.work(on_events).inspect_err(|_| drop(reader.cancel()))? {
                    if signal.is_some_and(|s| s.aborted()) {
                        return Err(aborted());
                    }
                    clock.pause_if_due().await?;
                }
            }
            self.tell(on_events)?;
        }
        // A connection that breaks is an error of the reader; this is the end of what the server has.
        if part.last { self.end(on_events) } else { Ok(()) }
    }

    fn end(&self, on_events: &Function) -> Result<(), JsValue> {
        let finished = self.state.borrow_mut().finish();
        self.tell(on_events)?;
        finished.map_err(|e| decode_error(&e))
    }

    /// How many bytes of the body to skip.
    fn check(&self, response: &Response, have: u64) -> Result<u64, JsValue> {
        match response.status() {
            206 => {
                let range = response.headers().get("content-range").unwrap_or_default();
                let total = range.rsplit('/').next().and_then(|t| t.parse::<u64>().ok());
                if have == self.state.borrow().bytes()
                    && total.is_some_and(|t| self.state.borrow().total_bytes().is_some_and(|known| known != t))
                {
                    return Err(error("http", "the file has changed on the server since its first part was read: load it again"));
                }
                let start = range.strip_prefix("bytes ").and_then(|r| r.split('-').next()?.parse::<u64>().ok());
                // Across origins the header may be hidden; the checksums tell then.
                match start {
                    Some(start) if start != have => {
                        Err(error("http", &format!("bytes from {have} were asked for, the server sent bytes from {start}")))
                    }
                    _ => Ok(0),
                }
            }
            200..=299 => Ok(have),
            status => {
                let text = response.status_text();
                Err(error("http", &format!("the server answered {status} {text}")))
            }
        }
    }

    fn slice(&self, bytes: &[u8], on_events: &Function) -> Result<(), JsValue> {
        let pushed = self.state.borrow_mut().feed(bytes);
        self.tell_news(on_events)?;
        pushed.map_err(|e| decode_error(&e))
    }
    /// A piece of the work that is left; false if none is.
    fn work(&self, on_events: &Function) -> Result<bool, JsValue> {
        let worked = self.state.borrow_mut().work();
        self.tell_news(on_events)?;
        worked.map_err(|e| decode_error(&e))
    }

    /// Calls the page if something has arrived.
    fn tell_news(&self, on_events: &Function) -> Result<(), JsValue> {
        let events: Array = self.state.borrow_mut().events().into_iter().collect();
        if events.length() > 0 {
            on_events.call1(&JsValue::NULL, &events)?;
        }
        Ok(())
    }

    /// Calls the page with what has arrived, which may be no event but bytes; nothing is borrowed meanwhile.
    fn tell(&self, on_events: &Function) -> Result<(), JsValue> {
        let events: ModelEvents = self.take_events();
        on_events.call1(&JsValue::NULL, &events)?;
        Ok(())
    }
}

/// Of which file a response is.
struct Part {
    /// Bytes of it that are here.
    have: u64,
    /// The stream ends with it.
    last: bool,
}

fn aborted() -> JsValue {
    error("aborted", "the request was aborted")
}

fn request_error(e: &gloo_net::Error, signal: Option<&web_sys::AbortSignal>) -> JsValue {
    if signal.is_some_and(|s| s.aborted()) {
        return aborted();
    }
    error("network", &format!("the request failed ({e}): the server is away, or does not allow this page (CORS)"))
}

fn read_error(e: JsValue) -> JsValue {
    let name = Reflect::get(&e, &"name".into()).ok().and_then(|n| n.as_string()).unwrap_or_default();
    if name == "AbortError" {
        return aborted();
    }
    let message = Reflect::get(&e, &"message".into()).ok().and_then(|m| m.as_string()).unwrap_or_default();
    error("network", &format!("the connection broke ({message})"))
}

/// Gives the page its turn once a slice's time is used up.
struct Clock {
    started: f64,
}

impl Clock {
    fn start() -> Self {
        Self { started: now() }
    }
    /// After waiting for the network the time used before it still counts if it was a moment ago: many small chunks in a
    /// row are one long task otherwise.
    fn start_after(before: Self) -> Self {
        if now() - before.started > 2.0 * SLICE_MS { Self::start() } else { before }
    }
    async fn pause_if_due(&mut self) -> Result<(), JsValue> {
        if now() - self.started > SLICE_MS {
            JsFuture::from(next_task()).await?;
            *self = Self::start();
        }
        Ok(())
    }
}

/// `performance.now()`, in pages and workers.
pub(crate) fn now() -> f64 {
    let performance = Reflect::get(&js_sys::global(), &"performance".into()).ok();
    performance.map_or_else(js_sys::Date::now, |p| p.unchecked_into::<web_sys::Performance>().now())
}

/// Resolves in a task of its own: a message to ourselves is not slowed down as timers are.
fn next_task() -> Promise {
    Promise::new(&mut |resolve, reject| {
        let posted = web_sys::MessageChannel::new().and_then(|channel| {
            channel.port1().set_onmessage(Some(&resolve));
            channel.port2().post_message(&JsValue::NULL)
        });
        if let Err(e) = posted {
            // The promise's own function; if even that throws there is no one left to tell.
            let _ = reject.call1(&JsValue::NULL, &e);
        }
    })
}
