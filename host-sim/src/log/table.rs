//! A table of numbers in a text file, plain or gzip, read line by line with bounded memory.

use std::fmt;
use std::fs::File;
use std::io::{self, BufRead, BufReader, Read};
use std::path::{Path, PathBuf};

use csv::{ByteRecord, ReaderBuilder};
use flate2::bufread::MultiGzDecoder;

use super::error::LogError;

/// Longest credible line: 60 columns of 20 characters and ample room.
const MAX_LINE_BYTES: usize = 16 * 1024;
const GZIP_MAGIC: [u8; 2] = [0x1f, 0x8b];

/// A file with a header line and rows of numbers.
pub(super) struct Table {
    path: PathBuf,
    reader: csv::Reader<LimitedLines>,
    header: Vec<String>,
    record: ByteRecord,
    line: u64,
}

/// One row, to be read cell by cell.
pub(super) struct Row<'a> {
    table: &'a Table,
}

impl Table {
    /// Opens `path` and reads its header.
    pub(super) fn open(path: &Path) -> Result<Self, LogError> {
        let source = open_text(path).map_err(|e| read_failed(path, &e))?;
        let reader = ReaderBuilder::new()
            .has_headers(false)
            .flexible(true)
            // A stray quote must not swallow the rest of the file into one cell.
            .quoting(false)
            .from_reader(LimitedLines {
                source,
                line_bytes: 0,
            });
        let mut table = Self {
            path: path.to_path_buf(),
            reader,
            header: Vec::new(),
            record: ByteRecord::new(),
            line: 0,
        };
        if !table.advance()? {
            let cause = "the logger never wrote to it, or a copy failed";
            return Err(table.defect("a header line and rows", "an empty file", cause));
        }
        let header = table.text()?;
        table.header = header.iter().map(|cell| cell.trim().to_owned()).collect();
        Ok(table)
    }

    /// Index of a column that must be there.
    pub(super) fn column(&self, name: &str) -> Result<usize, LogError> {
        self.optional_column(name).ok_or_else(|| {
            let cause = match self.header.len() {
                1 => "cells must be separated by commas: semicolons or tabs are not read",
                _ => {
                    "a column of another name or a headerless file; where the source has no \
                      such value keep the column and leave its cells empty (gnss.csv)"
                }
            };
            let found = format!("columns {}", shortened(&self.header.join(", ")));
            self.defect(&format!("a column `{name}`"), &found, cause)
                .at_line(self.line)
        })
    }

    /// Index of a column that may be missing.
    pub(super) fn optional_column(&self, name: &str) -> Option<usize> {
        self.header.iter().position(|column| column == name)
    }

    /// The next row, or `None` at the end.
    pub(super) fn next_row(&mut self) -> Result<Option<Row<'_>>, LogError> {
        if !self.advance()? {
            return Ok(None);
        }
        self.text()?;
        if self.record.len() == self.header.len() {
            Ok(Some(Row { table: self }))
        } else {
            Err(self.wrong_width())
        }
    }

    fn advance(&mut self) -> Result<bool, LogError> {
        let more = self.reader.read_byte_record(&mut self.record);
        match more {
            Ok(more) => {
                self.line = self
                    .record
                    .position()
                    .map_or(self.line, csv::Position::line);
                Ok(more)
            }
            Err(error) => Err(self.unreadable(&error)),
        }
    }

    fn unreadable(&self, error: &csv::Error) -> LogError {
        match error.kind() {
            csv::ErrorKind::Io(error) => read_failed(&self.path, error),
            _ => self.defect(
                "a comma-separated line",
                &error.to_string(),
                "a damaged file",
            ),
        }
        .at_line(self.line + 1)
    }

    fn text(&self) -> Result<Vec<&str>, LogError> {
        let cell = |(index, bytes)| {
            std::str::from_utf8(bytes).map_err(|_| {
                let cause = "saved as UTF-16 or another encoding, or a binary file";
                let character = self.character(index);
                self.defect("UTF-8 text", "bytes that are none", cause)
                    .at_line(self.line)
                    .at_character(character)
            })
        };
        self.record.iter().enumerate().map(cell).collect()
    }

    fn wrong_width(&self) -> LogError {
        let (cells, columns) = (self.record.len(), self.header.len());
        let cause = if cells < columns {
            "the logger was cut off in mid-line, a separator is missing, or the file is damaged"
        } else {
            "a decimal comma (1,5 for 1.5), or one separator too many"
        };
        let expected = format!("{columns} cells as in the header");
        self.defect(&expected, &cells.to_string(), cause)
            .at_line(self.line)
    }

    /// Character in the line where a cell begins.
    fn character(&self, index: usize) -> u64 {
        let before: usize = self
            .record
            .iter()
            .take(index)
            .map(|cell| cell.len() + 1)
            .sum();
        before as u64 + 1
    }

    fn defect(&self, expected: &str, found: &str, cause: &str) -> LogError {
        LogError::file(&self.path, expected, found, cause)
    }
}

impl Row<'_> {
    /// A cell that must hold a finite number.
    pub(super) fn number(&self, column: usize) -> Result<f64, LogError> {
        let cause = "a value was lost: leave such rows out";
        self.optional(column)?
            .ok_or_else(|| self.defect(column, "a number", "an empty cell", cause))
    }

    /// A cell that may be empty.
    pub(super) fn optional(&self, column: usize) -> Result<Option<f64>, LogError> {
        let cell = self.cell(column);
        if cell.is_empty() {
            return Ok(None);
        }
        let quoted = format!("\"{}\"", shortened(cell));
        match cell.parse::<f64>() {
            Ok(value) if value.is_finite() => Ok(Some(value)),
            Ok(_) => {
                let cause = "a lost value or a division by zero in the logger: leave such rows \
                             out, or the cell empty if it is GNSS";
                Err(self.defect(column, "a finite number", &quoted, cause))
            }
            Err(_) => {
                let cause = "text among the numbers, a second header, or a damaged line";
                Err(self.defect(column, "a number", &quoted, cause))
            }
        }
    }

    /// The text of a cell.
    pub(super) fn cell(&self, column: usize) -> &str {
        // `next_row` has checked both the width and the encoding.
        let bytes = self.table.record.get(column).unwrap_or_default();
        std::str::from_utf8(bytes).unwrap_or_default().trim()
    }

    /// A defect of one cell of this row.
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

fn shortened(text: &str) -> String {
    const LONGEST: usize = 60;
    match text.char_indices().nth(LONGEST) {
        Some((end, _)) => format!("{}...", &text[..end]),
        None => text.to_owned(),
    }
}

fn open_text(path: &Path) -> io::Result<Box<dyn BufRead>> {
    let mut file = BufReader::new(File::open(path)?);
    // By content: files get renamed, and browsers unpack what they download.
    if file.fill_buf()?.starts_with(&GZIP_MAGIC) {
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

/// Passes bytes on until a line grows absurdly long.
struct LimitedLines {
    source: Box<dyn BufRead>,
    line_bytes: usize,
}

impl Read for LimitedLines {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let count = self.source.read(buffer)?;
        for part in buffer[..count].split_inclusive(|&byte| byte == b'\n') {
            self.line_bytes += part.len();
            if self.line_bytes > MAX_LINE_BYTES {
                return Err(io::Error::other(LineTooLong));
            }
            if part.ends_with(b"\n") {
                self.line_bytes = 0;
            }
        }
        Ok(count)
    }
}

#[derive(Debug)]
struct LineTooLong;

impl fmt::Display for LineTooLong {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("line too long")
    }
}

impl std::error::Error for LineTooLong {}
