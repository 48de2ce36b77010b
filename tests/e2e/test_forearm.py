"""What a gripper that squeezes records, on simulated servos, and what is said of it while it does."""

import json
import math
import os
import signal
import subprocess
import threading
import time

import numpy as np
import pytest
import taxel_reader
from harness.daemon import Daemon, ask, asking_on, binary, die_with_parent, eventually, gathered, reader_of
from harness.gripper import (
    FINGERS,
    GOAL_PWM,
    PRESENT_PWM,
    SCENE,
    TICK,
    TORQUE,
    WATCHDOG,
    control,
    gripper,
    gripping,
    registers,
    torque_on,
    with_potentiometers,
)
from harness.servos import Servos


@pytest.fixture
def servos(folder):
    """Two servos in PWM mode with something springy between them, and potentiometers at `folder / "lines"`."""
    with Servos("--ids", "1-2", "--load", "--potentiometers", folder / "lines") as servos:
        yield servos


def record(daemon, *arguments, stdin=subprocess.DEVNULL):
    sockets = ["--socket", daemon.images, "--control", daemon.control_path]
    return subprocess.Popen(
        [binary("taxel"), "forearm", "record", daemon.folder / "session", *sockets, *map(str, arguments)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        stdin=stdin,
        text=True,
        preexec_fn=die_with_parent,
    )


ONE = ("--places", 1, "--repetitions", 1, "--no-wait")
# To a machine that stands still for a second no servo has answered: a squeeze that is to succeed is made again then.
WHOLE = (*ONE, "--allow-motion", "--again", 10)


def squeezing(servos, process, at_least=0):
    """Waits until both motors are driven."""

    def driven():
        assert process.poll() is None, f"it has ended: {process.communicate()[1]}"
        return registers(servos, TORQUE) == [1, 1] and min(registers(servos, PRESENT_PWM)) > at_least

    eventually(driven, "the gripper does not squeeze")


def filled(angles):
    """Angles of a squeeze; those that a busy machine had none of are between their neighbours."""
    rows, known = np.arange(len(angles)), ~np.isnan(angles)
    return np.interp(rows, rows[known], angles[known])


def test_a_squeeze_is_recorded_as_the_publication_s_files_are(folder, servos):
    with gripping(folder, servos) as daemon:
        out, said = record(daemon, *ONE).communicate()
        assert "nothing moves without --allow-motion" in said and registers(servos, TORQUE) == [0, 0]
        assert not (daemon.folder / "session").exists()
        npz = daemon.folder / "session.npz"
        process = record(daemon, *WHOLE, "--npz", npz)
        out, said = process.communicate()
        assert process.returncode == 0, said
        assert "next is place 0 (0.0 %, the wrist), squeeze 1 of 1" in said
        line = json.loads(out)
        assert line["file"] == str(daemon.folder / "session" / "0" / "distance0_1.mat") and line["samples"] == 95
        assert registers(servos, TORQUE) == [0, 0]
        eventually(lambda: registers(servos, WATCHDOG) == [0, 0], "their watchdogs stay armed")
        with np.load(npz) as arrays:
            data, places = arrays["data"], arrays["location_percent"]
        assert data.shape == (1, 1, 95, 10) and places.tolist() == [0.0]
        time_ms, pwm, left, right = data[0, 0][:, [0, 5, 3, 4]].T
        left, right = filled(left), filled(right)
        assert time_ms[0] == 0 and np.all(np.diff(time_ms) > 0) and time_ms[-1] >= 94 * 121 - 1000
        assert (data[0, 0][:, 6] == pwm).all() and (data[0, 0][:, 8] == -pwm).all()
        assert pwm.argmax() == 50 and 395 <= pwm.max() <= 405 and not pwm[:10].any() and not pwm[90:].any()
        assert np.isnan(data[0, 0][:, [1, 2]]).all(), "there are no potentiometers"
        # Open, pressed in at the peak, still pressed in when the torque sinks, and open again.
        open_deg, touch_deg = 10 * 360 / 4096, 410 * 360 / 4096
        assert left[5] == pytest.approx(open_deg, abs=0.2)
        assert left[50] == pytest.approx(touch_deg + pwm[50] / 4 * 360 / 4096, abs=1.0)
        assert left[55] > left[45] and abs(left[94] - open_deg) < 0.2 and (right > left).all()
        # It is there, and the session at its end; another ramp is another session.
        out, said = record(daemon, *ONE, "--allow-motion").communicate()
        assert out == "" and "all 1 squeezes are there" in said
        process = record(daemon, *ONE, "--allow-motion", "--ramp", "article", "--max-pwm", 92)
        assert "begun with ramp data" in process.communicate()[1] and process.returncode == 1
        process = record(daemon, *ONE, "--allow-motion", "--ramp", "article")
        assert "allow it with --max-pwm 92" in process.communicate()[1] and process.returncode == 2


@pytest.mark.parametrize("how", [signal.SIGKILL, signal.SIGINT])
def test_the_gripper_opens_when_the_recorder_is_killed_and_its_squeeze_is_made_again(folder, servos, how):
    with gripping(folder, servos) as daemon:
        process = record(daemon, *ONE, "--allow-motion")
        squeezing(servos, process, at_least=50)
        process.send_signal(how)
        eventually(lambda: registers(servos, TORQUE) == [0, 0], "the gripper squeezes on")
        _, said = process.communicate()
        if how == signal.SIGINT:
            assert process.returncode == 0 and "stopped" in said and "next is place 0" in said
        assert not list((daemon.folder / "session").glob("*/*"))


def test_the_gripper_opens_when_the_daemon_is_killed(folder, servos):
    with gripping(folder, servos) as daemon:
        process = record(daemon, *ONE, "--allow-motion")
        squeezing(servos, process, at_least=50)
        daemon.kill()
        servos.tell("watchdogs run")
        eventually(lambda: registers(servos, PRESENT_PWM) == [0, 0], "the motors go on without the daemon")
        assert all(servos.stopped_ns(id) for id in FINGERS.values())
        _, said = process.communicate()
        assert process.returncode == 1 and "this squeeze is not kept" in said
        assert "the same command makes it again" in said and "its log says why" in said
        # Nobody has confirmed it.
        assert "its motors may still be on" in said and "let go," not in said and "are let go" not in said
        assert not list((daemon.folder / "session").glob("*/*"))


def test_what_to_do_is_said_where_no_daemon_runs_and_where_it_has_no_servos(folder):
    daemon = Daemon(folder / "d", SCENE, tick=TICK)
    with daemon:
        _, said = record(daemon, *ONE, "--allow-motion").communicate()
        assert "give its configuration a table [joints] with the two servos" in said, said
    _, said = record(daemon, *ONE, "--allow-motion").communicate()
    assert "start it (`taxeld --config FILE`)" in said, said


def test_the_gripper_opens_at_a_fault_of_one_finger(folder, servos):
    # That a finger does not answer is known soon, with all tries.
    with gripping(folder, servos, answer_margin_ms=150.0) as daemon:
        process = record(daemon, *ONE, "--allow-motion")
        squeezing(servos, process)
        servos.tell("fault 2 silent")
        _, said = process.communicate()
        assert process.returncode == 1 and "right: the servo does not answer" in said, said
        eventually(lambda: registers(servos, TORQUE)[0] == 0, "the other finger squeezes on")
        assert not list((daemon.folder / "session").glob("*/*"))


def test_one_records_in_a_folder_at_a_time_and_what_has_come_there_meanwhile_stays(folder, servos):
    with gripping(folder, servos) as daemon:
        one = [*ONE[:-1], "--allow-motion"]
        first = record(daemon, *one, stdin=subprocess.PIPE)
        while "Enter begins" not in (line := first.stderr.readline()):
            assert line, "it has ended"
        second = record(daemon, *one, "--no-wait")
        _, said = second.communicate()
        assert second.returncode == 1 and f"(process {first.pid}) is at work in this folder" in said, said
        there = daemon.folder / "session" / "0" / "distance0_1.mat"
        there.parent.mkdir()
        there.write_bytes(b"somebody else's")
        out, said = first.communicate("\n")
        assert first.returncode == 0 and out == "" and "all 1 squeezes are there" in said, said
        assert there.read_bytes() == b"somebody else's" and registers(servos, TORQUE) == [0, 0]


def test_a_gripper_that_another_program_drives_is_left_to_it(folder, servos):
    with gripping(folder, servos) as daemon, control(daemon) as holder:
        for name in FINGERS:
            torque_on(holder, name, 10_000)
        assert ask(holder, {"cmd": "servos", "pwm_percent": {"left": 20, "right": 20}}) == {"ok": True}
        with asking_on(holder):
            process = record(daemon, *WHOLE)
            _, said = process.communicate()
        assert process.returncode == 1 and f"left: it is driven by user {os.getuid()}, process {os.getpid()}" in said
        assert "made again" not in said and "let go:" not in said, said
        assert registers(servos, TORQUE) == [1, 1] and registers(servos, GOAL_PWM) == [177, 177]
        assert not list((daemon.folder / "session").glob("*/*"))


def test_a_daemon_that_is_slower_than_the_steps_of_a_squeeze_is_refused(folder, servos):
    with Daemon(folder / "d", SCENE, tick={"rate_hz": 5.0}, joints=gripper(servos.path)) as daemon:
        daemon.wait_status(lambda s: s["joints"]["readings"] > 20, "nothing is read")
        process = record(daemon, *WHOLE)
        _, said = process.communicate()
        assert process.returncode == 1 and "a step of this ramp lasts 121 ms; it takes 8.3 frames per second" in said, said
        assert registers(servos, TORQUE) == [0, 0]


def test_a_squeeze_that_a_fault_has_ended_is_made_again_where_that_is_wanted(folder, servos):
    with gripping(folder, servos) as daemon:
        process = record(daemon, *WHOLE)
        squeezing(servos, process)
        servos.tell("fault 2 silent")
        eventually(lambda: registers(servos, TORQUE)[0] == 0, "the other finger squeezes on")
        servos.tell("mend 2")
        out, said = process.communicate()
        assert process.returncode == 0 and "this squeeze is not kept" in said and "made again (1 of 10)" in said, said
        (line,) = map(json.loads, out.splitlines())
        assert line["samples"] == 95 and line["repetition"] == 1
        assert registers(servos, TORQUE) == [0, 0]


def test_a_squeeze_has_the_potentiometers_of_its_fingers_and_ends_when_one_is_lost(folder, servos):
    with Daemon(folder / "d", SCENE, tick=TICK, joints=with_potentiometers(servos, folder / "lines")) as daemon:
        daemon.wait_status(lambda s: s["joints"]["joints"][3]["angle_rad"] is not None, "they are not read")
        npz = daemon.folder / "session.npz"
        process = record(daemon, *WHOLE, "--npz", npz)
        out, said = process.communicate()
        assert process.returncode == 0 and "potentiometers left p and right p" in said, said
        with np.load(npz) as arrays:
            data = arrays["data"][0, 0]
        # 180 degrees are 2048 pulses of the servo, and as many quarters of counts of its potentiometer. On a busy machine one of them
        # is older, or unknown, now and then.
        expected = ((2048 + data[:, 3:5] * 4096 / 360) / 4 - 512) * 0.9
        assert np.nanmedian(np.abs(data[:, 1:3] - expected)) < 2.0
        # Where the machine ends it first, it is made again.
        process = record(daemon, "--places", 1, "--repetitions", 2, "--no-wait", "--allow-motion", "--again", 3)
        squeezing(servos, process)
        servos.tell("line p2 540\\n")
        _, said = process.communicate()
        assert process.returncode == 1 and "the angle of left p is unknown" in said, said
        eventually(lambda: registers(servos, TORQUE) == [0, 0], "it squeezes on")


def taxel(*arguments, **more):
    command = [binary("taxel"), *map(str, arguments)]
    return subprocess.run(command, check=True, capture_output=True, text=True, **more).stdout


def session_of_springy_arms(path):
    """A session of the fingers' own kind of arm: softer from place to place, and where it touches with it.

    The fingers of these tests touch at 400 pulses, as they do at place 6. They move as these do in the rough alone: with four
    squeezes a place they would be told to be another gripper's.
    """
    random, places = np.random.default_rng(1), 13
    data = np.zeros((places, 3, 95, 10))
    pwm = np.array([max(0, 400 - 10 * abs(row - 50)) for row in range(95)], float)
    for place in range(places):
        for squeeze in data[place]:
            at = None
            for row, torque in enumerate(pwm):
                low, high = torque * 0.5 / 2, torque / 0.5 / 2
                at = -400.0 if torque == 0 else min(max(low if at is None else at, low), high)
                touch = 600 - 400 * place / 12
                closed = 10 if torque == 0 else 10 + touch + at
                squeeze[row] = [121 * row, 42, 42, 0, 0, torque, torque, torque, -torque, 0]
                squeeze[row, 3:5] = [closed * 360 / 4096, (closed + 10) * 360 / 4096]
            squeeze[:, 1:5] += random.normal(0, 0.3, (95, 4))
    np.savez(path, data=data, location_percent=np.arange(places) * 100 / 12)


def test_a_gripper_is_told_where_it_holds_while_it_squeezes(folder, servos):
    session, model, estimates = folder / "session.npz", folder / "arm.model", folder / "estimates.sock"
    session_of_springy_arms(session)
    taxel("forearm", "train", session, "--out", model)
    with gripping(folder, servos) as daemon:
        live = subprocess.Popen(
            [binary("taxel"), "forearm", "estimate", "--live", model, "--socket", daemon.images, "--publish", estimates],
            stdout=subprocess.PIPE,
            text=True,
            preexec_fn=die_with_parent,
        )
        published = gathered(reader_of(estimates), taxel_reader.ESTIMATE)
        process = record(daemon, *WHOLE)
        out, said = process.communicate()
        assert process.returncode == 0, said
        eventually(lambda: published and published[-1][1]["ended"], "the last estimate does not come")
        live.kill()
        lines = [json.loads(line) for line in live.stdout]
        live.wait()
        live.stdout.close()
    assert lines == [estimate for _, estimate in published]
    # Those of the squeeze that was kept.
    begins = max(i for i, line in enumerate(lines) if i == 0 or line["samples"] < lines[i - 1]["samples"])
    lines = lines[begins:]
    assert [line["ended"] for line in lines] == [False] * (len(lines) - 1) + [True]
    samples = [line["samples"] for line in lines]
    assert samples == list(range(samples[0], 96)) and samples[0] <= 30, "one at every sample"
    last = lines[-1]
    assert last["low"] <= last["location_percent"] <= last["high"] and last["source"] == "kinesthetic"
    assert abs(last["location_percent"] - 50) < 15
    latency_us = sorted(line["latency_us"] for line in lines)
    print(f"told {latency_us[len(lines) // 2]:.0f} us (median), {latency_us[-1]:.0f} us (most) after the sample")


@pytest.fixture
def arm(folder):
    """A gripper on a simulated forearm, at 50 %, and a daemon that reads both: `taxel sim forearm`."""
    touch, link = folder / "touch.sock", folder / "servos"
    joints = gripper(link)
    with Daemon(folder / "d", [f"pressure:{touch}"], layout="tekscan-6077", tick=TICK, joints=joints) as daemon:
        command = [binary("taxel"), "sim", "forearm", "--to", f"pressure:{touch}", "--servos", link, "--place", "50"]
        daemon.squeezed = subprocess.Popen(command, stdout=subprocess.DEVNULL, preexec_fn=die_with_parent)
        ready = lambda s: s["joints"]["readings"] > 20 and s["missing"] == 0 and not s["problems"]
        daemon.wait_status(ready, "gripper and touch are not read")
        yield daemon
        daemon.squeezed.kill()
        daemon.squeezed.wait()


def test_a_squeeze_is_recorded_with_the_touch_of_each_sample(arm):
    npz = arm.folder / "session.npz"
    process = record(arm, *WHOLE, "--npz", npz)
    out, said = process.communicate()
    assert process.returncode == 0 and ", touch;" in said, said
    assert json.loads(out)["touch"] is True
    beside = np.load(arm.folder / "session" / "0" / "tactile0_1.npy")
    with np.load(npz) as arrays:
        data, tactile = arrays["data"][0, 0], arrays["tactile"][0, 0]
    assert beside.shape == (95, 28, 50) and beside.dtype == np.uint16 and (tactile == beside).all()
    # An image is of the sample it stands beside: it is pressed as the fingers are, a frame or two of the sensor later.
    felt, closed = tactile.sum(axis=(1, 2)), filled(data[:, 3])
    assert felt[50] > 1.5 * felt[5] and abs(float(felt[94]) - float(felt[5])) < 0.1 * felt[5]
    assert np.corrcoef(felt, closed)[0, 1] > 0.9
    # The array falls silent: a squeeze without its touch is not kept, and the session goes on as it was begun.
    process = record(arm, "--places", 1, "--repetitions", 2, "--no-wait", "--allow-motion", "--again", 5)
    eventually(lambda: (arm.status()["joints"]["joints"][0]["angle_rad"] or 0) > 0.5, "it does not squeeze")
    arm.squeezed.send_signal(signal.SIGSTOP)
    _, said = process.communicate()
    assert process.returncode == 1 and "this squeeze is not kept" in said, said
    assert not list((arm.folder / "session" / "0").glob("*0_2*"))
    arm.squeezed.send_signal(signal.SIGCONT)


def test_touch_and_angles_are_fused_live_and_angles_go_on_when_the_array_falls_silent(arm, folder):
    session, model = folder / "simulated.npz", folder / "arm.model"
    taxel("forearm", "simulate", "--out", session, "--repetitions", 3)
    taxel("forearm", "train", session, "--out", model)
    live = subprocess.Popen(
        [binary("taxel"), "forearm", "estimate", "--live", model, "--socket", arm.images],
        stdout=subprocess.PIPE,
        text=True,
        preexec_fn=die_with_parent,
    )
    lines = []
    reader = threading.Thread(target=lambda: lines.extend(json.loads(line) for line in live.stdout), daemon=True)
    reader.start()
    arm.wait_status(lambda s: any(o["pid"] == live.pid and o["every"] for o in s["subscribers"]), "nobody estimates")
    # The sender of touch is one with the servos here: another one takes its place, and is killed.
    with control(arm) as connection:

        def ask_all(requests):
            for request in requests:
                assert ask(connection, request)["ok"], request

        for name in FINGERS:
            torque_on(connection, name, 10_000)
        mark = lambda text: {"cmd": "mark", "text": text}
        ask_all([mark("squeeze")])
        # Every second step of the ramp, and faster: it is phases that are looked at.
        pwm = [max(0, 400 - 20 * abs(row - 25)) for row in range(48)]
        for row, counts in enumerate(pwm):
            percent = counts / 8.85
            ask_all([mark(f"pwm {counts}"), {"cmd": "servos", "pwm_percent": dict.fromkeys(FINGERS, percent)}])
            if row == 30:
                drown(arm)
            # Four images on, with angles that were read since.
            begun, seen = time.monotonic(), arm.status()["images"]["made"]

            def measured(status, begun=begun, seen=seen):
                oldest_ms = max(joint["age_ms"] or math.inf for joint in status["joints"]["joints"])
                return status["images"]["made"] >= seen + 4 and oldest_ms < 1000 * (time.monotonic() - begun)

            arm.wait_status(measured, "the next sample is not measured")
        ask_all([mark("release")])
    eventually(lambda: lines and lines[-1]["ended"], "the last estimate does not come")
    live.kill()
    live.wait()
    sources = [line["source"] for line in lines]
    # Before, too, one of both may be taken alone where they contradict each other.
    silent = len(sources) - sources[::-1].index("fused")
    assert set(sources[silent:]) == {"kinesthetic"} and len(sources) - silent > 10, sources
    for line in (lines[silent - 1], lines[-1]):
        assert abs(line["location_percent"] - 50) < 20, line
        assert line["low"] <= line["location_percent"] <= line["high"]


def drown(arm):
    """Puts a file in the place of the array's socket, which taxeld leaves alone, so that what is sent there arrives no more."""
    path = arm.folder.parent / "touch.sock"
    other = path.with_suffix(".other")
    other.touch()
    other.rename(path)
