//! What is wrong on the buses, as the traffic on them shows: a node that babbles, two boards with
//! one address, boards on the wrong bus.
//!
//! Frames are counted per id over windows of a quarter of a second. What holds in two windows in a
//! row is a finding, and what is absent from two in a row no longer is one. So a finding comes and
//! goes within half a second and a window. A board in the wrong place is one from three windows, as
//! all boards of its bus may be about to follow it, and no longer one from one window without it.

mod alternation;
mod bus;
mod finding;
mod hub_modules;
mod stray;
mod swinging;
mod tally;

pub use finding::{BusLoad, Finding};

use crate::layout::Layout;
use crate::protocol::Protocol;
use crate::protocol::mtb::{BoardKind, answer_id, answering};
use crate::reading::TaxelReading;
use alternation::Alternation;
use bus::{Bus, STRANGER_NS, WINDOW_NS, figures, per_second};
use stray::{ANSWER_WINDOWS, Held, NOBODY, Pair, Stray, answers_questions, ids_of, pairs, strays};
use swinging::{Swinging, Swung};
use tally::FOREIGN_HUBS;
use taxel_can::Received;

/// One id that takes this share of the bus babbles: 1,800 frames of 8 bytes per second. A taxel's
/// own id takes 1 % at 100 sweeps per second.
const BABBLE_SHARE: f64 = 0.2;
/// One id of a board that comes this many times as often as the board's others babbles too, if it
/// comes so often at all.
const BABBLE_TIMES: f64 = 5.0;
const BABBLE_LEAST_HZ: f64 = 300.0;
/// A board that sends this many times as many sweeps as its like babbles, if it takes
/// `BABBLE_SHARE` of the bus.
const BOARD_TIMES: f64 = 3.0;
/// Two boards with one address send twice as much as one, less what they lose to each other.
const TWO_BOARDS_TIMES: f64 = 1.4;

/// Watches the traffic of all buses of a hand. Its memory is allocated once; a frame and a reading
/// take constant time.
///
/// ```
/// use taxel_can::{CanFrame, Received};
/// use taxel_skin::{BusMonitor, Finding, Layout};
///
/// let hand = Layout::builtin("allegro-uskin-15").expect("built in");
/// let mut monitor = BusMonitor::new(&hand);
/// let frame = CanFrame::standard(0x005, &[0xBA; 8])?;
/// for n in 0..4_000 {
///     monitor.handle_frame(1, &Received { t_ns: n * 250_000, frame });
/// }
/// assert!(matches!(monitor.findings(), [Finding::IdBabbles { bus: 1, id: 0x005, module: None, .. }]));
/// # Ok::<(), taxel_can::FrameError>(())
/// ```
#[derive(Debug, Clone)]
pub struct BusMonitor {
    buses: Vec<Bus>,
    modules: Vec<Module>,
    taxels: Vec<Taxel>,
    strays: Vec<Stray>,
    pairs: Vec<Pair>,
    findings: Vec<Finding>,
    /// Room to sort rates in.
    rates: Vec<f64>,
    window_ends_ns: Option<u64>,
    /// Time of the newest frame.
    now_ns: u64,
}

#[derive(Debug, Clone)]
struct Module {
    bus: u8,
    protocol: Protocol,
    /// Whether its taxels have 8 bits only.
    coarse: bool,
    /// Standard ids of its frames; none for CySkin.
    ids: Vec<u16>,
    taxels: u16,
    readings: u32,
    swinging: Swinging,
    /// What the newest window has shown of that.
    swung: Swung,
    /// The first of its taxels.
    first: u16,
    sweeps_hz: f64,
    /// Sweeps per second while nothing was wrong with it.
    usual_hz: Option<f64>,
    babbles: Held<()>,
    doubled: Held<()>,
}

#[derive(Debug, Clone, Copy)]
struct Taxel {
    module: u16,
    alternation: Alternation,
}

