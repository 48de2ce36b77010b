//! The line above the panels and those below.

use crate::colour::Palette;
use crate::figures::no_image_for;
use crate::paint::{shortened, text, text_width};
use crate::picture::{Picture, fault_in_words};
use crate::screen::Screen;
use ratatui::buffer::Buffer;
use ratatui::layout::Rect;
use ratatui::style::{Modifier, Style};
use ratatui::text::{Line, Span};
use ratatui::widgets::{Clear, Widget};
use taxel_hand::{Fault, Freshness};

/// Columns of the legend of colours.
const LEGEND: usize = 16;

/// What is seen; then what is most important to know.
pub(super) fn heading(
    buffer: &mut Buffer,
    area: Rect,
    picture: &Picture,
    heading: &super::Heading,
    palette: Palette,
) {
    let dim = Style::new().fg(palette.rgb(138, 138, 138));
    let bold = Style::new().add_modifier(Modifier::BOLD);
    let mut spans = vec![
        Span::styled(format!(" {} ", heading.name), bold),
        Span::raw(heading.detail.clone()),
    ];
    let room = room(area, heading);
    let problem = match picture.problems().unwrap_or_default() {
        [] => None,
        [problem] => Some(problem.sentence.clone()),
        problems @ [first, ..] => Some(format!("{} problems: {}", problems.len(), first.sentence)),
    };
    let urgent = if picture.gone.is_some() {
        said(picture)
    } else if let Some(ceased) = no_image_for(picture.age_s) {
        // What is wrong may say why.
        Some(
            [Some(ceased), problem]
                .into_iter()
                .flatten()
                .collect::<Vec<_>>()
                .join("; "),
        )
    } else if picture.paused {
        Some("paused: every actuator has let go; p goes on".into())
    } else if picture.calibrating {
        Some("measuring the baseline: hands off".into())
    } else {
        said(picture)
            .filter(|words| is_said_above(words, picture, room))
            .or(problem)
    };
    let (words, style) = match urgent {
        Some(words) => (words, warning(palette)),
        None => (heading.about.clone(), dim),
    };
    spans.push(Span::styled(format!("  {}", shortened(&words, room)), style));
    Line::from(spans).render(area, buffer);
}

/// Columns for a sentence behind what is seen.
fn room(area: Rect, heading: &super::Heading) -> usize {
    let used = text_width(&heading.name) + text_width(&heading.detail);
    usize::from(area.width).saturating_sub(used + 5)
}

/// Whether the line above the panels says these words of the moment: where it has room, and nothing that lasts to say.
fn is_said_above(words: &str, picture: &Picture, room: usize) -> bool {
    let lasts = picture.paused || picture.calibrating || no_image_for(picture.age_s).is_some();
    let lasts = picture.gone.is_none() && lasts;
    !lasts && text_width(words) <= room
}

/// What somebody who looks is told for the moment: why there is no daemon, or what became of a key.
fn said(picture: &Picture) -> Option<String> {
    let gone = picture.gone.as_ref();
    gone.map(|why| format!("the daemon is gone ({why}); looking for it"))
        .or_else(|| picture.note.clone())
}

/// Draws what is said for the moment over the lines below the panels where the line above does not say it: as a
/// rule it is too long for that, and why something was refused stands at its end.
pub(super) fn draw_said(
    buffer: &mut Buffer,
    area: Rect,
    picture: &Picture,
    heading: &super::Heading,
    palette: Palette,
) {
    let room = room(area, heading);
    let Some(words) = said(picture).filter(|words| !is_said_above(words, picture, room)) else {
        return;
    };
    let width = usize::from(area.width).saturating_sub(2);
    // The last line says which keys there are.
    let most = usize::from(area.height).saturating_sub(1);
    for (y, row) in (area.top()..).zip(wrapped(&words, width, most)) {
        let line = Rect { y, height: 1, ..area };
        Clear.render(line, buffer);
        text(buffer, line, &format!(" {row}"), warning(palette));
    }
}

