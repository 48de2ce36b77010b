"""Joint angles: simulated servos on a pseudo terminal, through the real taxeld, to `taxel watch`."""

import json
import math
import re
import subprocess
import time
from statistics import median

import pytest
from harness.daemon import HANGS_AFTER_S, Daemon, ask, binary, connect, eventually, read_reply, told_once_each_time
from harness.joints import (
    GOAL_PWM,
    IDS,
    PRESENT_PWM,
    PWM_MODE,
    SCENE,
    TICK,
    TORQUE,
    WATCHDOG,
    WRITING,
    Watch,
    all_known,
    comes,
    driven,
    dynamixel,
    joint_of,
    refused,
    servo,
)
from harness.servos import Servos

PULSE_RAD = math.tau / 4096
LATE = "late:395"  # far beyond the margin of answers, 100 ms, also where the reader is held up


def others_go_on(daemon, watch, but, unknown):
    """Servo `but` takes nothing from the others: they are read in the daemon's cycles, and known in every image.

    `unknown` says whether its own angle is; None that it may be. On a busy machine the servos themselves answer late now and
    then, and are not known for a while: so it holds for longer than an angle is held, at some time.
    """
    end = time.monotonic() + HANGS_AFTER_S
    hidden = True
    while hidden:
        assert time.monotonic() < end, f"one servo hides others, all the {HANGS_AFTER_S} s"
        before, images, after = daemon.status()["joints"], watch.more(150), daemon.status()["joints"]
        cycles = after["cycles"] - before["cycles"]
        reads = [after["joints"][id - 1]["readings"] - before["joints"][id - 1]["readings"] for id in IDS if id != but]
        others = [[angle for id, angle in zip(IDS, image["joints"]) if id != but] for image in images]
        hidden = min(reads) <= cycles / 2 or any(None in angles for angles in others)
    assert all(angles[-1] == pytest.approx(160 * PULSE_RAD, abs=1e-6) for angles in others)
    assert unknown is None or all((image["joints"][but - 1] is None) == unknown for image in images)


def images_while_the_bus_is_read(daemon, watch, count):
    """`count` images of times in which the servos were read a hundred times a second, as they are configured to be.

    A busy machine holds up the servos or the reader now and then: what the daemon knew then is older.
    """
    images, end = [], time.monotonic() + HANGS_AFTER_S
    while len(images) < count:
        assert time.monotonic() < end, f"in {HANGS_AFTER_S} s the bus kept its rate for {len(images)} of {count} images"
        before, began_ns = daemon.status(), time.monotonic_ns()
        watch.until(lambda image: image["t_ns"] > began_ns + 200_000_000, "no image comes")
        ended_ns, after = time.monotonic_ns(), daemon.status()
        if after["joints"]["cycles"] - before["joints"]["cycles"] > 90 * (after["uptime_s"] - before["uptime_s"]):
            images += [image for image in watch.lines if began_ns < image["t_ns"] < ended_ns]
    return images


def test_angles_are_those_of_the_images_own_instant(folder):
    servos = Servos("--ids", "1-16", "--motion", "sine")
    amplitude = 500 * PULSE_RAD
    # A line through two readings 10 ms apart, carried on for 15 ms, misses a sine of 1 Hz by at most this; and rounding
    # to whole pulses is carried on with it.
    bound = amplitude * math.tau**2 / 2 * 0.015 * 0.025 + 2 * PULSE_RAD
    with Daemon(folder / "d", SCENE, tick=TICK, joints=dynamixel(servos.path)) as daemon, Watch(daemon) as watch:
        watch.until(all_known, "not every angle became known")
        errors, newest = [], []
        for image in images_while_the_bus_is_read(daemon, watch, 150):
            for id, angle in zip(IDS, image["joints"]):
                at = lambda t_ns: amplitude * math.sin(math.tau * t_ns * 1e-9 + id)
                errors.append(abs(angle - at(image["t_ns"])))
                newest.append(abs(at(image["t_ns"] - 10_000_000) - at(image["t_ns"])))
        print(f"median error {median(errors):.5f} rad, bound {bound:.5f}; of angles 10 ms old {median(newest):.5f}")
        assert median(errors) < bound
        # The bound is worth something: angles that are one cycle old would not meet it.
        assert median(newest) > 2 * bound

        def is_well(status):
            joints, first = status["joints"], status["joints"]["joints"][0]
            is_read = joints["state"] == "connected" and joints["cycle_hz"] > 10
            return is_read and first["state"] == "answers" and first["age_ms"] < 250

        joints = daemon.wait_status(is_well, "no cycles")["joints"]
        assert joints["writes"] == "never" and joints["fast_sync_read"] != "off"
        first = joints["joints"][0]
        assert first["name"] == "joint 1" and first["hardware_error"] is None
        assert first["temperature_c"] == 31 and first["model"] == "XM430-W210"
        assert "all 16 servos answer" in eventually(lambda: "servos answer" in daemon.log and daemon.log, "no roll call")
    servos.close()


