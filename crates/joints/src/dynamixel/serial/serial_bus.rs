//! A [`Bus`] on a serial port.

use crate::dynamixel::bus::{Bus, DEFAULT_MARGIN_NS, Step};
use crate::serial::{Port, PortError, PortLatency, Terminal};
use std::path::Path;
use std::time::Duration;
use taxel_can::monotonic_ns;

/// Most bytes that are thrown away before a request; a bus that babbles on is asked all the same.
const DRAIN_BYTES: usize = 4096;
/// How often a bus that waits for an answer looks what else there is.
const LOOK: Duration = Duration::from_millis(10);
/// On top of twice an FTDI adapter's timer.
const FTDI_MARGIN_NS: u64 = 2_000_000;

/// How long an answer may take beyond its time on the wire, nanoseconds, unless the configuration says otherwise.
pub(super) fn usual_margin_ns(latency: PortLatency) -> u64 {
    let by_timer = (latency.ftdi_timer_ms).map(|ms| FTDI_MARGIN_NS + 2_000_000 * u64::from(ms));
    by_timer.unwrap_or(DEFAULT_MARGIN_NS)
}

/// An open port with the servos behind it. It blocks; [`crate::ServoReader`] gives it a thread.
#[derive(Debug)]
pub struct SerialBus {
    port: Port,
    margin_ns: Option<u64>,
}

impl SerialBus {
    /// Opens the port and prepares `bus` for it. `margin_ns`, if given, is how long an answer may
    /// take beyond its time on the wire; without it, an FTDI adapter's own timer decides where
    /// there is one.
    pub fn open(path: &Path, baud: u32, margin_ns: Option<u64>, bus: &mut Bus) -> Result<Self, PortError> {
        Self::open_again(path, baud, margin_ns, bus, None)
    }

    /// The same where that terminal was lost.
    pub(crate) fn open_again(
        path: &Path,
        baud: u32,
        margin_ns: Option<u64>,
        bus: &mut Bus,
        lost: Option<Terminal>,
    ) -> Result<Self, PortError> {
        let port = Port::open(path, baud, lost)?;
        bus.port_opened();
        let serial = Self { port, margin_ns };
        serial.set_margin(bus);
        Ok(serial)
    }

    fn set_margin(&self, bus: &mut Bus) {
        let usual_ns = usual_margin_ns(self.port.latency());
        bus.set_margins_ns(self.margin_ns.unwrap_or(usual_ns), usual_ns);
    }

    /// Looks at the adapter's timer anew: somebody may have set it meanwhile.
    pub fn look_at_latency(&mut self, bus: &mut Bus) -> PortLatency {
        if self.port.look_at_latency() {
            self.set_margin(bus);
        }
        self.port.latency()
    }

    /// How fast the port hands over what it has received.
    pub fn latency(&self) -> PortLatency {
        self.port.latency()
    }

    /// The device that was opened: where the path led to, if it was a link.
    pub fn device(&self) -> &Path {
        self.port.device()
    }

    /// Which terminal it is, also once that is gone; `None` where it is none, but an adapter.
    pub(crate) fn terminal(&self) -> Option<Terminal> {
        self.port.terminal()
    }

    /// When another program last took bytes that had come for this one, nanoseconds; `None` if none has.
    pub fn taken_ns(&self) -> Option<u64> {
        self.port.taken_ns()
    }

    /// Runs one cycle. The results are in [`Bus::results`]; the only error is a port that is gone.
    pub fn cycle(&mut self, bus: &mut Bus) -> Result<(), PortError> {
        self.cycle_while(bus, |_| true)
    }

    /// The same; `between` is called before it begins, again and again while an answer is waited for, and between its requests;
    /// once it says no, none is sent any more.
    pub(crate) fn cycle_while(
        &mut self,
        bus: &mut Bus,
        mut between: impl FnMut(&mut Bus) -> bool,
    ) -> Result<(), PortError> {
        between(bus);
        bus.begin(monotonic_ns());
        loop {
            let goes_on = between(bus);
            match bus.step(monotonic_ns()) {
                Step::Send if !goes_on => return Ok(()),
                Step::Send => {
                    self.drain(bus)?;
                    self.port.write(bus.request())?;
                    bus.sent(monotonic_ns());
                }
                Step::Wait { until_ns } => {
                    let timeout = Duration::from_nanos(until_ns.saturating_sub(monotonic_ns())).min(LOOK);
                    let n = self.port.read(bus.space(), timeout)?;
                    if n > 0 {
                        bus.take_bytes(n, monotonic_ns());
                    }
                }
                Step::Done => return Ok(()),
            }
        }
    }

    /// Reads what came too late for the request before.
    fn drain(&mut self, bus: &mut Bus) -> Result<(), PortError> {
        let mut left = DRAIN_BYTES;
        while left > 0 && self.port.waiting()? > 0 {
            let n = self.port.read(bus.space(), Duration::ZERO)?;
            if n == 0 {
                break;
            }
            bus.take_bytes(n, monotonic_ns());
            left = left.saturating_sub(n);
        }
        Ok(())
    }
}
