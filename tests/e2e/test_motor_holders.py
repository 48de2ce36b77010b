"""Who holds a motor: it is let go with its holder, and nobody else drives it meanwhile."""

import json
import os
import socket
from contextlib import suppress

import pytest
from harness.daemon import ask, asking_on, connect, eventually, read_reply
from harness.joints import TORQUE, driven, servo


@pytest.mark.parametrize(
    ("sent", "leaves"),
    [
        (b"", True),
        (b"\n" * 60_000, True),
        (b'{"cmd":"profile"}\n' * 500, True),
        (b'{"cmd":"servo","joint":"joint 7","torque":true}\n' + b"\n" * 60_000, True),
        (b'{"cmd":"pro', True),
        (b"\n" * 60_000, False),
        (b'{"cmd":"pro', False),
    ],
)
def test_a_motor_is_let_go_when_its_holder_dies_or_asks_nothing_whatever_was_sent_before(folder, sent, leaves, servos):
    with driven(folder, servos) as daemon, connect(daemon.control_path) as holder:
        hold_ms = 10_000 if leaves else 500
        assert ask(holder, {"cmd": "servo", "joint": "joint 5", "torque": True, "hold_ms": hold_ms})["ok"]
        with suppress(BrokenPipeError, ConnectionResetError):  # its time may be over before
            holder.sendall(sent)
        if leaves:
            holder.close()
        else:
            assert "nothing was asked for 500ms" in read_reply(holder)["error"]
        eventually(lambda: servos.register(5, *TORQUE) == 0, "the motor runs without its holder")
        eventually(lambda: "torque of joint 5 is off, since who held it is gone" in daemon.log, "the log does not say so")


def test_a_refused_request_takes_no_hold_and_one_that_was_let_go_of_none_either(folder, servos):
    with driven(folder, servos) as daemon:
        with connect(daemon.control_path) as client:
            refused = ask(client, {"cmd": "servo", "joint": "joint 5", "torque": True, "pwm_percent": 500, "hold_ms": 20})
            assert "outside -100 to 100" in refused["error"]
            # Long enough for it to be let go of, if it held anything.
            assert servo(daemon, "joint 6", "--torque", "on") == (0, "")
            assert ask(client, {"cmd": "servo", "joint": "joint 6", "torque": False})["ok"]
            for _ in range(10):
                daemon.status()
            assert ask(client, {"cmd": "profile"})["ok"]


def test_who_holds_a_motor_that_was_not_confirmed_is_told_so_and_it_is_let_go_with_the_others(folder, servos):
    on = {"cmd": "servo", "joint": "joint 5", "torque": True, "pwm_percent": 0}
    with driven(folder, servos) as daemon:
        servos.tell("fault 5 silent")
        with connect(daemon.control_path) as client:
            held = "its motor may run, and is held by this connection"
            for hold, is_held in [({}, False), ({"hold_ms": 10_000}, True)]:
                refused = ask(client, {**on, **hold})
                assert not refused["ok"] and (held in refused["error"]) == is_held, refused
                assert ("its motor may run, and nobody holds it" in refused["error"]) != is_held, refused
            with asking_on(client):
                status, said = servo(daemon, "joint 5", "--torque", "on")
            assert status == 1 and f"driven by user {os.getuid()}, process {os.getpid()}" in said, said
        servos.tell("mend 5")
        eventually(lambda: "torque of joint 5 is off, since who held it is gone" in daemon.log, "it is not let go")
        assert servos.register(5, *TORQUE) == 0


def test_a_motor_that_is_off_is_held_by_nobody_whose_request_has_failed(folder, servos):
    on = {"cmd": "servo", "joint": "joint 5", "torque": True, "pwm_percent": 0}
    with driven(folder, servos) as daemon:
        off = lambda s: s["joints"]["joints"][4]["torque_enabled"] is False and not s["problems"]  # noqa: E731
        daemon.wait_status(off, "it is not known to be off")
        servos.tell("fault 5 silent")
        with connect(daemon.control_path) as client:
            assert "is held by this connection" in ask(client, {**on, "hold_ms": 10_000})["error"]
            servos.tell("mend 5")
            # It asks on, so that it is not let go for its silence.
            free = lambda: ask(client, {"cmd": "profile"})["ok"] and servo(daemon, "joint 5", "--torque", "on") == (0, "")  # noqa: E731
            eventually(free, "it is held all the same")
        # Nor is it let go when that one leaves: it is another's.
        eventually(lambda: daemon.status()["control"]["clients"] == 1, "who has gone is kept")
        assert servos.register(5, *TORQUE) == 1


def test_who_only_writes_no_more_and_holds_a_motor_is_answered_and_then_let_go(folder, servos):
    with driven(folder, servos) as daemon:
        requests = [
            {"cmd": "servo", "joint": "joint 5", "torque": True, "pwm_percent": 0, "hold_ms": 10_000},
            {"cmd": "servo", "joint": "joint 5", "pwm_percent": 5},
            {"cmd": "mark", "text": "held"},
        ]
        with connect(daemon.control_path) as client:
            client.sendall(b"".join(json.dumps(request).encode() + b"\n" for request in requests))
            client.shutdown(socket.SHUT_WR)
            replies = [json.loads(line) for line in client.makefile("rb").read().splitlines()]
        assert [reply["ok"] for reply in replies] == [True, True, True], replies
        eventually(lambda: servos.register(5, *TORQUE) == 0, "the motor runs without its holder")
        assert "had gone" not in daemon.log
