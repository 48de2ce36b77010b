//! The tables `[[bus]]`: a source for each bus of the hand.

use crate::{BusConfig, ConfigError, File, MAX_BUSES, Table, sockets};
use taxel_can::SourceAddress;
use taxel_skin::Layout;

/// One source for each table, none of them given twice.
pub(crate) fn sources_of(
    file: &File<'_>,
    buses: &[Table<BusConfig>],
    layout: &Layout,
) -> Result<Vec<SourceAddress>, ConfigError> {
    let refuse = |bus: &Table<BusConfig>, message| file.refuse(bus.get_ref().0.source.span().start, message);
    let sources = buses
        .iter()
        .map(|bus| {
            let address = bus.get_ref().0.source.get_ref().parse::<SourceAddress>();
            address.map_err(|e| refuse(bus, e.to_string()))
        })
        .collect::<Result<Vec<_>, _>>()?;
    told_apart(sources, layout).map_err(|(again, message)| refuse(&buses[again], message))
}

/// There is a source for each bus of the layout, of a kind that can carry what is on it.
pub(crate) fn check_buses(
    file: &File<'_>,
    buses: &[Table<BusConfig>],
    layout: &Layout,
    sources: &[SourceAddress],
) -> Result<(), ConfigError> {
    if sources.len() != layout.buses.len() {
        let message = format!(
            "layout {} has {} buses ({}), so there must be as many [[bus]] tables with a source, not {}",
            layout.name,
            layout.buses.len(),
            layout.buses.join(", "),
            sources.len()
        );
        let place = buses.last().map_or(file.text.len(), |b| b.span().start);
        return Err(file.refuse(place, message));
    }
    if sources.len() > MAX_BUSES {
        let message = format!(
            "{} buses are more than the {MAX_BUSES} a daemon reads",
            sources.len()
        );
        return Err(file.refuse(0, message));
    }
    for (index, (bus, source)) in buses.iter().zip(sources).enumerate() {
        source_fits(layout, index, source)
            .map_err(|problem| file.refuse(bus.get_ref().0.source.span().start, problem))?;
    }
    Ok(())
}

/// Only the frames of pressure arrays come over a Unix socket of their own.
fn source_fits(layout: &Layout, bus: usize, source: &SourceAddress) -> Result<(), String> {
    let name = &layout.buses[bus];
    match (source, layout.array_on(bus)) {
        (SourceAddress::Pressure { .. }, None) => Err(format!(
            "{source} is for a pressure array, and bus {name:?} of layout {} has none; name its bus, such as can:{name}",
            layout.name
        )),
        (SourceAddress::Can { .. } | SourceAddress::Udp { .. }, Some(_)) => Err(format!(
            "bus {name:?} of layout {} is a pressure array, whose frames come over a Unix socket; write pressure:PATH",
            layout.name
        )),
        (SourceAddress::Pressure { path }, Some(_)) => sockets::check_path(path),
        _ => Ok(()),
    }
}

/// The sources of a hand's buses, of which none reads what another does. Where several are of one recording, each is the
/// interface of its bus's name. Scenes may be given twice.
///
/// Fails with the source that is given again and a message.
pub fn told_apart(
    mut sources: Vec<SourceAddress>,
    layout: &Layout,
) -> Result<Vec<SourceAddress>, (usize, String)> {
    let log = |source: &SourceAddress| match source {
        SourceAddress::Log { path, .. } => Some(path.clone()),
        _ => None,
    };
    let logs: Vec<_> = sources.iter().filter_map(log).collect();
    for (source, bus) in sources.iter_mut().zip(&layout.buses) {
        if let SourceAddress::Log {
            path,
            interface: interface @ None,
        } = source
            && logs.iter().filter(|log| *log == path).count() > 1
        {
            *interface = Some(bus.clone());
        }
    }
    let is_scene = |source: &SourceAddress| matches!(source, SourceAddress::Sim { .. });
    let again =
        (0..sources.len()).find(|at| !is_scene(&sources[*at]) && sources[..*at].contains(&sources[*at]));
    match again {
        None => Ok(sources),
        Some(again) => {
            let message = format!(
                "{} is given twice; each bus of the hand has a source of its own",
                sources[again]
            );
            Err((again, message))
        }
    }
}
