//! How long a cycle of 16 servos takes against its time on the wire (docs/protocols.md, "Dynamixel cycle"),
//! on the simulated bus.
//!
//!     cargo run --release -p taxel-sim --example cycle_time

use std::error::Error;
use taxel_joints::bus::{Bus, wire_ns};
use taxel_joints::{DynamixelConfig, FastSyncRead, SerialBus};
use taxel_sim::servo::{ServoBuild, ServoBus, ServoPty};

const SERVOS: usize = 16;
const CYCLES: usize = 1000;

fn main() -> Result<(), Box<dyn Error>> {
    println!("{SERVOS} servos, 12 bytes each, {CYCLES} cycles; times in ms");
    println!("baud      read   wire    p50    p99  p50 over wire  missed");
    for (baud, fast) in [
        (1_000_000, FastSyncRead::Off),
        (1_000_000, FastSyncRead::On),
        (4_000_000, FastSyncRead::Off),
        (115_200, FastSyncRead::Off),
    ] {
        let ids = 1..=SERVOS as u8;
        let pty = ServoPty::open(ServoBus::new(ids.clone().map(ServoBuild::new), baud))?;
        let mut config = DynamixelConfig::new(pty.path(), ids);
        config.baud = baud;
        config.fast_sync_read = fast;
        let mut bus = Bus::new(&config);
        let mut port = SerialBus::open(pty.path(), baud, None, &mut bus)?;
        // Until every servo has said who it is, its return delay is not known.
        for _ in 0..200 {
            port.cycle(&mut bus)?;
        }
        let mut cycles_ms = Vec::with_capacity(CYCLES);
        let mut missed = 0;
        let count = if baud < 1_000_000 { CYCLES / 10 } else { CYCLES };
        while cycles_ms.len() < count {
            let before = bus.counters();
            port.cycle(&mut bus)?;
            let after = bus.counters();
            missed += bus.results().iter().filter(|r| r.is_err()).count();
            // Cycles that ask one servo for its temperature as well are longer by that question.
            match after.requests - before.requests {
                1 => cycles_ms.push(after.cycle_ns as f64 / 1e6),
                // The machine stood still for so long that all servos count as silent and rest.
                0 => std::thread::sleep(std::time::Duration::from_millis(5)),
                _ => {}
            }
        }
        cycles_ms.sort_by(f64::total_cmp);
        let reply = match fast {
            FastSyncRead::On => 8 + SERVOS * 16,
            _ => SERVOS * 23,
        };
        let wire_ms = wire_ns(14 + SERVOS + reply, baud) as f64 / 1e6;
        let p50 = cycles_ms[cycles_ms.len() / 2];
        let p99 = cycles_ms[cycles_ms.len() * 99 / 100];
        println!(
            "{baud:<9} {:<5} {wire_ms:6.3} {p50:6.3} {p99:6.3}  {:+12.1} %  {missed}",
            if fast == FastSyncRead::On { "fast" } else { "sync" },
            100.0 * (p50 / wire_ms - 1.0),
        );
    }
    Ok(())
}