impl BusMonitor {
    /// A monitor for the buses of a layout.
    pub fn new(layout: &Layout) -> Self {
        let mut buses: Vec<Bus> = (0u8..)
            .zip(&layout.buses)
            .map(|(bus, _)| Bus::new(layout, bus))
            .collect();
        let mut modules = Vec::new();
        for (index, module, wiring) in layout.boards() {
            let ids = ids_of(wiring.protocol, wiring.board, layout.k_of(module));
            if let Some(bus) = buses.get_mut(usize::from(wiring.bus)) {
                for id in &ids {
                    bus.owners[usize::from(*id)] = index;
                }
                if answers_questions(wiring.protocol) {
                    bus.familiar[usize::from(answer_id(wiring.board))] = true;
                }
            }
            modules.push(Module {
                bus: wiring.bus,
                protocol: wiring.protocol,
                coarse: wiring.protocol.measures().has_coarse_steps(),
                ids,
                taxels: module.taxels,
                readings: 0,
                swinging: Swinging::default(),
                swung: Swung::default(),
                first: module.first_taxel,
                sweeps_hz: 0.0,
                usual_hz: None,
                babbles: Held::default(),
                doubled: Held::default(),
            });
        }
        let owners: Vec<&[u16; 0x800]> = buses.iter().map(|bus| &*bus.owners).collect();
        let strays = strays(layout, &owners);
        for bus in &mut buses {
            for (familiar, owner) in bus.familiar.iter_mut().zip(bus.owners.iter()) {
                *familiar |= *owner != NOBODY;
            }
        }
        for stray in &strays {
            let familiar = &mut buses[usize::from(stray.bus)].familiar;
            for id in &stray.ids {
                familiar[usize::from(*id)] = true;
            }
            if answers_questions(stray.protocol) && stray.module.is_some() {
                familiar[usize::from(answer_id(stray.address as u8))] = true;
            }
        }
        let pairs = pairs(layout, &strays);
        let hubs: usize = buses.iter().map(|bus| bus.hub_modules.len()).sum();
        let most = (1 + FOREIGN_HUBS) * buses.len() + hubs + 2 * modules.len() + strays.len() + pairs.len();
        let taxels = layout.taxels.iter().map(|t| Taxel {
            module: t.module,
            alternation: Alternation::default(),
        });
        let longest = modules.iter().map(|m| m.ids.len()).max().unwrap_or(0);
        Self {
            taxels: taxels.collect(),
            findings: Vec::with_capacity(most),
            rates: Vec::with_capacity(modules.len().max(longest)),
            buses,
            modules,
            strays,
            pairs,
            window_ends_ns: None,
            now_ns: 0,
        }
    }

    /// Ends the windows that are over at `now_ns`. [`BusMonitor::handle_frame`] does so with the
    /// time of every frame; to be called now and then when none come.
    #[inline]
    pub fn advance(&mut self, now_ns: u64) {
        let ends_ns = *self
            .window_ends_ns
            .get_or_insert(now_ns.saturating_add(WINDOW_NS));
        if now_ns >= ends_ns {
            self.end_windows(ends_ns, now_ns);
        }
    }

    #[cold]
    fn end_windows(&mut self, ends_ns: u64, now_ns: u64) {
        let windows = 1 + (now_ns - ends_ns) / WINDOW_NS;
        // After that many windows without a frame nothing changes any more.
        for _ in 0..windows.min(u64::from(ANSWER_WINDOWS) + 1) {
            self.end_window();
        }
        self.window_ends_ns = Some(ends_ns.saturating_add(windows.saturating_mul(WINDOW_NS)));
    }

    /// Takes a frame of a bus (index), whatever it is.
    #[inline]
    pub fn handle_frame(&mut self, bus: u8, received: &Received) {
        self.advance(received.t_ns);
        self.now_ns = received.t_ns;
        let frame = &received.frame;
        if let Some(bus) = self.buses.get_mut(usize::from(bus)) {
            let owner = frame.standard_id().map(|id| bus.owners[usize::from(id) & 0x7FF]);
            bus.hub_modules.note(frame);
            bus.tally
                .count(frame, owner.is_some_and(|module| module != NOBODY));
            if let Some(address) = answering(frame) {
                bus.answers[usize::from(address)] = Some(BoardKind::of(frame.data()[1]));
            }
        }
    }

    /// Takes a reading that a frame carried.
    #[inline]
    pub fn handle_reading(&mut self, reading: &TaxelReading) {
        let Some(taxel) = self.taxels.get_mut(usize::from(reading.taxel)) else {
            return;
        };
        let module = &mut self.modules[usize::from(taxel.module)];
        module.readings += 1;
        module
            .swinging
            .note(taxel.alternation.swing(reading, module.coarse));
        if reading.taxel == module.first {
            module.swinging.note_sweep(self.now_ns);
        }
    }

    /// What is wrong now.
    pub fn findings(&self) -> &[Finding] {
        &self.findings
    }

    /// Whether a node spoke on a bus (index) in the last ten minutes that is neither a board of the hand nor could be one on
    /// the wrong bus.
    pub fn strangers(&self, bus: u8) -> bool {
        let heard_ns = self.buses.get(usize::from(bus)).and_then(|bus| bus.stranger_ns);
        let spoke = heard_ns.zip(self.window_ends_ns);
        spoke.is_some_and(|(heard_ns, now_ns)| now_ns.saturating_sub(heard_ns) < STRANGER_NS)
    }

