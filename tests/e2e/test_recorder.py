"""`taxel record` beside a live daemon: what is in the file, who can read it, and what crashes and full disks leave of it."""

import json
import os
import re
import resource
import signal
import subprocess
from contextlib import contextmanager, suppress

import numpy as np
import pytest
import taxel_reader
from conditioning import DAEMON_SETTINGS
from harness.bus import GROUP, free_udp_port
from harness.compare import content
from harness.daemon import Daemon, binary, die_with_parent, eventually
from harness.lockstep import SWEEP
from harness.servos import Servos
from harness.touches import Touches, grasp
from mcap.exceptions import McapError
from mcap.reader import NonSeekingReader, make_reader
from mcap_ros2.decoder import DecoderFactory
from rosbags.highlevel import AnyReader


# Bytes of a disk that is soon full: some seconds.
LIMIT = 400_000
# Those of a hand without joints.
TYPES = {
    "/taxel/can": "taxel_msgs/msg/CanFrames",
    "/taxel/frames": "taxel_msgs/msg/TactileFrame",
    "/taxel/images": "taxel_msgs/msg/TactileImage",
    "/tactile_image": "sensor_msgs/msg/Image",
    "/diagnostics": "diagnostic_msgs/msg/DiagnosticArray",
    "/rosout": "rcl_interfaces/msg/Log",
    "/taxel/hello": "std_msgs/msg/String",
    "/taxel/status": "std_msgs/msg/String",
    "/taxel/clock": "taxel_msgs/msg/Clocks",
}


class Recorder:
    """`taxel record` of a daemon; what it says is in `said`."""

    def __init__(self, daemon, out, *arguments, limit=None, stderr=None):
        self.daemon, self.out = daemon, out
        self.log = out.with_suffix(".said")

        def limited():
            die_with_parent()
            if limit:
                resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))

        with self.log.open("wb") as log:
            self.process = subprocess.Popen(
                [binary("taxel"), "record", out, "--config", daemon.config, *arguments],
                stderr=log if stderr is None else stderr,
                preexec_fn=limited,
                restore_signals=False,  # the limit is told by an error instead of a signal
            )
        self.is_subscribed()

    def is_subscribed(self):
        """Waits until it is.

        It opens its buses before it subscribes, and has every message from when its wish is known, not from when it came.
        """
        self.daemon.wait_status(
            lambda s: any(other["pid"] == self.process.pid and other["every"] for other in s["subscribers"]),
            "taxel record does not subscribe",
        )

    @property
    def said(self):
        return self.log.read_text()

    def end(self, by=signal.SIGINT):
        self.process.send_signal(by)
        return self.process.wait(20)


@contextmanager
def recording(daemon, out, *arguments, **options):
    recorder = Recorder(daemon, out, *arguments, **options)
    try:
        yield recorder
    finally:
        recorder.process.kill()
        recorder.process.wait()


