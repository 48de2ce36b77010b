"""What signals do: boards and motors are stopped by every one that ends a process and can be caught."""

import os
import signal
import socket
import subprocess
import threading

import pytest
from harness.bus import MulticastBuses
from harness.daemon import HANGS_AFTER_S, Daemon, binary, eventually
from harness.joints import (
    IDS,
    PRESENT_PWM,
    PWM_MODE,
    SCENE,
    TICK,
    TORQUE,
    WRITING,
    comes,
    driven,
    dynamixel,
    servo,
)

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
def test_boards_and_motors_are_stopped_by_a_signal_that_ends_the_process(folder, by, servos):
    with MulticastBuses(1) as ear:
        joints = dynamixel(servos.path, **WRITING)
        with Daemon(folder / "d", ear.sources, layout="uskin-module", tick=TICK, joints=joints) as daemon:
            daemon.wait_status(lambda s: s["joints"]["readings"] > 50, "nothing is read")
            assert servo(daemon, "joint 5", "--torque", "on") == (0, "")
            assert servos.register(5, *TORQUE) == 1
            assert daemon.stop(by) == (0 if by in (signal.SIGTERM, signal.SIGINT) else 128 + by)
            assert f"{by.name}: stopping" in daemon.log or "signal " in daemon.log
        heard = []
        while message := ear.buses[0].recv(0.2):
            heard.append((message.arbitration_id, bytes(message.data)))
    # Its watchdog was disarmed by whoever switched the motor off.
    servos.let_go(5)
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
def test_a_signal_that_tells_of_a_fault_ends_it_at_once_and_motors_stop_by_their_watchdogs(folder, by, servos):
    with driven(folder, servos) as daemon:
        assert servo(daemon, "joint 5", "--torque", "on") == (0, "")
        assert daemon.stop(by) == -by
        servos.tell("watchdogs run")
        eventually(lambda: servos.stopped_ns(5), "the watchdog does not act")
        # What it has left behind is in nobody's way.
        daemon.start()


def test_a_motor_that_a_killed_taxeld_has_left_on_is_switched_off_by_the_next(folder, servos):
    servos.tell(f"mode 5 {PWM_MODE}")
    with driven(folder, servos) as daemon:
        assert servo(daemon, "joint 5", "--torque", "on", "--pwm", "20") == (0, "")
        eventually(lambda: servos.register(5, *PRESENT_PWM) != 0, "the motor does not turn")
        daemon.kill()
    # Before its watchdog has acted.
    with driven(folder, servos) as daemon:
        problem = comes(daemon, "motor-lost", "joint 5", "was left on by a taxeld that was killed", "enabled anew")
        assert problem["severe"]
        eventually(lambda: problem["sentence"] in daemon.log, "the log does not say so")
        servos.let_go(5)
        status, said = servo(daemon, "joint 5", "--pwm", "1")
        assert status == 1 and "was left on by a taxeld that was killed" in said, said
        assert servo(daemon, "joint 5", "--torque", "on") == (0, "")
        daemon.wait_status(lambda s: s["problems"] == [], "it is never over")


@pytest.mark.parametrize("is_abstract", [False, True], ids=["path", "abstract"])
def test_a_service_manager_that_reads_nothing_keeps_no_motor_on_and_is_told_once_it_reads(folder, is_abstract, servos):
    name = f"@{folder}" if is_abstract else str(folder / "notify")
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as manager:
        manager.settimeout(HANGS_AFTER_S)
        manager.bind(name.replace("@", "\0"))

        def fill():
            with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as other, pytest.raises(BlockingIOError):
                while True:
                    other.sendto(b"WATCHDOG=1", socket.MSG_DONTWAIT, manager.getsockname())

        def wait_for(state):
            while manager.recv(4096) != state:
                pass

        fill()
        joints = dynamixel(servos.path, **WRITING)
        with Daemon(folder / "d", SCENE, environment={"NOTIFY_SOCKET": name}, tick=TICK, joints=joints) as daemon:
            daemon.wait_status(lambda s: s["joints"]["readings"] > 50, "nothing is read")
            for switch in ("on", "off", "on"):
                assert servo(daemon, "joint 5", "--torque", switch) == (0, "")
                assert servos.register(5, *TORQUE) == (switch == "on")
            for state in (b"READY=1", b"WATCHDOG=1"):
                wait_for(state)
            fill()
            assert daemon.stop() == 0
            assert servos.register(5, *TORQUE) == 0


def test_no_motor_stays_on_at_the_end_because_other_servos_are_silent(folder, servos):
    with driven(folder, servos, answer_margin_ms=500.0) as daemon:
        for id in IDS:
            assert servo(daemon, f"joint {id}", "--torque", "on") == (0, "")
        for id in range(1, 15):
            servos.tell(f"fault {id} silent")
        daemon.stop()
        # The last that it said may still be on its way to them.
        eventually(lambda: [servos.register(id, *TORQUE) for id in IDS] == [0] * 16, "a motor stays on")


class Manager:
    """A service manager that notes what it is told until that is the end, without a pause, or the next might find no room."""

    def __init__(self, folder):
        self.told = []
        self.socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self.socket.settimeout(HANGS_AFTER_S)
        self.socket.bind(str(folder / "notify"))
        self.environment = {"NOTIFY_SOCKET": self.socket.getsockname()}
        self.reader = threading.Thread(target=self._read, daemon=True)
        self.reader.start()

    def _read(self):
        while b"STOPPING=1" not in self.told:
            self.told.append(self.socket.recv(4096))

    def to_the_end(self):
        """All that it was told."""
        self.reader.join()
        self.socket.close()
        return self.told


def test_a_service_manager_is_told_that_it_stops(folder):
    manager = Manager(folder)
    with Daemon(folder / "d", SCENE, environment=manager.environment, tick=TICK) as daemon:
        assert daemon.stop() == 0
    told = manager.to_the_end()
    assert b"READY=1" in told and told[-1] == b"STOPPING=1"


def test_the_watchdog_is_fed_also_while_no_more_files_may_be_opened(folder):
    manager = Manager(folder)
    with Daemon(folder / "d", SCENE, environment=manager.environment, tick=TICK) as daemon:
        subprocess.run(["prlimit", f"--pid={daemon.process.pid}", "--nofile=3:3"], check=True)
        before = manager.told.count(b"WATCHDOG=1")
        eventually(lambda: manager.told.count(b"WATCHDOG=1") > before + 3, "it is not fed")
        assert daemon.stop() == 0
    assert manager.to_the_end()[-1] == b"STOPPING=1"


def test_a_demo_tells_the_service_manager_of_the_program_that_runs_it_nothing(folder):
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as manager:
        manager.bind(str(folder / "notify"))
        environment = os.environ | {"NOTIFY_SOCKET": manager.getsockname()}
        command = [binary("taxel"), "demo", "--json", "--seconds", "2"]
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL, env=environment)
        with pytest.raises(BlockingIOError):
            manager.recv(4096, socket.MSG_DONTWAIT)
