//! Reads the joints of a bus of Dynamixel servos for some cycles and prints the last one as JSON.
//!
//!     cargo run -p taxel-joints --example read_joints -- /dev/ttyUSB0 --ids 1-16 [--baud 1000000] [--cycles 100]
//!         [--fast auto|on|off] [--margin-ms 4] [--scan]

use serde_json::{Value, json};
use std::error::Error;
use std::path::Path;
use taxel_joints::bus::Bus;
use taxel_joints::{DynamixelConfig, FastSyncRead, SerialBus, scan};

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let path = arguments.next().ok_or("the serial device is missing")?;
    let (mut ids, mut baud, mut cycles, mut fast) = (1..=16, 1_000_000, 100, FastSyncRead::Auto);
    let mut margin_ns = None;
    let mut scanning = false;
    while let Some(argument) = arguments.next() {
        let mut value = || arguments.next().ok_or(format!("{argument} needs a value"));
        match argument.as_str() {
            "--ids" => {
                let text = value()?;
                let (first, last) = text.split_once('-').unwrap_or((&text, &text));
                ids = first.parse()?..=last.parse()?;
            }
            "--baud" => baud = value()?.parse()?,
            "--cycles" => cycles = value()?.parse()?,
            "--margin-ms" => margin_ns = Some(1_000_000 * value()?.parse::<u64>()?),
            "--fast" => {
                fast = match value()?.as_str() {
                    "auto" => FastSyncRead::Auto,
                    "on" => FastSyncRead::On,
                    "off" => FastSyncRead::Off,
                    other => return Err(format!("--fast {other}: auto, on or off").into()),
                }
            }
            "--scan" => scanning = true,
            other => return Err(format!("no option is called {other}").into()),
        }
    }
    if scanning {
        for servo in scan(Path::new(&path), baud)? {
            println!(
                "{}",
                json!({"id": servo.id, "model": servo.model_number, "firmware": servo.firmware, "alert": servo.alert})
            );
        }
        return Ok(());
    }
    let mut config = DynamixelConfig::new(&path, ids);
    config.baud = baud;
    config.fast_sync_read = fast;
    config.check()?;
    let mut bus = Bus::new(&config);
    let mut port = SerialBus::open(Path::new(&path), baud, margin_ns, &mut bus)?;
    let mut cycle_us = Vec::new();
    for _ in 0..cycles {
        port.cycle(&mut bus)?;
        cycle_us.push(bus.counters().cycle_ns as f64 / 1e3);
    }
    cycle_us.sort_by(f64::total_cmp);
    let servos: Vec<Value> = config
        .servo
        .iter()
        .zip(bus.results())
        .enumerate()
        .map(|(i, (servo, result))| {
            let state = bus.servo(i).copied().unwrap_or_default();
            let c = state.counters;
            let mut row = json!({
                "id": servo.id,
                "model": state.identity.map(|d| d.model_number),
                "firmware": state.identity.map(|d| d.firmware),
                "return_delay_us": state.identity.map(|d| d.return_delay_us),
                "voltage_v": state.voltage_v,
                "temperature_c": state.temperature_c,
                "hardware_error": state.hardware_error.map(|e| e.0),
                "counters": {"ok": c.ok, "timeouts": c.timeouts, "bad_crc": c.bad_crc, "alerts": c.alerts,
                             "late": c.late, "double": c.double, "refused": c.refused, "rested": c.rested},
            });
            match result {
                Ok(r) => {
                    row["position"] = json!(r.position);
                    row["angle_rad"] = json!(r.angle_rad);
                    row["velocity_rad_s"] = json!(r.velocity_rad_s);
                    row["current_a"] = json!(r.current_a);
                    row["current_counts"] = json!(r.current_counts);
                    row["pwm"] = json!(r.pwm);
                    row["alert"] = json!(r.alert);
                    row["t_ns"] = json!(r.t_ns);
                }
                Err(e) => row["error"] = json!(e.to_string()),
            }
            row
        })
        .collect();
    let latency = port.latency();
    println!(
        "{}",
        json!({
            "servos": servos,
            "fast": format!("{:?}", bus.fast_state()),
            "cycles": bus.counters().cycles,
            "cycle_us_p50": cycle_us[cycle_us.len() / 2],
            "noise_bytes": bus.counters().noise_bytes,
            "low_latency": latency.low_latency,
            "ftdi_timer_ms": latency.ftdi_timer_ms,
        })
    );
    Ok(())
}
