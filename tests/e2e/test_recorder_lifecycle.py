"""`taxel record` from its start to its end: what it refuses, and what restarts of the daemon, disks and triggers make of it."""

import json
import os
import re
import signal
import subprocess
from contextlib import suppress

import pytest
import taxel_reader
from conditioning import DAEMON_SETTINGS
from harness.bus import GROUP, free_udp_port
from harness.daemon import HANGS_AFTER_S, binary, eventually
from harness.lockstep import SWEEP
from harness.recorder import can_frames, is_whole, longer_each_time, marks, messages, of_topic, recording, taxel, with_room
from harness.touches import Touches, grasp
from mcap.reader import make_reader


# Bytes of a disk that is soon full: some seconds.
LIMIT = 400_000


@pytest.fixture
def record(folder):
    """`taxel record` for half a second, or longer until it has what is said of it: how it ends, and what it says."""

    def record(name, *arguments, until=lambda ended: True):
        for seconds in longer_each_time():
            command = [binary("taxel"), "record", f"{name}.mcap", "--seconds", str(seconds), *map(str, arguments)]
            ended = subprocess.run(command, cwd=folder, capture_output=True, text=True)
            if until(ended):
                return ended

    return record


def has_come(ended):
    """Whether a recording had time enough for something to come of its daemon."""
    return "nothing came of a daemon" not in ended.stderr


def test_a_configuration_that_the_daemon_does_not_run_with_is_refused_and_silent_buses_are_named(start, folder, record):
    daemon = start()
    text = daemon.config.read_text()
    scenes = re.sub(r'source = "udp:[^"]*"', 'source = "sim:tap"', text)
    module = 'layout = "uskin-module"\n[[bus]]\nsource = "can:vcan7"\n'
    for name, other, reads in [
        ("scenes", scenes, "reads can0 from udp:"),
        ("module", module, "reads layout allegro-uskin-15"),
    ]:
        (folder / f"{name}.toml").write_text(other)
        refused = record(name, "--config", f"{name}.toml", "--socket", daemon.images)
        assert refused.returncode == 1 and not (folder / f"{name}.mcap").exists(), refused.stderr
        assert f"{name}.toml is not the configuration of the daemon that runs" in refused.stderr, refused.stderr
        assert reads in refused.stderr, refused.stderr
    # Without a daemon to ask, the file is what is spoken of.
    waiting = record("waiting", "--config", "scenes.toml", "--socket", folder / "nobody.sock")
    assert "no raw CAN: scenes.toml reads neither can: nor udp:" in waiting.stderr, waiting.stderr
    assert "no file was made" in waiting.stderr and not (folder / "waiting.mcap").exists(), waiting.stderr
    assert waiting.returncode == 1 and "nothing came of a daemon at" in waiting.stderr, waiting.stderr
    wrong = f"udp:{GROUP}:{free_udp_port()}"
    silent = record("silent", "--socket", daemon.images, "--can", f"left={wrong}?hops=0", "--json")
    assert f"no CAN frame came of left from {wrong}" in silent.stderr, silent.stderr
    assert json.loads(silent.stdout)["silent"] == ["left"]


def test_a_hand_is_compared_where_the_daemon_answers_by_another_name_and_one_of_no_layout_here_is_told(start, folder, record):
    layout = subprocess.run([binary("taxel"), "layouts", "uskin-module", "--file"], capture_output=True, text=True)
    own = folder / "own.toml"
    own.write_text(layout.stdout.replace('"uskin-module"', '"my-module"'))
    sources = [f"udp:{GROUP}:{free_udp_port()}?hops=0"]
    daemon = start(sources, layout=str(own), socket={"status": str(folder / "tells.sock")})
    (folder / "other.toml").write_text('layout = "uskin-module"\n[[bus]]\nsource = "can:vcan7"\n')
    refused = record("other", "--config", "other.toml", "--socket", daemon.images)
    assert refused.returncode == 1 and "reads layout my-module" in refused.stderr, refused.stderr
    elsewhere = record("elsewhere", "--socket", daemon.images)
    assert elsewhere.returncode == 1 and "--control PATH names the socket that answers" in elsewhere.stderr
    bare = record("bare", "--control", folder / "tells.sock", "--socket", daemon.images, until=has_come)
    assert bare.returncode == 0, bare.stderr
    assert "hand my-module is not built in, and its layout will not be in the recording" in bare.stderr, bare.stderr
    # The file's socket, in the file's words and in others.
    for name, socket in [("whole", daemon.images), ("again", os.path.relpath(daemon.images, folder))]:
        whole = record(name, "--config", daemon.config, "--socket", socket, until=has_come)
        assert whole.returncode == 0 and not re.search("not built in|not known", whole.stderr), whole.stderr


