//! Simulated Dynamixel servos behind a pseudo terminal, for any client that opens a serial port.
//!
//!     cargo run -p taxel-sim --example servo_bus -- --ids 1-16 --baud 1000000
//!
//! prints the path of the terminal and runs until its standard input ends. Lines of standard input
//! break and mend servos: `fault ID
//! silent|bad-crc|truncated:BYTES|late:MS|garbage:BYTES|noise:BYTES|refuse:NUMBER|twice [EVERY]`, `mend ID`, `error ID
//! BITS`; `mode ID OPERATING_MODE`; `register ID ADDRESS BYTES` prints what stands in a servo's table; `stopped ID` prints when its bus watchdog
//! stopped it (CLOCK_MONOTONIC, nanoseconds; 0 for never); `watchdogs hold` has no time pass for any of these, so that none
//! acts because this machine is held up, until `watchdogs run`; `traffic` prints how
//! many bytes the bus has heard, has said, and has still to say, and whether its client has hung up
//! (1) or not (0). Options: `--return-delay STEPS` (of 2 us), `--motion still|sine`, `--no-fast`,
//! `--stop-after-silence`, `--link PATH` (a stable name that points to the terminal), `--load` (servos of a gripper that
//! squeezes something springy: in PWM mode, each comes to rest at an angle), `--forearm PLACE` (that of a simulated
//! forearm, 0 wrist to 1 elbow), `--potentiometers PATH` (a link to a terminal on which a line comes every 10 ms, `pID
//! COUNT ...`, a quarter of each servo's position; `line TEXT` has this text come instead, with `\\n` at its ends, `line`
//! nothing, and `lines` what was).

use std::error::Error;
use std::io::BufRead;
use std::path::PathBuf;
use std::sync::{Arc, Mutex};
use std::time::Duration;
use taxel_sim::servo::{
    AfterSilence, ForearmFinger, LinePty, Load, Motion, ServoBuild, ServoBus, ServoPty, SpringWall,
    StableLink, servo_clock_ns,
};

