//! Formats numbers for readers: with typeset minus signs, powers of ten as superscripts, and errors with two significant digits.

/// Returns `exponent` in superscript characters: −12 becomes `⁻¹²`.
pub fn superscript(exponent: i32) -> String {
    let digit = |c| match c {
        '-' => '⁻',
        '1' => '¹',
        '2' => '²',
        '3' => '³',
        '4' => '⁴',
        '5' => '⁵',
        '6' => '⁶',
        '7' => '⁷',
        '8' => '⁸',
        '9' => '⁹',
        _ => '⁰',
    };
    exponent.to_string().chars().map(digit).collect()
}

/// Lists ascending numbers, with long runs as ranges: `1, 3–4000`.
pub fn format_ranges(numbers: &[u32]) -> String {
    /// Runs with more successive numbers than this become a range.
    const LONGEST_WRITTEN_OUT: usize = 6;
    let runs = numbers.chunk_by(|a, b| a + 1 == *b);
    let shown = runs.map(|run| match run {
        [first, .., last] if run.len() > LONGEST_WRITTEN_OUT => format!("{first}–{last}"),
        _ => run.iter().map(u32::to_string).collect::<Vec<_>>().join(", "),
    });
    shown.collect::<Vec<_>>().join(", ")
}

/// Text `10ⁿ` for an exponent n.
pub fn power_of_ten(exponent: i32) -> String {
    format!("10{}", superscript(exponent))
}

/// Formats a value with this number of decimals and a typeset minus sign. The text is never `−0`.
pub fn format_decimals(value: f64, decimals: usize) -> String {
    let text = format!("{value:.decimals$}");
    match text.strip_prefix('-') {
        Some(digits) if digits.bytes().any(|b| (b'1'..=b'9').contains(&b)) || digits == "inf" => format!("−{digits}"),
        Some(digits) => digits.to_owned(),
        None => text,
    }
}

/// Decimal exponent of the leading digit of a value: 3 for 4600. It is 0 for zero and for values that are not finite.
pub fn decimal_exponent(value: f64) -> i32 {
    if value == 0.0 || !value.is_finite() { 0 } else { value.abs().log10().floor() as i32 }
}

/// Exponent of the power of ten to factor out of numbers whose largest is `largest`. It is 0 if they are easy to read without a factor.
pub fn factored_exponent(largest: f64) -> i32 {
    let exponent = decimal_exponent(largest);
    if (-3..5).contains(&exponent) { 0 } else { exponent }
}

/// Formats a value with `digits` significant digits. Very large and very small values have the form `mantissa × 10ⁿ`.
pub fn format_significant(value: f64, digits: usize) -> String {
    if !value.is_finite() {
        return format_decimals(value, 0);
    }
    // The value is rounded first: 9.99 with two digits becomes 10, which has another exponent.
    let rounded: f64 = format!("{value:.*e}", digits.saturating_sub(1)).parse().unwrap_or(value);
    let factored = factored_exponent(rounded);
    let scaled = rounded / 10f64.powi(factored);
    let decimals = (digits as i32 - 1 - decimal_exponent(scaled)).max(0) as usize;
    let mantissa = format_decimals(scaled, decimals);
    if factored == 0 { mantissa } else { format!("{mantissa}×{}", power_of_ten(factored)) }
}

/// Texts of a value and its errors. A figure writes `plus` above `minus` after `centre`, then `factor`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ValueWithErrors {
    /// Text of the value.
    pub centre: String,
    /// Text of the upper error, with its sign.
    pub plus: String,
    /// Text of the lower error, with its sign.
    pub minus: String,
    /// Factor `×10ⁿ` if the numbers are very large or small; otherwise empty.
    pub factor: String,
}

impl ValueWithErrors {
    /// Formats a median with its errors, the distances to a lower and an upper quantile. The smaller error has two significant digits, and all three numbers
    /// have its number of decimals.
    pub fn from_quantiles(lower: f64, median: f64, upper: f64) -> Self {
        let (plus, minus) = ((upper - median).abs(), (median - lower).abs());
        let smallest = [plus, minus].into_iter().filter(|error| *error > 0.0).fold(f64::INFINITY, f64::min);
        if !smallest.is_finite() {
            let zero = |sign: &str| format!("{sign}0");
            return Self {
                centre: format_significant(median, 4),
                plus: zero("+"),
                minus: zero("−"),
                factor: String::new(),
            };
        }
        // The text 0.00135 +0.00149 is longer and harder to read than 1.35 +1.49 ×10⁻³, so a factor is taken out.
        let exponent = match decimal_exponent(median.abs().max(plus).max(minus)) {
            -2..5 => 0,
            exponent => exponent,
        };
        let scale = 10f64.powi(exponent);
        let decimals = (1 - decimal_exponent(smallest / scale)).clamp(0, 12) as usize;
        Self {
            centre: format_decimals(median / scale, decimals),
            plus: format!("+{}", format_decimals(plus / scale, decimals)),
            minus: format!("−{}", format_decimals(minus / scale, decimals)),
            factor: if exponent == 0 { String::new() } else { format!("×{}", power_of_ten(exponent)) },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn long_runs_are_shown_by_their_ends() {
        assert_eq!(format_ranges(&[2, 3, 4]), "2, 3, 4");
        assert_eq!(format_ranges(&[1, 3, 4, 5, 6, 7, 8, 9, 12]), "1, 3–9, 12");
        assert_eq!(format_ranges(&(1..=4000).collect::<Vec<_>>()), "1–4000");
        assert_eq!(format_ranges(&[]), "");
    }

    #[test]
    fn numbers_read_as_written_by_hand() {
        let cases = [
            (0.0, 3, "0.00"),
            (3.5271, 3, "3.53"),
            (-0.00123, 2, "−0.0012"),
            (1.5e-7, 2, "1.5×10⁻⁷"),
            (9.99, 2, "10"),
            (123_456.0, 3, "1.23×10⁵"),
            (99_999.9, 3, "1.00×10⁵"),
            (1_000.0, 2, "1000"),
        ];
        for (value, digits, text) in cases {
            assert_eq!(format_significant(value, digits), text, "{value}");
        }
        assert_eq!(format_decimals(-0.001, 2), "0.00");
        assert_eq!(power_of_ten(-12), "10⁻¹²");
    }

    #[test]
    fn errors_set_the_decimals() {
        let value = ValueWithErrors::from_quantiles(3.42, 3.5271, 3.65);
        assert_eq!((value.centre.as_str(), value.plus.as_str(), value.minus.as_str()), ("3.53", "+0.12", "−0.11"));
        let tiny = ValueWithErrors::from_quantiles(3.1e-8, 3.5e-8, 4.4e-8);
        assert_eq!(tiny.centre, "3.50");
        assert_eq!((tiny.plus.as_str(), tiny.minus.as_str(), tiny.factor.as_str()), ("+0.90", "−0.40", "×10⁻⁸"));
        let constant = ValueWithErrors::from_quantiles(2.0, 2.0, 2.0);
        assert_eq!((constant.centre.as_str(), constant.plus.as_str()), ("2.000", "+0"));
        let wide = ValueWithErrors::from_quantiles(800.0, 1234.0, 1900.0);
        assert_eq!((wide.centre.as_str(), wide.plus.as_str(), wide.minus.as_str()), ("1234", "+666", "−434"));
    }
}
