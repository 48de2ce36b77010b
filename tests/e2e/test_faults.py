"""Buses that fail, over udp_multicast with the simulator's boards: each fault is named, the rest goes on, and it is over
when its cause is.

The same on real SocketCAN, with the kernel's own states, is in tests/vcan/test_faults.py.
"""

import subprocess
import time
import tomllib

import numpy as np
import pytest
from harness.daemon import binary, eventually, kinds, problem, told_once_each_time
from harness.hand import LAYOUTS

FREE_RUNNING = {"tick": {"mode": "timer", "rate_hz": 30.0}, "boards": {"mode": "free-running"}, "sweep": {}}
# A busy machine may hold up the simulator, for seconds: no board is silent for that.
PATIENT = {**FREE_RUNNING, "boards": {"mode": "free-running", "silence_ms": 10_000.0}, "sweep": {"silent_after_sweeps": 250}}


@pytest.fixture
def simulate(buses, play, folder):
    """Starts `taxel sim` with these faults; the time it began. `order` says which of the buses are the hand's."""

    def simulate(faults, seconds=60, order=(0, 1), boards=""):
        text = f'name = "faults"\nseconds = {seconds}\n[boards]\nrate_hz = 25\n{boards}\n'
        for fault in faults:
            text += "\n[[fault]]\n" + "".join(f"{k} = {v!r}\n".replace("'", '"') for k, v in fault.items())
        scene = folder / "faults.toml"
        scene.write_text(text)
        play(scene, [buses.sources[n] for n in order])
        return time.monotonic()

    return simulate


def all_living(daemon, but=()):
    def living(status):
        return all(b["state"] == "living" for b in status["boards"] if b["module"] not in but)

    return daemon.wait_status(living, "not every board speaks")


def used_of_others(status, module):
    return [b["used"] for b in status["boards"] if b["module"] != module]


def passes(daemon, began, until_s, kind, place, words):
    """The problem comes, with these words, while all else is fed; it is over soon after `until_s` of the scene."""

    def told(status):
        # On a busy machine other boards may fall silent, too.
        return [p for p in status["problems"] if p["kind"] == kind and all(word in p["sentence"] for word in words)]

    status = daemon.wait_status(told, f"no problem {kind} with {words}")
    found = told(status)[0]
    bus = next(b for b in status["buses"] if b["name"] == found["bus"])
    board = next((b for b in status["boards"] if b["module"] == found["module"]), bus)
    assert kind in board["problems"] and found["bus"] == place, found
    before = used_of_others(status, found["module"])
    daemon.wait_status(
        lambda s: all(a < b for a, b in zip(before, used_of_others(s, found["module"]))), "other boards are not fed"
    )
    daemon.wait_status(lambda s: not problem(s, kind), f"{kind} is never over")
    over_s = time.monotonic() - began - until_s
    # In these words, though it may know less or more by then.
    eventually(lambda: words[0] in daemon.log, "the log does not say so")
    print(f"{kind}: over {over_s:.2f} s after its cause (start of the simulator included)")


# Each: the faults, the kind, its bus, words of the sentence.
CASES = {
    "a node that is nobody's floods the bus": (
        [{"kind": "babble", "bus": 1, "id": 0x005, "rate_hz": 3000.0}],
        "babbling",
        "can1",
        ["id 005, which is nobody's in the layout, babbles", "frames/s", "% of a bus"],
    ),
    "a board of the hand floods its bus": (
        [{"kind": "babble", "on": ["index distal"], "rate_hz": 3000.0}],
        "babbling",
        "can0",
        ["index distal (can0 board 1) babbles", "frames/s"],
    ),
    "a board answers under the address of another": (
        [{"kind": "wrong-id", "on": ["middle distal"], "board": 3}],
        "two-boards-one-address",
        "can0",
        ["two boards answer as board 3 of can0", "middle distal (can0 board 5) is silent"],
    ),
    "the controller flaps": (
        [{"kind": "error-frames", "bus": 0, "error": "flapping", "rate_hz": 100.0}],
        "flapping",
        "can0",
        ["changes its error state", "times a second"],
    ),
    "the controller is off the bus": (
        [{"kind": "bus-off", "bus": 1}],
        "bus-off",
        "can1",
        ["off the bus", "restart-ms 100"],
    ),
    "frames are broken": (
        [{"kind": "error-frames", "bus": 0, "error": "bit-stuffing", "rate_hz": 50.0}],
        "bus-errors",
        "can0",
        ["broken frames a second", "termination"],
    ),
    "a board has no power": (
        [{"kind": "silent", "on": ["thumb tip"]}],
        "board-silent",
        "can1",
        ["thumb tip (can1 board 4) is silent", "told to start again"],
    ),
}


