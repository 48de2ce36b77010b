//! The picture: the forearm with the estimate on it, what the third finger feels, and the numbers.

use super::{Outcome, Playing};
use ratatui::buffer::Buffer;
use ratatui::layout::{Constraint, Layout as Split, Rect};
use ratatui::style::{Color, Modifier, Style};
use ratatui::text::{Line, Span};
use ratatui::widgets::{Block, Paragraph, Widget, Wrap};
use taxel_forearm::{TACTILE_COLUMNS, TACTILE_ROWS};
use taxel_view::Palette;

/// The touch panel: two rows of tactels in a line, and its frame.
const TOUCH: [u16; 2] = [TACTILE_COLUMNS as u16 + 2, TACTILE_ROWS as u16 / 2 + 2];
/// The least panels of numbers, across, and of the arm, down.
const LEAST_NUMBERS: u16 = 26;
const LEAST_ARM: u16 = 8;
/// Full scale of a tactel, counts, and up to where it is noise, which is not drawn: it would go over the line again and
/// again.
const FULL_COUNTS: f64 = 255.0;
const NOISE_COUNTS: u16 = 4;
/// The picture goes a little beyond wrist and elbow, percent.
const BEYOND: f64 = 6.0;
/// Wrist by elbow, and elbow by the height of the picture.
const WRIST: f64 = 0.63;
const ELBOW: f64 = 0.74;

/// Draws everything into the whole terminal.
pub(super) fn draw(buffer: &mut Buffer, area: Rect, playing: &Playing, palette: Palette) {
    let needed = [TOUCH[0] + LEAST_NUMBERS, TOUCH[1] + LEAST_ARM];
    if area.width < needed[0] || area.height < needed[1] {
        let text = format!(
            "The terminal has {}x{} characters; the forearm needs {}x{}. Make it larger, or use --headless. q quits.",
            area.width, area.height, needed[0], needed[1],
        );
        Paragraph::new(text)
            .wrap(Wrap { trim: true })
            .render(area, buffer);
        return;
    }
    let [arm, below] =
        Split::vertical([Constraint::Min(LEAST_ARM), Constraint::Length(TOUCH[1])]).areas(area);
    let [touch, numbers] =
        Split::horizontal([Constraint::Length(TOUCH[0]), Constraint::Min(LEAST_NUMBERS)]).areas(below);
    let title = " where does it hold? a simulated forearm ".into();
    let inner = framed(buffer, arm, title, palette);
    draw_arm(buffer, inner, playing, palette);
    let title = " touch: across the arm, 28 x 50 ".into();
    let inner = framed(buffer, touch, title, palette);
    draw_touch(buffer, inner, playing, palette);
    let title = format!(" squeeze {} ", playing.number + 1);
    let inner = framed(buffer, numbers, title, palette);
    draw_numbers(buffer, inner, playing, palette);
}

fn framed(buffer: &mut Buffer, area: Rect, title: String, palette: Palette) -> Rect {
    let block = Block::bordered()
        .border_style(Style::new().fg(palette.rgb(110, 110, 120)))
        .title(Span::styled(title, Modifier::BOLD));
    let inner = block.inner(area);
    block.render(area, buffer);
    inner
}

/// What is at a point of the picture of the arm.
#[derive(Debug, Clone, Copy, PartialEq, PartialOrd)]
enum Part {
    Nothing,
    Arm,
    Interval,
    Finger,
    Estimate,
}

impl Part {
    fn colour(self, palette: Palette) -> Option<Color> {
        match self {
            Part::Nothing => None,
            Part::Arm => Some(palette.rgb(135, 95, 75)),
            Part::Interval => Some(palette.rgb(95, 135, 215)),
            Part::Finger => Some(palette.rgb(138, 138, 138)),
            Part::Estimate => Some(palette.rgb(255, 255, 255)),
        }
    }

    /// Without colours: how dark.
    fn shade(self) -> &'static str {
        match self {
            Part::Nothing => " ",
            Part::Arm => "░",
            Part::Interval => "▒",
            Part::Finger => "▓",
            Part::Estimate => "█",
        }
    }
}

/// Percent of the forearm to columns.
struct Axis {
    columns: u16,
}

impl Axis {
    fn percent(&self, column: u16) -> f64 {
        let share = f64::from(column) / f64::from(self.columns - 1);
        (100.0 + 2.0 * BEYOND) * share - BEYOND
    }

    fn column(&self, percent: f64) -> u16 {
        let share = (percent + BEYOND) / (100.0 + 2.0 * BEYOND);
        (share.clamp(0.0, 1.0) * f64::from(self.columns - 1)).round() as u16
    }
}

