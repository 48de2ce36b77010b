//! How a CAN source is named on a command line and in the configuration file.

use std::fmt;
use std::net::{IpAddr, Ipv4Addr, Ipv6Addr};
use std::path::PathBuf;
use std::str::FromStr;
use taxel_hand::shell_word;

/// The IPv4 group that python-can's `udp_multicast` interface calls its default for IPv4.
pub(crate) const DEFAULT_UDP_GROUP: Ipv4Addr = Ipv4Addr::new(239, 74, 163, 2);
/// The UDP port of python-can's `udp_multicast` interface.
pub(crate) const DEFAULT_UDP_PORT: u16 = 43113;
/// The hop limit (IPv4: TTL) of python-can's `udp_multicast` interface: the local network only.
pub(crate) const DEFAULT_UDP_HOP_LIMIT: u8 = 1;

/// Where CAN frames come from, as text: `can:vcan0`, `udp:239.74.163.2:43113`, `log:FILE`, `sim:SCENE`; and the frames of
/// a pressure array, `pressure:PATH`.
///
/// `Display` writes the form that `FromStr` reads back to the same value.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub enum SourceAddress {
    /// A SocketCAN interface: `can:can0`.
    Can {
        /// The interface's name, 1 to 15 bytes. It need not exist yet.
        interface: String,
    },
    /// python-can's `udp_multicast`: `udp:` alone for the default group, `udp:GROUP`, `udp::PORT`,
    /// `udp:GROUP:PORT`, an IPv6 group in brackets, then optionally `?interface=NAME&hops=N`.
    Udp {
        /// The multicast group.
        group: IpAddr,
        /// The UDP port, not 0.
        port: u16,
        /// The network interface to join on; `None` leaves the choice to the routing table.
        interface: Option<String>,
        /// Hop limit (IPv4: TTL) of sent datagrams; 0 keeps them on this machine.
        hop_limit: u8,
    },
    /// A candump recording: `log:FILE`, or `log:FILE?interface=can0` for one bus of it.
    Log {
        /// The file.
        path: PathBuf,
        /// Only frames that were recorded on this interface; `None` takes that of the bus's name, or the only one.
        interface: Option<String>,
    },
    /// A simulated scene: `sim:grasp`. What a scene's name means is the simulator's business.
    Sim {
        /// The scene's name or file.
        scene: String,
    },
    /// The Unix socket to which a program sends the frames of a pressure array: `pressure:/run/taxeld/touch.sock`.
    Pressure {
        /// The socket's path.
        path: PathBuf,
    },
}

/// Why a text names no CAN source.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error(
    "`{text}` is not a CAN source: {problem}. Write can:INTERFACE, udp:GROUP:PORT \
     (udp: alone is {DEFAULT_UDP_GROUP}:{DEFAULT_UDP_PORT}; an IPv6 group goes in brackets), \
     log:FILE, log:FILE?interface=can0, sim:SCENE, or pressure:SOCKET"
)]
pub struct AddressError {
    /// The text given.
    pub text: String,
    /// What is wrong with it.
    pub problem: String,
}

const UNKNOWN_SCHEME: &str = "it starts with none of can:, udp:, log:, sim:, pressure:";
/// What the name of an interface is.
pub(crate) const INTERFACE_NAME: &str = "1 to 15 bytes without blanks, `/` or `:`";

/// Whether the kernel would take `name` as a network interface's name.
pub(crate) fn is_interface_name(name: &str) -> bool {
    (1..=15).contains(&name.len())
        && name != "."
        && name != ".."
        && !name
            .bytes()
            .any(|b| b == b'/' || b == b':' || b == 0 || b.is_ascii_whitespace())
}

impl FromStr for SourceAddress {
    type Err = AddressError;

    fn from_str(text: &str) -> Result<Self, AddressError> {
        parse(text).map_err(|problem| AddressError {
            text: text.to_owned(),
            problem,
        })
    }
}

fn parse(text: &str) -> Result<SourceAddress, String> {
    let (scheme, rest) = text.split_once(':').ok_or_else(|| unknown_scheme("", text))?;
    match scheme {
        "can" => match rest {
            "" => Err("the interface is missing".into()),
            name => Ok(SourceAddress::Can {
                interface: interface(name)?,
            }),
        },
        "udp" => parse_udp(rest),
        "log" => parse_log(rest),
        "sim" => match rest {
            "" => Err("the scene is missing".into()),
            scene => Ok(SourceAddress::Sim {
                scene: scene.to_owned(),
            }),
        },
        "pressure" => match rest {
            "" => Err("the socket's path is missing".into()),
            path => Ok(SourceAddress::Pressure { path: path.into() }),
        },
        _ => Err(unknown_scheme(scheme, rest)),
    }
}