def test_a_joint_of_the_layout_that_nobody_reads_is_warned_of_once(folder, servos):
    command = [binary("taxel"), "layouts", "uskin-module", "--file"]
    layout = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    (folder / "own.toml").write_text(layout.replace("[[module]]\n", '[[module]]\njoint = "jiont 3"\n', 1))
    hand = {"layout": str(folder / "own.toml"), "joints": dynamixel(servos.path)}
    with Daemon(folder / "d", ["sim:roll"], tick=TICK, **hand) as daemon, Watch(daemon) as watch:
        eventually(lambda: "all 16 servos answer" in daemon.log, "no roll call")
        watch.more(10)
        sentence = "sit on joints that [joints] does not read: `jiont 3` (there is `joint 3`)"
        assert [line for line in daemon.log.splitlines() if "WARN" in line and sentence in line] != []
        assert daemon.log.count(sentence) == 1, daemon.log


def test_a_dead_servo_is_unknown_and_named_and_the_others_go_on(folder, servos):
    with Daemon(folder / "d", SCENE, tick=TICK, joints=dynamixel(servos.path)) as daemon, Watch(daemon) as watch:
        watch.until(all_known, "not every angle became known")
        eventually(lambda: "all 16 servos answer" in daemon.log, "no roll call")
        servos.tell("fault 5 silent")
        watch.until(lambda image: image["joints"][4] is None, "a dead servo's angle stays known")
        others_go_on(daemon, watch, but=5, unknown=True)
        dead = joint_of(daemon, 5)
        assert dead["angle_rad"] is None and dead["age_ms"] > 250 and dead["timeouts"] >= 2
        assert "silent" in dead["state"] or "no answer" in dead["state"]
        eventually(lambda: joint_of(daemon, 6)["state"] == "answers", "it hides another")
        eventually(lambda: "servo joint 5 (id 5) is silent" in daemon.log, "the log does not name it")

        servos.tell("error 9 32")
        eventually(lambda: joint_of(daemon, 9)["hardware_error"] == "overload", "no hardware error in the status")
        eventually(lambda: "servo joint 9 (id 9) reports a hardware error: overload" in daemon.log, "nor in the log")
        alerts = lambda joint: joint["angle_rad"] is not None and joint["alerts"] > 0  # noqa: E731
        eventually(lambda: alerts(joint_of(daemon, 9)), lambda: joint_of(daemon, 9))

        servos.tell("mend 5")
        watch.until(all_known, "a mended servo's angle stays unknown")
        eventually(lambda: "servo joint 5 (id 5) answers again" in daemon.log, "the log does not say that it is back")
        assert told_once_each_time(daemon.log, "joint 5 (id 5) is silent;")
        assert told_once_each_time(daemon.log, "joint 5 (id 5) answers again")


