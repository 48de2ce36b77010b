//! An MCAP recording as an input: the frames and images that the daemon made, and the marks in between.

use super::head::Head;
use crate::newest_reading::NewestReading;
use anyhow::bail;
use std::path::Path;
use taxel_hand::{TactileImage, plural, shell_word};
use taxel_record::Recording;
use taxel_recorder::{
    Item, RecordedFrame, RecordingReader, Topic, event_name, read_event, read_image, read_text,
};
use taxel_sequence::Mark;
use taxel_wire::{EventKind, Hello};

/// Topics of others that are named.
const MOST_TOPICS: usize = 8;

/// The tactile frames that the daemon made, counts and joint angles, from the first in which a taxel has a value.
pub fn frames(path: &Path) -> anyhow::Result<Recording> {
    wanted_frames(path, Wanted::Every)
}

/// The same, of those that were made of new readings.
pub fn read_frames(path: &Path) -> anyhow::Result<Recording> {
    wanted_frames(path, Wanted::Read)
}

fn wanted_frames(path: &Path, wanted: Wanted) -> anyhow::Result<Recording> {
    let of_ours = || {
        Ok(match Head::read(path)?.has_can {
            true => format!(
                "no tactile frames of a daemon in it; of CAN traffic `taxel convert {} {}` makes some",
                shell_word(path.display()),
                shell_word(path.with_extension("npz").display())
            ),
            false => "no tactile frames of a daemon and no CAN traffic in it".into(),
        })
    };
    frames_and_wall_marks(path, wanted, || nothing_in(path, of_ours)).map(|(recording, ..)| recording)
}

/// Which frames of a recording are taken.
#[derive(Clone, Copy, PartialEq)]
enum Wanted {
    Every,
    /// Those with a reading that the frame before did not have: another one has the values of the frame before at the time
    /// of a tick, which may be behind a mark that they were read before.
    Read,
}

/// What a recording without frames has instead: the topics of one that no recorder of ours made, whatever they are called, or
/// else `of_ours`.
fn nothing_in(path: &Path, of_ours: impl FnOnce() -> anyhow::Result<String>) -> anyhow::Result<String> {
    let reader = RecordingReader::open(path, &[])?;
    let topics = reader.topics();
    let is_ours = [Topic::Can, Topic::Frames, Topic::Hello].map(|topic| reader.may_hold(topic));
    let first: Vec<&str> = topics.iter().take(MOST_TOPICS).map(String::as_str).collect();
    let more = if topics.len() > MOST_TOPICS { ", .." } else { "" };
    let are_others = !topics.is_empty() && is_ours == [false; 3];
    match are_others {
        true => Ok(format!(
            "no frames and no CAN traffic of `taxel record` in it; there is {}{more}. In Python, mcap_ros2.reader.read_ros2_messages reads \
             what is ROS 2's, mcap.reader.make_reader the rest, and numpy.savez(\"grasp.npz\", counts=.., t_ns=..) makes a \
             recording",
            first.join(", ")
        )),
        false => of_ours(),
    }
}

/// The tactile frames that the daemon made of new readings, and the marks that people and programs made meanwhile; times of
/// both begin with the first frame. What was marked last before it holds when it comes, and is marked there.
pub fn read_frames_and_marks(path: &Path) -> anyhow::Result<(Recording, Vec<Mark>)> {
    frames_and_marks(path, Wanted::Read)
}

/// The marks alone.
pub fn marks(path: &Path) -> anyhow::Result<Vec<Mark>> {
    frames_and_marks(path, Wanted::Every).map(|(_, marks)| marks)
}

fn frames_and_marks(path: &Path, wanted: Wanted) -> anyhow::Result<(Recording, Vec<Mark>)> {
    let of_ours = || Ok("no tactile frames in it, from the first of which marks are counted".into());
    let (recording, mut marks, began_ns) = frames_and_wall_marks(path, wanted, || nothing_in(path, of_ours))?;
    marks.sort_by_key(|mark| mark.t_ns);
    let early = marks.partition_point(|mark| mark.t_ns < began_ns);
    if early > 0 {
        let (name, last) = (recording.name(), &marks[early - 1].text);
        match early {
            1 => remark!(
                "taxel: {name}: the mark {last:?} was made before the first frame; it is taken to be made with it"
            ),
            _ => remark!(
                "taxel: {name}: {early} marks were made before the first frame; the last, {last:?}, is taken to be made \
                 with it, and the others are left out"
            ),
        }
        marks.drain(..early - 1);
    }
    for mark in &mut marks {
        mark.t_ns = mark.t_ns.saturating_sub(began_ns);
    }
    Ok((recording, marks))
}

