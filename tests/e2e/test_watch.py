"""`taxel watch` as a child process: whoever reads its lines slowly is given the newest, and is told what was passed over."""

import json
import os
import socket

import pytest
from conditioning import DAEMON_SETTINGS
from harness.daemon import Programs
from harness.lockstep import NEVER_SILENT
from harness.touches import Touches, grasp


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

    def __init__(self, ends, taxel, *arguments):
        read, write = ends
        self.process = taxel("watch", "--json", *arguments, stdout=write)
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
    watch = Lines(ends(folder), taxel, "--socket", daemon.images, *kind)
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
