"""The harness itself: a sweep that the daemon's deadline cuts is sent again, and no image shows parts of two."""

import time
from itertools import islice

from conditioning import DAEMON_SETTINGS
from harness import lockstep as harness
from harness.compare import Reference, assert_same
from harness.touches import Touches, grasp
from sequential_clustering import Profile


def test_a_sweep_that_is_cut_is_sent_again_when_nothing_of_it_is_under_way(start, lockstep, hand, monkeypatch):
    monkeypatch.setattr(harness, "DEADLINE_S", 5.0)
    daemon = start(conditioning=DAEMON_SETTINGS, sweep={**harness.SWEEP, "deadline_ms": 5000.0})
    driver = lockstep(daemon)
    sweeps = list(islice(grasp(Touches.even(hand)), 4))
    send = driver.buses.send
    # Images of one taxel are waiting to be read.
    for _ in range(5):
        send(hand.sweep(sweeps[0])[:1])
        time.sleep(3 * harness.BOARD_PERIOD_S)
    driver.rezero()
    cuts = iter([200])

    def send_slowly(frames):
        cut = next(cuts, None)
        for i, frame in enumerate(frames):
            time.sleep(harness.DEADLINE_S + 0.2 if i == cut else 0.003)
            send([frame])

    monkeypatch.setattr(driver.buses, "send", send_slowly)
    reference = Reference(hand, Profile())
    for i, counts in enumerate(sweeps):
        assert_same(driver.step(counts), reference.image(counts), f"frame {i}")
    assert driver.sweeps > len(sweeps), "no sweep was cut"
