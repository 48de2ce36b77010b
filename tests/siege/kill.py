"""kill -9 at random instants, again and again: the display lets go, the motor stands still, the next daemon starts.

    cargo build --release --workspace --bins --examples
    TAXEL_BIN_DIR=target/release tests/siege/run kill [--times 1000] [--seed 1]

One folder, one simulated hand and one servo bus for all of it, so that each daemon finds what the one before it left: sockets, lock,
boards that send, a servo that refuses goals. Each is killed at a random instant, every third one before it is ready. Where it was
ready, a display read images and a motor ran at 15 % PWM; measured is how long after the kill the display hears that the connection
is closed, and until the motor stands still (by the servo itself). On a machine so busy that the servo heard nothing for its watchdog's
time while the daemon lived, the motor stood before the kill; such lives are counted. The exit status is 1 where a display or a motor
went on, a servo refused for another reason than NOT_YET has, or a start failed.
"""

import argparse
import random
import select
import sys
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / "tests"), str(ROOT / "crates/wire/python")]

import taxel_reader  # noqa: E402
from harness.daemon import eventually, must_be_built  # noqa: E402
from harness.siege import Hand, percentiles, progress  # noqa: E402

WATCHDOG_MS = 100
SERVO, PWM_MODE = 1, 16
PRESENT_PWM = 124, 2
# Why a servo may refuse: the daemon has just started, or the machine is too busy for the answer or for its watchdog.
NOT_YET = [
    "the port of the servos is not open",
    "the servo does not answer",
    "not confirmed in time",
    "after its watchdog has stopped it",
]


def life(hand, daemon, random):
    """One daemon from its start to kill -9. Returns after how many ms the display let go and the motor stood, which is below 0 where
    its watchdog had stopped it before; None where the daemon was killed before it was ready."""
    daemon.spawn()
    if random.random() < 1 / 3:
        time.sleep(random.uniform(0, 0.03))
        daemon.kill()
        return None
    eventually(daemon._answers, lambda: f"it does not start after a kill; its log:\n{daemon.log[-2000:]}")
    with taxel_reader.connect(daemon.images) as display:
        pushed_ns = eventually(lambda: pushed(daemon), lambda: f"no servo: {daemon.log[-2000:]}", seconds=30)
        end = time.monotonic() + random.uniform(0, 0.2)
        while (left := end - time.monotonic()) > 0:
            display.receive(timeout=left)
        killed_ns = time.monotonic_ns()
        daemon.process.kill()
        let_go_ns = closed(display)
    stopped_ns = eventually(lambda: stopped(hand.servos, pushed_ns), "the motor runs on though nobody speaks to it", seconds=5)
    daemon.process.wait()
    return (let_go_ns - killed_ns) / 1e6, (stopped_ns - killed_ns) / 1e6


def stopped(servos, since_ns):
    """When the motor's watchdog stopped it, once it has and the motor stands."""
    at_ns = servos.stopped_ns(SERVO)
    return at_ns if at_ns >= since_ns and servos.register(SERVO, *PRESENT_PWM) == 0 else None


def pushed(daemon):
    """From when on the motor is under PWM; None where it is to be asked again."""
    asked_ns = time.monotonic_ns()
    reply = daemon.control("servo", joint="joint 1", torque=True, pwm_percent=15.0)
    assert reply["ok"] or any(reason in reply["error"] for reason in NOT_YET), reply
    return asked_ns if reply["ok"] else None


def closed(display):
    """Reads what is still in the socket; when the connection was seen to be closed."""
    end = time.monotonic() + 5
    while time.monotonic() < end:
        select.select([display], [], [], 1)
        try:
            display.receive(timeout=0)
        except (EOFError, OSError):
            return time.monotonic_ns()
    raise AssertionError("the display never heard that the daemon was gone")


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--times", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    must_be_built("taxeld", "taxel", "examples/servo_bus")
    chance = random.Random(options.seed)
    displays, motors, early = [], [], 0
    with tempfile.TemporaryDirectory(prefix="siege-") as folder, Hand() as hand:
        hand.servos.tell(f"mode {SERVO} {PWM_MODE}")
        for _ in progress(range(options.times)):
            daemon = hand.daemon(folder, allow_writes=True, watchdog_ms=WATCHDOG_MS, answer_margin_ms=80.0)
            daemon.log_path.unlink(missing_ok=True)
            try:
                measured = life(hand, daemon, chance)
            finally:
                daemon.kill()
            if measured is None:
                early += 1
            else:
                displays.append(measured[0])
                motors.append(measured[1])
        with hand.daemon(folder) as daemon:
            daemon.status()
    print(f"{options.times} kills, {early} of them before it was ready; every next daemon started")
    print(f"display lets go after   {percentiles(displays)} ms")
    ran = [ms for ms in motors if ms >= 0]
    print(f"motor stands still after {percentiles(ran)} ms; its watchdog is {WATCHDOG_MS} ms")
    print(f"{len(motors) - len(ran)} motors stood before the kill, as the machine was too busy to keep them going")


if __name__ == "__main__":
    main()
