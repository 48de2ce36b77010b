"""Commands in every order around SIGTERM: the daemon ends with 0, motors are off, sockets are gone, nothing is left unanswered in between.

    cargo build --workspace --bins --examples
    tests/siege/run orders [--every N]

Five commands (torque on, a profile, a mark, rezero, pause), a subscription and SIGTERM are sent in all 5,040 orders, each command on
a connection of its own and none waiting for the one before it; every one gets a whole reply or a closed connection. `--every N` takes
each N-th order. The exit status is 1 where a daemon hung, panicked, ended with another status than 0, or left a motor on.
"""

import argparse
import itertools
import json
import signal
import socket
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / "tests"), str(ROOT / "crates/wire/python")]

from harness.daemon import eventually, must_be_built  # noqa: E402
from harness.siege import Hand, progress  # noqa: E402

TORQUE_ENABLE = (64, 1)
COMMANDS = {
    "torque on": {"cmd": "servo", "joint": "joint 1", "torque": True},
    "profile": {"cmd": "profile", "profile": {"levels": 3, "actuators": 5}},
    "mark": {"cmd": "mark", "text": "here"},
    "rezero": {"cmd": "rezero"},
    "pause": {"cmd": "pause"},
}
STEPS = (*COMMANDS, "subscribe", "SIGTERM")


def step(daemon, name):
    """Does it without waiting for what comes of it; the connection, where there is one."""
    if name == "SIGTERM":
        daemon.process.send_signal(signal.SIGTERM)
        return None
    kind, path = (socket.SOCK_SEQPACKET, daemon.images) if name == "subscribe" else (socket.SOCK_STREAM, daemon.control_path)
    connection = socket.socket(socket.AF_UNIX, kind)
    connection.settimeout(10)
    try:
        connection.connect(str(path))
        if name in COMMANDS:
            connection.sendall(json.dumps(COMMANDS[name]).encode() + b"\n")
    except OSError:  # it has ended
        connection.close()
        return None
    return connection


def answer(connection, name):
    """What came of it, to the end of the connection; half a line is a lie."""
    text = b""
    try:
        while not text.endswith(b"\n") or name == "subscribe":
            part = connection.recv(1 << 20)
            if not part:
                break
            text = b"" if name == "subscribe" else text + part
    except ConnectionError:
        pass
    finally:
        connection.close()
    if name == "subscribe" or not text:
        return "closed"
    return "done" if json.loads(text)["ok"] else "refused"


def shut_down(hand, daemon, order):
    daemon.start()
    # The servo is there, so that a torque that is told before the end is switched on.
    eventually(lambda: daemon.status()["joints"].get("readings"), "no servo")
    connections = [(name, step(daemon, name)) for name in order]
    status = daemon.process.wait(10)
    outcome = {name: answer(c, name) if c else "closed" for name, c in connections}
    assert status == 0, f"it ended with {status}"
    assert "panicked" not in daemon.log, "it panicked"
    assert not daemon.images.exists() and not daemon.control_path.exists(), "its sockets are left"
    eventually(lambda: hand.servos.traffic().hung_up, "the servos' bus does not hear its client hang up")
    assert hand.servos.register(1, *TORQUE_ENABLE) == 0, "a motor is left on"
    return outcome


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--every", type=int, default=1, help="take each N-th order")
    options = parser.parse_args()
    must_be_built("taxeld", "taxel", "examples/servo_bus")
    outcomes = {}
    with tempfile.TemporaryDirectory(prefix="siege-") as folder, Hand() as hand:
        for order in progress(list(itertools.permutations(STEPS))[:: options.every]):
            daemon = hand.daemon(folder, allow_writes=True)
            daemon.log_path.unlink(missing_ok=True)
            try:
                outcome = shut_down(hand, daemon, order)
            except BaseException as error:
                daemon.kill()
                sys.exit(f"{', '.join(order)}: {error!r}; its log:\n{daemon.log[-3000:]}")
            for name, what in outcome.items():
                where = "before" if order.index(name) < order.index("SIGTERM") else "after"
                key = (name, where, what)
                outcomes[key] = outcomes.get(key, 0) + 1
    for (name, where, what), count in sorted(outcomes.items()):
        if name != "SIGTERM":
            print(f"{name:10} sent {where:6} SIGTERM: {count:5} {what}")


if __name__ == "__main__":
    main()
