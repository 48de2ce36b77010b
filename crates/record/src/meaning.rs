//! What the numbers of a file are, told by their shape and by options before they are read.

use crate::error::{RecordError, SOMETHING};
use crate::table::{Columns, ReadOptions};
use taxel_hand::MAX_TAXELS;

const SHAPES: &str = "T x H x W or T x N (magnitudes) or T x N x 3 or T x H x W x 3 (counts); a T x 3N array of \
                      counts needs --columns xyz-interleaved (x1,y1,z1,x2,..) or --columns xyz-blocks (x1,x2,..,y1,..,z1,..)";
const SHAPES_WITH_COLUMNS: &str = "T x 3N, since --columns was given: three columns, x y z, for each of N taxels; of a \
                                   .csv --joint-columns M says that the last M are joint angles, and --time-column UNIT \
                                   that the first is time";

/// What an array of numbers is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Meaning {
    /// Number of taxels, void cells included.
    pub(crate) taxels: usize,
    /// Height and width, where frames are images.
    pub(crate) image: Option<(usize, usize)>,
    /// The order of the counts in a frame; `None` for magnitudes.
    pub(crate) counts: Option<Columns>,
}

impl Meaning {
    /// Of an array of this shape, whose file says this of its columns.
    ///
    /// `T x H x W x 3` is counts, and so is `T x H x 3`, of `H` taxels, unless the options say that frames are images of
    /// `H x 3` or have void cells. `T x N` is images where the options say that frames are of N cells and some are void.
    pub(crate) fn of(
        at: &str,
        shape: &[usize],
        columns: Option<Columns>,
        options: &ReadOptions,
    ) -> Result<Self, RecordError> {
        let wrong_shape = |expected: &str| RecordError::shape(at, shape, expected);
        if shape.contains(&0) {
            return Err(wrong_shape(SOMETHING));
        }
        let of_image = |h: usize, w: usize, counts: Option<Columns>| {
            if let Some((height, width)) = options.image.filter(|image| *image != (h, w)) {
                let axes = if counts.is_some() { " x 3" } else { "" };
                let order = match shape[..2] == [height, width] {
                    true => "; time is the first axis: numpy.moveaxis(a, -1, 0)",
                    false => "",
                };
                let expected = format!(
                    "T x {height} x {width}{axes}, as the layout grid:{height}x{width} has it{order}"
                );
                return Err(wrong_shape(&expected));
            }
            let taxels = h.checked_mul(w).filter(|taxels| *taxels <= MAX_TAXELS);
            let image = |taxels| Self {
                taxels,
                image: Some((h, w)),
                counts,
            };
            taxels.map(image).ok_or_else(|| {
                let expected =
                    format!("frames of at most {MAX_TAXELS} taxels; {h} x {w} is more than an image can be");
                wrong_shape(&expected)
            })
        };
        let meaning = match (shape, columns.or(options.columns)) {
            (&[_, n], None) if options.void.is_some() && options.image.is_some_and(|(h, w)| h * w == n) => {
                Self {
                    taxels: n,
                    image: options.image,
                    counts: None,
                }
            }
            (&[_, n], None) => Self {
                taxels: n,
                image: None,
                counts: None,
            },
            (&[_, n], Some(columns)) if n % 3 == 0 => Self {
                taxels: n / 3,
                image: None,
                counts: Some(columns),
            },
            (_, Some(_)) => return Err(wrong_shape(SHAPES_WITH_COLUMNS)),
            (&[_, h, 3], None) if options.image == Some((h, 3)) || options.void.is_some() => {
                of_image(h, 3, None)?
            }
            (&[_, n, 3], None) => Self {
                taxels: n,
                image: None,
                counts: Some(Columns::XyzInterleaved),
            },
            (&[_, h, w], None) => of_image(h, w, None)?,
            (&[_, h, w, 3], None) => of_image(h, w, Some(Columns::XyzInterleaved))?,
            _ => return Err(wrong_shape(SHAPES)),
        };
        if meaning.taxels > MAX_TAXELS {
            return Err(wrong_shape(&format!("frames of at most {MAX_TAXELS} taxels")));
        }
        if meaning.counts.is_some() && options.void.is_some() {
            return Err(wrong_shape(
                "T x H x W or T x N magnitudes, since --void was given; leave --void out where they are counts: a taxel \
                 without a value is missing there",
            ));
        }
        Ok(meaning)
    }
}
