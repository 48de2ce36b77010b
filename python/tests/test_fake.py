"""The fake daemon, as tests of drivers use it: in one thread."""

import pytest
import taxel


def levels(hand):
    return hand.next(timeout=10).actuators.level.tolist()


@pytest.mark.parametrize("asked", [{}, {"profile": {"levels": 4}}, {"raw": True}])
def test_what_is_pressed_is_for_whoever_has_connected_or_else_connects_next(daemon, asked):
    daemon.press([(0, 0, 1)])
    with taxel.connect(daemon.path, **asked) as hand:
        assert levels(hand) == [1]
        daemon.restart()
        daemon.press([(0, 0, 2)])
        daemon.press([(0, 0, 3)])
        assert levels(hand) == [2] and levels(hand) == [3] and hand.restarts == 1
        daemon.stop()
        assert hand.next(timeout=0.05) is None and hand.gone
        daemon.start()
        daemon.press([(0, 0, 4)])
        assert levels(hand) == [4] and hand.restarts == 2
        with taxel.connect(daemon.path, **asked) as other:
            daemon.press([(0, 0, 1)])
            assert levels(hand) == levels(other) == [1]
            assert hand.next(timeout=0) is other.next(timeout=0) is None, "each has it once"


def test_a_stopped_daemon_sends_nothing_and_keeps_nothing(daemon):
    daemon.press()
    daemon.stop()
    for send in (daemon.press, lambda: daemon.event("mark", "a")):
        with pytest.raises(RuntimeError, match="stopped"):
            send()
    daemon.start()
    with taxel.connect(daemon.path) as hand:
        assert hand.next(timeout=0.05) is None


def test_a_subscriber_that_never_reads_is_told_of(daemon, monkeypatch):
    monkeypatch.setattr("taxel.fake.PATIENCE_S", 0.05)
    with taxel.connect(daemon.path), pytest.raises(TimeoutError, match="read nothing"):
        while True:
            daemon.press()
