//! One plot as SVG text: thin lines over a light grid, colours for light and dark backgrounds.

use plotters::coord::ranged1d::{AsRangedCoord, ValueFormatter};
use plotters::prelude::*;

use super::digits;

pub(crate) const BLUE: RGBColor = RGBColor(0x3b, 0x82, 0xc4);
pub(crate) const ORANGE: RGBColor = RGBColor(0xd9, 0x82, 0x2b);
pub(crate) const GREEN: RGBColor = RGBColor(0x2e, 0x9e, 0x6b);
pub(crate) const RED: RGBColor = RGBColor(0xd0, 0x4a, 0x4a);
pub(crate) const GREY: RGBColor = RGBColor(0x88, 0x88, 0x88);

/// One of `count` distinct colours, none of which is grey.
pub(crate) fn distinct_colour(index: usize, count: usize) -> RGBColor {
    // Neighbours also differ in lightness.
    let lightness = if index.is_multiple_of(2) { 0.42 } else { 0.6 };
    let colour = HSLColor(index as f64 / count as f64, 0.6, lightness);
    let RGBAColor(red, green, blue, _) = colour.to_rgba();
    RGBColor(red, green, blue)
}

/// Something drawn in the coordinates of the axes.
pub(crate) enum Mark {
    Line(Vec<(f64, f64)>, RGBColor),
    /// A thin line for reference.
    Reference(Vec<(f64, f64)>, RGBColor),
    /// The area between a lower and an upper line: x, lower, upper.
    Band(Vec<(f64, f64, f64)>, RGBColor),
    /// Intervals of x, over the whole height.
    Shade(Vec<(f64, f64)>, RGBColor),
}

pub(crate) struct Plot<'a> {
    /// Width and height, px.
    pub(crate) size: (u32, u32),
    /// Quantity and unit along x and y.
    pub(crate) labels: [&'a str; 2],
    pub(crate) x: (f64, f64),
    /// Range of the y axis; lines are clipped to it.
    pub(crate) y: (f64, f64),
    /// From back to front.
    pub(crate) marks: Vec<Mark>,
}

impl Plot<'_> {
    /// The drawing as an SVG element; an empty string if it cannot be drawn, on axes without extent, which
    /// `padded` prevents.
    pub(crate) fn svg(&self) -> String {
        let drawn = self.draw(self.y.0..self.y.1, &|y| tick(*y, self.y));
        drawn.unwrap_or_default()
    }

    /// The same over a logarithmic y axis; both of its ends must be positive.
    pub(crate) fn svg_log_y(&self) -> String {
        let axis = (self.y.0..self.y.1).log_scale();
        let drawn = self.draw(axis.with_key_points(decades(self.y)), &f64::to_string);
        drawn.unwrap_or_default()
    }

    fn draw<Y>(
        &self,
        y_axis: Y,
        y_tick: &dyn Fn(&f64) -> String,
    ) -> Result<String, Box<dyn std::error::Error>>
    where
        Y: AsRangedCoord<Value = f64>,
        Y::CoordDescType: Ranged<ValueType = f64> + ValueFormatter<f64>,
    {
        let mut text = String::new();
        let root = SVGBackend::with_string(&mut text, self.size).into_drawing_area();
        let mut chart = ChartBuilder::on(&root)
            .margin(8)
            .margin_right(14)
            .x_label_area_size(34)
            .y_label_area_size(58)
            .build_cartesian_2d(self.x.0..self.x.1, y_axis)?;
        let label = ("sans-serif", 12).into_font().color(&GREY);
        chart
            .configure_mesh()
            .light_line_style(TRANSPARENT)
            .bold_line_style(GREY.mix(0.22))
            .axis_style(GREY.mix(0.6))
            .x_labels(6)
            .y_labels(5)
            .x_desc(self.labels[0])
            .y_desc(self.labels[1])
            .x_label_formatter(&|x| tick(*x, self.x))
            .y_label_formatter(&y_tick)
            .label_style(label.clone())
            .axis_desc_style(label)
            .draw()?;
        for mark in &self.marks {
            match mark {
                Mark::Line(points, colour) => {
                    let style = colour.stroke_width(2);
                    let pieces = self.clipped(points).into_iter();
                    chart.draw_series(pieces.flat_map(|piece| LineSeries::new(piece, style)))?;
                }
                Mark::Reference(points, colour) => {
                    let style = colour.mix(0.8);
                    let pieces = self.clipped(points).into_iter();
                    chart.draw_series(pieces.flat_map(|piece| LineSeries::new(piece, style)))?;
                }
                Mark::Shade(intervals, colour) => {
                    let (low, high) = self.y;
                    let bar = |&(from, to): &(f64, f64)| {
                        Rectangle::new([(from, low), (to, high)], colour.mix(0.2).filled())
                    };
                    chart.draw_series(intervals.iter().map(bar))?;
                }
                Mark::Band(points, colour) => {
                    let outline = self.clamped(&outline(points));
                    chart.draw_series([Polygon::new(outline, colour.mix(0.18))])?;
                }
            }
        }
        root.present()?;
        drop((chart, root));
        Ok(scalable(&text))
    }

    /// The pieces of a line within the range of the y axis.
    fn clipped(&self, points: &[(f64, f64)]) -> Vec<Vec<(f64, f64)>> {
        let mut pieces: Vec<Vec<(f64, f64)>> = Vec::new();
        for pair in points.windows(2) {
            let Some([from, to]) = clip(pair[0], pair[1], self.y) else {
                continue;
            };
            match pieces.last_mut() {
                Some(piece) if piece.last() == Some(&from) => piece.push(to),
                _ => pieces.push(vec![from, to]),
            }
        }
        pieces
    }

    /// An area, clamped to the ranges of the axes.
    fn clamped(&self, points: &[(f64, f64)]) -> Vec<(f64, f64)> {
        let keep = |v: f64, (low, high): (f64, f64)| v.clamp(low, high);
        points
            .iter()
            .map(|&(x, y)| (keep(x, self.x), keep(y, self.y)))
            .collect()
    }
}

