"""A gripper's fingers, on simulated servos: they move together, and go off with whoever moved them. Its potentiometers."""

import asyncio
import json
import math
import os
import signal
import subprocess
import sys

import pytest
import taxel
from harness.daemon import Daemon, ask, asking_on, binary, die_with_parent, eventually, read_reply
from harness.gripper import (
    FINGERS,
    GOAL_PWM,
    PRESENT_PWM,
    PULSE_RAD,
    SCENE,
    TICK,
    TORQUE,
    control,
    control_of_another,
    gripping,
    registers,
    torque_on,
    with_potentiometers,
)
from harness.joints import servo
from harness.servos import Servos


@pytest.fixture
def servos(folder):
    """Two servos in PWM mode with something springy between them, and potentiometers at `folder / "lines"`."""
    with Servos("--ids", "1-2", "--load", "--potentiometers", folder / "lines") as servos:
        yield servos


def test_both_fingers_take_a_step_together_and_come_to_rest_where_they_are_held(folder, servos):
    with gripping(folder, servos) as daemon, control(daemon) as connection:
        # From the factory: all of it.
        assert registers(servos, GOAL_PWM) == [885, 885]
        refused = ask(connection, {"cmd": "servos", "pwm_percent": {"left": 10, "right": 10}})
        assert not refused["ok"] and "enable its torque first" in refused["error"]
        torque_on(connection, "left", 10_000)
        refused = ask(connection, {"cmd": "servos", "pwm_percent": {"left": 10, "right": 10}})
        assert refused["error"].startswith("right: ") and "left" not in refused["error"], refused
        torque_on(connection, "right", 10_000)
        assert registers(servos, GOAL_PWM) == [0, 0] and registers(servos, TORQUE) == [1, 1]
        refused = ask(connection, {"cmd": "servos", "pwm_percent": {"left": 10, "thumb": 10}})
        assert not refused["ok"] and "no joint is called thumb; there are left, right" in refused["error"]
        assert registers(servos, GOAL_PWM) == [0, 0], "a refused request moves nothing"
        assert ask(connection, {"cmd": "servos", "pwm_percent": {"left": 40, "right": 20}}) == {"ok": True}
        assert registers(servos, GOAL_PWM) == [354, 177]
        # The wall is 400 pulses away; half of the PWM presses in, two counts a pulse.
        rest = [10 + 400 + 354 / 4, 20 + 400 + 177 / 4]

        def stand(status):
            angles = [joint["angle_rad"] for joint in status["joints"]["joints"]]
            return angles == pytest.approx([pulses * PULSE_RAD for pulses in rest], abs=2 * PULSE_RAD)

        daemon.wait_status(stand, f"the fingers do not come to rest at {rest}")
        assert registers(servos, PRESENT_PWM) == [354, 177]


HOLDER = """
import json, socket, sys
connection = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
connection.connect(sys.argv[1])
lines = connection.makefile("rw")
for request in map(json.loads, sys.argv[2:]):
    lines.write(json.dumps(request) + "\\n")
    lines.flush()
    print(lines.readline().strip(), flush=True)
sys.stdin.read()
"""


