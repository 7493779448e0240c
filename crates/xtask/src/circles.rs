//! A test that no files of a crate import each other in a circle.
//!
//! A file depends on another one if it names an item that the other one defines, by a `use` or by a path. Re-exports are followed to the
//! file that defines the item. A parent that re-exports its children with `pub use` does not depend on them, and a child may use what
//! its parents define: it is a part of them.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

use proc_macro2::{Delimiter, TokenStream, TokenTree};

use crate::process::{entries, root};

/// The identifier that a token is.
fn word(token: Option<&TokenTree>) -> Option<String> {
    if let Some(TokenTree::Ident(word)) = token { Some(word.to_string()) } else { None }
}

fn is_word(token: Option<&TokenTree>, wanted: &str) -> bool {
    matches!(token, Some(TokenTree::Ident(word)) if word == wanted)
}

fn is_mark(token: Option<&TokenTree>, wanted: char) -> bool {
    matches!(token, Some(TokenTree::Punct(mark)) if mark.as_char() == wanted)
}

/// The tokens within brackets of this kind.
fn within(token: Option<&TokenTree>, delimiter: Delimiter) -> Option<Vec<TokenTree>> {
    match token {
        Some(TokenTree::Group(group)) if group.delimiter() == delimiter => Some(group.stream().into_iter().collect()),
        _ => None,
    }
}

#[derive(Default)]
struct Module {
    file: PathBuf,
    parent: Option<usize>,
    children: BTreeMap<String, usize>,
    /// Names that are imported, and the paths that they are for.
    imports: BTreeMap<String, Vec<String>>,
    /// Modules whose items are all imported.
    globs: Vec<Vec<String>>,
    /// Names of what is defined here.
    items: BTreeSet<String>,
    /// Paths that this module names.
    paths: Vec<Vec<String>>,
    /// Words, which are items of `globs` or anything else.
    words: BTreeSet<String>,
}

/// Target of a path.
enum Found {
    Module(usize),
    /// An item that this module defines.
    Item(usize),
}

/// Names that were looked up on the way: globs may lead back.
type Seen = BTreeSet<(usize, String)>;

#[derive(Default)]
struct Crate {
    modules: Vec<Module>,
}

impl Crate {
    fn read(root: &Path) -> Self {
        let mut all = Self::default();
        all.file(root, None);
        all
    }

