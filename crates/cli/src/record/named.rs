//! The buses that `--can` names, and what they are called in the recording.

use crate::errors::wrong_use;
use taxel_can::SourceAddress;
use taxel_recorder::CanInput;

/// `NAME=SOURCE`, or a source that is called as its interface is, else as what is `known` calls it, else by the first of
/// can0, can1, .. that is no other's.
///
/// # Errors
/// What is no source of a bus, and a name or a source that is given twice.
pub(super) fn named(
    texts: &[String],
    known: impl FnOnce() -> Vec<CanInput>,
) -> anyhow::Result<Vec<CanInput>> {
    let mut buses = texts
        .iter()
        .map(|text| parse(text))
        .collect::<anyhow::Result<Vec<_>>>()?;
    if buses.iter().any(|(name, _)| name.is_none()) {
        let known = known();
        for (name, address) in &mut buses {
            let is_same = |bus: &&CanInput| heard(&bus.address) == heard(address);
            *name = (name.take()).or_else(|| known.iter().find(is_same).map(|bus| bus.name.clone()));
        }
        while let Some(at) = buses.iter().position(|(name, _)| name.is_none()) {
            let is_free = |name: &String| {
                known.iter().all(|bus| bus.name != *name)
                    && buses.iter().all(|(other, _)| other.as_ref() != Some(name))
            };
            let free = (0..).map(|n| format!("can{n}")).find(is_free);
            let name = free.unwrap_or_default();
            remark!(
                "taxel: {} is called {name} in the recording; --can NAME=SOURCE calls it otherwise",
                texts[at]
            );
            buses[at].0 = Some(name);
        }
    }
    let mut inputs: Vec<CanInput> = Vec::new();
    for (text, (name, address)) in texts.iter().zip(buses) {
        let name = name.unwrap_or_default();
        if inputs.iter().any(|bus| heard(&bus.address) == heard(&address)) {
            return Err(wrong_use(format!(
                "--can {text}: {address} is given twice, and each of its frames would be recorded twice"
            )));
        }
        if inputs.iter().any(|bus| bus.name == name) {
            return Err(wrong_use(format!(
                "--can {text}: another bus is called {name}, too; give each a name of its own, as it has in the layout"
            )));
        }
        inputs.push(CanInput { name, address });
    }
    Ok(inputs)
}

/// The address without what only those who send need.
fn heard(address: &SourceAddress) -> SourceAddress {
    let mut heard = address.clone();
    if let SourceAddress::Udp { hop_limit, .. } = &mut heard {
        *hop_limit = 0;
    }
    heard
}

/// A bus, and the name that the text gives it.
fn parse(text: &str) -> anyhow::Result<(Option<String>, SourceAddress)> {
    let (name, address) = match text.split_once('=') {
        Some((name, address)) if !name.contains(':') => (Some(name.to_owned()), address),
        _ => (None, text),
    };
    let address: SourceAddress = address.parse().map_err(wrong_use)?;
    let name = match &address {
        SourceAddress::Log { .. } | SourceAddress::Sim { .. } => {
            return Err(wrong_use(format!(
                "--can {text}: a recording or a scene is no bus; name can:INTERFACE or udp:GROUP:PORT"
            )));
        }
        SourceAddress::Pressure { .. } => {
            return Err(wrong_use(format!(
                "--can {text}: a pressure array is no bus; its counts are in the raw frames, which are kept"
            )));
        }
        SourceAddress::Can { interface } => name.or_else(|| Some(interface.clone())),
        SourceAddress::Udp { .. } => name,
    };
    match &name {
        Some(name) if name.is_empty() || name.chars().any(char::is_whitespace) => Err(wrong_use(format!(
            "--can {text}: {name:?} is no name of a bus; it has one character or more, and no blanks"
        ))),
        _ => Ok((name, address)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What the buses are called where the daemon reads can0 and can1 from two groups, or why they are refused.
    fn names(texts: &[&str]) -> Result<Vec<String>, String> {
        let texts: Vec<String> = texts.iter().map(|text| (*text).to_owned()).collect();
        let known = || {
            [("can0", "udp::47213"), ("can1", "udp::47214?hops=0")]
                .map(|(name, address)| CanInput {
                    name: name.into(),
                    address: address.parse().unwrap(),
                })
                .to_vec()
        };
        match named(&texts, known) {
            Ok(buses) => Ok(buses.into_iter().map(|bus| bus.name).collect()),
            Err(error) => Err(error.to_string()),
        }
    }

    #[test]
    fn a_bus_is_called_as_it_is_said_or_as_its_interface_or_as_the_daemon_calls_it_or_by_what_is_free() {
        for (texts, wanted) in [
            (&["can:vcan3"][..], &["vcan3"][..]),
            (
                &["left=udp:239.74.163.2:47214?interface=lo", "can:can0"],
                &["left", "can0"],
            ),
            (&["udp::47214"], &["can1"]),
            (&["udp::47214", "udp::47213"], &["can1", "can0"]),
            // The daemon's names are those of its own buses.
            (&["udp::47300", "udp::47213"], &["can2", "can0"]),
            (
                &["udp::47300", "udp::47301", "can2=udp::47302"],
                &["can3", "can4", "can2"],
            ),
        ] {
            let wanted: Vec<String> = wanted.iter().map(|name| (*name).to_owned()).collect();
            assert_eq!(names(texts), Ok(wanted), "{texts:?}");
        }
    }

    #[test]
    fn what_is_no_bus_or_has_no_name_or_is_given_twice_is_refused() {
        for (texts, wanted) in [
            (&["sim:tap"][..], "no bus"),
            (&["=can:can0"], "no name"),
            (&["left=can:can0", "left=can:can1"], "another bus is called left"),
            (
                &["can1=udp::47300", "udp::47214"],
                "--can udp::47214: another bus is called can1",
            ),
            (&["can1=udp::47300", "can:can1"], "another bus is called can1"),
            (&["a=can:can0", "b=can:can0"], "can:can0 is given twice"),
            (&["a=udp::47300", "b=udp::47300?hops=0"], "is given twice"),
        ] {
            let error = names(texts).unwrap_err();
            assert!(error.contains(wanted), "{texts:?}: {error}");
        }
    }
}
