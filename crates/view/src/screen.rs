//! What the person at the terminal has chosen to see.

use crate::flat::Hand;

/// Taxels that can be shown over time at once.
pub(crate) const MOST_CHOSEN: usize = 6;

/// What is shown, and how. Changed by [`Screen::key`].
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Screen {
    /// The taxel told in words; the strongest one where none is chosen.
    pub(crate) cursor: Option<usize>,
    /// Taxels shown over time; where there are none, the one told in words.
    pub(crate) chosen: Vec<usize>,
    pub(crate) right: Right,
    pub(crate) help: bool,
    /// Whether no arrows of shear are wanted.
    pub(crate) no_arrows: bool,
    /// The force that the brightest colour stands for, where it does not follow the hand.
    pub(crate) held: Option<f64>,
    /// The text of a mark that is being written.
    pub(crate) prompt: Option<String>,
    /// Whether a recording is seen, which has keys of its own.
    pub(crate) recording: bool,
}

/// What is right of the skin, or below it where the hand is wide.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(crate) enum Right {
    #[default]
    Image,
    Traces,
    Problems,
}

/// Where an arrow key goes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Way {
    Left,
    Right,
    Up,
    Down,
}

impl Screen {
    /// For a daemon.
    pub fn new() -> Self {
        Self::default()
    }

    /// For a recording: keys that change a hand are keys of the playback.
    pub fn of_recording() -> Self {
        Self {
            recording: true,
            ..Self::default()
        }
    }

    /// Goes to the next taxel this way: the nearest, where one further aside counts as two ahead.
    pub(crate) fn go(&mut self, way: Way, hand: &Hand, from: Option<usize>) {
        let (across, down) = (&hand.flat.across[0].places, &hand.flat.down[0][0].places);
        let Some(from) = self.cursor.or(from).filter(|taxel| *taxel < hand.len()) else {
            self.cursor = (!hand.is_empty()).then_some(0);
            return;
        };
        let nearest = (0..hand.len())
            .filter_map(|taxel| {
                let (x, y) = (across[taxel] - across[from], down[taxel] - down[from]);
                let (ahead, aside) = match way {
                    Way::Left => (-x, y),
                    Way::Right => (x, y),
                    Way::Up => (-y, x),
                    Way::Down => (y, x),
                };
                (ahead > 0.1).then_some((taxel, ahead + 2.0 * aside.abs()))
            })
            .min_by(|a, b| a.1.total_cmp(&b.1));
        self.cursor = Some(nearest.map_or(from, |(taxel, _)| taxel));
    }

    /// Shows a taxel over time, or no longer.
    pub(crate) fn choose(&mut self, taxel: usize) {
        match self.chosen.iter().position(|chosen| *chosen == taxel) {
            Some(place) => drop(self.chosen.remove(place)),
            None => {
                if self.chosen.len() == MOST_CHOSEN {
                    self.chosen.remove(0);
                }
                self.chosen.push(taxel);
            }
        }
    }

    /// Forgets taxels that another hand does not have.
    pub fn fit(&mut self, hand: &Hand) {
        self.chosen.retain(|taxel| *taxel < hand.len());
        self.cursor = self.cursor.filter(|taxel| *taxel < hand.len());
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use taxel_skin::Layout;

    #[test]
    fn arrow_keys_go_from_taxel_to_taxel_and_over_gaps() {
        let hand = Hand::new(Layout::builtin("allegro-uskin-15").unwrap().geometry);
        let at = |x, y| hand.taxel_at(x, y).unwrap();
        let mut screen = Screen::new();
        screen.go(Way::Right, &hand, Some(at(2, 1)));
        assert_eq!(screen.cursor, Some(at(3, 1)));
        for (way, there) in [
            (Way::Right, (4, 1)),
            (Way::Down, (4, 2)),
            (Way::Left, (3, 2)),
            (Way::Up, (3, 1)),
            (Way::Up, (3, 0)),
            (Way::Up, (3, 0)),
        ] {
            screen.go(way, &hand, None);
            assert_eq!(screen.cursor, Some(at(there.0, there.1)), "{way:?}");
        }
    }

    #[test]
    fn every_taxel_can_be_reached() {
        for name in Layout::builtin_names() {
            let hand = Hand::new(Layout::builtin(name).unwrap().geometry);
            let mut reached = vec![false; hand.len()];
            let mut next = vec![0];
            while let Some(from) = next.pop() {
                if std::mem::replace(&mut reached[from], true) {
                    continue;
                }
                for way in [Way::Left, Way::Right, Way::Up, Way::Down] {
                    let mut screen = Screen::new();
                    screen.go(way, &hand, Some(from));
                    next.extend(screen.cursor);
                }
            }
            assert!(reached.iter().all(|reached| *reached), "{name}");
        }
    }

    #[test]
    fn the_seventh_taxel_over_time_replaces_the_first() {
        let mut screen = Screen::new();
        (0..7).for_each(|taxel| screen.choose(taxel));
        screen.choose(3);
        assert_eq!(screen.chosen, [1, 2, 4, 5, 6]);
    }
}