@pytest.mark.parametrize(
    ("fault", "counter"),
    [("truncated:9", "timeouts bad_crc"), ("bad-crc", "bad_crc"), (LATE, "late"), ("garbage:40", None), ("noise:30", None)],
)
@pytest.mark.parametrize("fast", ["off", "auto"])
def test_damaged_and_late_answers_are_counted_and_never_become_wrong_angles(folder, fault, counter, fast, servos):
    joints = dynamixel(servos.path, fast_sync_read=fast)
    with Daemon(folder / "d", SCENE, tick=TICK, joints=joints) as daemon, Watch(daemon) as watch:
        watch.until(all_known, "not every angle became known")
        servos.tell(f"fault 3 {fault} 3")
        for image in watch.more(100):
            for id, angle in zip(IDS, image["joints"]):
                assert angle is None or angle == pytest.approx(10 * id * PULSE_RAD, abs=1e-6), f"servo {id}"
        others = watch.until(lambda image: all(a is not None for a in image["joints"][3:]), "one servo hides others")
        assert others
        # The rest of half a packet is missed, or the next servo's bytes are taken for it.
        # In one packet for all, what is damaged of one is asked for again in the same cycle.
        names = counter.split() if counter and fast == "off" else []
        counted = lambda joints: joints["readings"] > 100 and (not names or sum(joints[name] for name in names) > 0)  # noqa: E731
        daemon.wait_status(lambda s: counted(s["joints"]), f"no {counter} is counted")
        servos.tell("mend 3")
        watch.until(all_known, "a mended servo's angle stays unknown")


@pytest.mark.parametrize(
    ("kind", "severe", "fault", "mend", "words", "over"),
    [
        ("servo-silent", True, "fault 5 silent", "mend 5", ["joint 5 (id 5) is silent", "power and cable"], "joint 5 (id 5) answers again"),
        ("servo-late", False, f"fault 5 {LATE}", "mend 5", ["joint 5 (id 5)", "after its deadline", "answer_margin_ms"], "answers in time"),
        ("servo-damaged", False, "fault 5 bad-crc", "mend 5", ["joint 5 (id 5)", "damaged (CRC)", "two servos with one id"], "are whole"),
        ("two-servos-one-id", True, "fault 5 twice", "mend 5", ["2 servos answer with the id of servo joint 5 (id 5)", "unplug all but one"], "one servo answers with the id"),
        ("servo-error", True, "error 5 4", "error 5 0", ["joint 5 (id 5)", "overheating", "Let it cool down"], "no hardware error any more"),
    ],
)
def test_what_is_wrong_with_a_servo_is_a_problem_in_words_and_is_over_when_it_is_mended(folder, kind, severe, fault, mend, words, over, servos):
    joints = dynamixel(servos.path, fast_sync_read="off")
    with Daemon(folder / "d", SCENE, tick=TICK, joints=joints) as daemon, Watch(daemon) as watch:
        watch.until(all_known, "not every angle became known")
        daemon.wait_status(lambda s: s["problems"] == [], "there are problems")
        servos.tell(fault)
        problem = comes(daemon, kind, "joint 5", *words)
        assert (problem["bus"], problem["module"], problem["severe"]) == (None, None, severe)
        # (On a busy machine another one may be late for a moment.)
        of_joints = lambda: [joint["problems"] for joint in daemon.status()["joints"]["joints"][3:5]]  # noqa: E731
        eventually(lambda: of_joints() == [[], [kind]], of_joints)
        # A servo whose every answer is late answers now and then in the end; its silence is not told beside.
        daemon.report(1)
        own = lambda: [p for p in daemon.status()["problems"] if p["joint"] == "joint 5"]  # noqa: E731
        eventually(lambda: {p["kind"] for p in own()} == {kind}, lambda: f"not that alone: {own()}")
        others_go_on(daemon, watch, but=5, unknown=None)

        def of_doctor():
            command = [binary("taxel"), "doctor", "--json", "--config", daemon.config]
            checks = json.loads(subprocess.run(command, capture_output=True, text=True).stdout)["checks"]
            found = [c for c in checks if "joint 5" in c["object"] + c["found"]]
            return found if [c["name"] for c in found] == [kind] else []

        # What the daemon tells, the doctor tells once, in the same words; its numbers are those of another moment.
        (found,) = eventually(of_doctor, "the doctor does not tell that alone")
        now = eventually(lambda: own()[:1], "it is not told any more")[0]
        but_numbers = lambda sentence: re.sub(r"\d+(\.\d+)?", "N", sentence)
        assert (found["name"], found["object"], but_numbers(found["found"])) == (kind, "joint 5", but_numbers(now["sentence"]))
        assert found["state"] == ("error" if severe else "warning")
        servos.tell(mend)
        mended = time.monotonic()
        daemon.wait_status(lambda s: s["problems"] == [], "it is never over")
        print(f"RECOVERY {kind}: {time.monotonic() - mended:.2f} s")
        eventually(lambda: over in daemon.log, "the log does not say that it is over")
        said = but_numbers(problem["sentence"].split(";")[0].split(",")[0])
        assert told_once_each_time(but_numbers(daemon.log), said), daemon.log
        eventually(lambda: over in watch.notices, "taxel watch does not say so")


