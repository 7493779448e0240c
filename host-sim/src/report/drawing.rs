//! Figures as SVG and PNG.

use kuva::backend::png::PngBackend;
use kuva::backend::svg::SvgBackend;
use kuva::plot::LineStyle;
use kuva::plot::annotations::ShadedRegion;
use kuva::prelude::{Figure as Scenes, Layout, LegendPosition, LinePlot, Plot, ScatterPlot};
use kuva::render::render::Scene;

use super::figure::{Figure, Panel};
use crate::grid::range;

/// Width and height of a panel in pixels, with its legend beneath.
const PANEL: (f64, f64) = (1000.0, 360.0);
/// Pixels of a PNG per pixel of the figure.
const SCALE: f32 = 1.5;

/// `figure` as SVG text.
pub fn svg(figure: &Figure) -> String {
    SvgBackend::new().render_scene(&scene(figure))
}

/// `figure` as the bytes of a PNG file.
pub fn png(figure: &Figure) -> Result<Vec<u8>, String> {
    PngBackend::new().with_scale(SCALE).render_scene(&scene(figure))
}

fn scene(figure: &Figure) -> Scene {
    let (plots, layouts): (Vec<Vec<Plot>>, Vec<Layout>) = figure
        .panels
        .iter()
        .map(|panel| {
            let plots = plots(panel);
            let layout = layout(panel, &plots);
            (plots, layout)
        })
        .unzip();
    Scenes::new(plots.len(), 1).with_plots(plots).with_layouts(layouts).with_cell_size(PANEL.0, PANEL.1).render()
}

fn plots(panel: &Panel) -> Vec<Plot> {
    let named = panel.lines.len() > 1;
    panel
        .drawn()
        .flat_map(|(line, colour, points)| {
            let marks = line.marked.then(|| {
                let marks = ScatterPlot::new().with_data(points.iter().copied());
                Plot::from(marks.with_color(colour.on_white).with_size(2.0 + line.width))
            });
            let style = if line.dashed { LineStyle::Dashed } else { LineStyle::Solid };
            let drawn = LinePlot::new()
                .with_data(points)
                .with_color(colour.on_white)
                .with_stroke_width(line.width)
                .with_line_style(style);
            // The axis names a line that is alone.
            let drawn = if named { drawn.with_legend(&line.label) } else { drawn };
            [Some(Plot::from(drawn)), marks].into_iter().flatten()
        })
        .collect()
}

/// Columns of a legend: as many as have room for the longest name.
fn legend_columns(panel: &Panel) -> usize {
    /// In pixels: the plot itself at the least, a letter and a line's sample with its gaps at the most.
    const PLOT: usize = 850;
    const LETTER: usize = 8;
    const SAMPLE: usize = 40;
    let longest = panel.lines.iter().map(|line| line.label.chars().count()).max().unwrap_or(0);
    (PLOT / (SAMPLE + LETTER * longest)).clamp(1, panel.lines.len().max(1))
}

fn layout(panel: &Panel, plots: &[Plot]) -> Layout {
    let mut layout = Layout::auto_from_plots(plots)
        .with_title(&panel.title)
        .with_x_label(&panel.x_label)
        .with_y_label(&panel.y_label)
        .with_clamp_axis()
        .with_legend_position(LegendPosition::OutsideBottomColumns)
        .with_legend_col_limit(legend_columns(panel))
        .with_legend_box(false)
        .with_title_size(16);
    if panel.log_x {
        layout = layout.with_log_x();
    } else if !panel.is_path {
        // As far as there is something to see.
        let (low, high) = range(panel.lines.iter().flat_map(|line| &line.points).map(|(x, _)| x));
        if low < high && !panel.lines.iter().any(|line| line.marked) {
            layout = layout.with_x_axis_min(low).with_x_axis_max(high);
        }
    }
    if panel.log_y {
        layout = layout.with_log_y();
    }
    if let Some(band) = &panel.band {
        let region = ShadedRegion::vertical(band.from, band.to).with_color("#56b4e9").with_opacity(0.2);
        layout = layout.with_shaded_region(region);
    }
    layout
}
