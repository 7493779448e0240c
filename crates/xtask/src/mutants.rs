//! Mutants: statements deleted and constants changed by rule, which cargo-mutants does not try, and further changes by hand.

use std::collections::{BTreeMap, HashSet};
use std::hash::{DefaultHasher, Hash, Hasher};
use std::ops::Range;
use std::path::Path;
use std::process::Command;
use std::{fmt, fs};

use crate::process::{Result, at, cargo, entries, make, name, output, read, root, write};

/// The list of those by hand, and of those that survive, relative to the root.
const LIST: &str = ".cargo/mutants.txt";

/// Sources that are mutated by rule: files, or folders with all of their files.
const SOURCES: [&str; 10] = [
    "crates/dea-driver/src/safety",
    "crates/dea-driver/src/control/controller.rs",
    "crates/dea-driver/src/control/controller/orders.rs",
    "crates/dea-driver/src/control/setpoint.rs",
    "crates/dea-driver/src/chips/ad5754.rs",
    "crates/dea-driver/src/parameters/store.rs",
    "crates/dea-driver/src/server/board.rs",
    "crates/dea-driver/src/server/device.rs",
    "crates/dea-driver/src/server/session.rs",
    "crates/springpot/src/control",
];

/// Time of a mutant's build or tests, s, after which it counts as noticed.
const MAX_SECONDS: &str = "1800";

#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Kind {
    Deleted,
    Constant,
    ByHand,
}

impl fmt::Display for Kind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Deleted => "statement deleted",
            Self::Constant => "constant changed",
            Self::ByHand => "by hand",
        })
    }
}

/// A change of a source file, which a test should notice.
struct Mutant {
    kind: Kind,
    name: String,
    /// Below the root.
    file: String,
    /// The file with the change.
    mutated: String,
    /// Why no test notices it.
    survives: Option<String>,
}

impl Mutant {
    fn new(kind: Kind, file: &str, text: &str, range: Range<usize>, to: &str) -> Self {
        let (line, column) =
            (text[..range.start].matches('\n').count() + 1, range.start - text[..range.start].rfind('\n').unwrap_or(0));
        let name = format!("{file}:{line}:{column}: {} -> {to}", text[range.clone()].trim().replace('\n', " "));
        let mutated = [&text[..range.start], to, &text[range.end..]].concat();
        Self { kind, name, file: file.into(), mutated, survives: None }
    }

    /// The change apart from how it is written: file, and its words after it.
    fn identity(&self) -> u64 {
        let mut hasher = DefaultHasher::new();
        self.file.hash(&mut hasher);
        self.mutated.split_whitespace().for_each(|word| word.hash(&mut hasher));
        hasher.finish()
    }

    fn package(&self) -> &'static str {
        if self.file.contains("springpot") { "springpot" } else { "dea-driver" }
    }

    /// Packages whose tests should notice it, with the options that name the tests, the quick ones first. The law in C is written by hand, and has the
    /// same bits.
    fn tests(&self) -> &'static [(&'static str, &'static str)] {
        if self.package() == "springpot" {
            &[("springpot", "--test it"), ("host-emit", "--test emitted")]
        } else {
            &[("dea-driver", "--test driver"), ("dea-driver", "--lib")]
        }
    }
}

/// Mutants of the list: each takes out lines that are in its file once.
fn listed() -> Result<Vec<Mutant>> {
    let list = read(&root().join(LIST))?;
    let mutant = |block: &str| {
        let lines = |sign| block.lines().filter_map(|line| line.strip_prefix(sign)).collect::<Vec<_>>().join("\n");
        let (from, to) = (lines('-'), lines('+'));
        let mut head = block.lines();
        let (name, file) = (head.next().unwrap_or_default(), format!("crates/{}", head.next().unwrap_or_default()));
        let text = read(&root().join(&file))?;
        let mut found = text.match_indices(&from);
        let (Some((start, _)), None) = (found.next(), found.next()) else {
            return Err(format!("{LIST}: {name}: its lines are not in {file}, or more than once"));
        };
        let survives = block.lines().find_map(|line| line.strip_prefix("= ")).map(Into::into);
        let mutant = Mutant::new(Kind::ByHand, &file, &text, start..start + from.len(), &to);
        Ok(Mutant { name: name.into(), survives, ..mutant })
    };
    // The first block says what the others are.
    list.split("\n\n").skip(1).map(mutant).collect()
}

