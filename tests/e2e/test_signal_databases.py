"""Frames of the boards described as a signal database (DBC), and made and read by cantools, which knows nothing of us:
what it puts into frames is what the daemon reads, and what it reads in frames is what the simulated boards sent."""

import subprocess

import can
import cantools
import pytest
import taxel_reader
from harness.bus import MulticastBuses
from harness.daemon import HANGS_AFTER_S, binary
from harness.hand import LAYOUTS

# Bits are numbered as DBC has it: byte * 8 + bit, big-endian values (@0) by their most significant one.
USKIN = {"status": "7|8@0+", "x": "15|16@0+", "y": "31|16@0+", "z": "47|16@0+", "line": "63|8@0+"}
FINGER = {"a": "0|16@1+", "b": "16|16@1+", "c": "32|16@1+", "d": "48|16@1+"}
ANGLES = {"j0": "0|16@1-", "j1": "16|16@1-", "j2": "32|16@1-", "j3": "48|16@1-"}


def database(messages):
    """A database of messages of eight bytes: {id: {signal: place}}, values as they are."""
    text = 'VERSION ""\nBU_: board\n'
    for id, signals in messages.items():
        text += f"BO_ {id} m{id:03X}: 8 board\n"
        text += "".join(f' SG_ {name} : {place} (1,0) [0|0] "" board\n' for name, place in signals.items())
    return cantools.database.load_string(text, "dbc")


def order_of_a_4x6_module():
    rows = [[4 * sda + chip for chip in range(4)] + [16 + 2 * sda, 17 + 2 * sda] for sda in range(4)]
    return f"order = {rows}"


def uskin(id_of, k_max):
    """Messages of a board, the signals of the taxel of each number k, and its values at a count n."""
    taxels = [(id_of(k), ("x", "y", "z")) for k in range(k_max)]
    return {id: USKIN for id, _ in taxels}, taxels


def hands():
    l1 = uskin(lambda k: 0x710 + k, 16)
    xela_text = 'name = "tip"\nimage = { width = 6, height = 4 }\nbuses = ["can0"]\n[[module]]\nname = "tip"\npart = "tip"\n'
    xela_text += f'bus = "can0"\nboard = 1\nprotocol = "uskin-l2"\nat = [0, 0]\n{order_of_a_4x6_module()}\n'
    xela = uskin(lambda k: 0x100 | (k >> 2) << 4 | k & 3 if k < 16 else 0x104 | (k - 16 >> 1) << 4 | k & 1, 24)
    # The finger's channels, in the order in which its frames carry them (docs/protocols.md, "CPM finger").
    channels = [11, 15, 14, 12, 9, 13, 8, 10, 6, 7, 4, 5, 2, 0, 3, 1]
    places = {channel: (0x405 + 2 * (i // 4), ("abcd"[i % 4],)) for i, channel in enumerate(channels)}
    finger = {id: FINGER for id in (0x405, 0x407, 0x409, 0x40B)}, [places[k] for k in range(16)]
    return {
        "uskin-module": ((LAYOUTS / "uskin-module.toml").read_text(), *l1),
        "xela 4x6": (xela_text, *xela),
        "cpm-finger": ((LAYOUTS / "cpm-finger.toml").read_text(), *finger),
    }


def count(n, axis):
    return 5_000 + 301 * n + 7 * axis


@pytest.mark.parametrize("hand", hands())
def test_what_another_encoder_puts_into_frames_is_what_the_daemon_reads(start, folder, hand):
    text, messages, taxels = hands()[hand]
    path, db = folder / "hand.toml", database(messages)
    path.write_text(text)
    values = {id: {signal: 0 for signal in signals} for id, signals in messages.items()}
    for n, (id, signals) in enumerate(taxels):
        for axis, signal in enumerate(signals):
            values[id][signal] = count(n, axis)
        if "status" in values[id]:
            values[id]["status"] = 0x83
    frames = [(0, can.Message(arbitration_id=id, is_extended_id=False, data=db.encode_message(id, v))) for id, v in values.items()]
    with MulticastBuses(1) as buses:
        daemon = start(
            sources=buses.sources,
            layout=path,
            tick={"mode": "timer", "rate_hz": 20.0},
            boards={"mode": "passive"},
            sweep={"stale_after_ms": 60_000.0},
        )
        with taxel_reader.connect(daemon.images, raw=True) as reader:
            raw = None
            while raw is None or any(taxel.freshness != 2 for taxel in raw.taxels):
                buses.send(frames)
                message = reader.receive(HANGS_AFTER_S)
                assert message is not None, "the daemon sends nothing more"
                raw = message if isinstance(message, taxel_reader.Raw) else raw
    for n, (taxel, (_, signals)) in enumerate(zip(raw.taxels, taxels, strict=True)):
        expected = tuple(count(n, axis) for axis in range(len(signals)))
        assert taxel.counts == (expected if len(expected) == 3 else (0, 0, *expected)), f"taxel {n}"


@pytest.mark.parametrize("hand", hands())
def test_what_the_simulated_boards_send_is_in_the_database_and_read_alike_by_two_log_readers(folder, hand):
    text, messages, taxels = hands()[hand]
    path, log, db = folder / "hand.toml", folder / "hand.log", database(messages)
    path.write_text(text)
    simulate = [binary("taxel"), "sim", "idle", "--layout", path, "--seconds", "1", "--autostart", "--to", f"log:{log}"]
    subprocess.run(simulate, check=True, capture_output=True)
    lines = list(can.CanutilsLogReader(log))
    with log.open() as file:
        others = list(cantools.logreader.Parser(file))
    assert [(m.arbitration_id, bytes(m.data)) for m in lines] == [(o.frame_id, o.data) for o in others]
    heard = {}
    for frame in lines:
        if frame.arbitration_id in messages:
            decoded = db.decode_message(frame.arbitration_id, frame.data)
            heard.setdefault(frame.arbitration_id, []).append(decoded)
            if "line" in decoded:
                assert decoded["status"] == 0xFF or decoded["line"] == (frame.arbitration_id >> 4 & 3 if "4x6" in hand else frame.arbitration_id >> 2 & 3) + 1
    assert heard.keys() == messages.keys(), "every message of the database, and none but these"
    for id, signals in taxels:
        z = [frame[signals[-1]] for frame in heard[id][len(heard[id]) // 2 :]]
        assert max(z) - min(z) < 400 and min(z) > 3_000, f"{id:03X}: {signals[-1]} at rest is {min(z)} to {max(z)}"
