"""A pressure array: a program sends its frames to a socket of the daemon's, well and badly."""

import json
import os
import socket
import stat
import struct
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest
import taxel_reader
from harness.daemon import REPOSITORY, Daemon, binary, die_with_parent, eventually
from harness.recorder import longer_each_time

SIZE = (28, 50)
FAST = {"conditioning": {"calibration_ms": 300}}


class Sender:
    """The program of a sensor: `image` is sent twenty times a second until it is closed."""

    def __init__(self, path):
        self.path, self.image = str(path), np.zeros(SIZE, "<u2")
        self.sequence, self.over = 0, threading.Event()
        self.socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self.thread = threading.Thread(target=self.run, daemon=True)
        self.thread.start()

    def run(self):
        while not self.over.wait(0.05):
            try:
                self.socket.sendto(message(self.sequence, self.image), self.path)
            except (FileNotFoundError, ConnectionRefusedError):
                pass
            self.sequence += 1

    def close(self):
        self.over.set()
        self.thread.join()
        self.socket.close()


def message(sequence, image, magic=b"TXPA", version=1, t_ns=0):
    head = struct.pack("<4sBxHHHIQ", magic, version, *image.shape, 0, sequence, t_ns)
    return head + image.astype("<u2").tobytes()


@pytest.fixture
def array(folder):
    with Daemon(folder / "d", [f"pressure:{folder}/touch.sock"], layout="tekscan-6077", **FAST) as daemon:
        daemon.touch = folder / "touch.sock"
        yield daemon


@pytest.fixture
def sender(array):
    sender = Sender(array.touch)
    array.wait_status(lambda s: not s["calibrating"] and not s["problems"], "a good array is not taken")
    yield sender
    sender.close()


def kinds(status):
    return {problem["kind"] for problem in status["problems"]}


def counts(status):
    return status["buses"][0]["array"]


def test_what_presses_an_array_is_felt_and_its_counts_are_in_the_raw_frames(array, sender):
    sender.image[10:14, 20:25] = 200
    status = array.wait_status(lambda s: s["contacts"] == 20, "it is not felt")
    assert (status["missing"], status["faulty"]) == (0, 0)
    array_counts = counts(status)
    assert array_counts["taken"] > 5
    assert {key for key, count in array_counts.items() if count} == {"taken"}, "nothing is lost or refused"
    assert status["buses"][0]["load_percent"] == 0 and status["boards"][0]["state"] == "living"
    reader = taxel_reader.connect(array.images)
    reader.subscribe(image=True, raw=True)
    seen = {}
    while len(seen) < 2:
        received = reader.receive()
        if isinstance(received, (taxel_reader.Image, taxel_reader.Raw)):
            seen[type(received)] = received
    image = seen[taxel_reader.Image]
    assert (image.width, image.height) == (50, 28)
    raw = [taxel.counts[2] for taxel in seen[taxel_reader.Raw].taxels]
    assert raw == sender.image.flatten().tolist()
    sender.image[:] = 0
    array.wait_status(lambda s: s["contacts"] == 0, "it does not let go")


def test_what_is_refused_is_counted_and_told_for_its_reason_and_disturbs_nothing(array, sender):
    other = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
    image = np.zeros(SIZE, "<u2")
    cases = [
        ("size", message(0, np.zeros((50, 28))), "frames of 50 x 28 are refused; the array has 28 x 50"),
        ("torn", message(0, image)[:-2], "too few or too many counts"),
        ("torn", message(0, image) + b"more", "too few or too many counts"),
        ("version", message(0, image, version=2), "of another version"),
        ("foreign", b"GET / HTTP/1.1", "no frame of a pressure array"),
        ("foreign", b"", "no frame of a pressure array"),
    ]
    for reason, bad, words in cases:
        before = counts(array.status())[reason]
        other.sendto(bad, str(array.touch))

        def told(status):
            said = [p["sentence"] for p in status["problems"] if p["kind"] == "array-refused"]
            return counts(status)[reason] == before + 1 and any(words in sentence for sentence in said)

        array.wait_status(told, f"{bad[:20]} is not told")
        array.wait_status(lambda s: not s["problems"], "the problem stays")
    # A flood: images go on, and the array with them.
    end, flooded = time.monotonic() + 2, 0
    made, taken = array.status()["images"]["made"], counts(array.status())["taken"]
    other.setblocking(False)
    while time.monotonic() < end:
        try:
            other.sendto(b"flood", str(array.touch))
            flooded += 1
        except BlockingIOError:
            pass
    other.close()
    assert flooded > 100
    array.wait_status(lambda s: s["images"]["made"] > made + 30, "images stand still")
    # The status before may be of the flood's last moment, when the array had no room yet.
    array.wait_status(
        lambda s: counts(s)["taken"] > taken + 5 and not s["problems"] and s["missing"] == 0, "the array is not taken any more"
    )