    /// What a bus (index) carries.
    pub fn load(&self, bus: u8) -> BusLoad {
        self.buses
            .get(usize::from(bus))
            .map_or_else(BusLoad::default, |b| b.load)
    }

    fn end_window(&mut self) {
        self.findings.clear();
        for bus in &mut self.buses {
            let (frames_hz, share) = figures(bus.tally.all.frames, bus.tally.all.bits);
            let (_, share_most) = figures(bus.tally.all.frames, bus.tally.all.most_bits);
            bus.load = BusLoad {
                frames_hz,
                share,
                share_most,
            };
        }
        for module in &mut self.modules {
            let sweeps = f64::from(module.readings) / f64::from(module.taxels.max(1));
            module.sweeps_hz = per_second(sweeps);
            module.swung = module.swinging.end_window(module.readings);
        }
        self.find_babblers();
        for protocol in Protocol::boards() {
            let usual_hz = self.usual_hz(protocol, None);
            for module in 0..self.modules.len() {
                if self.modules[module].protocol == protocol {
                    self.check_sweeps(module, usual_hz);
                }
            }
        }
        self.find_strays();
        self.find_foreign_hubs();
        self.find_strangers();
        for bus in &mut self.buses {
            bus.tally.clear();
            bus.answers = [None; 16];
        }
        for module in &mut self.modules {
            module.readings = 0;
        }
    }

    fn find_babblers(&mut self) {
        let buses = (0u8..).zip(&mut self.buses);
        for (index, bus) in buses.filter(|(_, bus)| !bus.is_array) {
            let loudest = bus.tally.loudest().filter(|(extended, id, of)| {
                let (rate_hz, share) = figures(of.frames, of.bits);
                let owner = (!extended).then(|| bus.owners[*id as usize & 0x7FF]);
                let others = owner.and_then(|m| self.modules.get(usize::from(m)));
                let out_of_line = others.is_some_and(|module| {
                    let rates = module.ids.iter().map(|id| bus.tally.ids[usize::from(*id)].frames);
                    let usual = median(&mut self.rates, rates.map(f64::from));
                    module.ids.len() > 2 && f64::from(of.frames) >= BABBLE_TIMES * usual.unwrap_or(0.0)
                });
                share >= BABBLE_SHARE || (out_of_line && rate_hz >= BABBLE_LEAST_HZ)
            });
            let held = bus
                .babbles
                .update(loudest.map(|(extended, id, _)| (extended, id)));
            let Some((extended, id)) = held else { continue };
            let same = loudest.filter(|(e, i, _)| (*e, *i) == (extended, id));
            let of = same.map_or_else(tally::OfId::default, |(_, _, of)| of);
            let (rate_hz, share) = figures(of.frames, of.bits);
            let owner = (!extended).then(|| bus.owners[id as usize & 0x7FF]);
            self.findings.push(Finding::IdBabbles {
                bus: index,
                id,
                extended,
                module: owner.filter(|m| *m != NOBODY),
                rate_hz,
                share,
            });
        }
    }

    /// Sweeps per second of the living boards of a protocol: the median, and how many boards there are.
    fn usual_hz(&mut self, protocol: Protocol, but: Option<usize>) -> (Option<f64>, usize) {
        let like = (self.modules.iter().enumerate())
            .filter(|(i, m)| Some(*i) != but && m.protocol == protocol && m.sweeps_hz > 0.0)
            .map(|(_, m)| m.sweeps_hz);
        let median = median(&mut self.rates, like);
        (median, self.rates.len())
    }

