"""Clients by the hundred that read, never read, come and go, ask without end or do nothing: they cost no image and no torque off.

    cargo build --release --workspace --bins --examples
    TAXEL_BIN_DIR=target/release tests/siege/run storms [--seconds 20] [--short] [--only NAME] [--machine quiet|busy] [--readers-fifo]

A daemon with a simulated hand and servos serves 450 readers at 30 Hz through one storm after the other, on a quiet machine and
beside eight busy loops that it starts and ends itself, with FIFO priority (root, or `LimitRTPRIO`) and without. It prints a row for
each: age of an image when it was sent (ms from when it was due; the daemon's own histogram, over the storm alone), what the readers
were not sent and how long the longest went without an image (the readers' own count), how long "torque off" took to be confirmed,
the daemon's memory and descriptors before and after, and what share of the processors' time a virtual machine's host took for others
("steal"): where it is not 0, ticks are late by whatever the host does. The exit status is 1 where a promise is broken; those are
in `PROMISES`. With `--readers-fifo` the readers have FIFO priority, too, below the daemon's: beside other work on the machine, an image
waits for who is to read it otherwise, and that is what is measured. `--short` is 3 seconds with a tenth of the clients, to see that the command works: then only what
does not depend on time is judged.
"""

import argparse
import json
import multiprocessing
import os
import resource
import selectors
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / "tests"), str(ROOT / "crates/wire/python")]

import taxel_reader  # noqa: E402
from harness.daemon import ask, die_with_parent, eventually, must_be_built  # noqa: E402
from harness.siege import Hand  # noqa: E402

READERS = 450
BUSY_LOOPS = 8
# How much the daemon's memory may grow during a storm, and descriptors after it: pages that come into use late.
SLACK_KIB, SLACK_FDS = 4096, 4

# Name of the storm, what it consists of: kinds of clients and how many, or how many a second.
STORMS = {
    "readers alone": {},
    "never read": {"sleepers": 450},
    "come and go": {"visitors": 5000},
    "status by 16": {"askers": 16},
    "idle control": {"idle": 200},
    "long subscriptions": {"subscribers": 120},
    "refused torque off": {"releasers": 120},
    "torque off by 16": {"changers": 16},
    "all of it": {"sleepers": 450, "visitors": 200, "askers": 16, "idle": 40},
}
# Storm, machine, FIFO: what must hold. Ages in ms, skipped as a share of all.
PROMISES = {
    ("never read", "quiet", True): {"p99.9": 2.0, "skipped": 0.0},
    ("all of it", "quiet", True): {"p99.9": 2.0, "skipped": 0.0},
    ("long subscriptions", "quiet", True): {"skipped": 0.0},
    ("readers alone", "busy", False): {"skipped": 0.01},
}
LONGEST_TORQUE_OFF_MS = 100.0
HEADER = ["storm", "machine", "FIFO", "age p50", "p99", "p99.9", "max", "images", "skipped", "gap ms", "torque off ms", "RSS MiB", "fds", "steal"]


def read_all(path, count):
    """A process of its own: reads with so many connections from its first line of input to the second, and prints what it saw."""
    sockets = [socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET) for _ in range(count)]
    selector = selectors.DefaultSelector()
    for index, connection in enumerate(sockets):
        connection.connect(path)
        connection.setblocking(False)
        selector.register(connection, selectors.EVENT_READ, index)
    selector.register(sys.stdin, selectors.EVENT_READ, None)
    print("connected", flush=True)
    images = skipped = lost = 0
    seen_at, gap, counts = [None] * count, 0.0, False
    packet = bytearray(1 << 17)
    view = memoryview(packet)
    while True:
        for key, _ in selector.select():
            if key.data is None:
                sys.stdin.readline()
                if counts:
                    print(json.dumps({"images": images, "skipped": skipped, "lost": lost, "gap_ms": gap * 1e3}), flush=True)
                    return
                counts, seen_at = True, [None] * count
                continue
            try:
                length = key.fileobj.recv_into(view)
            except BlockingIOError:
                continue
            except ConnectionError:
                length = 0
            if length == 0:
                selector.unregister(key.fileobj)
                lost += 1
            elif counts and packet[8] == 2:
                now = time.monotonic()
                images += 1
                skipped += int.from_bytes(packet[32:36], "little")
                before = seen_at[key.data]
                if before is not None:
                    gap = max(gap, now - before)
                seen_at[key.data] = now


FORK = multiprocessing.get_context("fork")


def release(joint):
    return {"cmd": "servo", "joint": joint, "torque": False}


