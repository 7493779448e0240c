//! Figures: panels of lines with their axes. [`drawing`](super::drawing) makes SVG and PNG of them, `chart` plots of a page.

/// A colour that colour-blind people can distinguish from the others (Okabe and Ito).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Colour {
    /// On white.
    pub on_white: &'static str,
    /// Its name in a page's style sheet.
    pub name: &'static str,
}

impl Colour {
    /// Measured or requested values, beneath other lines.
    pub const GREY: Self = Self { on_white: "#9a9a9a", name: "grey" };
    /// The first of the lines on top.
    pub const BLUE: Self = Self { on_white: "#0072b2", name: "blue" };
    /// The second.
    pub const VERMILION: Self = Self { on_white: "#d55e00", name: "vermilion" };
    /// The third.
    pub const GREEN: Self = Self { on_white: "#009e73", name: "green" };
    /// The fourth.
    pub const PURPLE: Self = Self { on_white: "#cc79a7", name: "purple" };
    /// The fifth.
    pub const ORANGE: Self = Self { on_white: "#e69f00", name: "orange" };
    /// Colours of lines that name none, in their order.
    const CYCLE: [Self; 5] = [Self::BLUE, Self::VERMILION, Self::GREEN, Self::PURPLE, Self::ORANGE];
}

/// Most points of a line as it is drawn: more do not show on a screen.
pub const MAX_POINTS: usize = 1600;

/// Points of a line.
pub type Points = Vec<(f64, f64)>;

/// A line of a panel.
#[derive(Clone, Debug, PartialEq)]
pub struct Line {
    /// Its name in the legend.
    pub label: String,
    /// Its points, thinned.
    pub points: Points,
    /// Number of points before they were thinned.
    pub all: usize,
    /// Its width in pixels.
    pub width: f64,
    /// Whether it is dashed.
    pub dashed: bool,
    /// Whether its points are marked.
    pub marked: bool,
    /// Its colour, if it is not the next one.
    pub colour: Option<Colour>,
}

impl Line {
    /// The line through `y` at `x`, which increases; points without a value are left out.
    pub fn new(label: impl Into<String>, x: &[f64], y: &[f64]) -> Self {
        Self::of_points(label, thinned, x, y)
    }

    /// The same for a logarithmic axis of x, where points at or below 0 cannot be shown.
    pub fn on_logarithmic(label: impl Into<String>, x: &[f64], y: &[f64]) -> Self {
        Self::of_points(label, logarithmically_thinned, x, y)
    }

    /// The line through `y` at `x` of any order, such as a loop.
    pub fn path(label: impl Into<String>, x: &[f64], y: &[f64]) -> Self {
        Self::of_points(label, every_nth, x, y)
    }

    fn of_points(label: impl Into<String>, thin: fn(Points) -> Points, x: &[f64], y: &[f64]) -> Self {
        let finite = |(x, y): &(f64, f64)| x.is_finite() && y.is_finite();
        let points: Points = x.iter().copied().zip(y.iter().copied()).filter(finite).collect();
        let all = points.len();
        Self { label: label.into(), points: thin(points), all, width: 1.5, dashed: false, marked: false, colour: None }
    }

    /// The same, dashed.
    #[must_use]
    pub fn dashed(mut self) -> Self {
        self.dashed = true;
        self
    }

    /// The same with a mark at every point.
    #[must_use]
    pub fn marked(mut self) -> Self {
        self.marked = true;
        self
    }

    /// The same in a colour of its own.
    #[must_use]
    pub fn coloured(mut self, colour: Colour) -> Self {
        self.colour = Some(colour);
        self
    }

    /// A line beneath others: wide and grey, so that a thin line on top leaves both visible.
    #[must_use]
    pub fn beneath(self) -> Self {
        Self { width: 4.5, ..self.coloured(Colour::GREY) }
    }
}

/// Values of x that are marked.
#[derive(Clone, Debug, PartialEq)]
pub struct Band {
    /// Their name.
    pub label: String,
    /// The lowest.
    pub from: f64,
    /// The highest.
    pub to: f64,
}

