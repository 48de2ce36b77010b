//! A cycle allocates nothing, whatever its servos do.

use taxel_joints::bus::{Bus, Step, WriteCommand};
use taxel_joints::{DynamixelConfig, FastSyncRead};
use taxel_sim::servo::{ServoBuild, ServoBus, ServoFault};

#[global_allocator]
static ALLOCATOR: taxel_allocations::Counting = taxel_allocations::Counting;

/// Runs `f` and adds what it allocates to `count`.
fn counted<T>(count: &mut u64, f: impl FnOnce() -> T) -> T {
    let (result, allocations) = taxel_allocations::during(f);
    *count += allocations;
    result
}

#[test]
fn no_cycle_allocates() {
    for fast in [FastSyncRead::Off, FastSyncRead::Auto] {
        let mut config = DynamixelConfig::new("none", 1..=16);
        (config.fast_sync_read, config.allow_writes) = (fast, true);
        let mut bus = Bus::new(&config);
        let mut servos = ServoBus::new((1..=16).map(ServoBuild::new), 1_000_000);
        for (id, fault) in [
            (3, ServoFault::Silent),
            (5, ServoFault::BadCrc),
            (8, ServoFault::Truncated { bytes: 8 }),
            (11, ServoFault::Late { by_ns: 9_000_000 }),
            (14, ServoFault::Noise { bytes: 400 }),
        ] {
            servos.set_fault(id, Some(fault), 7);
        }
        let (mut now_ns, mut allocations, mut arrived) = (0, 0, Vec::new());
        let told = [
            WriteCommand::Start(9),
            WriteCommand::GoalPwm(5),
            WriteCommand::Torque(false),
            WriteCommand::Torque(true),
        ];
        for cycle in 0..300 {
            counted(&mut allocations, || {
                // What is refused is none the less.
                let _ = bus.numbered_command(cycle, cycle as usize % 16, told[cycle as usize / 16 % 4]);
                let _ = bus.command_together(1000 + cycle, &[(2, 30), (6, 40), (9, 50)]);
                bus.begin(now_ns);
            });
            loop {
                match counted(&mut allocations, || bus.step(now_ns)) {
                    Step::Send => {
                        servos.receive(bus.request(), now_ns);
                        counted(&mut allocations, || bus.sent(now_ns));
                    }
                    Step::Wait { until_ns } => {
                        now_ns = servos
                            .next_due_ns()
                            .unwrap_or(until_ns)
                            .clamp(now_ns, until_ns.max(now_ns));
                        arrived.clear();
                        servos.take_due(now_ns, &mut arrived);
                        for piece in arrived.chunks(40) {
                            counted(&mut allocations, || {
                                bus.space()[..piece.len()].copy_from_slice(piece);
                                bus.take_bytes(piece.len(), now_ns);
                            });
                        }
                    }
                    Step::Done => break,
                }
            }
            now_ns += 1_000_000;
        }
        assert_eq!(bus.counters().cycles, 300);
        assert!(bus.counters().writes_ok > 100);
        assert_eq!(allocations, 0, "{fast:?}");
    }
}
