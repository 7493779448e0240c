//! The drawings of the boards, from the tables of docs/boards.md: pins on the left, parts on the right, a wire to a row.

use std::fmt::Write;
use std::path::PathBuf;

use crate::process::{Result, read, root, write};

/// A wire of a board.
struct Wire<'a> {
    pin: &'a str,
    signal: &'a str,
    through: &'a str,
    part: &'a str,
    terminal: &'a str,
}

/// Draws every board.
pub fn run() -> Result<()> {
    for (path, drawing) in drawings()? {
        write(&path, &drawing)?;
        println!("{}", path.display());
    }
    Ok(())
}

/// The files of the drawings, and their contents.
fn drawings() -> Result<Vec<(PathBuf, String)>> {
    let docs = root().join("docs");
    let page = read(&docs.join("boards.md"))?;
    let mut drawings = Vec::new();
    for section in page.split("\n## ") {
        let Some((_, rest)) = section.split_once("](").filter(|(before, _)| before.contains("\n![")) else { continue };
        let name = rest.split(')').next().unwrap_or_default();
        let title = section.lines().next().unwrap_or_default();
        drawings.push((docs.join(name), drawing(title, &wires(section)?)));
    }
    if drawings.is_empty() { Err("docs/boards.md: no drawings".into()) } else { Ok(drawings) }
}

/// The wires in the table of a section.
fn wires(section: &str) -> Result<Vec<Wire<'_>>> {
    let table = section.lines().skip_while(|line| !line.starts_with("| pin |")).skip(2);
    let rows = table.take_while(|line| line.starts_with('|'));
    rows.map(|line| {
        let cells: Vec<&str> = line.trim_matches('|').split('|').map(str::trim).collect();
        let &[pin, signal, through, to] = cells.as_slice() else { return Err(format!("docs/boards.md: {line}")) };
        let (part, terminal) = to.split_once(": ").ok_or_else(|| format!("docs/boards.md: no part in {line}"))?;
        Ok(Wire { pin, signal, through, part, terminal })
    })
    .collect()
}

/// Sizes, pixels.
const ROW: usize = 46;
const TOP: usize = 56;
const BOARD: [usize; 2] = [20, 150];
const PARTS: [usize; 2] = [620, 880];
const WIDTH: usize = 900;

fn drawing(title: &str, wires: &[Wire]) -> String {
    let height = TOP + ROW * wires.len() + 24;
    let mut svg = String::new();
    let mut line = |text: std::fmt::Arguments| {
        // A string takes whatever comes.
        let _ = writeln!(svg, "{text}");
    };
    line(format_args!(
        r#"<svg xmlns="http://www.w3.org/2000/svg" width="{WIDTH}" height="{height}" viewBox="0 0 {WIDTH} {height}" font-family="sans-serif" font-size="13">"#
    ));
    line(format_args!("<title>{}</title>", escaped(title)));
    line(format_args!(r#"<rect width="{WIDTH}" height="{height}" fill="white"/>"#));
    let [left, right] = BOARD;
    let tall = ROW * wires.len();
    line(format_args!(
        r##"<rect x="{left}" y="{TOP}" width="{}" height="{tall}" fill="#eef3f8" stroke="black"/>"##,
        right - left
    ));
    line(format_args!(r#"<text x="{left}" y="{}" font-weight="bold">{}</text>"#, TOP - 16, escaped(title)));
    let [from, to] = PARTS;
    for (index, wire) in wires.iter().enumerate() {
        let y = TOP + ROW * index + ROW / 2;
        // A part begins where the row before had another one.
        if index == 0 || wires[index - 1].part != wire.part {
            let rows = wires[index..].iter().take_while(|other| other.part == wire.part).count();
            line(format_args!(
                r##"<rect x="{from}" y="{}" width="{}" height="{}" fill="#f8f4ea" stroke="black"/>"##,
                y - ROW / 2 + 3,
                to - from,
                ROW * rows - 6
            ));
            line(format_args!(
                r#"<text x="{}" y="{}" text-anchor="end" font-weight="bold">{}</text>"#,
                to - 8,
                y - 4,
                escaped(wire.part)
            ));
        }
        line(format_args!(r#"<line x1="{right}" y1="{y}" x2="{from}" y2="{y}" stroke="black" stroke-width="1.5"/>"#));
        line(format_args!(r#"<text x="{}" y="{}" text-anchor="end">{}</text>"#, right - 8, y + 5, escaped(wire.pin)));
        line(format_args!(r#"<text x="{}" y="{}">{}</text>"#, right + 10, y - 5, escaped(wire.signal)));
        if wire.through != "–" {
            line(format_args!(
                r##"<text x="{}" y="{}" font-size="12" fill="#a03000">{}</text>"##,
                right + 10,
                y + 15,
                escaped(wire.through)
            ));
        }
        line(format_args!(r#"<text x="{}" y="{}">{}</text>"#, from + 8, y + 5, escaped(wire.terminal)));
    }
    svg.push_str("</svg>\n");
    svg
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;")
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `cargo xtask wiring` draws them again.
    #[test]
    fn the_drawings_are_those_of_the_tables() {
        for (path, drawing) in drawings().expect("tables") {
            assert!(read(&path).expect("a drawing") == drawing, "{}: cargo xtask wiring", path.display());
        }
    }

    /// Every board file has its drawing, and no text is longer than its place: seven pixels a letter at 13.
    #[test]
    fn every_board_has_a_drawing_with_room_for_its_texts() {
        let names: Vec<String> = drawings()
            .expect("tables")
            .into_iter()
            .map(|(path, _)| path.file_stem().expect("a name").to_string_lossy().into_owned())
            .collect();
        let boards = std::fs::read_dir(root().join("firmware/src/boards")).expect("boards");
        for board in boards {
            let path = board.expect("an entry").path();
            assert!(
                names.contains(&path.file_stem().expect("a name").to_string_lossy().into_owned()),
                "{}",
                path.display()
            );
            assert!(
                read(&path).expect("a board").lines().count() <= 300,
                "{}: a board is 300 lines at the most",
                path.display()
            );
        }
        let page = read(&root().join("docs/boards.md")).expect("a page");
        for section in page.split("\n## ").filter(|section| section.contains("\n| pin |")) {
            for Wire { pin, signal, through, part, terminal } in wires(section).expect("a table") {
                let room = PARTS[0] - BOARD[1];
                for (text, room) in
                    [(pin, 120), (signal, room), (through, room), (&*format!("{part}  {terminal}"), 250)]
                {
                    assert!(7 * text.chars().count() + 16 <= room, "{text}");
                }
            }
        }
    }
}
