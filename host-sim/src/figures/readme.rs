//! The README with parts between markers: `<!-- begin: NAME -->` and `<!-- end: NAME -->`.

use std::fs;
use std::path::{Path, PathBuf};

use miette::{Result, miette};

use crate::output::{self, OutputError};

/// The README in memory.
pub(super) struct Readme {
    path: PathBuf,
    text: String,
}

impl Readme {
    pub(super) fn read(path: &Path) -> Result<Self> {
        let text = fs::read_to_string(path).map_err(|error| {
            miette!(
                help = "run in the top folder of the repository, or say --repository",
                "{}: {error}",
                path.display()
            )
        })?;
        Ok(Self {
            path: path.to_owned(),
            text,
        })
    }

    pub(super) fn write(&self) -> Result<(), OutputError> {
        output::replace(&self.path, &self.text)
    }

    /// Where a part begins and ends, markers left out.
    fn place(&self, name: &str) -> Result<(usize, usize)> {
        let (begin, end) = (marker("begin", name), marker("end", name));
        let place = self.text.find(&begin).and_then(|at| {
            let from = at + begin.len();
            let length = self.text[from..].find(&end)?;
            Some((from, from + length))
        });
        place.ok_or_else(|| {
            miette!(
                help = "write both markers where the part belongs",
                "{}: no {begin} ... {end}",
                self.path.display()
            )
        })
    }

    pub(super) fn check(&self, name: &str) -> Result<()> {
        self.place(name).map(drop)
    }

    pub(super) fn replace(&mut self, name: &str, text: &str) -> Result<()> {
        let (from, to) = self.place(name)?;
        let text = format!("\n{}\n", text.trim());
        self.text.replace_range(from..to, &text);
        Ok(())
    }
}

fn marker(kind: &str, name: &str) -> String {
    format!("<!-- {kind}: {name} -->")
}

/// The Markdown tables among what a program has printed, an empty line between two.
pub(super) fn tables_of(text: &str, file: &Path) -> Result<String> {
    let lines: Vec<&str> = text
        .lines()
        .map(|line| if line.starts_with('|') { line } else { "" })
        .collect();
    let tables = lines.join("\n");
    let tables: Vec<&str> = tables
        .split("\n\n")
        .map(str::trim)
        .filter(|table| !table.is_empty())
        .collect();
    if tables.is_empty() {
        return Err(miette!("{}: no Markdown table in it", file.display()));
    }
    Ok(tables.join("\n\n"))
}

/// The first example of a crate's documentation, without what it hides from readers.
pub(super) fn example(file: &Path) -> Result<String> {
    let text = fs::read_to_string(file).map_err(|e| miette!("{}: {e}", file.display()))?;
    let code: Vec<&str> = text
        .lines()
        .map_while(|line| line.strip_prefix("//!"))
        .map(|line| line.strip_prefix(' ').unwrap_or(line))
        .skip_while(|line| !line.starts_with("```"))
        .skip(1)
        .take_while(|line| !line.starts_with("```"))
        .filter(|line| !line.starts_with("# "))
        .collect();
    if code.is_empty() {
        return Err(miette!("{}: no example in it", file.display()));
    }
    Ok(format!("```rust\n{}\n```", code.join("\n")))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_part_is_replaced_and_nothing_else() {
        let mut readme = Readme {
            path: "README.md".into(),
            text: "a\n<!-- begin: x -->\nold\n<!-- end: x -->\nb <!-- begin: y -->".to_owned(),
        };
        readme.replace("x", "new\n").unwrap();
        let expected = "a\n<!-- begin: x -->\nnew\n<!-- end: x -->\nb <!-- begin: y -->";
        assert_eq!(readme.text, expected);
        assert!(readme.replace("y", "new").is_err());
        assert!(readme.replace("z", "new").is_err());
        assert_eq!(readme.text, expected);
    }

    #[test]
    fn tables_are_found_among_other_output() {
        let text = "Benchmarking...\n| a |\n|---|\n| 1 |\ntime: 3 s\n\n| b |\n|---|\n";
        let tables = tables_of(text, Path::new("cost.txt")).unwrap();
        assert_eq!(tables, "| a |\n|---|\n| 1 |\n\n| b |\n|---|");
        assert!(tables_of("nothing\n", Path::new("cost.txt")).is_err());
    }
}
