//! The cognitive map: principal components of touches.

use crate::decomposition::exact;
use crate::error::PalpationError;
use crate::matrix::{Matrix, dots, greatest, product_above};
use crate::truncated::truncated;

/// How components are computed.
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq)]
pub enum Solver {
    /// `Exact` for small matrices or many components, else `Truncated`.
    #[default]
    Auto,
    /// QR of the centred matrix, then SVD of the triangle: all that double precision has, at `O(D N^2)`.
    Exact,
    /// Block power iteration from a random start (Halko, Martinsson and Tropp 2011), at `O(D N)` per component and
    /// pass. [`Pca::residuals`] says how exact it is.
    Truncated,
}

/// Touches and features from which on few components are computed without the others.
const LARGE: usize = 256;

/// Principal components of touches, descending, from the centred matrix itself and never from its scatter or Gram
/// matrix, which square its condition.
///
/// Signs: the loading of largest magnitude is positive, the first among equals. A component whose singular value is at
/// most `(a + sqrt(b)) * 2^-52` of the greatest, `a` the lesser and `b` the greater of `N` and `D`, is beyond the rank:
/// its loadings, its scores and its share are zero. (`max(N, D)`, which is usual, would cut off a condition of 10^12 at
/// 5,000 features.)
#[derive(Debug, Clone, PartialEq)]
pub struct Pca {
    mean: Vec<f64>,
    components: Matrix,
    singular_values: Vec<f64>,
    residuals: Vec<f64>,
    total: f64,
    rank: usize,
}

impl Pca {
    /// The first `components` components of touches, `D x N`.
    ///
    /// # Errors
    /// Fewer than two touches, no features, numbers that are not finite, touches that are all the same, 0 components.
    pub fn fit(touches: &Matrix, components: usize, solver: Solver) -> Result<Self, PalpationError> {
        let (features, count) = (touches.nrows(), touches.ncols());
        if count < 2 {
            return Err(PalpationError::TooFew { touches: count });
        }
        if features == 0 {
            return Err(PalpationError::NoFeatures);
        }
        if components == 0 {
            return Err(PalpationError::NoComponents);
        }
        let (mean, centred) = centre(touches);
        // A mean is finite only if all that it is made of is.
        if mean.iter().any(|x| !x.is_finite()) {
            finite(touches)?;
        }
        let total = total(&centred);
        let not_converged = PalpationError::NotConverged {
            touches: count,
            features,
        };
        if !total.is_finite() {
            return Err(not_converged);
        }
        // What is left of equal touches is rounding: half a unit in the last place of each value.
        if total <= (greatest(&mean) * f64::EPSILON).powi(2) * (features * count) as f64 {
            return Err(PalpationError::Constant { touches: count });
        }
        let least = features.min(count);
        let truncates = match solver {
            Solver::Auto => least > LARGE && components * 4 < least,
            Solver::Exact => false,
            Solver::Truncated => components < least,
        };
        let found = if truncates {
            truncated(&centred, components)
        } else {
            exact(centred, components)
        };
        let mut found = found.ok_or(not_converged)?;
        let tolerance = least as f64 + (features.max(count) as f64).sqrt();
        let floor = tolerance * f64::EPSILON * found.values[0];
        let rank = found
            .values
            .iter()
            .take_while(|s| **s > floor)
            .count()
            .min(components);
        found.values.truncate(rank);
        found.values.resize(components, 0.0);
        found.residuals.truncate(rank);
        found.residuals.resize(components, 0.0);
        let mut loadings = Matrix::zeros(features, components);
        for (loading, vector) in loadings
            .column_iter_mut()
            .zip(found.vectors.column_iter())
            .take(rank)
        {
            let largest = greatest(vector);
            let first = vector.iter().find(|x| x.abs() == largest);
            let sign = 1.0f64.copysign(*first.unwrap_or(&1.0));
            loading.iter_mut().zip(vector).for_each(|(to, x)| *to = sign * x);
        }
        Ok(Self {
            mean,
            components: loadings,
            singular_values: found.values,
            residuals: found.residuals,
            total,
            rank,
        })
    }

