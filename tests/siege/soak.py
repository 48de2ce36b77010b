"""Hours of everything at once: readers of every kind, control, faults of boards and servos, hands that go and come, reloads.

    cargo build --release --workspace --bins --examples
    TAXEL_BIN_DIR=target/release tests/siege/run soak [--hours 4] [--seed 1] [--clock-steps]

At random, about ten times a second, one of the things in `CHAOS` is done to one daemon, while two readers read on: one takes the
newest image, one every image. Prints a line a minute: images, memory, descriptors, threads. In the end the readers
that read have missed nothing without a word, every frame of each bus is accounted for, memory and descriptors are where they were after
the first tenth, and SIGTERM ends it with 0; otherwise the exit status is 1. `--clock-steps` sets the machine's wall clock an hour
back and forth (root), which disturbs other programs.
"""

import argparse
import random
import signal
import socket
import sys
import tempfile
import threading
import time
from collections import Counter
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / "tests"), str(ROOT / "crates/wire/python")]

import taxel_reader  # noqa: E402
from harness.daemon import eventually, must_be_built  # noqa: E402
from harness.siege import Hand  # noqa: E402

SERVO_FAULTS = ["silent", "bad-crc", "truncated:5", "late:145", "garbage:40", "noise:12"]
ACCOUNTED = ["used", "unknown", "not_data", "commands", "malformed", "queue_overflows", "duplicate", "late", "settling"]
# How much memory may differ from what it was after the first tenth: pages of stacks and buffers that come into use late.
SLACK_KIB = 2048


class Reading(threading.Thread):
    """A reader that reads on, `every` image or the newest, and checks that none is missing without a word."""

    def __init__(self, path, every):
        super().__init__(daemon=True)
        self.path, self.every = path, every
        self.images, self.skipped, self.closed, self.fault = 0, 0, False, None
        self.start()

    def run(self):
        last = None
        try:
            with taxel_reader.connect(self.path, image=True, every=self.every) as reader:
                while True:
                    message = reader.receive()
                    if isinstance(message, taxel_reader.Image):
                        header = message.header
                        if last is not None and header.seq != last + 1 + header.skipped:
                            raise AssertionError(f"image {header.seq} after {last}, {header.skipped} skipped")
                        self.images, self.skipped, last = self.images + 1, self.skipped + header.skipped, header.seq
        except (EOFError, OSError):
            self.closed = True
        except Exception as fault:  # what it found is told at the end
            self.fault = repr(fault)


class Chaos:
    """Things done to the daemon, each whole or begun and ended later."""

    def __init__(self, hand, daemon, chance, clock_steps):
        self.hand, self.daemon, self.chance, self.done = hand, daemon, chance, Counter()
        self.idle, self.slow, self.broken = [], [], set()
        self.things = [self.ask, self.ask, self.flood, self.idle_control, self.come_and_go, self.never_read, self.profile,
                       self.own_profile, self.pause, self.rezero, self.mark, self.servo, self.servo_fault, self.nonsense,
                       self.half_a_request, self.reload, self.bad_frames, self.hand_away]  # fmt: skip
        self.things += [self.step_clock] if clock_steps else []

    def something(self):
        # A hand that goes is away for a second or two, and that not often.
        thing = self.chance.choice(self.things)
        if thing in (self.hand_away, self.rezero, self.reload) and self.chance.random() < 0.9:
            return
        try:
            thing()
        except OSError:
            self.done["turned away"] += 1
        self.done[thing.__name__] += 1

    def connect(self, path, kind=socket.SOCK_STREAM):
        connection = socket.socket(socket.AF_UNIX, kind)
        connection.settimeout(5)
        connection.connect(str(path))
        return connection

    def ask(self):
        self.daemon.control("status")

    def flood(self):
        with self.connect(self.daemon.control_path) as connection:
            connection.setblocking(False)
            for _ in range(200):
                connection.send(b'{"cmd":"status"}\n')

    def idle_control(self):
        self.idle.append(self.connect(self.daemon.control_path))
        if len(self.idle) > 60:
            self.idle.pop(self.chance.randrange(len(self.idle))).close()

    def come_and_go(self):
        for _ in range(20):
            self.connect(self.daemon.images, socket.SOCK_SEQPACKET).close()

    def never_read(self):
        self.slow.append(self.connect(self.daemon.images, socket.SOCK_SEQPACKET))
        if len(self.slow) > 20:
            self.slow.pop(0).close()

    def profile(self):
        with taxel_reader.connect(self.daemon.images) as reader:
            levels, actuators = self.chance.randint(1, 16), self.chance.randint(1, 64)
            reader.subscribe(profile={"levels": levels, "actuators": actuators}, image=True)
            reader.receive(timeout=1.0)

    def own_profile(self):
        self.daemon.control("profile", profile={"levels": self.chance.randint(1, 16), "actuators": 16})

    def pause(self):
        self.daemon.control("pause")
        self.daemon.control("resume")

    def rezero(self):
        self.daemon.control("rezero")

    def mark(self):
        self.daemon.control("mark", text="x" * self.chance.randrange(400))

    def servo(self):
        joint = f"joint {self.chance.choice(list(self.hand.ids))}"
        self.daemon.control("servo", joint=joint, torque=self.chance.random() < 0.5)

    def servo_fault(self):
        id = self.chance.choice(list(self.hand.ids))
        if id in self.broken:
            self.hand.servos.tell(f"mend {id}")
        else:
            self.hand.servos.tell(f"fault {id} {self.chance.choice(SERVO_FAULTS)} {self.chance.randint(1, 5)}")
        self.broken ^= {id}

    def nonsense(self):
        with self.connect(self.daemon.control_path) as control, self.connect(self.daemon.images, socket.SOCK_SEQPACKET) as display:
            control.sendall(self.chance.randbytes(self.chance.randrange(1, 500)) + b"\n")
            display.send(self.chance.randbytes(self.chance.randrange(1, 500)))

    def half_a_request(self):
        with self.connect(self.daemon.control_path) as connection:
            connection.sendall(b'{"cmd":"sta')

    def reload(self):
        self.daemon.process.send_signal(signal.SIGHUP)

    def bad_frames(self):
        self.hand.disturb(self.chance.randbytes(self.chance.randrange(0, 64)) for _ in range(20))

    def hand_away(self):
        self.hand.leave()
        time.sleep(self.chance.uniform(0.1, 2))
        self.hand.come()

    def step_clock(self):
        for step in (3600, -3600):
            time.clock_settime(time.CLOCK_REALTIME, time.time() + step)
            time.sleep(0.05)

    def end(self):
        for connection in self.idle + self.slow:
            connection.close()
        for id in self.broken:
            self.hand.servos.tell(f"mend {id}")


