//! What memory there is, and what is taken of it, where the system tells.

use crate::units;
use zmend::{Error, Result};

/// Bytes that a repair may hold: what was asked for without what the program holds already, or else all that is free. `None` where
/// the system does not tell.
///
/// # Errors
/// When the program with its input holds more already.
pub(crate) fn limit(asked: Option<u64>) -> Result<Option<u64>> {
    let Some(asked) = asked else { return Ok(free()) };
    let held = status("VmRSS:").unwrap_or(0) + BESIDE;
    if held < asked {
        return Ok(Some(asked - held));
    }
    let problem = format!("{} are too few: the input and the program take {}", units::bytes(asked), units::bytes(held));
    Err(Error::setting("max-memory", problem, "allow more"))
}

/// Bytes beside what a repair counts: batches of triangles, pieces of meshes, tables of all threads.
const BESIDE: u64 = 9_000_000;

/// Bytes that the system would give: what is free of its memory, or of what it lets this process have.
fn free() -> Option<u64> {
    let available = field(&std::fs::read_to_string("/proc/meminfo").ok()?, "MemAvailable:")?;
    let limits = std::fs::read_to_string("/proc/self/limits").unwrap_or_default();
    let address_space =
        limits.lines().find_map(|line| line.strip_prefix("Max address space")?.split_whitespace().next());
    let addresses: Option<u64> = address_space.and_then(|bytes| bytes.parse().ok());
    Some(match addresses {
        Some(all) => available.min(all.saturating_sub(status("VmSize:").unwrap_or(0))),
        None => available,
    })
}

/// The most memory that this process has held at once.
pub(crate) fn peak() -> Option<u64> {
    status("VmHWM:")
}

fn status(name: &str) -> Option<u64> {
    field(&std::fs::read_to_string("/proc/self/status").ok()?, name)
}

/// A line such as `VmRSS:  123 kB`, in bytes.
fn field(text: &str, name: &str) -> Option<u64> {
    let line = text.lines().find_map(|line| line.strip_prefix(name))?;
    let kibibytes: u64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    kibibytes.checked_mul(1024)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fields_are_read() {
        let text = "Name: zmend\nVmRSS:\t    1234 kB\nVmBad: many kB\n";
        assert_eq!(field(text, "VmRSS:"), Some(1234 * 1024));
        assert_eq!((field(text, "VmBad:"), field(text, "VmHWM:")), (None, None));
    }

    #[test]
    fn what_is_held_already_counts() {
        assert_eq!(limit(Some(1 << 60)).unwrap().map(|bytes| bytes < 1 << 60), Some(true));
        assert!(limit(Some(1000)).unwrap_err().to_string().contains("1.00 kB are too few"));
    }
}