/// Mutants by rule of all sources.
fn generated() -> Result<Vec<Mutant>> {
    let mut files = Vec::new();
    for source in SOURCES {
        sources(source.to_owned(), &mut files)?;
    }
    files.sort();
    let mut mutants = Vec::new();
    for file in files.iter().filter(|file| file.ends_with(".rs")) {
        let text = read(&root().join(file))?;
        let deleted = statements(&text).into_iter().map(|range| Mutant::new(Kind::Deleted, file, &text, range, ""));
        mutants.extend(deleted);
        for (range, values) in constants(&text) {
            let change = |value: String| Mutant::new(Kind::Constant, file, &text, range.clone(), &value);
            mutants.extend(values.into_iter().map(change));
        }
    }
    Ok(mutants)
}

/// Adds a source, or those of a folder and of its folders.
fn sources(source: String, files: &mut Vec<String>) -> Result<()> {
    let path = root().join(&source);
    if path.is_file() {
        files.push(source);
        return Ok(());
    }
    entries(&path)?.iter().try_for_each(|path| sources(format!("{source}/{}", name(path)), files))
}

/// Lines with their places, without those that are comments, attributes or blank, up to the tests of a source.
fn code(text: &str) -> Vec<(usize, &str)> {
    let starts = text.split_inclusive('\n').scan(0, |start, line| {
        let at = *start;
        *start += line.len();
        Some((at, line))
    });
    let is_code = |line: &str| !(line.is_empty() || line.starts_with("//") || line.starts_with('#'));
    let before_tests = starts.take_while(|(_, line)| line.trim_end() != "#[test]");
    before_tests.filter(|(_, line)| is_code(line.trim())).collect()
}

/// Words that begin what is no statement, or one that cannot be missing.
const NO_STATEMENTS: [&str; 15] = [
    "let ", "return", "break", "continue", "pub ", "pub(", "fn ", "impl", "use ", "mod ", "const ", "static ", "type ",
    "}", "unsafe ",
];

/// Statements of a source that is formatted: they begin a line, within braces, and end one.
fn statements(text: &str) -> Vec<Range<usize>> {
    let lines = code(text);
    let mut found = Vec::new();
    for (index, &(start, line)) in lines.iter().enumerate().skip(1) {
        let begins = lines[index - 1].1.trim_end().ends_with([';', '{', '}']);
        let shadows = shadows(line);
        if !begins || !line.starts_with("    ") || (starts_with_any(line, &NO_STATEMENTS) && !shadows) {
            continue;
        }
        let is_block = starts_with_any(line, &["if ", "for ", "while ", "match ", "loop "]);
        let mut depth = 0;
        for &(at, line) in &lines[index..] {
            depth += line.matches(['(', '[', '{']).count() as i32 - line.matches([')', ']', '}']).count() as i32;
            if depth < 0 {
                break;
            }
            if depth == 0 && line.trim_end().ends_with(if is_block { '}' } else { ';' }) {
                found.push(start..at + line.trim_end().len());
                break;
            }
        }
    }
    found
}

fn starts_with_any(line: &str, words: &[&str]) -> bool {
    words.iter().any(|word| line.trim_start().starts_with(word))
}

/// Whether a line makes a new variable from one of the same name, which is still there without it.
fn shadows(line: &str) -> bool {
    let Some((name, value)) = line.trim_start().strip_prefix("let ").and_then(|rest| rest.split_once(" = ")) else {
        return false;
    };
    value.split(|c: char| !c.is_alphanumeric() && c != '_').any(|word| word == name.trim_start_matches("mut "))
}