@pytest.mark.parametrize("case", CASES)
def test_a_fault_is_named_and_over_when_its_cause_is(start, simulate, case):
    faults, kind, place, words = CASES[case]
    daemon = start(**FREE_RUNNING)
    began = simulate([{**fault, "from": 2.5, "to": 4.5} for fault in faults])
    all_living(daemon)
    passes(daemon, began, 4.5, kind, place, words)
    all_living(daemon)
    daemon.wait_status(lambda s: not s["problems"], "problems remain")
    assert told_once_each_time(daemon.log, words[0]), daemon.log


def test_a_healthy_hand_has_no_problems(start, simulate):
    daemon = start(**PATIENT)
    simulate([])
    all_living(daemon)
    daemon.wait_status(lambda s: not s["problems"], "a healthy hand has problems")
    end = time.monotonic() + 3
    while time.monotonic() < end:
        assert kinds(daemon.status()) == []


def test_a_hand_that_moves_while_its_baseline_is_measured_is_told_until_that_is_done_anew(start, folder):
    t, taxel, axis = np.indices((3000, 16, 3))
    moved = 3 * np.clip(t, 50, 90)  # the last second of the window, and still from then on
    np.save(folder / "moved.npy", (20_000 + (7 * t + 5 * taxel + 3 * axis) % 4 + moved).astype(np.uint16))
    convert = [binary("taxel"), "convert", "moved.npy", "moved.log", "--layout", "uskin-module", "--rate", "60"]
    subprocess.run(convert, cwd=folder, check=True, capture_output=True)
    daemon = start([f"log:{folder / 'moved.log'}"], layout="uskin-module")
    status = daemon.wait_status(lambda s: "baseline-moved" in kinds(s), "nothing is said of it")
    assert "`taxel rezero` when nothing touches the hand" in problem(status, "baseline-moved")["sentence"]
    daemon.control("rezero")
    daemon.wait_status(lambda s: "baseline-moved" not in kinds(s), "it is never over")


@pytest.mark.parametrize(
    "layout",
    ["allegro-xela-18", "uskin-module", "uskin-fingertip", "icub-forearm", "cyskin-triangle", "cpm-finger", "schunk-sdh"],
)
def test_a_touched_hand_of_any_kind_has_no_problems(start, folder, layout):
    """A ball rolls over every module: no touch is taken for a second board, no protocol for a babbling node."""
    buses = hand_buses(layout)
    daemon = start(["sim:roll"] * buses, layout=layout, **PATIENT)
    seen = set()
    daemon.wait_status(lambda s: all(b["state"] == "living" for b in s["boards"]), "not every board speaks")
    daemon.wait_status(lambda s: seen.update(p["sentence"] for p in s["problems"]) or not s["problems"], "problems remain")
    seen.clear()
    end = time.monotonic() + 4
    while time.monotonic() < end:
        seen.update(p["sentence"] for p in daemon.status()["problems"])
    assert not seen


def hand_buses(layout):
    return len(tomllib.loads((LAYOUTS / f"{layout}.toml").read_text()).get("buses", ["the only one"]))


def test_a_board_that_reboots_is_started_again(start, simulate):
    daemon = start(**FREE_RUNNING)
    simulate([{"kind": "reboot", "on": ["index tip"], "from": at} for at in (2.5, 4.0, 5.5, 7.0)])
    all_living(daemon)

    def board(status):
        return next(b for b in status["boards"] if b["module"] == "index tip")

    restarts = board(daemon.status())["restarts"]
    daemon.wait_status(lambda s: board(s)["restarts"] > restarts, "the board that came back is not started")
    all_living(daemon)
    # Again and again: that is a problem of its own.
    status = daemon.wait_status(lambda s: problem(s, "board-unsteady"), "the board's falling silent is not counted")
    assert "loose plug" in problem(status, "board-unsteady")["sentence"]
    all_living(daemon)


def test_swapped_buses_are_recognised_by_the_board_that_only_one_of_them_has(start, simulate):
    daemon = start(**FREE_RUNNING)
    simulate([], order=(1, 0))
    status = daemon.wait_status(lambda s: problem(s, "buses-swapped"), "the swap is not seen")
    sentence = problem(status, "buses-swapped")["sentence"]
    assert "can0 and can1 look swapped" in sentence and "source = " in sentence
    # What only one bus has is silent where the layout wants it; the rest of the hand works, on the wrong fingers.
    daemon.wait_status(lambda s: sum(b["state"] == "living" for b in s["boards"]) == 14, "not all but those two work")
    assert not problem(status, "board-not-in-layout")


def test_a_board_with_an_address_of_the_other_bus_is_named(start, simulate):
    daemon = start(**FREE_RUNNING)
    simulate([{"kind": "wrong-id", "on": ["ring tip"], "board": 7}, {"kind": "silent", "on": ["middle proximal"]}])
    status = daemon.wait_status(lambda s: problem(s, "buses-swapped"), "the displaced board is not seen")
    assert "only this board is on the wrong bus" in problem(status, "buses-swapped")["sentence"]