class Storm:
    """Clients that harm; each kind is a process, so that none waits for another."""

    def __init__(self, daemon, **clients):
        self.images, self.control = str(daemon.images), str(daemon.control_path)
        self.status = str(daemon.folder / "status.sock")
        jobs = {
            "sleepers": self.sleep,
            "visitors": self.visit,
            "askers": lambda n: self.ask(n, self.control, {"cmd": "status"}),
            "releasers": lambda n: self.ask(n, self.status, release("nobody")),
            "changers": lambda n: self.ask(n, self.control, release("joint 2")),
            "subscribers": self.subscribe,
            "idle": self.idle,
        }
        start = lambda job, n: FORK.Process(target=job, args=(n,), daemon=True)  # noqa: E731
        self.over = FORK.Event()
        self.processes = [start(jobs[kind], n) for kind, n in clients.items() if n]

    def __enter__(self):
        for process in self.processes:
            process.start()
        return self

    def __exit__(self, *_):
        self.over.set()
        for process in self.processes:
            process.join(10)
            process.kill()

    def reach(self, path, kind):
        connection = socket.socket(socket.AF_UNIX, kind)
        # Without a timeout: it waits for its turn to be let in, where it would be refused with one.
        connection.connect(path)
        connection.settimeout(5)
        return connection

    def sleep(self, count):
        """Readers that never read; the daemon lets them go after a while, and they come again."""
        while not self.over.is_set():
            fresh = []
            for _ in range(count):
                try:
                    fresh.append(self.reach(self.images, socket.SOCK_SEQPACKET))
                except OSError:
                    pass
            self.over.wait(5)
            for connection in fresh:
                connection.close()

    def visit(self, per_second):
        """Readers that connect and leave."""
        start, visits = time.monotonic(), 0
        while not self.over.is_set():
            if visits > (time.monotonic() - start) * per_second:
                time.sleep(0.002)
                continue
            try:
                self.reach(self.images, socket.SOCK_SEQPACKET).close()
            except OSError:
                time.sleep(0.001)
            visits += 1

    def ask(self, count, path, request):
        """Clients that each pipeline a request as fast as it is answered."""
        batch = json.dumps(request).encode() + b"\n"
        threads = [threading.Thread(target=self.keep_asking, args=(path, 50 * batch)) for _ in range(count)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()

    def keep_asking(self, path, batch):
        while not self.over.is_set():
            try:
                with self.reach(path, socket.SOCK_STREAM) as connection:
                    connection.settimeout(0.2)
                    while not self.over.is_set():
                        try:
                            connection.sendall(batch)
                        except TimeoutError:
                            pass
                        connection.setblocking(False)
                        try:
                            while connection.recv(1 << 20):
                                pass
                        except BlockingIOError:
                            pass
                        connection.settimeout(0.2)
            except OSError:
                time.sleep(0.05)

    def subscribe(self, count):
        """Clients that send the longest subscriptions there are as fast as they are taken: the same part of the hand again and
        again, and in every other one budgets for parts that it does not have. Who is sent away comes again."""
        region = taxel_reader.encode_subscribe({"region": ["index"] * 3600})
        budgets = taxel_reader.encode_subscribe({"profile": {"budgets": {f"p{part}": 1 for part in range(3000)}}})
        clients = [None] * count
        while not self.over.is_set():
            for n, connection in enumerate(clients):
                try:
                    if connection is None:
                        clients[n] = connection = self.reach(self.images, socket.SOCK_SEQPACKET)
                        connection.setblocking(False)
                    connection.send(budgets if n % 2 else region)
                except BlockingIOError:
                    pass
                except OSError:
                    self.part(clients, n)
                    continue
                try:
                    while connection.recv(1 << 17):
                        pass
                    self.part(clients, n)
                except BlockingIOError:
                    pass
                except OSError:
                    self.part(clients, n)
            time.sleep(0.002)

    @staticmethod
    def part(clients, n):
        if clients[n] is not None:
            clients[n].close()
        clients[n] = None

    def idle(self, count):
        """Control clients that say nothing; the daemon may let them go, and they come again."""
        kept = []
        while not self.over.is_set():
            for _ in range(count):
                try:
                    kept.append(self.reach(self.control, socket.SOCK_STREAM))
                except OSError:
                    pass
            self.over.wait(5)
            while kept:
                kept.pop().close()


def torque_off_ms(daemon, in_vain):
    """How long a new client waits until "torque off" is confirmed; infinite where it is not, and why is put `in_vain`."""
    start = time.monotonic()
    try:
        with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as connection:
            connection.settimeout(10)
            connection.connect(str(daemon.control_path))
            reply = ask(connection, release("joint 1"))
    except (OSError, AssertionError) as error:
        reply = {"ok": False, "error": repr(error)}
    if not reply["ok"]:
        in_vain.append(reply["error"])
        return float("inf")
    return (time.monotonic() - start) * 1e3


def sent(daemon):
    """What subscribers were sent so far, as a subscriber is told, whoever crowds the control socket."""
    with taxel_reader.connect(daemon.images, image=False, status=True) as reader:
        while True:
            message = reader.receive()
            if isinstance(message, taxel_reader.Text) and message.header.type == taxel_reader.STATUS:
                return message.json()["images"]["sent"]


def costs(daemon):
    pid = daemon.process.pid
    lines = Path(f"/proc/{pid}/status").read_text().splitlines()
    kib = next(int(line.split()[1]) for line in lines if line.startswith("VmRSS:"))
    return kib, len(os.listdir(f"/proc/{pid}/fd"))


def processor_time():
    """All of it so far, and what the host took for others."""
    with open("/proc/stat") as stat:
        times = [int(time) for time in stat.readline().split()[1:9]]
    return sum(times), times[7]


def read_first():
    """Before a reader's program begins: it goes before all but the daemon."""
    die_with_parent()
    os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(1))


