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
/// Cells of a picture without a colour, beneath their hatch: like no grey that a cell may have.
pub(crate) const EMPTY: Rgb = [0xE2, 0xD2, 0xB0];
/// Lines behind the data.
pub(crate) const GRID: Rgb = [0xDD, 0xE2, 0xE7];

/// Each colour that changes, and what it is in the dark.
const DARK: [(Rgb, Rgb); 13] = [
    (PAPER, [0x0D, 0x11, 0x17]),
    (INK, [0xE6, 0xED, 0xF3]),
    (PALE, [0x9E, 0xA7, 0xB1]),
    (EMPTY, [0x4D, 0x43, 0x30]),
    (GRID, [0x2D, 0x33, 0x3B]),
    (SERIES[0], [0x38, 0x93, 0xFF]),
    (SERIES[1], [0xD2, 0x6B, 0x0D]),
    (SERIES[2], [0x44, 0xD1, 0x94]),
    (SERIES[3], [0x9C, 0x85, 0x94]),
    (SERIES[4], [0xF0, 0xFF, 0x3B]),
    (SERIES[5], [0x69, 0x4D, 0xBA]),
    (SERIES[6], [0xD3, 0xBA, 0xEF]),
    (SERIES[7], [0xA4, 0x3D, 0x44]),
];

/// Of the series, in their order. Any two differ in lightness where they do not differ from blue to yellow: those who do
/// not see red and green apart see that.
const SERIES: [Rgb; 8] = [
    [0x1C, 0x52, 0xBA],
    [0xA2, 0x22, 0x1F],
    [0x01, 0xA7, 0x79],
    [0x9C, 0x8F, 0xA5],
    [0xC8, 0x6D, 0x0F],
    [0x58, 0x00, 0x5E],
    [0x1F, 0x96, 0xFF],
    [0x3E, 0x6C, 0x66],
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

    /// Linear light of each channel, sRGB.
    fn linear(colour: Rgb) -> [f64; 3] {
        colour.map(|c| {
            let c = f64::from(c) / 255.0;
            if c <= 0.04045 {
                c / 12.92
            } else {
                ((c + 0.055) / 1.055).powf(2.4)
            }
        })
    }

    type Matrix = [[f64; 3]; 3];

    fn times(matrix: Matrix, v: [f64; 3]) -> [f64; 3] {
        matrix.map(|row| row[0] * v[0] + row[1] * v[1] + row[2] * v[2])
    }

    /// WCAG 2.2, "contrast ratio".
    fn contrast(a: Rgb, b: Rgb) -> f64 {
        let luminance = |colour: Rgb| times([[0.2126, 0.7152, 0.0722]; 3], linear(colour))[0];
        let (a, b) = (luminance(a) + 0.05, luminance(b) + 0.05);
        a.max(b) / a.min(b)
    }

    /// What linear light becomes for three kinds of eyes: all, without red, without green (Machado, Oliveira and
    /// Fernandes 2009, severity 1).
    const EYES: [Matrix; 3] = [
        [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
        [
            [0.152286, 1.052583, -0.204868],
            [0.114503, 0.786281, 0.099216],
            [-0.003882, -0.048116, 1.051998],
        ],
        [
            [0.367322, 0.860646, -0.227968],
            [0.280085, 0.672501, 0.047413],
            [-0.011820, 0.042940, 0.968881],
        ],
    ];

    /// CIE L*a*b* of a colour as these eyes see it, white of D65.
    fn seen(colour: Rgb, eyes: Matrix) -> [f64; 3] {
        const XYZ: Matrix = [
            [0.4124564, 0.3575761, 0.1804375],
            [0.2126729, 0.7151522, 0.0721750],
            [0.0193339, 0.1191920, 0.9503041],
        ];
        let [x, y, z] = times(XYZ, times(eyes, linear(colour)).map(|c| c.clamp(0.0, 1.0)));
        let root = |t: f64| {
            if t > 0.008856 {
                t.cbrt()
            } else {
                7.787 * t + 16.0 / 116.0
            }
        };
        let [x, y, z] = [root(x / 0.95047), root(y), root(z / 1.08883)];
        [116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)]
    }

    #[test]
    fn any_two_series_are_told_apart_by_whoever_looks() {
        let distance = |a: Rgb, b: Rgb, eyes: Matrix| {
            let (a, b) = (seen(a, eyes), seen(b, eyes));
            a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt()
        };
        // The text's colour is that of a series without a name. What is just noticed is a distance of about 2.3.
        let of = |side: fn(&(Rgb, Rgb)) -> Rgb| {
            let series = DARK
                .iter()
                .filter(|(light, _)| *light == INK || SERIES.contains(light));
            series.map(side).collect::<Vec<_>>()
        };
        for colours in [of(|pair| pair.0), of(|pair| pair.1)] {
            assert_eq!(colours.len(), 9);
            for (n, a) in colours.iter().enumerate() {
                for (b, eyes) in colours[..n].iter().flat_map(|b| EYES.map(|eyes| (b, eyes))) {
                    let distance = distance(*a, *b, eyes);
                    assert!(distance > 19.0, "{} {}: {distance:.1}", hex(*a), hex(*b));
                }
            }
        }
    }

    #[test]
    fn text_and_series_are_legible_in_light_and_dark() {
        let (paper_light, paper_dark) = DARK[0];
        for (light, dark) in &DARK[1..] {
            let least = match *light {
                INK | PALE => 4.5,
                // Graphical objects need 3; the grid is meant to be weak, and empty cells are hatched.
                GRID | EMPTY => 1.1,
                _ => 2.9,
            };
            assert!(contrast(*light, paper_light) >= least, "{}", hex(*light));
            assert!(contrast(*dark, paper_dark) >= least, "{}", hex(*dark));
        }
    }

    #[test]
    fn an_empty_cell_is_like_no_grey_and_its_hatch_is_legible() {
        let dark = |colour: Rgb| DARK.iter().find(|(light, _)| *light == colour).unwrap().1;
        for (empty, hatch) in [(EMPTY, PALE), (dark(EMPTY), dark(PALE))] {
            assert!(empty.iter().max().unwrap() - empty.iter().min().unwrap() >= 24);
            assert!(contrast(hatch, empty) >= 3.0);
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
