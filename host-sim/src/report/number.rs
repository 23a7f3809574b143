//! Numbers with as many decimals as they need.

/// A number down to the second digit of `scale`.
pub(crate) fn to_second_digit_of(scale: f64, value: f64) -> String {
    let mut decimals = 0;
    let mut unit = 10.0;
    while unit > scale.abs() && decimals < 9 {
        decimals += 1;
        unit /= 10.0;
    }
    format!("{value:.decimals$}")
}

#[cfg(test)]
mod tests {
    use super::to_second_digit_of;

    #[test]
    fn decimals_follow_the_scale() {
        let shown = [31.0, 2.0, 0.1, 0.034].map(|scale| to_second_digit_of(scale, 1234.56789));
        assert_eq!(shown, ["1235", "1234.6", "1234.57", "1234.568"]);
    }
}
