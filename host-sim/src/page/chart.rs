//! One interactive plot, drawn by plotly.js in the page.

use std::io::Write as _;
use std::sync::LazyLock;

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use flate2::Compression;
use flate2::write::GzEncoder;
use plotters::style::RGBColor;
use serde::Serialize;
use serde_json::{Value, json};

use super::plot::{GREY, decades};
use super::significant;

/// Most points of a curve: in an hour one every two seconds, or minimum and maximum of four.
pub(crate) const MOST_POINTS: usize = 1800;
/// Digits of values, and of times and positions.
const DIGITS: usize = 5;
const FINE_DIGITS: usize = 9;

pub(crate) type Point = (f64, f64);
/// x, value and one sigma.
pub(crate) type SigmaPoint = (f64, f64, f64);
/// Breaks a curve between two points.
pub(crate) const BREAK: Point = (f64::NAN, f64::NAN);

/// plotly.js, packed and in base64: a third of its size.
pub(crate) static SCRIPT: LazyLock<String> = LazyLock::new(|| {
    let sources = plotly::Plot::offline_js_sources();
    // The first of two scripts; the other is for formulas, which are not used.
    let script = sources.split("</script>").next().unwrap_or_default();
    let code = script.split_once('>').map_or("", |(_, code)| code);
    let mut packed = GzEncoder::new(Vec::new(), Compression::default());
    // Writing into a vector cannot fail.
    let _ = packed.write_all(code.as_bytes());
    STANDARD.encode(packed.finish().unwrap_or_default())
});

/// A plot for the template of the page.
#[derive(Default, Serialize)]
pub(crate) struct Figure {
    title: String,
    note: String,
    /// Data, layout and configuration. Empty, and not on the page, if no curve or mark has a point.
    json: String,
    /// Zoomed together with the other plots over time.
    over_time: bool,
    /// Higher than other plots.
    tall: bool,
}

/// Builder of a plot, from back to front, of plotly.js objects.
pub(crate) struct Chart {
    figure: Figure,
    x: Value,
    y: Value,
    shaded: bool,
    data: Vec<Value>,
}

impl Chart {
    /// Over the time since the first sample.
    pub(crate) fn over_time(title: impl Into<String>, unit: &str, duration_s: f64) -> Self {
        let mut chart = Self::new(title, "time, s", unit);
        chart.x = merged(chart.x, json!({ "range": [0.0, duration_s] }));
        chart.figure.over_time = true;
        chart
    }

    pub(crate) fn new(title: impl Into<String>, x: &str, y: &str) -> Self {
        // The ticks keep the labels apart from those of the x axis.
        let ticks = json!({ "ticks": "outside", "ticklen": 5, "tickcolor": TRANSPARENT });
        Self {
            figure: Figure {
                title: title.into(),
                ..Figure::default()
            },
            x: axis(x),
            y: merged(axis(y), ticks),
            shaded: false,
            data: Vec::new(),
        }
    }

    pub(crate) fn note(mut self, note: impl Into<String>) -> Self {
        self.figure.note = note.into();
        self
    }

    /// Range of the y axis; by default that of the data.
    pub(crate) fn range(mut self, (low, high): (f64, f64)) -> Self {
        self.y = merged(self.y, json!({ "range": [low, high] }));
        self
    }

    /// Integers from one to `most` along x.
    pub(crate) fn counted(mut self, most: usize) -> Self {
        let counts = json!({ "dtick": 1.0, "range": [0.5, most as f64 + 0.5] });
        self.x = merged(self.x, counts);
        self
    }

    pub(crate) fn logarithmic_y(mut self, values: impl Iterator<Item = f64>) -> Self {
        self.y = merged(self.y, logarithmic(values));
        self
    }

    pub(crate) fn logarithmic_x(mut self, values: impl Iterator<Item = f64>) -> Self {
        self.x = merged(self.x, logarithmic(values));
        self
    }

    /// Degrees from 0 to 360 along y.
    pub(crate) fn circle(mut self) -> Self {
        self.y = merged(self.y, json!({ "range": [-10.0, 370.0], "dtick": 90.0 }));
        self
    }

    /// Higher, for many curves or a map.
    pub(crate) fn tall(mut self) -> Self {
        self.figure.tall = true;
        self
    }

    /// Over longitude and latitude; a degree of latitude is `ratio` times as long.
    pub(crate) fn map(title: &str, ratio: f64) -> Self {
        let map = Self::new(title, "", "").note("longitude and latitude, deg");
        let map = map.tall();
        let scale = json!({ "tickformat": ".5~f", "scaleanchor": "x", "scaleratio": ratio });
        Self {
            x: merged(map.x, json!({ "tickformat": ".5~f", "nticks": 5 })),
            y: merged(map.y, scale),
            ..map
        }
    }

    /// A curve; NaN breaks it.
    pub(crate) fn line(self, name: &str, colour: RGBColor, points: &[Point]) -> Self {
        self.curve(name, points, stroke(1.5, colour, 1.0))
    }

