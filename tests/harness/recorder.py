"""`taxel record` of a daemon as a process, and what is in its file."""

import io
import os
import resource
import signal
import struct
import subprocess
from contextlib import contextmanager, suppress

from harness.daemon import HANGS_AFTER_S, binary, die_with_parent
from mcap.exceptions import EndOfFile
from mcap.reader import NonSeekingReader
from mcap_ros2.decoder import DecoderFactory

SIGNATURE = b"\x89MCAP0\r\n"


def with_room(limit=None):
    """How a process is started on a disk that is full when a file has so many bytes; it ends with the test run."""

    def limited():
        die_with_parent()
        if limit:
            resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))

    # Without signals the limit is told by an error.
    return {"preexec_fn": limited, "restore_signals": False}


class Recorder:
    """`taxel record` of a daemon; what it says is in `said`, and as to the journal where that is asked for."""

    def __init__(self, daemon, out, *arguments, limit=None, stderr=None, as_service=False):
        self.daemon, self.out = daemon, out
        self.log = out.with_suffix(".said")
        with self.log.open("wb") as log:
            found = os.fstat(log.fileno())
            journal = {"JOURNAL_STREAM": f"{found.st_dev}:{found.st_ino}"} if as_service else {}
            self.process = subprocess.Popen(
                [binary("taxel"), "record", out, "--config", daemon.config, *arguments],
                stderr=log if stderr is None else stderr,
                env={**os.environ, **journal},
                **with_room(limit),
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
        return self.process.wait()


@contextmanager
def recording(daemon, out, *arguments, **options):
    recorder = Recorder(daemon, out, *arguments, **options)
    try:
        yield recorder
    finally:
        recorder.process.kill()
        recorder.process.wait()


def longer_each_time():
    """Seconds to record for, until enough has come: how many that takes says how busy the machine is."""
    seconds = 0.5
    while seconds < HANGS_AFTER_S:
        yield seconds
        seconds *= 2
    raise AssertionError(f"not enough has come in {seconds / 2} s")


def taxel(*arguments):
    """Runs a command; what it says on stderr."""
    done = subprocess.run([binary("taxel"), *arguments], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return done.stderr


def whole_records(path):
    """The bytes of a recording that is being written, up to the end of its last whole record; none before there is one."""
    try:
        data = path.read_bytes()
    except FileNotFoundError:
        return b""
    end = len(SIGNATURE)
    # A byte says what a record is, eight behind it how long it is from there.
    while end + 9 <= len(data) and (after := end + 9 + struct.unpack_from("<Q", data, end + 1)[0]) <= len(data):
        end = after
    return data[:end] if end <= len(data) else b""


def is_whole(path):
    """Whether a recording has its end, which is as it begins: the signature."""
    return path.exists() and path.read_bytes()[len(SIGNATURE) :].endswith(SIGNATURE)


def messages(path, *topics):
    """Messages by topic, of these topics or of all, decoded by mcap-ros2-support; also of a file that is being written, or not made yet."""
    decoder, by_topic = DecoderFactory(), {}
    # The reader takes what is torn off in the middle of a record for anything.
    file = io.BytesIO(whole_records(path))
    with suppress(EndOfFile):
        read = NonSeekingReader(file, decoder_factories=[decoder]).iter_decoded_messages(topics or None, log_time_order=False)
        for schema, channel, message, decoded in read:
            by_topic.setdefault(channel.topic, []).append((schema.name, message.log_time, decoded))
    return by_topic


def of_topic(path, topic):
    """Those of one topic."""
    return messages(path, topic).get(topic, [])


def can_frames(path):
    """How many CAN frames are in a recording."""
    return sum(len(block.id) for _, _, block in of_topic(path, "/taxel/can"))


def marks(path):
    """Time and text of the marks in a recording."""
    return [(at_ns, log.msg) for _, at_ns, log in of_topic(path, "/rosout") if log.name == "mark"]
