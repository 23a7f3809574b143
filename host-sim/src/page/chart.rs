//! One plot that the page draws with plotly.js: zoom, hover, curves to switch on and off.

use std::io::Write as _;
use std::sync::LazyLock;

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use flate2::Compression;
use flate2::write::GzEncoder;
use plotly::color::Rgba;
use plotly::common::{
    Anchor, AxisSide, DashType, ErrorData, ErrorType, ExponentFormat, Fill, Font, HoverInfo, Label,
    Line, Marker, MarkerSymbol, Mode, Orientation,
};
use plotly::configuration::{Configuration, ModeBarButtonName};
use plotly::layout::{Axis, AxisType, HoverMode, Layout, Legend, Margin, ModeBar, TicksDirection};
use plotly::{Plot, Scatter, Trace};
use plotters::style::RGBColor;
use serde::Serialize;

use super::plot::{GREY, decades};
use super::significant;

/// Points of a curve. An hour has one every two seconds, or the least and the greatest of four.
pub(crate) const MOST_POINTS: usize = 1800;
/// Digits of what is drawn: of values, and of times and places.
const DIGITS: usize = 5;
const FINE_DIGITS: usize = 9;

pub(crate) type Point = (f64, f64);
/// x, value and one sigma.
pub(crate) type Spread = (f64, f64, f64);
/// Between two points it breaks their curve.
pub(crate) const BREAK: Point = (f64::NAN, f64::NAN);

/// plotly.js, packed and in base64: a third of its size.
pub(crate) static SCRIPT: LazyLock<String> = LazyLock::new(|| {
    let sources = Plot::offline_js_sources();
    // The first of two scripts; the other sets formulas, which no plot has.
    let script = sources.split("</script>").next().unwrap_or_default();
    let code = script.split_once('>').map_or("", |(_, code)| code);
    let mut packed = GzEncoder::new(Vec::new(), Compression::default());
    // Writing into a vector cannot fail.
    let _ = packed.write_all(code.as_bytes());
    STANDARD.encode(packed.finish().unwrap_or_default())
});

/// A plot as the page takes it.
#[derive(Default, Serialize)]
pub(crate) struct Figure {
    title: String,
    /// What is to be known of it.
    note: String,
    /// Data, layout and configuration.
    json: String,
    /// Zoomed together with the others over time.
    over_time: bool,
    /// Higher than others.
    tall: bool,
}

/// A plot that is being put together, from back to front.
pub(crate) struct Chart {
    figure: Figure,
    x: Axis,
    y: Axis,
    shaded: bool,
    plot: Plot,
}

impl Chart {
    /// Over the time since the first sample.
    pub(crate) fn over_time(title: impl Into<String>, unit: &str, duration_s: f64) -> Self {
        let mut chart = Self::new(title, "time, s", unit);
        chart.x = chart.x.range(vec![0.0, duration_s]);
        chart.figure.over_time = true;
        chart
    }

    pub(crate) fn new(title: impl Into<String>, x: &str, y: &str) -> Self {
        Self {
            figure: Figure {
                title: title.into(),
                ..Figure::default()
            },
            x: axis(x),
            // Labels keep off those of the x axis in the corner.
            y: axis(y)
                .ticks(TicksDirection::Outside)
                .tick_length(5)
                .tick_color(NONE),
            shaded: false,
            plot: Plot::new(),
        }
    }

    pub(crate) fn note(mut self, note: impl Into<String>) -> Self {
        self.figure.note = note.into();
        self
    }

    /// Ends of the y axis; without, all is shown.
    pub(crate) fn range(mut self, (low, high): (f64, f64)) -> Self {
        self.y = self.y.range(vec![low, high]);
        self
    }

    /// Counts from one to so many along x.
    pub(crate) fn counted(mut self, most: usize) -> Self {
        self.x = self.x.dtick(1.0).range(vec![0.5, most as f64 + 0.5]);
        self
    }

