"""`taxel foxglove` beside a live daemon: what viewers are shown, and that they harm nobody."""

import json
import os
import signal
import subprocess
import time
from pathlib import Path

import numpy as np
import pytest
from conditioning import DAEMON_SETTINGS
from harness import foxglove
from harness.daemon import binary, eventually
from harness.foxglove import Bridge, Viewer, frame, let_in, raw, read_to_the_end, subscription
from harness.recorder import recording
from harness.touches import Touches, grasp
from mcap.reader import NonSeekingReader
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

TOPICS = {
    "/taxel/frames": "taxel_msgs/msg/TactileFrame",
    "/taxel/images": "taxel_msgs/msg/TactileImage",
    "/tactile_image": "sensor_msgs/msg/Image",
    "/joint_states": "sensor_msgs/msg/JointState",
    "/diagnostics": "diagnostic_msgs/msg/DiagnosticArray",
    "/rosout": "rcl_interfaces/msg/Log",
    "/taxel/hello": "std_msgs/msg/String",
    "/taxel/status": "std_msgs/msg/String",
    "/taxel/clock": "taxel_msgs/msg/Clocks",
}
SCENE = ["sim:ball-grasp", "sim:ball-grasp"]
TICK = {"rate_hz": 50.0}


@pytest.fixture
def bridge(daemon, folder):
    with Bridge(daemon, folder) as bridge:
        yield bridge


@pytest.fixture
def daemon(start):
    return start(conditioning=DAEMON_SETTINGS)


def is_sent(daemon, **wanted):
    """Waits until the bridge has subscribed to this."""

    def does(status):
        return any(subscriber.items() >= wanted.items() for subscriber in status["subscribers"])

    daemon.wait_status(does, f"nobody is subscribed to {wanted}")


def records(path):
    """By topic, its definition and its messages in a recording."""
    by_topic = {}
    with path.open("rb") as file:
        for schema, channel, message in NonSeekingReader(file).iter_messages(log_time_order=False):
            by_topic.setdefault(channel.topic, (schema, channel, []))[2].append((message.log_time, message.data))
    return by_topic


def test_a_viewer_is_shown_what_a_recording_holds_byte_by_byte(daemon, bridge, lockstep, folder, hand):
    driver, frames = lockstep(daemon), list(grasp(Touches.uneven(hand, seed=4)))
    with recording(daemon, folder / "grasp.mcap") as recorder, Viewer(bridge, *TOPICS) as viewer:
        is_sent(daemon, pid=bridge.process.pid, raw=True, every=True)
        live = [driver.step(counts) for counts in frames]
        daemon.control("mark", text="the grasp is over")
        viewer.hear_until(lambda: any(log.name == "mark" for _, log in viewer.of("/rosout")))
        viewer.hear_until(lambda: viewer.of("/taxel/images")[-1][1].seq >= live[-1].seq)
        viewer.hear_until(lambda: viewer.of("/taxel/frames")[-1][1].seq >= live[-1].seq)
        viewer.next("/diagnostics")
        assert recorder.end() == 0, recorder.said

    assert viewer.info["capabilities"] == [] and viewer.info["name"].startswith("taxel ")
    assert {topic: channel["schemaName"] for topic, channel in viewer.channels.items()} == TOPICS
    recorded = records(folder / "grasp.mcap")
    for topic, (schema, channel, _) in recorded.items():
        if topic == "/taxel/can":
            continue
        shown = viewer.channels[topic]
        assert (shown["schemaName"], shown["schemaEncoding"], shown["encoding"]) == (schema.name, schema.encoding, channel.message_encoding)
        assert shown["schema"] == schema.data.decode()

    # Other readers than the one above.
    store = get_typestore(Stores.ROS2_HUMBLE)
    for channel in viewer.channels.values():
        if channel["schemaName"].startswith("taxel_msgs"):
            store.register(get_types_from_msg(channel["schema"], channel["schemaName"]))
    for topic, messages in viewer.messages.items():
        for _, data in messages:
            store.deserialize_cdr(data, TOPICS[topic])

    in_file = {bytes(data) for topic in ("/taxel/images", "/taxel/frames") for _, data in recorded[topic][2]}
    by_seq = {topic: {m.seq: data for (_, m), (_, data) in zip(viewer.of(topic), viewer.messages[topic])} for topic in ("/taxel/images", "/taxel/frames")}
    for image in live[1:]:
        assert by_seq["/taxel/images"][image.seq] in in_file and by_seq["/taxel/frames"][image.seq] in in_file
    shown = {m.seq: m for _, m in viewer.of("/taxel/frames")}
    assert (np.array(shown[live[-1].seq].counts).reshape(-1, 3) == np.asarray(frames[-1])).all()
    assert live[-1].pixels in [bytes(m.data) for _, m in viewer.of("/tactile_image")]
    assert json.loads(viewer.of("/taxel/hello")[0][1].data)["layout"] == "allegro-uskin-15"
    # Times are the wall clock's, and what is stamped has the same.
    for wall_ns, picture in viewer.of("/tactile_image"):
        assert wall_ns == picture.header.stamp.sec * 1_000_000_000 + picture.header.stamp.nanosec
        assert abs(wall_ns - time.time_ns()) < 3600e9

    counts = bridge.end()
    assert counts["lost"] == counts["skipped"] == counts["refused"] == counts["let_go"] == counts["faults"] == 0
    assert (counts["clients"], counts["daemons"]) == (1, 1)


