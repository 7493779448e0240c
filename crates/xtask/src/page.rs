//! The page of a demo in a browser: everything is drawn, nothing is reported to the console, and the numbers are those of `--json`.

use std::path::Path;
use std::process::Command;

use crate::process::{Result, cargo, command, make, output, read, root, write};
use crate::setup;

/// Most bytes of a page of three recordings.
const MAX_BYTES: usize = 1_000_000;
/// Runs within a copy of the page and leaves its findings in an element.
const CHECKS: &str = include_str!("page.js");
/// Its findings that are errors.
const FINDINGS: [(&str, &str); 6] = [
    ("blank", "plots without a line"),
    ("unlike", "numbers that are not those of the document"),
    ("wide", "pixels that the page is wider than its window"),
    ("keyless", "plots that keys do not move"),
    ("unnamed", "controls without a name"),
    ("failed", "scripts that failed"),
];

/// A way to look at a page: its name, the window, and the browser's options.
type Look = (&'static str, (u32, u32), &'static [&'static str]);
const DARK: &[&str] = &["--blink-settings=preferredColorScheme=0"];
const LOOKS: [Look; 4] = [
    ("light", (1400, 12_000), &[]),
    ("dark", (1400, 12_000), DARK),
    ("phone", (390, 16_000), &[]),
    ("phone-dark", (390, 16_000), DARK),
];

/// Makes a demo and looks at its page.
pub fn run() -> Result<()> {
    let browser = setup::chromium()?;
    let folder = root().join("target").join("page");
    make(&folder)?;
    let folder_text = folder.to_string_lossy().into_owned();
    let mut demo = cargo("run --quiet --package host-sim -- demo --json --out");
    demo.arg(&folder_text);
    let printed = output(demo)?;
    let path = folder.join("report.html");
    let page = read(&path)?;
    check_document(&page, printed.trim_end())?;
    println!("{}: {} bytes, its document is what --json prints", path.display(), page.len());
    let checked = folder.join("checked.html");
    let with_checks = page.replace("</body>", &format!("<script>{CHECKS}</script></body>"));
    write(&checked, &with_checks)?;
    for look in LOOKS {
        check_look(browser, &folder, &path, &checked, look)?;
    }
    let pdf = folder.join("print.pdf");
    let mut print = headless(browser, &folder, &path, &[&format!("--print-to-pdf={}", pdf.display())]);
    print.arg("--no-pdf-header-footer");
    quiet(print, "print")?;
    println!("pictures to look at: {folder_text}/*.png, {}", pdf.display());
    Ok(())
}

/// The page is small and holds `printed`.
fn check_document(page: &str, printed: &str) -> Result<()> {
    if page.len() > MAX_BYTES {
        return Err(format!("the page has {} bytes, {MAX_BYTES} at the most", page.len()));
    }
    let begin = "<script type=\"application/json\" id=\"document\">";
    let embedded = page.split(begin).nth(1).and_then(|rest| rest.split("</script>").next());
    if embedded.map(|text| text.replace("\\u003c", "<")).as_deref() != Some(printed) {
        return Err("the page's document is not what --json printed".into());
    }
    Ok(())
}

/// Runs the checks in a window and takes a picture.
fn check_look(browser: &str, folder: &Path, page: &Path, checked: &Path, (name, size, more): Look) -> Result<()> {
    let window = format!("--window-size={},{}", size.0, size.1);
    let mut dump = headless(browser, folder, checked, &["--dump-dom", &window]);
    dump.args(more);
    let dom = quiet(dump, name)?;
    let found = dom.split("<pre id=\"page-checks\">").nth(1).and_then(|rest| rest.split("</pre>").next());
    let found = found.ok_or_else(|| format!("{name}: the checks did not end"))?;
    println!("{name}, {} pixels wide: {}", size.0, found.replace('\n', ", "));
    let count = |key: &str| -> Result<usize> {
        let line = found.lines().find_map(|line| line.strip_prefix(&format!("{key} ")));
        line.and_then(|count| count.parse().ok()).ok_or_else(|| format!("{name}: nothing was found of {key}"))
    };
    for (key, what) in [("plots", "plots"), ("numbers", "numbers")] {
        if count(key)? == 0 {
            return Err(format!("{name}: no {what}"));
        }
    }
    for (key, what) in FINDINGS {
        if count(key)? > 0 {
            return Err(format!("{name}: {} {what}", count(key)?));
        }
    }
    let picture = folder.join(format!("{name}.png"));
    let mut shot = headless(browser, folder, page, &[&format!("--screenshot={}", picture.display()), &window]);
    shot.args(more);
    quiet(shot, name).map(drop)
}

fn headless(browser: &str, folder: &Path, page: &Path, options: &[&str]) -> Command {
    let fixed =
        "--headless --no-sandbox --disable-gpu --hide-scrollbars --enable-logging=stderr --virtual-time-budget=10000";
    let mut browser = command(browser, &fixed.split(' ').collect::<Vec<_>>());
    browser.args(options).arg(format!("--user-data-dir={}", folder.join("profile").display()));
    browser.arg(format!("file://{}", page.display()));
    browser
}

/// Returns what `browser` prints, if the page wrote nothing to its console.
fn quiet(mut browser: Command, name: &str) -> Result<String> {
    let done = browser.output().map_err(|error| format!("{name}: {error}"))?;
    let messages = String::from_utf8_lossy(&done.stderr);
    if let Some(line) = messages.lines().find(|line| line.contains("CONSOLE")) {
        return Err(format!("{name}: the page wrote to the console: {line}"));
    }
    if !done.status.success() {
        return Err(format!("{name}: the browser ended with {}: {messages}", done.status));
    }
    Ok(String::from_utf8_lossy(&done.stdout).into_owned())
}