    pub(crate) fn logarithmic_y(mut self, values: impl Iterator<Item = f64>) -> Self {
        self.y = logarithmic(self.y, values);
        self
    }

    pub(crate) fn logarithmic_x(mut self, values: impl Iterator<Item = f64>) -> Self {
        self.x = logarithmic(self.x, values);
        self
    }

    /// Degrees of a circle along y.
    pub(crate) fn circle(mut self) -> Self {
        self.y = self.y.range(vec![-10.0, 370.0]).dtick(90.0);
        self
    }

    /// Room for many curves, or for a map.
    pub(crate) fn tall(mut self) -> Self {
        self.figure.tall = true;
        self
    }

    /// Over longitude and latitude; a degree of latitude is so many times as long.
    pub(crate) fn map(title: &str, ratio: f64) -> Self {
        let map = Self::new(title, "", "").note("longitude and latitude, deg");
        let map = map.tall();
        Self {
            x: map.x.tick_format(".5~f").n_ticks(5),
            y: map
                .y
                .tick_format(".5~f")
                .scale_anchor("x")
                .scale_ratio(ratio),
            ..map
        }
    }

    /// A curve; NaN breaks it.
    pub(crate) fn line(self, name: &str, colour: RGBColor, points: &[Point]) -> Self {
        self.drawn(name, points, stroke(1.5, colour, 1.0))
    }

    /// A curve that stays in the background.
    pub(crate) fn reference(self, name: &str, colour: RGBColor, points: &[Point]) -> Self {
        self.drawn(name, points, stroke(1.0, colour, 0.8).dash(DashType::Dot))
    }

    /// A curve of noise: pale.
    pub(crate) fn noise(self, name: &str, colour: RGBColor, points: &[Point]) -> Self {
        self.drawn(name, points, stroke(1.0, colour, 0.7))
    }

    /// One sigma to both sides of zero.
    pub(crate) fn expected(self, name: &str, colour: RGBColor, sigmas: &[Point]) -> Self {
        let side = |sign: f64| sigmas.iter().map(move |&(x, sigma)| (x, sign * sigma));
        let both: Vec<Point> = side(1.0).chain([BREAK]).chain(side(-1.0)).collect();
        self.drawn(name, &both, stroke(2.0, colour, 1.0))
    }

    /// A curve in a band of one sigma; both are switched together.
    pub(crate) fn band(self, name: &str, colour: RGBColor, points: &[Spread]) -> Self {
        let sigmas: Vec<f64> = points.iter().map(|p| significant(2, p.2)).collect();
        let values: Vec<Point> = points.iter().map(|p| (p.0, p.1)).collect();
        let line = self
            .curve(name, &values)
            .line(stroke(1.5, colour, 1.0))
            .custom_data(sigmas)
            .hover_template("%{y} \u{b1} %{customdata}")
            .legend_group(name);
        let area = self
            .area(name, &outline(points), css(colour, 0.18))
            .legend_group(name)
            .show_legend(false);
        self.with(area).with(line)
    }

    /// Points by themselves, each with a text.
    pub(crate) fn marks(
        self,
        name: &str,
        colour: RGBColor,
        symbol: MarkerSymbol,
        points: &[(Point, String)],
    ) -> Self {
        let marker = Marker::new().size(9).symbol(symbol).color(css(colour, 1.0));
        let marks = self.points(name, marker, points.iter().cloned());
        self.with(marks)
    }

    /// Points with one sigma each, and a text.
    pub(crate) fn error_bars(
        self,
        name: &str,
        colour: RGBColor,
        points: &[(Spread, String)],
    ) -> Self {
        let marker = Marker::new().size(8).color(css(colour, 1.0));
        let sigmas = points.iter().map(|(spread, _)| spread.2).collect();
        let places = points.iter();
        let places = places.map(|((x, value, _), text)| ((*x, *value), text.clone()));
        let bars = self
            .points(name, marker, places)
            .error_y(ErrorData::new(ErrorType::Data).array(sigmas));
        self.with(bars)
    }