@pytest.mark.parametrize("protocol", [foxglove.PROTOCOL, "foxglove.sdk.v1"])
def test_the_protocol_is_spoken_under_both_of_its_names(bridge, protocol):
    with Viewer(bridge, "/taxel/hello", protocol=protocol) as viewer:
        assert viewer.socket.subprotocol == protocol
        viewer.next("/taxel/hello")


def test_whoever_comes_later_is_told_how_things_are(start, folder):
    daemon = start(SCENE, tick=TICK)
    with Bridge(daemon, folder) as bridge, Viewer(bridge, "/taxel/hello", "/taxel/status") as first:
        first.next("/taxel/status")
        # Nobody describes the hand again for the second.
        with Viewer(bridge, "/taxel/hello", "/taxel/status", "/diagnostics", "/taxel/clock") as second:
            second.hear_until(lambda: len(second.messages) == 4)
            assert second.messages["/taxel/hello"] == first.messages["/taxel/hello"]


def is_sent_no_images(daemon, pid):
    """Waits until the bridge is sent none of twenty images."""

    def sent(status):
        return next(subscriber["images"] for subscriber in status["subscribers"] if subscriber["pid"] == pid)

    def none_of_twenty():
        before = daemon.status()
        after = daemon.wait_status(lambda s: s["images"]["made"] >= before["images"]["made"] + 20, "no images are made")
        return sent(before) == sent(after)

    eventually(none_of_twenty, "nobody looks at images, and they are sent")


def test_the_daemon_sends_what_viewers_look_at_and_nothing_else(start, folder):
    daemon = start(SCENE, tick=TICK)
    with Bridge(daemon, folder) as bridge:
        pid = bridge.process.pid
        is_sent(daemon, pid=pid, raw=False)
        is_sent_no_images(daemon, pid)
        with Viewer(bridge, "/tactile_image") as one, Viewer(bridge, "/taxel/frames") as other:
            one.next("/tactile_image")
            other.next("/taxel/frames")
            is_sent(daemon, pid=pid, raw=True)
            other.unsubscribe("/taxel/frames")
            is_sent(daemon, pid=pid, raw=False)
            one.next("/tactile_image", count=5)
        is_sent_no_images(daemon, pid)
        assert bridge.end()["skipped"] == 0


def test_a_daemon_that_is_restarted_is_told_and_its_channels_stay(start, folder):
    daemon = start(SCENE, tick=TICK)
    with Bridge(daemon, folder) as bridge, Viewer(bridge, "/tactile_image", "/rosout", "/taxel/status") as viewer:
        viewer.next("/tactile_image")
        channels = dict(viewer.channels)
        daemon.kill()
        viewer.hear_until(lambda: viewer.statuses)
        assert "waiting for it" in viewer.statuses[0]["message"] and viewer.statuses[0]["level"] == 1
        with Viewer(bridge) as late:
            late.hear_until(lambda: late.statuses)
            assert late.statuses == viewer.statuses
        daemon.start()
        viewer.hear_until(lambda: viewer.removed)
        assert viewer.removed == [viewer.statuses[0]["id"]]
        viewer.next("/tactile_image")
        viewer.hear_until(lambda: len(viewer.of("/rosout")) == 2)
        said = [log.msg for _, log in viewer.of("/rosout") if log.name == "bridge"]
        assert said == [viewer.statuses[0]["message"], "taxeld is there again"]
        assert viewer.channels == channels
        assert bridge.end()["daemons"] == 2