def test_a_bus_without_a_name_is_called_as_the_daemon_or_the_configuration_calls_it(start, folder, record):
    sources = [f"udp:{GROUP}:{free_udp_port()}" for _ in range(2)]
    daemon = start([f"{source}?hops=0" for source in sources])
    for name, *more in [("daemon", "--socket", daemon.images), ("file", "--config", daemon.config)]:
        silent = record(name, "--can", sources[1], "--json", *more)
        assert json.loads(silent.stdout)["silent"] == ["can1"] and "is called" not in silent.stderr, silent.stderr
    other = record("other", "--socket", daemon.images, "--can", f"udp:{GROUP}:{free_udp_port()}?hops=0", "--json")
    assert json.loads(other.stdout)["silent"] == ["can2"] and "is called can2" in other.stderr, other.stderr


def test_a_recording_of_which_nothing_came_that_was_asked_for_fails_and_says_why(start, record):
    daemon = start(socket={"max_subscribers": 1})
    silent = f"udp:{GROUP}:{free_udp_port()}?hops=0"
    with taxel_reader.connect(daemon.images) as reader:
        assert reader.receive(HANGS_AFTER_S) is not None
        why = "1 subscribers are connected already"
        full = record("full", "--socket", daemon.images, "--no-can", until=lambda ended: why in ended.stderr)
    assert full.returncode == 1, full.stderr
    assert "nothing came of a daemon at" in full.stderr and "Broken pipe" not in full.stderr, full.stderr
    bus = record("bus", "--no-daemon", "--can", silent)
    assert bus.returncode == 1 and "no CAN frame came" in bus.stderr, bus.stderr


@pytest.mark.parametrize("stop", [signal.SIGTERM, signal.SIGINT])
def test_a_recording_that_is_stopped_before_anything_came_has_lost_nothing(folder, stop):
    command = [binary("taxel"), "record", "no.mcap", "--socket", "nobody.sock", "--no-can"]
    recorder = subprocess.Popen(command, cwd=folder, stderr=subprocess.PIPE, text=True)
    assert "waiting for it" in recorder.stderr.readline()
    recorder.send_signal(stop)
    _, told = recorder.communicate()
    assert recorder.returncode == 0 and "no file was made" in told, told
    assert not (folder / "no.mcap").exists()


def test_every_loss_of_the_daemon_is_told(start, folder):
    daemon = start()
    with recording(daemon, folder / "a.mcap") as recorder:
        for times in 1, 2:
            daemon.stop()
            told = lambda times=times: recorder.said.count("waiting for it") == times
            eventually(told, lambda: f"a loss is not told: {recorder.said}")
            daemon.start()
            recorder.is_subscribed()
        assert recorder.end() == 0, recorder.said


