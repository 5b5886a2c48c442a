//! A bar for whatever takes over a second.

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

/// A bar from 0 to 1 000; hidden if `quiet`, and until a second has gone.
pub struct Progress(ProgressBar);

impl Progress {
    pub fn new(what: &str, quiet: bool) -> Self {
        let bar = ProgressBar::with_draw_target(Some(1000), ProgressDrawTarget::hidden());
        bar.set_message(what.to_string());
        if let Ok(style) = ProgressStyle::with_template("{msg} {bar:32} {percent}% ({eta} left)") {
            bar.set_style(style);
        }
        if quiet { Self(ProgressBar::hidden()) } else { Self(bar) }
    }
    /// `part` of the work is done, 0 to 1.
    pub fn set(&self, part: f64) {
        if self.0.is_hidden() && self.0.elapsed().as_secs_f64() > 1.0 && !self.0.message().is_empty() {
            self.0.set_draw_target(ProgressDrawTarget::stderr());
        }
        self.0.set_position((part * 1000.0) as u64);
    }
    pub fn done(self) {
        self.0.finish_and_clear();
    }
}
