//! Colours, light and dark.

use plotters::style::RGBColor;
use plotters::style::colors::colormaps::{ColorMap, ViridisRGB};

/// Red, green, blue.
pub(crate) type Rgb = [u8; 3];

/// Behind everything.
pub(crate) const PAPER: Rgb = [0xFE, 0xFE, 0xFE];
/// Text and axes.
pub(crate) const INK: Rgb = [0x24, 0x29, 0x2E];
/// What is beside the point: units, captions.
pub(crate) const PALE: Rgb = [0x57, 0x60, 0x6B];
/// Lines behind the data.
pub(crate) const GRID: Rgb = [0xDD, 0xE2, 0xE7];

/// Each colour that changes, and what it is in the dark.
const DARK: [(Rgb, Rgb); 12] = [
    (PAPER, [0x0D, 0x11, 0x17]),
    (INK, [0xE6, 0xED, 0xF3]),
    (PALE, [0x9E, 0xA7, 0xB1]),
    (GRID, [0x2D, 0x33, 0x3B]),
    (SERIES[0], [0x4A, 0xA3, 0xDF]),
    (SERIES[1], [0xF0, 0x7B, 0x2E]),
    (SERIES[2], [0x2F, 0xC1, 0x9A]),
    (SERIES[3], [0xDE, 0x94, 0xBD]),
    (SERIES[4], [0xF0, 0xB4, 0x3C]),
    (SERIES[5], [0xB3, 0x9D, 0xEB]),
    (SERIES[6], [0x8A, 0xD0, 0xF5]),
    (SERIES[7], [0xB5, 0xB5, 0xB5]),
];

/// Of the series, in their order: those of Okabe and Ito that can be told apart on white, with a violet and a grey.
const SERIES: [Rgb; 8] = [
    [0x00, 0x72, 0xB2],
    [0xD5, 0x5E, 0x01],
    [0x00, 0x8F, 0x68],
    [0xC2, 0x66, 0x97],
    [0xC9, 0x86, 0x00],
    [0x6F, 0x54, 0xB3],
    [0x2F, 0x9B, 0xD8],
    [0x77, 0x77, 0x77],
];

/// The colour of the series of that number; the text's for one without a name.
pub(crate) fn of_series(number: Option<usize>) -> Rgb {
    number.map_or(INK, |number| SERIES[number % SERIES.len()])
}

/// A picture's colour, which never changes in the dark: moved by one where it is one of those that do.
pub(crate) fn of_picture(colour: Rgb) -> Rgb {
    let [red, green, blue] = colour;
    let changes = DARK.iter().any(|(light, _)| *light == colour);
    [red, green, if changes { blue ^ 1 } else { blue }]
}

/// From dark blue at 0 to yellow at 1.
pub(crate) fn of_heat(share: f64) -> Rgb {
    let RGBColor(red, green, blue) = ViridisRGB.get_color_normalized(share as f32, 0.0, 1.0);
    [red, green, blue]
}

/// As it is written in SVG by plotters.
pub(crate) fn hex([red, green, blue]: Rgb) -> String {
    format!("#{red:02X}{green:02X}{blue:02X}")
}

/// The style sheet: cells that meet without seams, and what makes a light figure dark, a rule for each colour.
pub(crate) fn style_sheet() -> String {
    let rule = |(light, dark): &(Rgb, Rgb)| {
        let (light, dark) = (hex(*light), hex(*dark));
        format!("[fill=\"{light}\"]{{fill:{dark}}}[stroke=\"{light}\"]{{stroke:{dark}}}")
    };
    let rules: String = DARK.iter().map(rule).collect();
    format!("<style>rect{{shape-rendering:crispEdges}}@media(prefers-color-scheme:dark){{{rules}}}</style>\n")
}

#[cfg(test)]
mod tests {
    use super::*;

    /// WCAG 2.2, "contrast ratio".
    fn contrast(a: Rgb, b: Rgb) -> f64 {
        let luminance = |colour: Rgb| {
            let linear = colour.map(|c| {
                let c = f64::from(c) / 255.0;
                if c <= 0.04045 {
                    c / 12.92
                } else {
                    ((c + 0.055) / 1.055).powf(2.4)
                }
            });
            0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]
        };
        let (a, b) = (luminance(a) + 0.05, luminance(b) + 0.05);
        a.max(b) / a.min(b)
    }

    #[test]
    fn text_and_series_are_legible_in_light_and_dark() {
        let (paper_light, paper_dark) = DARK[0];
        for (light, dark) in &DARK[1..] {
            let least = match *light {
                INK | PALE => 4.5,
                // Graphical objects need 3; the grid is meant to be weak.
                GRID => 1.1,
                _ => 2.9,
            };
            assert!(contrast(*light, paper_light) >= least, "{}", hex(*light));
            assert!(contrast(*dark, paper_dark) >= least, "{}", hex(*dark));
        }
    }

    #[test]
    fn no_pixel_of_a_picture_changes_in_the_dark() {
        for (light, _) in DARK {
            let shown = of_picture(light);
            assert!(DARK.iter().all(|(other, _)| *other != shown));
        }
        assert_eq!(of_picture([1, 2, 3]), [1, 2, 3]);
    }
}
