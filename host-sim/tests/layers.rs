//! Layers that only look down: a room of `host_sim` uses those above it in lib.rs, and there is no
//! circle between files.
//!
//! A file uses another where a path in its code leads there; what `pub use` hands on is followed to
//! where it stands. Tests within a file may look anywhere.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::Path;

use syn::punctuated::Punctuated;
use syn::visit::{self, Visit};
use syn::{Attribute, Expr, Item, ItemMod, ItemUse, Macro, Token, UseTree, Visibility};

/// Most rooms at the first level, and most of them public.
const ROOMS: usize = 16;
const PUBLIC: usize = 9;

/// Path of a module from the crate on; empty is the crate.
type Module = Vec<String>;
type Graph = BTreeMap<Module, BTreeSet<Module>>;

/// What a file says of other files.
struct File<'a> {
    module: &'a Module,
    modules: &'a BTreeMap<Module, String>,
    uses: Vec<Module>,
    /// What `pub use` hands on, by the name it then has.
    exports: BTreeMap<String, Module>,
    /// Names that stand alone.
    names: BTreeSet<String>,
}

impl File<'_> {
    /// Where a path leads to; `None` outside of the crate.
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

/// All paths of a tree, and the names that they get.
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
    let stands = |path: &Module| {
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
        let uses = file.uses.iter().map(stands).filter(|used| used != module);
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

/// What is left when all that leads to no circle is taken away.
fn circles(mut graph: Graph) -> Vec<String> {
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
                // The program is a crate of its own.
                if module != ["main"] {
                    sources.insert(module, fs::read_to_string(path).unwrap());
                }
            }
        }
    }
    sources
}

/// The rooms in the order of lib.rs, and whether they are public.
fn contents(sources: &BTreeMap<Module, String>) -> Vec<(String, bool)> {
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

/// Uses of what does not stand above.
fn upward(sources: &BTreeMap<Module, String>, files: &Graph) -> Vec<String> {
    let rooms_in_order = contents(sources);
    let place = |room: &Module| rooms_in_order.iter().position(|(name, _)| *name == room[0]);
    let mut found = Vec::new();
    for (room, uses) in rooms(files) {
        let below = uses.iter().filter(|used| place(used) >= place(&room));
        found.extend(below.map(|used| format!("{} uses {}", room[0], used[0])));
    }
    found
}

#[test]
fn rooms_use_those_above_and_files_no_circle() {
    let sources = sources(".");
    let files = graph(&sources);
    assert!(files.len() > 100, "{} files", files.len());
    assert_eq!(upward(&sources, &files), [""; 0]);
    assert_eq!(circles(files), [""; 0]);
}

#[test]
fn files_of_the_core_no_circle_either() {
    let sources = sources("../core");
    let files = graph(&sources);
    assert!(files.len() > 30, "{} files", files.len());
    assert_eq!(circles(files), [""; 0]);
    let public = contents(&sources)
        .iter()
        .filter(|(_, public)| *public)
        .count();
    assert!(public <= 8, "{public} public modules");
}

#[test]
fn few_rooms_and_fewer_public() {
    let rooms = contents(&sources("."));
    let public = rooms.iter().filter(|(_, public)| *public).count();
    assert!(
        rooms.len() <= ROOMS && public <= PUBLIC,
        "{} rooms, {public} public",
        rooms.len()
    );
}

#[test]
fn circles_are_found() {
    let source = |module: &[&str], text: &str| {
        let module: Module = module.iter().map(|part| (*part).to_owned()).collect();
        (module, text.to_owned())
    };
    let looking_down = [
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
    let all = looking_down.clone().into();
    assert_eq!(upward(&all, &graph(&all)), [""; 0]);
    assert_eq!(circles(graph(&all)), [""; 0]);
    let mut up = looking_down;
    up[1].1 = "pub fn digits(log: &crate::log::Log) {}".to_owned();
    let all = up.into();
    let files = graph(&all);
    assert_eq!(upward(&all, &files), ["page uses log"]);
    assert_eq!(
        circles(files),
        ["log::read uses page", "page uses log::read"]
    );
}