    /// The mean touch, `D` numbers.
    pub fn mean(&self) -> &[f64] {
        &self.mean
    }

    /// The loadings, `D x C`, a component in each column.
    pub fn components(&self) -> &Matrix {
        &self.components
    }

    /// The singular values of the centred matrix, descending.
    pub fn singular_values(&self) -> &[f64] {
        &self.singular_values
    }

    /// How many of the components asked for are there.
    pub fn rank(&self) -> usize {
        self.rank
    }

    /// Bound on the error of each singular value: some singular value of the matrix is no farther from it than this,
    /// and it is never greater than the true one. 0 where all that double precision has was computed.
    pub fn residuals(&self) -> &[f64] {
        &self.residuals
    }

    /// The share of the variance of the touches of the basis in each component, eq. (8): `tau`, 0 to 1.
    pub fn explained_variance(&self) -> Vec<f64> {
        self.singular_values.iter().map(|s| s * s / self.total).collect()
    }

    /// Puts touches, `D x N`, on the map: `C x N`. They are centred on the mean touch, which moves the publication's map,
    /// eq. (5), by a constant and keeps its digits.
    ///
    /// # Errors
    /// Touches of another number of features, and numbers that are not finite.
    pub fn project(&self, touches: &Matrix) -> Result<Matrix, PalpationError> {
        if touches.nrows() != self.mean.len() {
            return Err(PalpationError::OtherProbe {
                expected: self.mean.len(),
                found: touches.nrows(),
            });
        }
        let mut places = Vec::with_capacity(self.components.ncols() * touches.ncols());
        for touch in touches.column_iter() {
            let loadings = self.components.column_iter();
            places.extend(loadings.map(|loading| product_above(touch, &self.mean, loading)));
        }
        // A place is finite only if all of its touch is.
        if places.iter().any(|x| !x.is_finite()) {
            finite(touches)?;
        }
        Ok(Matrix::new(self.components.ncols(), touches.ncols(), places))
    }

    /// The share of the variance of any touches that the map keeps in each component: about their own mean, so that a
    /// basis of few touches is judged on all.
    ///
    /// # Errors
    /// As [`Pca::project`]; fewer than two touches, or touches that are all the same.
    pub fn kept_variance(&self, touches: &Matrix) -> Result<Vec<f64>, PalpationError> {
        if touches.ncols() < 2 {
            return Err(PalpationError::TooFew {
                touches: touches.ncols(),
            });
        }
        let (_, map) = centre(&self.project(touches)?);
        let total = total(&centre(touches).1);
        if total == 0.0 {
            return Err(PalpationError::Constant {
                touches: touches.ncols(),
            });
        }
        let mut kept = vec![0.0; map.nrows()];
        for place in map.column_iter() {
            kept.iter_mut()
                .zip(place)
                .for_each(|(sum, x)| *sum += x * x / total);
        }
        Ok(kept)
    }
}

/// The mean column and what the columns differ from it. The mean is corrected by the mean of the differences, so that
/// an offset of a million costs no digit of the signal.
fn centre(touches: &Matrix) -> (Vec<f64>, Matrix) {
    let mut mean = touches.column_mean();
    let rest = touches.column_mean_above(&mean);
    let mut centred = Vec::with_capacity(touches.as_slice().len());
    for column in touches.column_iter() {
        let values = column.iter().zip(&mean).zip(&rest);
        centred.extend(values.map(|((x, mean), rest)| x - mean - rest));
    }
    mean.iter_mut().zip(rest).for_each(|(mean, rest)| *mean += rest);
    (mean, Matrix::new(touches.nrows(), touches.ncols(), centred))
}

/// The sum of all squares.
fn total(a: &Matrix) -> f64 {
    a.column_iter().map(|column| dots(column, [column])[0]).sum()
}

fn finite(touches: &Matrix) -> Result<(), PalpationError> {
    match touches.not_finite() {
        Some((feature, touch)) => Err(PalpationError::NotFinite {
            touch,
            feature,
            value: touches[(feature, touch)],
        }),
        None => Ok(()),
    }
}
