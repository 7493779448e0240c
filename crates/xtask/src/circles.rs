//! A test that no files of a crate import each other in a circle.
//!
//! A file depends on another one if it names an item that the other one defines, by a `use` or by a path. Re-exports are followed to the
//! file that defines the item. A parent that re-exports its children with `pub use` does not depend on them, and a child may use what
//! its parents define: it is a part of them.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

#[derive(Clone, Debug, PartialEq)]
enum Token {
    Word(String),
    Text(String),
    /// `::`
    Path,
    Other(char),
}

impl Token {
    fn word(&self) -> Option<&str> {
        if let Self::Word(word) = self { Some(word) } else { None }
    }
}

/// The tokens of Rust source, without comments, numbers, characters and lifetimes.
fn tokens(source: &str) -> Vec<Token> {
    let letters: Vec<char> = source.chars().collect();
    let at = |index: usize| letters.get(index).copied().unwrap_or(' ');
    let is_word = |letter: char| letter.is_alphanumeric() || letter == '_';
    let mut tokens = Vec::new();
    let mut index = 0;
    while index < letters.len() {
        let begin = index;
        match (at(index), at(index + 1)) {
            ('/', '/') => index += letters[index..].iter().position(|&c| c == '\n').unwrap_or(letters.len() - index),
            ('/', '*') => {
                let mut depth = 0;
                loop {
                    depth += i32::from((at(index), at(index + 1)) == ('/', '*'));
                    depth -= i32::from((at(index), at(index + 1)) == ('*', '/'));
                    index += 1;
                    if depth == 0 || index >= letters.len() {
                        break;
                    }
                }
                index += 1;
            }
            ('r', '#' | '"') if letters[index + 1..].iter().find(|&&c| c != '#') == Some(&'"') => {
                let hashes = letters[index + 1..].iter().take_while(|&&c| c == '#').count();
                let end: Vec<char> = std::iter::once('"').chain(std::iter::repeat_n('#', hashes)).collect();
                index += hashes + 2;
                let rest = letters[index..].windows(end.len()).position(|window| window == end);
                index += rest.map_or(letters.len(), |rest| rest + end.len());
            }
            ('"', _) => {
                index += 1;
                while index < letters.len() && at(index) != '"' {
                    index += if at(index) == '\\' { 2 } else { 1 };
                }
                tokens.push(Token::Text(letters[begin + 1..index.min(letters.len())].iter().collect()));
                index += 1;
            }
            // A character, or a lifetime.
            ('\'', '\\') => index += 3 + letters[index + 3..].iter().position(|&c| c == '\'').unwrap_or(0),
            ('\'', _) => index += if at(index + 2) == '\'' { 3 } else { 1 },
            (':', ':') => {
                tokens.push(Token::Path);
                index += 2;
            }
            (letter, _) if is_word(letter) => {
                index += letters[index..].iter().take_while(|&&c| is_word(c)).count();
                tokens.push(Token::Word(letters[begin..index].iter().collect()));
            }
            (letter, _) => {
                if !letter.is_whitespace() {
                    tokens.push(Token::Other(letter));
                }
                index += 1;
            }
        }
    }
    tokens
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
        self.scan(&tokens(&source), module, &folder);
        module
    }

    fn module(&mut self, file: &Path, parent: Option<usize>) -> usize {
        self.modules.push(Module { file: file.to_owned(), parent, ..Module::default() });
        self.modules.len() - 1
    }

    /// Reads the tokens of a module, whose children are in `folder`.
    fn scan(&mut self, tokens: &[Token], module: usize, folder: &Path) {
        let (mut index, mut depth) = (0, 0);
        // What attributes say of the item that follows.
        let (mut path, mut is_test) = (None, false);
        while index < tokens.len() {
            let after = |more: usize| tokens.get(index + more);
            match &tokens[index] {
                Token::Other('#') if after(1) == Some(&Token::Other('[')) => {
                    let end = index + 1 + closing(&tokens[index + 1..]);
                    match &tokens[index + 2..end] {
                        [Token::Word(name), _, Token::Text(text)] if name == "path" => path = Some(text.clone()),
                        [Token::Word(name), _, Token::Word(test), _] if name == "cfg" && test == "test" => {
                            is_test = true
                        }
                        _ => {}
                    }
                    index = end;
                }
                Token::Word(word) if word == "mod" && depth == 0 => {
                    let name = after(1).and_then(Token::word).expect("a name").to_owned();
                    if after(2) == Some(&Token::Other('{')) {
                        let end = index + 2 + closing(&tokens[index + 2..]);
                        if !is_test {
                            let file = self.modules[module].file.clone();
                            let child = self.module(&file, Some(module));
                            self.modules[module].children.insert(name.clone(), child);
                            self.scan(&tokens[index + 3..end], child, &folder.join(name));
                        }
                        index = end;
                    } else if !is_test {
                        let files = [format!("{name}.rs"), format!("{name}/mod.rs")].map(|file| folder.join(file));
                        let here = self.modules[module].file.with_file_name("");
                        let file =
                            path.take().map(|path| here.join(path)).or(files.into_iter().find(|file| file.is_file()));
                        let child = self.file(&file.unwrap_or_else(|| panic!("no file of {name}")), Some(module));
                        self.modules[module].children.insert(name, child);
                    }
                    (path, is_test) = (None, false);
                }
                Token::Word(word) if word == "use" => {
                    let is_public = index > 0 && matches!(&tokens[index - 1], Token::Word(word) if word == "pub")
                        || index > 3 && matches!(&tokens[index - 4], Token::Word(word) if word == "pub");
                    let end = index + tokens[index..].iter().position(|t| *t == Token::Other(';')).unwrap_or(0);
                    self.import(module, &tokens[index + 1..end], &[], is_public);
                    index = end;
                    (path, is_test) = (None, false);
                }
                Token::Word(word) => {
                    if !["pub", "crate"].contains(&word.as_str()) {
                        (path, is_test) = (None, false);
                    }
                    let defines = ["struct", "enum", "fn", "trait", "const", "static", "type", "union", "macro_rules"];
                    if depth == 0 && defines.contains(&word.as_str()) {
                        let name = tokens[index + 1..].iter().find_map(Token::word).expect("a name");
                        self.modules[module].items.insert(name.to_owned());
                    }
                    let mut named = vec![word.clone()];
                    while tokens.get(index + 1) == Some(&Token::Path) {
                        let Some(next) = tokens.get(index + 2).and_then(Token::word) else { break };
                        named.push(next.to_owned());
                        index += 2;
                    }
                    if named.len() > 1 {
                        self.modules[module].paths.push(named);
                    } else {
                        self.modules[module].words.extend(named);
                    }
                }
                Token::Other('{') => depth += 1,
                Token::Other('}') => depth -= 1,
                _ => {}
            }
            index += 1;
        }
    }

    /// Reads the tree of a `use` below the path `above`.
    fn import(&mut self, module: usize, tree: &[Token], above: &[String], is_public: bool) {
        let mut path = above.to_vec();
        let mut index = 0;
        while let Some(token) = tree.get(index) {
            match token {
                Token::Other('{') => {
                    let mut begin = index + 1;
                    let mut depth = 0;
                    for (end, token) in tree.iter().enumerate().skip(index) {
                        depth += i32::from(*token == Token::Other('{')) - i32::from(*token == Token::Other('}'));
                        if depth == 0 || depth == 1 && *token == Token::Other(',') {
                            self.import(module, &tree[begin..end], &path, is_public);
                            begin = end + 1;
                        }
                    }
                    return;
                }
                Token::Other('*') => return self.modules[module].globs.push(path),
                Token::Word(word) if word == "as" => break,
                Token::Word(word) => path.push(word.clone()),
                _ => {}
            }
            index += 1;
        }
        let Some(last) = tree.iter().rev().find_map(Token::word) else { return };
        if path.last().is_some_and(|last| last == "self") {
            path.pop();
        }
        let name = if last == "self" { path.last().cloned().unwrap_or_default() } else { last.to_owned() };
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

/// Index of the bracket that closes the first one.
fn closing(tokens: &[Token]) -> usize {
    let mut depth = 0;
    let change = |token: &Token| match token {
        Token::Other('(' | '[' | '{') => 1,
        Token::Other(')' | ']' | '}') => -1,
        _ => 0,
    };
    let is_end = |token: &Token| {
        depth += change(token);
        depth == 0
    };
    tokens.iter().position(is_end).expect("closed")
}

/// The roots of all crates below `folder`.
fn roots(folder: &Path, all: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).expect("readable") {
        let path = entry.expect("readable").path();
        if path.is_dir() && !path.ends_with("target") && !path.ends_with(".git") {
            roots(&path, all);
        } else if path.ends_with("lib.rs") || path.ends_with("main.rs") {
            all.push(path);
        }
    }
}

#[test]
fn no_files_import_each_other_in_a_circle() {
    let root = crate::process::root();
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