def test_a_supply_that_is_off_is_one_problem_and_not_sixteen(folder, servos):
    with Daemon(folder / "d", SCENE, tick=TICK, joints=dynamixel(servos.path)) as daemon, Watch(daemon) as watch:
        watch.until(all_known, "not every angle became known")
        for id in IDS:
            servos.tell(f"fault {id} silent")
        assert comes(daemon, "servos-silent", None, "no servo answers", "baud = 1000000")["severe"]
        daemon.report(1)
        assert [p["kind"] for p in daemon.status()["problems"]] == ["servos-silent"]
        for id in IDS:
            servos.tell(f"mend {id}")
        daemon.wait_status(lambda s: s["problems"] == [], "it is never over")
        watch.until(all_known, "not every angle is known again")


def test_nothing_is_written_unless_the_configuration_says_so(folder, servos):
    before = [servos.register(5, *at) for at in (WATCHDOG, TORQUE, GOAL_PWM)]
    with Daemon(folder / "d", SCENE, tick=TICK, joints=dynamixel(servos.path)) as daemon:
        assert daemon.wait_status(lambda s: s["joints"]["readings"] > 50, "nothing is read")["joints"]["writes"] == "never"
        for arguments in [("--torque", "on"), ("--torque", "off"), ("--pwm", "10")]:
            status, said = servo(daemon, "joint 5", *arguments)
            assert status == 1 and "joints.allow_writes = true" in said, said
    assert [servos.register(5, *at) for at in (WATCHDOG, TORQUE, GOAL_PWM)] == before
    with Daemon(folder / "none", SCENE, tick=TICK) as daemon:
        assert "no table [joints]" in daemon.control("servo", joint="joint 5", torque=True)["error"]


