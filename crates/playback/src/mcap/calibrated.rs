//! What the daemon of an MCAP recording had calibrated when that begins: a part of a recording, or one that was kept around
//! a trigger, may begin in a grasp.

use super::head::{HEAD_NS, Head};
use taxel_config::Config;
use taxel_recorder::{Item, RecordedFrame, RecordingReader, Topic};
use taxel_skin::Calibrated;

/// Nanoseconds of a millisecond.
const MS: u64 = 1_000_000;

/// What the daemon had calibrated in the first frame of a recording, where that holds for this configuration too. If not,
/// the first `calibration_ms` are calibrated on, and it is said how many taxels were in contact meanwhile.
pub fn at_the_beginning(head: &Head, config: &Config) -> anyhow::Result<Option<Calibrated>> {
    let mut reader = RecordingReader::open(head.path(), &[Topic::Frames])?;
    if !reader.may_hold(Topic::Frames) {
        return Ok(None);
    }
    let is_of_it = is_of_it(head, config)?;
    let window_ns = window_ns(config);
    let (mut began_ns, mut touched) = (None, vec![false; config.layout.len()]);
    while let Some(item) = reader.next_item()? {
        let Item::Message { wall_ns, data, .. } = item else {
            continue;
        };
        let Some(frame) = RecordedFrame::read(data) else {
            continue;
        };
        if frame.contacts().len() != touched.len() {
            return Ok(None);
        }
        // Behind the first it is a change (`DaemonChanges`).
        if is_of_it && !frame.is_calibrating && frame.baselines().len() > 0 {
            return Ok(began_ns.is_none().then(|| calibrated(&frame)));
        }
        if wall_ns.saturating_sub(*began_ns.get_or_insert(wall_ns)) > window_ns.min(HEAD_NS) {
            break;
        }
        for (touched, contact) in touched.iter_mut().zip(frame.contacts()) {
            *touched |= contact;
        }
    }
    let touched = touched.iter().filter(|touched| **touched).count();
    if touched > 0 {
        remark!(
            "taxel: {}: its first {} ms are taken for an untouched hand, but {touched} taxels were in contact; contacts may \
             be missing, and others be shown that never were",
            head.path().display(),
            config.conditioning.calibration_ms
        );
    }
    Ok(None)
}

/// How long this configuration calibrates, nanoseconds.
pub(crate) fn window_ns(config: &Config) -> u64 {
    config.conditioning.calibration_ms.saturating_mul(MS)
}

/// Whether the daemon calibrated as this configuration says, as far as the recording tells.
pub(crate) fn is_of_it(head: &Head, config: &Config) -> anyhow::Result<bool> {
    if let Some(recorded) = head.config()? {
        return Ok(recorded.conditioning == config.conditioning);
    }
    let unit = head.hello().map(|hello| hello.force_unit.as_str());
    Ok(unit == Some(config.force_unit()))
}

pub(crate) fn calibrated(frame: &RecordedFrame<'_>) -> Calibrated {
    Calibrated {
        threshold: frame.threshold.into(),
        baseline: frame.baselines().collect(),
        contact: frame.contacts().collect(),
        faults: frame.faults().collect(),
    }
}
