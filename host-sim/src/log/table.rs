//! A table of numbers in a text file, plain or gzip, read line by line with bounded memory.

use std::cell::RefCell;
use std::fs::File;
use std::io::{self, BufRead, BufReader, Read};
use std::path::{Path, PathBuf};

use flate2::bufread::MultiGzDecoder;

use super::error::LogError;

/// Longest credible line: 60 columns of 20 characters and ample room.
const MAX_LINE_BYTES: u64 = 16 * 1024;
const GZIP_MAGIC: [u8; 2] = [0x1f, 0x8b];
const BYTE_ORDER_MARK: &[u8] = "\u{feff}".as_bytes();

/// The column that every table has.
const TIME: &str = "t_s";
pub(super) const NOT_FINITE: &str = "a lost value or a division by zero in the logger";
const NAME_THEM: &str = "name the columns in meta.toml, [columns]";
/// Starts of lines before the header: of a comment, and of the separator line for spreadsheets.
const COMMENT: char = '#';
const SEPARATOR: &str = "sep=";

/// A file with a header line and rows of numbers.
pub(super) struct Table {
    path: PathBuf,
    source: Box<dyn BufRead>,
    header: Vec<String>,
    header_line: u64,
    /// Columns that are read if present.
    known: RefCell<Vec<String>>,
    record: Record,
    /// Line number of the record.
    line: u64,
    separator: u8,
    /// Values read as empty or left out.
    lost: RefCell<Defects>,
    /// The defect of a file that ends within its last gzip member.
    truncated: Option<LogError>,
}

/// Defects of one kind: the first, and how many.
#[derive(Clone, Default)]
pub(super) struct Defects {
    pub(super) first: Option<LogError>,
    pub(super) count: usize,
}

impl Defects {
    pub(super) fn add(&mut self, defect: LogError) {
        self.first.get_or_insert(defect);
        self.count += 1;
    }

    /// The first as a warning, with what was done to all.
    pub(super) fn warning(self, done: &str) -> Option<LogError> {
        let more = match self.count {
            1 => done.to_owned(),
            count => format!("{count} like it: {done}"),
        };
        self.with_cause(&more)
    }

    /// The first as an error, where at most this share may be left out.
    pub(super) fn refusal(self, max: f64) -> Option<LogError> {
        let percent = 100.0 * max;
        match self.count {
            1 => self.first,
            count => self.with_cause(&format!(
                "{count} like it: too many to leave out, at most {percent} % of the rows"
            )),
        }
    }

    fn with_cause(self, more: &str) -> Option<LogError> {
        let first = self.first?;
        let cause = format!("{}; {more}", first.cause).into();
        Some(LogError { cause, ..first })
    }
}

/// A line without its end, and the ranges of its cells. Quotes do not protect separators: an unpaired one
/// must not consume the rest of the file.
#[derive(Default)]
struct Record {
    bytes: Vec<u8>,
    cells: Vec<(usize, usize)>,
}

impl Record {
    fn is_zeros(&self) -> bool {
        !self.bytes.is_empty() && self.bytes.iter().all(|&byte| byte == 0)
    }

    fn split(&mut self, separator: u8) {
        self.cells.clear();
        let mut start = 0;
        for cell in self.bytes.split(|&byte| byte == separator) {
            self.cells.push((start, start + cell.len()));
            start += cell.len() + 1;
        }
    }

    fn cell(&self, index: usize) -> &[u8] {
        let cell = self.cells.get(index);
        cell.map_or(&[], |&(start, end)| &self.bytes[start..end])
    }
}

/// One row, to be read cell by cell.
pub(super) struct Row<'a> {
    table: &'a Table,
}

impl Table {
    pub(super) fn open(path: &Path) -> Result<Self, LogError> {
        let mut source = decompressed(path).map_err(|e| read_failed(path, &e))?;
        let separator = separator(source.fill_buf().map_err(|e| read_failed(path, &e))?);
        let mut table = Self {
            path: path.to_path_buf(),
            source,
            header: Vec::new(),
            header_line: 0,
            known: vec![TIME.to_owned()].into(),
            record: Record::default(),
            line: 0,
            separator,
            lost: RefCell::default(),
            truncated: None,
        };
        // Comments may precede the header, which may look like one.
        loop {
            if !table.advance()? {
                let cause = "the logger never wrote to it, or a copy failed";
                return Err(table.defect("a header line and rows", "an empty file", cause));
            }
            let header = table.text()?;
            let comment = header[0].starts_with(COMMENT) || header[0].starts_with(SEPARATOR);
            let bare =
                |cell: &&str| unquoted(cell.trim_start_matches(COMMENT)).to_ascii_lowercase();
            table.header = header.iter().map(bare).collect();
            table.header_line = table.line;
            if !comment || table.header.iter().any(|name| name == TIME) {
                return Ok(table);
            }
        }
    }