def taxel(*arguments):
    """Runs a command; what it says on stderr."""
    done = subprocess.run([binary("taxel"), *arguments], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return done.stderr


def messages(path):
    """Every message by topic, decoded by mcap-ros2-support; also of a file without its end, and of one that is not made yet."""
    decoder, by_topic = DecoderFactory(), {}
    with suppress(McapError, FileNotFoundError), path.open("rb") as file:
        read = NonSeekingReader(file, decoder_factories=[decoder]).iter_decoded_messages(log_time_order=False)
        for schema, channel, message, decoded in read:
            by_topic.setdefault(channel.topic, []).append((schema.name, message.log_time, decoded))
    return by_topic


def marks(path):
    """Time and text of the marks in a recording."""
    return [(at_ns, log.msg) for _, at_ns, log in messages(path).get("/rosout", []) if log.name == "mark"]


def full_images(path):
    """What images with every taxel show, calibration over, in a file of IMAGE messages."""
    data, images = path.read_bytes(), []
    while data:
        image, length = taxel_reader.decode(data)
        data = data[length:]
        if image.missing == 0 and not image.header.flags & taxel_reader.FLAG_CALIBRATING:
            images.append(content(image))
    return images


def test_a_recording_holds_what_was_sent_and_shown_and_gives_the_same_images(start, lockstep, folder, hand):
    frames = list(grasp(Touches.uneven(hand, seed=4)))
    daemon = start(conditioning=DAEMON_SETTINGS, sweep=SWEEP)
    out = folder / "grasp.mcap"
    with recording(daemon, out) as recorder:
        driver = lockstep(daemon)
        live = [driver.step(counts) for counts in frames]
        marked = daemon.control("mark", text="the grasp is over")["mark"]
        eventually(lambda: marks(out), lambda: f"the mark does not come into the file: {recorder.said}")
        assert recorder.end() == 0, recorder.said
        assert "lost" not in recorder.said and "passed over" not in recorder.said, recorder.said

    by_topic = messages(out)
    types = {topic: found[0][0] for topic, found in by_topic.items()}
    once_a_second = {"/taxel/status", "/diagnostics"}
    assert types.items() <= TYPES.items() and types.keys() | once_a_second == TYPES.keys()
    blocks = [m for _, _, m in by_topic["/taxel/can"]]
    assert sum(len(b.id) for b in blocks) == driver.sweeps * len(hand)
    assert blocks[-1].buses == hand.buses and list(blocks[-1].lost) == [0] * len(hand.buses)
    [(at_ns, text)] = marks(out)
    assert text == "the grasp is over"
    clock = by_topic["/taxel/clock"][0][2]
    offset_ns = clock.realtime_ns - clock.monotonic_ns
    assert abs(at_ns - marked["t_ns"] - offset_ns) < 1_000_000_000
    assert json.loads(by_topic["/taxel/hello"][-1][2].data)["layout"] == "allegro-uskin-15"

    recorded = {m.seq: m for _, _, m in by_topic["/taxel/images"]}
    for image in live:
        same = recorded[image.seq]
        assert bytes(same.pixels) == image.pixels and list(same.levels) == list(image.levels)
        got = list(zip(same.actuator_id, same.actuator_x, same.actuator_y, same.actuator_level))
        assert got == [tuple(a[:4]) for a in image.actuators]
    raw = {m.seq: m for _, _, m in by_topic["/taxel/frames"]}
    last = np.array(raw[live[-1].seq].counts).reshape(-1, 3)
    assert (last == np.asarray(frames[-1])).all()
    pictures = [bytes(m.data) for _, _, m in by_topic["/tactile_image"]]
    assert live[-1].pixels in pictures

    # The configuration is in the file, so the command needs none, and begins where the recording did.
    taxel("compress", out, "--out", folder / "images.bin")
    calibrated = [content(i) for i in live if not i.header.flags & taxel_reader.FLAG_CALIBRATING]
    assert len(calibrated) >= 10
    again = full_images(folder / "images.bin")
    assert [i for i in again if i in calibrated] == again and again[-len(calibrated) :] == calibrated

    taxel("convert", out, folder / "grasp.npz")
    with np.load(folder / "grasp.npz") as arrays:
        assert arrays["counts"].shape[1:] == (len(hand), 3)
        assert (arrays["counts"][-1] == last).all() or len(arrays["counts"]) > len(live)


def test_a_configuration_that_the_daemon_does_not_run_with_is_refused_and_silent_buses_are_named(start, folder):
    daemon = start()

    def record(*arguments):
        command = [binary("taxel"), "record", "--seconds", "0.5", *map(str, arguments)]
        return subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=30)

    text = daemon.config.read_text()
    scenes = re.sub(r'source = "udp:[^"]*"', 'source = "sim:tap"', text)
    module = 'layout = "uskin-module"\n[[bus]]\nsource = "can:vcan7"\n'
    for name, other, reads in [
        ("scenes", scenes, "reads can0 from udp:"),
        ("module", module, "reads layout allegro-uskin-15"),
    ]:
        (folder / f"{name}.toml").write_text(other)
        refused = record(f"{name}.mcap", "--config", f"{name}.toml", "--socket", daemon.images)
        assert refused.returncode == 1 and not (folder / f"{name}.mcap").exists(), refused.stderr
        assert f"{name}.toml is not the configuration of the daemon that runs" in refused.stderr, refused.stderr
        assert reads in refused.stderr, refused.stderr
    # Without a daemon to ask, the file is what is spoken of.
    waiting = record("waiting.mcap", "--config", "scenes.toml", "--socket", folder / "nobody.sock")
    assert "no raw CAN: scenes.toml reads neither can: nor udp:" in waiting.stderr, waiting.stderr
    assert "no file was made" in waiting.stderr and not (folder / "waiting.mcap").exists(), waiting.stderr
    assert waiting.returncode == 1 and "nothing came of a daemon at" in waiting.stderr, waiting.stderr
    wrong = f"udp:{GROUP}:{free_udp_port()}"
    silent = record("silent.mcap", "--socket", daemon.images, "--can", f"left={wrong}?hops=0", "--json")
    assert f"no CAN frame came of left from {wrong}" in silent.stderr, silent.stderr
    assert json.loads(silent.stdout)["silent"] == ["left"]


