//! One recording as figures need it: every frame, and which of them matter.

use crate::recordings::input::Input;
use crate::recordings::offline::{OfflineArgs, ends_within_calibration};
use crate::recordings::out_of_use::OutOfUse;
use anyhow::{Context, bail};
use taxel_compress::Compressor;
use taxel_hand::{
    FORCE_MAX, FORCE_MIN, ForceFrame, Method, Profile, TactileFrame, TactileImage, did_you_mean,
};
use taxel_skin::{ConditionConfig, Layout};

/// A contact that is away for no longer is the same contact, frames.
const FLICKER: usize = 3;
/// From here on a contact is no row of flickers, frames.
const LASTING: usize = 2 * FLICKER;

/// A recording, conditioned as the daemon does it.
#[derive(Debug)]
pub(super) struct Take {
    pub(super) name: String,
    pub(super) layout: Layout,
    pub(super) profile: Profile,
    /// What forces are in; none where the recording holds magnitudes, whose unit it does not say.
    pub(super) unit: Option<&'static str>,
    /// Counts of each frame; empty where the recording holds magnitudes.
    pub(super) tactile: Vec<TactileFrame>,
    /// The first baseline of each taxel, counts x, y, z; not a number where it never had one.
    pub(super) rest: Vec<[f32; 3]>,
    /// Without the contacts that are out of use since their force is none that an image can carry, as in a compressor.
    pub(super) force: Vec<ForceFrame>,
    pub(super) out_of_use: OutOfUse,
    /// How counts are conditioned.
    conditioning: ConditionConfig,
    /// When it begins, nanoseconds.
    begins_ns: u64,
}

/// A frame, and what it is.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Instant {
    pub(super) name: String,
    pub(super) index: usize,
}

impl Take {
    /// With the conditioning that belongs to the method, where one is given and the user states no other.
    pub(super) fn of(offline: &OfflineArgs, name: &str, method: Option<Method>) -> anyhow::Result<Self> {
        let input = offline.open_whole()?;
        let mut config = offline.configure(&input)?;
        if let Some(method) = method {
            config.set_method(method, offline.conditioning);
        }
        config.profile.check()?;
        let mut take = Self {
            name: name.into(),
            layout: config.layout.clone(),
            profile: config.profile.clone(),
            unit: None,
            tactile: Vec::new(),
            rest: vec![[f32::NAN; 3]; config.layout.len()],
            force: Vec::new(),
            out_of_use: OutOfUse::default(),
            conditioning: config.conditioning.clone(),
            begins_ns: match &input {
                Input::Frames(recording) => recording.t_ns(0),
                Input::Log(_) | Input::Scene(_) => 0,
            },
        };
        offline.run(&input, &config, &mut |felt| {
            if let Some(measured) = &felt.measured {
                take.tactile.push(measured.tactile.clone());
                for (rest, baseline) in take.rest.iter_mut().zip(measured.baseline) {
                    if rest[0].is_nan() {
                        *rest = *baseline;
                    }
                }
            }
            take.out_of_use.take(felt.force);
            let mut frame = felt.force.clone();
            for (contact, force) in frame.contact.iter_mut().zip(&frame.force) {
                *contact &= (FORCE_MIN..=FORCE_MAX).contains(force);
            }
            take.force.push(frame);
            Ok(())
        })?;
        if !take.tactile.is_empty() {
            let squared = config.conditioning.magnitude.is_squared();
            take.unit = Some(if squared { "counts²" } else { "counts" });
        }
        Ok(take)
    }

    /// Time of a frame, seconds from the beginning.
    pub(super) fn time_s(&self, index: usize) -> f64 {
        self.force[index].t_ns.saturating_sub(self.begins_ns) as f64 / 1e9
    }

    /// Force on a module in a frame: the largest of its taxels in contact, 0 where there is none.
    pub(super) fn force_on(&self, module: usize, index: usize) -> f64 {
        let frame = &self.force[index];
        let taxels = self.layout.modules[module].taxel_range();
        taxels
            .filter(|n| frame.contact[*n])
            .map(|n| frame.force[n])
            .fold(0.0, f64::max)
    }

