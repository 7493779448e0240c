//! README.md and docs/*.md: their tables are complete, and their links lead to files.

use std::fs;
use std::path::PathBuf;

use documents::{Documents, Table, Tolerance, files, root};

/// All pages of the book, and README.md.
fn pages() -> Result<Vec<PathBuf>, String> {
    let mut pages = files()?;
    pages.extend(["link", "blob"].map(|name| root().join(format!("crates/dea-driver/doc/{name}.md"))));
    Ok(pages)
}

/// Rows whose number of cells is not their header's.
fn ragged(tables: &[Table]) -> Vec<String> {
    tables
        .iter()
        .flat_map(|table| table.rows.iter().map(move |row| (table, row)))
        .filter(|(table, row)| row.len() != table.header.len())
        .map(|(table, row)| {
            format!("table at {}: {} cells below {} titles: {row:?}", table.place, row.len(), table.header.len())
        })
        .collect()
}

#[test]
fn a_table_has_as_many_cells_as_its_header() {
    let documents = Documents::read().expect("readable");
    assert!(documents.tables().len() > 5, "README.md and docs have tables");
    let ragged = ragged(documents.tables());
    assert!(ragged.is_empty(), "{}", ragged.join("\n"));
}

/// The reader itself: bars in code, groups of digits, bold numbers, and a row that lacks a cell.
#[test]
fn numbers_are_found_by_row_and_title() {
    let documents = Documents::from_text(
        "x.md",
        "| row | a | **b**, late |\n| --- | --- | --- |\n| `x\\|y` | 35 477 | **0.382** |\n| film | 1.8e-7 | 16 kB |\n| `short` | 1 |\n\
         \n```text\n| no | table |\n```\n",
    );
    assert_eq!(documents.tables().len(), 1);
    assert_eq!(documents.number(&["x\\|y"], "a"), Some(35_477.0));
    assert_eq!(documents.number(&["x\\|y"], "b"), Some(0.382));
    assert_eq!(documents.number(&["film", "1.8e-7"], "b"), Some(16.0));
    assert_eq!(documents.number(&["film"], "a"), Some(1.8e-7));
    assert_eq!(documents.number(&["film"], "c"), None);
    assert_eq!(documents.number(&["short"], "b"), None);
    assert_eq!(documents.column("a"), [("x\\|y", 35_477.0), ("short", 1.0)]);
    assert_eq!(ragged(documents.tables()).len(), 1);
    assert!(Tolerance::COUNT.holds(102.0, 100.0) && !Tolerance::COUNT.holds(102.1, 100.0));
    assert!(!Tolerance::COUNT.holds(f64::NAN, 100.0));
}

/// Headings of a page as GitHub and as the book name them: only where both do alike can a link lead there in both.
fn anchors(page: &str) -> Vec<String> {
    let mut in_code = false;
    let headings = page.lines().filter(|line| {
        in_code ^= line.starts_with("```");
        !in_code && line.starts_with('#')
    });
    let named = |keeps: fn(char) -> bool| {
        move |heading: &str| -> String {
            let kept = heading.trim_start_matches('#').trim().to_lowercase();
            kept.chars()
                .filter(|&letter| keeps(letter) || "-_ ".contains(letter))
                .map(|letter| if letter == ' ' { '-' } else { letter })
                .collect()
        }
    };
    let github = named(|letter| letter.is_alphabetic() || letter.is_ascii_digit());
    let book = named(char::is_alphanumeric);
    headings.filter(|heading| github(heading) == book(heading)).map(github).collect()
}

/// Links to files of the project, relative to the document, and to headings within them.
#[test]
fn links_lead_to_files_and_headings() {
    let (mut count, mut broken) = (0, Vec::new());
    for path in pages().expect("readable") {
        let text = fs::read_to_string(&path).expect("readable");
        for link in text.split("](").skip(1).filter_map(|rest| rest.split(')').next()) {
            if link.contains("://") {
                continue;
            }
            count += 1;
            let (file, heading) = link.split_once('#').map_or((link, None), |(file, heading)| (file, Some(heading)));
            let target = if file.is_empty() { path.clone() } else { path.parent().unwrap_or(root()).join(file) };
            let leads = target.exists()
                && heading.is_none_or(|heading| {
                    let page = fs::read_to_string(&target).expect("readable");
                    anchors(&page).iter().any(|anchor| anchor == heading)
                });
            if !leads {
                broken.push(format!("{}: {link}", path.display()));
            }
        }
    }
    assert!(broken.is_empty(), "{broken:#?}");
    assert!(count > 5);
}