    /// Whether a module's board sends too much, or more than one board does. `usual` is the rate of
    /// all like it, and how many these are: among few it would be a part of its own measure.
    fn check_sweeps(&mut self, index: usize, usual: (Option<f64>, usize)) {
        const FEW: usize = 8;
        let (all_hz, boards) = usual;
        let others_hz = if boards < FEW && self.modules[index].sweeps_hz > 0.0 {
            self.usual_hz(self.modules[index].protocol, Some(index)).0
        } else {
            all_hz
        };
        // All of them may be two: then they send more than each did alone.
        let own_hz = self.modules[index].usual_hz;
        let usual_hz = others_hz.into_iter().chain(own_hz).reduce(f64::min);
        let module = &mut self.modules[index];
        let bus = self.buses.get(usize::from(module.bus));
        let Some(bus) = bus.filter(|bus| !bus.is_array) else {
            // The modules of an array in a file are on no bus, those of a pressure array on none of boards.
            return;
        };
        let own = (module.ids.iter()).fold((0, 0), |(frames, bits), id| {
            let of = bus.tally.ids[usize::from(*id)];
            (frames + of.frames, bits + of.bits)
        });
        let (rate_hz, share) = figures(own.0, own.1);
        let sweeps_hz = [module.sweeps_hz, usual_hz.unwrap_or(module.sweeps_hz)];
        let times = |times: f64| usual_hz.is_some_and(|usual| module.sweeps_hz >= times * usual);
        let swung = module.swung;
        let (doubled, babbles) = (
            // What has sent as much before is one board, whatever hums or shakes. Two stay two while their values swing, however
            // their sweeps come.
            (swung.is_proof && own_hz.is_none())
                || (swung.is && (module.doubled.is.is_some() || times(TWO_BOARDS_TIMES))),
            share >= BABBLE_SHARE && times(BOARD_TIMES) && bus.babbles.is.is_none(),
        );
        let (doubled_now, babbles_now) = (doubled.then_some(()), babbles.then_some(()));
        let number = index as u16;
        if module.doubled.update(doubled_now).is_some() {
            self.findings.push(Finding::TwoBoards {
                module: number,
                sweeps_hz,
            });
        }
        if module.babbles.update(babbles_now).is_some() {
            self.findings.push(Finding::BoardBabbles {
                module: number,
                rate_hz,
                share,
                sweeps_hz,
            });
        }
        if !swung.is && !babbles && module.sweeps_hz > 0.0 {
            let usual = module.usual_hz.get_or_insert(module.sweeps_hz);
            // Slowly, so that it stays what it was for a while when a second board joins.
            *usual += (module.sweeps_hz - *usual) / 8.0;
        }
    }

    /// What is no board's, by its id: extended ones of no hub, and those that are neither a
    /// module's nor a stray's nor a command.
    fn find_strangers(&mut self) {
        for bus in &mut self.buses {
            let mut ids = bus.tally.ids.iter().zip(bus.familiar.iter());
            if bus.tally.of_no_hub > 0 || ids.any(|(of, familiar)| of.frames > 0 && !familiar) {
                bus.stranger_ns = Some(self.now_ns);
            }
        }
    }

    /// Boards that speak where the layout has none of their address.
    fn find_strays(&mut self) {
        for stray in &mut self.strays {
            let bus = &self.buses[usize::from(stray.bus)];
            let elsewhere = stray
                .module
                .filter(|m| self.modules[usize::from(*m)].readings == 0);
            stray.end_window(&bus.tally, &bus.answers, elsewhere);
        }
        self.find_swapped_buses();
        for stray in self.strays.iter().filter(|stray| stray.is_settled) {
            let Some(module) = stray.there.is else { continue };
            let tally = &self.buses[usize::from(stray.bus)].tally;
            if self.strays.iter().any(|other| stray.is_another(other, tally)) {
                continue;
            }
            let swapped = module.is_some_and(|m| {
                let own = self.modules[usize::from(m)].bus;
                self.findings.iter().any(|finding| {
                    matches!(finding, Finding::BusesSwapped { buses, .. } if buses.contains(&own) && buses.contains(&stray.bus))
                })
            });
            match module {
                Some(_) if swapped => {}
                Some(module) => self.findings.push(Finding::OnOtherBus {
                    module,
                    bus: stray.bus,
                }),
                None => self.findings.push(Finding::NotInLayout {
                    bus: stray.bus,
                    protocol: stray.protocol,
                    address: stray.address,
                }),
            }
        }
    }

    fn find_swapped_buses(&mut self) {
        for pair in &self.pairs {
            let strays = pair.strays.iter().map(|i| &self.strays[*i]);
            let mut displaced = strays.map(|stray| stray.there.is.flatten());
            let Some(module) = displaced.clone().next().flatten() else {
                continue;
            };
            if displaced.all(|module| module.is_some()) {
                self.findings.push(Finding::BusesSwapped {
                    buses: pair.buses,
                    module,
                    boards: pair.strays.len() as u16,
                });
            }
        }
    }

    /// Hubs that the layout does not have, and modules that it does not have on a hub.
    fn find_foreign_hubs(&mut self) {
        for (index, bus) in (0u8..).zip(&mut self.buses) {
            bus.find_foreign_hubs();
            let speaking = bus.foreign_hubs.iter().filter(|hub| hub.speaks.is.is_some());
            self.findings.extend(speaking.map(|hub| Finding::NotInLayout {
                bus: index,
                protocol: Protocol::CYSKIN,
                address: hub.address,
            }));
            self.findings.extend(bus.hub_modules.end_window());
        }
    }
}

fn median(room: &mut Vec<f64>, values: impl Iterator<Item = f64>) -> Option<f64> {
    room.clear();
    room.extend(values);
    room.sort_unstable_by(f64::total_cmp);
    room.get(room.len() / 2).copied()
}