/// A sentence in at most so many rows of so many characters, with dots where it goes on.
fn wrapped(words: &str, width: usize, most: usize) -> Vec<String> {
    let mut rows: Vec<String> = vec![String::new()];
    for word in words.split_whitespace() {
        let row = rows.last_mut().expect("one row or more");
        if row.is_empty() {
            row.push_str(word);
        } else if text_width(row) + 1 + text_width(word) <= width {
            *row += " ";
            row.push_str(word);
        } else {
            rows.push(word.into());
        }
    }
    if rows.len() > most {
        let rest = rows.split_off(most.saturating_sub(1)).join(" ");
        rows.push(rest);
    }
    rows.iter().map(|row| shortened(row, width)).collect()
}

fn warning(palette: Palette) -> Style {
    Style::new()
        .fg(palette.rgb(255, 175, 0))
        .add_modifier(Modifier::BOLD)
}

/// Counts; rates; one taxel in words; the legend and where keys are listed.
pub(super) fn draw(buffer: &mut Buffer, area: Rect, picture: &Picture, screen: &Screen, palette: Palette) {
    let dim = Style::new().fg(palette.rgb(138, 138, 138));
    let bold = Style::new().add_modifier(Modifier::BOLD);
    let value = |text: String| Span::styled(text, bold);
    let label = |text: &'static str| Span::styled(text, dim);
    let count = |n: u64| Span::styled(n.to_string(), if n > 0 { warning(palette) } else { bold });
    let mut contacts = vec![
        vec![
            label(" contact "),
            value(format!("{:3}", picture.contacts)),
            label(" taxels → "),
            value(format!("{:2}", picture.actuators.len())),
            label(" actuators"),
        ],
        vec![label("   missing "), count(picture.missing.into())],
        vec![label("   faulty "), count(picture.faulty.into())],
    ];
    if let Some(skipped) = picture.skipped {
        contacts.push(vec![label("   skipped "), count(skipped)]);
    }
    contacts.push(vec![label("   "), value(picture.method.clone())]);
    let figures = &picture.figures;
    let mut rates = vec![vec![
        label(" rate "),
        value(format!("{:5.1} Hz", figures.rate_hz)),
    ]];
    if let (Some(p50), Some(p99)) = (figures.latency_p50_ms, figures.latency_p99_ms) {
        rates.push(vec![
            label("   latency p50 "),
            value(format!("{p50:.2}")),
            label(" p99 "),
            value(format!("{p99:.2} ms")),
        ]);
    }
    let (raw, image) = (figures.raw_bits_per_s, figures.image_bits_per_s);
    let mut data = vec![
        label("   data "),
        value(format!("{:.0}", raw / 1e3)),
        label(" → "),
        value(format!("{:.1} kbit/s", image / 1e3)),
    ];
    if image > 0.0 {
        data.push(value(format!(" {:.0}:1", raw / image)));
    }
    rates.push(data);
    let last = match &screen.prompt {
        Some(text) => vec![
            vec![label(" mark: "), value(format!("{text}▏"))],
            vec![label("  Enter makes it, Esc leaves")],
        ],
        None => last_line(picture, palette, area.width.into()),
    };
    let taxel = taxel_in_words(picture, area.width);
    let taxel = taxel.into_iter().map(|part| vec![Span::raw(part)]).collect();
    for (y, line) in (area.top()..area.bottom()).zip([contacts, rates, taxel, last]) {
        Line::from(whole(line, area.width.into())).render(Rect { y, height: 1, ..area }, buffer);
    }
}