    /// A curve in the background.
    pub(crate) fn reference(self, name: &str, colour: RGBColor, points: &[Point]) -> Self {
        let mut thin = stroke(1.0, colour, 0.8);
        thin["line"]["dash"] = "dot".into();
        self.curve(name, points, thin)
    }

    /// A pale curve, for noise.
    pub(crate) fn noise(self, name: &str, colour: RGBColor, points: &[Point]) -> Self {
        self.curve(name, points, stroke(1.0, colour, 0.7))
    }

    /// Plus and minus one sigma.
    pub(crate) fn expected(self, name: &str, colour: RGBColor, sigmas: &[Point]) -> Self {
        let side = |sign: f64| sigmas.iter().map(move |&(x, sigma)| (x, sign * sigma));
        let both: Vec<Point> = side(1.0).chain([BREAK]).chain(side(-1.0)).collect();
        self.curve(name, &both, stroke(2.0, colour, 1.0))
    }

    /// A curve with a band of one sigma; the legend switches both together.
    pub(crate) fn band(self, name: &str, colour: RGBColor, points: &[SigmaPoint]) -> Self {
        let sigmas: Vec<f64> = points.iter().map(|p| significant(2, p.2)).collect();
        let values: Vec<Point> = points.iter().map(|p| (p.0, p.1)).collect();
        let around = json!({ "legendgroup": name, "showlegend": false });
        let line = json!({
            "legendgroup": name,
            "customdata": sigmas,
            "hovertemplate": "%{y} \u{b1} %{customdata}",
        });
        self.area(name, &outline(points), &css(colour, 0.18), around)
            .curve(name, &values, merged(stroke(1.5, colour, 1.0), line))
    }

    /// Single points, each with a text; symbols have plotly's names.
    pub(crate) fn marks(
        self,
        name: &str,
        colour: RGBColor,
        symbol: &str,
        points: &[(Point, String)],
    ) -> Self {
        let marker = json!({ "size": 9, "symbol": symbol, "color": css(colour, 1.0) });
        self.points(name, json!({ "marker": marker }), points.iter().cloned())
    }

    /// Points with one sigma each, and a text.
    pub(crate) fn error_bars(
        self,
        name: &str,
        colour: RGBColor,
        points: &[(SigmaPoint, String)],
    ) -> Self {
        let sigmas: Vec<f64> = points.iter().map(|(spread, _)| spread.2).collect();
        let look = json!({
            "marker": { "size": 8, "color": css(colour, 1.0) },
            "error_y": { "type": "data", "array": sigmas },
        });
        let places = points.iter();
        let places = places.map(|((x, value, _), text)| ((*x, *value), text.clone()));
        self.points(name, look, places)
    }

    /// Intervals of x over the whole height.
    pub(crate) fn shade(mut self, name: &str, intervals: &[Point]) -> Self {
        let bars = |&(from, to): &Point| [(from, 0.0), (from, 1.0), (to, 1.0), (to, 0.0), BREAK];
        let bars: Vec<Point> = intervals.iter().flat_map(bars).collect();
        self.shaded |= !intervals.is_empty();
        self.area(name, &bars, &css(GREY, 0.22), json!({ "yaxis": "y2" }))
    }

    fn area(self, name: &str, outline: &[Point], colour: &str, look: Value) -> Self {
        let area = json!({
            "line": { "width": 0.0 },
            "fill": "toself",
            "fillcolor": colour,
            "hoverinfo": "skip",
        });
        self.curve(name, outline, merged(area, look))
    }

    fn points(
        self,
        name: &str,
        look: Value,
        points: impl Iterator<Item = (Point, String)>,
    ) -> Self {
        let (places, texts): (Vec<Point>, Vec<String>) = points.unzip();
        let marks = json!({
            "mode": "markers",
            "hovertext": texts,
            "hovertemplate": "%{hovertext}",
        });
        self.curve(name, &places, merged(marks, look))
    }

    fn curve(mut self, name: &str, points: &[Point], look: Value) -> Self {
        if points.is_empty() {
            return self;
        }
        let digits = if self.figure.tall {
            FINE_DIGITS
        } else {
            DIGITS
        };
        let xs = points.iter().map(|p| significant(FINE_DIGITS, p.0));
        let ys = points.iter().map(|p| significant(digits, p.1));
        let curve = json!({
            "type": "scatter",
            "mode": "lines",
            "name": name,
            "x": xs.collect::<Vec<_>>(),
            "y": ys.collect::<Vec<_>>(),
        });
        self.data.push(merged(curve, look));
        self
    }

