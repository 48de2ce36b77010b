"""`taxel record` beside a live daemon: what is in the file, and who can read it, while it is written and after a crash."""

import json
import signal
import subprocess

import numpy as np
import taxel_reader
from conditioning import DAEMON_SETTINGS
from harness.compare import content
from harness.daemon import Daemon, binary, eventually
from harness.lockstep import NEVER_SILENT, SWEEP
from harness.recorder import can_frames, marks, messages, of_topic, recording, taxel
from harness.servos import Servos
from harness.touches import Touches, grasp
from mcap.reader import NonSeekingReader, make_reader
from mcap.writer import Writer
from rosbags.highlevel import AnyReader


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


def full_images(path):
    """What images with every taxel show, calibration over, in a file of IMAGE messages."""
    data, images = path.read_bytes(), []
    while data:
        image, length = taxel_reader.decode(data)
        data = data[length:]
        if image.missing == 0 and not image.header.flags & taxel_reader.FLAG_CALIBRATING:
            images.append(content(image))
    return images


def without_can(path, to):
    """Writes a recording anew without its CAN traffic."""
    with path.open("rb") as file, to.open("wb") as out:
        writer, channels = Writer(out), {}
        writer.start("ros2")
        for schema, channel, message in NonSeekingReader(file).iter_messages(log_time_order=False):
            if channel.topic == "/taxel/can":
                continue
            if channel.topic not in channels:
                of = writer.register_schema(schema.name, schema.encoding, schema.data)
                channels[channel.topic] = writer.register_channel(channel.topic, channel.message_encoding, of)
            writer.add_message(channels[channel.topic], message.log_time, message.data, message.publish_time)
        writer.finish()


def test_a_recording_holds_what_was_sent_and_shown_and_gives_the_same_images(start, lockstep, folder, hand):
    frames = list(grasp(Touches.uneven(hand, seed=4)))
    daemon = start(conditioning=DAEMON_SETTINGS, sweep=SWEEP, tick=NEVER_SILENT)
    out = folder / "grasp.mcap"
    with recording(daemon, out) as recorder:
        driver = lockstep(daemon)
        live = [driver.step(counts) for counts in frames]
        marked = daemon.control("mark", text="the grasp is over")["mark"]
        eventually(lambda: marks(out), lambda: f"the mark does not come into the file: {recorder.said}")
        sent = driver.sweeps * len(hand)
        eventually(lambda: can_frames(out) == sent, lambda: f"{can_frames(out)} of {sent} frames come into the file: {recorder.said}")
        assert recorder.end() == 0, recorder.said
        assert "lost" not in recorder.said and "passed over" not in recorder.said, recorder.said

    by_topic = messages(out)
    types = {topic: found[0][0] for topic, found in by_topic.items()}
    once_a_second = {"/taxel/status", "/diagnostics"}
    assert types.items() <= TYPES.items() and types.keys() | once_a_second == TYPES.keys()
    blocks = [m for _, _, m in by_topic["/taxel/can"]]
    assert sum(len(b.id) for b in blocks) == sent
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


def test_a_part_that_begins_in_a_grasp_gives_the_contacts_that_were_shown(start, lockstep, folder, hand):
    frames = list(grasp(Touches.uneven(hand, seed=4)))
    daemon = start(conditioning=DAEMON_SETTINGS, sweep=SWEEP, tick=NEVER_SILENT)
    driver = lockstep(daemon)
    before = [driver.step(counts) for counts in frames[:8]]
    assert before[-1].contacts > 0
    out = folder / "part.mcap"
    with recording(daemon, out) as recorder:
        live = [driver.step(counts) for counts in frames[8:]]
        sent = (driver.sweeps - len(before)) * len(hand)
        eventually(lambda: can_frames(out) == sent and len(of_topic(out, "/taxel/images")) >= len(live), lambda: recorder.said)
        assert recorder.end() == 0, recorder.said
    taxel("compress", out, "--out", folder / "part.bin")
    again = full_images(folder / "part.bin")
    assert len(again) >= len(live) - 1
    assert [image.contacts for image in again] == [image.contacts for image in live][-len(again) :]