/// Those parts of a line for which there is room: half a number says another one. Of the first as much as there is.
fn whole(parts: Vec<Vec<Span<'static>>>, width: usize) -> Vec<Span<'static>> {
    let mut line = Vec::new();
    let mut used = 0;
    for part in parts {
        let needs: usize = part.iter().map(Span::width).sum();
        if line.is_empty() || used + needs <= width {
            used += needs;
            line.extend(part);
        }
    }
    line
}

/// The legend and where keys are listed; the latter first where there is no room for all.
fn last_line(picture: &Picture, palette: Palette, width: usize) -> Vec<Vec<Span<'static>>> {
    let [colours, digits, keys] = legend(picture, palette);
    let columns = |part: &[Span<'static>]| part.iter().map(Span::width).sum::<usize>();
    match width
        .saturating_sub(columns(&keys))
        .checked_sub(columns(&colours))
    {
        Some(room) if room >= columns(&digits) => vec![colours, digits, keys],
        Some(_) => vec![colours, keys],
        None => vec![keys],
    }
}

/// Of colours and of digits; then where keys are listed.
fn legend(picture: &Picture, palette: Palette) -> [Vec<Span<'static>>; 3] {
    let dim = Style::new().fg(palette.rgb(138, 138, 138));
    let bold = Style::new().add_modifier(Modifier::BOLD);
    let label = |text: &'static str| Span::styled(text, dim);
    let mut legend = vec![label(" force 0 ")];
    // The colours are a square root of the force; so are the places of the legend.
    legend.extend((0..LEGEND).map(|i| {
        let share = (i as f64 / (LEGEND - 1) as f64).powi(2);
        match palette {
            Palette::Shades => Span::raw(Palette::shade(share)),
            _ => Span::styled(" ", Style::new().bg(palette.force(share, 30))),
        }
    }));
    // Two digits: the last ones change with every image.
    let scale = picture.scale;
    let step = 10f64.powi((scale.log10().floor() as i32 - 1).max(0));
    legend.push(Span::raw(format!(" {:.0} ", (scale / step).round() * step)));
    legend.push(Span::styled(
        if picture.held {
            "held".into()
        } else {
            picture.unit.clone()
        },
        dim,
    ));
    let digits = vec![
        label("  digits: level, 1 to "),
        Span::raw(picture.levels.to_string()),
    ];
    let keys = vec![
        Span::styled("   ? ", bold),
        label("keys  "),
        Span::styled("q", bold),
        label(" quit"),
    ];
    [legend, digits, keys]
}

/// A taxel's name: its module and its number there.
pub(super) fn name(picture: &Picture, taxel: usize) -> String {
    let module = picture.hand.module_of(taxel);
    format!(
        "{} {}",
        module.name,
        taxel.saturating_sub(usize::from(module.first_taxel))
    )
}

/// Columns that the press of a taxel needs besides its counts.
const WIDE: u16 = 100;

/// What is known of the taxel that is looked at, in parts.
fn taxel_in_words(picture: &Picture, width: u16) -> Vec<String> {
    let Some(taxel) = picture.cursor else {
        return vec![
            " arrow keys: look at a taxel".into(),
            "; Enter: show it over time".into(),
        ];
    };
    let name = name(picture, taxel);
    let Some(now) = picture.taxels.get(taxel) else {
        return vec![format!(" {name}: no raw counts")];
    };
    let raw = &now.raw;
    let [x, y, z] = raw.counts;
    let faults: Vec<Fault> = raw.faults().collect();
    // What is missing has a reason of its own, or none.
    let named = faults
        .iter()
        .filter(|fault| **fault != Fault::Missing || faults.len() == 1);
    let reasons: Vec<&str> = named.map(|fault| fault_in_words(*fault)).collect();
    if raw.freshness == Freshness::Missing {
        return vec![format!(" {name}: no value ever came")];
    }
    if !reasons.is_empty() {
        let reasons = format!(" {name}: {}", reasons.join("; "));
        return with_counts(picture, reasons, format!("; counts {x} {y} {z}"), raw.age_us);
    }
    let press = now
        .press
        .filter(|_| width >= WIDE)
        .map_or(String::new(), |[x, y, z]| {
            format!(", press {x:+.0} {y:+.0} {z:+.0}")
        });
    let state = match (raw.contact, raw.repaired) {
        (_, true) => ", repaired",
        (true, _) => ", in contact",
        (false, false) => "",
    };
    let force = format!(" {name}: force {:.0}{state}", raw.force);
    with_counts(picture, force, format!("; counts {x} {y} {z}{press}"), raw.age_us)
}

/// What is told of a taxel, with its counts and their age where there are any.
fn with_counts(picture: &Picture, told: String, counts: String, age_us: u32) -> Vec<String> {
    match picture.has_counts() {
        true => vec![told, counts, format!(", {} old", age(age_us))],
        false => vec![told],
    }
}

fn age(age_us: u32) -> String {
    match age_us {
        u32::MAX => "very".into(),
        us if us < 1_000_000 => format!("{} ms", us / 1000),
        us => format!("{} s", us / 1_000_000),
    }
}
