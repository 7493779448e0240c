//! A figure inside a page: its data, drawn by the page's script.

use maud::{Markup, PreEscaped, html};
use serde_json::{Value, json};

use super::figure::{Band, Figure, MAX_POINTS, Panel};
use crate::grid::range;

/// `figure` for a page: plots that zoom together where they share an axis.
pub fn figure(figure: &Figure) -> Markup {
    html! {
        @for panel in &figure.panels { (chart(panel, &figure.title)) }
    }
}

/// `panel` for a page, zoomed with the others of `group` on the same axis.
pub fn chart(panel: &Panel, group: &str) -> Markup {
    html! {
        figure.chart data-group=[(!panel.is_path).then(|| format!("{group} | {}", panel.x_label))] {
            h4 { (panel.title) }
            div.plot tabindex="0" role="group" aria-label=(spoken(panel)) {}
            figcaption {
                (panel.caption)
                @if panel.is_thinned() {
                    " "
                    span.thinned {
                        @if panel.is_path {
                            "Drawn with every nth sample, at most " (MAX_POINTS) " a line."
                        } @else {
                            "Drawn with the lowest and highest of every few samples, at most " (MAX_POINTS) " points a line."
                        }
                    }
                }
            }
            script type="application/json" { (PreEscaped(in_script(&data(panel).to_string()))) }
        }
    }
}

/// Text of `panel` for a screen reader: its lines with their ranges, and the keys.
fn spoken(panel: &Panel) -> String {
    let mut lines: Vec<String> = panel
        .drawn()
        .filter_map(|(line, _, points)| {
            let (low, high) = range(points.iter().map(|(_, y)| y));
            (low <= high).then(|| format!("{} from {} to {}", line.label, digits(low, 3), digits(high, 3)))
        })
        .collect();
    let marked = |band: &Band| format!("{} marked from {} to {}", band.label, digits(band.from, 3), digits(band.to, 3));
    lines.extend(panel.band.as_ref().map(marked));
    format!(
        "Plot {}: {} over {}; {}. Arrow keys move the cursor, plus and minus zoom, Page Up and Page Down pan, 0 shows all.",
        panel.title,
        panel.y_label,
        panel.x_label,
        lines.join("; ")
    )
}

fn data(panel: &Panel) -> Value {
    let lines: Vec<Value> = panel
        .drawn()
        .map(|(line, colour, points)| {
            let count = x_digits(&points);
            json!({
                "label": line.label,
                "colour": colour.name,
                "width": line.width,
                "dashed": line.dashed,
                "marked": line.marked,
                "x": points.iter().map(|(x, _)| digits(*x, count)).collect::<Vec<f64>>(),
                "y": points.iter().map(|(_, y)| digits(*y, 5)).collect::<Vec<f64>>(),
            })
        })
        .collect();
    json!({
        "x": panel.x_label,
        "y": panel.y_label,
        "logX": panel.log_x,
        "logY": panel.log_y,
        "path": panel.is_path,
        "band": panel.band.as_ref().map(|band| json!({"label": band.label, "from": band.from, "to": band.to})),
        "lines": lines,
    })
}

/// Digits that distinguish values of x as finely as six do on an axis that begins at 0.
fn x_digits(points: &[(f64, f64)]) -> usize {
    let (low, high) = range(points.iter().map(|(x, _)| x));
    let more = (low.abs().max(high.abs()) / (high - low)).log10().ceil();
    6 + if more.is_finite() && more > 0.0 { (more as usize).min(9) } else { 0 }
}

/// `value` with at most `count` digits.
fn digits(value: f64, count: usize) -> f64 {
    format!("{value:.*e}", count - 1).parse().unwrap_or(value)
}

/// JSON for a `script` element: no text in it can end the element.
pub fn in_script(json: &str) -> String {
    json.replace('<', "\\u003c")
}
