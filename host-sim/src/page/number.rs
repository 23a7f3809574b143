//! Numbers with as many digits as they need.

/// A number down to the second digit of `scale`.
pub fn to_second_digit_of(scale: f64, value: f64) -> String {
    let mut decimals = 0;
    let mut unit = 10.0;
    while unit > scale.abs() && decimals < 9 {
        decimals += 1;
        unit /= 10.0;
    }
    format!("{value:.decimals$}")
}

/// A number down to its own second digit.
pub fn brief(value: f64) -> String {
    to_second_digit_of(value, value)
}

/// A number rounded to so many digits.
pub(crate) fn significant(digits: usize, value: f64) -> f64 {
    let decimals = digits.saturating_sub(1);
    // Through text: what is then written has no more digits than these.
    format!("{value:.decimals$e}").parse().unwrap_or(value)
}

#[cfg(test)]
mod tests {
    use super::{significant, to_second_digit_of};

    #[test]
    fn decimals_follow_the_scale() {
        let shown = [31.0, 2.0, 0.1, 0.034].map(|scale| to_second_digit_of(scale, 1234.56789));
        assert_eq!(shown, ["1235", "1234.6", "1234.57", "1234.568"]);
    }

    #[test]
    fn what_is_drawn_has_few_digits() {
        let rounded = [1_234.567_89, -0.000_123_456_7, 0.0].map(|v| significant(5, v).to_string());
        assert_eq!(rounded, ["1234.6", "-0.00012346", "0"]);
        assert!(significant(5, f64::NAN).is_nan());
    }
}
