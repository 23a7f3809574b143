//! Pages with generated parts between markers `<!-- begin: NAME -->` and `<!-- end: NAME -->`: the README and all of
//! docs/.

use std::fs;
use std::path::{Path, PathBuf};

use miette::{Result, miette};

/// All pages in memory.
#[derive(Debug)]
pub struct Pages(Vec<Page>);

#[derive(Debug)]
struct Page {
    path: PathBuf,
    text: String,
    changed: bool,
}

impl Page {
    fn read(path: PathBuf) -> Result<Self> {
        let text = fs::read_to_string(&path).map_err(|error| {
            miette!(
                help = "run in the top folder of the repository, or say --repository",
                "{}: {error}",
                path.display()
            )
        })?;
        Ok(Self {
            path,
            text,
            changed: false,
        })
    }

    /// Start and end of a part, without its markers.
    fn range(&self, name: &str) -> Option<(usize, usize)> {
        let begin = marker("begin", name);
        let from = self.text.find(&begin)? + begin.len();
        let length = self.text[from..].find(&marker("end", name))?;
        Some((from, from + length))
    }
}

impl Pages {
    /// The README in a folder, and the Markdown files of its docs/.
    pub fn read(root: &Path) -> Result<Self> {
        let mut paths = vec![root.join("README.md")];
        let docs = root.join("docs").read_dir().into_iter().flatten().flatten();
        let docs = docs.map(|entry| entry.path());
        paths.extend(docs.filter(|path| path.extension().is_some_and(|end| end == "md")));
        paths
            .into_iter()
            .map(Page::read)
            .collect::<Result<_>>()
            .map(Self)
    }

    /// The page with a part, its start and end.
    fn find(&mut self, name: &str) -> Result<(&mut Page, usize, usize)> {
        let found = self.0.iter_mut().find_map(|page| {
            let (from, to) = page.range(name)?;
            Some((page, from, to))
        });
        found.ok_or_else(|| {
            miette!(
                help = "write both markers where the part belongs",
                "neither README.md nor a page of docs/ has {} ... {}",
                marker("begin", name),
                marker("end", name)
            )
        })
    }

    /// Fails unless a page has a part.
    pub fn check(&mut self, name: &str) -> Result<()> {
        self.find(name).map(drop)
    }

    /// Replaces the text of a part.
    pub fn replace(&mut self, name: &str, text: &str) -> Result<()> {
        let (page, from, to) = self.find(name)?;
        let text = format!("\n{}\n", text.trim());
        page.text.replace_range(from..to, &text);
        page.changed = true;
        Ok(())
    }

    /// Writes changed pages.
    pub fn write(&self) -> Result<()> {
        for page in self.0.iter().filter(|page| page.changed) {
            write(&page.path, &page.text)?;
        }
        Ok(())
    }
}

fn marker(kind: &str, name: &str) -> String {
    format!("<!-- {kind}: {name} -->")
}

/// Markdown tables in a program's output, separated by empty lines.
pub fn tables_of(text: &str, file: &Path) -> Result<String> {
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

/// The first example of a crate's documentation, without hidden lines.
pub fn example(file: &Path) -> Result<String> {
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

/// Writes a picture into docs/.
pub fn picture(root: &Path, name: &str, svg: &str) -> Result<()> {
    write(&root.join("docs").join(name), svg)
}

fn write(path: &Path, text: &str) -> Result<()> {
    fs::write(path, text).map_err(|e| miette!("{}: {e}", path.display()))
}
