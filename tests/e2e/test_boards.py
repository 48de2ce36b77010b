"""Hands of other boards than uSkin's: `taxel sim` plays them on the bus, and the real daemon has to configure and start
them before they speak. Every image is then the publication's, made from the counts of its own tick."""

import re
import tomllib

import numpy as np
import pytest
import taxel_reader
from conditioning import DAEMON_SETTINGS
from harness.bus import MulticastBuses
from harness.compare import fits_the_counts
from harness.daemon import HANGS_AFTER_S, eventually
from harness.hand import LAYOUTS


class Places:
    """Pixels of the taxels of a layout file, in the layout's order, read from the file and not from the daemon."""

    def __init__(self, text):
        layout = tomllib.loads(text)
        self.shape = (layout["image"]["height"], layout["image"]["width"])
        self.xy = []
        for module in layout["module"]:
            x0, y0 = module["at"]
            at = {k: (x0 + x, y0 + y) for y, ks in enumerate(module["order"]) for x, k in enumerate(ks) if k >= 0}
            self.xy += [at[k] for k in sorted(at)]
        self.xy = np.array(self.xy)

    def __len__(self):
        return len(self.xy)


def cyskin_triangle():
    """The built-in file with the lines for a hub filled in, as its head says. A busy machine may hold up who plays the hub in
    the middle of a packet, for longer than the 50 ms after which it is given up."""
    text = (LAYOUTS / "cyskin-triangle.toml").read_text()
    offline = r'^protocol = "offline"\n|^order = \[\n(.*\n)*?^\]\n'
    text = re.sub(offline, "", text, flags=re.M)
    text = re.sub(r"^#!", "", text, flags=re.M)
    return text.replace("[[cyskin.hub]]", "[cyskin]\ntimeout_ms = 10000\n\n[[cyskin.hub]]", 1)


TEXTS = {
    "icub-forearm": (LAYOUTS / "icub-forearm.toml").read_text,
    "cyskin-triangle": cyskin_triangle,
}


@pytest.fixture(params=TEXTS)
def patch(request, folder):
    """A layout file and what it says."""
    text = TEXTS[request.param]()
    path = folder / f"{request.param}.toml"
    path.write_text(text)
    return path, Places(text)


@pytest.fixture
def buses():
    """The patch's only bus."""
    with MulticastBuses(1) as buses:
        yield buses


@pytest.fixture
def simulate(buses, play, patch):
    return lambda scene: play(scene, buses.sources, "--layout", patch[0], "--seed", "5")


def test_every_image_fits_the_counts_that_the_boards_sent(start, simulate, patch):
    path, places = patch
    daemon = start(
        layout=path,
        # Half of the boards' rate: every tick has new values, as the publication's calibration on two frames wants it.
        tick={"mode": "timer", "rate_hz": 10.0},
        boards={"mode": "free-running"},
        sweep={"stale_after_ms": 60_000.0},
        conditioning=DAEMON_SETTINGS,
    )
    simulate("roll")
    with taxel_reader.connect(daemon.images, raw=True, every=True) as reader:
        fits_the_counts(daemon, reader, places, 20)
    daemon.wait_status(lambda s: [b["state"] for b in s["boards"]] == ["living"], "its board is not living")


def two_hubs():
    """The triangle twice, on a bus and a hub each."""
    text = cyskin_triangle()
    head, rest = text.split("[[cyskin.hub]]", 1)
    hub, module = rest.split("[[module]]", 1)
    width = tomllib.loads(text)["image"]["width"]
    second = {'"can0"': '"can1"', '"hub"': '"second"', "0x01": "0x02", "at = [0, 0]": f"at = [{width}, 0]"}
    name = tomllib.loads(text)["module"][0]["name"]

    def other(part):
        for old, new in second.items():
            part = part.replace(old, new)
        return part.replace(f'name = "{name}"', f'name = "{name} 2"')

    head = head.replace('["can0"]', '["can0", "can1"]').replace(f"width = {width}", f"width = {2 * width}")
    return "".join([head, "[[cyskin.hub]]", hub, "[[cyskin.hub]]", other(hub), "[[module]]", module, "\n[[module]]", other(module)])


