//! Decimal numbers in text: correctly rounded, fast where that is provably exact, lenient where exporters were.

/// The powers of ten that a double holds exactly.
const POWERS: [f64; 23] = [
    1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15, 1e16, 1e17, 1e18, 1e19, 1e20,
    1e21, 1e22,
];

/// Integers up to here are doubles, so that one multiplication or division by an exact power of ten rounds only once.
const EXACT_INTEGER: u64 = 1 << 53;

/// The number at the start of `bytes` and its length in bytes, or `None` when there is none.
///
/// Beyond what [`str::parse`] takes, the exponent letter may be `d` (Fortran) and may follow its sign (`3.1+e2`), and
/// `nan(ind)`, `1.#INF`, `-1.#IND` (C runtimes of Windows) are read as what they mean.
///
/// Clinger 1990, "How to read floating point numbers accurately", his fast case; everything else goes to the standard
/// library, which is correctly rounded.
#[inline]
pub(super) fn scan(bytes: &[u8]) -> Option<(f64, usize)> {
    let negative = bytes.first() == Some(&b'-');
    let start = usize::from(matches!(bytes.first(), Some(b'-' | b'+')));
    let mut mantissa = 0;
    let mut at = digits(bytes, start, &mut mantissa);
    let mut count = at - start;
    let mut exponent = 0;
    if bytes.get(at) == Some(&b'.') {
        let point = at + 1;
        at = digits(bytes, point, &mut mantissa);
        count += at - point;
        exponent = -i64::try_from(at - point).ok()?;
    }
    if count == 0 {
        return word(&bytes[start..], negative).map(|(value, length)| (value, start + length));
    }
    if bytes.get(at) == Some(&b'#') && bytes[at - 1] == b'.' {
        return windows_word(&bytes[at..], negative).map(|(value, length)| (value, at + length));
    }
    let mantissa_end = at;
    let suffix = exponent_suffix(&bytes[at..]);
    if let Some((power, length)) = suffix {
        exponent += power;
        at += length;
    }
    let value = if count <= 19 && mantissa <= EXACT_INTEGER && (-22..=22).contains(&exponent) {
        let power = POWERS[exponent.unsigned_abs() as usize];
        let magnitude = if exponent < 0 { mantissa as f64 / power } else { mantissa as f64 * power };
        if negative { -magnitude } else { magnitude }
    } else {
        let power = suffix.map_or(0, |(power, _)| power);
        parse(&bytes[..mantissa_end], power)?
    };
    Some((value, at))
}

/// The integer at the start of `bytes` (saturating at the ends of `i64`) and its length, or `None` when there is none.
#[inline]
pub(super) fn scan_integer(bytes: &[u8]) -> Option<(i64, usize)> {
    let negative = bytes.first() == Some(&b'-');
    let start = usize::from(matches!(bytes.first(), Some(b'-' | b'+')));
    let mut magnitude: u64 = 0;
    let end = digits(bytes, start, &mut magnitude);
    let magnitude = if end - start <= 18 { magnitude as i64 } else { i64::MAX };
    (end > start).then_some((if negative { -magnitude } else { magnitude }, end))
}

/// Appends the digits from `at` on to `value` (wrapping) and returns where they end.
#[inline]
fn digits(bytes: &[u8], mut at: usize, value: &mut u64) -> usize {
    while let Some(digit) = bytes.get(at).map(|b| b.wrapping_sub(b'0')).filter(|d| *d < 10) {
        *value = value.wrapping_mul(10).wrapping_add(u64::from(digit));
        at += 1;
    }
    at
}

/// The exponent at the start of `bytes`, as `e2`, `E+2`, `d-2` or `-e2`, and its length.
fn exponent_suffix(bytes: &[u8]) -> Option<(i64, usize)> {
    let is_letter = |b: &u8| matches!(b, b'e' | b'E' | b'd' | b'D');
    let is_sign = |b: &u8| matches!(b, b'+' | b'-');
    let (sign, start) = match bytes {
        [letter, sign, ..] if is_letter(letter) && is_sign(sign) => (*sign, 2),
        [sign, letter, ..] if is_sign(sign) && is_letter(letter) => (*sign, 2),
        [letter, ..] if is_letter(letter) => (b'+', 1),
        _ => return None,
    };
    let (power, length) = scan_integer(&bytes[start..]).filter(|_| bytes.get(start).is_some_and(u8::is_ascii_digit))?;
    let power = power.min(1_000_000_000);
    Some((if sign == b'-' { -power } else { power }, start + length))
}

/// The slow way: mantissa as written, times a power of ten.
#[cold]
fn parse(mantissa: &[u8], power: i64) -> Option<f64> {
    let mantissa = std::str::from_utf8(mantissa).ok()?;
    if power == 0 { mantissa.parse().ok() } else { format!("{mantissa}e{power}").parse().ok() }
}