def test_what_is_made_anew_is_calibrated_and_paused_where_the_daemon_was(start, lockstep, folder, hand):
    hands = [Touches.uneven(hand, seed=4)]
    hands += [Touches(hand, hands[0].at_rest + [0, 0, drift]) for drift in (300, 700)]
    daemon = start(conditioning=DAEMON_SETTINGS, sweep=SWEEP)
    out, live = folder / "day.mcap", []

    def said(kind):
        return any(log.name == kind for _, _, log in of_topic(out, "/rosout"))

    with recording(daemon, out) as recorder:
        driver = lockstep(daemon)

        def show(touches, frames=slice(None)):
            shown = [driver.step(counts) for counts in list(grasp(touches))[frames]]
            live.extend(shown)
            return [image.contacts for image in shown]

        assert show(hands[0])[-1] == 0
        assert min(show(hands[1], slice(3))) > 100
        driver.rezero()
        assert show(hands[1])[-2:] != [0, 0]
        assert daemon.control("pause")["ok"]
        assert show(hands[1], slice(8, None)) == [0] * 7
        eventually(lambda: said("paused"), lambda: f"no pause comes into the file: {recorder.said}")
        assert daemon.control("resume")["ok"]
        assert show(hands[1], slice(8, 10)) != [0, 0]
        eventually(lambda: said("resumed"), lambda: f"no end of the pause comes into the file: {recorder.said}")
        assert daemon.stop() == 0
        daemon.start()
        recorder.is_subscribed()
        driver = lockstep(daemon)
        assert show(hands[2])[-2:] != [0, 0]
        eventually(lambda: len(of_topic(out, "/taxel/images")) >= len(live), lambda: recorder.said)
        assert recorder.end() == 0, recorder.said

    def display(image, actuators):
        return bytes(image.pixels), list(image.levels), [tuple(actuator) for actuator in actuators]

    # All that were made, also those that were overtaken on their way to the driver.
    full = [m for _, _, m in of_topic(out, "/taxel/images") if not m.missing]
    calibrated = [m for m in full if not m.flags & taxel_reader.FLAG_CALIBRATING]
    lists = "id", "x", "y", "level", "force"
    shown = [display(m, zip(*(getattr(m, f"actuator_{name}") for name in lists))) for m in calibrated]
    assert len(shown) >= 40
    frames = folder / "frames.mcap"
    without_can(out, frames)
    for recorded in (out, frames):
        taxel("compress", recorded, "--config", daemon.config, "--out", folder / "again.bin")
        assert [display(i, i.actuators) for i in full_images(folder / "again.bin")] == shown, recorded


def test_joint_angles_are_joint_states_to_the_tools_of_others(folder):
    servos = Servos("--ids", "1-4", "--motion", "sine")
    names = [f"index {n}" for n in range(4)]
    table = [{"id": id, "name": name} for id, name in zip(range(1, 5), names)]
    joints = {"source": f"dynamixel:{servos.path}", "answer_margin_ms": 100.0, "hold_ms": 2000.0, "servo": table}
    out = folder / "joints.mcap"
    with Daemon(folder / "daemon", ["sim:idle", "sim:idle"], joints=joints) as daemon, recording(daemon, out) as recorder:
        eventually(lambda: len(of_topic(out, "/joint_states")) >= 20, "no joint states come into the file")
        assert recorder.end() == 0, recorder.said

    by_topic = messages(out, "/taxel/frames", "/joint_states")
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

        eventually(are_all_there, f"the {sent} frames sent do not come into the file")
        before = log.read_bytes()
        assert recorder.end(signal.SIGKILL) == -signal.SIGKILL
    assert "torn off" in taxel("convert", out, log)
    differ = [pair for pair in zip(before.splitlines(), log.read_bytes().splitlines()) if pair[0] != pair[1]]
    assert not differ, f"{len(differ)} of {sent} frames differ, the first is {differ[0]}"
    assert log.stat().st_size == len(before)
    assert "torn off" in taxel("compress", out, "--out", folder / "images.npz")
