"""Bus watchdogs that others have left armed on servos."""

import dynamixel_sdk as dxl
from harness.daemon import Daemon, eventually
from harness.joints import SCENE, TICK, WATCHDOG, WRITING, dynamixel, servo
from harness.sdk_port import SdkPort
from harness.servos import BAUD


def test_a_watchdog_that_was_left_armed_on_a_motor_that_is_off_is_cleared_where_writing_is_allowed(folder, servos):
    port, packets = SdkPort(servos), dxl.PacketHandler(2.0)
    assert port.openPort() and port.setBaudRate(BAUD)
    for id in (5, 6):
        assert packets.write1ByteTxRx(port, id, WATCHDOG[0], 50)[0] == dxl.COMM_SUCCESS
    port.closePort()
    left = lambda: [servos.register(id, *WATCHDOG) for id in (4, 5, 6, 7)]
    cleared = "the bus watchdog of servo joint 5 (id 5), joint 6 (id 6) was left armed"
    with Daemon(folder / "reads", SCENE, tick=TICK, joints=dynamixel(servos.path)) as daemon:
        daemon.wait_status(lambda s: s["joints"]["readings"] > 50, "nothing is read")
        assert left() == [0, 50, 50, 0] and "watchdog" not in daemon.log
    with Daemon(folder / "writes", SCENE, tick=TICK, joints=dynamixel(servos.path, **WRITING)) as daemon:
        eventually(lambda: left() == [0, 0, 0, 0], "the watchdogs stay armed")
        eventually(lambda: cleared in daemon.log, lambda: f"the log does not say so: {daemon.log}")
        # Whoever drives the motors next has no goal refused.
        assert servo(daemon, "joint 5", "--torque", "on") == (0, "")
        assert servo(daemon, "joint 5", "--pwm", "10") == (0, "")
        assert servos.register(5, *WATCHDOG) == 127
        assert daemon.log.count("was left armed") == 1
