//! What the beginning of an MCAP recording tells: whose hand it is, and how its daemon was configured.

use anyhow::bail;
use std::path::{Path, PathBuf};
use taxel_config::Config;
use taxel_hand::Geometry;
use taxel_recorder::{Attached, Item, RecordingReader, Topic, numbered_beside, parts, read_text};
use taxel_skin::{Layout, LayoutError};
use taxel_wire::Hello;

/// The daemon's configuration in a recording.
pub const CONFIG: &str = "taxeld.toml";
/// The hand's layout in a recording, where it is no built-in one.
pub const LAYOUT: &str = "layout.toml";

/// How much of a recording is looked at for what it is, nanoseconds.
pub(crate) const HEAD_NS: u64 = 10_000_000_000;

/// What the first seconds of a recording tell.
#[derive(Debug, Default, Clone)]
pub struct Head {
    path: PathBuf,
    config: Option<String>,
    layout: Option<String>,
    hello: Option<Hello>,
    /// Whether a file that is attached to it is damaged.
    is_damaged: bool,
    /// Whether a daemon's description may have been in what could not be read of its beginning.
    is_undescribed: bool,
    /// Whether there is CAN traffic in it.
    pub has_can: bool,
    /// What is left out of it, where that is all of its CAN traffic, and no frame was read either.
    pub unread_can: Option<String>,
}

impl Head {
    /// Looks at the beginning of a recording.
    pub fn read(path: &Path) -> anyhow::Result<Self> {
        let mut head = Self {
            path: path.into(),
            ..Self::default()
        };
        if let [first, .., last] = &parts(path)[..] {
            let (first, last) = (first.display(), last.display());
            remark!("taxel: {}: read of its parts, {first} to {last}", path.display());
        }
        if let [first, others @ ..] = &numbered_beside(path)[..] {
            let to_last = others
                .last()
                .map_or(String::new(), |last| format!(" to {}", last.display()));
            remark!(
                "taxel: {}: read alone; a recorder goes on in {}{to_last} where its daemon runs with another configuration or reads \
                 other buses, which is read by its own name",
                path.display(),
                first.display()
            );
        }
        let mut reader = RecordingReader::open(path, &[Topic::Can, Topic::Hello, Topic::Frames])?;
        let (mut began_ns, mut has_frames) = (None, false);
        let may_describe = reader.may_hold(Topic::Hello);
        while let Some(item) = reader.next_item()? {
            match item {
                Item::Attached(attached) => head.take(attached),
                Item::Damaged => head.is_damaged = true,
                Item::Message { topic, wall_ns, data } => {
                    match topic {
                        Topic::Can => head.has_can = true,
                        // One behind frames may be that of another hand, whose frames follow.
                        Topic::Hello if head.hello.is_none() || !has_frames => {
                            let hello = read_text(data).and_then(|text| Hello::parse(text.as_bytes()).ok());
                            // One that is damaged does not undo the one before.
                            head.hello = hello.or(head.hello);
                        }
                        _ => has_frames |= topic == Topic::Frames,
                    }
                    let is_described = head.hello.is_some() || (head.config.is_some() && !may_describe);
                    let is_known = head.has_can && is_described;
                    if is_known || wall_ns.saturating_sub(*began_ns.get_or_insert(wall_ns)) > HEAD_NS {
                        break;
                    }
                }
            }
        }
        head.is_undescribed =
            head.hello.is_none() && !reader.left_out().is_empty() && reader.may_hold(Topic::Hello);
        if !head.has_can && !has_frames && reader.may_hold(Topic::Can) {
            head.unread_can = reader.left_out().into_iter().next();
        }
        Ok(head)
    }

    fn take(&mut self, attached: Attached) {
        let text = String::from_utf8(attached.data).ok();
        match attached.name.as_str() {
            CONFIG => self.config = text,
            LAYOUT => self.layout = text,
            _ => {}
        }
    }