    pub(crate) fn figure(self) -> Figure {
        let in_front = |of: &Value| of["fill"].is_null() && of["line"]["dash"].is_null();
        if !self.data.iter().any(in_front) {
            return self.figure;
        }
        let hover = if self.figure.tall {
            "closest"
        } else {
            "x unified"
        };
        let mut layout = json!({
            "xaxis": self.x,
            "yaxis": self.y,
            "hovermode": hover,
            "hoverlabel": {
                "bgcolor": "rgba(255, 255, 255, 0.95)",
                "font": { "color": "rgba(31, 35, 40, 1)" },
            },
            "margin": { "l": 64, "r": 12, "t": 8, "b": 44 },
            "showlegend": true,
            "legend": { "orientation": "h", "x": 0.0, "y": 1.02, "yanchor": "bottom" },
            "modebar": { "orientation": "v", "bgcolor": TRANSPARENT },
            "font": { "size": 12, "color": css(GREY, 1.0) },
            "paper_bgcolor": TRANSPARENT,
            "plot_bgcolor": TRANSPARENT,
        });
        if self.shaded {
            layout["yaxis2"] = json!({
                "overlaying": "y",
                "side": "right",
                "range": [0.0, 1.0],
                "fixedrange": true,
                "visible": false,
            });
        }
        let config = json!({
            "responsive": true,
            "displaylogo": false,
            "modeBarButtonsToRemove": ["select2d", "lasso2d"],
        });
        let plot = json!({ "data": self.data, "layout": layout, "config": config });
        Figure {
            // A tag in a name must not end the script.
            json: plot.to_string().replace('<', "\\u003c"),
            ..self.figure
        }
    }
}

const TRANSPARENT: &str = "rgba(0,0,0,0)";

/// An object with additional keys.
fn merged(mut object: Value, more: Value) -> Value {
    if let (Value::Object(keys), Value::Object(more)) = (&mut object, more) {
        keys.extend(more);
    }
    object
}

fn axis(title: &str) -> Value {
    json!({
        "title": { "text": title },
        "automargin": true,
        "zeroline": false,
        "gridcolor": css(GREY, 0.25),
        "exponentformat": "none",
        "nticks": 7,
    })
}

/// A logarithmic axis with few labels.
fn logarithmic(values: impl Iterator<Item = f64>) -> Value {
    let positive = values.filter(|value| *value > 0.0);
    let (low, high) = positive.fold((f64::MAX, 0.0), |(low, high): Point, value| {
        (low.min(value), high.max(value))
    });
    let ends = if low <= high {
        (0.7 * low, 1.4 * high)
    } else {
        (0.1, 10.0)
    };
    json!({
        "type": "log",
        "range": [ends.0.log10(), ends.1.log10()],
        "tickvals": decades(ends),
        "tickformat": "~g",
    })
}

fn stroke(width: f64, colour: RGBColor, opacity: f64) -> Value {
    json!({ "line": { "width": width, "color": css(colour, opacity) } })
}

fn css(RGBColor(red, green, blue): RGBColor, opacity: f64) -> String {
    format!("rgba({red}, {green}, {blue}, {opacity})")
}

/// Minimum and maximum of blocks of points, such that no more than [`MOST_POINTS`] are left.
pub(crate) fn thinned(points: impl ExactSizeIterator<Item = Point>) -> Vec<Point> {
    let mut thinner = Thinner::new(points.len());
    points.for_each(|point| thinner.push(point));
    thinner.finish()
}

/// Thins a curve point by point.
pub(crate) struct Thinner {
    /// Points in a block, which is replaced by its minimum and maximum.
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

    /// Breaks the curve before the next point.
    pub(crate) fn cut(&mut self) {
        (self.kept).extend(self.ends.take().into_iter().flat_map(in_order));
        self.kept.push(BREAK);
        self.count = 0;
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

/// At most `most` items, evenly spaced, including the last.
pub(crate) fn sampled<T: Clone>(items: &[T], most: usize) -> Vec<T> {
    let every = items.len().div_ceil(most).max(1);
    let skipped = (items.len() + every - 1) % every;
    items.iter().skip(skipped).step_by(every).cloned().collect()
}

/// Outline of each part of a band that is broken at NaN.
fn outline(points: &[SigmaPoint]) -> Vec<Point> {
    let whole = points.split(|(_, value, sigma)| !(value + sigma).is_finite());
    let around = |part: &[SigmaPoint]| {
        let upper = part.iter().map(|&(x, value, sigma)| (x, value + sigma));
        let lower = part.iter().rev();
        let lower = lower.map(|&(x, value, sigma)| (x, value - sigma));
        upper.chain(lower).chain([BREAK]).collect::<Vec<Point>>()
    };
    let parts = whole.filter(|part| !part.is_empty());
    parts.flat_map(around).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_curve_is_broken_at_a_gap_and_keeps_its_ends() {
        for points in [8, 8 * MOST_POINTS] {
            let mut thinner = Thinner::new(points);
            for at in 0..points {
                if at == points / 4 + 1 {
                    thinner.cut();
                }
                thinner.push((at as f64, at as f64));
            }
            let curve = thinner.finish();
            let gap = curve.iter().position(|point| point.0.is_nan()).unwrap();
            assert_eq!(curve.iter().filter(|point| point.0.is_nan()).count(), 1);
            let ends = [curve[gap - 1].0, curve[gap + 1].0];
            assert_eq!(
                format!("{ends:?}"),
                format!("[{}.0, {}.0]", points / 4, points / 4 + 1)
            );
            assert!(curve.len() <= MOST_POINTS + 3);
        }
    }
}
