//! HTML pages that hold all they need: style, script, plots and the numbers behind them.

use maud::{DOCTYPE, Markup, PreEscaped, html};

use super::chart::in_script;
use super::numbers::{Document, Form, Numbers};

const STYLE: &str = include_str!("assets/page.css");
const SCRIPT: &str = include_str!("assets/charts.js");
const UPLOT: &str = include_str!("assets/uplot/uPlot.iife.min.js");
const UPLOT_STYLE: &str = include_str!("assets/uplot/uPlot.min.css");
const UPLOT_LICENCE: &str = include_str!("assets/uplot/LICENSE");

/// Nothing is loaded from anywhere, whatever text is in the page.
const POLICY: &str = "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; img-src data:; base-uri 'none'; \
                      form-action 'none'";

/// A page in parts.
pub struct Page<'a> {
    pub title: &'a str,
    /// Text under the title.
    pub lead: Markup,
    pub sections: Vec<Section>,
    /// The document that `--json` prints, if its numbers are in the page.
    pub document: Option<&'a Document>,
}

/// A part of a page.
pub struct Section {
    /// Its anchor.
    pub id: &'static str,
    pub heading: &'static str,
    pub body: Markup,
}

impl Section {
    pub fn new(id: &'static str, heading: &'static str, body: Markup) -> Self {
        Self { id, heading, body }
    }
}

impl Page<'_> {
    pub fn html(&self) -> String {
        html! {
            (DOCTYPE)
            html lang="en" {
                head {
                    meta charset="utf-8";
                    meta name="viewport" content="width=device-width, initial-scale=1";
                    meta name="color-scheme" content="light dark";
                    meta http-equiv="Content-Security-Policy" content=(POLICY);
                    title { (self.title) }
                    style { (PreEscaped(UPLOT_STYLE)) (PreEscaped(STYLE)) }
                }
                body {
                    a.skip href="#content" { "To the content" }
                    header {
                        h1 { (self.title) }
                        (self.lead)
                        @if self.sections.len() > 2 {
                            nav aria-label="Parts of this page" {
                                ul { @for section in &self.sections { li { a href={ "#" (section.id) } { (section.heading) } } } }
                            }
                        }
                    }
                    main id="content" {
                        noscript { p { "The plots need JavaScript, which is off in this browser; the tables do not." } }
                        @for section in &self.sections {
                            section id=(section.id) aria-labelledby={ (section.id) "-heading" } {
                                h2 id={ (section.id) "-heading" } { (section.heading) }
                                (section.body)
                            }
                        }
                    }
                    footer {
                        p {
                            "Plots: drag to zoom, double-click to see all, click a name in a legend to hide its line. Of a plot in focus the \
                             arrow keys move the cursor, + and − zoom, Page Up and Page Down pan, 0 shows all."
                        }
                        details {
                            summary { "Licence of uPlot, which draws the plots" }
                            pre { (UPLOT_LICENCE) }
                        }
                    }
                    @if let Some(document) = self.document {
                        script type="application/json" id="document" { (PreEscaped(in_script(document.text()))) }
                    }
                    script { (PreEscaped(UPLOT)) }
                    script { (PreEscaped(SCRIPT)) }
                }
            }
        }
        .into_string()
    }
}

/// A row of a table.
#[derive(Clone)]
pub struct Row {
    /// Its cells; the first names the row.
    pub cells: Vec<Markup>,
    /// Whether it is the one to see.
    pub marked: bool,
}

impl Row {
    pub fn new(cells: Vec<Markup>) -> Self {
        Self { cells, marked: false }
    }
}

/// A table that scrolls within a narrow page.
pub fn table(caption: &str, header: &[&str], rows: &[Row]) -> Markup {
    html! {
        div.table role="region" aria-label=(caption) tabindex="0" {
            table {
                caption { (caption) }
                thead { tr { @for cell in header { th scope="col" { (cell) } } } }
                tbody {
                    @for row in rows {
                        tr.marked[row.marked] {
                            @for (index, cell) in row.cells.iter().enumerate() {
                                @if index == 0 { th scope="row" { (cell) } } @else { td { (cell) } }
                            }
                        }
                    }
                }
            }
        }
    }
}

/// A cell of a table, by its place in a row of the document.
pub enum Cell {
    Text(&'static str),
    Number(&'static str, Form),
    Made(fn(&Numbers<'_>) -> Markup),
}

impl Cell {
    fn in_row(&self, row: &Numbers<'_>) -> Markup {
        match self {
            Self::Text(path) => text(row.text(path)),
            Self::Number(path, form) => row.number(path, *form),
            Self::Made(cell) => cell(row),
        }
    }
}

/// The table of the list at `numbers`: the titles of its columns with their cells. A row that is `chosen` is marked.
pub fn list(caption: &str, columns: &[(&str, Cell)], numbers: &Numbers<'_>) -> Markup {
    let header: Vec<&str> = columns.iter().map(|(title, _)| *title).collect();
    let row = |row: &Numbers<'_>| Row {
        cells: columns.iter().map(|(_, cell)| cell.in_row(row)).collect(),
        marked: row.at("/chosen").value() == true,
    };
    table(caption, &header, &numbers.rows().iter().map(row).collect::<Vec<Row>>())
}

/// Text as a cell.
pub fn text(text: impl AsRef<str>) -> Markup {
    html! { (text.as_ref()) }
}
