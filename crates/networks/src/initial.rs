//! Weights before training, as Keras 2 draws them. The draws themselves are others: its generator is not ours.

use candle_core::{Device, Result, Tensor};
use taxel_cluster::Random;

/// Evenly within sqrt(6 / (inputs + outputs)) of 0 (Glorot and Bengio 2010), rows x columns. A kernel that slides over an
/// image counts inputs and outputs once for each of its places.
pub(crate) fn glorot_uniform(
    random: &mut Random,
    rows: usize,
    columns: usize,
    places: usize,
) -> Result<Tensor> {
    let limit = (6.0 / (rows + columns * places) as f64).sqrt();
    let draw = || (limit * (2.0 * random.unit() - 1.0)) as f32;
    let values: Vec<f32> = std::iter::repeat_with(draw).take(rows * columns).collect();
    Tensor::from_vec(values, (rows, columns), &Device::Cpu)
}

/// A random matrix whose rows (or columns, where these are fewer) are orthogonal and of length 1 (Saxe, McClelland and
/// Ganguli 2014): Q of a normal matrix, of the QR decomposition in which R has no negative diagonal.
///
/// That R is the Cholesky factor of A'A, so Q = A inv(R). The loss of orthogonality grows with the square of the condition
/// of A, which is about 3 where one side is four times the other, as in every recurrent kernel.
pub(crate) fn orthogonal(random: &mut Random, rows: usize, columns: usize) -> Result<Tensor> {
    let (long, short) = (rows.max(columns), rows.min(columns));
    let values: Vec<f64> = std::iter::repeat_with(|| random.normal())
        .take(long * short)
        .collect();
    let a = Tensor::from_vec(values, (long, short), &Device::Cpu)?;
    let gram = a.t()?.matmul(&a)?.flatten_all()?.to_vec1()?;
    let inverse = Tensor::from_vec(inverse_cholesky(gram, short), (short, short), &Device::Cpu)?;
    let q = a.matmul(&inverse.t()?)?.to_dtype(candle_core::DType::F32)?;
    if rows < columns {
        q.t()?.contiguous()
    } else {
        Ok(q)
    }
}

/// The inverse of the lower triangular L with L L' = `matrix`, which is n x n, symmetric and positive definite.
fn inverse_cholesky(mut matrix: Vec<f64>, n: usize) -> Vec<f64> {
    // Elimination of column by column makes L' of the matrix, and inv(L) of the identity, up to the rows' lengths.
    let mut inverse = vec![0.0; n * n];
    for row in 0..n {
        inverse[row * n + row] = 1.0;
    }
    for pivot in 0..n {
        let scale = 1.0 / matrix[pivot * n + pivot];
        let (upper, below) = matrix.split_at_mut((pivot + 1) * n);
        let (done, open) = inverse.split_at_mut((pivot + 1) * n);
        let (pivot_row, done_row) = (&upper[pivot * n..], &done[pivot * n..]);
        for (row, target) in below.chunks_exact_mut(n).zip(open.chunks_exact_mut(n)) {
            let factor = row[pivot] * scale;
            let tail = row[pivot..].iter_mut().zip(&pivot_row[pivot..]);
            tail.for_each(|(value, above)| *value -= factor * above);
            let head = target[..=pivot].iter_mut().zip(&done_row[..=pivot]);
            head.for_each(|(value, above)| *value -= factor * above);
        }
    }
    for row in 0..n {
        let length = matrix[row * n + row].sqrt();
        inverse[row * n..][..=row]
            .iter_mut()
            .for_each(|value| *value /= length);
    }
    inverse
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn recurrent_kernels_are_orthogonal() {
        for (rows, columns) in [(5, 20), (30, 8)] {
            let q = orthogonal(&mut Random::for_purpose(1, 2), rows, columns).unwrap();
            let product = if rows < columns {
                q.matmul(&q.t().unwrap())
            } else {
                q.t().unwrap().matmul(&q)
            };
            for (row, values) in product.unwrap().to_vec2::<f32>().unwrap().iter().enumerate() {
                for (column, value) in values.iter().enumerate() {
                    let expected = f32::from(u8::from(row == column));
                    assert!(
                        (value - expected).abs() < 1e-5,
                        "{rows} x {columns}: {row}, {column} is {value}"
                    );
                }
            }
        }
    }

    #[test]
    fn first_weights_stay_within_their_limit_and_fill_it() {
        let drawn = glorot_uniform(&mut Random::for_purpose(1, 2), 30, 20, 1).unwrap();
        let drawn = drawn.flatten_all().unwrap().to_vec1::<f32>().unwrap();
        let limit = (6.0f32 / 50.0).sqrt();
        let largest = drawn.iter().fold(0.0f32, |a, b| a.max(b.abs()));
        assert!(largest <= limit && largest > 0.98 * limit, "{largest} of {limit}");
    }
}