fn main() -> Result<(), Box<dyn Error>> {
    let (mut ids, mut baud, mut delay) = (1..=16, 1_000_000, 0);
    let (mut sine, mut fast, mut loaded, mut after) = (false, true, false, AfterSilence::Answer);
    let (mut place, mut potentiometers) = (None, None);
    let mut link: Option<PathBuf> = None;
    let mut arguments = std::env::args().skip(1);
    while let Some(argument) = arguments.next() {
        let mut value = || arguments.next().ok_or(format!("{argument} needs a value"));
        match argument.as_str() {
            "--ids" => {
                let text = value()?;
                let (first, last) = text.split_once('-').unwrap_or((&text, &text));
                ids = first.parse()?..=last.parse()?;
            }
            "--baud" => baud = value()?.parse()?,
            "--return-delay" => delay = value()?.parse()?,
            "--motion" => sine = value()? == "sine",
            "--no-fast" => fast = false,
            "--load" => loaded = true,
            "--forearm" => (loaded, place) = (true, Some(ForearmFinger::at(value()?.parse()?)?)),
            "--potentiometers" => potentiometers = Some(PathBuf::from(value()?)),
            "--stop-after-silence" => after = AfterSilence::Stop,
            "--link" => link = Some(value()?.into()),
            other => {
                return Err(format!("no option is called {other}; the head of the file lists them").into());
            }
        }
    }
    let servos = ids.clone().map(|id| {
        let motion = if sine {
            Motion::Sine {
                centre: 2048.0,
                amplitude: 500.0,
                hz: 1.0,
                phase: f64::from(id),
            }
        } else {
            ServoBuild::new(id).motion
        };
        let motion = place.map_or(motion, |finger| Motion::Still(finger.open().round() as i32));
        let open = motion.position(0);
        let wall = || -> Arc<dyn Load> {
            if let Some(finger) = place {
                return Arc::new(finger);
            }
            Arc::new(SpringWall {
                open,
                touch: open + 400.0,
                counts_per_pulse: 2.0,
                efficiency: 0.5,
            })
        };
        ServoBuild {
            motion,
            return_delay: delay,
            fast,
            load: loaded.then(wall),
            ..ServoBuild::new(id)
        }
    });
    let mut bus = ServoBus::new(servos, baud);
    if loaded {
        for id in ids.clone() {
            if let Some(servo) = bus.servo_mut(id) {
                servo.set_operating_mode(16);
            }
        }
    }
    bus.set_after_silence(after);
    let pty = Arc::new(ServoPty::open(bus)?);
    let instead: Arc<Mutex<Option<String>>> = Arc::default();
    let _lines = (potentiometers.as_ref())
        .map(|link| -> Result<_, Box<dyn Error>> {
            let (pty, instead) = (pty.clone(), instead.clone());
            let lines = LinePty::open(Duration::from_millis(10), move |now_ns| {
                if let Some(text) = instead.lock().ok().and_then(|text| text.clone()) {
                    return text.replace("\\n", "\n").into_bytes();
                }
                let bus = pty.bus();
                let each = ids.clone().filter_map(|id| {
                    let count = bus.servo(id)?.position(now_ns) / 4.0;
                    Some(format!("p{id} {count:.0} "))
                });
                (each.collect::<String>() + "\n").into_bytes()
            })?;
            Ok((StableLink::new(link, lines.path())?, lines))
        })
        .transpose()?;
    let _link = link.map(|link| StableLink::new(&link, pty.path())).transpose()?;
    println!("{}", pty.path().display());
    for line in std::io::stdin().lock().lines() {
        let line = line?;
        let told = match line.split_once(' ').unwrap_or((&line, "")) {
            ("line", text) => Some(Some(text.to_owned())),
            ("lines", _) => Some(None),
            _ => None,
        };
        if let (Some(told), Ok(mut instead)) = (told, instead.lock()) {
            *instead = told;
            println!("ok");
            continue;
        }
        match command(&pty, &line) {
            Ok(answer) => println!("{answer}"),
            Err(problem) => println!("`{line}`: {problem}"),
        }
    }
    Ok(())
}

fn command(pty: &ServoPty, line: &str) -> Result<String, Box<dyn Error>> {
    let words: Vec<&str> = line.split_whitespace().collect();
    let mut bus = pty.bus();
    let known = match words[..] {
        ["fault", id, fault] => bus.set_fault(id.parse()?, Some(fault.parse()?), 1),
        ["fault", id, fault, every] => bus.set_fault(id.parse()?, Some(fault.parse()?), every.parse()?),
        ["mend", id] => bus.set_fault(id.parse()?, None, 1),
        ["error", id, bits] => {
            let servo = bus.servo_mut(id.parse()?).ok_or("no such servo")?;
            servo.set_hardware_error(bits.parse()?);
            true
        }
        ["mode", id, mode] => {
            let servo = bus.servo_mut(id.parse()?).ok_or("no such servo")?;
            servo.set_operating_mode(mode.parse()?);
            true
        }
        ["register", id, at, bytes] => {
            let servo = bus.servo_mut(id.parse()?).ok_or("no such servo")?;
            return Ok(servo.register(at.parse()?, bytes.parse()?).to_string());
        }
        ["stopped", id] => {
            let servo = bus.servo(id.parse()?).ok_or("no such servo")?;
            return Ok(servo.stopped_ns().unwrap_or(0).to_string());
        }
        ["watchdogs", "hold"] => {
            bus.hold_watchdogs();
            true
        }
        ["watchdogs", "run"] => {
            bus.run_watchdogs(servo_clock_ns());
            true
        }
        ["traffic"] => {
            let t = bus.traffic();
            let (heard, said, due) = (t.heard_bytes, t.said_bytes, t.due_bytes);
            return Ok(format!("{heard} {said} {due} {}", u8::from(t.hung_up)));
        }
        _ => {
            return Err(
                "commands are fault, mend, error, mode, register, stopped, watchdogs and traffic".into(),
            );
        }
    };
    if known {
        Ok("ok".into())
    } else {
        Err("no such servo".into())
    }
}