def test_another_configuration_of_the_next_daemon_is_in_another_file_and_one_that_is_not_its_own_in_none(start, folder):
    ports = [free_udp_port() for _ in range(2)]
    daemon = start([f"udp:{GROUP}:{ports[0]}?hops=0"], layout="uskin-module")
    text, out, file = daemon.config.read_text(), folder / "day.mcap", daemon.config

    def described(path, times=1):
        found = lambda: len(of_topic(path, "/taxel/hello")) >= times
        eventually(found, lambda: f"no hand is described in {path.name}: {recorder.said}")

    def again(text, config=file):
        assert daemon.stop() == 0
        config.write_text(text)
        daemon.config = config
        daemon.start()

    def attached(path):
        with path.open("rb") as file:
            return [one.data.decode() for one in make_reader(file).iter_attachments()]

    changed = text.replace(str(ports[0]), str(ports[1])).replace("[profile]", "[profile]\nlevels = 3")
    assert "levels = 3" in changed, text
    second, third = (folder / f"day-000{number}.mcap" for number in (1, 2))
    with recording(daemon, out) as recorder:
        described(out)
        again(changed)
        described(second)
        # The same again is recorded on in the same file.
        times = len(of_topic(second, "/taxel/hello"))
        again(changed)
        described(second, times + 1)
        again(changed.replace("uskin-module", "uskin-fingertip"), folder / "other.toml")
        described(third)
        assert recorder.end() == 0, recorder.said
    assert [attached(path) for path in (out, second, third)] == [[text], [changed], []]
    assert sorted(folder.glob("*.mcap")) == sorted([out, second, third])
    read = lambda path: subprocess.run([binary("taxel"), "convert", path, folder / "frames.npz"], capture_output=True, text=True).stderr
    assert f"{out}: read alone; a recorder goes on in {second} to {third} where" in read(out)
    assert "read alone" not in read(third)
    said = recorder.said
    assert said.count("the daemon runs with another configuration") == 2, said
    assert f"{file} is not the configuration of the daemon that runs" in said, said
    assert "From here on it is recorded without it" in said and said.count("reads layout uskin-fingertip") == 1, said
    for port in ports:
        assert f"no CAN frame came of can0 from udp:{GROUP}:{port}" in said, said


def test_a_full_disk_stops_the_recording_says_so_and_costs_no_image(start, lockstep, folder, hand, capfd):
    daemon = start(conditioning=DAEMON_SETTINGS, sweep=SWEEP)
    out = folder / "full.mcap"
    with recording(daemon, out, "--json", limit=LIMIT, as_service=True) as recorder:
        driver = lockstep(daemon)
        frames = list(grasp(Touches.even(hand)))
        images = 0
        while recorder.process.poll() is None:
            driver.step(frames[images % len(frames)])
            images += 1
            assert images < 2000, "the recorder does not notice that the disk is full"
        assert recorder.process.returncode == 1
        # As an error in the journal, in one line.
        assert re.search("^<3>taxel: .*full.mcap: File too large.*the recording stopped there", recorder.said, re.M), recorder.said
        driver.step(frames[0])
    made = json.loads(capfd.readouterr().out)
    assert made["files"] == [str(out)] and made["images"] > 0 and made["can_frames"] > 0, made
    assert out.stat().st_size <= LIMIT
    assert "torn off" in taxel("convert", out, folder / "full.log")
    assert (folder / "full.log").stat().st_size > 0


def test_a_disk_without_room_for_a_first_chunk_is_left_without_files_however_often_it_is_tried(start, folder):
    daemon = start()
    out = folder / "full.mcap"
    for _ in range(2):
        command = [binary("taxel"), "record", out, "--no-can", "--socket", daemon.images, "--split-size", "1MB", "--json"]
        options = {"capture_output": True, "text": True}
        failed = subprocess.run(command, **with_room(100), **options)
        assert failed.returncode == 1 and "full-0001.mcap: File too large" in failed.stderr, failed.stderr
        assert list(folder.glob("*.mcap")) == [] and json.loads(failed.stdout)["files"] == []


def test_a_file_that_is_renamed_while_it_is_recorded_into_is_told_and_the_recording_goes_on_in_another(start, folder):
    daemon = start()
    out, old = folder / "a.mcap", folder / "a.mcap.1"
    with recording(daemon, out, as_service=True) as recorder:
        eventually(lambda: len(of_topic(out, "/taxel/hello")) > 0, "nothing comes into the file")
        out.rename(old)
        another = folder / "a-0001.mcap"
        eventually(lambda: messages(another), lambda: f"no other file is written: {recorder.said}")
        assert recorder.end() == 1, recorder.said
    gone = "^<4>taxel: .*a.mcap was removed or renamed while it was recorded into.*the recording goes on in another file"
    assert re.search(gone, recorder.said, re.M), recorder.said
    assert re.search("^<3>taxel: .*not whole in its files", recorder.said, re.M), recorder.said
    for whole in old, another:
        with whole.open("rb") as file:
            counted = make_reader(file).get_summary().statistics
        assert counted.message_count > 0