/// The book has every page of docs, each once.
#[test]
fn the_book_has_every_page() {
    let summary = fs::read_to_string(root().join("docs/SUMMARY.md")).expect("readable");
    for path in files().expect("readable") {
        let name = path.file_name().and_then(|name| name.to_str()).expect("a name");
        if path.parent() == Some(&root().join("docs")) && name != "SUMMARY.md" {
            assert_eq!(summary.matches(&format!("]({name})")).count(), 1, "docs/SUMMARY.md: {name}");
        }
    }
}

/// The book holds the files of docs and the pages that SUMMARY.md names: a link to another file of the project leads nowhere in it.
#[test]
fn links_of_the_book_stay_within_it() {
    let docs = root().join("docs");
    let summary = fs::read_to_string(docs.join("SUMMARY.md")).expect("readable");
    let of = |text: &str| -> Vec<String> {
        let links = text.split("](").skip(1).filter_map(|rest| rest.split([')', '#']).next());
        links.filter(|link| !link.is_empty() && !link.contains("://")).map(str::to_owned).collect()
    };
    let pages = of(&summary);
    let mut count = 0;
    for page in &pages {
        let path = docs.join(page);
        let folder = path.parent().expect("a folder");
        for link in of(&fs::read_to_string(&path).expect("readable")) {
            count += 1;
            let target = folder.join(&link).canonicalize().expect("a file");
            let within = target.parent() == Some(&docs)
                || pages.iter().any(|page| docs.join(page).canonicalize().is_ok_and(|page| page == target));
            assert!(within, "docs/{page}: {link} is not in the book: name the file without a link");
        }
    }
    assert!(count > 100);
}

/// Single faults in the table of the safety page: what is detected names when and a test, and the share that the page states is that of the rows.
#[test]
fn single_faults_are_counted() {
    let page = fs::read_to_string(root().join("docs/safety.md")).expect("readable");
    let documents = Documents::from_text("docs/safety.md", &page);
    let parts = ["wire: ", "chip: ", "supply: ", "clock: ", "memory: "];
    let of_part = |part: &str| -> Vec<&Vec<String>> {
        let rows = documents.tables().iter().flat_map(|table| &table.rows);
        rows.filter(|row| row[0].starts_with(part)).collect()
    };
    assert!(parts.iter().all(|part| of_part(part).len() > 1));
    let faults: Vec<_> = parts.iter().flat_map(|part| of_part(part)).collect();
    let detected: Vec<_> = faults.iter().filter(|row| !row[1].contains("**not detected**")).collect();
    let times = ["tick", "time", "second", " s", "ms", "`discharge_s`", "`heartbeat_s`", "start", "at once", "refused"];
    for row in &detected {
        assert!(times.iter().any(|time| row[1].contains(time)), "{}: when?", row[0]);
        assert!(row[2].contains("::"), "{}: no test", row[0]);
    }
    let share = (100.0 * detected.len() as f64 / faults.len() as f64).round();
    let stated = format!("**{} of {}, {share} %, are detected**", detected.len(), faults.len());
    assert!(page.contains(&stated), "{stated}");
}

/// The project's sources: the names of the module and of the folder of each, its path, and its text.
fn sources() -> Vec<([String; 2], PathBuf, String)> {
    let mut sources = Vec::new();
    let mut folders: Vec<_> = ["crates", "host-sim", "python", "tests"].map(|folder| root().join(folder)).into();
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(&folder).expect("readable").map(|entry| entry.expect("readable").path()) {
            if entry.is_dir() && !entry.ends_with("target") {
                folders.push(entry);
            } else if entry
                .extension()
                .is_some_and(|extension| ["rs", "py", "trycmd"].iter().any(|kind| extension == *kind))
            {
                let names = [entry.file_stem(), folder.file_name()];
                let names = names.map(|name| name.expect("a name").to_string_lossy().into_owned());
                let text = fs::read_to_string(&entry).expect("readable");
                sources.push((names, entry, text));
            }
        }
    }
    sources
}

