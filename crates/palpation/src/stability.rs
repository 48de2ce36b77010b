//! Whether categories would be found again.

use crate::agreement::Agreement;
use crate::categories::best_of_many;
use crate::error::PalpationError;
use crate::matrix::Matrix;
use taxel_cluster::Random;

/// Mean adjusted Rand index between categories and those of touches drawn anew with replacement, every touch put into
/// the nearest of them (Hennig 2007): 1 where the same are always found. `labels` are of the map, `C x N`.
///
/// Draws in which fewer than `clusters` touches differ do not count; 0 where none counts.
///
/// # Errors
/// Not one label per touch.
pub fn stability(map: &Matrix, labels: &[usize], draws: u32, seed: u64) -> Result<f64, PalpationError> {
    let touches = map.ncols();
    if labels.len() != touches {
        return Err(PalpationError::Labels {
            labels: labels.len(),
            touches,
        });
    }
    let clusters = labels.iter().max().map_or(0, |most| most + 1);
    let mut random = Random::new(seed);
    let (mut sum, mut counted) = (0.0, 0);
    for _ in 0..draws {
        let drawn: Vec<usize> = (0..touches).map(|_| random.below(touches)).collect();
        let mut different = drawn.clone();
        different.sort_unstable();
        different.dedup();
        if different.len() < clusters {
            continue;
        }
        let again = best_of_many(&map.select_columns(&drawn), clusters, seed);
        let nearest: Vec<usize> = map.column_iter().map(|touch| again.nearest(touch).0).collect();
        sum += Agreement::of(&nearest, labels)?.ari;
        counted += 1;
    }
    Ok(if counted > 0 {
        sum / f64::from(counted)
    } else {
        0.0
    })
}