fn draw_arm(buffer: &mut Buffer, area: Rect, playing: &Playing, palette: Palette) {
    let [arm, scale] = Split::vertical([Constraint::Min(1), Constraint::Length(1)]).areas(area);
    let axis = Axis { columns: arm.width };
    let held = axis.column(playing.trial.location_percent);
    let estimate = playing.estimate;
    let part = |column: u16, half_row: u16| {
        let percent = axis.percent(column);
        let height = 2.0 * f64::from(arm.height);
        // From the arm's axis, in its half height there.
        let thick = 0.5 * height * ELBOW * (WRIST + (1.0 - WRIST) * (percent / 100.0).clamp(0.0, 1.0));
        let away = (f64::from(half_row) + 0.5 - 0.5 * height).abs() / thick;
        // Fingers stand beside the arm and press into it as they close.
        let reach = 1.25 - 0.4 * closed(playing);
        match estimate {
            _ if column.abs_diff(held) <= 1 && away >= reach => Part::Finger,
            _ if away > 1.0 => Part::Nothing,
            Some(estimate) if column == axis.column(estimate.percent) => Part::Estimate,
            Some(estimate) if (percent - estimate.percent).abs() <= estimate.half_width_90 => Part::Interval,
            _ => Part::Arm,
        }
    };
    for row in 0..arm.height {
        for column in 0..arm.width {
            let (top, bottom) = (part(column, 2 * row), part(column, 2 * row + 1));
            let cell = &mut buffer[(arm.x + column, arm.y + row)];
            if palette == Palette::Shades {
                let part = if top > bottom { top } else { bottom };
                cell.set_symbol(part.shade());
                continue;
            }
            match (top.colour(palette), bottom.colour(palette)) {
                (None, None) => {}
                (Some(top), Some(bottom)) => {
                    cell.set_symbol("▀").set_fg(top).set_bg(bottom);
                }
                (Some(top), None) => {
                    cell.set_symbol("▀").set_fg(top);
                }
                (None, Some(bottom)) => {
                    cell.set_symbol("▄").set_fg(bottom);
                }
            }
        }
    }
    let dim = Style::new().fg(palette.rgb(138, 138, 138));
    let (wrist, elbow) = ("0 % wrist", "elbow 100 %");
    let elbow_at = (axis.column(100.0) + 1).saturating_sub(elbow.len() as u16);
    buffer.set_string(scale.x + axis.column(0.0), scale.y, wrist, dim);
    buffer.set_string(scale.x + elbow_at, scale.y, elbow, dim);
    if let Some(estimate) = estimate {
        let text = format!("▲ {:.0} %", estimate.percent);
        let width = text.chars().count() as u16;
        let at = axis.column(estimate.percent).min(scale.width - width);
        buffer.set_string(scale.x + at, scale.y, text, Modifier::BOLD);
    }
}

/// How far the fingers are closed: 0 as the squeeze begins, 1 at its peak.
fn closed(playing: &Playing) -> f64 {
    let whole = &playing.trial.squeeze.theta_a_deg[0];
    let now = playing.so_far.theta_a_deg[0].last().or(whole.first());
    let most = whole.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let (Some(now), Some(first)) = (now, whole.first()) else {
        return 0.0;
    };
    ((now - first) / (most - first).max(f64::MIN_POSITIVE)).clamp(0.0, 1.0)
}

fn draw_touch(buffer: &mut Buffer, area: Rect, playing: &Playing, palette: Palette) {
    let sample = playing.so_far.len().checked_sub(1);
    let Some(image) = sample.and_then(|sample| playing.so_far.tactile_image(sample)) else {
        return;
    };
    let share = |row: usize, column: usize| {
        let counts = image[row * TACTILE_COLUMNS + column];
        let is_noise = counts <= NOISE_COUNTS;
        if is_noise {
            0.0
        } else {
            f64::from(counts) / FULL_COUNTS
        }
    };
    for row in 0..TACTILE_ROWS / 2 {
        for column in 0..TACTILE_COLUMNS {
            let (top, bottom) = (share(2 * row, column), share(2 * row + 1, column));
            let cell = &mut buffer[(area.x + column as u16, area.y + row as u16)];
            if palette == Palette::Shades {
                cell.set_symbol(Palette::shade(top.max(bottom)));
            } else {
                let (top, bottom) = (palette.force(top, 30), palette.force(bottom, 30));
                cell.set_symbol("▀").set_fg(top).set_bg(bottom);
            }
        }
    }
}

