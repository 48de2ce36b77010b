//! The cognitive map: principal components of touches.

use crate::decomposition::Decomposition;
use crate::error::PalpationError;
use crate::truncated::truncated;
use nalgebra::{DMatrix, DVector, QR, SVD};

/// How components are computed.
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq)]
pub enum Solver {
    /// `Exact` for small matrices or many components, else `Truncated`.
    #[default]
    Auto,
    /// QR, then SVD of the centred matrix: all that double precision has, at `O(D N^2)`.
    Exact,
    /// Block power iteration from a random start (Halko, Martinsson and Tropp 2011), at `O(D N)` per component and
    /// pass. [`Pca::residuals`] says how exact it is.
    Truncated,
}

/// Touches and features from which on few components are computed without the others.
const LARGE: usize = 256;
/// Steps of the SVD of a triangle of N columns at most, per column.
const STEPS: usize = 200;

/// Principal components of touches, descending, from the centred matrix itself and never from its scatter or Gram
/// matrix, which square its condition.
///
/// Signs: the loading of largest magnitude is positive, the first among equals. A component whose singular value is at
/// most `(a + sqrt(b)) * 2^-52` of the greatest, `a` the lesser and `b` the greater of `N` and `D`, is beyond the rank:
/// its loadings, its scores and its share are zero. (`max(N, D)`, which is usual, would cut off a condition of 10^12 at
/// 5,000 features.)
#[derive(Debug, Clone, PartialEq)]
pub struct Pca {
    mean: DVector<f64>,
    components: DMatrix<f64>,
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
    pub fn fit(touches: &DMatrix<f64>, components: usize, solver: Solver) -> Result<Self, PalpationError> {
        let (features, count) = touches.shape();
        if count < 2 {
            return Err(PalpationError::TooFew { touches: count });
        }
        if features == 0 {
            return Err(PalpationError::NoFeatures);
        }
        if components == 0 {
            return Err(PalpationError::NoComponents);
        }
        finite(touches)?;
        let (mean, centred) = centre(touches);
        let total = centred.norm_squared();
        // What is left of equal touches is rounding: half a unit in the last place of each value.
        let largest = mean.amax();
        if total <= (largest * f64::EPSILON).powi(2) * (features * count) as f64 {
            return Err(PalpationError::Constant { touches: count });
        }
        let least = features.min(count);
        let truncates = match solver {
            Solver::Auto => least > LARGE && components * 4 < least,
            Solver::Exact => false,
            Solver::Truncated => components < least,
        };
        let mut found = if truncates {
            truncated(&centred, components)
        } else {
            exact(centred)?
        };
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
        let mut loadings = found.vectors.columns(0, rank).into_owned();
        for mut column in loadings.column_iter_mut() {
            let largest = column
                .iter()
                .fold(0.0f64, |most, x| if x.abs() > most.abs() { *x } else { most });
            if largest < 0.0 {
                column.neg_mut();
            }
        }
        Ok(Self {
            mean,
            components: loadings.resize_horizontally(components, 0.0),
            singular_values: found.values,
            residuals: found.residuals,
            total,
            rank,
        })
    }

    /// The mean touch, `D` numbers.
    pub fn mean(&self) -> &DVector<f64> {
        &self.mean
    }

    /// The loadings, `D x C`, a component in each column.
    pub fn components(&self) -> &DMatrix<f64> {
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
    pub fn project(&self, touches: &DMatrix<f64>) -> Result<DMatrix<f64>, PalpationError> {
        if touches.nrows() != self.mean.len() {
            return Err(PalpationError::OtherProbe {
                expected: self.mean.len(),
                found: touches.nrows(),
            });
        }
        finite(touches)?;
        let mut centred = touches.clone();
        for mut column in centred.column_iter_mut() {
            column -= &self.mean;
        }
        Ok(self.components.tr_mul(&centred))
    }

    /// The share of the variance of any touches that the map keeps in each component: about their own mean, so that a
    /// basis of few touches is judged on all.
    ///
    /// # Errors
    /// As [`Pca::project`]; fewer than two touches, or touches that are all the same.
    pub fn kept_variance(&self, touches: &DMatrix<f64>) -> Result<Vec<f64>, PalpationError> {
        if touches.ncols() < 2 {
            return Err(PalpationError::TooFew {
                touches: touches.ncols(),
            });
        }
        let (_, map) = centre(&self.project(touches)?);
        let total = centre(touches).1.norm_squared();
        if total == 0.0 {
            return Err(PalpationError::Constant {
                touches: touches.ncols(),
            });
        }
        Ok(map.row_iter().map(|row| row.norm_squared() / total).collect())
    }
}

/// The mean column and what the columns differ from it. The mean is corrected by the mean of the differences, so that
/// an offset of a million costs no digit of the signal.
fn centre(touches: &DMatrix<f64>) -> (DVector<f64>, DMatrix<f64>) {
    let mut mean = touches.column_mean();
    let mut centred = touches.clone();
    for mut column in centred.column_iter_mut() {
        column -= &mean;
    }
    let rest = centred.column_mean();
    for mut column in centred.column_iter_mut() {
        column -= &rest;
    }
    mean += rest;
    (mean, centred)
}

fn finite(touches: &DMatrix<f64>) -> Result<(), PalpationError> {
    match touches.iter().position(|x| !x.is_finite()) {
        Some(at) => Err(PalpationError::NotFinite {
            touch: at / touches.nrows(),
            feature: at % touches.nrows(),
            value: touches[at],
        }),
        None => Ok(()),
    }
}

/// All of it: QR of the longer side, then SVD of the triangle.
fn exact(centred: DMatrix<f64>) -> Result<Decomposition, PalpationError> {
    let (features, touches) = centred.shape();
    let wide = touches > features;
    let qr = QR::new(if wide { centred.transpose() } else { centred });
    let steps = STEPS * features.min(touches);
    let not_converged = PalpationError::NotConverged {
        touches,
        features,
        steps,
    };
    let svd = SVD::try_new(qr.r(), !wide, wide, f64::EPSILON, steps).ok_or(not_converged)?;
    // The vectors of the features: Q U of the matrix itself, V of its transpose.
    let vectors = match (svd.u, svd.v_t) {
        (Some(u), _) => qr.q() * u,
        (None, Some(v_t)) => v_t.transpose(),
        (None, None) => unreachable!("one of the two was asked for"),
    };
    let values: Vec<f64> = svd.singular_values.iter().copied().collect();
    Ok(Decomposition {
        residuals: vec![0.0; values.len()],
        values,
        vectors,
    })
}