def test_an_array_that_falls_silent_is_told_and_goes_on_when_it_returns(array, sender):
    sender.close()
    status = array.wait_status(lambda s: kinds(s) == {"board-silent"}, "silence is not told")
    (problem,) = status["problems"]
    assert "no more frames come" in problem["sentence"] and f"pressure:{array.touch}" in problem["sentence"]
    assert array.wait_status(lambda s: s["missing"] == 1400, "its last values stand for ever")
    again = Sender(array.touch)
    array.wait_status(lambda s: not s["problems"] and s["missing"] == 0, "it is not taken when it returns")
    assert counts(array.status())["restarts"] == 1
    # Gaps, and two programs at once.
    again.sequence += 5
    array.wait_status(lambda s: counts(s)["lost"] == 5, "a gap is not counted")
    third = Sender(array.touch)
    array.wait_status(lambda s: "array-senders" in kinds(s), "two senders are not told")
    third.close()
    array.wait_status(lambda s: not s["problems"], "one sender is left")
    again.close()


def test_late_frames_are_told(array, sender):
    sender.close()
    late = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)

    def told():
        late.sendto(message(0, sender.image, t_ns=time.monotonic_ns() - 10**9), str(array.touch))
        return "array-late" in kinds(array.status())

    eventually(told, "frames that come late are not told")
    late.close()


def test_the_socket_is_the_daemon_s_alone_and_a_killed_one_s_is_taken_over(array, sender):
    mode = array.touch.stat().st_mode
    assert stat.S_ISSOCK(mode) and stat.S_IMODE(mode) == 0o600
    second = Daemon(array.folder.parent / "second", [f"pressure:{array.touch}"], layout="tekscan-6077").spawn()
    assert second.process.wait() != 0 and "touch.sock" in second.log, "it takes another daemon's socket"
    array.kill()
    array.start()
    array.wait_status(lambda s: counts(s)["taken"] > 5 and s["missing"] == 0, "it is not taken after a restart")
    assert array.stop() == 0 and not array.touch.exists()


def test_a_socket_that_somebody_removes_or_replaces_is_made_again_and_felt_by_without_a_restart(array, sender):
    def is_felt(pressed):
        sender.image[:] = 0
        sender.image[10:14, 20 : 20 + pressed] = 200
        array.wait_status(lambda s: s["contacts"] == 4 * pressed, "it is not felt")

    mode = stat.S_IMODE(array.touch.stat().st_mode)
    is_felt(5)
    array.touch.unlink()
    is_felt(6)
    assert f"removed or replaced {array.touch}" in array.log
    assert stat.S_IMODE(array.touch.stat().st_mode) == mode

    # What another program has put there stays its own, which is said.
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as other:
        aside = array.touch.with_name("aside.sock")
        other.bind(str(aside))
        aside.rename(array.touch)
        status = array.wait_status(lambda s: "sockets-lost" in kinds(s), "it is not told")
        said = [p["sentence"] for p in status["problems"] if p["kind"] == "sockets-lost"]
        assert str(array.touch) in said[0], said
    is_felt(7)
    array.wait_status(lambda s: "sockets-lost" not in kinds(s), "it is told for ever")


def test_the_example_says_how_it_is_run():
    example = REPOSITORY / "examples" / "pressure_array.py"
    ended = subprocess.run([sys.executable, example], capture_output=True, text=True)
    assert ended.returncode == 1 and "usage:" in ended.stderr and "Traceback" not in ended.stderr, ended.stderr


def test_the_example_sends_frames(array):
    program = subprocess.Popen(
        [sys.executable, REPOSITORY / "examples" / "pressure_array.py", array.touch], preexec_fn=die_with_parent
    )
    array.wait_status(lambda s: s["contacts"] > 5, "its bump is not felt")
    program.kill()
    program.wait()


def test_a_recording_of_an_array_that_is_silent_says_so(array, folder):
    array.wait_status(lambda s: any(problem["severe"] for problem in s["problems"]), "the array is not missed")
    sentence = array.status()["problems"][0]["sentence"]
    # It is told what is wrong once a second.
    for seconds in longer_each_time():
        command = [binary("taxel"), "record", folder / f"{seconds}.mcap", "--socket", array.images, "--seconds", str(seconds), "--json"]
        recorded = subprocess.run(command, capture_output=True, text=True)
        if f"taxel: at the end: {sentence}\n" in recorded.stderr:
            break
    assert recorded.returncode == 0, recorded.stderr
    assert len(json.loads(recorded.stdout)["lacking"]) == 1


