//! Ctrl-C, and being asked to end: nothing half-written is left behind.
//!
//! As a rule a signal ends the program at once. While a file is in the making it is only noted: the work looks for it all the time
//! ([`is_asked`]), stops, and removes what it has written. Whoever cannot wait asks a second time.

use std::io::{IsTerminal, Write};
use std::sync::atomic::{AtomicU8, Ordering};
use zmend::{Error, Result};

/// The exit code of programs that were interrupted: 128 and the number of the signal.
pub(crate) const EXIT_CODE: u8 = 130;

/// What a signal does.
const ENDS: u8 = 0;
/// It is noted.
const IS_NOTED: u8 = 1;
/// It was noted; another one ends the program.
const WAS_NOTED: u8 = 2;

static STATE: AtomicU8 = AtomicU8::new(ENDS);

/// From now on signals are handled. Without it, or if the system refuses, they end the program as they always do.
pub(crate) fn listen() {
    let handler = || {
        if STATE.compare_exchange(IS_NOTED, WAS_NOTED, Ordering::SeqCst, Ordering::SeqCst).is_err() {
            end();
        }
    };
    // Files may be left behind then, which is no reason not to work.
    let _ = ctrlc::set_handler(handler);
}

/// Ends the program with a clean line on the terminal.
fn end() -> ! {
    let mut stderr = std::io::stderr();
    if stderr.is_terminal() {
        let _ = stderr.write_all(b"\r\x1b[2K\x1b[?25h");
    }
    std::process::exit(i32::from(EXIT_CODE))
}

/// Whether a signal was noted: what is running should stop.
pub(crate) fn is_asked() -> bool {
    STATE.load(Ordering::Relaxed) == WAS_NOTED
}

/// Does work that makes a file. A signal meanwhile is noted for it, and ends the program afterwards.
///
/// # Errors
/// Those of the work, and `Cancelled` after a signal.
pub(crate) fn noted<T>(work: impl FnOnce() -> Result<T>) -> Result<T> {
    STATE.store(IS_NOTED, Ordering::SeqCst);
    let result = work();
    let state = STATE.swap(ENDS, Ordering::SeqCst);
    if state == WAS_NOTED { Err(Error::Cancelled) } else { result }
}
