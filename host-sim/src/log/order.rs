//! Rows of a table in the order of their times.

use std::io;
use std::path::Path;

use ins_core::{ImuSample, Time};

use super::Log;
use super::error::LogError;
use super::samples::Store;
use super::table::{Defects, NOT_FINITE, Row, Table};

/// Largest share of rows that may be unusable: errors of a logger are rare, more means an unknown format.
pub(super) const MAX_LEFT_OUT: f64 = 0.05;

/// A container of rows.
pub(super) trait Rows: Default {
    type Row: Copy + PartialEq;
    fn push(&mut self, row: Self::Row) -> io::Result<()>;
    fn all(&self) -> impl Iterator<Item = Self::Row>;
}

impl<T: Copy + PartialEq> Rows for Vec<T> {
    type Row = T;

    fn push(&mut self, row: T) -> io::Result<()> {
        self.push(row);
        Ok(())
    }

    fn all(&self) -> impl Iterator<Item = T> {
        self.iter().copied()
    }
}

impl Rows for Store {
    type Row = ImuSample;

    fn push(&mut self, row: ImuSample) -> io::Result<()> {
        self.push(row)
    }

    fn all(&self) -> impl Iterator<Item = ImuSample> {
        self.iter()
    }
}

/// All usable rows of a table, in order of time.
pub(super) fn rows<R: Rows>(
    mut table: Table,
    max_left_out: f64,
    warnings: &mut Vec<LogError>,
    time: fn(&R::Row) -> Time,
    mut parse: impl FnMut(&Row, Time) -> Result<R::Row, LogError>,
) -> Result<R, LogError> {
    let stamp = table.column("t_s")?;
    let mut order = Order::<R>::new(time);
    let mut unusable = Defects::default();
    while let Some(row) = table.next_row()? {
        let parsed = row.and_then(|row| {
            let defect = |last, time| not_increasing(&row, stamp, last, time);
            let value = parse(&row, order.stamp(self::time(&row, stamp)?, defect))?;
            Ok(order.take(value, defect))
        });
        match parsed {
            Ok(kept) => kept.map_err(|e| LogError::no_room(&e))?,
            Err(defect) => unusable.add(defect),
        }
    }
    let count = order.count + unusable.count;
    if order.count == 0 || too_many(&unusable, max_left_out, count) {
        return Err(unusable
            .refusal(max_left_out)
            .unwrap_or_else(|| table.no_rows()));
    }
    warnings.extend(table.warnings());
    warnings.extend(unusable.warning("left out"));
    order.finish(count, max_left_out, warnings)
}

/// The same for rows in memory, of one source in a file, whose numbers are unchecked.
pub(super) fn in_order<T: Copy + PartialEq>(
    all: Vec<T>,
    (path, source): (&Path, &str),
    time: fn(&T) -> Time,
    at: fn(T, Time) -> T,
    finite: fn(&T) -> bool,
    warnings: &mut Vec<LogError>,
) -> Result<Vec<T>, LogError> {
    let mut order = Order::<Vec<T>>::new(time);
    let (count, mut unusable) = (all.len(), Defects::default());
    for row in all {
        if !finite(&row) {
            unusable.add(not_finite(path, time(&row)).in_column(source));
            continue;
        }
        let defect = |last, time| {
            let [expected, found] = expected_and_found(last, time);
            LogError::file(path, expected, found, cause(last, time)).in_column(source)
        };
        let stamp = order.stamp(time(&row), defect);
        let kept = order.take(at(row, stamp), defect);
        kept.map_err(|e| LogError::no_room(&e))?;
    }
    let unusable = few_enough(unusable, MAX_LEFT_OUT, count)?;
    warnings.extend(unusable.warning("left out"));
    order.finish(count, MAX_LEFT_OUT, warnings)
}

fn not_finite(path: &Path, time: Time) -> LogError {
    let found = format!("NaN or infinity at {} s", decimal(time));
    LogError::file(path, "finite numbers", found, NOT_FINITE)
}

/// Whether defects are too many of all rows. One never is, even in a short file: often the last line.
fn too_many(defects: &Defects, max: f64, rows: usize) -> bool {
    defects.count > 1 && defects.count as f64 > max * rows as f64
}

/// The same defects, or the refusal of too many.
fn few_enough(defects: Defects, max: f64, rows: usize) -> Result<Defects, LogError> {
    let refusal = too_many(&defects, max, rows).then(|| defects.clone().refusal(max));
    refusal.flatten().map_or(Ok(defects), Err)
}

