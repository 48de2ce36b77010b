"""The fake daemon, as tests of drivers use it: in one thread."""

import pytest
import taxel

# tests/e2e/test_python_package.py asks taxeld the same.
REFUSED = [
    {"max_rate_hz": -1},
    {"max_rate_hz": 0},
    {"max_rate_hz": 10, "every": True},
    {"region": []},
    {"region": [1]},
    {"profile": {"levels": 0}},
    {"profile": {"levels": 256}},
    {"profile": {"levels": 4.5}},
    {"profile": {"actuators": 1025}},
    {"profile": [4]},
]
REFUSED_REQUESTS = [
    {"cmd": "mark", "text": ""},
    {"cmd": "mark", "text": "two\nlines"},
    {"cmd": "mark", "text": "\u00e9" * 251},
    {"cmd": "mark"},
    {"cmd": "profile", "profile": {"levels": 0}},
    {"cmd": "profile", "profile": []},
    {"cmd": "servo", "joint": "index 0", "pwm_percent": 101},
    {"cmd": "servo", "joint": "index 0"},
    {"cmd": "servo", "joint": "index 0", "torque": False, "pwm_percent": 0},
    {"cmd": "servo", "joint": "index 0", "torque": True, "hold_ms": 19},
    {"cmd": "servo", "joint": "index 0", "torque": True, "hold_ms": 10_001},
    {"cmd": "servo", "joint": "index 0", "torque": False, "hold_ms": 500},
    {"cmd": "servo", "joint": "index 0", "pwm_percent": 0, "hold_ms": 500},
    {"cmd": "servos", "pwm_percent": {}},
    {"cmd": "servos", "pwm_percent": {"index 0": 101}},
    {"cmd": "dance"},
    [],
]


@pytest.mark.parametrize("asked", REFUSED, ids=str)
def test_subscriptions_that_taxeld_refuses_are_refused(daemon, asked):
    with taxel.connect(daemon.path, **asked) as hand, pytest.raises(taxel.Refused):
        hand.next(timeout=300)


@pytest.mark.parametrize("request_", REFUSED_REQUESTS, ids=str)
def test_requests_that_taxeld_refuses_are_refused(daemon, request_):
    with taxel.Control(daemon.control) as control, pytest.raises(taxel.Refused):
        control.request(request_)
    assert daemon.held == {}


def test_images_that_no_display_of_this_kind_shows_are_not_made(daemon):
    for pressed in ([(0, 0, 1)] * 17, [(4, 0, 1)], [(0, -1, 1)], [(0, 0, 0)], [(0, 0, 5)]):
        with pytest.raises(ValueError):
            daemon.press(pressed)
    with pytest.raises(ValueError, match="levels = 0"):
        taxel.FakeDaemon(levels=0)


def levels(hand):
    return hand.next(timeout=300).actuators.level.tolist()


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