@pytest.mark.parametrize("how", [signal.SIGKILL, signal.SIGSTOP])
def test_fingers_are_let_go_when_the_program_that_holds_them_dies_or_hangs(folder, servos, how):
    with gripping(folder, servos) as daemon:
        requests = [
            {"cmd": "servo", "joint": name, "torque": True, "pwm_percent": 0, "hold_ms": 10_000} for name in FINGERS
        ] + [{"cmd": "servos", "pwm_percent": {"left": 30, "right": 30}}]
        holder = subprocess.Popen(
            [sys.executable, "-c", HOLDER, str(daemon.control_path), *map(json.dumps, requests)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            preexec_fn=die_with_parent,
        )
        for _ in requests:
            assert json.loads(holder.stdout.readline()) == {"ok": True}
        holder.send_signal(how)
        eventually(lambda: registers(servos, TORQUE) == [0, 0], "the fingers go on without who holds them")
        eventually(lambda: "torque of right is off" in daemon.log, "the log does not say so")
        holder.kill()
        holder.wait()
        holder.stdin.close()
        holder.stdout.close()
        daemon.wait_status(
            lambda s: all(abs(j["angle_rad"]) < 50 * PULSE_RAD for j in s["joints"]["joints"]), "they do not open"
        )


def test_a_connection_that_holds_fingers_and_asks_nothing_is_told_that_they_are_off(folder, servos):
    with gripping(folder, servos) as daemon, control(daemon) as connection:
        torque_on(connection, "left", 200)
        reply = read_reply(connection)
        assert not reply["ok"] and "nothing was asked for 200ms" in reply["error"]
        assert connection.recv(10) == b""
        eventually(lambda: registers(servos, TORQUE) == [0, 0], "the motor stays on")
        # Without hold_ms it is on as long as the daemon reads it.
        with control(daemon) as other:
            assert ask(other, {"cmd": "servo", "joint": "left", "torque": True, "pwm_percent": 0}) == {"ok": True}
        with control(daemon) as other:
            torque_on(other, "right", 10_000)
        eventually(lambda: registers(servos, TORQUE) == [1, 0], "one is held, the other is not")


def test_fingers_are_driven_by_none_but_who_holds_them_until_they_are_switched_off(folder, servos):
    with gripping(folder, servos) as daemon, control(daemon) as holder:
        other, other_process = control_of_another(daemon)
        both = lambda percent: {"cmd": "servos", "pwm_percent": {"left": percent, "right": percent}}
        pwm = {"cmd": "servo", "joint": "left", "pwm_percent": 50}
        who = f"left: it is driven by user {os.getuid()}, process {{}}, until that lets go"
        for name in FINGERS:
            torque_on(holder, name, 10_000)
        assert ask(holder, both(20)) == {"ok": True}
        with asking_on(holder):
            for request in [pwm, {**pwm, "torque": True}, {**pwm, "torque": True, "hold_ms": 500}, both(50)]:
                refused = ask(other, request)
                assert not refused["ok"] and refused["error"].startswith(who.format(os.getpid())), refused
                assert refused["held_by"] == os.getpid()
            # Its own process may have other connections.
            with control(daemon) as own:
                assert ask(own, both(20)) == {"ok": True}
            status, said = servo(daemon, "left", "--torque", "on")
        assert status == 1 and who.format(os.getpid()) in said, said
        assert registers(servos, TORQUE) == [1, 1] and registers(servos, GOAL_PWM) == [177, 177]
        # Switched off by whom it may be, it is nobody's, and who held it is told so.
        assert ask(other, {"cmd": "servo", "joint": "left", "torque": False}) == {"ok": True}
        refused = ask(holder, both(30))
        assert refused["error"].startswith("left: its motor was") and "held_by" not in refused, refused
        torque_on(other, "left", 10_000)
        assert ask(holder, pwm)["error"].startswith(who.format(other_process))
        # What its first holder leaves behind is the other finger alone.
        holder.close()
        eventually(lambda: registers(servos, TORQUE) == [1, 0], "the wrong finger is let go, or none")
        other.close()


def test_potentiometers_are_joints_beside_the_servos_and_unknown_when_a_wire_is_off(folder, servos):
    with Daemon(folder / "d", SCENE, tick=TICK, joints=with_potentiometers(servos, folder / "lines")) as daemon:
        angles = lambda status: [joint["angle_rad"] for joint in status["joints"]["joints"]]
        # Positions 2058 and 2068 of 4096 are 514 or 515 and 517 counts.
        near = lambda status: angles(status)[2:] == pytest.approx([math.radians(2.2), math.radians(4.5)], abs=0.02)
        status = daemon.wait_status(lambda s: None not in angles(s) and near(s), "they are not read")["joints"]
        assert [joint["name"] for joint in status["joints"]] == ["left", "right", "left p", "right p"]
        assert status["analogue_lines"] > 0 and status["analogue_malformed"] == 0
        assert "lines of 2 potentiometers come" in eventually(lambda: "potentiometers" in daemon.log and daemon.log, "no log")
        # A wire is off: that joint alone is unknown, and named.
        servos.tell("line p1 1023 p2 540\\n")
        lost = lambda s: angles(s)[2] is None and None not in (angles(s)[0], angles(s)[3])
        status = daemon.wait_status(lost, "a wire that is off has an angle")["joints"]
        assert "stands at an end (1023 counts)" in status["joints"][2]["state"]
        daemon.wait_status(lambda s: s["joints"]["joints"][2]["problems"] == ["potentiometer-lost"], "it is not named")
        # Nothing comes: both are unknown, never the last angle for ever.
        servos.tell("line ")
        silent = lambda s: angles(s)[2:] == [None, None] and "analogue-silent" in s["joints"]["problems"]
        daemon.wait_status(silent, "silence is not told")
        servos.tell("lines")
        daemon.wait_status(near, "they do not come back")


def test_the_doctor_hears_the_potentiometers_where_no_daemon_reads_them(folder, servos):
    config = Daemon(folder / "d", SCENE, tick=TICK, joints=with_potentiometers(servos, folder / "lines")).config

    def doctor():
        command = [binary("taxel"), "doctor", "--json", "--seconds", "1", "--config", config]
        checks = json.loads(subprocess.run(command, capture_output=True, text=True).stdout)["checks"]
        return [check for check in checks if check["object"] == str(folder / "lines")]

    def found(state, *words):
        (told,) = doctor()
        return told["state"] == state and all(word in told["found"] for word in words)

    # In its second on a machine that is held up it may hear nothing, or what came before.
    eventually(lambda: found("ok", "lines a second; degrees: left p "), doctor)
    servos.tell("line p1 1023 p2 540\\n")
    eventually(lambda: found("error", "left p", "1023"), doctor)


def test_the_python_package_holds_fingers_for_a_block_and_no_longer_than_it_asks_something(folder, servos):
    with gripping(folder, servos) as daemon:
        with taxel.Control(daemon.control_path) as control:
            for name in FINGERS:
                control.torque(name, True, pwm_percent=0, hold_ms=10_000)
            control.pwm_together({"left": 20, "right": 20})
            control.keep_alive()
            assert registers(servos, TORQUE) == [1, 1] and registers(servos, GOAL_PWM) == [177, 177]
            assert f"process {os.getpid()}" in servo(daemon, "left", "--torque", "on")[1]
        eventually(lambda: registers(servos, TORQUE) == [0, 0], "the block has ended")
        with taxel.Control(daemon.control_path) as control:
            control.torque("left", True, pwm_percent=0, hold_ms=200)
            eventually(lambda: registers(servos, TORQUE) == [0, 0], "it has asked nothing")
            with pytest.raises(taxel.Refused, match="nothing was asked for 200ms"):
                control.keep_alive()
        other, other_process = control_of_another(daemon)
        with other:
            torque_on(other, "left", 10_000)
            with pytest.raises(taxel.Refused, match="left: it is driven by") as refused:
                taxel.Control(daemon.control_path).pwm("left", 50)
            assert refused.value.held_by == other_process


def test_the_python_package_holds_a_finger_with_asyncio(folder, servos):
    async def hold(daemon):
        async with taxel.aio.Control(daemon.control_path) as control:
            await control.torque("left", True, pwm_percent=0, hold_ms=10_000)
            await control.pwm("left", 20)
            await asyncio.gather(control.keep_alive(), control.pwm_together({"left": 40}))
            assert (await control.status())["joints"]["joints"][0]["torque_enabled"] is True
            assert registers(servos, TORQUE) == [1, 0] and registers(servos, GOAL_PWM)[0] == 354

    with gripping(folder, servos) as daemon:
        asyncio.run(hold(daemon))
        eventually(lambda: registers(servos, TORQUE) == [0, 0], "the block has ended")