def test_torque_and_pwm_are_written_on_request_with_the_watchdog_armed(folder, servos):
    joints = dynamixel(servos.path, **WRITING | {"answer_margin_ms": 150.0})
    joints["servo"][5]["direction"] = -1
    with Daemon(folder / "d", SCENE, tick=TICK, joints=joints) as daemon, Watch(daemon) as watch:
        watch.until(all_known, "not every angle became known")
        assert (daemon.status()["joints"]["writes"], daemon.status()["joints"]["watchdog_ms"]) == ("allowed", 2540)
        refusals = [
            (("joint 5", "--pwm", "10"), "enable its torque first"),
            (("thumb", "--torque", "on"), "no joint is called thumb; there are joint 1, joint 2"),
            (("joint 5", "--pwm", "-101"), "outside -100 to 100"),
            (("joint 5", "--torque", "off", "--pwm", "3"), "--pwm goes with --torque on"),
        ]
        for arguments, words in refusals:
            status, said = servo(daemon, *arguments)
            assert status == (2 if "off" in arguments else 1) and words in said, said
        assert servos.register(5, *TORQUE) == 0

        for name, id, goal in [("joint 5", 5, -177), ("joint 6", 6, 177)]:
            assert servo(daemon, name, "--torque", "on") == (0, "")
            assert (servos.register(id, *WATCHDOG), servos.register(id, *TORQUE)) == (127, 1)
            assert servo(daemon, name, "--pwm", "-20") == (0, "")
            assert servos.register(id, *GOAL_PWM) == goal
        assert [servos.register(id, *TORQUE) for id in (4, 7)] == [0, 0]
        torque = lambda s: [j["torque_enabled"] for j in s["joints"]["joints"][3:7]]
        assert torque(daemon.status())[1:3] == [True, True], "what is confirmed is not told at once"
        enabled = lambda s: torque(s) == [False, True, True, False]
        status = daemon.wait_status(enabled, "the status does not say whose torque is on")["joints"]
        assert (status["writes_ok"], status["writes_failed"]) == (10, 0)
        eventually(lambda: "torque of joint 5 is on" in daemon.log, "the log does not say so")

        servos.tell("fault 6 silent")
        status, said = servo(daemon, "joint 6", "--pwm", "1")
        assert status == 1 and "joint 6: the servo does not answer" in said, said
        servos.tell("mend 6")
        assert servo(daemon, "joint 5", "--torque", "off") == (0, "")
        assert servos.register(5, *TORQUE) == 0
        servos.let_go(5)
        assert daemon.status()["joints"]["joints"][4]["torque_enabled"] is False
        watch.until(all_known, "writing hides angles")
    # The daemon has ended, and with it all that it had switched on.
    servos.let_go(6)

    servos.tell(f"mode 5 {PWM_MODE}")
    with Daemon(folder / "d", SCENE, tick=TICK, joints=joints) as daemon:
        daemon.wait_status(lambda s: s["joints"]["readings"] > 50, "nothing is read")
        assert servo(daemon, "joint 5", "--torque", "on") == (0, "")
        assert servo(daemon, "joint 5", "--pwm", "-20") == (0, "")
        turning = lambda: servos.register(5, *PRESENT_PWM) != 0
        eventually(turning, "the motor does not turn")
        daemon.kill()
    servos.tell("watchdogs run")
    # Nobody speaks on the bus any more, and the motor stands within its watchdog.
    eventually(lambda: servos.register(5, *PRESENT_PWM) == 0, "the motor goes on without its daemon")
    assert servos.stopped_ns(5) > 0
    servos.tell("watchdogs hold")
    with Daemon(folder / "d", SCENE, tick=TICK, joints=joints) as daemon:
        # A servo that has heard nothing for so long has stopped its motor, and takes no goal.
        daemon.wait_status(lambda s: s["joints"]["readings"] > 50, "nothing is read")
        assert servos.register(5, *WATCHDOG) % 256 == 255
        assert comes(daemon, "motor-stopped", "joint 5", "Enable its torque anew")["severe"]
        assert daemon.status()["joints"]["joints"][4]["watchdog_tripped"] is True
        assert servo(daemon, "joint 5", "--pwm", "10")[0] == 1
        assert servo(daemon, "joint 5", "--torque", "on") == (0, "")
        assert servos.register(5, *WATCHDOG) == 127
        daemon.wait_status(lambda s: s["problems"] == [], "it is never over")
        servos.close()
        daemon.wait_status(lambda s: s["joints"]["state"] == "gone", "the status does not say that it is gone")
        status, said = servo(daemon, "joint 5", "--torque", "off")
        assert status == 1 and servos.path in said, said


def test_a_motor_that_does_not_confirm_that_it_is_off_is_told_again_and_said_to_be_off_when_it_does(folder, servos):
    again = "it is told again until it confirms that"
    off = {5: "torque of joint 5 is off", 6: "torque of joint 6 is off, since who held it is gone"}
    # Two servos that are told three times each must not answer within the two seconds for which the daemon waits.
    with driven(folder, servos, answer_margin_ms=150.0) as daemon:
        assert servo(daemon, "joint 5", "--torque", "on") == (0, "")
        with connect(daemon.control_path) as holder:
            assert ask(holder, {"cmd": "servo", "joint": "joint 6", "torque": True, "hold_ms": 10_000})["ok"]
            for id in off:
                servos.tell(f"fault {id} silent")
        status, said = servo(daemon, "joint 5", "--torque", "off")
        assert status == 1 and "the servo does not answer" in said and again in said, said
        for id in off:
            assert comes(daemon, "motor-not-off", f"joint {id}", "is told again")["severe"]
        held = "torque of joint 6 is to be off, since who held it is gone: the servo does not answer"
        eventually(lambda: held in daemon.log and daemon.log.count(again) >= 2, "the log does not say that it may be on")
        assert not any(line in daemon.log for line in off.values()), daemon.log
        status, said = servo(daemon, "joint 5", "--pwm", "1")
        assert status == 1 and "enable its torque first" in said, said
        for id in off:
            servos.tell(f"mend {id}")
        for id, line in off.items():
            eventually(lambda: line in daemon.log, f"nobody says that joint {id} is off")
            servos.let_go(id)
        daemon.wait_status(lambda s: s["problems"] == [], "it is never over")