/// `inf`, `infinity`, `nan` or `nan(...)`, in any case, and its length.
#[cold]
fn word(bytes: &[u8], negative: bool) -> Option<(f64, usize)> {
    let (magnitude, length) = if starts_with(bytes, "infinity") {
        (f64::INFINITY, 8)
    } else if starts_with(bytes, "inf") {
        (f64::INFINITY, 3)
    } else if starts_with(bytes, "nan") {
        let bracket = bytes[3..].iter().skip(1).take_while(|b| b.is_ascii_alphanumeric()).count() + 2;
        let is_bracket = bytes.get(3) == Some(&b'(') && bytes.get(2 + bracket) == Some(&b')');
        (f64::NAN, if is_bracket { 3 + bracket } else { 3 })
    } else {
        return None;
    };
    Some((if negative { -magnitude } else { magnitude }, length))
}

/// `#INF`, `#J` (an infinity cut to fit its column), `#IND`, `#QNAN`, `#SNAN`, with the digits behind, and its length.
#[cold]
fn windows_word(bytes: &[u8], negative: bool) -> Option<(f64, usize)> {
    let starts = |words: &[&str]| words.iter().any(|word| starts_with(bytes, word));
    let magnitude = if starts(&["#INF", "#J"]) {
        f64::INFINITY
    } else if starts(&["#IND", "#QNAN", "#SNAN"]) {
        f64::NAN
    } else {
        return None;
    };
    let length = 1 + bytes[1..].iter().take_while(|b| b.is_ascii_alphanumeric()).count();
    Some((if negative { -magnitude } else { magnitude }, length))
}

/// Whether `bytes` begins with `word`, in any letter case.
fn starts_with(bytes: &[u8], word: &str) -> bool {
    bytes.get(..word.len()).is_some_and(|found| found.eq_ignore_ascii_case(word.as_bytes()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn odd_forms_are_read_as_meant() {
        for (text, value) in [
            ("2.", 2.0),
            (".5", 0.5),
            ("+1e+2", 100.0),
            ("3.1+e2", 310.0),
            ("-3.1-e2", -0.031),
            ("1.5D+03", 1500.0),
            ("2.E1", 20.0),
            ("inf", f64::INFINITY),
            ("-Infinity", f64::NEG_INFINITY),
            ("-1.#INF00", f64::NEG_INFINITY),
            ("1.#J", f64::INFINITY),
            ("1e999999999999999999999", f64::INFINITY),
            ("1e-999999999999999999999", 0.0),
        ] {
            assert_eq!(scan(text.as_bytes()), Some((value, text.len())), "{text}");
        }
        for text in ["nan", "-NaN", "nan(ind)", "-1.#IND", "1.#QNAN"] {
            let (value, length) = scan(text.as_bytes()).expect(text);
            assert!(value.is_nan() && length == text.len(), "{text}");
        }
        assert!(scan(b"-0").is_some_and(|(zero, _)| zero.is_sign_negative()));
    }

    #[test]
    fn what_is_no_number_stops_the_scan() {
        for text in ["", "-", "+.", ".", "e5", "x", "--1", "#INF", "."] {
            assert_eq!(scan(text.as_bytes()), None, "{text}");
        }
        assert_eq!(scan(b"1e+ 2"), Some((1.0, 1)));
        assert_eq!(scan(b"7,5"), Some((7.0, 1)));
        assert_eq!(scan(b"7#5"), Some((7.0, 1)));
        assert_eq!(scan_integer(b"-12/3"), Some((-12, 3)));
        assert_eq!(scan_integer(b"/3"), None);
        assert_eq!(scan_integer(b"99999999999999999999999"), Some((i64::MAX, 23)));
    }

    proptest! {
        #[test]
        fn rounds_like_the_standard_library(text in "[-+]?[0-9]{1,21}(\\.[0-9]{0,21})?([eE][-+]?[0-9]{1,3})?") {
            let expected: f64 = text.parse().expect("a number");
            let (value, length) = scan(text.as_bytes()).expect("a number");
            prop_assert_eq!((value.to_bits(), length), (expected.to_bits(), text.len()), "{}", text);
        }

        #[test]
        fn every_double_survives(bits in any::<u64>()) {
            let value = f64::from_bits(bits);
            prop_assume!(!value.is_nan());
            for text in [format!("{value}"), format!("{value:e}")] {
                prop_assert_eq!(scan(text.as_bytes()).map(|(v, n)| (v.to_bits(), n)), Some((bits, text.len())));
            }
        }

        #[test]
        fn any_bytes_are_harmless(bytes in proptest::collection::vec(any::<u8>(), 0..40)) {
            let _ = (scan(&bytes), scan_integer(&bytes));
        }
    }
}