    /// Intervals of x over the whole height.
    pub(crate) fn shade(mut self, name: &str, intervals: &[Point]) -> Self {
        let bars = |&(from, to): &Point| [(from, 0.0), (from, 1.0), (to, 1.0), (to, 0.0), BREAK];
        let bars: Vec<Point> = intervals.iter().flat_map(bars).collect();
        self.shaded = true;
        let area = self.area(name, &bars, css(GREY, 0.22)).y_axis("y2");
        self.with(area)
    }

    fn drawn(self, name: &str, points: &[Point], line: Line) -> Self {
        let curve = self.curve(name, points).line(line);
        self.with(curve)
    }

    fn curve(&self, name: &str, points: &[Point]) -> Box<Scatter<f64, f64>> {
        let digits = if self.figure.tall {
            FINE_DIGITS
        } else {
            DIGITS
        };
        let xs = points.iter().map(|p| significant(FINE_DIGITS, p.0));
        let ys = points.iter().map(|p| significant(digits, p.1));
        Scatter::new(xs.collect(), ys.collect())
            .mode(Mode::Lines)
            .name(name)
    }

    fn area(&self, name: &str, outline: &[Point], colour: Rgba) -> Box<Scatter<f64, f64>> {
        self.curve(name, outline)
            .line(Line::new().width(0.0))
            .fill(Fill::ToSelf)
            .fill_color(colour)
            .hover_info(HoverInfo::Skip)
    }

    fn points(
        &self,
        name: &str,
        marker: Marker,
        points: impl Iterator<Item = (Point, String)>,
    ) -> Box<Scatter<f64, f64>> {
        let (places, texts): (Vec<Point>, Vec<String>) = points.unzip();
        self.curve(name, &places)
            .mode(Mode::Markers)
            .marker(marker)
            .hover_text_array(texts)
            .hover_template("%{hovertext}")
    }

    fn with(mut self, trace: Box<dyn Trace>) -> Self {
        self.plot.add_trace(trace);
        self
    }

    pub(crate) fn figure(self) -> Figure {
        let mut layout = Layout::new()
            .x_axis(self.x)
            .y_axis(self.y)
            .hover_mode(if self.figure.tall {
                HoverMode::Closest
            } else {
                HoverMode::XUnified
            })
            .hover_label(
                Label::new()
                    .background_color(css(RGBColor(255, 255, 255), 0.95))
                    .font(Font::new().color(css(RGBColor(31, 35, 40), 1.0))),
            )
            .margin(Margin::new().left(64).right(12).top(8).bottom(44))
            .show_legend(true)
            .legend(
                Legend::new()
                    .orientation(Orientation::Horizontal)
                    .x(0.0)
                    .y(1.02)
                    .y_anchor(Anchor::Bottom),
            )
            .mode_bar(
                ModeBar::new()
                    .orientation(Orientation::Vertical)
                    .background_color(NONE),
            )
            .font(Font::new().size(12).color(css(GREY, 1.0)))
            .paper_background_color(NONE)
            .plot_background_color(NONE);
        if self.shaded {
            let whole = Axis::new()
                .overlaying("y")
                .side(AxisSide::Right)
                .range(vec![0.0, 1.0])
                .fixed_range(true)
                .visible(false);
            layout = layout.y_axis2(whole);
        }
        let mut plot = self.plot;
        plot.set_layout(layout);
        plot.set_configuration(
            Configuration::new()
                .responsive(true)
                .display_logo(false)
                .mode_bar_buttons_to_remove(vec![
                    ModeBarButtonName::Select2d,
                    ModeBarButtonName::Lasso2d,
                ]),
        );
        Figure {
            // The page must not end where a name has a tag.
            json: plot.to_json().replace('<', "\\u003c"),
            ..self.figure
        }
    }
}

