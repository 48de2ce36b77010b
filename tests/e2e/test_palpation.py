"""A phantom palpated over the bus at 20 Hz: `taxel sim` makes the marks, and `taxel categorize --live` tells each touch's category."""

import re
import signal
import subprocess

import pytest
import taxel_reader
from harness.bus import MulticastBuses
from harness.daemon import Programs, eventually, gathered, reader_of
from harness.phantom import Categorizer, Phantom, two_categories
from harness.terminal import Terminal

AREAS = 16
# Shallow, so that a round of the scene is short; its touches can be told apart all the same.
DEPTH_MM = 6.5


@pytest.fixture
def buses():
    """The probe's only bus."""
    with MulticastBuses(1) as buses:
        yield buses


@pytest.fixture
def taxel():
    with Programs() as taxel:
        yield taxel


def test_every_touch_of_a_phantom_is_told_in_its_category(start, taxel, buses, folder):
    phantom = Phantom(folder, DEPTH_MM)
    offline = phantom.offline()
    assert offline["touches"] == AREAS
    daemon = phantom.daemon(start, buses.sources)
    own = folder / "touches.sock"
    live = Categorizer(taxel, phantom, daemon, "--publish", own)
    reader = reader_of(own)
    published = gathered(reader, taxel_reader.TOUCH)
    phantom.begin(taxel, daemon, buses.sources[0])
    touches = live.wait_told(lambda areas: len(areas) == AREAS, offline)
    for touch in touches:
        assert touch["label"] == offline["class_of_label"][touch["category"]], touch
        assert len(touch["distances"]) == 5 and touch["start_ns"] < touch["end_ns"], touch
        assert touch["latency_us"] > 0, touch
    eventually(lambda: len(published) >= len(touches), lambda: f"{len(published)} published, {len(touches)} told")
    assert [touch for _, touch in published[: len(touches)]] == touches
    assert all(header.t_ns == touch["end_ns"] for header, touch in published)
    assert reader.hello["daemon"].startswith("taxel ") and len(reader.hello["taxels"]) == 7

    # Another reader has every image, in order, while this one is killed.
    with taxel_reader.connect(daemon.images, every=True) as images:
        seen = [next(iter(images)) for _ in range(5)]
        live.process.kill()
        live.process.wait()
        seen += [next(iter(images)) for _ in range(20)]
    assert [image.seq - seen[0].seq for image in seen] == list(range(25))
    assert not any(image.header.skipped for image in seen[1:])


def test_touches_that_turn_the_probe_are_told_in_their_categories(start, taxel, buses, folder):
    phantom = Phantom(folder, DEPTH_MM, radius_mm=10, first_areas=("NA", "BS", "NA", "NA"))
    offline = phantom.offline()
    # 61 angles; the descent before the mark is no part of the touch.
    assert (offline["aligned_by"], offline["steps"], offline["first"], offline["step"]) == ("angle", 61, -30.0, 1.0), offline
    assert offline["labels"][0] != offline["labels"][1], "nothing, and a big ball that is near"
    daemon = phantom.daemon(start, buses.sources)
    live = Categorizer(taxel, phantom, daemon)
    phantom.begin(taxel, daemon, buses.sources[0])
    touches = live.wait_told(two_categories(offline), offline)
    for touch in touches:
        assert 6.0e9 < touch["end_ns"] - touch["start_ns"], "61 steps of 100 ms"


@pytest.mark.parametrize("ending", [signal.SIGTERM, signal.SIGINT])
def test_a_signal_leaves_nothing_of_the_socket_of_touches(start, taxel, buses, folder, ending):
    phantom = Phantom(folder, DEPTH_MM)
    phantom.offline(2)
    daemon = phantom.daemon(start, buses.sources)
    own = folder / "published" / "touches.sock"
    live = Categorizer(taxel, phantom, daemon, "--publish", own)
    eventually(own.exists, "no socket of touches")
    live.process.send_signal(ending)
    assert live.process.wait() == -ending
    assert not own.parent.exists(), list(own.parent.iterdir())


def test_the_map_of_another_probe_is_refused(start, taxel, folder):
    phantom = Phantom(folder, DEPTH_MM)
    phantom.offline(2)
    with MulticastBuses(2) as buses:
        daemon = start(sources=buses.sources)
        live = taxel(
            "categorize", "--live", phantom.map, "--socket", daemon.images, stderr=subprocess.PIPE
        )
        _, said = live.communicate()
    assert live.returncode == 1
    assert "has 7 values a frame, and allegro-uskin-15 has 240 taxels; it is of another probe" in said, said


def test_the_demo_of_a_phantom_makes_its_marks_and_puts_touches_onto_the_map(folder):
    def find(pattern):
        terminal.shows("")
        return re.search(pattern, "\n".join(terminal.screen.display))

    with Terminal(folder, "demo", "--scene", Phantom(folder, DEPTH_MM).scene) as terminal:
        eventually(lambda: find(r" [1-9]\d* of \d+ in their class's"), lambda: "\n".join(terminal.screen.display))
        terminal.press("q")
        summary = r"touches +(\d+), (\d+) in the category of their class, (\d+) unknown"
        touches = eventually(lambda: find(summary), lambda: "\n".join(terminal.screen.display))
    # One whose frames a busy machine makes late is not like the others of its class, and unknown.
    told, right, unknown = map(int, touches.groups())
    assert right > 0 and right + unknown == told, touches[0]
