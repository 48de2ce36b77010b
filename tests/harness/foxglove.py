"""`taxel foxglove` of a daemon as a process, and viewers: stock WebSockets, read as the protocol's specification says."""

import base64
import json
import os
import re
import signal
import socket
import struct
import subprocess
from contextlib import ExitStack

from harness.daemon import HANGS_AFTER_S, binary, die_with_parent, eventually
from mcap.records import Schema
from mcap_ros2.decoder import DecoderFactory
from websockets.sync.client import connect

PROTOCOL = "foxglove.websocket.v1"
MESSAGE_DATA = 1


class Bridge:
    """A running `taxel foxglove`; what it says is in `said`. Use it as a context."""

    def __init__(self, daemon, folder, listen="127.0.0.1:0"):
        self.log, self.out = folder / "foxglove.said", folder / "foxglove.out"
        with self.log.open("wb") as log, self.out.open("wb") as out:
            self.process = subprocess.Popen(
                [binary("taxel"), "foxglove", "--json", "--listen", listen, "--socket", daemon.images],
                stdout=out,
                stderr=log,
                preexec_fn=die_with_parent,
            )
        said = eventually(lambda: re.search(r"ws://\S+:(\d+),", self.said), lambda: f"no address: {self.said}")
        self.port = int(said[1])

    @property
    def said(self):
        return self.log.read_text()

    def end(self):
        """Ends it as Ctrl-C does; what it counted."""
        self.process.send_signal(signal.SIGINT)
        assert self.process.wait(HANGS_AFTER_S) == 0, self.said
        return json.loads(self.out.read_text())

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.process.kill()
        self.process.wait()


class Viewer:
    """A client that keeps what it is told: `info`, `channels` by topic, `statuses`, and messages by topic."""

    def __init__(self, bridge, *topics, protocol=PROTOCOL, host="127.0.0.1", **options):
        self.stack = ExitStack()
        # A test that looks at something else for a while has not stopped reading.
        options = {"max_queue": None, **options}
        options |= {"subprotocols": [protocol], "max_size": None, "proxy": None, "ping_interval": None}
        self.socket = self.stack.enter_context(connect(f"ws://{host}:{bridge.port}", **options))
        self.statuses, self.removed, self.messages = [], [], {}
        self.channels, self.topics, self.decoders = {}, {}, {}
        self.info = self.hear()
        assert self.info["op"] == "serverInfo"
        while not self.channels:
            self.hear()
        self.subscribe(*topics)

    def subscribe(self, *topics):
        wanted = [{"id": 100 + self.channels[topic]["id"], "channelId": self.channels[topic]["id"]} for topic in topics]
        self.topics.update({s["id"]: topic for s, topic in zip(wanted, topics)})
        self.say({"op": "subscribe", "subscriptions": wanted})

    def unsubscribe(self, *topics):
        ids = [100 + self.channels[topic]["id"] for topic in topics]
        self.say({"op": "unsubscribe", "subscriptionIds": ids})

    def say(self, message):
        self.socket.send(json.dumps(message))

    def hear(self):
        """One message of the server."""
        data = self.socket.recv(HANGS_AFTER_S)
        if isinstance(data, bytes):
            kind, subscription, wall_ns = struct.unpack_from("<BIQ", data)
            assert kind == MESSAGE_DATA
            self.messages.setdefault(self.topics[subscription], []).append((wall_ns, data[13:]))
            return data
        message = json.loads(data)
        match message["op"]:
            case "advertise":
                self.channels.update({channel["topic"]: channel for channel in message["channels"]})
            case "status":
                self.statuses.append(message)
            case "removeStatus":
                self.removed += message["statusIds"]
        return message

    def hear_until(self, condition):
        while not condition():
            self.hear()

    def of(self, topic):
        """What came of a topic, read by mcap-ros2-support: time and message."""
        channel = self.channels[topic]
        if topic not in self.decoders:
            schema = Schema(1, channel["schema"].encode(), channel["schemaEncoding"], channel["schemaName"])
            self.decoders[topic] = DecoderFactory().decoder_for(channel["encoding"], schema)
        return [(wall_ns, self.decoders[topic](data)) for wall_ns, data in self.messages.get(topic, [])]

    def next(self, topic, count=1):
        """The next messages of a topic."""
        wanted = len(self.messages.get(topic, [])) + count
        self.hear_until(lambda: len(self.messages.get(topic, [])) >= wanted)
        return [message for _, message in self.of(topic)[-count:]]

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.stack.close()


def raw(bridge, receive_buffer=None):
    """A TCP connection that nothing was said on."""
    client = socket.socket()
    client.settimeout(HANGS_AFTER_S)
    if receive_buffer:
        client.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, receive_buffer)
    client.connect(("127.0.0.1", bridge.port))
    return client


def request(protocol=PROTOCOL):
    """What a WebSocket of the protocol begins with."""
    key = base64.b64encode(os.urandom(16)).decode()
    lines = ["GET / HTTP/1.1", "Host: localhost", "Upgrade: websocket", "Connection: Upgrade", "Sec-WebSocket-Version: 13"]
    lines += [f"Sec-WebSocket-Key: {key}", f"Sec-WebSocket-Protocol: {protocol}", "", ""]
    return "\r\n".join(lines).encode()


def let_in(bridge, **options):
    """A connection behind the handshake, byte by byte; what follows it is unread."""
    client = raw(bridge, **options)
    client.sendall(request())
    answer = b""
    while not answer.endswith(b"\r\n\r\n"):
        answer += client.recv(1)
    assert answer.startswith(b"HTTP/1.1 101"), answer
    return client


def frame(payload, opcode=1, final=True, masked=True, reserved=0, claims=None):
    """A WebSocket frame of a client, right or wrong; it `claims` to be so long."""
    length = len(payload) if claims is None else claims
    head = bytes([final << 7 | reserved << 4 | opcode])
    mask = masked << 7
    if length < 126:
        head += bytes([mask | length])
    elif length < 1 << 16:
        head += bytes([mask | 126]) + struct.pack(">H", length)
    else:
        head += bytes([mask | 127]) + struct.pack(">Q", length)
    # A mask of zeros masks nothing.
    return head + bytes(4 if masked else 0) + payload


def subscription(*channels):
    return json.dumps({"op": "subscribe", "subscriptions": [{"id": i, "channelId": c} for i, c in enumerate(channels)]}).encode()


def read_to_the_end(client):
    """What is still sent before the server closes, however it does."""
    data = b""
    try:
        while part := client.recv(65536):
            data += part
    except ConnectionError:
        pass
    return data
