//! The joints in the status report. What a source of angles alone has to tell is a part of its own,
//! which its first key tells from others.

use super::report::{keys, report};
use serde::{Deserialize, Serialize};

/// Reports whose first key is required, since that tells whether it is there at all.
macro_rules! part {
    ($($(#[$doc:meta])* $name:ident {
        $(#[doc = $of_first:literal])* $first:ident: $first_type:ty,
        $($(#[doc = $about:literal])* $key:ident: $type:ty,)*
    })*) => {$(
        $(#[$doc])*
        #[derive(Debug, Default, Clone, PartialEq, Serialize, Deserialize)]
        pub struct $name {
            $(#[doc = $of_first])* pub $first: $first_type,
            $($(#[doc = $about])* #[serde(default)] pub $key: $type,)*
        }
        keys!($name { $(#[doc = $of_first])* $first: $first_type, $($(#[doc = $about])* $key: $type,)* });
    )*};
}

report! {
    /// The joints.
    JointsStatus {
        /// Where they are read, as the configuration has it.
        source: String,
        /// `connected`, `waiting` for what was never there, or `gone`.
        state: String,
        /// Kinds of the problems of the joints as a whole.
        problems: Vec<String>,
        /// Readings of each joint per second.
        cycle_hz: f64,
        /// What is sent.
        writes: String,
        /// One entry per joint.
        joints: Vec<JointStatus>,
        /// What a bus of servos has to tell.
        #[serde(flatten)]
        servos: Option<ServosStatus>,
        /// What an Allegro hand has to tell.
        #[serde(flatten)]
        allegro: Option<AllegroStatus>,
        /// What potentiometers have to tell, which are the last of the joints.
        #[serde(flatten)]
        analogue: Option<AnalogueStatus>,
    }

    /// One joint.
    JointStatus {
        /// Its name.
        name: String,
        /// Whether it answers, in words.
        state: String,
        /// Kinds of its problems.
        problems: Vec<String>,
        /// Its angle in the newest image, radians; null where unknown.
        angle_rad: Option<f64>,
        /// Age of that, milliseconds.
        age_ms: Option<f64>,
        /// What its servo has to tell.
        #[serde(flatten)]
        servo: Option<ServoStatus>,
    }
}

part! {
    /// What a bus of servos has to tell.
    ServosStatus {
        /// Bits per second.
        baud: u32,
        /// Why it is not connected.
        reason: Option<String>,
        /// The device behind its name.
        device: Option<String>,
        /// How often the port was opened.
        opened: u64,
        /// Cycles per second that the configuration asks for.
        wanted_hz: f64,
        /// How long the newest cycle took, milliseconds.
        cycle_ms: f64,
        /// Whether all servos answer in one packet, in words.
        fast_sync_read: String,
        /// Whether the driver hands bytes over at once.
        low_latency: Option<bool>,
        /// Latency timer of an FTDI adapter, milliseconds.
        ftdi_latency_ms: Option<u32>,
        /// After which silence of the daemon motors are switched off, milliseconds; null where
        /// nothing is written.
        watchdog_ms: Option<u32>,
        /// Writes to servos that were confirmed.
        writes_ok: u64,
        /// Writes to servos that were not confirmed.
        writes_failed: u64,
        /// Rounds of reading all servos.
        cycles: u64,
        /// Requests sent.
        requests: u64,
        /// Readings of all servos together.
        readings: u64,
        /// Answers that did not come in time.
        timeouts: u64,
        /// Answers that came damaged.
        bad_crc: u64,
        /// Answers that report a hardware error.
        alerts: u64,
        /// Answers that came too late.
        late: u64,
        /// Second answers to one request.
        double: u64,
        /// Bytes that belong to no packet.
        noise_bytes: u64,
        /// Packets of servos that are not in the configuration.
        foreign: u64,
    }

    /// What an Allegro hand has to tell.
    AllegroStatus {
        /// Frames with the angles of each finger.
        positions: Vec<u64>,
        /// Version of the hand, where it is told.
        version: Option<u8>,
        /// `up`, `down` or `absent`.
        link: String,
        /// Frames of the hand that could not be read.
        malformed: u64,
        /// Messages in which a hand of version 5 reported an error of a motor.
        motor_errors: u64,
        /// Frames received.
        received: u64,
        /// Frames that the kernel dropped.
        lost_in_kernel: u64,
        /// Datagrams or lines that were no frame.
        undecodable: u64,
        /// How often the source was opened anew.
        reopens: u64,
        /// Frames sent.
        sent: u64,
    }

    /// What potentiometers have to tell.
    AnalogueStatus {
        /// The device of the potentiometers, as the configuration has it.
        analogue_source: String,
        /// Why it is not open; null where it is.
        analogue_reason: Option<String>,
        /// How often it was opened.
        analogue_opened: u64,
        /// Lines that could be read.
        analogue_lines: u64,
        /// Lines that could not.
        analogue_malformed: u64,
    }

    /// What one servo has to tell.
    ServoStatus {
        /// Its id.
        id: u8,
        /// Velocity, radians per second.
        velocity_rad_s: Option<f64>,
        /// Current, amperes, with the sign of the joint: negated where `direction` is -1.
        current_a: Option<f64>,
        /// Temperature, degrees Celsius.
        temperature_c: Option<u8>,
        /// Supply, volts.
        voltage_v: Option<f64>,
        /// What it complains of, in words.
        hardware_error: Option<String>,
        /// Whether its motor is switched on. It holds nothing where its watchdog has stopped it.
        torque_enabled: Option<bool>,
        /// Whether its bus watchdog has stopped its motor, which is switched on.
        watchdog_tripped: Option<bool>,
        /// Its model.
        model: Option<String>,
        /// Version of its firmware.
        firmware: Option<u8>,
        /// How long it waits before it answers, microseconds.
        return_delay_us: Option<u16>,
        /// Readings of the servo.
        readings: u64,
        /// Answers that did not come in time.
        timeouts: u64,
        /// Answers that came damaged.
        bad_crc: u64,
        /// Answers that report a hardware error.
        alerts: u64,
        /// Answers that came too late.
        late: u64,
        /// Second answers to one request: two servos have one id.
        double: u64,
        /// Requests that the servo refused.
        refused: u64,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::Value;

    #[test]
    fn joints_have_the_keys_of_their_source_alone() {
        let servo = JointStatus {
            servo: Some(ServoStatus::default()),
            ..JointStatus::default()
        };
        let servos = JointsStatus {
            joints: vec![servo],
            servos: Some(ServosStatus::default()),
            ..JointsStatus::default()
        };
        let hand = JointsStatus {
            joints: vec![JointStatus::default()],
            allegro: Some(AllegroStatus::default()),
            ..JointsStatus::default()
        };
        for (status, has, lacks) in [(servos, "baud", "positions"), (hand, "positions", "baud")] {
            let value = serde_json::to_value(&status).unwrap();
            assert!(value.get(has).is_some() && value.get(lacks).is_none(), "{value}");
            assert_eq!(value["joints"][0].get("id").is_some(), has == "baud", "{value}");
            assert_eq!(value.get("reason"), (has == "baud").then_some(&Value::Null));
            assert_eq!(serde_json::from_value::<JointsStatus>(value).unwrap(), status);
        }
    }
}
