//! Pages, comments, messages and names use the words of the field: the lists are in `words/`.

use documents::words::{Words, exceptions, findings};

#[test]
fn the_project_uses_the_words_of_the_field() {
    let (findings, unneeded) = findings().expect("readable");
    let lines: Vec<_> = findings.iter().map(ToString::to_string).collect();
    assert!(lines.is_empty(), "{}\n{} words", lines.join("\n"), lines.len());
    assert!(unneeded.is_empty(), "words/exceptions.txt: nothing needs {unneeded:#?}");
    assert!(exceptions().iter().all(|[.., reason]| !reason.is_empty()));
}

/// Lines and causes of the findings in a text.
fn found(path: &str, text: &str) -> Vec<(usize, String)> {
    let cause = |cause: &str| cause.split(':').next().unwrap_or_default().to_owned();
    Words::default().findings(path, text).into_iter().map(|found| (found.line, cause(&found.cause))).collect()
}

#[test]
fn phrases_are_found_also_over_the_end_of_a_line() {
    let mend = |line| vec![(line, "\"mended\"".to_owned())];
    assert_eq!(found("a.md", "x\nMended.\n"), mend(2));
    assert_eq!(found("a.rs", "// it is mended\n"), mend(1));
    assert_eq!(found("a.m", "error('x:y', 'mended')"), mend(1));
    assert_eq!(found("a.md", "amended, mended_x, un-mended, `mended()`"), []);
    let number = |line| vec![(line, "\"is no number\"".to_owned())];
    assert_eq!(found("a.rs", "    /// x is no\n    /// number\n"), number(1));
    assert_eq!(found("a.py", "# x is\n# no number\n"), number(1));
    assert_eq!(found("a.c", "/* x is\n * no number */"), number(1));
    assert_eq!(found("a.rs", "f(\"is no\", \"number\")"), []);
    assert_eq!(found("a.md", "There is `None`, is None, is none"), [(1, "\"is none\"".to_owned())]);
    assert_eq!(found("a.md", "nobody's"), [(1, "\"nobody\"".to_owned())]);
}

#[test]
fn documentation_begins_with_the_item() {
    let begins = |word: &str, line| vec![(line, format!("documentation that begins with \"{word}\""))];
    assert_eq!(found("a.rs", "/// Of a film.\nfn x() {}\n"), begins("Of", 1));
    assert_eq!(found("a.rs", "//! What it is.\n"), begins("What", 1));
    assert_eq!(found("a.rs", "/// Value.\n///\n/// What follows.\nstruct X;\n// What\n"), []);
    assert_eq!(found("a.rs", "/// Whether it is.\n#[must_use]\npub fn x(\n    a: u8,\n) -> bool {\n"), []);
    assert_eq!(found("a.rs", "    /// Whether it is.\n    x: u8,\n    y: bool,\n"), begins("Whether", 1));
    assert_eq!(found("a.rs", "    /// Whether it is.\n    x: bool,\n    /// Of it\n    y: u8,\n"), begins("Of", 3));
    assert_eq!(found("a.h", "/** What it is. */\n/* Of */"), begins("What", 1));
    assert_eq!(found("a.py", "def f():\n    \"\"\"What it is.\"\"\"\n"), begins("What", 2));
}

#[test]
fn names_are_the_terms_of_the_field() {
    let causes = found("a.rs", "const MOST_X: u8 = 1;\nfn of(x: u8) {}\nlet x = \"drill\";");
    let lines: Vec<_> = causes.iter().map(|(line, _)| *line).collect();
    assert_eq!(lines, [1, 2, 3], "{causes:?}");
    assert_eq!(found("a.rs", "const UTMOST: u8 = 1; fn of_file() {}\n"), []);
}
