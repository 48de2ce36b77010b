"""The unit as it is installed, all of its filters active, under a real systemd."""

import grp
import json
import os
import shutil
import stat
import subprocess
import urllib.request
from pathlib import Path

import taxel_reader
from harness.daemon import eventually
from harness.lockstep import next_image
from harness.service import Held, Service, run, systemctl



def fields(pid):
    """What the kernel says of a process."""
    with open(f"/proc/{pid}/status") as lines:
        return dict(line.rstrip("\n").split(":\t", 1) for line in lines if ":\t" in line)


def is_served(service):
    with taxel_reader.connect(service.images) as reader:
        next_image(reader)


def links(status):
    return [bus["link"] for bus in status["buses"]]


def test_it_is_ready_as_its_own_user_without_any_capability_and_in_real_time(service):
    service.start()
    assert service.show("SubState") == "running"
    status = fields(service.pid)
    assert "0" not in status["Uid"].split() and int(status["CapBnd"], 16) == int(status["CapEff"], 16) == 0
    assert status["NoNewPrivs"] == "1" and status["Seccomp"] == "2"
    is_served(service)
    policy = os.sched_getscheduler(service.thread("tick")) & ~os.SCHED_RESET_ON_FORK
    assert policy == os.SCHED_FIFO, service.newest()
    assert int(status["VmLck"].split()[0]) > 0, service.newest()
    for name, group in (("images", "tactile"), ("status", "tactile"), ("control", "tactile-control")):
        found = (service.runtime / f"{name}.sock").stat()
        assert (grp.getgrgid(found.st_gid).gr_name, stat.S_IMODE(found.st_mode)) == (group, 0o660)
    eventually(lambda: "Hz (timer)" in service.show("StatusText"), "systemctl status shows no line", rest=2)
    service.wait_journal("bus is up", "--priority", "info")
    assert "bus is up" not in service.journal("--priority", "warning")


def test_its_exposure_is_as_low_as_it_was(service):
    for unit in ("taxeld.service", "taxeld@hand.service"):
        judged = run("systemd-analyze", "security", "--no-pager", "--threshold=14", unit)
        assert judged.returncode == 0, judged.stdout + judged.stderr


def test_stopped_it_ends_well_and_leaves_nothing(service):
    service.start()
    service.stop()
    assert (service.show("Result"), service.show("ExecMainStatus")) == ("success", "0"), service.newest()
    assert not service.runtime.exists()


def test_killed_it_is_started_again(service):
    service.start()
    os.kill(service.pid, 9)
    service.wait_restarts(1)
    is_served(service)


def test_a_tick_that_hangs_is_caught_by_the_watchdog(service):
    service.start()
    with Held(service.thread("tick")):
        service.wait_restarts(1)
    service.wait_journal("Watchdog timeout")
    is_served(service)


def test_a_bus_that_is_unplugged_trips_nothing_and_is_taken_up_again(service, buses):
    service.start()
    pid = service.pid
    service.wait_status(lambda s: links(s) == ["up", "up"], "not every bus is up")
    buses.delete(1)
    service.wait_status(lambda s: links(s) == ["up", "absent"], "the interface is not missed")
    service.wait_status(lambda s: "link-absent" in {problem["kind"] for problem in s["problems"]}, "nobody is told")
    buses.create(1)
    service.wait_status(lambda s: links(s) == ["up", "up"], "the interface is not taken up")
    assert (service.pid, service.show("NRestarts")) == (pid, "0")


def test_a_reload_takes_up_the_profile_and_loses_no_subscriber(service, buses):
    # The reader takes nothing while the service is reloaded, which takes seconds on a busy machine.
    patient = {"mode": "0660", "group": "tactile", "stall_ms": 60_000}
    service.configure(sources=buses.sources, socket=patient)
    service.start()
    pid = service.pid
    with taxel_reader.connect(service.images) as reader:
        next_image(reader)
        service.configure(sources=buses.sources, profile={"levels": 3}, socket=patient)
        systemctl("reload", service.unit, check=True)
        eventually(lambda: service.control("profile")["profile"]["levels"] == 3, service.newest, rest=2)
        service.configure(sources=buses.sources, profile={"levels": 0}, socket=patient)
        assert systemctl("reload", service.unit).returncode != 0
        service.wait_journal("levels = 0")
        before = next_image(reader).seq
        eventually(lambda: next_image(reader).seq > before, "no more images")
    assert (service.pid, service.control("profile")["profile"]["levels"]) == (pid, 3)


