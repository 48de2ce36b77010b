//! Force as colour.

use ratatui::style::Color;

/// From little force to the greatest: violet, red, orange, pale yellow; brighter is always stronger.
const STOPS: [[f64; 3]; 5] = [
    [84.0, 26.0, 130.0],
    [160.0, 40.0, 100.0],
    [226.0, 90.0, 50.0],
    [250.0, 165.0, 30.0],
    [252.0, 250.0, 180.0],
];

/// Steps of colour from no force to the greatest.
const FORCES: f64 = 25.0;

/// Colours as the terminal can show them.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Palette {
    /// 24 bit.
    True,
    /// The 256 that nearly every terminal has.
    Indexed,
    /// None: shades of the terminal's own.
    Shades,
}

impl Palette {
    /// What the environment says of the terminal.
    ///
    /// `NO_COLOR` that is not empty gives shades (<https://no-color.org>).
    pub fn of_terminal() -> Self {
        if std::env::var_os("NO_COLOR").is_some_and(|set| !set.is_empty()) {
            return Self::Shades;
        }
        let colours = std::env::var("COLORTERM").unwrap_or_default();
        match colours.as_str() {
            "truecolor" | "24bit" => Self::True,
            _ => Self::Indexed,
        }
    }

    /// The colour of a force, 0 to 1 of the scale, on a taxel that is `idle` grey without any. The
    /// scale is a square root, so that light touches show.
    pub fn force(self, share: f64, idle: u8) -> Color {
        // In steps: a colour that flickers by a shade is sent over the line for nothing.
        let place = (share.clamp(0.0, 1.0).sqrt() * FORCES).round() / FORCES * STOPS.len() as f64;
        let below = (place as usize).min(STOPS.len() - 1);
        let from = if below == 0 {
            [f64::from(idle); 3]
        } else {
            STOPS[below - 1]
        };
        let part = place - below as f64;
        let mix = |axis: usize| from[axis] + part * (STOPS[below][axis] - from[axis]);
        self.rgb(mix(0) as u8, mix(1) as u8, mix(2) as u8)
    }

    /// A character as dark as a force, 0 to 1 of the scale, is great; a dot where there is none.
    pub fn shade(share: f64) -> &'static str {
        const SHADES: [&str; 5] = ["·", "░", "▒", "▓", "█"];
        SHADES[(share.clamp(0.0, 1.0).sqrt() * 4.0).round() as usize]
    }

    /// Black or white, whichever can be read on the colour of a force.
    pub fn ink(self, share: f64) -> Color {
        if share > 0.3 {
            self.rgb(0, 0, 0)
        } else {
            self.rgb(255, 255, 255)
        }
    }

    /// The nearest colour the terminal has.
    pub fn rgb(self, r: u8, g: u8, b: u8) -> Color {
        match self {
            Self::True => Color::Rgb(r, g, b),
            Self::Indexed => Color::Indexed(nearest_indexed(r, g, b)),
            Self::Shades => Color::Reset,
        }
    }
}

/// The nearest of the 6x6x6 colour cube (16 to 231) and the grey ramp (232 to 255).
fn nearest_indexed(r: u8, g: u8, b: u8) -> u8 {
    const STEPS: [u8; 6] = [0, 95, 135, 175, 215, 255];
    let step = |v: u8| (0..6).min_by_key(|i| STEPS[*i].abs_diff(v)).unwrap_or(0);
    let distance = |x: [u8; 3]| -> u32 {
        x.iter()
            .zip([r, g, b])
            .map(|(a, b)| u32::from(a.abs_diff(b)).pow(2))
            .sum()
    };
    let (cr, cg, cb) = (step(r), step(g), step(b));
    let cube = [STEPS[cr], STEPS[cg], STEPS[cb]];
    let mean = (u16::from(r) + u16::from(g) + u16::from(b)) / 3;
    let grey = (mean.saturating_sub(3) / 10).min(23) as u8;
    let grey_value = 8 + 10 * grey;
    match distance([grey_value; 3]) < distance(cube) {
        true => 232 + grey,
        false => 16 + (36 * cr + 6 * cg + cb) as u8,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn more_force_is_never_darker() {
        let brightness = |share: f64| match Palette::True.force(share, 38) {
            Color::Rgb(r, g, b) => 0.299 * f64::from(r) + 0.587 * f64::from(g) + 0.114 * f64::from(b),
            other => panic!("{other:?}"),
        };
        for i in 0..100 {
            assert!(
                brightness(f64::from(i) / 100.0) <= brightness(f64::from(i + 1) / 100.0) + 1.0,
                "{i}"
            );
        }
    }

    #[test]
    fn colours_of_the_256_are_found_exactly() {
        for (rgb, index) in [
            ([0, 0, 0], 16),
            ([255, 0, 0], 196),
            ([255; 3], 231),
            ([8; 3], 232),
            ([128; 3], 244),
        ] {
            assert_eq!(nearest_indexed(rgb[0], rgb[1], rgb[2]), index, "{rgb:?}");
        }
    }
}