/// The frames, their times from the first; marks on the wall clock, in the order of the file; and when the first frame was
/// on that clock, nanoseconds. It is an error that no frame is in a file: `nothing` says so where it is whole.
fn frames_and_wall_marks(
    path: &Path,
    wanted: Wanted,
    nothing: impl FnOnce() -> anyhow::Result<String>,
) -> anyhow::Result<(Recording, Vec<Mark>, u64)> {
    let name = path.display().to_string();
    let mut reader = RecordingReader::open(path, &[Topic::Frames, Topic::Events, Topic::Hello])?;
    let (mut counts, mut times_ns, mut joints) = (Vec::new(), Vec::new(), Vec::new());
    let (mut size, mut rest_ns, mut hand) = (None, None, Hand::default());
    let (mut before, mut began_ns, mut marks) = (0, None, Vec::new());
    let (mut newest_reading, mut old) = (NewestReading::default(), 0);
    let may_hold = reader.may_hold(Topic::Frames);
    while may_hold && let Some(item) = reader.next_item()? {
        let Item::Message { topic, wall_ns, data } = item else {
            continue;
        };
        if topic == Topic::Events {
            if let Some(text) = mark_text(data) {
                let text = text.to_owned();
                marks.push(Mark { t_ns: wall_ns, text });
            }
            continue;
        }
        if topic == Topic::Hello {
            hand.described(data, wall_ns, !times_ns.is_empty());
            continue;
        }
        let Some(frame) = RecordedFrame::read(data) else {
            continue;
        };
        // Before a hand speaks there is nothing to begin with; a hand that falls silent goes on in time.
        if times_ns.is_empty() && !frame.has_values() {
            before += 1;
            continue;
        }
        let present = (frame.counts().len(), frame.joints().len());
        // Where the daemon was started anew, or its hand changed, another recording begins.
        let is_before_the_last = times_ns.last().is_some_and(|last| *last > frame.t_ns);
        if *size.get_or_insert(present) != present || is_before_the_last || hand.another().is_some() {
            rest_ns = Some(hand.described_ns.unwrap_or(wall_ns).min(wall_ns));
            break;
        }
        hand.described_ns = None;
        let is_read = newest_reading.advances(frame.t_ns, frame.ages_us());
        if !is_read && wanted == Wanted::Read && began_ns.is_some() {
            old += 1;
            continue;
        }
        began_ns.get_or_insert(wall_ns);
        counts.extend(frame.counts());
        joints.extend(frame.joints());
        times_ns.push(frame.t_ns);
    }
    tell_left_out(&name, &reader);
    if let Some(rest_ns) = rest_ns {
        remark!(
            "taxel: {name}: the daemon began anew after {}{}; read up to there{}",
            plural(times_ns.len(), "frame"),
            hand.with_another(),
            rest(&name, rest_ns)
        );
    }
    let (Some((taxels, _)), Some(began_ns)) = (size, began_ns) else {
        match (before, reader.left_out().is_empty()) {
            (0, true) => bail!("{name}: {}", nothing()?),
            (0, false) => bail!("{name}: nothing of it could be read"),
            _ => bail!("{name}: {}", silent(before)),
        }
    };
    tell_frames_before(&name, before);
    if old > 0 {
        let frames = if old == 1 { "frame is" } else { "frames are" };
        remark!(
            "taxel: {name}: {old} {frames} left out, in which no taxel has a newer reading than in the one before"
        );
    }
    if let Some(first_ns) = times_ns.first().copied() {
        times_ns.iter_mut().for_each(|t_ns| *t_ns -= first_ns);
    }
    let mut recording = Recording::of_counts(name, taxels, counts, times_ns, joints)?;
    if let Some(hello) = &hand.first {
        recording = recording.with_layout(&hello.layout);
    }
    Ok((recording, marks, began_ns))
}

/// Images of one shape.
#[derive(Debug)]
pub struct ShownImages {
    /// One at least.
    pub images: Vec<TactileImage>,
    /// Levels of their display, or of the image that has most.
    pub levels: u16,
    /// Actuators of it.
    pub actuators: u16,
}

