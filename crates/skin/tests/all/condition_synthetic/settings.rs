//! What can be set: the publication's rules, thresholds per taxel, values out of range.

use super::skin::{MS, Skin};
use taxel_hand::{Fault, ForceFrame, Freshness, TactileFrame};
use taxel_skin::{
    BaselineSource, ConditionConfig, ConditionError, Conditioner, FaultRule, MagnitudeMode, ThresholdSource,
};

#[test]
fn the_paper_preset_is_equations_1_and_2_on_two_frames() {
    let mut conditioner = Conditioner::new(5, ConditionConfig::paper()).expect("valid");
    let (mut frame, mut out) = (TactileFrame::new(5), ForceFrame::new(5));
    frame.freshness[..4].fill(Freshness::Fresh);
    frame.age_ns[..4].fill(0);
    // x of frame 0: 10, 10, 10, 50: mean 20, population sd 17.3, so taxel 3 is faulty; taxel 4 is absent.
    let frames = [
        [[10, 1, 2], [10, 1, 2], [10, 1, 2], [50, 1, 2]],
        [[11, 1, 2], [10, 1, 3], [10, 1, 2], [90, 1, 2]],
        [[11, 1, 2], [12, 1, 2], [8, 1, 2], [50, 9, 9]],
    ];
    // Taxel 4 never speaks, so frame 0 is the tenth, when waiting ends.
    for counts in std::iter::repeat_n(frames[0], 10).chain([frames[1], frames[2]]) {
        frame.t_ns += 33 * MS;
        frame.counts[..4].copy_from_slice(&counts);
        conditioner.process(&frame, &mut out);
    }
    assert_eq!(
        conditioner.threshold(),
        21.0,
        "the largest of |121-100|, |9-4|; the faulty taxel's 5600 is left out"
    );
    assert_eq!(out.force, [21.0, 44.0, 36.0, 0.0, 0.0]);
    assert_eq!(
        out.contact,
        [false, true, true, false, false],
        "strictly above 21"
    );
    assert!(out.faults[3].contains(Fault::PaperRule) && out.faults[4].contains(Fault::Missing));
    assert_eq!(
        conditioner
            .report()
            .expect("calibrated")
            .faulty_for(Fault::PaperRule),
        1
    );
}

#[test]
fn every_switch_of_the_paper_preset_works_on_its_own() {
    let robust = ConditionConfig::robust;
    for config in [
        ConditionConfig {
            baseline: BaselineSource::FirstFrame,
            ..robust()
        },
        ConditionConfig {
            threshold: ThresholdSource::FirstPair,
            threshold_margin: 4.0,
            ..robust()
        },
        ConditionConfig {
            fault_rule: FaultRule::Paper,
            paper_sigmas: 10.0,
            ..robust()
        },
        ConditionConfig {
            magnitude: MagnitudeMode::Literal,
            ..robust()
        },
        ConditionConfig {
            magnitude: MagnitudeMode::LiteralSquared,
            ..robust()
        },
        ConditionConfig {
            magnitude: MagnitudeMode::VectorSquared,
            ..robust()
        },
    ] {
        let mut skin = Skin::new(8, 100, config.clone());
        skin.calibrate();
        assert!(skin.conditioner.threshold() > 0.0, "{config:?}");
        for a in 0..3 {
            skin.truth[4][a] += 5_000;
        }
        skin.run_ms(50);
        assert!(
            skin.out.contact[4],
            "{config:?}: {:?}, theta {}",
            skin.out.force, skin.out.threshold
        );
    }
}

#[test]
fn thresholds_per_taxel_let_quiet_taxels_feel_less() {
    let config = ConditionConfig {
        threshold_per_taxel: true,
        ..ConditionConfig::robust()
    };
    let mut skin = Skin::new(3, 100, config);
    skin.noise[0] = [1, 1, 1];
    skin.calibrate();
    assert_eq!(skin.conditioner.threshold_of(0), 10.0, "the least threshold");
    assert!(skin.conditioner.threshold_of(1) > 30.0);
    for n in 0..2 {
        skin.truth[n][0] += 20;
    }
    skin.run_ms(30);
    assert!(skin.out.contact[0] && !skin.out.contact[1]);
}

#[test]
fn the_hands_threshold_is_the_greatest_also_of_a_taxel_that_spoke_late() {
    let config = ConditionConfig {
        threshold_per_taxel: true,
        ..ConditionConfig::robust()
    };
    let mut skin = Skin::new(3, 100, config);
    skin.noise[..2].fill([1, 1, 1]);
    while skin
        .step_with(|frame| frame.freshness[2] = Freshness::Missing)
        .calibrating
    {}
    assert_eq!(skin.conditioner.threshold(), 10.0);
    skin.frame.freshness[2] = Freshness::Fresh;
    skin.run_ms(2_000);
    let late = skin.conditioner.threshold_of(2);
    assert!(late > 30.0 && skin.conditioner.threshold() == late, "{late}");
}

#[test]
fn settings_read_from_toml_refuse_unknown_keys_and_values_out_of_range() {
    let config: ConditionConfig =
        toml::from_str("magnitude = \"literal_squared\"\nmasked_taxels = [3]\n").expect("valid");
    assert_eq!(config.magnitude, MagnitudeMode::LiteralSquared);
    assert_eq!(
        config.threshold_margin,
        ConditionConfig::robust().threshold_margin
    );
    let paper = toml::to_string(&ConditionConfig::paper()).expect("serializable");
    assert_eq!(
        toml::from_str::<ConditionConfig>(&paper).expect("its own output"),
        ConditionConfig::paper()
    );
    assert_eq!(
        toml::from_str::<ConditionConfig>("repair_wraps = true\npreset = \"paper\"").expect("valid"),
        ConditionConfig {
            repair_wraps: true,
            ..ConditionConfig::paper()
        }
    );
    assert!(toml::from_str::<ConditionConfig>("treshold_margin = 2.0").is_err());

    assert!(matches!(
        Conditioner::new(3, config).err(),
        Some(ConditionError::MaskedTaxel { taxel: 3, taxels: 3 })
    ));
    assert_eq!(
        Conditioner::new(0, ConditionConfig::robust()).err(),
        Some(ConditionError::Taxels { taxels: 0 })
    );
    let robust = ConditionConfig::robust;
    for (config, key) in [
        (
            ConditionConfig {
                threshold_margin: f64::NAN,
                ..robust()
            },
            "threshold_margin",
        ),
        (
            ConditionConfig {
                threshold_margin: 0.5,
                ..robust()
            },
            "threshold_margin",
        ),
        (
            ConditionConfig {
                threshold_release: 1.5,
                ..robust()
            },
            "threshold_release",
        ),
        (
            ConditionConfig {
                calibration_ms: 0,
                ..robust()
            },
            "calibration_ms",
        ),
        (
            ConditionConfig {
                calibration_min_frames: 1,
                ..robust()
            },
            "calibration_min_frames",
        ),
        (
            ConditionConfig {
                paper_sigmas: 0.0,
                ..robust()
            },
            "paper_sigmas",
        ),
        (
            ConditionConfig {
                drift_quiet_share: 0.9,
                ..robust()
            },
            "drift_quiet_share",
        ),
        (
            ConditionConfig {
                jump_counts: 70_000,
                ..robust()
            },
            "jump_counts",
        ),
    ] {
        match Conditioner::new(3, config) {
            Err(ConditionError::OutOfRange(range)) => assert_eq!(range.key, key),
            other => panic!("{key}: {:?}", other.err()),
        }
    }
}