    /// The configuration that it was recorded with, where it is in there. It is left out, and that is told, where it is
    /// damaged, and where it is of another hand than the daemon described.
    pub fn config(&self) -> anyhow::Result<Option<Config>> {
        let path = self.path.display();
        let parsed = self.config.as_ref().map(|text| {
            Config::parse_for(text, &format!("{path}: {CONFIG} in it"), &|name| {
                self.hand_of(name)
            })
        });
        let config = match parsed.transpose() {
            Ok(None) | Err(_) if self.is_damaged => {
                remark!("taxel: {path}: the configuration in it is damaged and left out; --config gives one");
                return Ok(None);
            }
            parsed => parsed.map_err(|error| anyhow::anyhow!("{error:#}; --config gives another"))?,
        };
        let (Some(hand), Some(hello)) = (config.as_ref().map(|config| &config.layout), &self.hello) else {
            return Ok(config);
        };
        if is_of(hello, hand) {
            return Ok(config);
        }
        let read = match hello.layout == hand.name {
            true => "one of that name with other modules or places".into(),
            false => format!("hand {}", hello.layout),
        };
        remark!(
            "taxel: {path}: the configuration in it is of hand {}, and the daemon read {read}; it is left out, and \
             --config gives another",
            hand.name
        );
        Ok(None)
    }

    /// The hand that the configuration in it names.
    fn hand_of(&self, name: &str) -> Result<Layout, LayoutError> {
        match &self.layout {
            Some(text) => Layout::parse(text, LAYOUT),
            None if name.starts_with("grid:") => Layout::resolve(name),
            // A file of that name that is here now is not that of the recording.
            None => Layout::builtin(name).ok_or_else(|| LayoutError::Unknown {
                name: name.into(),
                builtin: Layout::builtin_names().collect::<Vec<_>>().join(", "),
            }),
        }
    }

    /// The recording.
    pub(crate) fn path(&self) -> &Path {
        &self.path
    }

    /// What the daemon said of itself and the hand (HELLO), where it is there.
    pub(crate) fn hello(&self) -> Option<&Hello> {
        self.hello.as_ref()
    }

    /// The hand that it was recorded on: that of the configuration in it, or else the built-in one that the daemon's
    /// description (HELLO) names and describes; none where no daemon described any.
    ///
    /// # Errors
    /// Where the daemon read a hand that is not here, so that nothing is taken for another hand.
    pub fn layout(&self) -> anyhow::Result<Option<Layout>> {
        if let Some(config) = self.config()? {
            return Ok(Some(config.layout));
        }
        let Some(hello) = &self.hello else {
            if self.is_undescribed {
                remark!(
                    "taxel: {}: whose hand it is stood in what is damaged or torn off; --layout names it, or --config",
                    self.path.display()
                );
            }
            return Ok(None);
        };
        match named(hello) {
            Some(known) if is_of(hello, &known) => Ok(Some(known)),
            known => bail!(
                "{}: recorded on hand {} of {} taxels, which {}; name its layout with --layout, or its configuration \
                 with --config",
                self.path.display(),
                hello.layout,
                hello.taxels.len(),
                match known {
                    Some(_) => "has other modules or places than the built-in hand of that name",
                    None => "is not built in",
                }
            ),
        }
    }
}

/// The hand of the name in a daemon's description, where a name is enough to have it.
fn named(hello: &Hello) -> Option<Layout> {
    let grid = || Layout::grid(hello.width, hello.height).ok();
    let known = Layout::builtin(&hello.layout).or_else(grid);
    known.filter(|known| known.name == hello.layout)
}

/// Whether a recording of the hand that a daemon describes is read without a layout file.
pub fn is_here(hello: &Hello) -> bool {
    named(hello).is_some_and(|known| is_of(hello, &known))
}

/// Whether a daemon's description is that of this hand: of the same name, modules and taxels, each at its pixel and place.
pub fn is_of(hello: &Hello, hand: &Geometry) -> bool {
    hello.geometry().is_ok_and(|described| described == *hand)
}

#[cfg(test)]
mod tests {
    use super::*;
    use taxel_hand::Profile;
    use taxel_wire::{Clock, HelloRate};

    #[test]
    fn every_built_in_hand_is_known_by_its_description_to_the_last_digit() {
        let builtin = Layout::builtin_names().map(|name| Layout::builtin(name).unwrap());
        let grids = [[1, 1], [80, 80], [37, 201]].map(|[width, height]| Layout::grid(width, height).unwrap());
        for hand in builtin.chain(grids) {
            let rate = HelloRate {
                mode: "sweep".into(),
                hz: None,
            };
            let hello = Hello::new("taxeld", &hand, &Profile::default(), rate, Clock::Monotonic);
            let read = Hello::parse(&hello.to_json()).unwrap();
            assert!(is_here(&read), "{}", hand.name);
        }
    }
}
