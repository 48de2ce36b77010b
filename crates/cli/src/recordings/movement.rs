//! What moved while the hand of a recording was calibrated, in words.

use taxel_skin::Movement;
use taxeld::Config;

/// What moved, what follows from it, and what to do; `threshold` is the one that was measured. `None` where nothing moved.
pub(crate) fn told(moved: Movement, threshold: f64, config: &Config) -> Option<String> {
    let unit = match config.conditioning.magnitude.is_squared() {
        true => "counts squared",
        false => "counts",
    };
    let what: String = match moved {
        Movement::None => return None,
        Movement::Taxels(1) => "a taxel moved while the hand was calibrated, or was touched: it may show contacts that are none, \
                                or miss some"
            .into(),
        Movement::Taxels(count) => format!(
            "{count} taxels moved while the hand was calibrated, or were touched: they may show contacts that are none, or miss \
             some"
        ),
        Movement::Noise => format!(
            "most taxels were out of use as noisy when the time in which the hand was calibrated ended: its contact threshold, \
             {threshold:.0} {unit}, is of that noise, and lighter touches are missed"
        ),
        Movement::InOneHalf => {
            "the hand moved while it was calibrated, or was touched: it rests as in the quieter half of that time".into()
        }
        Movement::InBothHalves => format!(
            "the hand moved in both halves of the time in which it was calibrated, or was touched: its contact threshold, \
             {threshold:.0} {unit}, is of that movement, and lighter touches are missed"
        ),
    };
    Some(format!(
        "{what}; begin with a hand that is still, or measure for less time with --calibration-ms"
    ))
}
