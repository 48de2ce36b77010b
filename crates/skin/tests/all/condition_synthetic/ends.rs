//! Taxels that read an end of their range.

use taxel_hand::{ForceFrame, Freshness, TactileFrame};
use taxel_skin::{ConditionConfig, Conditioner, ICUB_OUT_OF_RANGE, Layout, STATUS_ERROR};

const TOP: u16 = u16::MAX;

/// Whether the first taxel of a hand is said to be saturated, with these counts and this status.
fn is_saturated(layout: &Layout, counts: [u16; 3], status: u8, freshness: Freshness) -> bool {
    let mut conditioner = Conditioner::for_layout(layout, ConditionConfig::robust()).unwrap();
    let (mut frame, mut out) = (TactileFrame::new(layout.len()), ForceFrame::default());
    frame.age_ns.fill(0);
    frame.freshness.fill(freshness);
    frame.counts.fill(counts);
    frame.status.fill(status);
    conditioner.process(&frame, &mut out);
    assert!(
        out.saturated.iter().all(|s| *s == out.saturated[0]),
        "{}",
        layout.name
    );
    out.saturated[0]
}

#[test]
fn a_taxel_is_saturated_as_its_boards_protocol_says() {
    for (name, counts, status, expected) in [
        ("uskin-module", [30_000, 30_000, 9_000], 0, false),
        ("uskin-module", [30_000, 30_000, TOP], 0, true),
        ("uskin-module", [30_000, 0, 9_000], 0, true),
        ("cpm-finger", [0, 0, 9_000], 0, false),
        ("cpm-finger", [0, 0, TOP], 0, true),
        ("cyskin-triangle", [0, 0, 9_000], 0, false),
        ("cyskin-triangle", [0, 0, TOP], STATUS_ERROR, false),
        ("icub-forearm", [0, 0, 240 << 8], 0, false),
        ("icub-forearm", [0, 0, 0], ICUB_OUT_OF_RANGE, true),
        ("icub-forearm", [0, 0, 0], ICUB_OUT_OF_RANGE | STATUS_ERROR, false),
        ("tekscan-6077", [0, 0, 0], 0, false),
        ("tekscan-6077", [0, 0, TOP], 0, true),
        ("grid:4x4", [0, 0, 9_000], 0, false),
        ("grid:4x4", [0, 0, TOP], 0, true),
    ] {
        let layout = Layout::resolve(name).unwrap();
        let fresh = is_saturated(&layout, counts, status, Freshness::Fresh);
        assert_eq!(fresh, expected, "{name}, {counts:?}, status {status:#x}");
        let stale = is_saturated(&layout, counts, status, Freshness::Stale);
        assert!(!stale, "{name}, {counts:?}, stale");
    }
}