    /// Warnings of columns and values not used, and of truncation.
    pub(super) fn warnings(&self) -> Vec<LogError> {
        let mut warnings = Vec::new();
        let twice = |name: &&String| self.header.iter().filter(|other| other == name).count() > 1;
        if let Some(name) = self.header.iter().find(twice) {
            let defect = self.defect(
                "columns of different names",
                &format!("`{name}` twice"),
                "two sources in one file: the first of the columns is used",
            );
            warnings.push(defect.at_line(self.header_line).in_column(name));
        }
        warnings.extend(self.unread());
        warnings.extend(self.truncated.clone());
        let lost = std::mem::take(&mut *self.lost.borrow_mut());
        warnings.extend(lost.warning("taken as empty"));
        warnings
    }

    /// Columns that are not read, with suggestions.
    fn unread(&self) -> Option<LogError> {
        let known = self.known.borrow();
        let other = |name: &&String| !name.is_empty() && !known.contains(name);
        let unread: Vec<&String> = self.header.iter().filter(other).collect();
        let suggestions = unread.iter().filter_map(|name| {
            let missing = known.iter().filter(|known| !self.header.contains(known));
            let near = missing.filter(|known| are_alike(known, name));
            let nearest = near.min_by_key(|known| strsim::osa_distance(known, name))?;
            Some(format!("`{nearest}` by `{name}`"))
        });
        let suggestions = suggestions.collect::<Vec<_>>().join(", ");
        let cause = match suggestions.as_str() {
            "" => "not read; harmless if intended".to_owned(),
            _ => format!("not read; did you mean {suggestions}?"),
        };
        let names = unread.iter().map(|name| format!("`{name}`"));
        let found = names.collect::<Vec<_>>().join(", ");
        let expected = format!("columns {}", known.join(", "));
        let defect = || {
            self.defect(&expected, &found, &cause)
                .at_line(self.header_line)
        };
        (!unread.is_empty()).then(defect)
    }

    /// Index of a required column.
    pub(super) fn column(&self, name: &str) -> Result<usize, LogError> {
        self.optional_column(name).ok_or_else(|| {
            let near = self.header.iter().find(|other| other.starts_with(name));
            let cause = match (self.header.len(), near) {
                (1, _) => "cells must be separated by commas, semicolons or tabs",
                (_, Some(near)) => &format!("is it `{near}`? {NAME_THEM}"),
                _ => &format!("a column of another name or a headerless file: {NAME_THEM}"),
            };
            let found = format!("columns {}", shortened(&self.header.join(", ")));
            self.defect(&format!("a column `{name}`"), &found, cause)
                .at_line(self.header_line)
        })
    }

    /// Index of an optional column.
    pub(super) fn optional_column(&self, name: &str) -> Option<usize> {
        let mut known = self.known.borrow_mut();
        if !known.iter().any(|known| known == name) {
            known.push(name.to_owned());
        }
        self.header.iter().position(|column| column == name)
    }