/// A chart with its axes.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Panel {
    /// Its title.
    pub title: String,
    /// Quantity and unit of x.
    pub x_label: String,
    /// Quantity and unit of y.
    pub y_label: String,
    /// Its lines, the lowest first.
    pub lines: Vec<Line>,
    /// Whether x is logarithmic.
    pub log_x: bool,
    /// Whether y is logarithmic.
    pub log_y: bool,
    /// Whether x goes back and forth along a line, as along a loop: its lines are [`Line::path`]s.
    pub is_path: bool,
    /// Values of x that are marked.
    pub band: Option<Band>,
    /// Explanation for the reader, in a sentence or two.
    pub caption: String,
}

impl Panel {
    /// A panel with a title and labelled axes.
    pub fn new(title: impl Into<String>, x_label: impl Into<String>, y_label: impl Into<String>) -> Self {
        Self { title: title.into(), x_label: x_label.into(), y_label: y_label.into(), ..Self::default() }
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

    /// The same with values of x marked.
    #[must_use]
    pub fn banded(mut self, label: impl Into<String>, from: f64, to: f64) -> Self {
        self.band = Some(Band { label: label.into(), from, to });
        self
    }

    /// The same with a caption.
    #[must_use]
    pub fn captioned(mut self, caption: impl Into<String>) -> Self {
        self.caption = caption.into();
        self
    }

    /// Its lines with their colours and the points that its axes can show.
    pub fn drawn(&self) -> impl Iterator<Item = (&Line, Colour, Points)> {
        let mut cycle = Colour::CYCLE.into_iter().cycle();
        self.lines.iter().map(move |line| {
            let colour = line.colour.or_else(|| cycle.next()).unwrap_or(Colour::BLUE);
            let shows = |(x, y): &(f64, f64)| (!self.log_x || *x > 0.0) && (!self.log_y || *y > 0.0);
            (line, colour, line.points.iter().copied().filter(shows).collect())
        })
    }

    /// Whether a line has fewer points than were given.
    pub fn is_thinned(&self) -> bool {
        self.lines.iter().any(|line| line.points.len() < line.all)
    }
}

/// Panels, one above the other.
#[derive(Clone, Debug, PartialEq)]
pub struct Figure {
    /// Its title.
    pub title: String,
    /// Its panels.
    pub panels: Vec<Panel>,
}

impl Figure {
    /// A figure of `panels`.
    pub fn new(title: impl Into<String>, panels: Vec<Panel>) -> Self {
        Self { title: title.into(), panels }
    }
}

/// Every chunk of points becomes its lowest and its highest, so that no peak is lost; the ends stay.
fn thinned(points: Points) -> Points {
    let [first, inner @ .., last] = points.as_slice() else { return points };
    let length = inner.len().div_ceil(CHUNKS);
    if length <= 2 {
        return points;
    }
    extremes(*first, inner.chunks(length), *last)
}

/// The same with chunks that are equally long on a logarithmic axis.
fn logarithmically_thinned(mut points: Points) -> Points {
    points.retain(|(x, _)| *x > 0.0);
    let [first, inner @ .., last] = points.as_slice() else { return points };
    if inner.len() <= 2 * CHUNKS {
        return points;
    }
    let per_e_fold = CHUNKS as f64 / (last.0 / first.0).ln();
    let chunk = |point: &(f64, f64)| ((point.0 / first.0).ln() * per_e_fold) as usize;
    extremes(*first, inner.chunk_by(|a, b| chunk(a) == chunk(b)), *last)
}

/// Chunks of a thinned line: each has two points.
const CHUNKS: usize = MAX_POINTS / 2 - 1;

fn extremes<'a>(first: (f64, f64), chunks: impl Iterator<Item = &'a [(f64, f64)]>, last: (f64, f64)) -> Points {
    let by_value = |a: &(usize, &(f64, f64)), b: &(usize, &(f64, f64))| a.1.1.total_cmp(&b.1.1);
    let both = chunks.flat_map(|chunk| {
        let lowest = chunk.iter().enumerate().min_by(by_value);
        let highest = chunk.iter().enumerate().max_by(by_value);
        let mut both: Vec<(usize, &(f64, f64))> = lowest.into_iter().chain(highest).collect();
        both.sort_unstable_by_key(|(row, _)| *row);
        both.dedup_by_key(|(row, _)| *row);
        both.into_iter().map(|(_, point)| *point)
    });
    [first].into_iter().chain(both).chain([last]).collect()
}

/// Every so many points of a path: lowest and highest mean nothing there.
fn every_nth(points: Points) -> Points {
    let every = points.len().div_ceil(MAX_POINTS).max(1);
    points.into_iter().step_by(every).collect()
}
