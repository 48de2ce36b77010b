//! A raw frame as one line: JSON for scripts, words for people.

use super::image_line::{joints, remarks, start};
use serde::Serialize;
use std::fmt::Write;
use taxel_hand::Freshness;
use taxel_wire::{Flags, Header, Hello, RawTaxel, RawView};

#[derive(Debug, Serialize)]
struct RawLine {
    seq: u64,
    t_ns: u64,
    latency_us: Option<f64>,
    threshold: f32,
    /// In the order of their numbers.
    taxels: Vec<TaxelLine>,
    joints: Vec<Option<f32>>,
    /// Frames that the reader was not given since its last one.
    skipped: u32,
    /// Whether the baseline is being measured, so that there is no force yet.
    calibrating: bool,
}

#[derive(Debug, Serialize)]
struct TaxelLine {
    counts: [u16; 3],
    /// Null where it is no number.
    force: Option<f32>,
    contact: bool,
    repaired: bool,
    /// Null where there is no value.
    age_us: Option<u32>,
    status: u8,
    faults: Vec<&'static str>,
}

/// The raw frame as one line of JSON, without the line break:
/// `{"seq","t_ns","latency_us","threshold","taxels":[{"counts","force","contact","repaired","age_us","status","faults"}],"joints",
/// "skipped","calibrating"}`.
pub fn json(header: &Header, raw: &RawView<'_>, latency_ns: Option<i64>) -> String {
    let taxel = |t: RawTaxel| TaxelLine {
        counts: t.counts,
        force: t.force.is_finite().then_some(t.force),
        contact: t.contact,
        repaired: t.repaired,
        age_us: (t.freshness != Freshness::Missing).then_some(t.age_us),
        status: t.status,
        faults: t.faults().map(taxel_hand::Fault::name).collect(),
    };
    let line = RawLine {
        seq: header.seq,
        t_ns: header.t_ns,
        latency_us: latency_ns.map(|ns| ns as f64 / 1000.0),
        threshold: raw.threshold,
        taxels: raw.taxels().map(taxel).collect(),
        joints: raw
            .joints()
            .map(|angle| angle.is_finite().then_some(angle))
            .collect(),
        skipped: header.skipped,
        calibrating: header.flags.contains(Flags::CALIBRATING),
    };
    serde_json::to_string(&line).expect("numbers and lists always serialise")
}

/// The name of each taxel, `MODULE/K` with its place in the module, for [`words`].
pub fn names(hello: &Hello) -> Vec<String> {
    let name = |taxel: u16, module: u16| match hello.modules.get(usize::from(module)) {
        Some(module) => format!("{} {}", module.name, taxel.wrapping_sub(module.first_taxel)),
        None => taxel.to_string(),
    };
    hello.taxels.iter().map(|t| name(t.taxel, t.module)).collect()
}

/// The raw frame in words: number, time, latency, contacts, the taxel pressed hardest with its counts.
pub fn words(header: &Header, raw: &RawView<'_>, latency_ns: Option<i64>, names: &[String]) -> String {
    let mut line = start(header, latency_ns);
    let fresh = raw.taxels().filter(|t| t.freshness == Freshness::Fresh).count();
    let contacts = raw.taxels().filter(|t| t.contact).count();
    let _ = write!(
        line,
        "  {fresh:>3} of {} taxels fresh  {contacts:>3} contacts",
        raw.taxels().len()
    );
    let strongest = raw
        .taxels()
        .enumerate()
        .max_by(|(_, a), (_, b)| a.force.total_cmp(&b.force));
    if let Some((
        taxel,
        RawTaxel {
            counts: [x, y, z],
            force,
            ..
        },
    )) = strongest
    {
        let name = names.get(taxel).cloned().unwrap_or_else(|| taxel.to_string());
        let _ = write!(
            line,
            "  most at {name}: {force:.0} over {:.0} (x {x} y {y} z {z})",
            raw.threshold
        );
    }
    line += &joints(raw.joints());
    if header.skipped > 0 {
        let _ = write!(line, "  {} skipped", header.skipped);
    }
    line + remarks(header)
}

#[cfg(test)]
mod tests {
    use super::*;
    use taxel_hand::{Fault, ForceFrame, TactileFrame};
    use taxel_wire::{Body, decode_packet, encode_raw_payload};

    #[test]
    fn a_raw_frame_tells_counts_forces_and_faults() {
        let mut frame = TactileFrame::new(2);
        frame.seq = 3;
        frame.counts[1] = [100, 200, 300];
        frame.freshness[1] = Freshness::Fresh;
        frame.age_ns[1] = 2_000_000;
        let mut force = ForceFrame::new(2);
        force.force[1] = 50.0;
        force.contact[1] = true;
        force.faults[0].insert(Fault::Missing);
        force.threshold = 10.0;
        let mut payload = Vec::new();
        encode_raw_payload(&frame, &force, None, &mut payload).unwrap();
        let packet = [
            &Header::of_frame(&frame, &force, payload.len())
                .with_skipped(4)
                .to_bytes()[..],
            &payload,
        ]
        .concat();
        let message = decode_packet(&packet).unwrap();
        let Body::Raw(raw) = message.body else {
            panic!("not raw")
        };

        let value: serde_json::Value = serde_json::from_str(&json(&message.header, &raw, None)).unwrap();
        assert_eq!(value["taxels"][1]["counts"], serde_json::json!([100, 200, 300]));
        assert_eq!(value["taxels"][1]["age_us"], 2000);
        assert_eq!(value["taxels"][0]["age_us"], serde_json::Value::Null);
        assert_eq!(value["taxels"][0]["faults"], serde_json::json!(["missing"]));
        assert_eq!(
            (&value["skipped"], &value["calibrating"]),
            (&4.into(), &false.into())
        );
        let words = words(&message.header, &raw, None, &["a 0".into(), "a 1".into()]);
        for part in [
            "1 of 2 taxels fresh",
            "1 contacts",
            "a 1: 50 over 10 (x 100 y 200 z 300)",
        ] {
            assert!(words.contains(part), "{part}: {words}");
        }
    }
}