def test_it_waits_for_a_daemon_that_is_not_there_yet_and_says_that_one_hangs(start, folder):
    daemon = start(SCENE, tick=TICK)
    daemon.stop()
    with Bridge(daemon, folder) as bridge, Viewer(bridge, "/tactile_image") as viewer:
        viewer.hear_until(lambda: viewer.statuses)
        daemon.start()
        viewer.next("/tactile_image")
        daemon.hold()
        try:
            viewer.hear_until(lambda: any("says nothing" in status["message"] for status in viewer.statuses))
        finally:
            daemon.process.send_signal(signal.SIGCONT)
        viewer.hear_until(lambda: len(viewer.removed) == 2)
        viewer.next("/tactile_image")
        assert bridge.said.count("taxeld is there again") == 2, bridge.said


def test_its_end_is_told_and_an_address_that_is_taken_is_named(daemon, bridge):
    with Viewer(bridge) as viewer:
        again = [binary("taxel"), "foxglove", "--listen", f"127.0.0.1:{bridge.port}"]
        taken = subprocess.run(again, capture_output=True, text=True)
        assert taken.returncode == 1 and f"cannot listen at 127.0.0.1:{bridge.port}" in taken.stderr
        bridge.end()
        with pytest.raises(Exception) as ended:
            viewer.hear_until(lambda: False)
        assert "1001" in str(ended.value) and "ends" in str(ended.value)


@pytest.fixture
def healthy(daemon, bridge, lockstep, hand):
    """Call it to see that a viewer is shown every image of a grasp, and is told nothing."""
    driver = lockstep(daemon)
    with Viewer(bridge, "/taxel/images", "/taxel/frames") as viewer:
        is_sent(daemon, pid=bridge.process.pid, raw=True)

        def healthy():
            for counts in grasp(Touches.even(hand)):
                image = driver.step(counts)
                viewer.hear_until(lambda: any(m.seq == image.seq for _, m in viewer.of("/taxel/images")[-3:]))
                (shown,) = [m for _, m in viewer.of("/taxel/images")[-3:] if m.seq == image.seq]
                assert bytes(shown.pixels) == image.pixels
            assert viewer.statuses == []

        yield healthy


ASKED_WRONGLY = {
    "one byte": b"\0",
    "no HTTP": b"\x16\x03\x01\x02\x00\x01\x00\x01\xfc" + os.urandom(508) + b"\r\n\r\n",
    "another method": b"POST / HTTP/1.1\r\nHost: localhost\r\nContent-Length: 0\r\n\r\n",
    "no WebSocket": b"GET / HTTP/1.1\r\nHost: localhost\r\n\r\n",
    "another protocol": foxglove.request("rosbridge"),
    "a head without an end": b"GET / HTTP/1.1\r\n" + b"X: y\r\n" * 20_000,
    "a line without an end": b"GET /" + b"a" * 100_000,
    "more than was asked for": foxglove.request() + b"junk",
    "half of it": foxglove.request()[:50],
}


@pytest.mark.parametrize("what", ASKED_WRONGLY)
def test_who_asks_wrongly_is_not_let_in_and_disturbs_nobody(bridge, healthy, what):
    with raw(bridge) as client:
        try:
            client.sendall(ASKED_WRONGLY[what])
        except ConnectionError:
            pass  # it has heard enough
        healthy()
        answer = read_to_the_end(client)
        assert b"101 Switching" not in answer
        if what == "no WebSocket":
            assert answer.startswith(b"HTTP/1.1 426") and b"Foxglove" in answer
        if what == "another protocol":
            assert answer.startswith(b"HTTP/1.1 400") and foxglove.PROTOCOL.encode() in answer
    eventually(lambda: "not let in" in bridge.said, lambda: bridge.said)
    assert (bridge.end().items()) >= {"refused": 1, "clients": 1, "lost": 0}.items()