def test_who_cannot_start_a_motor_anew_that_runs_hears_that_it_is_told_to_be_off(folder, servos):
    on = {"cmd": "servo", "joint": "joint 5", "torque": True}
    told = "its motor may run, and is told to be off until it confirms that"
    with driven(folder, servos) as daemon:
        for more in [{}, {"pwm_percent": 1}, {"hold_ms": 10_000}]:
            with connect(daemon.control_path) as client:
                started = ask(client, on)
                assert started["ok"], started
                servos.tell("fault 5 silent")
                refused = ask(client, on | more)
                assert not refused["ok"] and refused["error"].endswith(told), refused
                servos.tell("mend 5")
                eventually(lambda: servos.register(5, *TORQUE) == 0, "it is not")
                daemon.wait_status(lambda s: s["problems"] == [], "nobody knows that it is off")


def test_the_log_tells_of_a_motor_in_the_order_in_which_its_servo_was_told(folder, servos):
    on = {"cmd": "servo", "joint": "joint 5", "torque": True, "pwm_percent": 0}
    with driven(folder, servos) as daemon:
        for _ in range(8):
            with connect(daemon.control_path) as holder:
                assert ask(holder, on | {"hold_ms": 10_000})["ok"]
            eventually(lambda: servos.register(5, *TORQUE) == 0, "it is not let go")
            assert daemon.control(**on)["ok"]
        words = re.compile("torque of joint 5 is (on|off, since who held it is gone)")
        eventually(lambda: len(words.findall(daemon.log)) == 24, "something is not told")
        assert words.findall(daemon.log) == 8 * ["on", "off, since who held it is gone", "on"]


def test_each_of_two_who_tell_one_servo_something_at_once_hears_of_its_own_request(folder, servos):
    with driven(folder, servos) as daemon:
        with connect(daemon.control_path) as one, connect(daemon.control_path) as other:
            for percent in (5, -5):
                for client in (one, other):
                    request = {"cmd": "servo", "joint": "joint 5", "pwm_percent": percent}
                    client.sendall(json.dumps(request).encode() + b"\n")
                for reply in [read_reply(one), read_reply(other)]:
                    assert not reply["ok"] and "enable its torque first" in reply["error"], reply


def test_who_tells_a_servo_something_that_reports_a_hardware_error_hears_of_it(folder, servos):
    with driven(folder, servos) as daemon:
        assert servo(daemon, "joint 6", "--torque", "on", "--pwm", "0") == (0, "")
        servos.tell("error 5 32")
        assert comes(daemon, "servo-error", "joint 5", "overload")["severe"]
        words = "joint 5: the servo reports a hardware error: overload; its motor may stay off until it is rebooted"
        for arguments in [("--torque", "on", "--pwm", "0"), ("--pwm", "5"), ("--torque", "off"), ("--torque", "on")]:
            status, said = servo(daemon, "joint 5", *arguments)
            assert status == 0 and words in said, said
        with connect(daemon.control_path) as client:
            together = ask(client, {"cmd": "servos", "pwm_percent": {"joint 5": 3, "joint 6": 3}})
        assert together == {"ok": True, "warning": words}
        said = f"torque of joint 5 is on (it stops by itself after 2540 ms of silence); {words}"
        eventually(lambda: said in daemon.log, "the log does not say so")
        # Goals beyond its PWM Limit are refused, which is told first.
        servos.tell("fault 5 refuse:6")
        status, said = servo(daemon, "joint 5", "--pwm", "6")
        assert status == 1 and "data limit" in said and "hardware error: overload" in said, said


