//! What the settings of sweeps may be.

use taxel_skin::SweepConfig;

#[test]
fn settings_outside_their_range_are_named_with_their_limits() {
    SweepConfig::default().check().unwrap();
    type Change = fn(&mut SweepConfig);
    let cases: [(Change, &str); 6] = [
        (
            |c| c.board_period_ms = Some(0.5),
            "sweep: board_period_ms = 0.5 is outside 1 to 10000",
        ),
        (
            |c| c.board_period_ms = Some(f64::NAN),
            "sweep: board_period_ms = NaN is outside 1 to 10000",
        ),
        (
            |c| c.deadline_ms = Some(0.0),
            "sweep: deadline_ms = 0 is outside 0.1 to 10000",
        ),
        (
            |c| c.stale_after_ms = Some(1e9),
            "sweep: stale_after_ms = 1000000000 is outside 1 to 60000",
        ),
        (
            |c| c.silent_after_sweeps = 0,
            "sweep: silent_after_sweeps = 0 is outside 1 to 250",
        ),
        (
            |c| c.settle_ms = -1.0,
            "sweep: settle_ms = -1 is outside 0 to 60000",
        ),
    ];
    for (change, expected) in cases {
        let mut config = SweepConfig::default();
        change(&mut config);
        assert_eq!(config.check().unwrap_err().to_string(), expected);
    }
}

#[test]
fn the_table_of_the_configuration_reads_and_refuses_unknown_keys() {
    let config: SweepConfig = toml::from_str("board_period_ms = 12\ndeadline_ms = 8.5").unwrap();
    let expected = SweepConfig {
        board_period_ms: Some(12.0),
        deadline_ms: Some(8.5),
        ..SweepConfig::default()
    };
    assert_eq!(config, expected);
    assert_eq!(config.board_period_ns(), 12_000_000);
    assert_eq!(SweepConfig::default().board_period_ns(), 10_000_000, "assumed");
    let error = toml::from_str::<SweepConfig>("dead_line_ms = 8")
        .unwrap_err()
        .to_string();
    assert!(error.contains("dead_line_ms"), "{error}");
}