    /// Sum of the forces of all taxels in contact.
    pub(super) fn total_force(&self, index: usize) -> f64 {
        let frame = &self.force[index];
        let touched = frame
            .force
            .iter()
            .zip(&frame.contact)
            .filter(|(_, contact)| **contact);
        touched.map(|(force, _)| force).sum()
    }

    /// The frame with the largest total force, the first of several; none where nothing is in contact.
    pub(super) fn tightest(&self) -> Option<usize> {
        let touched = (0..self.force.len()).filter(|index| self.force[*index].contacts() > 0);
        touched
            .rev()
            .max_by(|a, b| self.total_force(*a).total_cmp(&self.total_force(*b)))
    }

    /// Why nothing is in contact, where that is known.
    pub(super) fn why_untouched(&self) -> Option<String> {
        let is_cut = !self.force.is_empty() && self.force.iter().all(|frame| frame.calibrating);
        is_cut.then(|| ends_within_calibration(&self.conditioning))
    }

    /// The module whose first contact begins first, the one pressed hardest of several; one that only flickers where no
    /// other is touched.
    pub(super) fn touched_first(&self) -> Option<usize> {
        let contacts = (0..self.layout.modules.len()).filter_map(|module| {
            let (first, last) = self.first_contact(module)?;
            Some((
                module,
                (last - first < LASTING, first),
                self.force_on(module, first),
            ))
        });
        let first =
            contacts.min_by(|(_, a, force_a), (_, b, force_b)| a.cmp(b).then(force_b.total_cmp(force_a)));
        first.map(|(module, ..)| module)
    }

    pub(super) fn module_named(&self, name: &str) -> anyhow::Result<usize> {
        let modules = &self.layout.modules;
        let names = || modules.iter().map(|module| module.name.as_str());
        let found = names().position(|known| known == name);
        found.with_context(|| {
            let (meant, all) = (
                did_you_mean(name, names()),
                names().collect::<Vec<_>>().join(", "),
            );
            format!("--module {name}: layout {} has {all}{meant}", self.layout.name)
        })
    }

    /// The first and the last frame of a module's first contact: the first that lasts for longer than a row of flickers,
    /// if there is one.
    pub(super) fn first_contact(&self, module: usize) -> Option<(usize, usize)> {
        let touched = (0..self.force.len()).filter(|index| self.force_on(module, *index) > 0.0);
        let mut contacts: Vec<(usize, usize)> = Vec::new();
        for index in touched {
            match contacts.last_mut() {
                Some((_, last)) if index <= *last + FLICKER => *last = index,
                _ => contacts.push((index, index)),
            }
        }
        let lasting = contacts.iter().find(|(first, last)| last - first >= LASTING);
        lasting.or(contacts.first()).copied()
    }

    /// The first frame of a contact, from this one on, in which nothing is held back as a glitch: of a touch that comes at
    /// once its strongest taxels are held back first, and its rim alone is felt.
    fn first_whole(&self, module: usize, first: usize) -> usize {
        let is_whole = |index: &usize| {
            let mut taxels = self.layout.modules[module].taxel_range();
            self.force_on(module, *index) > 0.0 && taxels.all(|n| !self.force[*index].repaired[n])
        };
        let mut near = first..self.force.len().min(first + FLICKER + 1);
        near.find(is_whole).unwrap_or(first)
    }

    /// The last frame, of those up to this one, in which a contact is what was read: the first frame after a touch may be
    /// held back as a glitch, and the touch is still felt.
    fn last_read(&self, module: usize, last: usize) -> usize {
        let is_read = |index: &usize| {
            let frame = &self.force[*index];
            let mut taxels = self.layout.modules[module].taxel_range();
            taxels.any(|n| frame.contact[n] && !frame.repaired[n])
        };
        let near = last.saturating_sub(FLICKER)..=last;
        near.rev().find(is_read).unwrap_or(last)
    }

