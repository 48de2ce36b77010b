//! Marks of a daemon that is followed, each before the frame that it belongs before.

use std::collections::VecDeque;

/// Frames for which a mark waits at most: those of a hand that fell silent are of one instant.
const PATIENCE: usize = 5;

/// Marks that wait for their frame. A mark comes when it is made, and a frame after what it tells of, so that one that comes
/// behind a mark may be older. As in a recording, the first frame of a mark is the first that is not.
#[derive(Debug, Default)]
pub(super) struct WaitingMarks {
    marks: VecDeque<(u64, String)>,
    /// Frames that came since the first of them.
    frames: usize,
}

impl WaitingMarks {
    /// A mark has come.
    pub(super) fn wait(&mut self, t_ns: u64, text: &str) {
        self.marks.push_back((t_ns, text.to_owned()));
    }

    /// A frame has come.
    pub(super) fn count_frame(&mut self) {
        self.frames += usize::from(!self.marks.is_empty());
    }

    /// Takes the next mark that belongs before a frame of this instant, with its own.
    pub(super) fn next_before(&mut self, t_ns: u64) -> Option<(u64, String)> {
        let (mark_ns, _) = self.marks.front()?;
        if *mark_ns > t_ns && self.frames <= PATIENCE {
            return None;
        }
        let mark = self.marks.pop_front();
        if self.marks.is_empty() {
            self.frames = 0;
        }
        mark
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The marks that were taken before each frame.
    fn taken(frames: &[u64], of: impl Fn(usize) -> Vec<(u64, &'static str)>) -> Vec<Vec<String>> {
        let mut marks = WaitingMarks::default();
        let mut before = |(n, t_ns): (usize, &u64)| {
            of(n)
                .iter()
                .for_each(|(mark_ns, text)| marks.wait(*mark_ns, text));
            marks.count_frame();
            std::iter::from_fn(|| marks.next_before(*t_ns).map(|(_, text)| text)).collect()
        };
        frames.iter().enumerate().map(&mut before).collect()
    }

    #[test]
    fn a_mark_is_before_the_first_frame_that_is_no_older() {
        // A frame of before the mark comes behind it.
        let come = |n| {
            if n == 1 {
                vec![(25, "a"), (26, "up")]
            } else {
                vec![]
            }
        };
        let none: Vec<String> = Vec::new();
        let both = vec!["a".to_owned(), "up".to_owned()];
        assert_eq!(
            taken(&[10, 20, 26, 30], come),
            [none.clone(), none.clone(), both, none.clone()]
        );
        let one = |text: &str| vec![text.to_owned()];
        assert_eq!(
            taken(&[10, 20, 25, 30], come),
            [none.clone(), none, one("a"), one("up")]
        );
    }

    #[test]
    fn a_hand_that_is_silent_holds_no_mark_back() {
        let come = |n| {
            if n == 0 {
                vec![(25, "a"), (26, "up")]
            } else {
                vec![]
            }
        };
        let taken = taken(&[20; 9], come);
        assert_eq!(taken.concat(), ["a", "up"]);
        assert_eq!(taken[PATIENCE].len(), 2);
    }
}
