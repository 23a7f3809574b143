//! Generated parts of the pages.

use std::fs;
use std::path::Path;

use ins_tests::pages::{Pages, tables_of};

#[test]
fn only_the_part_of_a_page_is_replaced() {
    let root = tempfile::tempdir().unwrap();
    let [readme, page] = ["README.md", "docs/a.md"].map(|name| root.path().join(name));
    let front = "front <!-- begin: y -->";
    fs::create_dir(root.path().join("docs")).unwrap();
    fs::write(&readme, front).unwrap();
    fs::write(&page, "a\n<!-- begin: x -->\nold\n<!-- end: x -->\nb").unwrap();
    let mut pages = Pages::read(root.path()).unwrap();
    pages.replace("x", "new\n").unwrap();
    assert!(pages.replace("y", "new").is_err());
    assert!(pages.replace("z", "new").is_err());
    // An unchanged page is not written.
    fs::write(&readme, "worked on").unwrap();
    pages.write().unwrap();
    let expected = "a\n<!-- begin: x -->\nnew\n<!-- end: x -->\nb";
    assert_eq!(fs::read_to_string(page).unwrap(), expected);
    assert_eq!(fs::read_to_string(readme).unwrap(), "worked on");
}

#[test]
fn tables_are_extracted_from_other_output() {
    let text = "Benchmarking...\n| a |\n|---|\n| 1 |\ntime: 3 s\n\n| b |\n|---|\n";
    let tables = tables_of(text, Path::new("cost.txt")).unwrap();
    assert_eq!(tables, "| a |\n|---|\n| 1 |\n\n| b |\n|---|");
    assert!(tables_of("nothing\n", Path::new("cost.txt")).is_err());
}