fn draw_numbers(buffer: &mut Buffer, area: Rect, playing: &Playing, palette: Palette) {
    let dim = Style::new().fg(palette.rgb(138, 138, 138));
    let bold = Style::new().add_modifier(Modifier::BOLD);
    let squeeze = &playing.so_far;
    let newest = |column: &[f64]| column.last().copied().unwrap_or(f64::NAN);
    let pair = |columns: &[Vec<f64>; 2]| match squeeze.is_empty() {
        true => String::new(),
        false => format!("{:5.1} {:5.1}", newest(&columns[0]), newest(&columns[1])),
    };
    let pwm = squeeze.pwm.last().copied().unwrap_or_default();
    let bars = "█".repeat((pwm / 50.0).round().clamp(0.0, 9.0) as usize);
    let held = playing.trial.location_percent;
    let place = if playing.is_new() { "new" } else { "trained" };
    let estimate = match (&playing.estimate, &playing.trouble) {
        (Some(e), _) => format!("{:5.1} % ±{:.1}", e.percent, e.half_width_90),
        (None, Some(_)) => "too early".into(),
        (None, None) => "-".into(),
    };
    let source = playing.estimate.map(|e| e.source.to_string()).unwrap_or_default();
    let line = |name: &'static str, value: String, style: Style| {
        Line::from(vec![Span::styled(name, dim), Span::styled(value, style)])
    };
    let mut lines = vec![
        line(" PWM      ", format!("{pwm:3.0} {bars}"), Style::new()),
        line(" motors   ", pair(&squeeze.theta_a_deg) + " °", Style::new()),
        line(" phalanges", pair(&squeeze.theta_p_deg) + " °", Style::new()),
        line(" estimate ", estimate, bold),
        line("  from     ", source, Style::new()),
        line(" holds at ", format!("{held:5.1} % {place}"), Style::new()),
        Line::default(),
        Line::styled(" held at  estimate", dim),
    ];
    // The newest that there is room for, above the two lines at the end.
    let room = usize::from(area.height).saturating_sub(lines.len() + 2);
    let first = playing.outcomes.len().saturating_sub(room);
    lines.extend(
        playing.outcomes[first..]
            .iter()
            .map(|outcome| told(outcome, palette)),
    );
    lines.resize(usize::from(area.height).saturating_sub(2), Line::default());
    let within = playing
        .outcomes
        .iter()
        .filter(|outcome| outcome.is_within())
        .count();
    let all = playing.outcomes.len();
    lines.push(Line::from(format!(" {within} of {all} in the interval")));
    lines.push(Line::styled(" synthetic; q quits", dim));
    for (row, line) in (area.top()..area.bottom()).zip(lines) {
        let place = Rect {
            y: row,
            height: 1,
            ..area
        };
        line.render(place, buffer);
    }
}

fn told(outcome: &Outcome, palette: Palette) -> Line<'static> {
    let colour = match outcome.is_within() {
        true => palette.rgb(95, 175, 95),
        false => palette.rgb(215, 135, 95),
    };
    let said = match outcome.estimate {
        Some(e) => format!("{:5.1} ±{:.1}", e.percent, e.half_width_90),
        None => "none".into(),
    };
    let sign = if outcome.is_within() { " ✓" } else { " ✗" };
    Line::from(vec![
        Span::raw(format!(" {:5.1} %  ", outcome.held_at)),
        Span::styled(said + sign, Style::new().fg(colour)),
    ])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shown(playing: &Playing, [width, height]: [u16; 2], palette: Palette) -> String {
        let area = Rect::new(0, 0, width, height);
        let mut buffer = Buffer::empty(area);
        draw(&mut buffer, area, playing, palette);
        let row = |y: u16| (0..width).map(|x| buffer[(x, y)].symbol()).collect::<String>();
        (0..height).map(row).collect::<Vec<_>>().join("\n")
    }

    #[test]
    fn the_picture_fits_and_has_everything_in_it_once() {
        let mut playing = Playing::start().unwrap();
        playing.advance(18_000.0).unwrap();
        for size in [[80, 24], [120, 40], [78, 24]] {
            for palette in [Palette::True, Palette::Indexed, Palette::Shades] {
                let text = shown(&playing, size, palette);
                for once in [
                    "0 % wrist",
                    "elbow 100 %",
                    "▲",
                    "from ",
                    "holds at",
                    "held at",
                    "synthetic; q quits",
                    "squeeze 2",
                ] {
                    assert_eq!(text.matches(once).count(), 1, "{once} at {size:?}:\n{text}");
                }
            }
        }
        assert!(shown(&playing, [80, 23], Palette::True).contains("needs 78x24"));
    }

    #[test]
    fn the_estimate_is_above_its_number() {
        let mut playing = Playing::start().unwrap();
        playing.advance(8000.0).unwrap();
        let text = shown(&playing, [80, 24], Palette::Shades);
        let rows: Vec<Vec<char>> = text.lines().map(|line| line.chars().collect()).collect();
        let column = rows[6].iter().position(|c| *c == '▲').unwrap();
        assert_eq!(rows[3][column], '█', "{text}");
    }
}