    /// The module engaging, the hand at its tightest, the module disengaging. A recording that begins or ends in its
    /// contact does not show that.
    pub(super) fn usual_instants(&self, module: usize) -> Vec<Instant> {
        let name = &self.layout.modules[module].name;
        let contact = self.first_contact(module);
        let engages = |(first, _)| match first {
            0 => ("beginning of the recording".into(), first),
            _ => (format!("{name} engages"), self.first_whole(module, first)),
        };
        let disengages = |(_, last)| match last {
            last if last + 1 == self.force.len() => ("end of the recording".into(), last),
            _ => (format!("{name} disengages"), self.last_read(module, last)),
        };
        let tightest = self.tightest().map(|index| ("tightest".into(), index));
        let known = [contact.map(engages), tightest, contact.map(disengages)];
        let instants = known.into_iter().flatten();
        instants.map(|(name, index)| Instant { name, index }).collect()
    }

    /// The frames nearest to these times, seconds of the recording. A time further than a frame from the first or the
    /// last of them is refused.
    pub(super) fn instants_at(&self, times: &[f64]) -> anyhow::Result<Vec<Instant>> {
        let (first_s, last_s) = (self.time_s(0), self.time_s(self.force.len() - 1));
        let frame_s = (last_s - first_s) / (self.force.len() - 1).max(1) as f64;
        let nearest = |at: &f64| {
            if !(first_s - frame_s..=last_s + frame_s).contains(at) {
                bail!(
                    "--at {at} is no time of {}, whose frames are from {first_s:.2} to {last_s:.2} s",
                    self.name
                );
            }
            let away = |index: &usize| (self.time_s(*index) - at).abs();
            let index = (0..self.force.len()).min_by(|a, b| away(a).total_cmp(&away(b)));
            Ok(Instant {
                name: format!("at {at} s"),
                index: index.unwrap_or(0),
            })
        };
        times.iter().map(nearest).collect()
    }

