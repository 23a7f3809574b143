//! Tables as text: aligned for a terminal, or in Markdown.

use std::fmt::Write as _;

use serde::Serialize;

/// A table with its title, which may be empty.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Table {
    pub title: String,
    pub header: Vec<String>,
    pub rows: Vec<Vec<String>>,
}

impl Table {
    pub(crate) fn of(
        title: impl Into<String>,
        header: Vec<String>,
        rows: impl IntoIterator<Item = Vec<String>>,
    ) -> Self {
        Self {
            title: title.into(),
            header,
            rows: rows.into_iter().collect(),
        }
    }

    /// Without columns that are empty throughout.
    pub(crate) fn filled(mut self) -> Self {
        let has = |row: &Vec<String>, at: usize| row.get(at).is_some_and(|cell| !cell.is_empty());
        let filled = |at: &usize| self.rows.iter().any(|row| has(row, *at));
        let kept: Vec<usize> = (0..self.header.len()).filter(filled).collect();
        for row in self.rows.iter_mut().chain([&mut self.header]) {
            let cells = kept.iter().filter_map(|at| row.get(*at).cloned());
            *row = cells.collect();
        }
        self
    }

    /// For a terminal, without the title.
    pub(crate) fn plain(&self) -> String {
        plain(&self.header, &self.rows)
    }

    /// For a page of the documentation, without the title.
    pub fn markdown(&self) -> String {
        markdown(&self.header, &self.rows)
    }
}

/// All tables in a format, each under its title.
pub(crate) fn titled(tables: &[Table], form: fn(&Table) -> String) -> String {
    let text = |table: &Table| format!("{}\n\n{}", table.title, form(table));
    tables.iter().map(text).collect::<Vec<_>>().join("\n")
}

/// Aligned with spaces: the first column and sentences to the left, the others to the right.
pub fn plain(header: &[String], rows: &[Vec<String>]) -> String {
    let all = || std::iter::once(header).chain(rows.iter().map(Vec::as_slice));
    let width = |column: usize| {
        all()
            .filter_map(|row| row.get(column))
            .map(|cell| cell.chars().count())
            .max()
            .unwrap_or(0)
    };
    let widths: Vec<usize> = (0..header.len()).map(width).collect();
    let is_prose = |cell: &String| cell.split(' ').count() > 5;
    let in_rows = |column: usize| rows.iter().filter_map(move |row| row.get(column));
    let is_left = |column| column == 0 || in_rows(column).any(is_prose);
    let left: Vec<bool> = (0..header.len()).map(is_left).collect();
    let mut text = String::new();
    for row in all() {
        let mut line = String::new();
        for (column, (cell, width)) in row.iter().zip(&widths).enumerate() {
            // Writing into a string cannot fail.
            let gap = if column == 0 { "" } else { "  " };
            let _ = if left[column] {
                write!(line, "{gap}{cell:<width$}")
            } else {
                write!(line, "{gap}{cell:>width$}")
            };
        }
        text.push_str(line.trim_end());
        text.push('\n');
    }
    text
}

/// A row for each name, in order of first appearance, with its cell in each column.
pub(crate) fn side_by_side(columns: &[Vec<(String, String)>]) -> Vec<Vec<String>> {
    let mut rows: Vec<Vec<String>> = Vec::new();
    for (name, _) in columns.iter().flatten() {
        if rows.iter().any(|row| row[0] == *name) {
            continue;
        }
        let cell = |column: &Vec<(String, String)>| {
            let found = column.iter().find(|(other, _)| other == name);
            found.map_or(String::new(), |(_, cell)| cell.clone())
        };
        rows.push(
            [name.clone()]
                .into_iter()
                .chain(columns.iter().map(cell))
                .collect(),
        );
    }
    rows
}

/// Column heads, written as in a table of Markdown.
pub fn heads(line: &str) -> Vec<String> {
    line.split('|').map(|head| head.trim().to_owned()).collect()
}

/// Column heads, or a row.
pub fn cells<const N: usize>(texts: [&str; N]) -> Vec<String> {
    texts.map(str::to_owned).to_vec()
}

pub fn markdown(header: &[String], rows: &[Vec<String>]) -> String {
    let line = |cells: &[String]| {
        let cells: Vec<String> = cells.iter().map(|cell| cell.replace('|', "\\|")).collect();
        format!("| {} |\n", cells.join(" | "))
    };
    let rule = format!("|{}\n", "---|".repeat(header.len()));
    let rows: String = rows.iter().map(|row| line(row)).collect();
    line(header) + &rule + &rows
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_are_as_wide_as_their_widest_cell() {
        let cells = |row: [&str; 2]| row.map(str::to_owned).to_vec();
        let (header, rows) = (cells(["", "ms"]), [cells(["tau", "121.8"])]);
        assert_eq!(plain(&header, &rows), "        ms\ntau  121.8\n");
        assert_eq!(
            markdown(&header, &rows),
            "|  | ms |\n|---|---|\n| tau | 121.8 |\n"
        );
        let half = Table::of("", header, [cells(["tau", ""])]).filled();
        assert_eq!((half.header.len(), half.rows[0].len()), (1, 1));
        let header = cells(["", "of a long name of many words"]);
        let text = plain(&header, &rows);
        assert!(text.lines().all(|line| line.len() == 33), "{text}");
        let bar = [cells(["a | b", "1"])];
        assert!(markdown(&header, &bar).ends_with("| a \\| b | 1 |\n"));
    }
}
