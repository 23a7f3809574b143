//! Links of the documentation exist, and the README stays short.

use std::fs;
use std::path::{Path, PathBuf};

use ins_tests::cargo::repository;

const LONGEST_README: usize = 190;

fn pages() -> Vec<PathBuf> {
    let root = repository();
    let docs = fs::read_dir(root.join("docs")).expect("there is docs/");
    let docs = docs.map(|entry| entry.expect("docs/ can be listed").path());
    let front = ["README.md", "CONTRIBUTING.md", "firmware-example/README.md"];
    let mut pages: Vec<_> = front.iter().map(|name| root.join(name)).collect();
    pages.extend(docs.filter(|path| path.extension().is_some_and(|end| end == "md")));
    pages
}

fn read(path: &Path) -> String {
    fs::read_to_string(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

/// Lines outside of code blocks.
fn prose(text: &str) -> impl Iterator<Item = &str> {
    let mut code = false;
    text.lines().filter(move |line| {
        let fence = line.trim_start().starts_with("```");
        code ^= fence;
        !(code || fence)
    })
}

/// Targets of `](...)`.
fn links(text: &str) -> Vec<&str> {
    prose(text)
        .flat_map(|line| line.split("](").skip(1))
        .filter_map(|rest| rest.split_once(')').map(|(link, _)| link))
        .filter(|link| !link.contains("://"))
        .collect()
}

/// Anchors that GitHub makes of the headings.
fn anchors(text: &str) -> Vec<String> {
    prose(text)
        .filter_map(|line| line.strip_prefix('#'))
        .map(|heading| {
            let heading = heading.trim_start_matches('#').trim().to_lowercase();
            let is_kept = |c: &char| c.is_alphanumeric() || " -_".contains(*c);
            heading.chars().filter(is_kept).collect::<String>()
        })
        .map(|heading| heading.replace(' ', "-"))
        .collect()
}

#[test]
fn every_link_and_anchor_exists() {
    let mut broken = Vec::new();
    for page in pages() {
        let text = read(&page);
        for link in links(&text) {
            let (path, anchor) = link.split_once('#').unwrap_or((link, ""));
            let target = match path {
                "" => page.clone(),
                path => page.with_file_name(path),
            };
            let found = target.exists()
                && (anchor.is_empty() || anchors(&read(&target)).iter().any(|a| a == anchor));
            if !found {
                broken.push(format!("{}: {link}", page.display()));
            }
        }
    }
    assert!(broken.is_empty(), "{}", broken.join("\n"));
}

#[test]
fn every_generated_part_has_unique_markers() {
    let mut names = Vec::new();
    for page in pages() {
        let text = read(&page);
        let begins = prose(&text).filter_map(|line| line.strip_prefix("<!-- begin: "));
        for name in begins.filter_map(|rest| rest.strip_suffix(" -->")) {
            let end = format!("<!-- end: {name} -->");
            assert_eq!(text.matches(&end).count(), 1, "{}: {end}", page.display());
            names.push(name.to_owned());
        }
    }
    assert!(!names.is_empty());
    names.sort_unstable();
    let twice = names.windows(2).find(|pair| pair[0] == pair[1]);
    assert!(twice.is_none(), "duplicate: {twice:?}");
}

#[test]
fn the_readme_is_short_and_links_every_page() {
    let front = read(&repository().join("README.md"));
    let lines = front.lines().count();
    assert!(lines <= LONGEST_README, "{lines} lines");
    let links = links(&front);
    for page in pages() {
        let path = page.strip_prefix(repository()).expect("a page of ours");
        let name = path.to_string_lossy().replace('\\', "/");
        let named = name == "README.md" || links.iter().any(|link| link.starts_with(&name));
        assert!(named, "{name} is not in the README");
    }
}
