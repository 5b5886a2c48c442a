//! What `/metrics` tells, in Prometheus' text format.

use prometheus_client::encoding::text::encode;
use prometheus_client::metrics::counter::Counter;
use prometheus_client::metrics::gauge::Gauge;
use prometheus_client::registry::Registry;

pub(crate) struct Metrics {
    registry: Registry,
    pub(crate) sessions: Gauge,
    pub(crate) opened: Counter,
    pub(crate) refused: Counter,
    pub(crate) failed: Counter,
    pub(crate) bytes_up: Counter,
    pub(crate) bytes_down: Counter,
    pub(crate) splits: Counter,
}

impl Default for Metrics {
    fn default() -> Self {
        let mut registry = Registry::with_prefix("pmesh");
        let sessions = Gauge::default();
        registry.register("sessions", "Sessions that are open", sessions.clone());
        let mut counter = |name: &str, help: &str| {
            let counter = Counter::default();
            registry.register(name, help, counter.clone());
            counter
        };
        Self {
            opened: counter("sessions_opened", "Sessions so far"),
            refused: counter("sessions_refused", "Sessions that found no place, or came from a page that may not"),
            failed: counter("sessions_failed", "Sessions that ended by an error"),
            bytes_up: counter("received_bytes", "Bytes of clients' messages"),
            bytes_down: counter("sent_bytes", "Bytes of messages to clients"),
            splits: counter("splits", "Splits sent"),
            sessions,
            registry,
        }
    }
}

impl Metrics {
    pub(crate) fn text(&self) -> String {
        let mut out = String::new();
        // Writing to a string does not fail.
        let _ = encode(&mut out, &self.registry);
        out
    }
}