    /// Reads a file and all below it; returns its module.
    fn file(&mut self, path: &Path, parent: Option<usize>) -> usize {
        let source = fs::read_to_string(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
        let module = self.module(path, parent);
        let is_root = parent.is_none() || path.ends_with("mod.rs");
        let folder = if is_root { path.with_file_name("") } else { path.with_extension("") };
        let tokens = source.parse::<TokenStream>().unwrap_or_else(|error| panic!("{}: {error}", path.display()));
        self.scan(&tokens.into_iter().collect::<Vec<_>>(), module, &folder, true);
        module
    }

    fn module(&mut self, file: &Path, parent: Option<usize>) -> usize {
        self.modules.push(Module { file: file.to_owned(), parent, ..Module::default() });
        self.modules.len() - 1
    }

    /// Reads tokens of a module, whose children are in `folder`. Its items are those at the `top`, outside of all brackets.
    fn scan(&mut self, tokens: &[TokenTree], module: usize, folder: &Path, top: bool) {
        let mut index = 0;
        // What attributes say of the item that follows.
        let (mut path, mut is_test) = (None, false);
        while index < tokens.len() {
            let after = |more: usize| tokens.get(index + more);
            if is_mark(after(0), '#')
                && let Some(attribute) = within(after(1), Delimiter::Bracket)
            {
                if is_word(attribute.first(), "path") {
                    path = attribute.get(2).map(|text| text.to_string().trim_matches('"').to_owned());
                }
                is_test |= is_word(attribute.first(), "cfg")
                    && within(attribute.get(1), Delimiter::Parenthesis)
                        .is_some_and(|of| is_word(of.first(), "test") && of.len() == 1);
                index += 1;
            } else if top && is_word(after(0), "mod") {
                let name = word(after(1)).expect("a name");
                let body = within(after(2), Delimiter::Brace);
                if !is_test {
                    let child = match &body {
                        Some(_) => self.module(&self.modules[module].file.clone(), Some(module)),
                        None => {
                            let files = [format!("{name}.rs"), format!("{name}/mod.rs")].map(|file| folder.join(file));
                            let here = self.modules[module].file.with_file_name("");
                            let file =
                                path.map(|path| here.join(path)).or(files.into_iter().find(|file| file.is_file()));
                            self.file(&file.unwrap_or_else(|| panic!("no file of {name}")), Some(module))
                        }
                    };
                    self.modules[module].children.insert(name.clone(), child);
                    if let Some(body) = &body {
                        self.scan(body, child, &folder.join(name), true);
                    }
                }
                index += 2;
                (path, is_test) = (None, false);
            } else if is_word(after(0), "use") && !is_mark(after(1), '<') {
                // `pub use` or `pub(crate) use`; `use<>` in a type is no import.
                let before = |less: usize| index.checked_sub(less).and_then(|index| tokens.get(index));
                let is_public = is_word(before(1), "pub") || is_word(before(2), "pub");
                let length = tokens[index..].iter().position(|token| is_mark(Some(token), ';')).unwrap_or(0);
                self.import(module, &tokens[index + 1..index + length], &[], is_public);
                index += length;
                (path, is_test) = (None, false);
            } else if is_mark(after(0), '\'') {
                // A lifetime.
                index += 1;
            } else if let Some(first) = word(after(0)) {
                if !["pub", "crate"].contains(&first.as_str()) {
                    (path, is_test) = (None, false);
                }
                let defines = ["struct", "enum", "fn", "trait", "const", "static", "type", "union", "macro_rules"];
                if top && defines.contains(&first.as_str()) {
                    let name = tokens[index + 1..].iter().find_map(|token| word(Some(token))).expect("a name");
                    self.modules[module].items.insert(name);
                }
                let mut named = vec![first];
                while is_mark(tokens.get(index + 1), ':')
                    && is_mark(tokens.get(index + 2), ':')
                    && let Some(next) = word(tokens.get(index + 3))
                {
                    named.push(next);
                    index += 3;
                }
                if named.len() > 1 {
                    self.modules[module].paths.push(named);
                } else {
                    self.modules[module].words.extend(named);
                }
            } else if let TokenTree::Group(group) = &tokens[index] {
                self.scan(&group.stream().into_iter().collect::<Vec<_>>(), module, folder, false);
            }
            index += 1;
        }
    }

    /// Reads the tree of a `use` below the path `above`.
    fn import(&mut self, module: usize, tree: &[TokenTree], above: &[String], is_public: bool) {
        let mut path = above.to_vec();
        for token in tree.iter().take_while(|token| !is_word(Some(token), "as")) {
            if let Some(below) = within(Some(token), Delimiter::Brace) {
                for tree in below.split(|token| is_mark(Some(token), ',')) {
                    self.import(module, tree, &path, is_public);
                }
                return;
            }
            if is_mark(Some(token), '*') {
                return self.modules[module].globs.push(path);
            }
            path.extend(word(Some(token)));
        }
        let Some(last) = tree.iter().rev().find_map(|token| word(Some(token))) else { return };
        if path.last().is_some_and(|last| last == "self") {
            path.pop();
        }
        let name = if last == "self" { path.last().cloned().unwrap_or_default() } else { last };
        // A re-export is no use; the file that uses it depends on the target.
        let leaves = matches!(path.first().map(String::as_str), Some("crate" | "super"));
        if !is_public || leaves {
            self.modules[module].paths.push(path.clone());
        }
        self.modules[module].imports.insert(name, path);
    }

    /// Returns the target of `path`, named in `module`; nothing if it leads out of the crate.
    fn resolve(&self, module: usize, path: &[String], seen: &mut Seen) -> Option<Found> {
        let mut here = module;
        for (index, name) in path.iter().enumerate() {
            here = match name.as_str() {
                "self" => here,
                "crate" => 0,
                "super" => self.modules[here].parent?,
                _ => match self.member(here, name, seen) {
                    Some(Found::Module(next)) => next,
                    Some(item) => return Some(item),
                    // What a macro defines.
                    None if index > 0 => return Some(Found::Item(here)),
                    None => return None,
                },
            };
        }
        Some(Found::Module(here))
    }

    fn member(&self, module: usize, name: &str, seen: &mut Seen) -> Option<Found> {
        let this = &self.modules[module];
        if !seen.insert((module, name.to_owned())) {
            return None;
        }
        if this.items.contains(name) {
            return Some(Found::Item(module));
        }
        if let Some(child) = this.children.get(name) {
            return Some(Found::Module(*child));
        }
        if let Some(path) = this.imports.get(name)
            && path.first().is_some_and(|first| first != name)
        {
            return self.resolve(module, path, seen);
        }
        this.globs.iter().find_map(|glob| match self.resolve(module, glob, seen) {
            Some(Found::Module(other)) if other != module => self.member(other, name, seen),
            _ => None,
        })
    }

    /// The files, each with those that it depends on.
    fn dependencies(&self) -> BTreeMap<&Path, BTreeSet<&Path>> {
        let mut all: BTreeMap<&Path, BTreeSet<&Path>> = BTreeMap::new();
        for (index, module) in self.modules.iter().enumerate() {
            let by_glob = if module.globs.is_empty() { BTreeSet::new() } else { module.words.clone() };
            let words = by_glob.into_iter().map(|word| vec![word]);
            let others = all.entry(&module.file).or_default();
            for path in module.paths.iter().cloned().chain(words) {
                if let Some(Found::Item(other)) = self.resolve(index, &path, &mut Seen::new()) {
                    let other = self.modules[other].file.as_path();
                    let mut parents = std::iter::successors(Some(index), |module| self.modules[*module].parent);
                    if parents.all(|parent| self.modules[parent].file != other) {
                        others.insert(other);
                    }
                }
            }
        }
        all
    }

    /// The files of each circle.
    fn circles(&self) -> BTreeSet<Vec<&Path>> {
        let direct = self.dependencies();
        let reached = |from: &Path| {
            let mut reached = BTreeSet::new();
            let mut open: Vec<&Path> = direct[from].iter().copied().collect();
            while let Some(next) = open.pop() {
                if reached.insert(next) {
                    open.extend(direct.get(next).into_iter().flatten());
                }
            }
            reached
        };
        let all: BTreeMap<&Path, BTreeSet<&Path>> = direct.keys().map(|file| (*file, reached(file))).collect();
        let circle =
            |file: &Path| all[file].iter().copied().filter(|other| all[other].contains(file)).collect::<Vec<_>>();
        all.keys().map(|file| circle(file)).filter(|circle| !circle.is_empty()).collect()
    }
}

/// The roots of all crates below `folder`.
fn roots(folder: &Path, all: &mut Vec<PathBuf>) {
    for path in entries(folder).expect("readable") {
        if path.is_dir() && !path.ends_with("target") && !path.ends_with(".git") {
            roots(&path, all);
        } else if path.ends_with("lib.rs") || path.ends_with("main.rs") {
            all.push(path);
        }
    }
}

#[test]
fn no_files_import_each_other_in_a_circle() {
    let root = root();
    let mut crates = Vec::new();
    roots(&root, &mut crates);
    assert!(crates.len() > 20, "{} crates", crates.len());
    let mut found = Vec::new();
    for path in crates {
        let all = Crate::read(&path);
        let direct = all.dependencies();
        for circle in all.circles() {
            let name = |path: &Path| path.strip_prefix(&root).unwrap_or(path).display().to_string().replace('\\', "/");
            for file in &circle {
                let others = direct[file].iter().filter(|other| circle.contains(other)).map(|other| name(other));
                found.push(format!("{} -> {}", name(file), others.collect::<Vec<_>>().join(", ")));
            }
            found.push(String::new());
        }
    }
    assert!(found.is_empty(), "files that import each other in a circle:\n{}", found.join("\n"));
}

/// A circle of two files through a re-export of their parent is found; a parent that re-exports a child which uses it is not one.
#[test]
fn circles_are_found() {
    let folder = std::env::temp_dir().join(format!("circles-{}", std::process::id()));
    let write = |a: &str| {
        fs::create_dir_all(&folder).expect("made");
        for (name, text) in [
            ("lib.rs", "mod a;\nmod b;\npub use a::{A, Other};\npub use b::B;\npub struct Root;"),
            ("a.rs", a),
            ("b.rs", "use super::{A, Root};\npub struct B(A, Root); // crate::a"),
        ] {
            fs::write(folder.join(name), text).expect("written");
        }
        let circles = Crate::read(&folder.join("lib.rs"));
        let names =
            |circle: Vec<&Path>| circle.iter().map(|path| path.file_stem().expect("a name").to_owned()).collect();
        circles.circles().into_iter().map(names).collect::<Vec<Vec<_>>>()
    };
    assert_eq!(
        write("/* use crate::B; */ pub struct A(&'static str); const X: char = '\"'; pub struct Other;"),
        [[""; 0]; 0]
    );
    assert_eq!(write("pub struct A; pub struct Other; fn a() -> Option<crate::B> { None }"), [["a", "b"]]);
    fs::remove_dir_all(&folder).expect("removed");
}
