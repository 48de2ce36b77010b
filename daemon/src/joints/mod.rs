//! Joint angles: where they come from, on their way into each tactile frame, in the status, and in the log.
//!
//! Servos are read by a thread of their own ([`taxel_joints::JointReader`]); the frames of an Allegro hand come over CAN
//! and through the pipeline like those of the skin, in whose time they are.

mod hand;
mod status;
mod tell;
#[cfg(test)]
pub(crate) mod test_views;
mod tick;
mod write;

pub(crate) use hand::OwnHand;
pub(crate) use status::{JointsView, status};
pub(crate) use tell::{Told, Weight};
pub(crate) use tick::{JointFeed, JointsSnapshot};
pub(crate) use write::{ServoRequest, write};

use crate::config::Config;
use taxel_can::SourceAddress;
use taxel_joints::{JointSource, JointsConfig, JointsConfigError, overlapping_ids};
use taxel_skin::Layout;

/// Why joints cannot be read as the configuration has it.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum JointsError {
    /// The table itself makes no sense.
    #[error(transparent)]
    Config(#[from] JointsConfigError),
    /// Servos are read now; a recording was made at another time.
    #[error(
        "joints: the servos on {device} would be read now, and {source_address} is a recording of another time; leave [joints] out, or take live buses"
    )]
    Recording {
        /// The serial device.
        device: String,
        /// The recording.
        source_address: String,
    },
    /// Hand and skin would be mistaken for each other.
    #[error(
        "joints: the Allegro hand and the skin share {address} (bus {bus}), where both use the CAN ids {}; give the hand a bus of its own, or the boards other addresses",
        hex(ids)
    )]
    SharedIds {
        /// The CAN source.
        address: String,
        /// Name of the bus in the layout.
        bus: String,
        /// The identifiers, in order.
        ids: Vec<u16>,
    },
    /// A scene has no hand.
    #[error(
        "joints: {0} is a scene, in which no Allegro hand sends; take the bus of a hand, or servos (`taxel sim --servos`)"
    )]
    Scene(String),
}

fn hex(ids: &[u16]) -> String {
    let ids: Vec<String> = ids.iter().map(|id| format!("{id:03X}")).collect();
    ids.join(", ")
}

/// The bus that an Allegro hand is on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct HandBus {
    /// Its number: that of a bus of the skin, or, for a bus of its own, the one after the last of these.
    pub index: u8,
    /// Whether it is one of the skin's.
    pub shared: bool,
}

/// The bus of the configuration's Allegro hand; `None` where there is none.
pub fn hand_bus(config: &Config) -> Option<HandBus> {
    let JointSource::Allegro { bus } = &config.joints.as_ref()?.source else {
        return None;
    };
    let shared = config.sources.iter().position(|source| source == bus);
    Some(HandBus {
        index: shared.unwrap_or(config.layout.buses.len()) as u8,
        shared: shared.is_some(),
    })
}

/// Refuses joints that make no sense, by themselves or with this skin on these buses.
pub(crate) fn check(
    joints: &JointsConfig,
    layout: &Layout,
    sources: &[SourceAddress],
) -> Result<(), JointsError> {
    joints.check()?;
    match &joints.source {
        JointSource::Dynamixel { path } => {
            let recording = |source: &&SourceAddress| matches!(source, SourceAddress::Log { .. });
            match sources.iter().find(recording) {
                Some(recording) => Err(JointsError::Recording {
                    device: path.display().to_string(),
                    source_address: recording.to_string(),
                }),
                None => Ok(()),
            }
        }
        JointSource::Allegro { bus: address } => {
            if let SourceAddress::Sim { .. } = address {
                return Err(JointsError::Scene(address.to_string()));
            }
            let Some(hand) = &joints.allegro else {
                return Err(JointsConfigError::NoAllegro.into());
            };
            let shared = (sources.iter().enumerate()).filter(|(_, source)| *source == address);
            for (bus, _) in shared {
                let ids = overlapping_ids(layout, bus as u8, hand);
                if !ids.is_empty() {
                    return Err(JointsError::SharedIds {
                        address: address.to_string(),
                        bus: layout.buses.get(bus).cloned().unwrap_or_default(),
                        ids,
                    });
                }
            }
            Ok(())
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    fn parse(bus: &str, joints: &str) -> Result<Config, String> {
        let text = format!("layout = \"allegro-uskin-15\"\n\n{bus}\n{joints}");
        Config::parse(&text, Path::new("taxeld.toml")).map_err(|e| e.to_string())
    }

    const BUSES: &str = "[[bus]]\nsource = \"can:can0\"\n[[bus]]\nsource = \"can:can1\"\n";
    const SERVOS: &str =
        "[joints]\nsource = \"dynamixel:/dev/ttyUSB0\"\n[[joints.servo]]\nid = 1\nname = \"a\"\n";

    #[test]
    fn servos_are_read_beside_live_buses_and_not_beside_a_recording() {
        let config = parse(BUSES, SERVOS).unwrap();
        assert_eq!(config.joints.as_ref().unwrap().joint_names(), ["a"]);
        assert_eq!(hand_bus(&config), None);
        let error = parse(&BUSES.replace("can:can1", "log:a.log"), SERVOS).unwrap_err();
        for part in [
            "taxeld.toml:8:",
            "/dev/ttyUSB0",
            "log:a.log",
            "leave [joints] out",
        ] {
            assert!(error.contains(part), "{part}: {error}");
        }
    }

    #[test]
    fn a_wrong_joints_table_is_refused_with_its_line() {
        for (joints, parts) in [
            (SERVOS.replace("name", "nmae"), ["taxeld.toml:12:", "nmae"]),
            (SERVOS.replace("id = 1", "id = 253"), ["taxeld.toml:8:", "253"]),
            (
                SERVOS.replace("dynamixel:/dev/ttyUSB0", "serial"),
                ["taxeld.toml:9:", "dynamixel:DEVICE"],
            ),
            (
                "[joints]\nsource = \"allegro:can2\"\n".into(),
                ["taxeld.toml:8:", "version"],
            ),
            (
                "[joints]\nsource = \"allegro:sim:tap\"\nallegro.version = 4\n".into(),
                ["taxeld.toml:8:", "is a scene"],
            ),
        ] {
            let error = parse(BUSES, &joints).unwrap_err();
            for part in parts {
                assert!(error.contains(part), "{part}: {error}");
            }
        }
    }

    #[test]
    fn a_hand_has_a_bus_of_its_own_or_shares_one_whose_ids_are_not_its_own() {
        let hand = |bus: &str, version| {
            format!("[joints]\nsource = \"allegro:{bus}\"\nallegro.version = {version}\n")
        };
        let own = parse(BUSES, &hand("can2", 4)).unwrap();
        let bus = HandBus {
            index: 2,
            shared: false,
        };
        assert_eq!(hand_bus(&own), Some(bus));

        let error = parse(BUSES, &hand("can0", 4)).unwrap_err();
        for part in ["taxeld.toml:8:", "can:can0", "204", "a bus of its own"] {
            assert!(error.contains(part), "{part}: {error}");
        }

        // 710 to 71F and 201 are no identifiers of the hand.
        let text = "layout = \"uskin-module\"\n[[bus]]\nsource = \"can:can0\"\n";
        let shared = Config::parse(&format!("{text}{}", hand("can0", 3)), Path::new("taxeld.toml"));
        let Ok(shared) = shared else {
            panic!("{}", shared.unwrap_err());
        };
        let bus = HandBus {
            index: 0,
            shared: true,
        };
        assert_eq!(hand_bus(&shared), Some(bus));
    }
}
