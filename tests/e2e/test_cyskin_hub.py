"""CySkin hubs of a program of its own (harness/cyskin.py) on the real daemon, and that program on the simulated hub."""

import time
from pathlib import Path

import can
import taxel_reader
from harness import cyskin
from harness.bus import MulticastBuses
from harness.daemon import HANGS_AFTER_S

VECTORS = Path(__file__).resolve().parents[2] / "crates/skin/tests/vectors/cyskin.txt"
HUB, MODULES = 0x2A, [3, 4, 9]
TAXELS = list(range(1, cyskin.SENSORS))


def layout_text():
    """A layout file that says no more than where the hub is."""
    text = 'name = "hub"\nbuses = ["can0"]\nimage = { width = 11, height = 3 }\n'
    text += f'[[cyskin.hub]]\nname = "hub"\nbus = "can0"\naddress = {HUB}\n'
    for row, module in enumerate(MODULES):
        text += f'[[module]]\nname = "m{module}"\npart = "p"\nbus = "can0"\nhub = "hub"\nboard = {module}\n'
        text += f'protocol = "cyskin"\nat = [0, {row}]\norder = [{TAXELS}]\n'
    return text


def value(module, sensor):
    return 20_000 + 256 * module + sensor


def message(id, data):
    return can.Message(arbitration_id=id, is_extended_id=False, data=data)


def listen(hub, bus, seconds):
    """Gives a hub all that came, but not what it sent itself: this bus hears its own frames."""
    while (heard := bus.recv(seconds)) is not None:
        if heard.arbitration_id & 0xFF == cyskin.EVERYBODY:
            hub.hear(heard.arbitration_id, heard.data)


def test_the_vectors_of_the_crate_are_those_of_this_implementation():
    assert VECTORS.read_text().splitlines() == list(cyskin.vectors())


def test_a_hub_is_started_as_the_library_does_and_its_values_are_read(start, folder):
    path = folder / "hub.toml"
    path.write_text(layout_text())
    hub = cyskin.Hub(HUB, MODULES)
    with MulticastBuses(1) as buses:
        daemon = start(
            sources=buses.sources,
            layout=path,
            tick={"mode": "timer", "rate_hz": 20.0},
            boards={"mode": "free-running"},
            sweep={"stale_after_ms": 5000.0},
        )
        with taxel_reader.connect(daemon.images, raw=True) as reader:
            raw, limit = None, time.monotonic() + HANGS_AFTER_S
            while time.monotonic() < limit:
                listen(hub, buses.buses[0], 0.02)
                if hub.sends:
                    buses.send([(0, message(*frame)) for frame in hub.sweep(value)])
                    frame = reader.receive(0.2)
                    if isinstance(frame, taxel_reader.Raw) and all(t.freshness == 2 for t in frame.taxels):
                        raw = frame
                        break
        assert hub.heard[:2] == ["5FF#3802003280", "5FF#370101CE"], hub.heard
        assert raw is not None, "no frame was ever complete"
        assert [t.counts[2] for t in raw.taxels] == [value(m, s) for m in MODULES for s in TAXELS]
        (bus,) = daemon.status()["buses"]
        assert bus["unknown"] == 0, bus
        daemon.stop()
        listen(hub, buses.buses[0], 1.0)
    assert hub.heard[-1] == "5FF#370100C9" and not hub.sends


def test_the_simulated_hub_is_one_to_this_implementation(folder, play):
    path = folder / "hub.toml"
    path.write_text(layout_text())
    reader, seen = cyskin.Reader(), {}
    with MulticastBuses(1) as buses:
        play("idle", buses.sources, "--layout", path, "--seed", "5")
        limit = time.monotonic() + HANGS_AFTER_S
        while len(seen) < len(MODULES) * cyskin.SENSORS and time.monotonic() < limit:
            if not seen:
                start = [(cyskin.AUTO_SYNC_PERIOD, [0, 20]), (cyskin.AUTO_SYNC, [1])]
                for command, data in start:
                    buses.send([(0, message(*frame)) for frame in cyskin.frames(cyskin.EVERYBODY, command, data)])
            while (heard := buses.buses[0].recv(0.2)) is not None and time.monotonic() < limit:
                if heard.arbitration_id & 0xFF != HUB:
                    continue
                packet = reader.take(heard.arbitration_id, heard.data)
                if packet is not None:
                    hub, command, data = packet
                    assert (hub, command) == (HUB, cyskin.SENSOR_DATA) and len(data) <= 40
                    seen.update({(module, sensor): z for module, sensor, z in cyskin.values_of(data)})
                    if len(seen) == len(MODULES) * cyskin.SENSORS:
                        break
    assert sorted(seen) == [(m, s) for m in MODULES for s in range(cyskin.SENSORS)]
    assert all(19_900 < z < 26_100 for (_, sensor), z in seen.items() if sensor > 0), seen