def test_who_ends_says_which_motors_are_off_and_of_which_nobody_knows(folder, servos):
    with driven(folder, servos) as daemon:
        for joint in ["joint 5", "joint 6"]:
            assert servo(daemon, joint, "--torque", "on") == (0, "")
        servos.tell("fault 6 silent")
        assert daemon.stop() == 0
        assert "torque of joint 5 is off, since taxeld ends" in daemon.log and "torque of joint 6 is off" not in daemon.log
        assert "nobody knows whether the motor of joint 6 is off" in daemon.log


def test_an_adapter_that_comes_back_under_another_number_is_found_by_its_stable_name(folder):
    link = folder / "by-id"
    servos = Servos("--ids", "1-16", "--link", link)
    with Daemon(folder / "d", SCENE, tick=TICK, joints=dynamixel(link)) as daemon, Watch(daemon) as watch:
        watch.until(all_known, "not every angle became known")
        ticks = []
        # A second of the daemon's own ticks: one that a busy machine holds up makes fewer. The servos and the joints' thread
        # can be held up on their own, so the best of three counts.
        while not ticks or (min(ticks) >= TICK["rate_hz"] and len(ticks) < 3):
            servos, took = comes_back_elsewhere(daemon, watch, servos, link, len(ticks) + 1)
            ticks.append(took)
        print(f"BACK after {ticks} ticks at {TICK['rate_hz']:.0f} Hz")
        assert min(ticks) < TICK["rate_hz"], "it takes longer than a second"
    servos.close()


def comes_back_elsewhere(daemon, watch, servos, link, times):
    """Unplugs the adapter and plugs it in under another number: the servos, and after how many ticks every angle is known."""
    before = daemon.wait_status(lambda s: s["joints"]["state"] == "connected", "the status says gone")["joints"]
    assert (before["device"], before["opened"]) == (servos.path, times)
    # Whoever has the old terminal's number open keeps it from being given again.
    with open(servos.path):
        servos.close()
        away = watch.until(lambda image: set(image["joints"]) == {None}, "angles stay known without adapter")
        daemon.wait_status(lambda s: s["joints"]["state"] == "gone", "the status does not say that it is gone")
        comes(daemon, "serial-absent", None, f"{link} is gone, unplugged")
        eventually(lambda: f"{link} is gone, unplugged" in daemon.log, "nor does the log")
        # Every image of the time without adapter was made, whether or not a busy machine had `watch` take it.
        watched = watch.more(60)
        missed = watched[-1]["seq"] - watched[0]["seq"] - 59
        assert missed <= daemon.status()["subscribers"][0]["skipped"], [image["seq"] for image in watched]

        servos = Servos("--ids", "1-16", "--link", link)
        back_ns = time.monotonic_ns()
        image = watch.until(all_known, "it is not found again")
    newer = next(other for other in watch.lines if other["t_ns"] >= min(back_ns, image["t_ns"]))
    status = daemon.wait_status(lambda s: s["joints"]["state"] == "connected", "the status says gone")
    assert status["joints"]["device"] == servos.path != before["device"]
    assert status["joints"]["opened"] == times + 1
    assert away["missing"] == 0 == image["missing"]
    eventually(lambda: f"(now {servos.path}) is back" in daemon.log, "the log does not say that it is back")
    assert daemon.log.count("ERROR") == times, "told more than once"
    return servos, image["seq"] - newer["seq"]


def test_a_port_that_is_not_there_is_waited_for_and_told_what_to_do(folder):
    link = folder / "by-id"
    with Daemon(folder / "d", SCENE, tick=TICK, joints=dynamixel(link)) as daemon, Watch(daemon) as watch:
        eventually(lambda: "is the adapter plugged in?" in daemon.log, "the log does not say what to do")
        assert daemon.status()["joints"]["state"] == "waiting"
        assert set(watch.more(1)[0]["joints"]) == {None}
        servos = Servos("--ids", "1-16", "--link", link)
        watch.until(all_known, "it is not found")
        servos.close()


def test_servos_beside_a_recording_are_refused(folder):
    log = refused(folder, ["log:a.log", "log:b.log"], dynamixel("/dev/ttyUSB0"))
    assert "recording of another time" in log and "/dev/ttyUSB0" in log, log