def test_a_recording_of_which_nothing_came_that_was_asked_for_fails_and_says_why(start, folder):
    daemon = start(socket={"max_subscribers": 1})
    silent = f"udp:{GROUP}:{free_udp_port()}?hops=0"

    def record(name, *arguments):
        command = [binary("taxel"), "record", f"{name}.mcap", "--seconds", "0.5", *map(str, arguments)]
        return subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=30)

    with taxel_reader.connect(daemon.images) as reader:
        assert reader.receive(20.0) is not None
        full = record("full", "--socket", daemon.images, "--no-can")
    assert full.returncode == 1 and "1 subscribers are connected already" in full.stderr, full.stderr
    assert "nothing came of a daemon at" in full.stderr and "Broken pipe" not in full.stderr, full.stderr
    bus = record("bus", "--no-daemon", "--can", silent)
    assert bus.returncode == 1 and "no CAN frame came" in bus.stderr, bus.stderr


@pytest.mark.parametrize("stop", [signal.SIGTERM, signal.SIGINT])
def test_a_recording_that_is_stopped_before_anything_came_has_lost_nothing(folder, stop):
    command = [binary("taxel"), "record", "no.mcap", "--socket", "nobody.sock", "--no-can"]
    recorder = subprocess.Popen(command, cwd=folder, stderr=subprocess.PIPE, text=True)
    assert "waiting for it" in recorder.stderr.readline()
    recorder.send_signal(stop)
    _, told = recorder.communicate(timeout=30)
    assert recorder.returncode == 0 and "no file was made" in told, told
    assert not (folder / "no.mcap").exists()


def test_a_part_that_begins_in_a_grasp_gives_the_contacts_that_were_shown(start, lockstep, folder, hand):
    frames = list(grasp(Touches.uneven(hand, seed=4)))
    daemon = start(conditioning=DAEMON_SETTINGS, sweep=SWEEP)
    driver = lockstep(daemon)
    before = [driver.step(counts) for counts in frames[:8]]
    assert before[-1].contacts > 0
    out = folder / "part.mcap"
    with recording(daemon, out) as recorder:
        live = [driver.step(counts) for counts in frames[8:]]
        eventually(lambda: len(messages(out).get("/taxel/images", [])) >= len(live), lambda: recorder.said)
        assert recorder.end() == 0, recorder.said
    taxel("compress", out, "--out", folder / "part.bin")
    again = full_images(folder / "part.bin")
    assert len(again) >= len(live) - 1
    assert [image.contacts for image in again] == [image.contacts for image in live][-len(again) :]


def test_a_hand_is_compared_where_the_daemon_answers_by_another_name_and_one_of_no_layout_here_is_told(start, folder):
    layout = subprocess.run([binary("taxel"), "layouts", "uskin-module", "--file"], capture_output=True, text=True)
    own = folder / "own.toml"
    own.write_text(layout.stdout.replace('"uskin-module"', '"my-module"'))
    sources = [f"udp:{GROUP}:{free_udp_port()}?hops=0"]
    daemon = start(sources, layout=str(own), socket={"status": str(folder / "tells.sock")})

    def record(name, *arguments, socket=daemon.images):
        command = [binary("taxel"), "record", f"{name}.mcap", "--seconds", "0.5", "--socket", socket]
        command += map(str, arguments)
        return subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=30)

    (folder / "other.toml").write_text('layout = "uskin-module"\n[[bus]]\nsource = "can:vcan7"\n')
    refused = record("other", "--config", "other.toml")
    assert refused.returncode == 1 and "reads layout my-module" in refused.stderr, refused.stderr
    elsewhere = record("elsewhere")
    assert elsewhere.returncode == 1 and "--control PATH names the socket that answers" in elsewhere.stderr
    bare = record("bare", "--control", folder / "tells.sock")
    assert bare.returncode == 0, bare.stderr
    assert "hand my-module is not built in, and its layout will not be in the recording" in bare.stderr, bare.stderr
    # The file's socket, in the file's words and in others.
    for name, socket in [("whole", daemon.images), ("again", os.path.relpath(daemon.images, folder))]:
        whole = record(name, "--config", daemon.config, socket=socket)
        assert whole.returncode == 0 and not re.search("not built in|not known", whole.stderr), whole.stderr