    /// Every image that a display with this profile is given.
    pub(super) fn images(&self, profile: &Profile) -> anyhow::Result<Vec<TactileImage>> {
        let mut compressor = Compressor::new(profile.clone(), &self.layout)?;
        let mut image = compressor.new_image();
        let mut images = Vec::with_capacity(self.force.len());
        for frame in &self.force {
            compressor.compress(frame, &mut image);
            images.push(image.clone());
        }
        if images.is_empty() {
            bail!(
                "{}: no frame: it ends before its first tick or sweep is complete",
                self.name
            );
        }
        Ok(images)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Forces of one 2 x 1 skin, frame by frame.
    fn take(forces: &[[f64; 2]]) -> Take {
        let force = forces.iter().enumerate().map(|(index, forces)| ForceFrame {
            seq: index as u64,
            t_ns: index as u64 * 100_000_000,
            force: forces.to_vec(),
            contact: forces.iter().map(|force| *force > 0.0).collect(),
            ..ForceFrame::new(2)
        });
        Take {
            name: "test".into(),
            layout: Layout::grid(2, 1).unwrap(),
            profile: Profile::default(),
            unit: None,
            tactile: Vec::new(),
            rest: Vec::new(),
            force: force.collect(),
            out_of_use: OutOfUse::default(),
            conditioning: ConditionConfig::default(),
            begins_ns: 0,
        }
    }

    #[test]
    fn a_fingertip_engages_with_its_first_frame_and_disengages_with_its_last() {
        let quiet = [0.0, 0.0];
        let frames = [
            quiet,
            [3.0, 0.0],
            quiet,
            [9.0, 1.0],
            [2.0, 0.0],
            quiet,
            quiet,
            quiet,
            quiet,
            [7.0, 8.0],
        ];
        let take = take(&frames);
        assert_eq!(take.first_contact(0), Some((1, 4)));
        assert_eq!(take.tightest(), Some(9));
        let instants: Vec<usize> = take.usual_instants(0).iter().map(|i| i.index).collect();
        assert_eq!(instants, [1, 9, 4]);
        let at = take.instants_at(&[0.0, 0.34, 0.95]).unwrap();
        assert_eq!(at.iter().map(|i| i.index).collect::<Vec<_>>(), [0, 3, 9]);
    }

    #[test]
    fn a_fingertip_engages_where_nothing_of_it_is_held_back() {
        let rim = |forces: &[[f64; 2]], held: &[usize]| {
            let mut take = take(forces);
            held.iter()
                .for_each(|index| take.force[*index].repaired[1] = true);
            take.usual_instants(0)[0].index
        };
        let forces = [
            [0.0, 0.0],
            [1.0, 0.0],
            [1.0, 9.0],
            [1.0, 9.0],
            [1.0, 9.0],
            [1.0, 9.0],
        ];
        assert_eq!(rim(&forces, &[]), 1);
        assert_eq!(rim(&forces, &[1]), 2);
        assert_eq!(
            rim(&forces, &[1, 2, 3, 4, 5]),
            1,
            "a taxel that is unwrapped all the time"
        );
    }

    #[test]
    fn a_flicker_before_the_contact_is_not_how_a_fingertip_engages() {
        let mut frames = [[0.0, 0.0]; 20];
        frames[2] = [1.0, 0.0];
        assert_eq!(take(&frames).first_contact(0), Some((2, 2)), "there is no other");
        frames[8..15].fill([9.0, 1.0]);
        assert_eq!(take(&frames).first_contact(0), Some((8, 14)));
    }

    #[test]
    fn a_module_that_flickers_is_not_touched_first_where_another_is_held() {
        let layout = Layout::builtin("allegro-uskin-15").unwrap();
        let frames = vec![[0.0, 0.0]; 20];
        let mut take = Take {
            force: vec![ForceFrame::new(layout.len()); frames.len()],
            layout,
            ..take(&frames)
        };
        let press = |take: &mut Take, module: usize, frames: std::ops::Range<usize>, force: f64| {
            let taxel = take.layout.modules[module].taxel_range().start;
            for frame in &mut take.force[frames] {
                (frame.force[taxel], frame.contact[taxel]) = (force, true);
            }
        };
        for (module, frames, force, wanted) in [
            (4, 2..3, 1.0, 4),
            (6, 2..3, 2.0, 6),
            (6, 5..6, 2.0, 6),
            (1, 12..19, 9.0, 1),
            (3, 9..19, 1.0, 3),
            (5, 9..19, 1.0, 3),
            (7, 9..19, 3.0, 7),
        ] {
            press(&mut take, module, frames, force);
            assert_eq!(take.touched_first(), Some(wanted));
        }
    }

    #[test]
    fn a_time_beside_the_recording_is_refused_with_its_span() {
        let mut take = take(&[[1.0, 0.0]; 3]);
        take.force
            .iter_mut()
            .for_each(|frame| frame.t_ns += 1_000_000_000_000);
        for (at, wanted) in [(999.95, Some(0)), (1000.3, Some(2)), (2.0, None), (1000.4, None)] {
            let instants = take.instants_at(&[1000.0, at]);
            assert_eq!(instants.as_ref().ok().map(|i| i[1].index), wanted, "{at}");
            if let Err(error) = instants {
                let text =
                    format!("--at {at} is no time of test, whose frames are from 1000.00 to 1000.20 s");
                assert_eq!(error.to_string(), text);
            }
        }
    }

    #[test]
    fn a_recording_that_begins_or_ends_in_contact_does_not_show_how_that_came_or_went() {
        let (on, off) = ([1.0, 0.0], [0.0, 0.0]);
        for (frames, wanted) in [
            (
                &[off, on, off][..],
                ["grid engages", "tightest", "grid disengages"],
            ),
            (
                &[off, on, on],
                ["grid engages", "tightest", "end of the recording"],
            ),
            (
                &[on, on, off],
                ["beginning of the recording", "tightest", "grid disengages"],
            ),
        ] {
            let names: Vec<String> = take(frames)
                .usual_instants(0)
                .into_iter()
                .map(|i| i.name)
                .collect();
            assert_eq!(names, wanted);
        }
    }

    #[test]
    fn a_recording_without_contact_has_no_instant() {
        let take = take(&[[0.0, 0.0]; 3]);
        assert_eq!(
            (take.tightest(), take.touched_first(), take.first_contact(0)),
            (None, None, None)
        );
        assert!(take.usual_instants(0).is_empty());
    }
}
