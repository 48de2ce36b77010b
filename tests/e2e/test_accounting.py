"""Every frame is accounted for, every fault has its reason, and re-zero works without a restart."""

import json
import subprocess

import can
import numpy as np
import pytest
from conditioning import DAEMON_SETTINGS
from harness.compare import Reference, assert_same
from harness.daemon import binary, eventually
from harness.lockstep import NEVER_SILENT, SWEEP, next_full_image, next_image
from harness.recordings import module_counts
from harness.touches import Touches, grasp
from sequential_clustering import Profile


def touched(image):
    return image if image.contacts else None


def standard(arbitration_id, data=b""):
    return can.Message(arbitration_id=arbitration_id, is_extended_id=False, data=data)


def test_every_frame_that_is_no_reading_is_counted_by_its_kind(start, lockstep, buses, hand):
    daemon = start(conditioning=DAEMON_SETTINGS)
    touches = Touches.even(hand)
    driver = lockstep(daemon)
    driver.step(touches.frame())
    sent = {
        "malformed": [standard(0x000, bytes(7)), standard(0x123, bytes(2)), standard(0x001)],
        "unknown": [
            standard(0x044, bytes(8)),
            standard(0x7FF, bytes(8)),
            can.Message(arbitration_id=0x000, is_extended_id=True, data=bytes(8)),
        ],
        "not_data": [
            can.Message(arbitration_id=0x000, is_extended_id=False, is_remote_frame=True, dlc=8),
            can.Message(arbitration_id=0x040, is_extended_id=False, is_error_frame=True, data=bytes(8)),
        ],
    }
    frames = [(0, message) for messages in sent.values() for message in messages]
    buses.send(frames)
    undecodable = [b"", b"\x00", b"\xff" * 300]
    for payload in undecodable:
        buses.send_datagram(0, payload)
    buses.buses[0].send(can.Message(arbitration_id=1, is_extended_id=False, is_fd=True, data=bytes(64)))

    expected = {
        **{kind: len(messages) for kind, messages in sent.items()},
        "received": 128 * driver.sweeps + len(frames),
        "used": 128 * driver.sweeps,
        "undecodable": len(undecodable) + 1,
        "can_fd": 1,
        "remote": 1,
        "duplicate": 0,
        "late": 0,
    }
    status = daemon.wait_status(
        lambda s: {k: s["buses"][0][k] for k in expected} == expected, f"the counters never become {expected}"
    )
    bus = status["buses"][0]
    assert bus["errors"]["frames"] == 1
    kinds = ["used", "unknown", "not_data", "commands", "malformed", "queue_overflows", "duplicate", "late", "settling"]
    assert sum(bus[k] for k in kinds) == bus["received"], "frames went missing in the account"
    kinds = ["readings", "unknown", "not_data", "commands", "malformed", "queue_overflows", "joints", "partial"]
    assert sum(bus[k] for k in kinds) == bus["received"], "frames went missing in the account"
    malformed = {b["module"]: b["malformed"] for b in status["boards"] if b["malformed"]}
    assert malformed == {hand.modules[0]: 2, hand.modules[1]: 1}
    assert status["buses"][1]["received"] == 112 * driver.sweeps

    # None of it disturbed the hand.
    reference = Reference(hand, Profile())
    reference.image(touches.frame())
    for i, counts in enumerate(list(grasp(touches))[1:]):
        assert_same(driver.step(counts), reference.image(counts), f"frame {i}")


def test_a_repeated_reading_is_a_duplicate_and_the_newest_value_counts(start, lockstep, buses, hand):
    daemon = start(conditioning=DAEMON_SETTINGS, sweep={**SWEEP, "board_period_ms": 2000.0})
    driver = lockstep(daemon)
    counts = Touches.even(hand).frame()
    sweep = hand.sweep(counts)
    buses.send([*sweep[:5], *sweep[:5], *sweep[5:]])
    image = next_full_image(driver.reader)
    assert image.missing == 0
    status = daemon.wait_status(
        lambda s: (s["buses"][0]["duplicate"], s["buses"][0]["used"]) == (5, 128), "128 readings were sent, five twice"
    )
    assert status["boards"][0]["duplicate"] == 5


