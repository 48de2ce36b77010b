"""What users pass."""

import os

import numpy as np
import pytest
import taxel


def test_numbers_of_numpy_are_asked_for_as_numbers(daemon):
    profile = {"levels": np.int64(4), "codebook": np.array([1.5, 2.5]), "jump_gain": np.float32(0.5)}
    with taxel.connect(daemon.path, profile=profile, max_rate_hz=np.float32(10), region=("index",)):
        daemon.wait_for_subscription()
    assert daemon.subscriptions == [
        {
            "profile": {"levels": 4, "codebook": [1.5, 2.5], "jump_gain": 0.5},
            "max_rate_hz": 10.0,
            "region": ["index"],
        }
    ]
    taxel.Control(daemon.control).set_profile({"levels": np.int64(4)})
    assert daemon.requests == [{"cmd": "profile", "profile": {"levels": 4}}]


@pytest.mark.parametrize("connect", [taxel.connect, taxel.aio.connect])
@pytest.mark.parametrize(
    ("wrong", "error", "sentence"),
    [
        ({"region": "index"}, TypeError, r"\['index'\] instead of 'index'"),
        ({"profile": {"levels": object()}}, TypeError, "nothing that the daemon is told"),
        ({"max_rate_hz": float("nan")}, ValueError, "not JSON compliant"),
    ],
)
def test_what_no_daemon_can_be_told_is_refused_by_name(daemon, connect, wrong, error, sentence):
    with pytest.raises(error, match=sentence):
        connect(daemon.path, **wrong)


def test_a_time_out_that_is_no_number_is_refused(daemon):
    with taxel.connect(daemon.path) as hand:
        for wait in (hand.next, hand.message, lambda timeout: next(hand.images(timeout))):
            with pytest.raises(ValueError, match="timeout"):
                wait(float("nan"))


def test_a_path_may_be_bytes(daemon):
    with taxel.connect(os.fsencode(daemon.path)) as hand:
        assert hand.next(timeout=0.05) is None and hand.hello
    assert taxel.Control(os.fsencode(daemon.control)).status() == {}