def test_joint_angles_are_joint_states_to_the_tools_of_others(folder):
    servos = Servos("--ids", "1-4", "--motion", "sine")
    names = [f"index {n}" for n in range(4)]
    table = [{"id": id, "name": name} for id, name in zip(range(1, 5), names)]
    joints = {"source": f"dynamixel:{servos.path}", "answer_margin_ms": 100.0, "hold_ms": 2000.0, "servo": table}
    out = folder / "joints.mcap"
    with Daemon(folder / "daemon", ["sim:idle", "sim:idle"], joints=joints) as daemon, recording(daemon, out) as recorder:
        eventually(lambda: len(messages(out).get("/joint_states", [])) >= 20, "no joint states come into the file", 30)
        assert recorder.end() == 0, recorder.said

    by_topic = messages(out)
    frames = {at_ns: frame for _, at_ns, frame in by_topic["/taxel/frames"]}
    states = by_topic["/joint_states"]
    assert {kind for kind, _, _ in states} == {"sensor_msgs/msg/JointState"}
    for _, at_ns, state in states:
        assert list(state.name) == names
        assert state.header.stamp.sec * 1_000_000_000 + state.header.stamp.nanosec == at_ns
        np.testing.assert_array_equal(np.float32(state.position), np.float32(frames[at_ns].joints))
    known = [state for _, _, state in states if np.isfinite(state.position).all()]
    assert known and np.ptp([state.position[0] for state in known]) > 0

    with AnyReader([out]) as bag:
        wanted = [connection for connection in bag.connections if connection.topic == "/joint_states"]
        read = [bag.deserialize(data, c.msgtype) for c, _, data in bag.messages(connections=wanted)]
    assert len(read) == len(states)
    for state, (_, _, same) in zip(read, states):
        np.testing.assert_array_equal(state.position, same.position)
        assert list(state.name) == names