/// What is wrong with other beginnings than ours, as other programs have them for what the kernel makes an interface of.
fn unknown_scheme(scheme: &str, rest: &str) -> String {
    let is_numbered = |prefix| {
        let number = rest.strip_prefix(prefix);
        number.is_some_and(|n| !n.is_empty() && n.bytes().all(|b| b.is_ascii_digit()))
    };
    let is_interface = match scheme {
        "" => ["can", "vcan", "slcan"].into_iter().any(is_numbered),
        _ => is_interface_name(rest),
    };
    let advice = match scheme {
        "" | "vcan" | "socketcan" if is_interface => format!("; the kernel's interface {rest} is can:{rest}"),
        "slcan" if is_interface => {
            format!("; slcand makes an interface of a serial adapter, which is can:{rest}")
        }
        "slcan" => format!(
            "; slcand makes an interface of a serial adapter: `slcand -o -s8 {} can0` (1 Mbit/s) and `ip link set \
             can0 up`, which is can:can0",
            // With a speed behind it in python-can's words.
            shell_word(rest.split('@').next().unwrap_or(rest))
        ),
        _ => String::new(),
    };
    format!("{UNKNOWN_SCHEME}{advice}")
}

fn interface(name: &str) -> Result<String, String> {
    if is_interface_name(name) {
        Ok(name.to_owned())
    } else {
        Err(format!("`{name}` is no interface name ({INTERFACE_NAME})"))
    }
}

fn parse_udp(rest: &str) -> Result<SourceAddress, String> {
    let (place, options) = match rest.split_once('?') {
        Some((place, options)) => (place, options),
        None => (rest, ""),
    };
    let (group, port) = parse_group_and_port(place)?;
    let mut interface_name = None;
    let mut hop_limit = DEFAULT_UDP_HOP_LIMIT;
    for option in options.split('&').filter(|o| !o.is_empty()) {
        match option.split_once('=') {
            Some(("interface", name)) => interface_name = Some(interface(name)?),
            Some(("hops", n)) => {
                hop_limit = n
                    .parse()
                    .map_err(|_| format!("`{n}` is no hop limit (0 to 255)"))?;
            }
            _ => {
                return Err(format!(
                    "`{option}` is no option of udp: (it has interface=NAME and hops=N)"
                ));
            }
        }
    }
    Ok(SourceAddress::Udp {
        group,
        port,
        interface: interface_name,
        hop_limit,
    })
}

fn parse_group_and_port(place: &str) -> Result<(IpAddr, u16), String> {
    let no_group = |text: &str| {
        format!("`{text}` is no IP address; an IPv6 address goes in brackets, such as [ff15::1]")
    };
    let no_port = |text: &str| format!("`{text}` is no UDP port (1 to 65535)");
    let (group, port) = if let Some(bracketed) = place.strip_prefix('[') {
        let (inside, after) = bracketed.split_once(']').ok_or_else(|| no_group(place))?;
        let group = inside.parse::<Ipv6Addr>().map_err(|_| no_group(inside))?;
        let port = match after {
            "" => None,
            _ => Some(after.strip_prefix(':').ok_or_else(|| no_port(after))?),
        };
        (IpAddr::V6(group), port)
    } else {
        let (group, port) = match place.split_once(':') {
            Some((group, port)) => (group, Some(port)),
            None => (place, None),
        };
        let group = match group {
            "" => DEFAULT_UDP_GROUP,
            _ => group.parse::<Ipv4Addr>().map_err(|_| no_group(place))?,
        };
        (IpAddr::V4(group), port)
    };
    if !group.is_multicast() {
        return Err(format!(
            "{group} is not a multicast group (224.0.0.0 to 239.255.255.255, or ff00::/8)"
        ));
    }
    let port = match port {
        None => DEFAULT_UDP_PORT,
        Some(text) => match text.parse() {
            Ok(port) if port != 0 => port,
            _ => return Err(no_port(text)),
        },
    };
    Ok((group, port))
}

/// A `?` belongs to the options only if a `=` follows it, so that a file may have a `?` in its name.
fn parse_log(rest: &str) -> Result<SourceAddress, String> {
    let (file, option) = match rest.rsplit_once('?') {
        Some((file, option)) if option.contains('=') => (file, Some(option)),
        _ => (rest, None),
    };
    if file.is_empty() {
        return Err("the file is missing".into());
    }
    let interface = match option {
        None => None,
        Some(option) => match option.split_once('=') {
            Some(("interface", "")) => return Err("the interface's name is missing".into()),
            Some(("interface", name)) => Some(name.to_owned()),
            _ => {
                return Err(format!("`{option}` is no option of log: (it has interface=NAME)"));
            }
        },
    };
    Ok(SourceAddress::Log {
        path: PathBuf::from(file),
        interface,
    })
}