/// Puts rows into order of time.
struct Order<R: Rows> {
    rows: R,
    time: fn(&R::Row) -> Time,
    count: usize,
    last: Option<R::Row>,
    /// Sum of the periods of rollovers so far, by week or day.
    rollovers_s: f64,
    defects: OrderDefects,
}

/// Rows whose times do not increase.
#[derive(Default)]
struct OrderDefects {
    rollovers: Defects,
    duplicates: Defects,
    conflicts: Defects,
    out_of_order: Defects,
}

impl<R: Rows> Order<R> {
    fn new(time: fn(&R::Row) -> Time) -> Self {
        Self {
            rows: R::default(),
            time,
            count: 0,
            last: None,
            rollovers_s: 0.0,
            defects: OrderDefects::default(),
        }
    }

    /// Time of a row, with rollovers of the clock added.
    fn stamp(&mut self, time: Time, defect: impl Fn(Time, Time) -> LogError) -> Time {
        let unwrapped = time.plus_seconds(self.rollovers_s);
        let Some(last) = self.last.map(|last| (self.time)(&last)) else {
            return unwrapped;
        };
        let (now_s, last_s) = (time.as_seconds(), last.as_seconds() - self.rollovers_s);
        let Some(period_s) = rollover_period_s(last_s, now_s) else {
            return unwrapped;
        };
        let cause = ROLLOVER.into();
        let defect = defect(last, unwrapped);
        self.defects.rollovers.add(LogError { cause, ..defect });
        self.rollovers_s += period_s;
        time.plus_seconds(self.rollovers_s)
    }

    fn take(&mut self, value: R::Row, defect: impl Fn(Time, Time) -> LogError) -> io::Result<()> {
        let time = (self.time)(&value);
        if let Some(before) = self.last.filter(|last| (self.time)(last) >= time) {
            let last = (self.time)(&before);
            let defect = defect(last, time);
            if before == value {
                self.defects.duplicates.add(defect);
                return Ok(());
            }
            if last == time {
                self.defects.conflicts.add(defect);
                return Ok(());
            }
            self.defects.out_of_order.add(defect);
        }
        self.last = Some(value);
        self.count += 1;
        self.rows.push(value)
    }

    /// The rows in order, or a refusal where too many are out of order.
    fn finish(
        mut self,
        count: usize,
        max_left_out: f64,
        warnings: &mut Vec<LogError>,
    ) -> Result<R, LogError> {
        self.prune().map_err(|e| LogError::no_room(&e))?;
        let OrderDefects {
            rollovers,
            duplicates,
            conflicts,
            out_of_order,
        } = self.defects;
        let conflicts = few_enough(conflicts, max_left_out, count)?;
        let out_of_order = few_enough(out_of_order, max_left_out, count)?;
        warnings.extend(rollovers.warning("its period was added"));
        for defects in [duplicates, conflicts, out_of_order] {
            warnings.extend(defects.warning("left out"));
        }
        Ok(self.rows)
    }

    /// Leaves out the fewest rows such that the others are in order.
    fn prune(&mut self) -> io::Result<()> {
        if self.defects.out_of_order.count == 0 {
            return Ok(());
        }
        let times: Vec<Time> = self.rows.all().map(|row| (self.time)(&row)).collect();
        let keep = longest_increasing(&times);
        let (mut kept, mut count) = (R::default(), 0);
        for (row, _) in self.rows.all().zip(keep).filter(|(_, keep)| *keep) {
            kept.push(row)?;
            count += 1;
        }
        self.rows = kept;
        self.defects.out_of_order.count = self.count - count;
        self.count = count;
        Ok(())
    }
}

/// Which rows belong to a longest increasing subsequence of times.
fn longest_increasing(times: &[Time]) -> Vec<bool> {
    // Last row of the best subsequence of each length, and the predecessor of each row.
    let mut ends: Vec<usize> = Vec::new();
    let mut before: Vec<Option<usize>> = Vec::with_capacity(times.len());
    for (index, time) in times.iter().enumerate() {
        let length = ends.partition_point(|&end| times[end] < *time);
        before.push(length.checked_sub(1).map(|shorter| ends[shorter]));
        if length == ends.len() {
            ends.push(index);
        } else {
            ends[length] = index;
        }
    }
    let mut keep = vec![false; times.len()];
    let mut next = ends.last().copied();
    while let Some(index) = next {
        keep[index] = true;
        next = before[index];
    }
    keep
}

