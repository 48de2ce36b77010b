//! What is said of recorded times that no skin has.

use taxel_record::Recording;

/// Frames that no skin sends faster than this, seconds.
const SHORTEST_S: f64 = 1e-4;
/// Longer than this, seconds, and it is hardly a skin that is read.
const LONGEST_S: f64 = 60.0;
/// Steps of floats of 32 bits that matter, seconds.
const COARSE_S: f64 = 1e-3;

/// That most frames share a time with another, or come faster or more slowly than those of any skin, and why that may be.
pub(crate) fn told(recording: &Recording) -> Option<String> {
    let steps = recording.len() - 1;
    if !recording.has_times() || steps < 2 {
        return None;
    }
    let step_ns = |index: usize| recording.t_ns(index) - recording.t_ns(index - 1);
    let same = (1..=steps).filter(|index| step_ns(*index) == 0).count();
    let mean_s = (recording.t_ns(steps) - recording.t_ns(0)) as f64 / 1e9 / steps as f64;
    let usual_s = recording.period_ns() as f64 / 1e9;
    if 2 * same > steps {
        let why = match float32_step_s(recording).filter(|step| *step > mean_s) {
            Some(step) => format!("float32 keeps times as great as these to {step} s: save them as float64"),
            None => "--rate HZ takes them for so many frames a second".into(),
        };
        return Some(format!(
            "{same} of its {} frames have the time of the frame before; {why}",
            recording.len()
        ));
    }
    let come = if mean_s < SHORTEST_S {
        format!("its frames come {:.0} times a second", 1.0 / mean_s)
    } else if usual_s > LONGEST_S && mean_s > LONGEST_S {
        format!("it has a frame every {usual_s:.0} s")
    } else {
        return None;
    };
    Some(format!(
        "by its times {come}; where these are in another unit, call them t_s, t_ms, t_us or t_ns; --rate HZ ignores them"
    ))
}

/// What floats of 32 bits go in steps of at the last of its times, seconds, where all of them are such floats of one unit and
/// that is too much.
fn float32_step_s(recording: &Recording) -> Option<f64> {
    let mut steps_s = [1e9, 1e6, 1e3].into_iter().filter_map(|unit_ns| {
        let in_unit = |index: usize| recording.t_ns(index) as f64 / unit_ns;
        let is_float = |index: usize| {
            let kept = f64::from(in_unit(index) as f32) * unit_ns;
            kept.round() as u64 == recording.t_ns(index)
        };
        let last = in_unit(recording.len() - 1) as f32;
        let step_s = f64::from(last.next_up() - last) * unit_ns / 1e9;
        (step_s > COARSE_S && (0..recording.len()).all(is_float)).then_some(step_s)
    });
    steps_s.next()
}