# What it sends, which code of the WebSocket protocol it is let go with, none where it may go on, and what it sends then as
# long as it is let.
SAID_WRONGLY = {
    "no frame": (b"\xff" * 1000, 1002),
    "a frame without a mask": (frame(b"{}", masked=False), 1002),
    "reserved bits": (frame(b"{}", reserved=4), 1002),
    "an opcode that is none": (frame(b"", opcode=11), 1002),
    "more than memory": (frame(b"", claims=1 << 62), 1009),
    "more than a client has to say": (frame(b"[" * 70_000), 1009),
    "a rest of nothing": (frame(b"", opcode=0), 1002),
    "fragments without an end": (frame(b"", final=False), 1008, frame(b"", opcode=0, final=False) * 10_000),
    "a message in endless parts": (frame(b"", final=False) + frame(b"x" * 1000, opcode=0, final=False) * 100, 1009),
    "questions without an end": (frame(b""), 1008, frame(b"x" * 100, opcode=9) * 1_000),
    "no UTF-8": (frame(b"\xff\xfe"), 1002),
    "no JSON": (frame(b"no"), None),
    "nesting": (frame(b"[" * 30_000), None),
    "no operation": (frame(b'{"op": 7}'), None),
    "another operation": (frame(b'{"op": "getParameters", "parameterNames": []}'), None),
    "a message": (frame(b"\x01\0\0\0\0", opcode=2), None),
    "no such channel": (frame(subscription(77)), None),
    "no such subscription": (frame(b'{"op": "unsubscribe", "subscriptionIds": [9]}'), None),
    "the same again and again": (frame(b"no") * 100, 1008),
}


def close_code(data):
    """The code of the frame that a server closes with, behind whatever it sent before."""
    at, found = 0, None
    while at < len(data):
        opcode, length = data[at] & 15, data[at + 1]
        at += 2
        if length in (126, 127):
            size = 2 if length == 126 else 8
            length = int.from_bytes(data[at : at + size], "big")
            at += size
        if opcode == 8:
            found = int.from_bytes(data[at : at + 2], "big")
        at += length
    return found


@pytest.mark.parametrize("what", SAID_WRONGLY)
def test_who_says_what_cannot_be_done_is_told_or_let_go_and_disturbs_nobody(bridge, healthy, what):
    said, code, *more = SAID_WRONGLY[what]
    with let_in(bridge) as client:
        try:
            client.sendall(said)
            while more:
                client.sendall(more[0])
        except ConnectionError:
            pass  # it has heard enough
        answer = b""
        if not code:
            # Who goes is told nothing more.
            while b'"op":"status"' not in answer:
                part = client.recv(65536)
                assert part, answer
                answer += part
            client.sendall(frame(b"", opcode=8))
        healthy()
        answer += read_to_the_end(client)
        if code:
            # Of a flood the kernel may throw away the answer.
            codes = {code, None} if more or len(said) > 65536 else {code}
            assert close_code(answer) in codes, answer
        else:
            assert b'"op":"status"' in answer and b'"level":2' in answer
    counts = bridge.end()
    assert (counts["clients"], counts["let_go"], counts["lost"]) == (2, int(code is not None), 0), bridge.said
    assert (counts["faults"] > 0) == (code is None or what in ("the same again and again", "questions without an end"))


def test_messages_of_no_length_count_for_more_than_their_bytes(bridge, healthy):
    with let_in(bridge) as client:
        try:
            client.sendall(frame(b"", opcode=9) * 10_000)
        except ConnectionError:
            pass  # it has heard enough
        healthy()
        read_to_the_end(client)
    assert "let go: sends too much" in bridge.said, bridge.said


def test_what_a_client_said_wrongly_is_not_said_back_to_it_whole(bridge, healthy):
    said = b'{"op": "subscribe", "subscriptions": "' + b"\x7f" * 60_000 + b'"}'
    with Viewer(bridge) as viewer:
        viewer.socket.send(said, text=True)
        viewer.hear_until(lambda: viewer.statuses)
        message = viewer.statuses[0]["message"]
        assert message.startswith("not understood: ") and len(message) < 300
        healthy()


def test_a_thousand_subscriptions_are_ten_and_one_word_about_the_others(bridge, healthy):
    with Viewer(bridge) as viewer:
        ids = [channel["id"] for channel in viewer.channels.values()]
        wanted = [{"id": i, "channelId": ids[i % len(ids)]} for i in range(1000)]
        viewer.say({"op": "subscribe", "subscriptions": wanted})
        viewer.hear_until(lambda: viewer.statuses)
        assert f"{1000 - len(ids)} of 1000 subscriptions are refused" in viewer.statuses[0]["message"]
        healthy()


