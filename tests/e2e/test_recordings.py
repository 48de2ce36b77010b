"""The same traffic gives the same bytes: played twice, and live against offline."""

import json
import re
import socket
import struct
import subprocess
import sys

import pytest
import taxel_reader
from conditioning import DAEMON_SETTINGS
from harness.bus import GROUP, free_udp_port
from harness.candump import write_candump
from harness.compare import content
from harness.daemon import binary, eventually
from harness.lockstep import NEVER_SILENT, SWEEP, next_image
from harness.terminal import Terminal
from harness.touches import Touches, grasp
from mcap.reader import make_reader
from mcap.writer import Writer

FIRST_SWEEP_S = 2.0  # time for the subscriber to connect before anything is to be seen

def sources(path, hand):
    return [f"log:{path}?interface={bus}" for bus in hand.buses]


def with_nothing_skipped(packet):
    """The packet without what its header says of this one reader: how many images it was not given before."""
    packet = bytearray(packet)
    flags, = struct.unpack_from("<H", packet, 10)
    struct.pack_into("<H", packet, 10, flags & ~taxel_reader.FLAG_GAP)
    struct.pack_into("<I", packet, 32, 0)
    return bytes(packet)


def image_packets(daemon):
    """Every IMAGE packet until the daemon ends, by number. On a busy machine newer images overtake some before they are sent."""
    packets = {}
    with socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET) as connection:
        connection.connect(str(daemon.images))
        while packet := connection.recv(taxel_reader.MAX_MESSAGE):
            header = taxel_reader.decode_header(packet)
            if header.type == taxel_reader.IMAGE:
                packets[header.seq] = with_nothing_skipped(packet)
    return packets


def offline_packets(log, daemon, out):
    """What `taxel compress` makes of it with the daemon's own configuration, by number."""
    subprocess.run(
        [binary("taxel"), "compress", log, "--config", daemon.config, "--out", out], check=True, capture_output=True
    )
    data, packets = out.read_bytes(), {}
    while data:
        message, length = taxel_reader.decode(data)
        packets[message.seq], data = data[:length], data[length:]
    return packets


def play(start, path, hand, **tables):
    """Packets of one run over the recording, which ends by itself."""
    daemon = start(sources(path, hand), **tables)
    packets = image_packets(daemon)
    eventually(lambda: daemon.process.poll() is not None, "the recording is over and taxeld goes on")
    assert daemon.process.returncode == 0, daemon.log
    return daemon, packets


def touched(packets, numbers):
    """Those of the numbers whose images have every taxel and contacts."""
    images = ((n, taxel_reader.decode_packet(packets[n])) for n in numbers)
    return [n for n, image in images if image.missing == 0 and image.contacts > 0]


@pytest.mark.parametrize("mode", ["timer", "sweep"])
@pytest.mark.parametrize("conditioning", ["paper", "robust"])
def test_a_recording_gives_the_same_bytes_twice_and_offline(start, folder, hand, mode, conditioning):
    touches = Touches.uneven(hand, seed=3, dead=[17])
    log = folder / "grasp.log"
    # Four seconds of grasping: a reader sees some of them in both runs, even on a machine that has no time for it.
    frames = [*touches.resting(16, seed=8), *(f for _ in range(8) for f in grasp(touches))]
    write_candump(log, hand, frames, FIRST_SWEEP_S)
    tables = {
        "tick": {"mode": mode},
        "sweep": {"board_period_ms": 33.0, "settle_ms": 0.0},
        "conditioning": DAEMON_SETTINGS if conditioning == "paper" else {"calibration_ms": 300},
        "profile": {"method": "paper" if conditioning == "paper" else "optimal"},
    }
    first_daemon, first = play(start, log, hand, **tables)
    _, second = play(start, log, hand, **tables)
    common = sorted(first.keys() & second.keys())
    assert touched(first, common), f"of {len(first)} and {len(second)} images no touched one was seen in both runs"
    assert [n for n in common if first[n] != second[n]] == []

    offline = offline_packets(log, first_daemon, folder / "images.bin")
    assert len(touched(offline, offline)) >= 40
    assert first.keys() <= offline.keys()
    assert [n for n in sorted(first) if first[n] != offline[n]] == []


def test_live_over_multicast_shows_what_offline_compression_shows(start, lockstep, folder, hand):
    frames = list(grasp(Touches.uneven(hand, seed=4)))
    daemon = start(conditioning=DAEMON_SETTINGS, sweep=SWEEP)
    driver = lockstep(daemon)
    live = [content(driver.step(counts)) for counts in frames]

    log = folder / "live.log"
    write_candump(log, hand, frames, FIRST_SWEEP_S)
    packets = offline_packets(log, daemon, folder / "images.bin")
    images = [taxel_reader.decode_packet(p) for _, p in sorted(packets.items())]
    assert live == [content(i) for i in images if i.missing == 0]


def test_on_a_terminal_replay_shows_how_much_of_the_file_is_played(folder):
    # A tenth of it at once, the rest in an hour.
    times = (1_700_000_000 + 1e-6 * n + max(0, n - 400) for n in range(4000))
    (folder / "slow.log").write_text("".join(f"({t:.6f}) can0 7FF#{n:08X}\n" for n, t in enumerate(times)))
    with Terminal(folder, "replay", "slow.log", "--to", f"udp:{GROUP}:{free_udp_port()}?hops=0") as terminal:
        terminal.wait_for("% of ")
        (bar,) = [line for line in terminal.screen.display if "% of " in line]
        assert 0 < int(bar.split("%")[0].split()[-1]) < 100 and " left" in bar, bar


