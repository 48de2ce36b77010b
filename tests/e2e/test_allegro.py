"""Joint angles of Allegro hands, on a bus of their own or beside the skin, through the real taxeld, to `taxel watch`."""

import json
import math
import subprocess

import can
import pytest
from harness.beside import Beside
from harness.bus import GROUP, free_udp_port
from harness.daemon import HANGS_AFTER_S, Daemon, binary, eventually
from harness.joints import SCENE, TICK, Watch, all_known, comes, refused

COUNT_RAD = math.radians(333.3 / 65536)
FINGERS = ("index", "middle", "ring", "thumb")


def allegro_frame(version, finger, counts):
    """The position frame of a finger, at rest at these counts from the centre."""
    if version >= 4:
        data = b"".join(c.to_bytes(2, "little", signed=True) for c in counts)
        return 0x080 + 4 * finger, data
    data = b"".join((c + 32768).to_bytes(2, "little") for c in counts)
    return 0x3C0 | 2 << 3 | 3 + finger, data


def motor_error(motor, bits, device=0):
    """What a hand of version 5 reports of a motor."""
    return can.Message(arbitration_id=0x3B8 + device, is_extended_id=False, data=bytes([motor, bits]))


class Fingers(Beside):
    """A hand that another program has started: each finger's position, `counts` from the centre, again and again."""

    def __init__(self, bus, version, counts, device=0):
        super().__init__()
        self.bus = bus
        frames = [allegro_frame(version, finger, counts[finger]) for finger in range(4)]
        self.messages = [can.Message(arbitration_id=id + device, is_extended_id=False, data=data) for id, data in frames]
        self.ids = {message.arbitration_id for message in self.messages}

    def run(self):
        while not self.stop.wait(0.003):
            for message in self.messages:
                self.bus.send(message)


@pytest.mark.parametrize("version", [1, 2, 3, 4, 5])
def test_an_allegro_hand_is_listened_to_and_never_spoken_to(folder, version):
    port = free_udp_port()
    address = f"allegro:udp:{GROUP}:{port}?hops=0"
    counts = [[1000 * finger + 100 * j - 2000 for j in range(4)] for finger in range(4)]
    count_rad = COUNT_RAD if version < 5 else math.radians(0.088)
    angles = [c * count_rad for finger in counts for c in finger]
    joints = {"source": address, "allegro": {"version": version}}
    with (
        can.Bus(GROUP, interface="udp_multicast", port=port, hop_limit=0) as bus,
        can.Bus(GROUP, interface="udp_multicast", port=port, hop_limit=0) as ear,
        Daemon(folder / "d", SCENE, tick=TICK, joints=joints) as daemon,
        Watch(daemon) as watch,
    ):
        # The first report may come before the tick thread has told whether the bus is there.
        daemon.wait_status(lambda s: s["joints"]["state"] == "waiting", "the hand's bus is not there")
        assert set(watch.more(5)[-1]["joints"]) == {None}
        with Fingers(bus, version, counts) as hand:
            image = watch.until(all_known, "the hand's angles stay unknown")
            assert image["joints"] == pytest.approx(angles, abs=1e-6)
            joints = daemon.wait_status(lambda s: s["joints"]["state"] == "connected", "not said to be connected")["joints"]
            assert joints["writes"] == "never" and joints["sent"] == 0
            assert [j["name"] for j in joints["joints"][::4]] == [f"{finger} 0" for finger in FINGERS]
        watch.until(lambda image: set(image["joints"]) == {None}, "angles of a silent hand stay known")
        daemon.wait_status(lambda s: s["joints"]["state"] == "gone", "the status does not say that it is silent")
        comes(daemon, "hand-silent", None, "sends no angles", "taxeld only listens")
        daemon.stop()
        heard = set()
        while message := ear.recv(0.2):
            heard.add(message.arbitration_id)
        assert heard == hand.ids, "it sent something"