def test_a_taxel_that_stops_sending_is_missing_and_never_repeated(start, lockstep, buses, hand):
    daemon = start(conditioning=DAEMON_SETTINGS, sweep={**SWEEP, "deadline_ms": 3000.0})
    touches = Touches.even(hand)
    driver = lockstep(daemon)
    driver.step(touches.frame())
    driver.step(touches.breath())
    pressed = touches.frame(np.full(len(hand), 300))
    assert driver.step(pressed).contacts == len(hand)
    lost = hand.taxels[200]
    driver.send([f for n, f in enumerate(hand.sweep(pressed)) if n != 200])
    image = eventually(lambda: touched(next_image(driver.reader)), "no image of the sweep that lacks a taxel")
    assert (image.contacts, image.missing) == (len(hand) - 1, 1)
    assert image.pixels[lost.y * image.width + lost.x] == 0
    used = 16 * driver.sweeps - 1
    daemon.wait_status(lambda s: s["boards"][12]["used"] == used, f"{used} readings of the thumb's tip were sent")


def test_rezero_measures_the_baseline_anew_without_a_restart(start, lockstep, hand):
    daemon = start(conditioning=DAEMON_SETTINGS)
    touches = Touches.even(hand)
    driver = lockstep(daemon)
    before = Reference(hand, Profile())
    for i, counts in enumerate(grasp(touches)):
        assert_same(driver.step(counts), before.image(counts), f"frame {i}")

    # The skin has warmed up: all counts have moved, and every taxel seems touched until the hand is told.
    warm = Touches(hand, touches.at_rest + [30, -20, 200])
    assert driver.step(warm.frame()).contacts == len(hand)
    driver.rezero()
    after = Reference(hand, Profile())
    for i, counts in enumerate(grasp(warm)):
        assert_same(driver.step(counts), after.image(counts), f"frame {i} after re-zero")


def test_rezero_warns_of_taxels_that_are_touched(start, lockstep, hand):
    daemon = start(conditioning=DAEMON_SETTINGS, tick=NEVER_SILENT)
    touches = Touches.even(hand)
    driver = lockstep(daemon)

    def rezero(*more):
        done = subprocess.run([binary("taxel"), "rezero", "--socket", daemon.control_path, *more], capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
        return done

    driver.step(touches.frame())
    driver.step(touches.breath())
    free = rezero()
    assert "measured anew" in free.stdout and free.stderr == ""
    driver.calibration = []
    driver.step(touches.frame())
    driver.step(touches.breath())
    contacts = driver.step(touches.frame(touches.dome(4, 4, 3, 500))).contacts
    assert contacts > 4
    daemon.wait_status(lambda s: s["contacts"] == contacts, "the touch is not felt")
    touched = rezero("--json")
    assert json.loads(touched.stdout) == {"contacts": contacts}
    assert f"{contacts} taxels were in contact" in touched.stderr


def test_paused_images_show_no_contact(start, lockstep, hand):
    daemon = start(conditioning=DAEMON_SETTINGS)
    touches = Touches.even(hand)
    driver = lockstep(daemon)
    driver.step(touches.frame())
    driver.step(touches.breath())
    pressed = touches.frame(touches.dome(4, 4, 3, 500))
    contacts = driver.step(pressed).contacts
    assert contacts > 4
    assert daemon.control("pause") == {"ok": True}
    paused = driver.step(pressed)
    assert (paused.contacts, paused.actuators) == (0, ()) and not any(paused.pixels)
    daemon.wait_status(lambda s: s["paused"] is True, "the status does not tell that images are paused")
    assert daemon.control("resume") == {"ok": True}
    assert driver.step(pressed).contacts == contacts


@pytest.mark.parametrize("rule", ["robust", "paper"])
def test_the_dead_taxel_of_log4_is_found(start, lockstep, hand, rule):
    module = module_counts("uskin_waseda.npz", "LOG4")
    dead = [k for k in range(16) if np.all(module[:, k] == 65535)]
    assert len(dead) == 1, "LOG4 has one dead taxel"
    settings = DAEMON_SETTINGS if rule == "paper" else {"preset": "robust", "calibration_ms": 200}
    daemon = start(conditioning=settings)
    driver = lockstep(daemon)
    for i in range(44):
        image = driver.step(np.tile(module[i % len(module)], (len(hand) // 16, 1)))
    assert not image.calibrating
    reasons = {(f["module"], f["k"]): f["reasons"] for f in daemon.status()["faults"]}
    expected = {(name, dead[0]) for name in hand.modules}
    if rule == "paper":
        # One dead taxel inflates the standard deviation so much that it is the only one flagged.
        assert set(reasons) == expected and {r for rs in reasons.values() for r in rs} == {"paper-rule"}
    else:
        assert {place for place, why in reasons.items() if "dead" in why} == expected
    assert image.faulty == len(reasons)
