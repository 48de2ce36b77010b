//! How samples spread: quartiles and ellipses.

/// The five numbers of a box plot.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Quartiles {
    /// The smallest sample within one and a half times the quartiles' distance below `first`.
    pub low: f64,
    /// A quarter of the samples are below it.
    pub first: f64,
    /// Half of the samples are below it.
    pub median: f64,
    /// Three quarters of the samples are below it.
    pub third: f64,
    /// The largest sample within one and a half times the quartiles' distance above `third`.
    pub high: f64,
}

impl Quartiles {
    /// Of the finite samples, between which quantiles are interpolated linearly; none where there is none.
    pub fn of(samples: &[f64]) -> Option<Self> {
        let mut sorted: Vec<f64> = samples.iter().copied().filter(|v| v.is_finite()).collect();
        sorted.sort_by(f64::total_cmp);
        let last = sorted.len().checked_sub(1)?;
        let quantile = |share: f64| {
            let place = share * last as f64;
            let below = place.floor() as usize;
            let above = (below + 1).min(last);
            sorted[below] + (place - below as f64) * (sorted[above] - sorted[below])
        };
        let [first, median, third] = [0.25, 0.5, 0.75].map(quantile);
        let reach = 1.5 * (third - first);
        let within = |v: &&f64| (first - reach..=third + reach).contains(*v);
        Some(Self {
            low: *sorted.iter().find(within)?,
            first,
            median,
            third,
            high: *sorted.iter().rev().find(within)?,
        })
    }
}

/// The outline of the two-sigma ellipse of points (x, y), 48 corners: around their mean, along the axes of their sample
/// covariance. Empty where fewer than three points are finite.
pub fn ellipse(points: &[(f64, f64)]) -> Vec<(f64, f64)> {
    let finite: Vec<_> = points
        .iter()
        .filter(|(x, y)| x.is_finite() && y.is_finite())
        .collect();
    if finite.len() < 3 {
        return Vec::new();
    }
    let count = finite.len() as f64;
    let (sum_x, sum_y) = finite.iter().fold((0.0, 0.0), |(a, b), (x, y)| (a + x, b + y));
    let (mean_x, mean_y) = (sum_x / count, sum_y / count);
    let (mut xx, mut xy, mut yy) = (0.0, 0.0, 0.0);
    for (x, y) in finite {
        let (x, y) = (x - mean_x, y - mean_y);
        xx += x * x / (count - 1.0);
        xy += x * y / (count - 1.0);
        yy += y * y / (count - 1.0);
    }
    let (middle, half) = ((xx + yy) / 2.0, ((xx - yy) / 2.0).hypot(xy));
    let [long, short] = [middle + half, middle - half].map(|variance: f64| 2.0 * variance.max(0.0).sqrt());
    let (sin, cos) = (0.5 * (2.0 * xy).atan2(xx - yy)).sin_cos();
    let corner = |n: u32| {
        let (b, a) = (f64::from(n) / 48.0 * std::f64::consts::TAU).sin_cos();
        let (a, b) = (a * long, b * short);
        (mean_x + a * cos - b * sin, mean_y + a * sin + b * cos)
    };
    (0..48).map(corner).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quartiles_are_those_of_the_samples_and_whiskers_leave_out_what_is_far() {
        let quartiles = Quartiles::of(&[4.0, 1.0, 3.0, f64::NAN, 2.0, 5.0, 100.0]).unwrap();
        let Quartiles {
            low,
            first,
            median,
            third,
            high,
        } = quartiles;
        assert_eq!([low, first, median, third, high], [1.0, 2.25, 3.5, 4.75, 5.0]);
        assert_eq!(
            Quartiles::of(&[7.0]).map(|q| (q.low, q.median, q.high)),
            Some((7.0, 7.0, 7.0))
        );
        assert_eq!(Quartiles::of(&[f64::NAN]), None);
    }

    #[test]
    fn an_ellipse_reaches_two_sigma_along_its_axes() {
        // Sums of squares 16 along (1, 1) / sqrt 2 and 4 across, over n - 1 = 3.
        let points = [(12.0, 12.0), (8.0, 8.0), (11.0, 9.0), (9.0, 11.0)];
        let outline = ellipse(&points);
        let reach = |x: f64, y: f64| {
            let along = |p: &(f64, f64)| ((p.0 - 10.0) * x + (p.1 - 10.0) * y) / 2f64.sqrt();
            outline.iter().map(along).fold(0.0, f64::max)
        };
        assert!((reach(1.0, 1.0) - 2.0 * (16.0f64 / 3.0).sqrt()).abs() < 1e-9);
        assert!((reach(1.0, -1.0) - 2.0 * (4.0f64 / 3.0).sqrt()).abs() < 1e-9);
        assert!(ellipse(&points[..2]).is_empty());
        assert_eq!(ellipse(&[(1.0, 1.0); 3]).len(), 48);
    }
}
