//! Recorded counts as tactile frames that are whole already: the recording says which values are of one frame.

use super::fitted::recorded_taxels;
use super::sweep::Sweeps;
use taxel_hand::{Freshness, TactileFrame};
use taxel_record::Recording;
use taxel_skin::{Decoder, Layout, Readings};

/// The frames of a recording, one after the other.
pub(crate) struct WholeFrames<'a> {
    recording: &'a Recording,
    skin: Skin<'a>,
    next: usize,
}

/// Where the values of a frame come from.
enum Skin<'a> {
    /// The file itself, where boards have no CAN frame for each taxel.
    Bare {
        /// For each taxel its number in the recording.
        recorded: Vec<usize>,
        /// When each frame is shown.
        shown_ns: &'a [u64],
    },
    /// What boards would have sent.
    Boards {
        sweeps: &'a Sweeps<'a>,
        decoders: Vec<Decoder>,
        readings: Box<Readings>,
    },
}

impl<'a> WholeFrames<'a> {
    /// Those of a skin whose counts no CAN frames carry one by one, at these times. Refuses a recording that does
    /// not fit it; with `tile`, the recording is repeated on every module.
    pub(crate) fn bare(
        recording: &'a Recording,
        layout: &Layout,
        tile: bool,
        shown_ns: &'a [u64],
    ) -> anyhow::Result<Self> {
        Ok(Self {
            recording,
            skin: Skin::Bare {
                recorded: recorded_taxels(recording, layout, tile)?,
                shown_ns,
            },
            next: 0,
        })
    }

    /// Those of a hand with boards: each is what its boards send in one sweep and has the time at which the sweep ends,
    /// whatever is missing in it.
    pub(crate) fn of_boards(sweeps: &'a Sweeps<'a>) -> Self {
        let layout = sweeps.layout();
        Self {
            recording: sweeps.recording(),
            skin: Skin::Boards {
                sweeps,
                decoders: (0..layout.buses.len())
                    .map(|bus| Decoder::new(layout, bus as u8))
                    .collect(),
                readings: Box::default(),
            },
            next: 0,
        }
    }

    /// How many frames are recorded.
    pub(crate) fn len(&self) -> u64 {
        self.recording.len() as u64
    }

    /// Makes the next frame; false at the end. A frame that has the time of the one before is passed over, as a board
    /// sends nothing twice at once.
    pub(crate) fn fill(&mut self, frame: &mut TactileFrame) -> bool {
        let recording = self.recording;
        while self.next > 0
            && self.next < recording.len()
            && recording.t_ns(self.next) == recording.t_ns(self.next - 1)
        {
            self.next += 1;
        }
        let Some(counts) = recording.counts(self.next) else {
            return false;
        };
        frame.counts.fill([0; 3]);
        frame.freshness.fill(Freshness::Missing);
        frame.age_ns.fill(u64::MAX);
        match &mut self.skin {
            Skin::Bare { recorded, shown_ns } => {
                frame.t_ns = shown_ns[self.next];
                for (taxel, recorded) in recorded.iter().enumerate() {
                    if let Some(counts) = counts[*recorded] {
                        (frame.counts[taxel], frame.freshness[taxel], frame.age_ns[taxel]) =
                            (counts, Freshness::Fresh, 0);
                    }
                }
            }
            Skin::Boards {
                sweeps,
                decoders,
                readings,
            } => {
                frame.t_ns = sweeps.end_ns(self.next);
                for (bus, received) in sweeps.sweep(self.next) {
                    decoders[usize::from(bus)].decode_at(received.t_ns, &received.frame, readings);
                    for reading in readings.iter() {
                        let taxel = usize::from(reading.taxel);
                        (frame.counts[taxel], frame.status[taxel]) = (reading.counts, reading.status);
                        (frame.freshness[taxel], frame.age_ns[taxel]) =
                            (Freshness::Fresh, frame.t_ns - received.t_ns);
                    }
                }
            }
        }
        let joints = recording.joints(self.next);
        frame.joints.clear();
        frame.joints.extend_from_slice(joints);
        frame.joint_age_ns.clear();
        frame.joint_age_ns.resize(joints.len(), 0);
        self.next += 1;
        true
    }
}
