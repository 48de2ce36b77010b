//! A palpated phantom in the demo's picture: touches on the map of the first two components.

use super::Meter;
use crate::categorize::{Categorised, Listener, Live, PhantomMap, Source, Untold, follow, label_of};
use crate::client::scene_marks::SceneMarks;
use crate::view::lock;
use ratatui::buffer::Buffer;
use ratatui::layout::{Constraint, Layout as Split, Rect};
use ratatui::style::{Color, Modifier, Style};
use ratatui::text::{Line, Span};
use ratatui::widgets::{Block, Widget};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;
use taxel_sim::Scene;
use taxel_view::Palette;

/// Colours of the categories, by their number.
const COLOURS: [[u8; 3]; 6] = [
    [110, 160, 255],
    [255, 165, 60],
    [90, 200, 120],
    [240, 110, 160],
    [200, 190, 80],
    [160, 130, 230],
];
/// Lines below the map: the newest touch, and how many are in the category of their class.
const LINES: u16 = 2;

/// The map, and the touches that were put onto it.
#[derive(Debug, Clone, Default)]
pub(super) struct Palpation {
    /// Place and category of each touch that the map was made of.
    map: Vec<([f64; 2], usize)>,
    /// The class that each category stands for.
    classes: Vec<Option<String>>,
    /// Touches so far, and those whose category stands for their class.
    touches: usize,
    right: usize,
    unknown: usize,
    newest: Option<Categorised>,
    /// Where the touches of one round of the scene are, by category.
    placed: Vec<([f64; 2], usize)>,
}

impl Palpation {
    pub(super) fn new(map: &PhantomMap) -> Self {
        Self {
            map: map
                .places
                .iter()
                .copied()
                .zip(map.labels.iter().copied())
                .collect(),
            classes: map.classes.clone(),
            ..Self::default()
        }
    }

    fn touch(&mut self, touch: Categorised) {
        self.touches += 1;
        self.unknown += usize::from(touch.unknown);
        self.right += usize::from(!touch.unknown && touch.label.as_deref() == Some(label_of(&touch.mark)));
        if self.placed.len() == self.map.len() {
            self.placed.clear();
        }
        self.placed.push((place(&touch), touch.category));
        self.newest = Some(touch);
    }

    /// How many touches there were, in the category of their class, and in none.
    pub(super) fn figures(&self) -> Value {
        json!({ "count": self.touches, "right": self.right, "unknown": self.unknown })
    }

    /// A line of the demo's summary.
    pub(super) fn summary(&self) -> String {
        format!(
            "touches    {}, {} in the category of their class, {} unknown\n",
            self.touches, self.right, self.unknown
        )
    }
}

fn place(touch: &Categorised) -> [f64; 2] {
    std::array::from_fn(|axis| touch.place.get(axis).copied().unwrap_or_default())
}

/// A phantom's scene that is played: who makes its marks.
pub(super) struct Palpating {
    _marks: SceneMarks,
}

impl Palpating {
    /// Makes the scene's marks, and a reader on a thread of its own that puts touches onto the map.
    pub(super) fn start(
        scene: &Scene,
        live: Live,
        began: Instant,
        [images, control]: [PathBuf; 2],
        meter: &Arc<Meter>,
    ) -> anyhow::Result<Self> {
        let told = meter.clone();
        let marks = SceneMarks::start(scene, began, control, move |text| told.tell(text))?;
        let mut onto_map = OntoMap(meter.clone());
        std::thread::Builder::new()
            .name("touches".into())
            .spawn(move || onto_map.follow(&images, live))?;
        Ok(Self { _marks: marks })
    }
}

/// Puts touches onto the map of the meter.
struct OntoMap(Arc<Meter>);

impl OntoMap {
    fn follow(&mut self, images: &Path, live: Live) {
        let outcome = follow(Source::of(images), live, self);
        if let Err(error) = outcome {
            self.0.tell(format!("touches: {error:#}"));
        }
    }
}

impl Listener for OntoMap {
    fn touch(&mut self, touch: Result<Categorised, Untold>, _: u64, _: u64) -> anyhow::Result<()> {
        match (touch, &self.0.palpation) {
            (Ok(touch), Some(palpation)) => lock(palpation).touch(touch),
            (Err(error), _) => self.0.tell(format!("{error:#}")),
            (Ok(_), None) => {}
        }
        Ok(())
    }
}

/// Draws the map into a place of its own.
pub(super) fn draw(buffer: &mut Buffer, area: Rect, palpation: &Palpation, palette: Palette) {
    let border = Style::new().fg(palette.rgb(110, 110, 120));
    let block = Block::bordered()
        .border_style(border)
        .title(Span::styled(" touches: first two components ", Modifier::BOLD));
    let inner = block.inner(area);
    block.render(area, buffer);
    let [map, lines] = Split::vertical([Constraint::Min(1), Constraint::Length(LINES)]).areas(inner);
    let newest = palpation.newest.as_ref();
    let shown = palpation
        .map
        .iter()
        .chain(&palpation.placed)
        .map(|(place, _)| *place);
    let Some(scale) = Scale::of(shown, map) else {
        return;
    };
    let style = |category: usize| Style::new().fg(colour(category, palette));
    let draw_all = |buffer: &mut Buffer, points: &[([f64; 2], usize)], glyph: &str| {
        for (place, category) in points {
            let (x, y) = scale.cell(*place);
            buffer.set_string(x, y, glyph, style(*category));
        }
    };
    draw_all(buffer, &palpation.map, "·");
    draw_all(buffer, &palpation.placed, "●");
    for category in 0..palpation.classes.len() {
        let own = palpation.map.iter().filter(|(_, own)| *own == category);
        // Right of its rightmost touch, left of it where the map ends.
        let Some((place, _)) = own.max_by(|a, b| a.0[0].total_cmp(&b.0[0])) else {
            continue;
        };
        let (x, y) = scale.cell(*place);
        let name = palpation.name(category);
        let width = name.chars().count() as u16;
        let beside = if x + 1 + width < map.right() {
            x + 2
        } else {
            x.saturating_sub(width + 1).max(map.x)
        };
        let room = usize::from(map.right().saturating_sub(beside));
        buffer.set_stringn(beside, y, name, room, style(category));
    }
    if let Some(touch) = newest {
        let (x, y) = scale.cell(place(touch));
        let own = Style::new()
            .fg(palette.rgb(0, 0, 0))
            .bg(colour(touch.category, palette))
            .add_modifier(Modifier::BOLD);
        buffer.set_string(x, y, "◆", own);
    }
    draw_lines(buffer, lines, palpation, palette);
}