/// Constants of a source, and other values for each.
fn constants(text: &str) -> Vec<(Range<usize>, Vec<String>)> {
    let mut found = Vec::new();
    for (start, line) in code(text).into_iter().filter(|(_, line)| !line.contains('"')) {
        let line = line.split("//").next().unwrap_or_default();
        let mut from = 0;
        while from < line.len() {
            let is_word = |c: char| c.is_alphanumeric() || c == '_';
            let rest = &line[from..];
            let mut length = rest.find(|c| !is_word(c)).unwrap_or(rest.len());
            if length == 0 {
                from += rest.chars().next().map_or(1, char::len_utf8);
                continue;
            }
            if rest.starts_with(|c: char| c.is_ascii_digit()) {
                // Digits behind the point, and the sign of an exponent.
                let more = |length: usize, sign: char| {
                    let digits = rest[length..]
                        .strip_prefix(sign)
                        .filter(|digits| digits.starts_with(|c: char| c.is_ascii_digit()));
                    digits.map_or(length, |digits| length + 1 + digits.find(|c| !is_word(c)).unwrap_or(digits.len()))
                };
                length = more(length, '.');
                if rest[..length].ends_with('e') {
                    length = more(length, '-');
                }
            }
            let mut word = &rest[..length];
            if word == "ZERO" && line[..from].ends_with("T::") {
                (from, length, word) = (from - 3, length + 3, "T::ZERO");
            }
            if !line[..from].ends_with('.') || word.contains('.') {
                found.push((start + from..start + from + length, others(word)));
            }
            from += length;
        }
    }
    found.retain(|(_, values): &(_, Vec<String>)| !values.is_empty());
    found
}

/// Other values in place of a constant; empty for another word.
fn others(word: &str) -> Vec<String> {
    let plain = word.replace('_', "");
    let swapped = match word {
        "true" => Some("false"),
        "false" => Some("true"),
        // Numbers of a step have no other constant.
        "T::ZERO" => Some("T::from_f64(1.0)"),
        _ => None,
    };
    match (word, plain.parse::<u64>(), plain.parse::<f64>()) {
        ("0.0", ..) => vec!["1.0".into()],
        (_, Ok(0), _) => vec!["1".into()],
        (_, Ok(value), _) => vec![(value + 1).to_string(), (value - 1).to_string()],
        (_, _, Ok(value)) if word.starts_with(|c: char| c.is_ascii_digit()) => {
            [1.25, 0.8].map(|factor| format!("{:?}", factor * value)).to_vec()
        }
        _ => swapped.into_iter().map(Into::into).collect(),
    }
}

/// All mutants, each once; of those by rule that are in the list, the list's.
fn all() -> Result<Vec<Mutant>> {
    let mut all = listed()?;
    let mut seen: HashSet<u64> = all.iter().map(Mutant::identity).collect();
    all.extend(generated()?.into_iter().filter(|mutant| seen.insert(mutant.identity())));
    Ok(all)
}

#[derive(Clone, Copy)]
enum Outcome {
    Noticed,
    Survives,
    DoesNotCompile,
}

/// Copy of the project, in which mutants are built and tested.
struct Copied<'a>(&'a Path);

impl Copied<'_> {
    fn refresh(&self) -> Result<()> {
        let mut list = Command::new("git");
        list.args(["ls-files", "--cached", "--others", "--exclude-standard"]).current_dir(root());
        for file in output(list)?.lines().filter(|file| root().join(file).is_file()) {
            let copied = self.0.join(file);
            make(copied.parent().unwrap_or(self.0))?;
            // What is the same keeps its time, and is not built again.
            let new = fs::read(root().join(file)).map_err(at(Path::new(file)))?;
            if fs::read(&copied).ok().as_ref() != Some(&new) {
                fs::write(&copied, new).map_err(at(&copied))?;
            }
        }
        Ok(())
    }

    /// Runs a package's test, or builds it only.
    fn test(&self, (package, test): (&str, &str), options: &str) -> Result<()> {
        let mut tests = cargo(&format!("test --quiet --profile mutants --package {package} {test} {options}"));
        let mut limited = Command::new("timeout");
        limited.arg(MAX_SECONDS).arg(tests.get_program()).args(tests.get_args());
        tests = limited;
        tests.current_dir(self.0).env("CARGO_TARGET_DIR", self.0.join("target")).env("CARGO_INCREMENTAL", "0");
        output(tests).map(drop)
    }

    fn outcome(&self, mutant: &Mutant) -> Result<Outcome> {
        let path = self.0.join(&mutant.file);
        let original = read(&path)?;
        write(&path, &mutant.mutated)?;
        let tests = mutant.tests();
        let built = tests.first().map_or(Ok(()), |&test| self.test(test, "--no-run"));
        let passed = built.is_ok() && tests.iter().all(|&test| self.test(test, "").is_ok());
        write(&path, &original)?;
        Ok(match (built, passed) {
            (Err(_), _) => Outcome::DoesNotCompile,
            (_, true) => Outcome::Survives,
            (_, false) => Outcome::Noticed,
        })
    }
}

