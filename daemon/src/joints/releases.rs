//! Motors that are to be off, and whose servos have not said so by the time that whoever wanted it was answered or gone.

use std::cell::RefCell;
use taxel_diagnose::Severity;
use taxel_joints::ServoReader;
use taxel_joints::bus::MotorOff;

/// What is still to be said of them in the log; at most one of each joint.
#[derive(Debug, Default)]
pub(crate) struct Releases {
    awaited: RefCell<Vec<Release>>,
}

#[derive(Debug)]
struct Release {
    joint: usize,
    /// Number of the command.
    number: u64,
    /// Why, where nobody asked for it.
    why: &'static str,
    /// Whether it was said that it is not confirmed.
    told: bool,
}

impl Releases {
    /// A command to switch a motor off was not confirmed, and whoever asked has been told so.
    pub(super) fn asked(&self, joint: usize, number: u64) {
        self.put(joint, number, "", true);
    }

    /// A motor is switched off, and whoever asked for it is told nothing any more.
    pub(super) fn left(&self, joint: usize, number: u64) {
        self.put(joint, number, "", false);
    }

    /// A motor is switched off since who held it is gone.
    pub(super) fn let_go(&self, joint: usize, number: u64) {
        self.put(joint, number, ", since who held it is gone", false);
    }

    fn put(&self, joint: usize, number: u64, why: &'static str, told: bool) {
        let mut awaited = self.awaited.borrow_mut();
        awaited.retain(|other| other.joint != joint);
        awaited.push(Release {
            joint,
            number,
            why,
            told,
        });
    }

    /// What has become of them since it was asked last: sentences for the log.
    pub(crate) fn news(&self, servos: &ServoReader) -> Vec<(Option<Severity>, String)> {
        let name = |joint: usize| servos.names().get(joint).map_or("", String::as_str);
        self.news_of(|joint| servos.motor_off(joint), name)
    }

    fn news_of<'n>(
        &self,
        off: impl Fn(usize) -> MotorOff,
        name: impl Fn(usize) -> &'n str,
    ) -> Vec<(Option<Severity>, String)> {
        let mut news = Vec::new();
        self.awaited.borrow_mut().retain_mut(|release| {
            let (off, name, why) = (off(release.joint), name(release.joint), release.why);
            let done = off.written.filter(|written| written.number >= release.number);
            match done.map(|written| (written.number == release.number, written.result)) {
                // The servos' thread is not there yet.
                None => return true,
                // Whoever asked for a later one is told.
                Some((false, _)) => {}
                Some((true, Ok(()))) => news.push((None, format!("joints: torque of {name} is off{why}"))),
                Some((true, Err(error))) if off.unconfirmed => {
                    if !std::mem::replace(&mut release.told, true) {
                        let sentence = format!(
                            "joints: torque of {name} is to be off{why}: {error}; it is told again until it confirms that"
                        );
                        news.push((Some(Severity::Error), sentence));
                    }
                    return true;
                }
                // It was started anew.
                Some((true, Err(_))) => {}
            }
            false
        });
        news
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use taxel_joints::bus::{WriteError, Written};

    fn off(newest: u64, number: u64, result: Result<(), WriteError>, unconfirmed: bool) -> MotorOff {
        MotorOff {
            newest,
            written: Some(Written { number, result }),
            unconfirmed,
        }
    }

    #[track_caller]
    fn says(releases: &Releases, state: MotorOff, words: &[&str]) {
        let news = releases.news_of(|_| state, |_| "index 0");
        let said: Vec<&str> = news.iter().map(|(_, sentence)| sentence.as_str()).collect();
        assert_eq!(said.len(), words.len(), "{said:?}");
        assert!(said.iter().zip(words).all(|(s, w)| s.contains(w)), "{said:?}");
    }

    #[test]
    fn that_a_motor_is_off_is_said_once_its_servo_has_confirmed_it() {
        let silent = Err(WriteError::Silent);
        let releases = Releases::default();
        releases.let_go(0, 7);
        says(&releases, MotorOff::default(), &[]);
        says(&releases, off(6, 6, Ok(()), false), &[]);
        let not_yet = "index 0 is to be off, since who held it is gone: the servo does not answer";
        says(&releases, off(7, 7, silent, true), &[not_yet]);
        says(&releases, off(7, 7, silent, true), &[]);
        says(
            &releases,
            off(7, 7, Ok(()), false),
            &["torque of index 0 is off, since who held it is gone"],
        );
        says(&releases, off(7, 7, Ok(()), false), &[]);
    }

    #[test]
    fn what_was_told_whoever_asked_is_not_told_again_and_a_later_command_speaks_for_itself() {
        let silent = Err(WriteError::Silent);
        for (state, words) in [
            (off(3, 3, silent, true), &[][..]),
            (off(3, 3, Ok(()), false), &["torque of index 0 is off"]),
            // Started anew, and told to be off once more.
            (off(3, 3, silent, false), &[]),
            (off(4, 4, Ok(()), false), &[]),
        ] {
            let releases = Releases::default();
            releases.asked(0, 2);
            releases.asked(0, 3);
            says(&releases, state, words);
            assert_eq!(releases.awaited.borrow().len(), usize::from(state.unconfirmed));
        }
    }
}
