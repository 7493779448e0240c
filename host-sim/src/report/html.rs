//! HTML pages without scripts or links, with their figures inside.

use maud::{DOCTYPE, Markup, PreEscaped, html};

use super::plot::{self, Panel};

const STYLE: &str = "body{font:16px/1.5 system-ui,sans-serif;max-width:60rem;margin:2rem auto;padding:0 1rem;color:#222}\
    table{border-collapse:collapse;margin:1rem 0}th,td{padding:.2rem .7rem;text-align:right;border-bottom:1px solid #ddd}\
    th:first-child,td:first-child{text-align:left}tr.chosen{font-weight:600;background:#eef5fb}\
    svg{max-width:100%;height:auto}.warning{border-left:4px solid #d55e00;padding-left:.7rem}";

/// A page with a title.
pub fn page(title: &str, body: &Markup) -> String {
    html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                title { (title) }
                style { (PreEscaped(STYLE)) }
            }
            body {
                h1 { (title) }
                (body)
            }
        }
    }
    .into_string()
}

/// A table; marked rows are highlighted.
pub fn table(header: &[&str], rows: &[(bool, Vec<String>)]) -> Markup {
    html! {
        table {
            thead { tr { @for cell in header { th { (cell) } } } }
            tbody {
                @for (marked, cells) in rows {
                    tr.chosen[*marked] { @for cell in cells { td { (cell) } } }
                }
            }
        }
    }
}

/// A figure inside the page.
pub fn figure(panels: &[Panel]) -> Markup {
    let svg = plot::svg(panels);
    // Without the XML declaration of a file.
    let start = svg.find("<svg").unwrap_or(0);
    PreEscaped(svg[start..].to_owned())
}