const NONE: &str = "rgba(0,0,0,0)";

fn axis(title: &str) -> Axis {
    Axis::new()
        .title(title)
        .auto_margin(true)
        .zero_line(false)
        .grid_color(css(GREY, 0.25))
        .exponent_format(ExponentFormat::None)
        .n_ticks(7)
}

/// With so few labels that they stand apart.
fn logarithmic(axis: Axis, values: impl Iterator<Item = f64>) -> Axis {
    let positive = values.filter(|value| *value > 0.0);
    let (low, high) = positive.fold((f64::MAX, 0.0), |(low, high): Point, value| {
        (low.min(value), high.max(value))
    });
    let ends = if low <= high {
        (0.7 * low, 1.4 * high)
    } else {
        (0.1, 10.0)
    };
    axis.type_(AxisType::Log)
        .range(vec![ends.0.log10(), ends.1.log10()])
        .tick_values(decades(ends))
        .tick_format("~g")
}

fn stroke(width: f64, colour: RGBColor, opacity: f64) -> Line {
    Line::new().width(width).color(css(colour, opacity))
}

fn css(RGBColor(red, green, blue): RGBColor, opacity: f64) -> Rgba {
    Rgba::new(red, green, blue, opacity)
}

/// The least and the greatest of so many points each that no more than [`MOST_POINTS`] are left.
pub(crate) fn thinned(points: impl ExactSizeIterator<Item = Point>) -> Vec<Point> {
    let mut thinner = Thinner::new(points.len());
    points.for_each(|point| thinner.push(point));
    thinner.finish()
}

/// A curve that is thinned while its points come in.
pub(crate) struct Thinner {
    /// So many points give their least and their greatest.
    size: usize,
    count: usize,
    ends: Option<[Point; 2]>,
    kept: Vec<Point>,
}

impl Thinner {
    pub(crate) fn new(points: usize) -> Self {
        let size = if points <= MOST_POINTS {
            1
        } else {
            points.div_ceil(MOST_POINTS / 2)
        };
        Self {
            size,
            count: 0,
            ends: None,
            kept: Vec::with_capacity(MOST_POINTS),
        }
    }

    pub(crate) fn push(&mut self, point: Point) {
        if self.size == 1 {
            self.kept.push(point);
            return;
        }
        if self.count.is_multiple_of(self.size) {
            self.kept
                .extend(self.ends.take().into_iter().flat_map(in_order));
        }
        self.count += 1;
        let [low, high] = self.ends.unwrap_or([point; 2]);
        self.ends = Some([
            if point.1 < low.1 { point } else { low },
            if point.1 > high.1 { point } else { high },
        ]);
    }

    pub(crate) fn finish(mut self) -> Vec<Point> {
        self.kept.extend(self.ends.into_iter().flat_map(in_order));
        self.kept
    }
}

fn in_order(mut ends: [Point; 2]) -> [Point; 2] {
    ends.sort_by(|a, b| a.0.total_cmp(&b.0));
    ends
}

/// No more than so many, evenly, and the last.
pub(crate) fn sampled<T: Clone>(items: &[T], most: usize) -> Vec<T> {
    let every = items.len().div_ceil(most).max(1);
    let skipped = (items.len() + every - 1) % every;
    items.iter().skip(skipped).step_by(every).cloned().collect()
}

/// Around a band; around each part of it where it is broken.
fn outline(points: &[Spread]) -> Vec<Point> {
    let whole = points.split(|(_, value, sigma)| !(value + sigma).is_finite());
    let around = |part: &[Spread]| {
        let upper = part.iter().map(|&(x, value, sigma)| (x, value + sigma));
        let lower = part.iter().rev();
        let lower = lower.map(|&(x, value, sigma)| (x, value - sigma));
        upper.chain(lower).chain([BREAK]).collect::<Vec<Point>>()
    };
    let parts = whole.filter(|part| !part.is_empty());
    parts.flat_map(around).collect()
}
