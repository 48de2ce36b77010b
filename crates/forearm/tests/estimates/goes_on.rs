//! Estimates of a squeeze while it goes on.

use super::{session_with_touch, squeeze, touch};
use taxel_forearm::{Estimator, Model, Seen, Source, TACTELS};

#[test]
fn a_squeeze_that_goes_on_is_estimated_as_a_whole_one_is_and_each_image_is_looked_at_once() {
    let model = Model::train(&session_with_touch()).unwrap();
    let mut whole = squeeze(37.0, 0.0);
    touch(&mut whole, 37.0);
    let mut seen = Seen::default();
    let mut sources = 0;
    for len in 1..=whole.len() {
        let so_far = whole.prefix(len);
        let mut newest = so_far.clone();
        // Images from before are not there to be looked at again.
        let before = TACTELS * (len - 1);
        newest.tactile.as_mut().unwrap()[..before].fill(0);
        match (model.follow(&newest, &mut seen), model.estimate(&so_far)) {
            (Ok(followed), Ok(estimate)) => {
                assert_eq!(followed, estimate, "{len} samples");
                sources += usize::from(estimate.source == Source::Fused);
            }
            (followed, estimate) => assert_eq!(followed.is_err(), estimate.is_err(), "{len} samples"),
        }
    }
    assert!(sources > 50, "{sources}");
}
