//! Numbers as people read them.

use glam::DVec3;

/// A count with thousands apart: `1,234,567`.
pub(crate) fn count(n: u64) -> String {
    let digits = n.to_string();
    let groups: Vec<&str> = digits.as_bytes().rchunks(3).rev().filter_map(|g| std::str::from_utf8(g).ok()).collect();
    groups.join(",")
}

/// A count that may be negative.
pub(crate) fn signed(n: i64) -> String {
    format!("{}{}", if n < 0 { "-" } else { "" }, count(n.unsigned_abs()))
}

/// A count and what is counted, one or many.
pub(crate) fn counted(n: u64, one: &str, many: &str) -> String {
    format!("{} {}", count(n), if n == 1 { one } else { many })
}

/// A size in bytes.
pub(crate) fn bytes(n: u64) -> String {
    const UNITS: [&str; 5] = ["kB", "MB", "GB", "TB", "PB"];
    if n < 1000 {
        return format!("{n} B");
    }
    let mut size = n as f64 / 1000.0;
    let mut unit = 0;
    while size >= 999.5 && unit + 1 < UNITS.len() {
        size /= 1000.0;
        unit += 1;
    }
    let decimals = if size < 9.995 { 2 } else { usize::from(size < 99.95) };
    format!("{size:.decimals$} {}", UNITS[unit])
}

/// A measured number with six digits.
pub(crate) fn real(x: f64) -> String {
    let magnitude = x.abs();
    if x == 0.0 {
        "0".to_owned()
    } else if (1e-4..1e9).contains(&magnitude) {
        let decimals = (5 - magnitude.log10().floor() as i64).max(0) as usize;
        let text = format!("{x:.decimals$}");
        if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
    } else {
        format!("{x:.5e}")
    }
}

/// A point or a vector.
pub(crate) fn vector(v: DVec3) -> String {
    v.to_array().map(real).join(" ")
}

/// A time, given in seconds.
pub(crate) fn time(s: f64) -> String {
    match s {
        ..0.000_5 => "0 ms".to_owned(),
        ..0.099_5 => format!("{:.0} ms", 1000.0 * s),
        ..9.995 => format!("{s:.2} s"),
        _ => format!("{s:.1} s"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_read_well() {
        assert_eq!([0, 7, 999, 1000, 1_234_567].map(count), ["0", "7", "999", "1,000", "1,234,567"]);
        assert_eq!(signed(-1234), "-1,234");
        assert_eq!([0, 1, 1000].map(|n| counted(n, "hole", "holes")), ["0 holes", "1 hole", "1,000 holes"]);
        assert_eq!(
            [999, 1000, 9_996, 99_960, 999_400, 999_600, 12_345_678].map(bytes),
            ["999 B", "1.00 kB", "10.0 kB", "100 kB", "999 kB", "1.00 MB", "12.3 MB"]
        );
        assert_eq!(bytes(u64::MAX), "18447 PB");
        assert_eq!(
            [0.0, 1.0, -2.5, 1234.5678, 123_456_789.0, 0.001_234_567, 1e-7, 1e12, f64::NAN].map(real),
            ["0", "1", "-2.5", "1234.57", "123456789", "0.00123457", "1.00000e-7", "1.00000e12", "NaN"]
        );
        assert_eq!([0.0004, 0.0042, 0.0994].map(time), ["0 ms", "4 ms", "99 ms"]);
        assert_eq!([0.0996, 9.994, 9.996, 75.0].map(time), ["0.10 s", "9.99 s", "10.0 s", "75.0 s"]);
        assert_eq!(vector(DVec3::new(1.0, -0.5, 0.0)), "1 -0.5 0");
    }
}