def test_what_a_daemon_is_told_while_it_runs_leaves_the_recording_with_the_configuration_it_runs_with(start, folder):
    daemon = start()
    text, out = daemon.config.read_text(), folder / "day.mcap"

    def described(levels=None):
        hellos = [json.loads(one.data) for _, _, one in of_topic(out, "/taxel/hello")]
        return any(levels in (None, hello["profile"]["levels"]) for hello in hellos)

    with recording(daemon, out) as recorder:
        eventually(described, "no hand is described")
        # Of this, a reload takes up the profile alone.
        masked = text.replace("[conditioning]", "[conditioning]\nmasked_taxels = [1, 2]")
        assert masked != text
        daemon.config.write_text(masked.replace("[profile]", "[profile]\nlevels = 3"))
        daemon.process.send_signal(signal.SIGHUP)
        eventually(lambda: described(3), lambda: f"it goes on elsewhere: {recorder.said}")
        # As an editor leaves it in the middle.
        daemon.config.write_text("[profile]\nlevels")
        assert daemon.control("profile", profile={"levels": 4})["ok"]
        eventually(lambda: described(4), lambda: f"it goes on elsewhere: {recorder.said}")
        assert recorder.end() == 0, recorder.said
    assert list(folder.glob("*.mcap")) == [out] and "configuration" not in recorder.said, recorder.said
    with out.open("rb") as file:
        assert [one.data.decode() for one in make_reader(file).iter_attachments()] == [text]


def test_a_recording_goes_on_though_nobody_reads_what_it_says(start, folder):
    daemon = start()
    reader, full = os.pipe()
    os.set_blocking(full, False)
    with suppress(BlockingIOError):
        while True:
            os.write(full, bytes(4096))
    os.set_blocking(full, True)
    with recording(daemon, folder / "slip.mcap", "--keep", "60", "--after", "0.2", stderr=full) as recorder:
        for file in folder / "slip-0001.mcap", folder / "slip-0002.mcap":
            daemon.control("mark", text="slipped")
            # It is when its window is over.
            eventually(lambda file=file: is_whole(file), f"{file.name} does not become whole")
        assert recorder.end() == 0
    os.close(full)
    os.close(reader)


@pytest.mark.parametrize("trigger", ["mark", "signal"])
def test_a_trigger_keeps_what_was_before_it_and_nothing_is_written_until_then(start, lockstep, folder, hand, trigger):
    daemon = start(conditioning=DAEMON_SETTINGS, sweep=SWEEP)
    out = folder / "slip.mcap"
    # However slow the machine is, all of it comes before the window is over, and none is too old.
    with recording(daemon, out, "--keep", "3600", "--after", "3600", "--trigger", trigger) as recorder:
        driver = lockstep(daemon)
        for counts in list(grasp(Touches.even(hand)))[:8]:
            driver.step(counts)
        sent = driver.sweeps * len(hand)
        assert list(folder.glob("*.mcap")) == []
        if trigger == "mark":
            daemon.control("mark", text="slipped")
        else:
            recorder.process.send_signal(signal.SIGUSR1)
        first = folder / "slip-0001.mcap"
        eventually(lambda: can_frames(first) == sent, lambda: f"{can_frames(first)} of {sent} frames are kept: {recorder.said}")
        eventually(lambda: len(marks(first)) == (trigger == "mark"), "the mark is not in the file")
        assert recorder.end() == 0, recorder.said
    by_topic = messages(first)
    assert can_frames(first) == sent
    assert [text for _, text in marks(first)] == (["slipped"] if trigger == "mark" else [])
    assert by_topic["/taxel/hello"]
