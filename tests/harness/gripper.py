"""A gripper of two servos, as a daemon's configuration has it."""

import math
import socket
import subprocess
import sys
from contextlib import contextmanager

from harness.daemon import Daemon, ask, connect
from harness.joints import WRITING

SCENE = ["sim:idle", "sim:idle"]
TICK = {"rate_hz": 50.0}
PULSE_RAD = math.tau / 4096
WATCHDOG, TORQUE, GOAL_PWM, PRESENT_PWM = (98, 1), (64, 1), (100, 2), (124, 2)
FINGERS = {"left": 1, "right": 2}


def gripper(path, **more):
    """The table [joints] of two servos that may be moved."""
    servos = [{"id": id, "name": name} for name, id in FINGERS.items()]
    return {"source": f"dynamixel:{path}", **WRITING, "hold_ms": 2000.0, **more, "servo": servos}


@contextmanager
def gripping(folder, servos, **more):
    """A daemon that may move these servos, and has read them."""
    with Daemon(folder / "d", SCENE, tick=TICK, joints=gripper(servos.path, **more)) as daemon:
        daemon.wait_status(lambda s: s["joints"]["readings"] > 20, "nothing is read")
        yield daemon


def with_potentiometers(servos, path):
    """The same, with a potentiometer in each finger: a quarter of the servo's position, 100 counts for 90 degrees."""
    joints = [
        {"name": f"{name} p", "channel": f"p{id}", "counts": [512, 612], "degrees": [0, 90]} for name, id in FINGERS.items()
    ]
    return {**gripper(servos.path), "analogue": {"device": path, "joint": joints}}


def registers(servos, at):
    return [servos.register(id, *at) for id in FINGERS.values()]


def control(daemon):
    return connect(daemon.control_path)


def control_of_another(daemon):
    """A connection that another process has made, and which: for the daemon it is that one's."""
    connection = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
    connect = "import socket, sys; socket.socket(fileno=int(sys.argv[1])).connect(sys.argv[2])"
    number = connection.fileno()
    command = [sys.executable, "-c", connect, str(number), str(daemon.control_path)]
    process = subprocess.Popen(command, pass_fds=[number])
    assert process.wait() == 0
    return connection, process.pid


def torque_on(connection, name, hold_ms):
    request = {"cmd": "servo", "joint": name, "torque": True, "pwm_percent": 0, "hold_ms": hold_ms}
    assert ask(connection, request) == {"ok": True}
