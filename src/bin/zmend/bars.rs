//! Progress on the terminal.

use crate::interrupt;
use indicatif::{ProgressBar, ProgressStyle};
use std::io::IsTerminal;
use std::time::Duration;
use zmend::progress::{Progress, Stage};
use zmend::{Error, Result};

/// A line on standard error that shows how far the running stage is. Without a terminal it shows nothing.
pub(crate) struct Bars {
    bar: ProgressBar,
    /// Bytes that the work may hold, if that is for this to say.
    limit: Option<u64>,
}

impl Bars {
    /// Shows nothing yet, and never anything when not `visible`.
    pub(crate) fn new(visible: bool) -> Self {
        if !(visible && std::io::stderr().is_terminal()) {
            return Bars { bar: ProgressBar::hidden(), limit: None };
        }
        let bar = ProgressBar::no_length();
        // The bar moves although a stage says nothing for a while.
        bar.enable_steady_tick(Duration::from_millis(100));
        Bars { bar, limit: None }
    }

    /// Refuses work that holds more bytes than these.
    pub(crate) fn within(self, limit: Option<u64>) -> Self {
        let mut bars = self;
        bars.limit = limit;
        bars
    }

    /// Begins a line for a piece of work; `total` is 0 when it is not known how much there is.
    pub(crate) fn start(&self, name: &'static str, total: u64) {
        if self.bar.is_hidden() {
            return;
        }
        let template = if total == 0 {
            "{msg:>8} {spinner} {elapsed_precise}"
        } else {
            "{msg:>8} [{bar:40}] {percent:>3} % {elapsed_precise}"
        };
        self.bar.reset();
        self.bar.set_style(ProgressStyle::with_template(template).expect("a template that was tried"));
        self.bar.set_length(total);
        self.bar.set_message(name);
    }

    /// Takes the line away.
    pub(crate) fn clear(&self) {
        self.bar.finish_and_clear();
    }
}

impl Progress for Bars {
    fn begin(&self, stage: Stage, total: u64) {
        self.start(stage.name(), total);
    }

    fn advance(&self, amount: u64) {
        self.bar.inc(amount);
    }

    fn hold(&self, bytes: u64) -> Result<()> {
        match self.limit {
            Some(limit) if bytes > limit => {
                let remedy = "crop the volume, or sample it anew with larger cells: --cell".to_owned();
                Err(Error::Memory { needed: bytes, limit, remedy })
            }
            _ => Ok(()),
        }
    }

    fn is_cancelled(&self) -> bool {
        interrupt::is_asked()
    }
}

/// However the work ends, the terminal is left clean.
impl Drop for Bars {
    fn drop(&mut self) {
        self.clear();
    }
}
