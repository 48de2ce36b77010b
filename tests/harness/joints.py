"""Joints as a daemon reads them: sixteen servos in its configuration, and what it says of them."""

import json
import subprocess
import threading
from contextlib import contextmanager

from harness.daemon import Daemon, binary, die_with_parent, eventually

IDS = range(1, 17)
SCENE = ["sim:idle", "sim:idle"]
TICK = {"rate_hz": 50.0}
# The servos are a process, which a busy machine can hold up: none is late for that, and no angle becomes unknown.
PATIENT = {"answer_margin_ms": 100.0, "hold_ms": 2000.0}
# The same where a servo without an answer may keep the others waiting.
WRITING = {"allow_writes": True, "watchdog_ms": 2540, "answer_margin_ms": 400.0, "hold_ms": 10_000.0}


def dynamixel(path, **more):
    servos = [{"id": id, "name": f"joint {id}"} for id in IDS]
    return {"source": f"dynamixel:{path}", **PATIENT, **more, "servo": servos}


@contextmanager
def driven(folder, servos, **more):
    """A daemon that may move these servos, and has read them."""
    with Daemon(folder / "d", SCENE, tick=TICK, joints=dynamixel(servos.path, **WRITING | more)) as daemon:
        daemon.wait_status(lambda s: s["joints"]["readings"] > 50, "nothing is read")
        yield daemon


class Watch:
    """`taxel watch --json`, whose lines are collected from now on, or with `--reconnect` from when the daemon is there."""

    def __init__(self, daemon, *options):
        self.lines = []
        self.folder = daemon.folder
        self.told = (self.folder / "watch.log").open("wb")
        self.process = subprocess.Popen(
            [binary("taxel"), "watch", "--json", "--socket", daemon.images, *options],
            stdout=subprocess.PIPE,
            stderr=self.told,
            text=True,
            preexec_fn=die_with_parent,
        )
        self.thread = threading.Thread(target=self._read, daemon=True)
        self.thread.start()

    def _read(self):
        for line in self.process.stdout:
            self.lines.append(json.loads(line))

    @property
    def notices(self):
        """What taxeld told beside images."""
        return (self.folder / "watch.log").read_text()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.process.kill()
        self.process.wait()
        self.thread.join()
        self.process.stdout.close()
        self.told.close()

    def more(self, count):
        """The next `count` images."""
        begin = len(self.lines)
        eventually(lambda: len(self.lines) >= begin + count, f"{count} more images did not come")
        return self.lines[begin : begin + count]

    def until(self, condition, what):
        """The first image from now on that meets the condition."""
        at = len(self.lines)

        def met():
            nonlocal at
            while at < len(self.lines):
                at += 1
                if condition(self.lines[at - 1]):
                    return self.lines[at - 1]
            return None

        return eventually(met, lambda: f"{what}; last image: {json.dumps(self.lines[-1:])[:3000]}")


def all_known(image):
    return len(image["joints"]) == len(IDS) and None not in image["joints"]


def joint_of(daemon, id):
    return daemon.status()["joints"]["joints"][id - 1]


def comes(daemon, kind, joint, *words):
    """Waits for a problem, and gives it back."""
    found = lambda s: [p for p in s["problems"] if (p["kind"], p["joint"]) == (kind, joint)]
    status = daemon.wait_status(found, f"no problem {kind} of {joint}")
    (problem,) = found(status)
    for word in words:
        assert word in problem["sentence"], problem
    return problem


def servo(daemon, *arguments):
    """`taxel servo`: its exit status and what it says."""
    done = subprocess.run(
        [binary("taxel"), "servo", *arguments, "--socket", daemon.control_path], capture_output=True, text=True
    )
    return done.returncode, done.stderr


WATCHDOG, TORQUE, GOAL_PWM, PRESENT_PWM = (98, 1), (64, 1), (100, 2), (124, 2)
PWM_MODE = 16


def refused(folder, sources, joints, **more):
    daemon = Daemon(folder / "d", sources, joints=joints, **more).spawn()
    assert daemon.process.wait() != 0
    return daemon.log
