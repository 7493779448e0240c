//! The book of docs/: built with mdBook, and every link in its pages leads to a page and a heading of it; and the documentation in sources.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::Path;

use crate::process::{Result, at, cargo, command, entries, make, name, read, root, run as run_command, write};
use crate::setup;

/// Builds the documentation in sources, and the book into target/book, and follows its links.
pub fn run() -> Result<()> {
    documentation()?;
    // Without its server and its search, which a book that opens from the disk does not have.
    let mdbook = setup::tool("mdbook", "0.4.52", "--no-default-features")?;
    let source = root().join("target").join("book-source");
    lay_out(&root().join("docs"), &source)?;
    let built = root().join("target").join("book");
    run_command(command(
        &mdbook.to_string_lossy(),
        &["build", &source.to_string_lossy(), "--dest-dir", &built.to_string_lossy()],
    ))?;
    let (pages, links) = follow(&built)?;
    println!("{}: {pages} pages, {links} links", built.join("start.html").display());
    Ok(())
}

/// Packages whose documentation is read in their sources, if at all.
const WITHOUT_PAGES: [&str; 7] =
    ["board-on-host", "chip-program", "converter-chips", "documents", "fuzz-targets", "tests", "xtask"];

fn documentation() -> Result<()> {
    let left_out = WITHOUT_PAGES.map(|package| format!("--exclude {package}")).join(" ");
    let mut doc = cargo(&format!("doc --quiet --workspace --no-deps --document-private-items {left_out}"));
    doc.env("RUSTDOCFLAGS", "-D warnings");
    run_command(doc)
}

/// A page of another folder, under the name that it has in the book: `../firmware/README.md` is `firmware-README.md`.
fn flat(link: &str) -> String {
    link.trim_start_matches("../").replace('/', "-")
}

/// Copies `docs` to `source`, with the pages of other folders that SUMMARY.md lists.
fn lay_out(docs: &Path, source: &Path) -> Result<()> {
    let _ = fs::remove_dir_all(source);
    make(source)?;
    let summary = read(&docs.join("SUMMARY.md"))?;
    let elsewhere: Vec<&str> = summary
        .split("](")
        .skip(1)
        .filter_map(|rest| rest.split(')').next())
        .filter(|link| link.starts_with("../"))
        .collect();
    let moved = |text: String| {
        elsewhere.iter().fold(text, |text, link| text.replace(&format!("]({link}"), &format!("]({}", flat(link))))
    };
    for path in entries(docs)? {
        let to = source.join(name(&path));
        if path.extension().is_some_and(|extension| extension == "md") {
            write(&to, &moved(read(&path)?))?;
        } else if path.is_file() {
            fs::copy(&path, &to).map_err(at(&path))?;
        }
    }
    for link in &elsewhere {
        // As from a folder of the root, which docs is one of.
        let text = read(&docs.join(link))?.replace("](../../../", "](../").replace("](../../", "](../");
        write(&source.join(flat(link)), &moved(text.replace("](../docs/", "](")))?;
    }
    Ok(())
}

/// Follows the links between the pages in `built`: how many pages, and how many links.
fn follow(built: &Path) -> Result<(usize, usize)> {
    let mut pages = BTreeMap::new();
    for path in entries(built)? {
        let name = name(&path);
        if name.ends_with(".html") && name != "print.html" && name != "404.html" {
            pages.insert(name, read(&path)?);
        }
    }
    let of = |page: &str, attribute: &str| -> Vec<String> {
        let begin = format!(" {attribute}=\"");
        let values = page.split(begin.as_str()).skip(1);
        values.filter_map(|rest| rest.split('"').next()).map(str::to_owned).collect()
    };
    let headings: BTreeMap<&str, BTreeSet<String>> =
        pages.iter().map(|(name, page)| (name.as_str(), of(page, "id").into_iter().collect())).collect();
    let (mut count, mut broken) = (0, Vec::new());
    for (name, page) in &pages {
        for link in of(page, "href") {
            let (file, heading) = link.split_once('#').unwrap_or((&link, ""));
            if file.contains("://") {
                continue;
            }
            count += 1;
            let file = if file.is_empty() { name } else { file };
            let leads = match headings.get(file) {
                Some(there) => heading.is_empty() || there.contains(heading),
                None => built.join(file).is_file(),
            };
            if !leads {
                broken.push(format!("{name}: {link}"));
            }
        }
    }
    if broken.is_empty() {
        Ok((pages.len(), count))
    } else {
        Err(format!("links lead nowhere:\n{}", broken.join("\n")))
    }
}
