//! Layering: a room of `host_sim` only uses those above it in lib.rs, and there is no cycle between
//! files.
//!
//! A file uses another if a path in its code refers to it; re-exports by `pub use` are resolved. Tests
//! within a file may use anything.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::Path;

use syn::punctuated::Punctuated;
use syn::visit::{self, Visit};
use syn::{Attribute, Expr, Item, ItemMod, ItemUse, Macro, Token, UseTree, Visibility};

/// Limits of rooms at the first level and of public ones.
const ROOMS: usize = 16;
const PUBLIC: usize = 9;

/// Path of a module within the crate; empty for the crate root.
type Module = Vec<String>;
type Graph = BTreeMap<Module, BTreeSet<Module>>;

/// References of a file to other files.
struct File<'a> {
    module: &'a Module,
    modules: &'a BTreeMap<Module, String>,
    uses: Vec<Module>,
    /// Re-exports by `pub use`, by their new names.
    exports: BTreeMap<String, Module>,
    /// Paths of a single segment.
    names: BTreeSet<String>,
}

impl File<'_> {
    /// Resolved path; `None` outside of the crate.
    fn absolute(&self, path: &[String]) -> Option<Module> {
        let mut from = match path.first()?.as_str() {
            "crate" => Module::new(),
            "self" | "super" => self.module.clone(),
            child => {
                let child = [self.module.as_slice(), &[child.to_owned()]].concat();
                return (self.modules.contains_key(&child))
                    .then(|| [self.module.as_slice(), path].concat());
            }
        };
        for part in path {
            match part.as_str() {
                "crate" | "self" => {}
                "super" => drop(from.pop()),
                name => from.push(name.to_owned()),
            }
        }
        Some(from)
    }
}

fn is_test(attributes: &[Attribute]) -> bool {
    let test = |attribute: &Attribute| {
        let list = attribute.meta.require_list();
        list.is_ok_and(|list| list.path.is_ident("cfg") && list.tokens.to_string() == "test")
    };
    attributes.iter().any(test)
}

/// All paths of a use tree, with their names.
fn leaves(tree: &UseTree, path: &mut Module, found: &mut Vec<(String, Module)>) {
    let mut leaf = |last: Option<String>, name: String| {
        found.push((name, path.iter().cloned().chain(last).collect()));
    };
    match tree {
        UseTree::Name(name) => leaf(Some(name.ident.to_string()), name.ident.to_string()),
        UseTree::Rename(name) => leaf(Some(name.ident.to_string()), name.rename.to_string()),
        UseTree::Glob(_) => leaf(None, "*".to_owned()),
        UseTree::Group(group) => group
            .items
            .iter()
            .for_each(|item| leaves(item, path, found)),
        UseTree::Path(inner) => {
            path.push(inner.ident.to_string());
            leaves(&inner.tree, path, found);
            path.pop();
        }
    }
}

impl<'ast> Visit<'ast> for File<'_> {
    fn visit_item_mod(&mut self, item: &'ast ItemMod) {
        if !is_test(&item.attrs) {
            visit::visit_item_mod(self, item);
        }
    }

    fn visit_item_use(&mut self, item: &'ast ItemUse) {
        let mut found = Vec::new();
        leaves(&item.tree, &mut Module::new(), &mut found);
        for (name, path) in found {
            let Some(path) = self.absolute(&path) else {
                continue;
            };
            match item.vis {
                Visibility::Inherited => self.uses.push(path),
                _ => drop(self.exports.insert(name, path)),
            }
        }
    }

    fn visit_path(&mut self, path: &'ast syn::Path) {
        let segments = path.segments.iter();
        let path_of: Module = segments.map(|part| part.ident.to_string()).collect();
        match path_of.as_slice() {
            [name] => drop(self.names.insert(name.clone())),
            _ => self.uses.extend(self.absolute(&path_of)),
        }
        visit::visit_path(self, path);
    }

    fn visit_macro(&mut self, call: &'ast Macro) {
        let arguments = call.parse_body_with(Punctuated::<Expr, Token![,]>::parse_terminated);
        // The expressions live no longer than this.
        for argument in arguments.into_iter().flatten() {
            File::visit_expr(self, &argument);
        }
    }
}

fn graph(modules: &BTreeMap<Module, String>) -> Graph {
    let parsed = modules.iter().map(|(module, text)| {
        let mut file = File {
            module,
            modules,
            uses: Vec::new(),
            exports: BTreeMap::new(),
            names: BTreeSet::new(),
        };
        file.visit_file(&syn::parse_file(text).unwrap());
        let own = (file.exports.iter()).filter(|(name, _)| file.names.contains(*name));
        file.uses.extend(own.map(|(_, path)| path.clone()));
        (module.clone(), file)
    });
    let files: BTreeMap<Module, File> = parsed.collect();
    let resolve = |path: &Module| {
        let mut path = path.clone();
        loop {
            let length = (0..=path.len())
                .rev()
                .find(|&n| files.contains_key(&path[..n]));
            let (module, rest) = path.split_at(length.unwrap());
            let exports = &files[module].exports;
            match rest
                .split_first()
                .and_then(|(name, rest)| Some((exports.get(name)?, rest)))
            {
                Some((export, rest)) => path = [export.as_slice(), rest].concat(),
                None => return module.to_vec(),
            }
        }
    };
    let uses = |(module, file): (&Module, &File)| {
        let uses = file.uses.iter().map(resolve).filter(|used| used != module);
        (module.clone(), uses.collect())
    };
    files.iter().map(uses).collect()
}