/// Runs the tests on `sample` of the mutants, or on all of them, in a copy of the project, and prints the counts for safety.md. `only` is a part of
/// the paths of their files.
pub fn run(sample: Option<usize>, only: Option<&str>) -> Result<()> {
    let folder = root().join("target/mutants-by-hand");
    let copied = Copied(&folder);
    copied.refresh()?;
    let mut mutants = all()?;
    mutants.retain(|mutant| only.is_none_or(|part| mutant.file.contains(part)));
    let count = mutants.len();
    if let (0, Some(part)) = (count, only) {
        return Err(format!("no file that is mutated has {part:?} in its path"));
    }
    // At random, and the same ones every time; a larger sample includes a smaller one.
    mutants.sort_by_key(Mutant::identity);
    mutants.truncate(sample.unwrap_or(count));
    println!("{} of {count} mutants", mutants.len());
    for &test in mutants.iter().flat_map(Mutant::tests).collect::<HashSet<_>>() {
        copied.test(test, "").map_err(|error| format!("fails without a mutant: {error}"))?;
    }
    let mut table: BTreeMap<_, [usize; 5]> = BTreeMap::new();
    let mut wrong = Vec::new();
    for mutant in &mutants {
        let (column, says) = match (copied.outcome(mutant)?, &mutant.survives) {
            (Outcome::Noticed, None) => (1, "noticed"),
            (Outcome::DoesNotCompile, _) => (2, "does not compile"),
            (Outcome::Survives, Some(_)) => (3, "survives, as explained"),
            (Outcome::Survives, None) => (4, "SURVIVES"),
            (Outcome::Noticed, Some(_)) => (1, "NOTICED, although explained"),
        };
        println!("{says}: {}", mutant.name);
        if says.starts_with(char::is_uppercase) {
            wrong.push(format!("{says}: {}", mutant.name));
        }
        let row = table.entry((mutant.package(), mutant.kind)).or_default();
        row[0] += 1;
        row[column] += 1;
    }
    println!("| mutants of | kind | tried | noticed | do not compile | survive, explained | survive |");
    println!("| --- | --- | --- | --- | --- | --- | --- |");
    for ((package, kind), counts) in table {
        println!("| {package} | {kind} | {} |", counts.map(|count| count.to_string()).join(" | "));
    }
    if wrong.is_empty() { Ok(()) } else { Err(wrong.join("\n")) }
}

#[test]
fn every_mutant_is_of_the_sources_as_they_are() {
    assert!(listed().expect("it is read").len() > 30);
}

#[test]
fn statements_and_constants_are_found() {
    let text = "fn f(&mut self) {\n    // a;\n    self.a = 0.5;\n    if b {\n        let c = 2;\n        d(&[c], true);\n    }\n    \
                self\n        .e\n        .g(1e-3);\n    let h = h + 1;\n    self.x.0\n}\n#[test]\nfn t() {\n    \
                f(3);\n}\n";
    let found: Vec<&str> = statements(text).into_iter().map(|range| text[range].trim()).collect();
    let block = "if b {\n        let c = 2;\n        d(&[c], true);\n    }";
    assert_eq!(
        found,
        ["self.a = 0.5;", block, "d(&[c], true);", "self\n        .e\n        .g(1e-3);", "let h = h + 1;"]
    );
    let found = constants(text).into_iter().map(|(range, values)| format!("{} {}", &text[range], values.join(" ")));
    assert_eq!(constants("[T::ZERO]"), [(1..8, vec!["T::from_f64(1.0)".into()])]);
    assert_eq!(found.collect::<Vec<_>>(), ["0.5 0.625 0.4", "2 3 1", "true false", "1e-3 0.00125 0.0008", "1 2 0"]);
}
