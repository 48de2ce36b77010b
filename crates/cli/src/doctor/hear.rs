//! Hearing the hand: says what will be sent, opens the buses, and judges what was heard on them.

use super::arguments::Args;
use super::bus_listener::BusListener;
use super::finding::{Check, State};
use super::live::{self, ListenPolicy};
use super::{Doctor, capacity, hand, link};
use crate::wrap::wrap;
use anyhow::bail;
use taxel_can::SourceAddress;
use taxel_diagnose::Kind;
use taxel_playback::interrupt::Interrupt;
use taxel_skin::{Layout, Wiring};
use taxeld::Config;
use taxeld::stdout;

const AREA: &str = "hand";

impl Doctor {
    pub(super) fn check_hand(
        &mut self,
        args: &Args,
        config: &Config,
        links: &[link::LinkFacts],
        interrupt: Interrupt,
    ) -> anyhow::Result<()> {
        let layout = &config.layout;
        if layout.buses.is_empty() {
            let why = format!("layout {} has no boards: it is for arrays in files", layout.name);
            return self.report(vec![Check::skipped(AREA, "boards", "", why)]);
        }
        if !args.json {
            self.announce(args, config)?;
        }
        let (mut bus_listener, unheard) = self.open_buses(config, interrupt)?;
        if unheard == config.sources.len() {
            // What needs no hearing is told all the same.
            return self.check_capacity(config);
        }
        let policy = ListenPolicy {
            listen_only: args.listen_only,
            seconds: args.seconds.as_secs_f64(),
        };
        let Some(mut facts) = live::examine(config, &bitrates(config, links), policy, &mut bus_listener)?
        else {
            bail!("stopped before the hand was heard");
        };
        let told = self.report_lost_links(layout, &config.sources)?;
        facts.problems.retain(|noted| match noted.problem.kind {
            Kind::LinkAbsent | Kind::LinkDown | Kind::BusOff => {
                noted.problem.bus(layout).is_none_or(|bus| !told.contains(&bus))
            }
            _ => true,
        });
        self.report(hand::check(layout, &config.boards, &facts))?;
        self.draw(layout, &hand::marks(&facts))
    }

    /// Opens the buses, and says which cannot be heard, and what the others cannot tell; gives how many cannot.
    fn open_buses(&mut self, config: &Config, interrupt: Interrupt) -> anyhow::Result<(BusListener, usize)> {
        let layout = &config.layout;
        let receive_buffer = config.can.receive_buffer_kib as usize * 1024;
        let (bus_listener, failures) =
            BusListener::open(&config.sources, Some(config), receive_buffer, interrupt);
        let no_can = self
            .checks
            .iter()
            .any(|c| c.name == "AF_CAN" && c.state == State::Error);
        for (bus, error) in &failures {
            let name = &layout.buses[*bus];
            // Its cause was told above.
            let check = match (&config.sources[*bus], no_can) {
                (SourceAddress::Can { .. }, true) => Check::skipped(
                    AREA,
                    "source",
                    name,
                    "cannot be heard without CAN sockets (see AF_CAN)",
                ),
                _ => Check::error(AREA, "source", name, format!("{error:#}")),
            };
            self.report(vec![check])?;
        }
        for (bus, (address, name)) in config.sources.iter().zip(&layout.buses).enumerate() {
            let source = bus_listener.source(bus);
            if let Some(sentence) = source.and_then(|source| taxeld::left_out(config, address, source)) {
                self.report(vec![Check::skipped(AREA, "source", name, sentence)])?;
            }
            if let Some(sentence) = source.and_then(taxeld::untimed) {
                self.report(vec![Check::warning(AREA, "source", name, sentence)])?;
            }
        }
        Ok((bus_listener, failures.len()))
    }

    fn check_capacity(&mut self, config: &Config) -> anyhow::Result<()> {
        let buses = (0u8..).zip(&config.layout.buses);
        let checks = buses.filter_map(|(bus, name)| {
            capacity::check(&config.layout, bus, &config.boards, link::BITRATE, name)
        });
        self.report(checks.collect())
    }

    /// Says which buses could not be heard for what was told of their interfaces, and returns them.
    fn report_lost_links(
        &mut self,
        layout: &Layout,
        sources: &[SourceAddress],
    ) -> anyhow::Result<Vec<usize>> {
        let is_told = |interface: &str| {
            let errors = self.checks.iter().filter(|c| c.state == State::Error);
            let mut of_link = errors.filter(|c| ["interface", "link", "state"].contains(&c.name.as_ref()));
            of_link.any(|c| c.area == "link" && c.object == interface)
        };
        let buses = sources.iter().enumerate().filter(|(_, source)| match source {
            SourceAddress::Can { interface } => is_told(interface),
            _ => false,
        });
        let told: Vec<usize> = buses.map(|(bus, _)| bus).collect();
        let skipped = told
            .iter()
            .map(|bus| Check::skipped(AREA, "traffic", &layout.buses[*bus], "not heard (see link)"));
        self.report(skipped.collect())?;
        Ok(told)
    }

    /// Says beforehand what will be sent.
    fn announce(&mut self, args: &Args, config: &Config) -> anyhow::Result<()> {
        let recorded = config
            .sources
            .iter()
            .all(|s| matches!(s, SourceAddress::Log { .. }));
        let commanded = config.layout.wiring.iter().any(Wiring::takes_commands);
        let text = match (recorded, args.listen_only || !commanded) {
            (true, _) => return Ok(()),
            (_, true) => format!(
                "Listening to the hand for {} s, sending nothing. Do not touch it.",
                args.seconds.as_secs_f64()
            ),
            _ => format!(
                "Asking the boards who they are, starting them and listening for {} s, but only on buses where nobody else \
                 speaks (--listen-only sends nothing). Do not touch the hand.",
                args.seconds.as_secs_f64()
            ),
        };
        let lines = wrap(&text, 78);
        stdout::print(&format!("\n{}\n", lines.join("\n")))
    }
}

/// The bit rate of each bus: its interface's, or the usual one.
fn bitrates(config: &Config, links: &[link::LinkFacts]) -> Vec<u64> {
    let of_interface = |source: &SourceAddress| match source {
        SourceAddress::Can { interface } => links.iter().find(|link| link.name == *interface)?.bitrate(),
        _ => None,
    };
    let known = config.sources.iter().map(of_interface);
    known.map(|known| known.unwrap_or(link::BITRATE)).collect()
}