def test_replay_puts_a_recording_onto_the_bus(start, buses, folder, hand):
    frames = list(grasp(Touches.even(hand)))
    log = folder / "grasp.log"
    write_candump(log, hand, frames, start_s=0.1)
    daemon = start(conditioning=DAEMON_SETTINGS)
    targets = [a for bus, source in zip(hand.buses, buses.sources) for a in ("--interface", f"{bus}={source}")]
    with taxel_reader.connect(daemon.images) as reader:
        replay = subprocess.Popen([binary("taxel"), "replay", log, *targets], stderr=subprocess.PIPE)
        eventually(lambda: next_image(reader).contacts > 20, "the replayed grasp is not seen")
        _, said = replay.communicate()
        assert replay.returncode == 0, said
    sent = len(frames) * len(hand)
    # A player that is held up sends two sweeps at once, and readings of the second are then duplicates.
    status = daemon.wait_status(
        lambda s: sum(b["used"] + b["duplicate"] for b in s["buses"]) == sent, f"{sent} readings were sent"
    )
    assert [b["unknown"] for b in status["buses"]] == [1, 0]


def test_watch_prints_one_json_object_per_image(start, lockstep, hand):
    daemon = start(conditioning=DAEMON_SETTINGS, tick=NEVER_SILENT)
    driver = lockstep(daemon)
    frames = list(grasp(Touches.even(hand)))
    watch = subprocess.Popen(
        [binary("taxel"), "watch", "--socket", daemon.images, "--json"], stdout=subprocess.PIPE, text=True
    )
    try:
        daemon.wait_status(lambda s: len(s["subscribers"]) == 2, "taxel watch does not connect")
        for counts in frames:
            seen = driver.step(counts)
            line = next(o for o in map(json.loads, watch.stdout) if o["missing"] == 0)
            assert line["seq"] == seen.seq and line["t_ns"] == seen.t_ns and line["latency_us"] >= 0
            assert bytes(line["image"]) == seen.pixels and (line["width"], line["height"]) == (16, 16)
            assert line["levels"] == pytest.approx(seen.levels, rel=1e-6)
            got = [(a["id"], a["x"], a["y"], a["level"]) for a in line["actuators"]]
            assert got == [tuple(a[:4]) for a in seen.actuators]
            assert (line["contacts"], line["faulty"], line["joints"]) == (seen.contacts, seen.faulty, [])
    finally:
        watch.kill()
        watch.wait()


def test_a_recording_that_another_program_wrote_anew_with_zstd_gives_the_same_images(tmp_path):
    def taxel(*args):
        return subprocess.run([binary("taxel"), *args], cwd=tmp_path, check=True, capture_output=True, text=True)

    taxel("sim", "tap", "--seconds", "2.5", "--to", "log:tap.log")
    taxel("convert", "tap.log", "tap.mcap")
    with open(tmp_path / "tap.mcap", "rb") as file, open(tmp_path / "zstd.mcap", "wb") as anew:
        writer = Writer(anew)  # zstd, unless it is told otherwise
        writer.start()
        channels = {}
        for schema, channel, message in make_reader(file).iter_messages():
            if channel.id not in channels:
                number = writer.register_schema(schema.name, schema.encoding, schema.data)
                channels[channel.id] = writer.register_channel(channel.topic, channel.message_encoding, number)
            writer.add_message(channels[channel.id], message.log_time, message.data, message.publish_time)
        writer.finish()
    assert b"zstd" in (tmp_path / "zstd.mcap").read_bytes()
    for name in ("tap", "zstd"):
        told = taxel("compress", f"{name}.mcap", "--out", f"{name}.bin")
        assert "left out" not in told.stderr
    assert (tmp_path / "zstd.bin").read_bytes() == (tmp_path / "tap.bin").read_bytes()


@pytest.mark.parametrize("ending", ["blf", "asc", "trc"])
def test_what_python_can_converts_there_and_back_gives_the_same_images(tmp_path, ending):
    def run(*command):
        return subprocess.run(command, cwd=tmp_path, check=True, capture_output=True, text=True)

    # Buses whose boards have other addresses each, so that those of TRC, which counts from 1, are told.
    run(binary("taxel"), "sim", "ball-grasp", "--seconds", "3", "--to", "log:there.log")
    for read, written in ("there.log", f"grasp.{ending}"), (f"grasp.{ending}", "back.log"):
        run(sys.executable, "-m", "can.logconvert", read, written)
    made = []
    for name in "there", "back":
        told = run(binary("taxel"), "compress", f"{name}.log", "--out", f"{name}.bin").stderr
        assert "left out" not in told, told
        assert int(re.search(r"(\d+) with contact", told)[1]) > 0, told
        made.append((tmp_path / f"{name}.bin").read_bytes())
    assert made[0] == made[1]


def test_a_daemon_says_of_a_recording_without_times_that_these_are_made_up(start, folder):
    path = folder / "screen.log"
    path.write_text("  can0  000   [8]  83 80 39 80 06 32 86 01\n" * 10_000)
    daemon = start([f"log:{path}"], layout="uskin-module")
    said = "the recording has no times, and its frames are taken to follow each other on a full bus"
    eventually(lambda: said in daemon.log, lambda: daemon.log)