/// Tests that a page cites: `module::name` in its text, and `<!-- test: module::name, ... -->`, which only the source shows.
fn cited(page: &str) -> (Vec<&str>, Vec<&str>) {
    let comments = page.split("<!-- test: ").skip(1).filter_map(|rest| rest.split(" -->").next());
    let in_comments = comments.flat_map(|names| names.split(',')).map(str::trim).collect();
    (page.split('`').skip(1).step_by(2).filter(|code| code.contains("::")).collect(), in_comments)
}

/// A comment that begins a line ends the paragraph before it, and the rest of its line is shown as it is written.
#[test]
fn comments_do_not_break_paragraphs() {
    let breaks = |[before, line, next]: [&str; 3]| {
        let comment = line.trim_start();
        let rest = comment.rsplit_once("-->").map_or("", |(_, rest)| rest.trim());
        comment.starts_with("<!-- test") && (!rest.is_empty() || !before.trim().is_empty() && is_prose(next))
    };
    let mut wrong = Vec::new();
    for path in pages().expect("readable") {
        let text = fs::read_to_string(&path).expect("readable");
        let lines: Vec<&str> = text.lines().chain([""]).collect();
        let broken = lines.array_windows().enumerate().filter(|(_, lines)| breaks(**lines));
        wrong.extend(broken.map(|(index, _)| format!("{}:{}", path.display(), index + 2)));
    }
    assert!(wrong.is_empty(), "{wrong:#?}: write the comment at the end of the line before");
}

/// Whether a line of a page goes on with the one before.
fn is_prose(line: &str) -> bool {
    let line = line.trim_start();
    let is_numbered = line.split_once(". ").is_some_and(|(number, _)| number.bytes().all(|byte| byte.is_ascii_digit()));
    !line.is_empty() && !is_numbered && !["|", "#", "```", "- ", "* ", "<"].iter().any(|begin| line.starts_with(begin))
}

/// Tests that pages cite as `module::name` exist in that module, and commands with their answers as `cases::name`. So do the functions and the
/// modules of the sources. Names of tests are
/// sentences, which only the safety page shows to its reader.
#[test]
fn tests_that_are_cited_exist() {
    let sources = sources();
    let (mut count, mut wrong) = (0, Vec::new());
    for path in pages().expect("readable") {
        let text = fs::read_to_string(&path).expect("readable");
        let (in_text, in_comments) = cited(&text);
        for (cited, is_comment) in
            in_text.into_iter().map(|cited| (cited, false)).chain(in_comments.into_iter().map(|cited| (cited, true)))
        {
            let (modules, name) = cited.rsplit_once("::").unwrap_or(("", cited));
            let module = modules.rsplit("::").next().unwrap_or(modules);
            let is_word =
                |word: &str| word.chars().all(|letter| letter.is_ascii_lowercase() || "_0123456789".contains(letter));
            if !(is_comment || is_word(module) && is_word(name)) {
                continue;
            }
            let there: Vec<_> =
                sources.iter().filter(|(names, ..)| names.iter().any(|other| other == module)).collect();
            let is_sentence = name.matches('_').count() >= 3;
            // `f32::sin` is not ours.
            if there.is_empty() && !is_sentence && !is_comment {
                continue;
            }
            count += 1;
            let defined = ["fn NAME(", "fn NAME<", "def NAME("].map(|defined| defined.replace("NAME", name));
            let files = ["rs", "trycmd"].map(|kind| format!("{module}/{name}.{kind}"));
            let found = there.iter().any(|(_, path, source)| {
                files.iter().any(|file| path.ends_with(file)) || defined.iter().any(|defined| source.contains(defined))
            });
            if !found {
                wrong.push(format!("{}: no {cited}", path.display()));
            }
            let shown = is_sentence && !is_comment && !path.ends_with("docs/safety.md");
            if shown {
                wrong.push(format!("{}: {cited} belongs in a comment, <!-- test: {cited} -->", path.display()));
            }
        }
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
    assert!(count > 100, "{count} tests are cited");
}