def test_a_configuration_that_is_wrong_is_not_started_again(service):
    service.config.write_text("layout = 3\n")
    assert service.start(check=False).returncode != 0
    assert (service.show("ExecMainStatus"), service.show("NRestarts")) == ("78", "0")
    assert service.show("ActiveState") == "failed"
    service.wait_journal(f"{service.config}:1", "--priority", "err")


def test_several_hands_are_several_services(service, buses):
    hands = [Service("taxeld@left"), Service("taxeld@right")]
    for hand, source in zip(hands, buses.sources):
        hand.configure(sources=[source], layout="uskin-module")
        hand.start()
    for hand in hands:
        is_served(hand)
    left, right = hands
    left.stop()
    assert not left.runtime.exists()
    is_served(right)
    for hand in hands:
        hand.stop()
        hand.clean()


def test_what_runs_beside_it_records_within_its_bounds_and_answers_who_asks_for_metrics(service):
    beside = [Service("taxel-record"), Service("taxel-metrics")]
    recorder, metrics = beside
    recorder.add(Environment='"OPTIONS=--split-seconds 2 --most-files 2"')
    for program in beside:
        program.start()
    recorder.wait_journal("waiting for it", "--priority", "warning")
    metrics.wait_journal("metrics at http://", "--priority", "info")
    assert "metrics at http://" not in metrics.journal("--priority", "warning")
    service.start()
    folder = Path("/var/lib/taxel-record")
    eventually(lambda: (folder / "taxeld-0004.mcap").exists(), recorder.newest)
    def is_up():
        with urllib.request.urlopen("http://127.0.0.1:9464/metrics") as answer:
            return b"taxeld_up 1" in answer.read().splitlines()

    eventually(is_up, metrics.newest, rest=2)
    for program in beside:
        assert (program.show("NRestarts"), fields(program.pid)["Seccomp"]) == ("0", "2")
        program.stop()
        assert program.show("Result") == "success", program.newest()
    # While it ran, it would have removed another one at any time.
    files = sorted(folder.iterdir())
    assert "taxeld-0001.mcap" not in {file.name for file in files}
    for found, mode in [(folder, 0o750), (files[-1], 0o640)]:
        assert (found.owner(), found.group()) == ("taxel-record", "tactile")
        assert stat.S_IMODE(found.stat().st_mode) == mode
    recorder.clean()


def test_a_bus_on_the_network_is_refused_with_what_to_do_and_works_when_that_is_done(service):
    subprocess.run(["ip", "link", "set", "lo", "multicast", "on"], check=True)
    service.configure(sources=[f"udp:239.74.163.2:{port}?interface=lo&hops=0" for port in (43113, 43114)])
    assert service.start(check=False).returncode != 0
    assert (service.show("ExecMainStatus"), service.show("NRestarts")) == ("78", "0")
    service.wait_journal("taxeld-network.conf", "--priority", "err")
    service.add_text(Path("/usr/share/doc/taxeld/examples/taxeld-network.conf").read_text())
    systemctl("reset-failed", service.unit)
    service.start()
    service.wait_status(lambda s: links(s) == ["up", "up"], "no bus on the network")


def test_whoever_takes_over_its_process_has_no_network_and_can_write_nowhere_but_in_its_folder(service):
    program = Path("/usr/local/lib/taxel-probe.py")
    shutil.copy(Path(__file__).with_name("probe.py"), program)
    # As the unit is, but for what is run.
    service.add_text(
        "[Service]\nType=oneshot\nWatchdogSec=0\nRestart=no\nExecStart=\n"
        f"ExecStart=/usr/bin/python3 -I {program} {os.getpid()}\n"
    )
    service.start()
    line = service.wait_journal('{"sockets"')
    found = json.loads(next(text for text in line.splitlines() if text.startswith('{"sockets"')))
    opened = {name for name, outcome in found["sockets"].items() if outcome == "done"}
    assert opened == {"unix", "can"}
    assert found["writable"] == [str(service.runtime)]
    assert {name for name, outcome in found["acts"].items() if outcome == "done"} == set(), found["acts"]
    assert found["other processes"] == [] and found["home"] != "done"