def test_cyskin_hubs_on_each_others_bus_are_started_there_and_told_of(start, play, folder):
    layout = folder / "two-hubs.toml"
    layout.write_text(two_hubs())
    with MulticastBuses(2) as buses:
        daemon = start(
            sources=buses.sources,
            layout=layout,
            tick={"mode": "timer", "rate_hz": 20.0},
            boards={"mode": "free-running"},
            sweep={},
        )
        swapped = play("idle", reversed(buses.sources), "--layout", layout)
        status = daemon.wait_status(
            lambda s: [p["kind"] for p in s["problems"]] == ["buses-swapped"], "swapped hubs are not told of"
        )
        (problem,) = status["problems"]
        assert "can0 and can1 look swapped: 2 boards that only one of them has" in problem["sentence"], problem
        assert buses.sources[0] in problem["sentence"] and problem["severe"]
        swapped.kill()
        swapped.wait()
        play("idle", buses.sources, "--layout", layout)
        daemon.wait_status(
            lambda s: not s["problems"] and {b["state"] for b in s["boards"]} == {"living"}, "it is never over"
        )
        loads = lambda s: [(b["load_percent"], b["load_percent_most"]) for b in s["buses"]]  # noqa: E731
        daemon.wait_status(lambda s: all(0 < load < most < 1.25 * load for load, most in loads(s)), "no load is told")


def test_boards_come_up_feel_the_ball_and_nothing_is_misunderstood(start, simulate, patch):
    path, places = patch
    simulate("roll")
    daemon = start(
        layout=path,
        tick={"mode": "sweep"},
        boards={"mode": "free-running"},
        sweep={},
        profile={"method": "optimal"},
    )
    contacts = []
    with taxel_reader.connect(daemon.images) as reader:
        # Half of the scene: the taps, and the ball on its way.
        while len(contacts) < 11 * 20:
            message = reader.receive(HANGS_AFTER_S)
            assert message is not None, "the daemon sends nothing more"
            if isinstance(message, taxel_reader.Image) and not message.calibrating:
                contacts.append(message.contacts)
    touched = sum(n > 0 for n in contacts)
    assert 0.2 * len(contacts) < touched < 0.9 * len(contacts), f"touched in {touched} of {len(contacts)} images"
    assert max(contacts) <= len(places)

    def is_heard(status):
        (board,) = status["boards"]
        return board["state"] == "living" and abs(board["period_ms"] - 50) < 5

    status = daemon.wait_status(is_heard, "its board does not keep its period")
    (board,), (counts,) = status["boards"], status["buses"]
    assert (board["malformed"], board["queue_overflows"], counts["unknown"]) == (0, 0, 0), status
    assert status["faults"] == [], status["faults"]


def test_boards_that_are_gone_are_told_and_started_from_the_beginning_when_they_are_back(start, simulate, patch):
    path, _ = patch
    first = simulate("idle")
    daemon = start(
        layout=path,
        boards={"mode": "free-running", "restart_longest_ms": 1000.0},
        sweep={},
    )

    def state(wanted):
        return lambda status: [b["state"] for b in status["boards"]] == [wanted]

    daemon.wait_status(state("living"), "the boards were not started")
    first.kill()
    first.wait()
    daemon.wait_status(state("silent"), "boards that are gone are not told")
    simulate("idle")
    daemon.wait_status(state("living"), "boards that are back are not configured and started")
    assert daemon.status()["boards"][0]["restarts"] > 0


def test_modules_without_a_board_are_no_boards_that_are_silent(start, folder, buses, play):
    own = folder / "mix.toml"
    own.write_text(
        'name = "mix"\nimage = { width = 8, height = 4 }\nbuses = ["can0"]\n'
        '[[module]]\nname = "b"\npart = "p"\nprotocol = "offline"\nat = [4, 0]\norder = [[0, 1], [2, 3]]\n'
        '[[module]]\nname = "a"\npart = "p"\nbus = "can0"\nboard = 1\nprotocol = "uskin-l1"\nat = [0, 0]\n'
    )
    daemon = start(layout=own, boards={"mode": "free-running"})
    play("idle", buses.sources, "--layout", "uskin-module")
    status = daemon.wait_status(lambda s: [b["state"] for b in s["boards"]] == ["living"], "its board does not speak")
    assert [b["module"] for b in status["boards"]] == ["a"] and status["missing"] == 4, status
    daemon.report(3)
    assert daemon.status()["problems"] == [], daemon.log
    eventually(lambda: "its board speaks" in daemon.log, lambda: f"boards that are none are waited for\n{daemon.log}")
    assert "module b has no board" in daemon.log