def costs(daemon):
    process = Path(f"/proc/{daemon.process.pid}")
    status = dict(line.split(":", 1) for line in (process / "status").read_text().splitlines())
    return int(status["VmRSS"].split()[0]), len(list((process / "fd").iterdir())), int(status["Threads"])


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--hours", type=float, default=4.0)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--clock-steps", action="store_true")
    options = parser.parse_args()
    must_be_built("taxeld", "taxel", "examples/servo_bus")
    chance, faults = random.Random(options.seed), []
    with tempfile.TemporaryDirectory(prefix="siege-") as folder, Hand() as hand:
        with hand.daemon(folder, allow_writes=True) as daemon:
            chaos = Chaos(hand, daemon, chance, options.clock_steps)
            newest, every = Reading(daemon.images, False), Reading(daemon.images, True)
            began, minute, after_a_tenth = time.monotonic(), 0, None
            while (elapsed := time.monotonic() - began) < options.hours * 3600:
                chaos.something()
                time.sleep(chance.expovariate(10))
                assert daemon.process.poll() is None, f"it ended by itself with {daemon.process.poll()}:\n{daemon.log[-3000:]}"
                if after_a_tenth is None and elapsed > options.hours * 360:
                    after_a_tenth = costs(daemon)
                if elapsed // 60 > minute:
                    minute += 1
                    rss, files, threads = costs(daemon)
                    images = f"{newest.images:8} images  {newest.skipped} skipped"
                    print(f"{minute:4} min  {images}  {rss} KiB  {files} descriptors  {threads} threads", flush=True)
            chaos.end()
            for reading, name in ((newest, "the newest"), (every, "every")):
                if reading.closed or reading.fault or not reading.images:
                    faults.append(f"the reader of {name} image: {reading.fault or 'it was let go'}")
            settled = eventually(lambda: rest(daemon), "its clients do not go", 60)
            status = daemon.status()
            for bus in status["buses"]:
                missing = bus["received"] - sum(bus[kind] for kind in ACCOUNTED)
                if missing:
                    faults.append(f"{missing} frames of {bus['name']} are in no account")
            log_bytes = daemon.log_path.stat().st_size
            if "panicked" in daemon.log:
                faults.append("it panicked:\n" + daemon.log[-3000:])
    before = after_a_tenth
    print(f"done: {', '.join(f'{n} {what}' for what, n in chaos.done.most_common())}")
    print(f"newest: {newest.images} images, {newest.skipped} skipped; every: {every.images} images, {every.skipped} skipped")
    print(f"KiB, descriptors, threads after a tenth {before}, in the end {settled}; {log_bytes} bytes of log")
    if settled[0] > before[0] + SLACK_KIB:
        faults.append(f"memory grew by {settled[0] - before[0]} KiB")
    print("\n".join(faults) or "nothing went wrong")
    sys.exit(bool(faults))


def rest(daemon):
    """What it costs once only the two readers are left."""
    return len(daemon.status()["subscribers"]) <= 2 and costs(daemon)


if __name__ == "__main__":
    main()
