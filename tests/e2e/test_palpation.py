"""A phantom palpated over the bus at 20 Hz: `taxel sim` makes the marks, and `taxel categorize --live` tells each touch's category."""

import json
import re
import subprocess
import threading

import pytest
import taxel_reader
from harness.bus import MulticastBuses
from harness.daemon import binary, die_with_parent, eventually

AREAS = 16
# Shallow, so that a round of the scene is short; its touches can be told apart all the same.
DEPTH = "6.5"


@pytest.fixture
def buses():
    """The probe's only bus."""
    with MulticastBuses(1) as buses:
        yield buses


@pytest.fixture
def taxel():
    """Starts `taxel` with these arguments; it is gone after the test."""
    running = []

    def taxel(*arguments, **pipes):
        process = subprocess.Popen(
            [binary("taxel"), *map(str, arguments)], preexec_fn=die_with_parent, text=True, **pipes
        )
        running.append(process)
        return process

    yield taxel
    for process in running:
        process.kill()
        process.wait()


def output_of(*arguments):
    command = [binary("taxel"), *map(str, arguments)]
    return subprocess.run(command, check=True, capture_output=True, text=True, timeout=60).stdout


def lines_of(stream):
    """The list that the lines of a stream are added to as they come."""
    lines = []
    threading.Thread(target=lambda: lines.extend(iter(stream.readline, "")), daemon=True).start()
    return lines


def touches_of(path):
    """The list that the touches of a socket are added to as they come, and the HELLO before them."""
    touches, reader = [], taxel_reader.connect(path)

    def read():
        try:
            while True:
                message = reader.receive()
                if message.header.type == taxel_reader.TOUCH:
                    touches.append((message.header, message.json()))
        except taxel_reader.Closed:
            pass

    threading.Thread(target=read, daemon=True).start()
    return touches, reader


@pytest.fixture
def scene(folder):
    """The first phantom, touched less deeply."""
    text = output_of("sim", "phantom-1", "--show").replace("depth_mm = 12.5", f"depth_mm = {DEPTH}")
    path = folder / "phantom.toml"
    path.write_text(text)
    return path


@pytest.fixture
def probe(folder, scene):
    """The layout file of the probe with the hub that the simulator has."""
    path = folder / "probe.toml"
    path.write_text(output_of("sim", scene, "--layout", "cyskin-triangle", "--show"))
    return path


@pytest.fixture
def start_probe(start, probe, buses):
    """Starts a daemon that reads the probe."""

    def start_probe():
        return start(
            sources=buses.sources, layout=probe, boards={"mode": "free-running"}, sweep={"stale_after_ms": 5000.0}
        )

    return start_probe


def test_every_touch_of_a_phantom_is_told_in_its_category(start_probe, taxel, buses, scene, folder):
    classes = ["--classes", "5", "--save", folder / "map.json", "--json"]
    offline = json.loads(output_of("categorize", f"sim:{scene}", *classes))
    assert offline["touches"] == AREAS
    daemon = start_probe()
    own = folder / "touches.sock"
    arguments = ["--live", folder / "map.json", "--socket", daemon.images, "--publish", own]
    live = taxel("categorize", *arguments, stdout=subprocess.PIPE, stderr=(folder / "live.log").open("w"))
    lines = lines_of(live.stdout)
    eventually(own.exists, "no socket of touches", 30)
    published, reader = touches_of(own)
    taxel("sim", scene, "--to", buses.sources[0], "--control", daemon.control_path, stderr=subprocess.DEVNULL)

    def area(touch):
        return int(touch["mark"].split()[1])

    def is_told(touch):
        return touch["category"] == offline["labels"][area(touch)] and not touch["unknown"]

    def all_areas():
        assert live.poll() is None, (folder / "live.log").read_text()
        return {area(touch) for touch in map(json.loads, lines) if is_told(touch)} == set(range(AREAS))

    # A touch that lacks a step or has it late, as on a machine that stood still meanwhile, comes again in the next round.
    eventually(all_areas, lambda: f"{lines}\n{(folder / 'live.log').read_text()}", 90)
    touches = [json.loads(line) for line in lines]
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
        live.kill()
        live.wait()
        seen += [next(iter(images)) for _ in range(20)]
    assert [image.seq - seen[0].seq for image in seen] == list(range(25))
    assert not any(image.header.skipped for image in seen[1:])


def test_the_map_of_another_probe_is_refused(start, taxel, folder, scene):
    output_of("categorize", f"sim:{scene}", "--classes", "2", "--save", folder / "map.json")
    with MulticastBuses(2) as buses:
        daemon = start(sources=buses.sources)
        live = taxel(
            "categorize", "--live", folder / "map.json", "--socket", daemon.images, stderr=subprocess.PIPE
        )
        _, said = live.communicate(timeout=30)
    assert live.returncode == 1
    assert "has 7 values a frame, and allegro-uskin-15 has 240 taxels; it is of another probe" in said, said


def test_the_demo_of_a_phantom_makes_its_marks_and_puts_touches_onto_the_map(scene):
    out = output_of("demo", "--scene", scene, "--headless", "--seconds", "10")
    touches = re.search(r"^touches +(\d+), (\d+) in the category of their class, 0 unknown$", out, re.MULTILINE)
    assert touches and int(touches[1]) > 0, out