/// The part of a segment within the range of the y axis.
fn clip(from: (f64, f64), to: (f64, f64), (low, high): (f64, f64)) -> Option<[(f64, f64); 2]> {
    let end = |(x, y): (f64, f64), other: (f64, f64)| {
        // A point within is not changed, not even by rounding.
        if (low..=high).contains(&y) {
            return (x, y);
        }
        let edge = y.clamp(low, high);
        (x + (edge - y) / (other.1 - y) * (other.0 - x), edge)
    };
    let finite = from.1.is_finite() && to.1.is_finite();
    let intersects = from.1.min(to.1) <= high && from.1.max(to.1) >= low;
    (finite && intersects).then(|| [end(from, to), end(to, from)])
}

/// Both edges of a band as one closed line.
fn outline(points: &[(f64, f64, f64)]) -> Vec<(f64, f64)> {
    let lower = points.iter().map(|&(x, low, _)| (x, low));
    let upper = points.iter().rev().map(|&(x, _, high)| (x, high));
    lower.chain(upper).collect()
}

/// Range of an axis for all values with a margin; never empty.
pub(crate) fn padded(values: impl Iterator<Item = f64>, least: f64) -> (f64, f64) {
    let (low, high) = values
        .filter(|v| v.is_finite())
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| {
            (low.min(v), high.max(v))
        });
    if low > high {
        return (-least, least);
    }
    let margin = (0.06 * (high - low))
        .max(0.5 * least - 0.5 * (high - low))
        .max(1e-9);
    (low - margin, high + margin)
}

/// Round numbers for the labels of a logarithmic axis.
pub(crate) fn decades((low, high): (f64, f64)) -> Vec<f64> {
    let digits: &[u32] = match (high / low).log10() {
        span if span < 1.5 => &[1, 2, 5],
        span if span < 3.0 => &[1, 3],
        _ => &[1],
    };
    (-9..=9)
        .flat_map(|exponent| {
            digits
                .iter()
                .map(move |digit| format!("{digit}e{exponent}"))
        })
        // Parsed, not multiplied, since they are printed.
        .filter_map(|number| number.parse().ok())
        .filter(|number| (low..=high).contains(number))
        .collect()
}

/// A number with as many decimals as the axis needs.
fn tick(value: f64, (low, high): (f64, f64)) -> String {
    let span = (high - low).max(f64::MIN_POSITIVE);
    let text = digits(span, value);
    let trimmed = if text.contains('.') {
        text.trim_end_matches('0').trim_end_matches('.')
    } else {
        &text
    };
    trimmed.replace('-', "\u{2212}")
}

/// Without a size, which the page sets: only the view box is kept.
fn scalable(svg: &str) -> String {
    match svg.find("viewBox") {
        Some(view) => format!("<svg {}", &svg[view..]),
        None => svg.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_is_clipped_to_the_axis() {
        let plot = Plot {
            size: (100, 100),
            labels: ["", ""],
            x: (0.0, 4.0),
            y: (0.0, 1.0),
            marks: Vec::new(),
        };
        let points = [(0.0, 0.5), (1.0, 1.5), (2.0, 1.5), (3.0, 0.5), (4.0, 0.5)];
        let pieces = [
            vec![(0.0, 0.5), (0.5, 1.0)],
            vec![(2.5, 1.0), (3.0, 0.5), (4.0, 0.5)],
        ];
        assert_eq!(plot.clipped(&points), pieces);
        // NaN breaks it.
        assert!(plot.clipped(&[(0.0, f64::NAN), (1.0, 0.5)]).is_empty());
    }

    #[test]
    fn colours_are_distinct() {
        for count in 1..=40 {
            let mut all: Vec<_> = (0..count).map(|i| distinct_colour(i, count)).collect();
            all.push(GREY);
            all.sort_by_key(|colour| (colour.0, colour.1, colour.2));
            all.dedup();
            assert_eq!(all.len(), count + 1);
        }
    }
}
