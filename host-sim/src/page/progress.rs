//! Progress bars.

use indicatif::{ProgressBar, ProgressStyle};

pub(crate) fn bar() -> ProgressBar {
    let style = ProgressStyle::with_template("{msg:<14} {bar:40} {percent:>3} % {eta}");
    let bar = ProgressBar::new(0);
    if let Ok(style) = style {
        bar.set_style(style);
    }
    bar
}

/// Advances the bar after each call of `one`.
pub(crate) fn counted<T, R>(bar: &ProgressBar, one: impl Fn(T) -> R) -> impl Fn(T) -> R {
    move |item| {
        let done = one(item);
        bar.inc(1);
        done
    }
}

pub(crate) fn spinner(message: &'static str) -> ProgressBar {
    let spinner = ProgressBar::new_spinner().with_message(message);
    spinner.enable_steady_tick(std::time::Duration::from_millis(120));
    spinner
}