/// Rollover periods of clocks, s: GPS week and day.
const ROLLOVER_PERIODS_S: [f64; 2] = [604_800.0, 86_400.0];
/// Longest gap at a rollover, s.
const GAP_S: f64 = 60.0;
const ROLLOVER: &str = "the clock began anew with the GPS week or the day";

/// Period of the rollover between two times, s, if there is one.
fn rollover_period_s(last_s: f64, now_s: f64) -> Option<f64> {
    ROLLOVER_PERIODS_S.into_iter().find(|period_s| {
        (0.0..GAP_S).contains(&now_s) && (period_s - GAP_S..=*period_s).contains(&last_s)
    })
}

fn not_increasing(row: &Row, column: usize, last: Time, time: Time) -> LogError {
    let [expected, found] = expected_and_found(last, time);
    row.defect(column, &expected, &found, cause(last, time))
}

fn expected_and_found(last: Time, time: Time) -> [String; 2] {
    let expected = format!("a time after {} s, that of the row before", decimal(last));
    [expected, format!("{} s", decimal(time))]
}

fn cause(last: Time, time: Time) -> &'static str {
    if time == last {
        "a sample written twice, or stamps of too few digits"
    } else {
        "rows out of order, two logs joined, or a clock that was set back"
    }
}

fn time(row: &Row, column: usize) -> Result<Time, LogError> {
    let seconds = row.number(column).map_err(|defect| {
        if !row.cell(column).contains(':') {
            return defect;
        }
        let cause = "a date or a time of day: write seconds of any origin, the same in both files";
        LogError {
            expected: "seconds".into(),
            cause: cause.into(),
            ..defect
        }
    })?;
    exact_micros(row.cell(column))
        .map(Time::from_micros)
        .or_else(|| Time::from_seconds(seconds))
        .ok_or_else(|| {
            let cause = "another unit: milli-, micro- or nanoseconds";
            row.defect(column, "seconds within 1e12", row.cell(column), cause)
        })
}

/// Microseconds of a plain decimal, exactly: f64 loses the last digit after some decades.
fn exact_micros(text: &str) -> Option<i64> {
    let (whole, fraction) = text.split_once('.').unwrap_or((text, ""));
    let negative = whole.starts_with('-');
    let digits = |s: &str| s.len() <= 12 && s.bytes().all(|b| b.is_ascii_digit());
    let whole = whole.strip_prefix('-').unwrap_or(whole);
    // Finer fractions need rounding: left to `Time::from_seconds`.
    if whole.is_empty() || !digits(whole) || !digits(fraction) || fraction.len() > 6 {
        return None;
    }
    let number = |digits: &str| {
        let next = |number, digit| 10 * number + i64::from(digit - b'0');
        digits.bytes().fold(0, next)
    };
    let scale = [1_000_000, 100_000, 10_000, 1_000, 100, 10, 1][fraction.len()];
    let micros = 1_000_000 * number(whole) + scale * number(fraction);
    Some(if negative { -micros } else { micros })
}

/// Seconds with all six decimals.
pub(super) fn decimal(time: Time) -> String {
    let micros = time.as_micros();
    let (whole, fraction) = (
        micros.unsigned_abs() / 1_000_000,
        micros.unsigned_abs() % 1_000_000,
    );
    format!("{}{whole}.{fraction:06}", if micros < 0 { "-" } else { "" })
}

/// A warning where rows do not overlap the samples in time and are not used.
pub(super) fn outside_samples<T>(
    path: &Path,
    what: &str,
    rows: &[T],
    time: fn(&T) -> Time,
    log: &Log,
) -> Option<LogError> {
    let [first, last] = [log.imu.first()?.time, log.imu.last()?.time];
    let (from, to) = (time(rows.first()?), time(rows.last()?));
    let span = |from, to| format!("{} to {} s", decimal(from), decimal(to));
    let expected = format!(
        "{what} within the time of the inertial samples, {}",
        span(first, last)
    );
    let found = format!("one from {}", span(from, to));
    let cause = "another time scale (UTC, GPS week, boot) or another drive: not used";
    let defect = LogError::file(path, expected, found, cause).in_column("t_s");
    (to < first || from > last).then_some(defect)
}