impl Palpation {
    fn name(&self, category: usize) -> String {
        let class = self.classes.get(category).cloned().flatten();
        class.unwrap_or_else(|| category.to_string())
    }
}

fn draw_lines(buffer: &mut Buffer, lines: Rect, palpation: &Palpation, palette: Palette) {
    let dim = Style::new().fg(palette.rgb(138, 138, 138));
    let bold = Style::new().add_modifier(Modifier::BOLD);
    let newest = match &palpation.newest {
        None => vec![Span::styled(" no touch yet", dim)],
        Some(touch) => {
            let mut spans = vec![
                Span::styled(" ◆ ", Style::new().fg(colour(touch.category, palette))),
                Span::raw(touch.mark.clone()),
                Span::styled(" is like ", dim),
            ];
            if touch.unknown {
                spans.push(Span::styled("none", bold));
            } else {
                spans.push(Span::styled(palpation.name(touch.category), bold));
                spans.push(Span::styled(format!(" {:.2}", touch.confidence), dim));
            }
            spans
        }
    };
    let count = vec![
        Span::styled(format!(" {}", palpation.right), bold),
        Span::styled(" of ", dim),
        Span::styled(palpation.touches.to_string(), bold),
        Span::styled(" in their class's", dim),
    ];
    for (row, line) in (lines.top()..lines.bottom()).zip([newest, count]) {
        let place = Rect {
            y: row,
            height: 1,
            ..lines
        };
        Line::from(line).render(place, buffer);
    }
}

fn colour(category: usize, palette: Palette) -> Color {
    let [r, g, b] = COLOURS[category % COLOURS.len()];
    palette.rgb(r, g, b)
}

/// Places on the map to cells of the terminal: the first component to the right, the second up.
struct Scale {
    least: [f64; 2],
    span: [f64; 2],
    area: Rect,
}

impl Scale {
    /// That shows all of these; `None` where there is no room or nothing to show.
    fn of(places: impl Iterator<Item = [f64; 2]>, area: Rect) -> Option<Self> {
        let (mut least, mut most) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        for place in places {
            for axis in 0..2 {
                least[axis] = least[axis].min(place[axis]);
                most[axis] = most[axis].max(place[axis]);
            }
        }
        let span = [0, 1].map(|axis| (most[axis] - least[axis]).max(f64::MIN_POSITIVE));
        (least[0].is_finite()
            && span[0].is_finite()
            && span[1].is_finite()
            && area.width > 2
            && area.height > 0)
            .then_some(Self { least, span, area })
    }

    fn cell(&self, place: [f64; 2]) -> (u16, u16) {
        let share = |axis: usize| ((place[axis] - self.least[axis]) / self.span[axis]).clamp(0.0, 1.0);
        // A column at each side stays free.
        let (columns, rows) = (self.area.width - 3, self.area.height - 1);
        (
            self.area.x + 1 + (share(0) * f64::from(columns)).round() as u16,
            self.area.y + rows - (share(1) * f64::from(rows)).round() as u16,
        )
    }
}

#[cfg(test)]
impl Palpation {
    /// A map of two categories and a touch on it, for tests of the picture.
    pub(super) fn sample() -> Self {
        let mut palpation = Self {
            map: vec![([0.0, 0.0], 0), ([1.0, 1.0], 0), ([100.0, 50.0], 1)],
            classes: vec![Some("NA".into()), Some("BS".into())],
            ..Self::default()
        };
        palpation.touch(Categorised::sample([99.0, 50.0], 1, Some("BS"), "touch 3 BS"));
        palpation
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn touches_are_counted_by_what_they_are_like() {
        let mut palpation = Palpation::sample();
        palpation.touch(Categorised::sample([0.0, 0.0], 0, Some("NA"), "touch 4 SS"));
        let mut strange = Categorised::sample([0.0, 9.0], 0, Some("NA"), "touch 5 NA");
        strange.unknown = true;
        palpation.touch(strange);
        assert_eq!(
            palpation.summary(),
            "touches    3, 1 in the category of their class, 1 unknown\n"
        );
    }

    #[test]
    fn the_first_component_goes_right_and_the_second_up() {
        let area = Rect::new(10, 5, 21, 9);
        let places = [[-5.0, -1.0], [5.0, 1.0]];
        let scale = Scale::of(places.into_iter(), area).unwrap();
        assert_eq!(
            (scale.cell(places[0]), scale.cell(places[1])),
            ((11, 13), (29, 5))
        );
        assert_eq!(scale.cell([0.0, 0.0]), (20, 9));
        assert!(Scale::of(std::iter::empty(), area).is_none());
        // All in one place.
        assert!(Scale::of([[1.0, 1.0]].into_iter(), area).is_some());
    }
}