def test_an_error_that_a_hand_of_version_5_reports_of_a_motor_is_a_problem_until_it_takes_it_back(folder):
    port = free_udp_port()
    address = f"udp:{GROUP}:{port}?hops=0"
    joints = {"source": f"allegro:{address}", "allegro": {"version": 5, "device": 1}}
    with (
        can.Bus(GROUP, interface="udp_multicast", port=port, hop_limit=0) as bus,
        Daemon(folder / "d", SCENE, tick=TICK, joints=joints) as daemon,
        Fingers(bus, 5, [[0] * 4] * 4, device=1),
    ):
        report = lambda motor, bits: bus.send(motor_error(motor, bits, device=1))
        daemon.wait_status(lambda s: s["joints"]["state"] == "connected", "not said to be connected")
        assert daemon.status()["joints"]["motor_errors"] == 0
        report(3, 0x24)
        found = comes(daemon, "hand-error", "index 3", "motor 3 (index 3): overheating, overload (0x24)", "Let it cool down")
        assert found["severe"]
        joints = daemon.status()["joints"]
        assert joints["motor_errors"] == 1 and joints["malformed"] == 0
        assert [j["problems"] for j in joints["joints"]] == [["hand-error"] if j == 3 else [] for j in range(16)]
        doctor = subprocess.run([binary("taxel"), "doctor", "--config", daemon.config], capture_output=True, text=True)
        assert "motor 3 (index 3): overheating" in " ".join(doctor.stdout.split()), doctor.stdout
        report(3, 0)
        daemon.wait_status(lambda s: not s["problems"], "the error is not over")
        assert "reported no error of motor 3" in daemon.log


@pytest.mark.parametrize(
    ("version", "start", "end"),
    [(3, [0x08A, 0x0CA, 0x14A, 0x04A, 0x38A], [0x08A]), (4, [0x204, 0x100], [0x104])],
)
def test_a_hand_of_its_own_bus_is_started_and_stopped(folder, version, start, end):
    port = free_udp_port()
    joints = {"source": f"allegro:udp:{GROUP}:{port}?hops=0", "allegro": {"version": version, "own_bus": True}}
    with can.Bus(GROUP, interface="udp_multicast", port=port, hop_limit=0) as ear:
        with Daemon(folder / "d", SCENE, tick=TICK, joints=joints) as daemon:
            heard = [ear.recv(HANGS_AFTER_S).arbitration_id for _ in start]
            assert heard == start
            assert "start" in daemon.status()["joints"]["writes"]
        last = None
        while message := ear.recv(0.2):
            last = message.arbitration_id
        assert [last] == end


@pytest.mark.parametrize("version", [3, 4])
def test_a_recording_has_the_hands_angles_in_its_own_time_live_and_offline(folder, version):
    skin, log = folder / "skin.log", folder / "both.log"
    subprocess.run([binary("taxel"), "sim", "tap", "--to", f"log:{skin}"], check=True, capture_output=True)
    lines = skin.read_text().splitlines()
    stamp = lambda line: float(line[1 : line.index(")")])
    start, end = stamp(lines[0]), min(stamp(lines[-1]), stamp(lines[0]) + 4.0)
    lines = [line for line in lines if stamp(line) <= end]
    # One count a millisecond; the fingers report one after another, every 3 ms.
    truth = lambda t_s, joint: (t_s * 1000 - 100 * joint) * COUNT_RAD
    t = 0.0
    while start + t <= end:
        for finger in range(4):
            at = t + 0.0005 * finger
            counts = [round(at * 1000) - 100 * (4 * finger + j) for j in range(4)]
            id, data = allegro_frame(version, finger, counts)
            lines.append(f"({start + at:.6f}) hand {id:03X}#{data.hex().upper()}")
        t += 0.003
    log.write_text("\n".join(sorted(lines, key=stamp)) + "\n")

    joints = {"source": f"allegro:log:{log}?interface=hand", "allegro": {"version": version}}
    sources = [f"log:{log}?interface=can0", f"log:{log}?interface=can1"]
    config = Daemon(folder / "d", sources, tick=TICK, joints=joints).config
    out = folder / "images.jsonl"
    subprocess.run([binary("taxel"), "compress", log, "--config", config, "--out", out], check=True)
    offline = {image["seq"]: image for image in map(json.loads, out.read_text().splitlines())}
    assert len(offline) > 100
    for image in list(offline.values())[5:]:
        for joint, angle in enumerate(image["joints"]):
            assert angle == pytest.approx(truth(image["t_ns"] * 1e-9, joint), abs=2 * COUNT_RAD), (image["seq"], joint)

    daemon = Daemon(folder / "live", sources, tick=TICK, joints=joints)
    try:
        # It is there before the recording begins, which on a busy machine may be over soon.
        with Watch(daemon, "--reconnect") as watch:
            daemon.start()
            eventually(lambda: "played to its end" in daemon.log, "the recording does not end")
            live = watch.lines
    finally:
        daemon.kill()
    assert live, "no image was seen of it"
    assert [image["joints"] for image in live] == [offline[image["seq"]]["joints"] for image in live]