def left_over(daemon, before):
    """Descriptors once those of the storm's clients are closed: of one that was slowed all that was asked is done at its pace."""
    end = time.monotonic() + 60
    while (fds := costs(daemon)[1]) > before + SLACK_FDS and time.monotonic() < end:
        time.sleep(0.05)
    return fds


def quantiles(before, after):
    """Of the ages in ms between two histograms: rows of an age in us and a count."""
    old = dict(map(tuple, before))
    ages = [(us, count - old.get(us, 0)) for us, count in after]
    total = sum(count for _, count in ages)

    def at(share):
        below = 0
        for us, count in ages:
            below += count
            if count and below >= share * total:
                return us / 1e3
        return 0.0

    return [at(0.5), at(0.99), at(0.999), at(1.0)]


class Readers:
    """A process with readers that read all they are sent."""

    def __init__(self, daemon, count, fifo):
        self.process = subprocess.Popen(
            [sys.executable, __file__, "--read", str(daemon.images), str(count)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            preexec_fn=read_first if fifo else die_with_parent,
        )
        assert self.process.stdout.readline() == "connected\n", "the readers did not connect"

    def tell(self, word):
        self.process.stdin.write(word + "\n")
        self.process.stdin.flush()

    def seen(self):
        """What they saw since they were told to count."""
        self.tell("tell")
        return json.loads(self.process.stdout.readline())

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.process.kill()
        self.process.wait()


@contextmanager
def beside(loops):
    """So many busy loops on the machine."""
    loop = [sys.executable, "-c", "while True: pass"]
    loops = [subprocess.Popen(loop, preexec_fn=die_with_parent) for _ in range(loops)]
    try:
        yield
    finally:
        for loop in loops:
            loop.kill()
            loop.wait()


class Seen(NamedTuple):
    """What a daemon and its readers went through in a storm."""

    ages: list  # of images when they were sent, ms: p50, p99, p99.9, max
    readers: dict  # what the readers say
    offs: list  # how long torque off took, ms
    in_vain: list
    costs: tuple  # resident KiB and descriptors, a third into the storm and at its end
    stolen: float  # share of the processors' time, %


def weather(daemon, storm, readers, there, seconds):
    """Measures in the middle of a storm, as soon as so many are there."""
    with storm:
        eventually(lambda: sent(daemon)["subscribers"] >= there, "they do not get in", 60)
        time.sleep(1.0)
        before = sent(daemon)
        readers.tell("count")
        offs, in_vain, costs_before, begun = [], [], None, time.monotonic()
        all_before, taken_before = processor_time()
        while time.monotonic() < begun + seconds:
            if costs_before is None and time.monotonic() > begun + seconds / 3:
                costs_before = costs(daemon)
            offs.append(torque_off_ms(daemon, in_vain))
            time.sleep(0.25)
        all_after, taken_after = processor_time()
        stolen = 100 * (taken_after - taken_before) / max(1, all_after - all_before)
        of_daemon = (costs_before or costs(daemon), costs(daemon))
        seen = readers.seen()
        ages = quantiles(before["ages"], sent(daemon)["ages"])
        return Seen(ages, seen, offs, in_vain, of_daemon, stolen)


def broken_promises(case, seen):
    """Of what depends on time."""
    _, machine, fifo = case
    promise = PROMISES.get(case, {})
    (begins_kib, _), (ends_kib, _) = seen.costs
    skipped = seen.readers["skipped"]
    share, p999 = skipped / max(1, seen.readers["images"] + skipped), seen.ages[2]
    if p999 > promise.get("p99.9", float("inf")):
        yield f"age at send p99.9 is {p999:.2f} ms"
    if share > promise.get("skipped", 1.0):
        yield f"{100 * share:.2f} % skipped"
    if fifo and machine == "quiet" and max(seen.offs) > LONGEST_TORQUE_OFF_MS:
        yield f"torque off took {max(seen.offs):.0f} ms {seen.in_vain}"
    if ends_kib > begins_kib + SLACK_KIB:
        yield f"memory grew by {ends_kib - begins_kib} KiB"


def run(hand, folder, case, seconds, scale, readers_fifo):
    """One row of the table, and which promises are broken. A case is a storm, the machine, and whether there is FIFO priority."""
    storm, machine, fifo = case
    few = lambda n: max(1, n // scale) if n else 0  # noqa: E731
    clients = {kind: few(n) for kind, n in STORMS[storm].items()}
    readers = few(READERS)
    tables = {"socket": {"max_subscribers": 4096}, "realtime": {"priority": 10 if fifo else 0}}
    with hand.daemon(folder, tables, allow_writes=True) as daemon:
        eventually(lambda: daemon.status()["joints"].get("readings"), "no servo")
        fds = costs(daemon)[1]
        with Readers(daemon, readers, readers_fifo) as reading, beside(BUSY_LOOPS if machine == "busy" else 0):
            there = 0.95 * (readers + clients.get("sleepers", 0) + clients.get("subscribers", 0))
            seen = weather(daemon, Storm(daemon, **clients), reading, there, seconds)
        eventually(lambda: sent(daemon)["subscribers"] == 1, "subscribers are left", 30)
        fds_left = left_over(daemon, fds)
    (begins_kib, begins_fds), (ends_kib, ends_fds) = seen.costs
    row = [storm, machine, "yes" if fifo else "no", *(f"{age:.2f}" for age in seen.ages)]
    row += [seen.readers["images"], seen.readers["skipped"], f"{seen.readers['gap_ms']:.0f}", f"{max(seen.offs):.0f}"]
    row += [f"{begins_kib / 1024:.1f} -> {ends_kib / 1024:.1f}", f"{begins_fds} -> {ends_fds} -> {fds_left}", f"{seen.stolen:.1f} %"]
    broken = list(broken_promises(case, seen)) if scale == 1 else []
    if lost := seen.readers["lost"]:
        broken.append(f"{lost} readers that read were let go")
    if fds_left > fds + SLACK_FDS:
        broken.append(f"{fds_left} descriptors are left of {fds}")
    if "panicked" in daemon.log:
        broken.append("it panicked")
    if (lines := len(daemon.log.splitlines())) > 2000:
        broken.append(f"{lines} lines of log")
    daemon.log_path.unlink(missing_ok=True)
    return row, broken


def main():
    if sys.argv[1:2] == ["--read"]:
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        return read_all(sys.argv[2], int(sys.argv[3]))
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seconds", type=float, default=20.0, help="how long each storm is measured")
    parser.add_argument("--short", action="store_true", help="3 seconds, a tenth of the clients, quiet machine, no promises on time")
    parser.add_argument("--only", choices=STORMS, help="one storm alone")
    parser.add_argument("--machine", choices=("quiet", "busy"), help="one of both alone")
    parser.add_argument("--readers-fifo", action="store_true", help="the readers have FIFO priority 1")
    options = parser.parse_args()
    must_be_built("taxeld", "taxel", "examples/servo_bus")
    most = resource.getrlimit(resource.RLIMIT_NOFILE)[1]
    resource.setrlimit(resource.RLIMIT_NOFILE, (most, most))
    seconds, scale = (3.0, 10) if options.short else (options.seconds, 1)
    storms = [options.only] if options.only else list(STORMS)
    machines = [options.machine] if options.machine else ["quiet"] if options.short else ["quiet", "busy"]
    broken = []
    print("| " + " | ".join(HEADER) + " |\n|" + "---|" * len(HEADER), flush=True)
    with tempfile.TemporaryDirectory(prefix="siege-") as folder, Hand(scene="ball-grasp") as hand:
        for machine in machines:
            for fifo in (True, False):
                for storm in storms:
                    row, faults = run(hand, folder, (storm, machine, fifo), seconds, scale, options.readers_fifo)
                    print("| " + " | ".join(map(str, row)) + " |", flush=True)
                    broken += [f"{storm}, {machine}, FIFO {'yes' if fifo else 'no'}: {fault}" for fault in faults]
    for fault in broken:
        print(fault, file=sys.stderr)
    return 1 if broken else 0


if __name__ == "__main__":
    sys.exit(main())