impl fmt::Display for SourceAddress {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            SourceAddress::Can { interface } => write!(f, "can:{interface}"),
            SourceAddress::Udp {
                group,
                port,
                interface,
                hop_limit,
            } => {
                match group {
                    IpAddr::V4(group) => write!(f, "udp:{group}:{port}")?,
                    IpAddr::V6(group) => write!(f, "udp:[{group}]:{port}")?,
                }
                let mut separator = '?';
                if let Some(interface) = interface {
                    write!(f, "{separator}interface={interface}")?;
                    separator = '&';
                }
                if *hop_limit != DEFAULT_UDP_HOP_LIMIT {
                    write!(f, "{separator}hops={hop_limit}")?;
                }
                Ok(())
            }
            SourceAddress::Log { path, interface } => {
                write!(f, "log:{}", path.display())?;
                match interface {
                    Some(interface) => write!(f, "?interface={interface}"),
                    None => Ok(()),
                }
            }
            SourceAddress::Sim { scene } => write!(f, "sim:{scene}"),
            SourceAddress::Pressure { path } => write!(f, "pressure:{}", path.display()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn udp(group: &str, port: u16) -> SourceAddress {
        SourceAddress::Udp {
            group: group.parse().unwrap(),
            port,
            interface: None,
            hop_limit: 1,
        }
    }

    #[test]
    fn every_form_is_read() {
        let cases = [
            (
                "can:vcan0",
                SourceAddress::Can {
                    interface: "vcan0".into(),
                },
            ),
            ("udp:", udp("239.74.163.2", 43113)),
            ("udp:239.74.163.9", udp("239.74.163.9", 43113)),
            ("udp::50000", udp("239.74.163.2", 50000)),
            ("udp:239.1.2.3:4", udp("239.1.2.3", 4)),
            ("udp:[ff15::1]:4", udp("ff15::1", 4)),
            ("udp:[ff15::1]", udp("ff15::1", 43113)),
            (
                "udp:?interface=lo&hops=0",
                SourceAddress::Udp {
                    group: DEFAULT_UDP_GROUP.into(),
                    port: DEFAULT_UDP_PORT,
                    interface: Some("lo".into()),
                    hop_limit: 0,
                },
            ),
            (
                "log:a b/c.log",
                SourceAddress::Log {
                    path: "a b/c.log".into(),
                    interface: None,
                },
            ),
            (
                "log:why?.log?interface=can1",
                SourceAddress::Log {
                    path: "why?.log".into(),
                    interface: Some("can1".into()),
                },
            ),
            (
                "sim:grasp",
                SourceAddress::Sim {
                    scene: "grasp".into(),
                },
            ),
            (
                "pressure:/run/a b:c.sock",
                SourceAddress::Pressure {
                    path: "/run/a b:c.sock".into(),
                },
            ),
        ];
        for (text, address) in cases {
            assert_eq!(text.parse(), Ok(address.clone()), "{text}");
            assert_eq!(address.to_string().parse(), Ok(address), "{text}");
        }
    }

    #[test]
    fn a_wrong_address_says_what_is_wrong_and_lists_the_forms() {
        let cases = [
            ("vcan0", "starts with none of"),
            ("vcan0", "; the kernel's interface vcan0 is can:vcan0. Write"),
            ("tap.log", "pressure:. Write"),
            ("tcp:1", "pressure:. Write"),
            ("vcan:vcan0", "; the kernel's interface vcan0 is can:vcan0. Write"),
            ("socketcan:can1", "is can:can1. Write"),
            (
                "slcan:slcan0",
                "makes an interface of a serial adapter, which is can:slcan0. Write",
            ),
            (
                "slcan:/dev/ttyUSB0@115200",
                "`slcand -o -s8 /dev/ttyUSB0 can0` (1 Mbit/s)",
            ),
            ("can:", "the interface is missing"),
            ("can:a/b", "no interface name"),
            ("can:sixteen_bytes_16", "no interface name"),
            ("udp:10.0.0.1:5", "10.0.0.1 is not a multicast group"),
            ("udp:ff15::1", "in brackets"),
            ("udp:[ff15::1", "in brackets"),
            ("udp:[ff15::1]5", "no UDP port"),
            ("udp:239.1.1.1:0", "no UDP port"),
            ("udp:239.1.1.1:65536", "no UDP port"),
            ("udp:?hops=300", "no hop limit"),
            ("udp:?ttl=3", "no option of udp"),
            ("log:", "the file is missing"),
            ("log:x.log?speed=2", "no option of log"),
            ("log:x.log?interface=", "interface's name is missing"),
            ("sim:", "the scene is missing"),
            ("pressure:", "the socket's path is missing"),
        ];
        for (text, says) in cases {
            let error = text.parse::<SourceAddress>().unwrap_err().to_string();
            assert!(error.contains(says), "{text}: {error}");
            assert!(
                error.contains("can:INTERFACE") && error.contains("sim:SCENE"),
                "{text}: {error}"
            );
        }
    }
}