@pytest.mark.parametrize(
    ("version", "ids"),
    # Positions of a finger against taxels of boards 4 and 5; commands to the hand against taxels of boards 1 and 2 and
    # the start of board 4.
    [(3, "403, 413, 423, 433, 503, 513, 523, 533"), (4, "100, 200, 204, 220")],
)
def test_a_hand_and_a_skin_with_the_same_ids_on_one_bus_are_refused_by_name(folder, version, ids):
    log = refused(folder, ["can:can0", "can:can1"], {"source": "allegro:can1", "allegro": {"version": version}})
    for part in ["taxeld.toml:", "can:can1 (bus can1)", f"the CAN ids {ids};", "a bus of its own"]:
        assert part in log, f"{part}: {log}"


@pytest.mark.parametrize("version", [3, 4])
def test_a_hand_on_the_skins_bus_is_read_beside_it_and_either_goes_on_without_the_other(folder, play, version):
    port = free_udp_port()
    address = f"udp:{GROUP}:{port}?hops=0"
    counts = [[900 * finger - 120 * j for j in range(4)] for finger in range(4)]
    angles = [c * COUNT_RAD for finger in counts for c in finger]
    joints = {"source": f"allegro:{address}", "allegro": {"version": version}}
    with (
        can.Bus(GROUP, interface="udp_multicast", port=port, hop_limit=0) as bus,
        can.Bus(GROUP, interface="udp_multicast", port=port, hop_limit=0) as ear,
        Daemon(folder / "d", [address], layout="uskin-module", tick=TICK, joints=joints) as daemon,
        Watch(daemon) as watch,
    ):
        with Fingers(bus, version, counts) as hand:
            # The hand alone: its skin is missed, its joints are not.
            watch.until(all_known, "the hand's angles stay unknown without the skin")
            heard = {ear.recv(HANGS_AFTER_S).arbitration_id for _ in range(400)}
            # What it holds back for who reads so late begins with what was sent first.
            assert heard == hand.ids | {0x201}, "something else than the start of the skin's board was sent"

            skin = play("roll", [address], "--layout", "uskin-module")
            image = watch.until(lambda image: image["missing"] == 0 and image["contacts"] > 0 and all_known(image), "no touch is seen")
            assert image["joints"] == pytest.approx(angles, abs=1e-6)

            def is_well(status):
                living = [board["state"] for board in status["boards"]] == ["living"]
                return living and status["joints"]["state"] == "connected" and not status["problems"]

            (skin_bus,) = daemon.wait_status(is_well, "there are problems")["buses"]
            assert skin_bus["joints"] > 400 and skin_bus["unknown"] == 0, skin_bus
            accounted = [
                "used", "unknown", "not_data", "commands", "malformed", "queue_overflows", "duplicate", "late", "settling", "joints"
            ]  # fmt: skip
            assert sum(skin_bus[kind] for kind in accounted) == skin_bus["received"]

            skin.kill()
            comes(daemon, "board-silent", None, "silent")
            watch.more(20)
            watch.until(all_known, "a silent skin hides the hand")
        comes(daemon, "hand-silent", None, "sends no angles")