    /// The next row, or its defect, or `None` at the end.
    pub(super) fn next_row(&mut self) -> Result<Option<Result<Row<'_>, LogError>>, LogError> {
        if !self.advance()? {
            return Ok(None);
        }
        Ok(Some(self.check_row().map(|()| Row { table: self })))
    }

    fn check_row(&self) -> Result<(), LogError> {
        if std::str::from_utf8(&self.record.bytes).is_err() {
            self.text()?;
        }
        let (cells, columns) = (self.record.cells.len(), self.header.len());
        // A trailing separator adds no cell.
        let ends_empty = cells == columns + 1 && self.record.cell(columns).is_empty();
        let header_does = columns == cells + 1 && self.header[cells].is_empty();
        if cells == columns || ends_empty || header_does {
            Ok(())
        } else {
            Err(self.wrong_width())
        }
    }

    /// Reads the next line that is not blank.
    fn advance(&mut self) -> Result<bool, LogError> {
        loop {
            match self.read_line() {
                Ok(false) => return Ok(false),
                Ok(true) if self.record.bytes.is_empty() => {}
                Ok(true) => {
                    self.record.split(self.separator);
                    return Ok(true);
                }
                Err(error) if self.line > 0 && error.kind() == io::ErrorKind::UnexpectedEof => {
                    let cause = "a copy or a download broke off, or the logger lost power: what \
                                 is whole is used";
                    let defect = self.defect("a whole gzip file", "one that ends too early", cause);
                    self.truncated = Some(defect.at_line(self.line));
                    return Ok(false);
                }
                Err(_) if self.line > 0 && self.record.is_zeros() => {
                    let cause = "a file made longer than what was written before the logger lost \
                                 power: what is before them is used";
                    let found = "thousands of zero bytes";
                    let defect = self.defect("text to the end of the file", found, cause);
                    self.truncated = Some(defect.at_line(self.line + 1));
                    return Ok(false);
                }
                Err(error) => return Err(read_failed(&self.path, &error).at_line(self.line + 1)),
            }
        }
    }

    fn read_line(&mut self) -> io::Result<bool> {
        let bytes = &mut self.record.bytes;
        bytes.clear();
        let mut limited = self.source.by_ref().take(MAX_LINE_BYTES);
        if limited.read_until(b'\n', bytes)? == 0 {
            return Ok(false);
        }
        if limited.limit() == 0 && !bytes.ends_with(b"\n") {
            return Err(io::Error::other(LineTooLong));
        }
        while bytes.pop_if(|last| matches!(last, b'\n' | b'\r')).is_some() {}
        if self.line == 0 && bytes.starts_with(BYTE_ORDER_MARK) {
            bytes.drain(..BYTE_ORDER_MARK.len());
        }
        self.line += 1;
        Ok(true)
    }

    fn text(&self) -> Result<Vec<&str>, LogError> {
        let cell = |index| {
            std::str::from_utf8(self.record.cell(index)).map_err(|_| {
                let cause = "saved as UTF-16 or another encoding, or a binary file";
                let character = self.character(index);
                self.defect("UTF-8 text", "bytes that are none", cause)
                    .at_line(self.line)
                    .at_character(character)
            })
        };
        (0..self.record.cells.len()).map(cell).collect()
    }

    fn wrong_width(&self) -> LogError {
        let (cells, columns) = (self.record.cells.len(), self.header.len());
        let cause = if cells < columns {
            "the logger was cut off in mid-line, a separator is missing, or the file is damaged"
        } else {
            "a decimal comma (1,5 for 1.5), or one separator too many"
        };
        let expected = format!("{columns} cells as in the header");
        self.defect(&expected, &cells.to_string(), cause)
            .at_line(self.line)
    }

    /// Position in the line of the first character of a cell.
    fn character(&self, index: usize) -> u64 {
        let cell = self.record.cells.get(index);
        cell.map_or(1, |(start, _)| *start as u64 + 1)
    }

    /// The defect of a table without rows.
    pub(super) fn no_rows(&self) -> LogError {
        let cause = "the logger stopped at the header";
        self.defect("rows under the header", "none", cause)
    }

    fn defect(&self, expected: &str, found: &str, cause: &str) -> LogError {
        LogError::file(&self.path, expected, found, cause)
    }
}

impl Row<'_> {
    /// A cell that must hold a finite number.
    pub(super) fn number(&self, column: usize) -> Result<f64, LogError> {
        let value = self
            .parsed(column)?
            .ok_or_else(|| self.defect(column, "a number", "an empty cell", "a value was lost"))?;
        if value.is_finite() {
            Ok(value)
        } else {
            Err(self.not_finite(column))
        }
    }

    /// A cell that may be empty; a NaN or an infinity counts as such.
    pub(super) fn optional(&self, column: usize) -> Result<Option<f64>, LogError> {
        let value = self.parsed(column)?;
        if value.is_some_and(|value| !value.is_finite()) {
            self.note_lost(self.not_finite(column));
            return Ok(None);
        }
        Ok(value)
    }

    /// Notes a value that is read as empty or left out.
    pub(super) fn note_lost(&self, defect: LogError) {
        self.table.lost.borrow_mut().add(defect);
    }

    fn parsed(&self, column: usize) -> Result<Option<f64>, LogError> {
        // The common case; other cells may have blanks, quotes or a decimal comma.
        let bytes = self.table.record.cell(column);
        if let Ok(number) = fast_float2::parse(bytes) {
            return Ok(Some(number));
        }
        let cell = self.cell(column);
        if cell.is_empty() {
            return Ok(None);
        }
        let number = match self.table.separator {
            b',' => cell.parse(),
            // With other separators a comma is a decimal one.
            _ => cell.replace(',', ".").parse(),
        };
        number.map(Some).map_err(|_| {
            let quoted = format!("\"{}\"", shortened(cell));
            let cause = "text among the numbers, a second header, or a damaged line";
            self.defect(column, "a number", &quoted, cause)
        })
    }

    fn not_finite(&self, column: usize) -> LogError {
        let quoted = format!("\"{}\"", shortened(self.cell(column)));
        self.defect(column, "a finite number", &quoted, NOT_FINITE)
    }

    pub(super) fn cell(&self, column: usize) -> &str {
        // `next_row` has checked both the width and the encoding.
        let bytes = self.table.record.cell(column);
        unquoted(std::str::from_utf8(bytes).unwrap_or_default())
    }

    pub(super) fn defect(
        &self,
        column: usize,
        expected: &str,
        found: &str,
        cause: &str,
    ) -> LogError {
        self.table
            .defect(expected, found, cause)
            .at_line(self.table.line)
            .at_character(self.table.character(column))
            .in_column(&self.table.header[column])
    }
}

