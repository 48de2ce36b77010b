"""`taxel watch` as a child process: whoever reads its lines slowly is given the newest, and is told what was passed over."""

import json
import os
import shutil
import signal
import socket
import subprocess
from pathlib import Path

import pytest
from conditioning import DAEMON_SETTINGS
from harness.daemon import HANGS_AFTER_S, REPOSITORY, Programs, binary, die_with_parent, eventually
from harness.lockstep import NEVER_SILENT
from harness.touches import Touches, grasp
from taxel import FakeDaemon


def pipe(_folder):
    return os.pipe()


def fifo(folder):
    path = folder / "images"
    os.mkfifo(path)
    read = os.open(path, os.O_RDONLY | os.O_NONBLOCK)
    write = os.open(path, os.O_WRONLY)
    os.set_blocking(read, True)
    return read, write


def stream(_folder):
    """What Node.js gives a child."""
    here, there = socket.socketpair()
    return here.detach(), there.detach()


class Lines:
    """The lines of a `taxel watch --json` that are read one by one, when they are asked for."""

    def __init__(self, ends, taxel, *arguments, **pipes):
        read, write = ends
        self.process = taxel("watch", "--json", *arguments, stdout=write, **pipes)
        os.close(write)
        # Unbuffered, so that nothing is taken that is not asked for.
        self.out = os.fdopen(read, "rb", buffering=0)

    def next(self):
        line = self.out.readline()
        assert line.endswith(b"\n"), f"torn: {line!r}"
        return json.loads(line)


@pytest.fixture
def taxel():
    with Programs() as taxel:
        yield taxel


def accounts_for(lines):
    """Whether each line says how many there were since the one before."""
    return all(after["seq"] == line["seq"] + 1 + after["skipped"] for line, after in zip(lines, lines[1:]))


@pytest.mark.parametrize("kind", [(), ("--raw",)], ids=["images", "raw frames"])
@pytest.mark.parametrize("ends", [pipe, fifo, stream])
def test_a_reader_that_stops_is_then_given_the_newest_and_the_count_of_what_it_missed(
    start, lockstep, hand, taxel, folder, ends, kind
):
    daemon = start(conditioning=DAEMON_SETTINGS, tick=NEVER_SILENT)
    driver = lockstep(daemon)
    watch = Lines(ends(folder), taxel, "--newest", "--socket", daemon.images, *kind)
    is_there = lambda reader: reader["pid"] == watch.process.pid and reader["raw"] == bool(kind)  # noqa: E731
    daemon.wait_status(lambda s: any(map(is_there, s["subscribers"])), "taxel watch does not subscribe")
    first, *frames = list(grasp(Touches.even(hand))) * 10
    driver.step(first)
    lines = [watch.next()]
    for counts in frames:
        newest = driver.step(counts)
    while lines[-1]["seq"] < newest.seq:
        lines.append(watch.next())
    assert accounts_for(lines), [(line["seq"], line["skipped"]) for line in lines]
    assert sum(line["skipped"] for line in lines[1:]) + len(lines) - 1 == newest.seq - lines[0]["seq"] >= len(frames)
    # One that waited to be taken, the one behind it, and what may be on its way from the daemon: two, and the newest.
    assert len(lines) - 1 <= 5, [line["seq"] for line in lines]


@pytest.mark.parametrize("ends", [pipe, stream])
def test_every_line_is_kept_for_who_asks_for_it(start, lockstep, hand, taxel, folder, ends):
    daemon = start(conditioning=DAEMON_SETTINGS, tick=NEVER_SILENT)
    driver = lockstep(daemon)
    watch = Lines(ends(folder), taxel, "--socket", daemon.images, "--every")
    is_there = lambda reader: reader["pid"] == watch.process.pid and reader["every"]  # noqa: E731
    daemon.wait_status(lambda s: any(map(is_there, s["subscribers"])), "taxel watch does not subscribe")
    seen = [driver.step(counts).seq for counts in list(grasp(Touches.even(hand))) * 2]
    lines = [watch.next() for _ in seen]
    while lines[-1]["seq"] < seen[-1]:
        lines.append(watch.next())
    assert {line["skipped"] for line in lines[1:]} == {0}
    assert set(seen) <= {line["seq"] for line in lines}


def test_images_from_before_the_daemon_knows_the_display_make_no_lines(taxel, folder):
    with FakeDaemon() as daemon:
        daemon.answers = False
        watch = Lines(pipe(folder), taxel, "--newest", "--socket", daemon.path, "--profile", '{"levels": 2}')
        daemon.wait_for_subscribers(timeout=HANGS_AFTER_S)
        daemon.press([(1, 1, 8)])
        daemon.answers = True
        daemon.wait_for_subscription(timeout=HANGS_AFTER_S)
        assert daemon.subscriptions[0]["profile"]["levels"] == 2
        known = daemon.press([(1, 1, 2)])
        assert watch.next()["seq"] == known.seq == 1