/// The same between rooms of the first level.
fn rooms(files: &Graph) -> Graph {
    let mut rooms = Graph::new();
    for (module, uses) in files {
        let Some(room) = module.first() else { continue };
        let used = uses.iter().filter_map(|used| used.first());
        let used = used
            .filter(|used| *used != room)
            .map(|used| vec![used.clone()]);
        rooms.entry(vec![room.clone()]).or_default().extend(used);
    }
    rooms
}

/// Edges that remain after removal of all nodes outside of cycles.
fn cycles(mut graph: Graph) -> Vec<String> {
    loop {
        let all: BTreeSet<Module> = graph.keys().cloned().collect();
        let used: BTreeSet<Module> = graph.values().flatten().cloned().collect();
        let before = graph.len();
        graph.retain(|module, uses| {
            uses.retain(|used| all.contains(used));
            !uses.is_empty() && used.contains(module)
        });
        if graph.len() == before {
            break;
        }
    }
    let edge = |(module, uses): (&Module, &BTreeSet<Module>)| {
        let uses: Vec<String> = uses.iter().map(|used| used.join("::")).collect();
        format!("{} uses {}", module.join("::"), uses.join(", "))
    };
    graph.iter().map(edge).collect()
}

fn sources(of: &str) -> BTreeMap<Module, String> {
    let src = Path::new(env!("CARGO_MANIFEST_DIR")).join(of).join("src");
    let (mut folders, mut sources) = (vec![src.clone()], BTreeMap::new());
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|end| end == "rs") {
                let inner = path.strip_prefix(&src).unwrap().with_extension("");
                let parts = inner.iter().map(|part| part.to_str().unwrap().to_owned());
                let mut module: Module = parts.collect();
                module.pop_if(|last| ["mod", "lib"].contains(&last.as_str()));
                // The binary is a separate crate.
                if module != ["main"] {
                    sources.insert(module, fs::read_to_string(path).unwrap());
                }
            }
        }
    }
    sources
}

/// Rooms in the order of lib.rs, and whether they are public.
fn crate_modules(sources: &BTreeMap<Module, String>) -> Vec<(String, bool)> {
    let crate_root = syn::parse_file(&sources[&Module::new()]).unwrap();
    let room = |item: &Item| match item {
        Item::Mod(room) => Some((
            room.ident.to_string(),
            matches!(room.vis, Visibility::Public(_)),
        )),
        _ => None,
    };
    crate_root.items.iter().filter_map(room).collect()
}

/// Uses of rooms that are not above.
fn violations(sources: &BTreeMap<Module, String>, files: &Graph) -> Vec<String> {
    let rooms_in_order = crate_modules(sources);
    let order = |room: &Module| rooms_in_order.iter().position(|(name, _)| *name == room[0]);
    let mut found = Vec::new();
    for (room, uses) in rooms(files) {
        let below = uses.iter().filter(|used| order(used) >= order(&room));
        found.extend(below.map(|used| format!("{} uses {}", room[0], used[0])));
    }
    found
}

#[test]
fn rooms_use_only_those_above_and_files_have_no_cycle() {
    let sources = sources(".");
    let files = graph(&sources);
    assert!(files.len() > 100, "{} files", files.len());
    assert_eq!(violations(&sources, &files), [""; 0]);
    assert_eq!(cycles(files), [""; 0]);
}

#[test]
fn files_of_the_core_have_no_cycle() {
    let sources = sources("../core");
    let files = graph(&sources);
    assert!(files.len() > 30, "{} files", files.len());
    assert_eq!(cycles(files), [""; 0]);
    let public = crate_modules(&sources)
        .iter()
        .filter(|(_, public)| *public)
        .count();
    assert!(public <= 8, "{public} public modules");
}

#[test]
fn numbers_of_rooms_and_public_rooms_are_limited() {
    let rooms = crate_modules(&sources("."));
    let public = rooms.iter().filter(|(_, public)| *public).count();
    assert!(
        rooms.len() <= ROOMS && public <= PUBLIC,
        "{} rooms, {public} public",
        rooms.len()
    );
}

#[test]
fn cycles_are_detected() {
    let source = |module: &[&str], text: &str| {
        let module: Module = module.iter().map(|part| (*part).to_owned()).collect();
        (module, text.to_owned())
    };
    let valid = [
        source(&[], "pub mod page; pub mod log;"),
        source(
            &["page"],
            "pub fn digits() {} #[cfg(test)] mod tests { use crate::log::Log; }",
        ),
        source(&["log"], "mod read; pub use read::Log;"),
        source(
            &["log", "read"],
            "pub struct Log; fn f() { vec![crate::page::digits()]; }",
        ),
    ];
    let all = valid.clone().into();
    assert_eq!(violations(&all, &graph(&all)), [""; 0]);
    assert_eq!(cycles(graph(&all)), [""; 0]);
    let mut invalid = valid;
    invalid[1].1 = "pub fn digits(log: &crate::log::Log) {}".to_owned();
    let all = invalid.into();
    let files = graph(&all);
    assert_eq!(violations(&all, &files), ["page uses log"]);
    assert_eq!(
        cycles(files),
        ["log::read uses page", "page uses log::read"]
    );
}
