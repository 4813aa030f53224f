//! Progress on the terminal.

use crate::interrupt;
use indicatif::{ProgressBar, ProgressStyle};
use std::io::IsTerminal;
use std::time::Duration;
use zmend::progress::{Progress, Stage};

/// A line on standard error that shows how far the running stage is. Without a terminal it shows nothing.
pub(crate) struct Bars {
    bar: ProgressBar,
}

impl Bars {
    /// Shows nothing yet, and never anything when not `visible`.
    pub(crate) fn new(visible: bool) -> Self {
        if !(visible && std::io::stderr().is_terminal()) {
            return Bars { bar: ProgressBar::hidden() };
        }
        let bar = ProgressBar::no_length();
        // The bar moves although a stage says nothing for a while.
        bar.enable_steady_tick(Duration::from_millis(100));
        Bars { bar }
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
