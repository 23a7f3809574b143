//! The rows of a table in the order of their stamps.

use std::io;
use std::path::Path;

use ins_core::{ImuSample, Time};

use super::Log;
use super::error::LogError;
use super::samples::Store;
use super::table::{Few, NOT_FINITE, Row, Table};

/// Largest share of rows that may be unusable: a slip of the logger is rare, more is a format that
/// is not understood.
pub(super) const MOST_LEFT_OUT: f64 = 0.05;

/// Where rows are kept.
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

/// Every usable row of a table, in order of time.
pub(super) fn rows<R: Rows>(
    mut table: Table,
    most_left_out: f64,
    warnings: &mut Vec<LogError>,
    time: fn(&R::Row) -> Time,
    mut parse: impl FnMut(&Row, Time) -> Result<R::Row, LogError>,
) -> Result<R, LogError> {
    let stamp = table.column("t_s")?;
    let mut order = Order::<R>::new(time);
    let mut unusable = Few::default();
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
    if order.count == 0 || too_many(&unusable, most_left_out, count) {
        return Err(unusable
            .refusal(most_left_out)
            .unwrap_or_else(|| table.no_rows()));
    }
    warnings.extend(table.warnings());
    warnings.extend(unusable.warning("left out"));
    order.settled(count, most_left_out, warnings)
}

/// The same of rows that are in memory, whose numbers nobody has looked at: of one source of a file.
pub(super) fn in_order<T: Copy + PartialEq>(
    all: Vec<T>,
    (path, source): (&Path, &str),
    time: fn(&T) -> Time,
    at: fn(T, Time) -> T,
    finite: fn(&T) -> bool,
    warnings: &mut Vec<LogError>,
) -> Result<Vec<T>, LogError> {
    let mut order = Order::<Vec<T>>::new(time);
    let (count, mut unusable) = (all.len(), Few::default());
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
    let unusable = few_enough(unusable, MOST_LEFT_OUT, count)?;
    warnings.extend(unusable.warning("left out"));
    order.settled(count, MOST_LEFT_OUT, warnings)
}

fn not_finite(path: &Path, time: Time) -> LogError {
    let found = format!("NaN or infinity at {} s", decimal(time));
    LogError::file(path, "finite numbers", found, NOT_FINITE)
}

/// Whether so many of all rows are no slip. One is, even in a short file: the last line, usually.
fn too_many(few: &Few, most: f64, rows: usize) -> bool {
    few.count > 1 && few.count as f64 > most * rows as f64
}

/// The same rows, or the refusal of too many.
fn few_enough(few: Few, most: f64, rows: usize) -> Result<Few, LogError> {
    let refusal = too_many(&few, most, rows).then(|| few.clone().refusal(most));
    refusal.flatten().map_or(Ok(few), Err)
}

/// Puts rows into the order of their stamps.
struct Order<R: Rows> {
    rows: R,
    time: fn(&R::Row) -> Time,
    count: usize,
    last: Option<R::Row>,
    /// For clocks that begin anew with the week or the day, so far.
    added_s: f64,
    told: Told,
}

/// What is said of rows that were not in order.
#[derive(Default)]
struct Told {
    rollovers: Few,
    repeated: Few,
    clashes: Few,
    disorder: Few,
}

impl<R: Rows> Order<R> {
    fn new(time: fn(&R::Row) -> Time) -> Self {
        Self {
            rows: R::default(),
            time,
            count: 0,
            last: None,
            added_s: 0.0,
            told: Told::default(),
        }
    }

    /// Stamp of a row, after those that came before where the clock has begun anew.
    fn stamp(&mut self, time: Time, defect: impl Fn(Time, Time) -> LogError) -> Time {
        let written = time.plus_seconds(self.added_s);
        let Some(last) = self.last.map(|last| (self.time)(&last)) else {
            return written;
        };
        let (now_s, last_s) = (time.as_seconds(), last.as_seconds() - self.added_s);
        let Some(period_s) = begun_anew(last_s, now_s) else {
            return written;
        };
        let cause = BEGUN_ANEW.into();
        let defect = defect(last, written);
        self.told.rollovers.add(LogError { cause, ..defect });
        self.added_s += period_s;
        time.plus_seconds(self.added_s)
    }

    fn take(&mut self, value: R::Row, defect: impl Fn(Time, Time) -> LogError) -> io::Result<()> {
        let time = (self.time)(&value);
        if let Some(before) = self.last.filter(|last| (self.time)(last) >= time) {
            let last = (self.time)(&before);
            let defect = defect(last, time);
            if before == value {
                self.told.repeated.add(defect);
                return Ok(());
            }
            if last == time {
                self.told.clashes.add(defect);
                return Ok(());
            }
            self.told.disorder.add(defect);
        }
        self.last = Some(value);
        self.count += 1;
        self.rows.push(value)
    }

    /// The rows in order, if so few of all are not that it was a slip.
    fn settled(
        mut self,
        count: usize,
        most_left_out: f64,
        warnings: &mut Vec<LogError>,
    ) -> Result<R, LogError> {
        self.settle().map_err(|e| LogError::no_room(&e))?;
        let Told {
            rollovers,
            repeated,
            clashes,
            disorder,
        } = self.told;
        let clashes = few_enough(clashes, most_left_out, count)?;
        let disorder = few_enough(disorder, most_left_out, count)?;
        warnings.extend(rollovers.warning("its period was added"));
        for few in [repeated, clashes, disorder] {
            warnings.extend(few.warning("left out"));
        }
        Ok(self.rows)
    }

    /// Leaves out the rows that stand between others of their time.
    fn settle(&mut self) -> io::Result<()> {
        if self.told.disorder.count == 0 {
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
        self.told.disorder.count = self.count - count;
        self.count = count;
        Ok(())
    }
}

/// Which rows belong to the longest sequence of increasing stamps.
fn longest_increasing(times: &[Time]) -> Vec<bool> {
    // Last rows of the best sequence of each length, and the row before each.
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

/// Periods of clocks that begin anew, s: the GPS week and the day.
const PERIODS_S: [f64; 2] = [604_800.0, 86_400.0];
/// Longest hole at such a moment, s.
const MARGIN_S: f64 = 60.0;
const BEGUN_ANEW: &str = "the clock began anew with the GPS week or the day";

/// Period of a clock that has begun anew between two stamps, s.
fn begun_anew(last_s: f64, now_s: f64) -> Option<f64> {
    PERIODS_S.into_iter().find(|period_s| {
        (0.0..MARGIN_S).contains(&now_s) && (period_s - MARGIN_S..=*period_s).contains(&last_s)
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

/// Microseconds of a plain decimal, exactly: f64 loses the last one after some decades.
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

/// Rows, from one time to another, without a moment in common with the samples: they are not used, and this
/// says so.
pub(super) fn of_another_time(
    path: &Path,
    what: &str,
    ends: [Option<Time>; 2],
    log: &Log,
) -> Option<LogError> {
    let [first, last] = [log.imu.first()?.time, log.imu.last()?.time];
    let [from, to] = [ends[0]?, ends[1]?];
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
