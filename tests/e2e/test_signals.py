"""What signals do: boards and motors are stopped by every one that ends a process and can be caught."""

import signal

import pytest
from harness.bus import MulticastBuses
from harness.daemon import Daemon, eventually
from harness.joints import SCENE, TICK, TORQUE, WATCHDOG, WRITING, dynamixel, servo
from harness.servos import Servos

ENDING = [
    signal.SIGTERM,
    signal.SIGINT,
    signal.SIGQUIT,
    signal.SIGUSR1,
    signal.SIGUSR2,
    signal.SIGALRM,
    signal.SIGVTALRM,
    signal.SIGPROF,
    signal.SIGXCPU,
    signal.SIGXFSZ,
    signal.SIGIO,
    signal.SIGPWR,
    signal.SIGSTKFLT,
    signal.SIGRTMIN,
    signal.SIGRTMAX,
]


@pytest.mark.parametrize("by", ENDING, ids=lambda by: by.name)
def test_boards_and_motors_are_stopped_by_a_signal_that_ends_the_process(folder, by):
    servos = Servos("--ids", "1-16")
    # A watchdog that would not have acted by the time that it is looked at.
    joints = dynamixel(servos.path, **WRITING)
    with MulticastBuses(1) as ear:
        with Daemon(folder / "d", ear.sources, layout="uskin-module", tick=TICK, joints=joints) as daemon:
            daemon.wait_status(lambda s: s["joints"]["readings"] > 50, "nothing is read")
            assert servo(daemon, "joint 5", "--torque", "on") == (0, "")
            assert servos.register(5, *TORQUE) == 1
            assert daemon.stop(by) == (0 if by in (signal.SIGTERM, signal.SIGINT) else 128 + by)
            assert f"{by.name}: stopping" in daemon.log or "signal " in daemon.log
        heard = []
        while message := ear.buses[0].recv(0.2):
            heard.append((message.arbitration_id, bytes(message.data)))
    # A watchdog that has tripped reads 255; this one was disarmed by whoever switched the motor off.
    assert (servos.register(5, *TORQUE), servos.register(5, *WATCHDOG)) == (0, 0)
    servos.close()
    assert len(heard) > 1 and heard[-1] != heard[0], "the board was not told to stop"
    assert heard[-1][0] == heard[0][0]


@pytest.mark.parametrize("by", [signal.SIGHUP, signal.SIGPIPE, signal.SIGCHLD, signal.SIGWINCH], ids=lambda by: by.name)
def test_a_signal_that_ends_nothing_is_lived_through(folder, by):
    with Daemon(folder / "d", SCENE, tick=TICK) as daemon:
        daemon.process.send_signal(by)
        before = daemon.status()["images"]["made"]
        eventually(lambda: daemon.status()["images"]["made"] > before + 10, "no more images")
        assert daemon.stop() == 0


@pytest.mark.parametrize("by", [signal.SIGABRT, signal.SIGTRAP, signal.SIGSYS], ids=lambda by: by.name)
def test_a_signal_that_tells_of_a_fault_ends_it_at_once_and_motors_stop_by_their_watchdogs(folder, by):
    servos = Servos("--ids", "1-16")
    joints = dynamixel(servos.path, allow_writes=True)
    with Daemon(folder / "d", SCENE, tick=TICK, joints=joints) as daemon:
        daemon.wait_status(lambda s: s["joints"]["readings"] > 50, "nothing is read")
        assert servo(daemon, "joint 5", "--torque", "on") == (0, "")
        assert daemon.stop(by) == -by
        eventually(lambda: servos.stopped_ns(5), "the watchdog does not act")
        # What it has left behind is in nobody's way.
        daemon.start()
    servos.close()