/// The images that the daemon made, as they were shown.
pub fn images(path: &Path) -> anyhow::Result<ShownImages> {
    let name = path.display().to_string();
    let mut reader = RecordingReader::open(path, &[Topic::Images, Topic::Hello])?;
    let mut images: Vec<TactileImage> = Vec::new();
    // Levels and actuators: of the display, so that images of one display have one shape, and of every image.
    let (mut display, mut most, mut hand) = ([0, 0], [0, 0], Hand::default());
    while let Some(item) = reader.next_item()? {
        let Item::Message { topic, data, wall_ns } = item else {
            continue;
        };
        if topic == Topic::Hello {
            let newest = hand.described(data, wall_ns, !images.is_empty());
            display = newest.map_or(display, |hello| [hello.profile.levels, hello.profile.actuators]);
            continue;
        }
        let Some(image) = read_image(data) else {
            continue;
        };
        if hand.another().is_some() {
            remark!(
                "taxel: {name}: the daemon began anew after {}{}; read up to there{}",
                plural(images.len(), "image"),
                hand.with_another(),
                rest(&name, hand.described_ns.unwrap_or(wall_ns))
            );
            break;
        }
        let shape = |image: &TactileImage| (image.width, image.height, image.joints.len());
        if let Some(first) = images.first().filter(|first| shape(first) != shape(&image)) {
            remark!(
                "taxel: {name}: images of {} x {} and {} after {} of {} x {} and {}; read up to there{}",
                image.height,
                image.width,
                plural(image.joints.len(), "joint"),
                images.len(),
                first.height,
                first.width,
                first.joints.len(),
                rest(&name, wall_ns)
            );
            break;
        }
        let has = [image.levels.len(), image.actuators.len()].map(|count| count as u16);
        for ((most, has), display) in most.iter_mut().zip(has).zip(display) {
            *most = has.max(display).max(*most);
        }
        hand.described_ns = None;
        images.push(image);
    }
    tell_left_out(&name, &reader);
    if images.is_empty() {
        bail!("{name}: no image in it; `taxel compress` makes images of CAN traffic and frames");
    }
    let [levels, actuators] = most;
    Ok(ShownImages {
        images,
        levels,
        actuators,
    })
}

/// How many marks, frames and images there are among these topics of a recording, in words such as `1 mark and 449
/// frames`; none where there are none.
pub fn counted(path: &Path, topics: &[Topic]) -> anyhow::Result<Option<String>> {
    let mut reader = RecordingReader::open(path, topics)?;
    if !topics.iter().any(|topic| reader.may_hold(*topic)) {
        return Ok(None);
    }
    let [mut marks, mut frames, mut images] = [0; 3];
    while let Some(item) = reader.next_item()? {
        match item {
            Item::Message {
                topic: Topic::Frames, ..
            } => frames += 1,
            Item::Message {
                topic: Topic::Images, ..
            } => images += 1,
            Item::Message { data, .. } => marks += usize::from(mark_text(data).is_some()),
            Item::Attached(_) | Item::Damaged => {}
        }
    }
    let counted = [(marks, "mark"), (frames, "frame"), (images, "image")];
    let mut parts: Vec<String> = counted
        .into_iter()
        .filter(|(count, _)| *count > 0)
        .map(|(count, what)| plural(count, what))
        .collect();
    let last = parts.pop();
    Ok(last.map(|last| match parts.is_empty() {
        true => last,
        false => format!("{} and {last}", parts.join(", ")),
    }))
}

/// The hand of a recording, as the daemon described it (HELLO).
#[derive(Default)]
struct Hand {
    first: Option<Hello>,
    newest: Option<Hello>,
    /// When the newest description was, where nothing of the hand was taken since: wall clock, nanoseconds.
    described_ns: Option<u64>,
}

impl Hand {
    /// Takes a description; what was taken before is of the first one. One that is damaged is none.
    fn described(&mut self, data: &[u8], wall_ns: u64, is_taken: bool) -> Option<&Hello> {
        let hello = Hello::parse(read_text(data)?.as_bytes()).ok()?;
        if self.first.is_none() || !is_taken {
            self.first = Some(hello.clone());
        }
        self.described_ns = Some(wall_ns);
        Some(self.newest.insert(hello))
    }