def test_connections_that_never_ask_keep_nobody_out(bridge, healthy):
    silent = [raw(bridge) for _ in range(200)]
    for client in silent:
        try:
            client.sendall(b"GET / HTTP/1.1\r\n")
        except ConnectionError:
            pass  # it made room for another
    with Viewer(bridge, "/taxel/hello") as viewer:
        viewer.next("/taxel/hello")
    healthy()
    for client in silent:
        read_to_the_end(client)
        client.close()
    assert bridge.end().items() >= {"refused": 200, "clients": 2, "let_go": 0, "lost": 0}.items()


def test_who_is_turned_away_is_counted_once_also_where_others_come_meanwhile(bridge, healthy):
    # Each has half a second to read why, and there are more of them than may ask at once.
    turned_away = [raw(bridge) for _ in range(150)]
    for client in turned_away:
        try:
            client.sendall(foxglove.request("rosbridge"))
        except ConnectionError:
            pass  # it made room for another
    for client in turned_away:
        read_to_the_end(client)
        client.close()
    healthy()
    assert bridge.end().items() >= {"refused": 150, "clients": 1, "let_go": 0, "lost": 0}.items()


def test_there_are_so_many_viewers_and_no_more(bridge, healthy):
    others = [let_in(bridge) for _ in range(31)]
    with raw(bridge) as client:
        client.sendall(foxglove.request())
        assert read_to_the_end(client).startswith(b"HTTP/1.1 503")
    healthy()
    others.pop().close()

    def has_room():
        with raw(bridge) as client:
            client.sendall(foxglove.request())
            return client.recv(12).endswith(b"101")

    eventually(has_room, "nobody is let in for one who left")
    for client in others:
        client.close()


def test_a_viewer_that_takes_nothing_is_let_go_and_a_slow_one_loses_the_oldest(start, folder):
    daemon = start(SCENE, tick={"rate_hz": 200.0})
    with Bridge(daemon, folder) as bridge, Viewer(bridge, "/taxel/images") as viewer:
        # One that reads all the time, but little: whatever the kernel's buffers hold, it is behind by a second or so.
        slow = Viewer(bridge, "/taxel/frames", "/taxel/images", max_queue=4)
        with let_in(bridge, receive_buffer=4096) as dead, slow:
            dead.sendall(frame(subscription(*range(1, 10))))

            def read_slowly():
                time.sleep(0.1)
                slow.hear()

            while "takes nothing" not in bridge.said or not any("it has lost" in s["message"] for s in slow.statuses):
                read_slowly()
            for _ in range(20):
                read_slowly()
        newest = viewer.next("/taxel/images")[0].seq
        viewer.hear_until(lambda: viewer.of("/taxel/images")[-1][1].seq > newest + 20)
        assert viewer.statuses == []
        eventually(lambda: bridge.said.count(" lost") == 1, lambda: bridge.said)
        counts = bridge.end()
        assert counts["let_go"] == 1 and counts["lost"] > 0, bridge.said


@pytest.mark.skipif(not Path("/proc/net/if_inet6").exists(), reason="no IPv6 here")
@pytest.mark.parametrize("listen, hosts", [("[::1]:0", ["[::1]"]), ("[::]:0", ["[::1]", "127.0.0.1"])])
def test_it_is_reached_by_ipv6(daemon, folder, listen, hosts):
    with Bridge(daemon, folder, listen) as bridge:
        for host in hosts:
            with Viewer(bridge, "/taxel/hello", host=host) as viewer:
                viewer.next("/taxel/hello")


# What a viewer of a server that can do more may ask for.
CHANGES = [
    json.dumps({"op": "advertise", "channels": [{"id": 1, "topic": "/rosout", "encoding": "json", "schemaName": "x"}]}),
    b"\x01" + bytes(4) + b"{}",
    json.dumps({"op": "setParameters", "parameters": [{"name": "levels", "value": 2}]}),
    b"\x02" + bytes(8) + b"\x04\0\0\0json{}",
    json.dumps({"op": "fetchAsset", "uri": "file:///etc/passwd", "requestId": 1}),
]


def test_a_page_of_another_origin_sees_what_everybody_sees_and_changes_nothing(daemon, bridge):
    profile = daemon.control("profile")
    with Viewer(bridge, "/taxel/hello", origin="https://elsewhere.example") as page:
        page.next("/taxel/hello")
        for change in CHANGES:
            page.socket.send(change)
        page.hear_until(lambda: len(page.statuses) == len(CHANGES))
        assert all(status["level"] == 2 for status in page.statuses)
    assert daemon.control("profile") == profile
    assert bridge.end()["faults"] == len(CHANGES)
