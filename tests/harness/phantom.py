"""A phantom that the simulator's probe palpates through the daemon, in real time."""

import json
import subprocess
import threading

from harness.daemon import binary, eventually


def output_of(*arguments):
    command = [binary("taxel"), *map(str, arguments)]
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout


def lines_of(stream):
    """The list that the lines of a stream are added to as they come."""
    lines = []
    threading.Thread(target=lambda: lines.extend(iter(stream.readline, "")), daemon=True).start()
    return lines


class Phantom:
    """The first phantom, touched by a motion of one's own: its scene, the probe's layout file with the simulator's hub, and a map."""

    def __init__(self, folder, depth_mm, radius_mm=0, first_areas=("NA", "NA", "NA", "BS")):
        self.folder = folder
        text = output_of("sim", "phantom-1", "--show")
        for shown, wanted in [
            ("depth_mm = 12.5", f"depth_mm = {depth_mm}"),
            ("radius_mm = 0", f"radius_mm = {radius_mm}"),
            ('["NA", "NA", "NA", "BS"]', json.dumps(first_areas)),
        ]:
            assert text.count(shown) == 1, text
            text = text.replace(shown, wanted)
        self.scene = folder / "phantom.toml"
        self.scene.write_text(text)
        self.probe = folder / "probe.toml"
        self.probe.write_text(output_of("sim", self.scene, "--layout", "cyskin-triangle", "--show"))
        self.map = folder / "map.json"

    def offline(self, classes=5):
        """Keeps the map of all touches, and says what is found without a bus."""
        sizes = ["--classes", classes, "--save", self.map, "--json"]
        return json.loads(output_of("categorize", f"sim:{self.scene}", *sizes))

    def daemon(self, start, sources):
        """A daemon that reads the probe."""
        tables = {"boards": {"mode": "free-running"}, "sweep": {"stale_after_ms": 5000.0}}
        return start(sources=sources, layout=self.probe, **tables)

    def begin(self, taxel, daemon, source):
        """Palpates area after area, again and again, with marks."""
        return taxel("sim", self.scene, "--to", source, "--control", daemon.control_path, stderr=subprocess.DEVNULL)


class Categorizer:
    """`taxel categorize --live` with a phantom's map, and the touches that it tells."""

    def __init__(self, taxel, phantom, daemon, *more):
        self.log = phantom.folder / "live.log"
        arguments = ["--live", phantom.map, "--socket", daemon.images, *more]
        self.process = taxel("categorize", *arguments, stdout=subprocess.PIPE, stderr=self.log.open("w"))
        self.lines = lines_of(self.process.stdout)

    def touches(self):
        """Those that have a category."""
        return [touch for touch in map(json.loads, self.lines) if "error" not in touch]

    def wait_told(self, enough, offline):
        """Waits until `enough` areas were told in the category that they have offline; all touches until then.

        A touch that lacks a step or has it late, as on a machine that stood still meanwhile, comes again in the next round.
        """

        def is_told(touch):
            return touch["category"] == offline["labels"][area(touch)] and not touch["unknown"]

        def all_areas():
            assert self.process.poll() is None, self.log.read_text()
            return enough({area(touch) for touch in self.touches() if is_told(touch)})

        eventually(all_areas, lambda: f"{self.lines}\n{self.log.read_text()}")
        return self.touches()


def two_categories(offline):
    """Whether areas are of two categories."""
    return lambda areas: len({offline["labels"][area] for area in areas}) > 1


def area(touch):
    return int(touch["mark"].split()[1])