def test_a_recording_is_replayed_to_an_array(array):
    """T x 28 x 50: untouched for two seconds, then what presses stays."""
    images = np.zeros((100, *SIZE), "<u2")
    images[20:, 10:14, 20:25] = 200
    np.savez(array.folder / "touch.npz", touch=images)
    to = ["--to", f"pressure:{array.touch}"]
    command = [binary("taxel"), "replay", array.folder / "touch.npz", "--rate", "10", *to]
    program = subprocess.Popen(command, preexec_fn=die_with_parent, stderr=subprocess.PIPE, text=True)
    status = array.wait_status(lambda s: s["contacts"] == 20 and s["missing"] == 0, "the recorded touch is not felt")
    array_counts = counts(status)
    assert {key for key, count in array_counts.items() if count} == {"taken"}, "nothing is lost or refused"
    assert program.wait() == 0, program.stderr.read()
    array.wait_status(lambda s: counts(s)["taken"] == 100, "a frame is lost")
    np.save(array.folder / "turned.npy", images.swapaxes(1, 2))
    turned = [binary("taxel"), "replay", array.folder / "turned.npy", *to]
    refused = subprocess.run(turned, capture_output=True, text=True)
    assert refused.returncode == 1 and "frames of 50 x 28 taxels" in refused.stderr, refused.stderr


def test_an_array_stands_beside_boards(folder):
    """On a bus of its own; an array alone, boards alone, and both are felt."""
    layout = folder / "both.toml"
    layout.write_text(
        'name = "both"\nimage = { width = 20, height = 4 }\nbuses = ["can0", "mat"]\n'
        '[[module]]\nname = "tip"\npart = "finger"\nbus = "can0"\nboard = 1\nprotocol = "uskin-l2"\nat = [0, 0]\n'
        '[[module]]\nname = "mat"\npart = "mat"\nbus = "mat"\nprotocol = "pressure-array"\nrows = 4\ncolumns = 16\nat = [4, 0]\n'
    )
    sources = ["sim:idle", f"pressure:{folder}/mat.sock"]
    # The array may speak first, and what is quiet in it is not what is quiet in magnetic taxels.
    own = {"conditioning": {"calibration_ms": 300, "threshold_per_taxel": True}}
    with Daemon(folder / "d", sources, layout=layout, **own) as daemon:
        sender = Sender(folder / "mat.sock")
        sender.image = np.zeros((4, 16), "<u2")
        daemon.wait_status(lambda s: not s["calibrating"] and not s["problems"], "they are not whole")
        sender.image[1, 3] = 5000
        status = daemon.wait_status(lambda s: s["contacts"] == 1, "the array is not felt")
        assert [board["state"] for board in status["boards"]] == ["living", "living"]
        sender.close()
        daemon.wait_status(lambda s: s["missing"] == 64 and kinds(s) == {"board-silent"}, "boards fall silent with it")


def doctor(*arguments, **more):
    command = [binary("taxel"), "doctor", "--json", "--seconds", "2", *map(str, arguments)]
    run = subprocess.run(command, capture_output=True, text=True, env={**os.environ, **more})
    return json.loads(run.stdout)["checks"]


def test_the_doctor_says_whether_the_array_speaks(folder):
    daemon = Daemon(folder / "d", [f"pressure:{folder}/touch.sock"], layout="tekscan-6077")
    checks = doctor("--config", daemon.config)
    silent = [c for c in checks if "no frame has come" in c["found"]]
    assert [c["state"] for c in silent] == ["error"], "nobody sends"
    # No board is to be recognised on its socket, and no bit rate is wrong.
    traffic = [c for c in checks if c["name"] == "traffic"]
    assert "--scan" not in json.dumps(checks) and "bit rate" not in json.dumps(traffic), checks
    sender = Sender(folder / "touch.sock")
    wrong = lambda: [c for c in doctor("--config", daemon.config) if c["area"] == "hand" and c["state"] == "error"]  # noqa: E731
    eventually(lambda: not wrong(), wrong)
    sender.close()
    assert not (folder / "touch.sock").exists()


@pytest.mark.skipif(Path("/etc/taxeld/taxeld.toml").exists(), reason="a service has its configuration here")
def test_the_doctor_looks_at_what_a_running_daemon_reads_where_nothing_is_named(array, sender):
    checks = doctor(RUNTIME_DIRECTORY=str(array.control_path.parent))
    assert not [c for c in checks if c["area"] == "link" or "CAN" in c["name"] and c["state"] == "error"], "nobody has named a CAN interface"
    assert [c for c in checks if c["area"] == "daemon" and "tekscan-6077" in c["found"]], checks
