//! Figures: line charts stacked in panels, as SVG or PNG.

use std::path::Path;

use kuva::backend::png::PngBackend;
use kuva::backend::svg::SvgBackend;
use kuva::plot::LineStyle;
use kuva::prelude::{Figure, Layout, LegendPosition, LinePlot, Plot};
use kuva::render::render::Scene;

use crate::error::{Error, Result};
use crate::files::output;

/// Colours that colour-blind people can tell apart (Okabe and Ito), in the order of the lines.
pub const COLOURS: [&str; 6] = ["#7f7f7f", "#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00"];

/// Width and height of a panel in pixels.
const PANEL: (f64, f64) = (900.0, 330.0);
/// The same width for the legends of all panels, so that their axes are aligned.
const LEGEND_WIDTH: f64 = 220.0;
/// More points than these are thinned: a screen does not show them.
const MOST_POINTS: usize = 2000;

/// A line of a panel.
#[derive(Clone, Debug)]
pub struct Line {
    label: String,
    points: Vec<(f64, f64)>,
    width: f64,
    style: LineStyle,
    colour: Option<&'static str>,
}

impl Line {
    /// The line through `y` at `x`.
    pub fn new(label: impl Into<String>, x: &[f64], y: &[f64]) -> Self {
        let points = thinned(x.iter().copied().zip(y.iter().copied()).collect());
        Self { label: label.into(), points, width: 1.5, style: LineStyle::Solid, colour: None }
    }

    /// The same, `width` pixels wide.
    #[must_use]
    pub fn wide(mut self, width: f64) -> Self {
        self.width = width;
        self
    }

    /// The same, dashed.
    #[must_use]
    pub fn dashed(mut self) -> Self {
        self.style = LineStyle::Dashed;
        self
    }

    /// The same in a colour of its own, instead of the next of [`COLOURS`].
    #[must_use]
    pub fn coloured(mut self, colour: &'static str) -> Self {
        self.colour = Some(colour);
        self
    }
}

/// A chart with its axes.
#[derive(Clone, Debug)]
pub struct Panel {
    title: String,
    x_label: String,
    y_label: String,
    lines: Vec<Line>,
    log_x: bool,
    log_y: bool,
}

impl Panel {
    /// A panel with a title and labelled axes.
    pub fn new(title: impl Into<String>, x_label: impl Into<String>, y_label: impl Into<String>) -> Self {
        Self {
            title: title.into(),
            x_label: x_label.into(),
            y_label: y_label.into(),
            lines: Vec::new(),
            log_x: false,
            log_y: false,
        }
    }

    /// The same with one more line on top.
    #[must_use]
    pub fn with(mut self, line: Line) -> Self {
        self.lines.push(line);
        self
    }

    /// The same with logarithmic axes.
    #[must_use]
    pub fn logarithmic(mut self, x: bool, y: bool) -> Self {
        (self.log_x, self.log_y) = (x, y);
        self
    }

    fn plots(&self) -> Vec<Plot> {
        self.lines
            .iter()
            .zip(COLOURS.iter().cycle())
            .map(|(line, colour)| {
                LinePlot::new()
                    .with_data(line.points.iter().copied())
                    .with_color(line.colour.unwrap_or(colour))
                    .with_stroke_width(line.width)
                    .with_line_style(line.style.clone())
                    .with_legend(&line.label)
                    .into()
            })
            .collect()
    }

    fn layout(&self, plots: &[Plot]) -> Layout {
        let layout = Layout::auto_from_plots(plots)
            .with_title(&self.title)
            .with_x_label(&self.x_label)
            .with_y_label(&self.y_label)
            .with_clamp_axis()
            .with_legend_position(LegendPosition::OutsideRightTop)
            .with_legend_width(LEGEND_WIDTH)
            .with_title_size(16);
        let layout = if self.log_x { layout.with_log_x() } else { layout };
        if self.log_y { layout.with_log_y() } else { layout }
    }
}

/// Writes `panels`, one above the other, to `path`: SVG or PNG by its ending.
///
/// # Errors
///
/// [`Error::File`] for another ending or where the file cannot be written.
pub fn write(path: &Path, panels: &[Panel]) -> Result<()> {
    let ending = path.extension().and_then(|ending| ending.to_str()).unwrap_or("");
    if !matches!(ending, "svg" | "png") {
        return Err(Error::file(path, "a figure is written as .svg or .png"));
    }
    let bytes = if ending == "svg" {
        svg(panels).into_bytes()
    } else {
        PngBackend::new().with_scale(1.5).render_scene(&scene(panels)).map_err(|e| Error::file(path, e))?
    };
    output::write_whole(path, |out| out.write_all(&bytes))
}

/// `panels`, one above the other, as SVG text.
pub fn svg(panels: &[Panel]) -> String {
    SvgBackend::new().render_scene(&scene(panels))
}

fn scene(panels: &[Panel]) -> Scene {
    let (plots, layouts): (Vec<Vec<Plot>>, Vec<Layout>) = panels
        .iter()
        .map(|panel| {
            let plots = panel.plots();
            let layout = panel.layout(&plots);
            (plots, layout)
        })
        .unzip();
    Figure::new(panels.len(), 1).with_plots(plots).with_layouts(layouts).with_cell_size(PANEL.0, PANEL.1).render()
}

/// Every chunk of points becomes its first, lowest, highest and last one, so that no peak is lost.
fn thinned(points: Vec<(f64, f64)>) -> Vec<(f64, f64)> {
    let length = points.len().div_ceil(MOST_POINTS / 4);
    if length <= 4 {
        return points;
    }
    points
        .chunks(length)
        .flat_map(|chunk| {
            let by_value = |i: &usize, j: &usize| chunk[*i].1.total_cmp(&chunk[*j].1);
            let mut keep =
                [Some(0), (0..chunk.len()).min_by(by_value), (0..chunk.len()).max_by(by_value), Some(chunk.len() - 1)];
            keep.sort_unstable();
            keep.into_iter().flatten().map(|i| chunk[i]).collect::<Vec<_>>()
        })
        .collect()
}