/// Whether one name may stand for another: a typing error, or a unit appended.
fn are_alike(a: &str, b: &str) -> bool {
    strsim::osa_distance(a, b) < 2 || a.starts_with(b) || b.starts_with(a)
}

/// A cell without its blanks and its pair of quotes.
fn unquoted(cell: &str) -> &str {
    let cell = cell.trim();
    let inner = cell.strip_prefix('"').and_then(|c| c.strip_suffix('"'));
    inner.unwrap_or(cell).trim()
}

/// The separator, from the header or else the first line.
fn separator(start: &[u8]) -> u8 {
    let lines = || start.split(|&byte| byte == b'\n');
    let names_time = |line: &&[u8]| {
        line.to_ascii_lowercase()
            .windows(3)
            .any(|w| w == TIME.as_bytes())
    };
    let header = lines().find(names_time).or_else(|| lines().next());
    let line = header.unwrap_or_default();
    let count = |separator: u8| line.split(|&byte| byte == separator).count();
    *[b'\t', b';', b',']
        .iter()
        .max_by_key(|&&separator| count(separator))
        .unwrap_or(&b',')
}

fn shortened(text: &str) -> String {
    const LONGEST: usize = 60;
    match text.char_indices().nth(LONGEST) {
        Some((end, _)) => format!("{}...", &text[..end]),
        None => text.to_owned(),
    }
}

/// Whether a file is gzip, by content: files get renamed, and browsers decompress downloads.
pub(super) fn is_gzip(path: &Path) -> io::Result<bool> {
    let mut file = BufReader::new(File::open(path)?);
    Ok(file.fill_buf()?.starts_with(&GZIP_MAGIC))
}

/// A file's bytes, decompressed if it is gzip.
pub(super) fn decompressed(path: &Path) -> io::Result<Box<dyn BufRead>> {
    let file = BufReader::new(File::open(path)?);
    if is_gzip(path)? {
        Ok(Box::new(BufReader::new(MultiGzDecoder::new(file))))
    } else {
        Ok(Box::new(file))
    }
}

fn read_failed(path: &Path, error: &io::Error) -> LogError {
    if error
        .get_ref()
        .is_some_and(<dyn std::error::Error + Send + Sync>::is::<LineTooLong>)
    {
        let expected = format!("lines of at most {MAX_LINE_BYTES} bytes");
        let cause = "not a table of numbers, or its line ends are lost (old Mac style)";
        return LogError::file(path, expected, "a longer one", cause);
    }
    match error.kind() {
        io::ErrorKind::NotFound => {
            LogError::file(path, "a file", "none", "a wrong folder or a misspelt name")
        }
        io::ErrorKind::UnexpectedEof => {
            let cause = "a copy or a download broke off, or the logger lost power: unpack what \
                         is whole with `gzip -dc` and cut the last line";
            LogError::file(path, "a whole gzip file", "one that ends too early", cause)
        }
        io::ErrorKind::InvalidInput | io::ErrorKind::InvalidData => LogError::file(
            path,
            "an intact gzip file",
            error.to_string(),
            "a damaged file",
        ),
        _ => LogError::file(
            path,
            "a readable file",
            error.to_string(),
            "permissions or the disk",
        ),
    }
}

#[derive(Debug, thiserror::Error)]
#[error("line too long")]
struct LineTooLong;