def test_what_was_shown_and_marked_comes_out_of_the_file_as_it_was(start, lockstep, folder, hand):
    daemon = start(conditioning=DAEMON_SETTINGS, sweep=SWEEP)
    out = folder / "touches.mcap"
    frames = list(grasp(Touches.uneven(hand, seed=4)))
    with recording(daemon, out) as recorder:
        driver = lockstep(daemon)
        live = []
        for touch in range(4):
            daemon.control("mark", text=f"touch {touch} {'AB'[touch % 2]}")
            live += [driver.step(counts) for counts in frames[:: 2 + touch % 2][:12]]
            daemon.control("mark", text="away")
            live += [driver.step(frames[0]) for _ in range(3)]
        eventually(lambda: len(marks(out)) == 8, lambda: f"the marks do not come into the file: {recorder.said}")
        assert recorder.end() == 0, recorder.said

    taxel("convert", out, folder / "images.npz", "--images")
    with np.load(folder / "images.npz") as arrays:
        shown = {seq: pixels.tobytes() for seq, pixels in zip(arrays["seq"].tolist(), arrays["images"])}
        assert set(arrays.files) >= {"levels", "actuators", "t_ns", "contacts"}
    assert len(live) >= 30 and all(shown[image.seq] == image.pixels for image in live)
    taxel("convert", out, folder / "images.csv", "--images")
    assert len((folder / "images.csv").read_text().splitlines()) == len(shown) + 1

    taxel("convert", out, folder / "marks.csv", "--marks")
    lines = [line.split(",") for line in (folder / "marks.csv").read_text().splitlines()]
    assert lines[0] == ["t_s", "text"] and [text for _, text in lines[1:]] == [text for _, text in marks(out)]
    times = [float(seconds) for seconds, _ in lines[1:]]
    assert times == sorted(times)
    to_stdout = subprocess.run([binary("taxel"), "convert", out, "-", "--marks"], capture_output=True, check=True)
    assert to_stdout.stdout == (folder / "marks.csv").read_bytes()

    def categories(*arguments):
        # One step for all of a touch: on a busy machine two frames may be any time apart.
        command = [binary("taxel"), "categorize", *arguments, "--step", "1000", "--classes", "2", "--json"]
        done = subprocess.run(command, capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
        return json.loads(done.stdout)

    cut = categories(out)
    assert cut["touches"] == 4
    assert categories(out, "--marks", folder / "marks.csv")["labels"] == cut["labels"]


def test_rosbags_and_the_index_of_mcap_read_it(start, lockstep, folder, hand):
    daemon = start(conditioning=DAEMON_SETTINGS, sweep=SWEEP)
    out = folder / "grasp.mcap"
    with recording(daemon, out) as recorder:
        driver = lockstep(daemon)
        for counts in list(grasp(Touches.even(hand)))[:10]:
            driver.step(counts)
        daemon.wait_status(lambda s: s["uptime_s"] > 2.5, "no second passes")
        assert recorder.end() == 0, recorder.said
    with out.open("rb") as file:
        reader = make_reader(file)
        summary = reader.get_summary()
        assert {a.name for a in reader.iter_attachments()} == {"taxeld.toml"}
        assert [m.name for m in reader.iter_metadata()] == ["taxel"]
        counted = {summary.channels[c].topic: n for c, n in summary.statistics.channel_message_counts.items()}
    with AnyReader([out]) as bag:
        seen = {}
        for connection, _, data in bag.messages():
            bag.deserialize(data, connection.msgtype)
            seen[connection.topic] = seen.get(connection.topic, 0) + 1
    assert seen == counted and seen["/taxel/frames"] >= 10 and seen["/diagnostics"] >= 1


def test_what_was_recorded_can_be_read_while_it_is_and_after_kill_9(start, lockstep, folder, hand):
    daemon = start(conditioning=DAEMON_SETTINGS, sweep=SWEEP)
    out, log = folder / "torn.mcap", folder / "torn.log"
    with recording(daemon, out) as recorder:
        driver = lockstep(daemon)
        for counts in list(grasp(Touches.even(hand)))[:10]:
            driver.step(counts)
        sent = driver.sweeps * len(hand)

        def are_all_there():
            subprocess.run([binary("taxel"), "convert", out, log], capture_output=True)
            lines = log.read_text().splitlines() if log.exists() else []
            # As long as it has no CAN, there is a log of its tactile frames, which begins at 0 s.
            return len(lines) == sent and not lines[0].startswith("(0000000000.")

        eventually(are_all_there, f"the {sent} frames sent do not come into the file", 20)
        before = log.read_bytes()
        assert recorder.end(signal.SIGKILL) == -signal.SIGKILL
    assert "torn off" in taxel("convert", out, log)
    differ = [pair for pair in zip(before.splitlines(), log.read_bytes().splitlines()) if pair[0] != pair[1]]
    assert not differ, f"{len(differ)} of {sent} frames differ, the first is {differ[0]}"
    assert log.stat().st_size == len(before)
    assert "torn off" in taxel("compress", out, "--out", folder / "images.npz")


def test_a_full_disk_stops_the_recording_says_so_and_costs_no_image(start, lockstep, folder, hand):
    daemon = start(conditioning=DAEMON_SETTINGS, sweep=SWEEP)
    out = folder / "full.mcap"
    with recording(daemon, out, limit=LIMIT) as recorder:
        driver = lockstep(daemon)
        frames = list(grasp(Touches.even(hand)))
        images = 0
        while recorder.process.poll() is None:
            driver.step(frames[images % len(frames)])
            images += 1
            assert images < 2000, "the recorder does not notice that the disk is full"
        assert recorder.process.returncode == 1
        assert "full.mcap: File too large" in recorder.said and "the recording stopped there" in recorder.said
        driver.step(frames[0])
    assert out.stat().st_size <= LIMIT
    assert "torn off" in taxel("convert", out, folder / "full.log")
    assert (folder / "full.log").stat().st_size > 0


def test_a_disk_without_room_for_a_first_chunk_is_left_without_files_however_often_it_is_tried(start, folder):
    daemon = start()
    out = folder / "full.mcap"

    def limited():
        die_with_parent()
        resource.setrlimit(resource.RLIMIT_FSIZE, (100, 100))

    for _ in range(2):
        command = [binary("taxel"), "record", out, "--no-can", "--socket", daemon.images, "--split-size", "1MB"]
        options = {"capture_output": True, "text": True, "timeout": 30}
        failed = subprocess.run(command, preexec_fn=limited, restore_signals=False, **options)
        assert failed.returncode == 1 and "full-0001.mcap: File too large" in failed.stderr, failed.stderr
        assert list(folder.glob("*.mcap")) == []


def test_a_file_that_is_renamed_while_it_is_recorded_into_is_told_and_the_recording_goes_on_in_another(start, folder):
    daemon = start()
    out, old = folder / "a.mcap", folder / "a.mcap.1"
    with recording(daemon, out) as recorder:
        eventually(lambda: len(messages(out).get("/taxel/hello", [])) > 0, "nothing comes into the file")
        out.rename(old)
        another = folder / "a-0001.mcap"
        eventually(another.exists, lambda: f"no other file is made: {recorder.said}")
        assert recorder.end() == 1, recorder.said
    assert "a.mcap was removed or renamed while it was recorded into" in recorder.said
    assert "the recording goes on in another file" in recorder.said and "not whole in its files" in recorder.said
    for whole in old, another:
        with whole.open("rb") as file:
            counted = make_reader(file).get_summary().statistics
        assert counted.message_count > 0


def test_another_configuration_of_the_next_daemon_is_in_another_file_and_one_that_is_not_its_own_in_none(start, folder):
    ports = [free_udp_port() for _ in range(2)]
    daemon = start([f"udp:{GROUP}:{ports[0]}?hops=0"], layout="uskin-module")
    text, out, file = daemon.config.read_text(), folder / "day.mcap", daemon.config

    def described(path, times=1):
        found = lambda: len(messages(path).get("/taxel/hello", [])) >= times
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
        times = len(messages(second)["/taxel/hello"])
        again(changed)
        described(second, times + 1)
        again(changed.replace("uskin-module", "uskin-fingertip"), folder / "other.toml")
        described(third)
        assert recorder.end() == 0, recorder.said
    assert [attached(path) for path in (out, second, third)] == [[text], [changed], []]
    assert sorted(folder.glob("*.mcap")) == sorted([out, second, third])
    said = recorder.said
    assert said.count("the daemon runs with another configuration") == 2, said
    assert f"{file} is not the configuration of the daemon that runs" in said, said
    assert "From here on it is recorded without it" in said and said.count("reads layout uskin-fingertip") == 1, said
    for port in ports:
        assert f"no CAN frame came of can0 from udp:{GROUP}:{port}" in said, said


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
            # A file is whole when its window is over, and has an index then.
            def is_whole(file=file):
                with suppress(McapError, FileNotFoundError), file.open("rb") as whole:
                    return make_reader(whole).get_summary()

            daemon.control("mark", text="slipped")
            eventually(is_whole, f"{file.name} does not become whole", 20)
        assert recorder.end() == 0
    os.close(full)
    os.close(reader)


def test_every_loss_of_the_daemon_is_told(start, folder):
    daemon = start()
    with recording(daemon, folder / "a.mcap") as recorder:
        for times in 1, 2:
            daemon.stop()
            eventually(
                lambda times=times: recorder.said.count("waiting for it") == times,
                lambda: f"a loss is not told: {recorder.said}",
                20,
            )
            daemon.start()
            recorder.is_subscribed()
        assert recorder.end() == 0, recorder.said


@pytest.mark.parametrize("trigger", ["mark", "signal"])
def test_a_trigger_keeps_what_was_before_it_and_nothing_is_written_until_then(start, lockstep, folder, hand, trigger):
    daemon = start(conditioning=DAEMON_SETTINGS, sweep=SWEEP)
    out = folder / "slip.mcap"
    with recording(daemon, out, "--keep", "60", "--after", "0.2", "--trigger", trigger) as recorder:
        driver = lockstep(daemon)
        for counts in list(grasp(Touches.even(hand)))[:8]:
            driver.step(counts)
        sent = driver.sweeps * len(hand)
        # What the daemon has made of them the recorder has, too, once it is told of a status of later.
        daemon.wait_status(lambda s: s["images"]["made"] >= 8, "no images")
        assert list(folder.glob("*.mcap")) == []
        if trigger == "mark":
            daemon.control("mark", text="slipped")
        else:
            recorder.process.send_signal(signal.SIGUSR1)
        first = folder / "slip-0001.mcap"
        eventually(first.exists, lambda: f"no file comes of the trigger: {recorder.said}")
        assert recorder.end() == 0, recorder.said
    by_topic = messages(first)
    assert sum(len(m.id) for _, _, m in by_topic["/taxel/can"]) == sent
    assert [text for _, text in marks(first)] == (["slipped"] if trigger == "mark" else [])
    assert by_topic["/taxel/hello"]
