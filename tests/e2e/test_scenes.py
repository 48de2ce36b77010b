"""The simulator's scenes through the bus, at the daemon's own tick: each image against the counts it was made from."""

import signal

import pytest
import taxel_reader
from conditioning import DAEMON_SETTINGS
from harness.compare import fits_the_counts

SCENES = ["tap", "ball-grasp", "slip", "worst-case"]


@pytest.fixture
def simulate(buses, play):
    return lambda scene: play(scene, buses.sources, "--seed", "5")


@pytest.mark.parametrize("scene", SCENES)
def test_every_image_of_a_scene_fits_the_counts_it_was_made_from(start, simulate, hand, scene):
    daemon = start(
        tick={"mode": "timer", "rate_hz": 30.0},
        boards={"mode": "free-running"},
        # A simulator held up by a busy machine is not what is tested here.
        sweep={"board_period_ms": 10.0, "stale_after_ms": 60_000.0},
        conditioning=DAEMON_SETTINGS,
    )
    simulate(scene)
    with taxel_reader.connect(daemon.images, raw=True, every=True) as reader:
        fits_the_counts(daemon, reader, hand, 10)


# What is broken in the scene, by module and taxel, and the reasons that name it. A dead chip also has a status byte
# that reports an error, and a value that wraps all the time is also noisy.
BROKEN = {
    ("index tip", 5): {"dead", "status"},
    ("ring middle", 12): {"dead", "status"},
    ("middle tip", 6): {"stuck"},
    ("index distal", 9): {"noisy"},
    ("middle middle", 0): {"status"},
    ("thumb distal", 3): {"wrapping", "noisy"},
}


def test_every_fault_of_the_faulty_hand_is_found_with_its_reason(start, simulate):
    daemon = start(
        tick={"mode": "timer", "rate_hz": 30.0}, boards={"mode": "free-running"}, sweep={"board_period_ms": 10.0}
    )
    simulate("faulty-hand")

    def found(status):
        reasons = {(f["module"], f["k"]): f["reasons"] for f in status["faults"]}
        return all(why & set(reasons.get(place, [])) for place, why in BROKEN.items())

    daemon.wait_status(found, "not every fault is found")
    daemon.wait_status(
        lambda s: all(s["conditioning"][kind] > 0 for kind in ["samples", "held", "glitches", "wraps", "status_errors"]),
        "not every kind of bad sample is counted",
    )

    def board(status, module):
        return next(b for b in status["boards"] if b["module"] == module)

    def recovered(status):
        fallen = board(status, "middle proximal")
        return fallen["restarts"] > 0 and fallen["state"] == "living"

    daemon.wait_status(recovered, "the board that lost its power is not started again")
    daemon.wait_status(lambda s: board(s, "ring proximal")["queue_overflows"] > 0, "the overflowing board is not counted")


def test_boards_are_started_and_stopped_by_the_daemon(start, simulate):
    daemon = start(boards={"mode": "free-running"}, sweep={"board_period_ms": 10.0})
    simulator = simulate("idle")
    daemon.wait_status(lambda s: all(b["state"] == "living" for b in s["boards"]), "not every board was started")
    simulator.send_signal(signal.SIGINT)
    assert simulator.wait() == 0
    daemon.wait_status(lambda s: all(b["state"] == "silent" for b in s["boards"]), "boards that are gone are not told")