def test_the_newest_image_is_printed_when_the_daemon_has_gone(taxel, folder):
    with FakeDaemon() as daemon:
        watch = Lines(pipe(folder), taxel, "--newest", "--socket", daemon.path, stderr=subprocess.DEVNULL)
        daemon.wait_for_subscribers(timeout=HANGS_AFTER_S)
        # The last of them waits for a reader.
        for level in (1, 2, 3):
            newest = daemon.press([(1, 1, level)])
        daemon.stop()
        lines = [json.loads(line) for line in watch.out.read().splitlines()]
        assert lines[-1]["seq"] == newest.seq
        assert sum(line["skipped"] for line in lines) + len(lines) == 3 and accounts_for(lines)
        assert watch.process.wait() == 1


def children(pid):
    return [int(child) for child in Path(f"/proc/{pid}/task/{pid}/children").read_text().split()]


def has_ended(pid):
    """Also where nobody has asked how."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] == "Z"
    except (FileNotFoundError, ProcessLookupError):
        return True


class Driver:
    """`examples/display.js`, with the `taxel` of this folder: by default the one that was built."""

    def __init__(self, images, folder=None):
        path = f"{folder or binary('taxel').resolve().parent}:{os.environ['PATH']}"
        self.process = subprocess.Popen(
            ["node", REPOSITORY / "examples/display.js", images],
            stdout=subprocess.PIPE,
            text=True,
            env=os.environ | {"PATH": path},
            preexec_fn=die_with_parent,
        )

    def until(self, start):
        """The first line that begins so, of those that come."""
        return next(line for line in self.process.stdout if line.startswith(start))

    def rest(self):
        return self.process.stdout.read().splitlines()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        # What it leaves behind would end by itself, once nobody reads it.
        self.process.kill()
        self.process.wait()


needs_node = pytest.mark.skipif(not shutil.which("node"), reason="no node: apt-get install nodejs")


@pytest.fixture
def grasping(start):
    return start(["sim:worst-case"] * 2, tick={"mode": "timer", "rate_hz": 30.0}, boards={}, sweep={}, conditioning={})


@needs_node
@pytest.mark.parametrize("by", [signal.SIGTERM, signal.SIGINT, signal.SIGHUP, signal.SIGQUIT], ids=lambda by: by.name)
def test_a_display_in_node_lets_go_when_images_stop_and_when_it_is_told_to_end(grasping, by):
    with Driver(grasping.images) as display:
        display.until("image: 0=")
        grasping.hold()
        # The hand of this scene is idle for four of its twelve seconds: there is nothing to be let go then.
        while display.until(("no image: clear", "image: clear")) == "image: clear\n":
            grasping.go_on()
            display.until("image: 0=")
            grasping.hold()
        grasping.go_on()
        display.until("image: 0=")
        [child] = children(display.process.pid)
        display.process.send_signal(by)
        assert display.rest()[-1] == "stopped: clear"
        assert display.process.wait() == 0
        eventually(lambda: has_ended(child), "taxel watch goes on without its reader")


@needs_node
def test_a_display_in_node_lets_go_and_ends_when_its_child_ends(grasping):
    with Driver(grasping.images) as display:
        display.until("image: 0=")
        [child] = children(display.process.pid)
        os.kill(child, signal.SIGKILL)
        assert display.rest()[-1] == "closed: clear"
        assert display.process.wait() == 1


@needs_node
def test_taxel_watch_ends_when_a_display_in_node_is_killed(grasping):
    with Driver(grasping.images) as display:
        display.until("image: 0=")
        [child] = children(display.process.pid)
        display.process.kill()
        eventually(lambda: has_ended(child), "taxel watch goes on without its reader")


# A `taxel watch` that prints fifty images at once, of an hour to come; and when they were shown one from long ago.
FIFTY_AND_AN_OLD_ONE = """#!/usr/bin/env python3
import json, os, pathlib, sys, time

def line(seq, t_ns):
    image = {"seq": seq, "t_ns": t_ns, "latency_us": 1.0, "actuators": [{"id": 0, "x": 0, "y": 0, "level": seq, "force": 1.0}]}
    return json.dumps(image).encode() + b"\\n"

def wait(over):
    while os.getppid() == display and not over():
        time.sleep(0.01)

display = os.getppid()
new = time.monotonic_ns() + 3600 * 10**9
os.write(1, b"".join(line(seq, new) for seq in range(1, 51)))
wait(pathlib.Path(sys.argv[0]).with_name("shown").exists)
os.write(1, line(51, 1))
wait(lambda: False)
"""


@needs_node
def test_a_display_in_node_shows_the_newest_line_of_many_and_none_that_is_old(folder):
    program = folder / "taxel"
    program.write_text(FIFTY_AND_AN_OLD_ONE)
    program.chmod(0o755)
    with Driver("images.sock", folder) as display:
        assert display.until("") == "image: 0=50\n"
        (folder / "shown").touch()
        assert display.until("") == "no image: clear\n"
        display.process.terminate()
        assert display.rest() == ["stopped: clear"]