    /// The layout of the newest description, where that is of another hand than the first.
    fn another(&self) -> Option<&str> {
        let (first, newest) = (self.first.as_ref()?, self.newest.as_ref()?);
        (!newest.is_of_one_hand_with(first)).then_some(&newest.layout)
    }

    fn with_another(&self) -> String {
        self.another()
            .map_or(String::new(), |layout| format!(", with another hand, {layout}"))
    }
}

/// The text of a mark, where an event is one.
fn mark_text(data: &[u8]) -> Option<&str> {
    let (kind, text) = read_event(data)?;
    (kind == event_name(EventKind::Mark)).then_some(text)
}

/// How what is behind this time is read.
pub(crate) fn rest(name: &str, from_ns: u64) -> String {
    format!(
        "; `mcap filter {} -o rest.mcap --start {from_ns} --output-compression lz4` takes out the rest",
        shell_word(name)
    )
}

/// That there are frames, and nothing in them.
pub fn silent(frames: u64) -> String {
    let of = if frames == 1 {
        "its only frame"
    } else {
        &format!("any of its {frames} frames")
    };
    format!("no taxel has a value in {of}: the hand was silent")
}

/// Says how many frames of a recording are left out since nothing has begun: those before the first in which a taxel has a
/// value.
pub fn tell_frames_before(name: &str, before: u64) {
    if before > 0 {
        let frames = if before == 1 { "frame is" } else { "frames are" };
        remark!("taxel: {name}: {before} {frames} left out, before the first in which a taxel has a value");
    }
}

fn tell_left_out(name: &str, reader: &RecordingReader) {
    for sentence in reader.left_out() {
        remark!("taxel: {name}: {sentence}");
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs::File;
    use taxel_hand::{ForceFrame, Freshness, TactileFrame};
    use taxel_recorder::{Entry, Preamble, RecordingWriter, event_message, frame_message};
    use taxel_wire::{Header, RawView, encode_raw_payload};

    const MS: u64 = 1_000_000;
    /// From the daemon's clock to the wall clock.
    const WALL_NS: u64 = 1_000_000 * MS;

    #[test]
    fn a_touch_has_the_frames_of_new_readings_alone() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("hand.mcap");
        let file = File::create(&path).unwrap();
        let mut writer = RecordingWriter::begin(file, &Preamble::default(), 0).unwrap();
        let mut put = |topic, t_ns: u64, data| {
            let wall_ns = t_ns + WALL_NS;
            writer.put(&Entry { topic, wall_ns, data }).unwrap();
        };
        // Sweeps each 50 ms, from 10 ms on. A tick at 55 ms finds none behind the mark, one at 210 ms while the hand is silent.
        let mut payload = Vec::new();
        for (seq, t_ms, age_ms) in [
            (0, 10, 0),
            (1, 55, 45),
            (2, 60, 0),
            (3, 110, 0),
            (4, 210, 100),
            (5, 260, 0),
        ] {
            if seq == 1 {
                let mark = event_message(event_name(EventKind::Mark), "touch 0", 50 * MS + WALL_NS);
                put(Topic::Events, 50 * MS, mark);
            }
            let (mut tactile, force) = (TactileFrame::new(2), ForceFrame::new(2));
            (tactile.seq, tactile.t_ns) = (seq, t_ms * MS);
            tactile.freshness.fill(Freshness::Fresh);
            tactile.age_ns.fill(age_ms * MS);
            tactile.age_ns[1] += 5 * MS;
            encode_raw_payload(&tactile, &force, None, &mut payload).unwrap();
            let header = Header {
                t_ns: tactile.t_ns,
                ..Header::of_frame(&tactile, &force, payload.len())
            };
            let data = frame_message(&header, &RawView::decode(&payload).unwrap());
            put(Topic::Frames, tactile.t_ns, data);
        }
        writer.finish().unwrap();
        let times = |recording: &Recording| -> Vec<u64> {
            (0..recording.len()).map(|n| recording.t_ns(n) / MS).collect()
        };
        let (recording, marks) = read_frames_and_marks(&path).unwrap();
        assert_eq!(times(&recording), [0, 50, 100, 250]);
        assert_eq!((marks.len(), marks[0].t_ns), (1, 40 * MS));
        assert_eq!(super::marks(&path).unwrap(), marks);
        assert_eq!(times(&read_frames(&path).unwrap()), [0, 50, 100, 250]);
        assert_eq!(times(&frames(&path).unwrap()), [0, 45, 50, 100, 200, 250]);
    }
}
