"""ROBOTIS's own SDK, unchanged, against the simulated servo bus, and our reader beside it."""

import json
import math

import dynamixel_sdk as dxl
import pytest

from harness.daemon import eventually
from harness.sdk_port import SdkPort
from harness.servos import BAUD, example

IDS = range(1, 17)
MODEL = 1030

LED, TORQUE, RETURN_LEVEL, HARDWARE_ERROR = 65, 64, 68, 70
RETURN_DELAY, GOAL_PWM, GOAL_VELOCITY, GOAL_POSITION = 9, 100, 104, 116
PRESENT_PWM, PRESENT_POSITION, VOLTAGE, TEMPERATURE = 124, 132, 144, 146
ALERT = 128


def open_port(bus):
    port = SdkPort(bus)
    assert port.openPort() and port.setBaudRate(BAUD)
    return port


@pytest.fixture
def port(bus):
    port = open_port(bus)
    yield port
    port.closePort()


@pytest.fixture
def sdk():
    return dxl.PacketHandler(2.0)


def good(result, error=0, expect_error=0):
    assert result == dxl.COMM_SUCCESS, dxl.PacketHandler(2.0).getTxRxResult(result)
    assert error == expect_error, dxl.PacketHandler(2.0).getRxPacketError(error)


def test_ping(sdk, port):
    for id in IDS:
        model, result, error = sdk.ping(port, id)
        good(result, error)
        assert model == MODEL
    assert sdk.ping(port, 17)[1] == dxl.COMM_RX_TIMEOUT


def test_broadcast_ping_answers_in_order_of_ids(sdk, port):
    found, result = sdk.broadcastPing(port)
    good(result)
    assert list(found) == list(IDS)
    assert set(map(tuple, found.values())) == {(MODEL, 46)}


def test_read_and_write(sdk, port):
    for id in (1, 16):
        good(*sdk.write1ByteTxRx(port, id, LED, 1))
        value, result, error = sdk.read1ByteTxRx(port, id, LED)
        good(result, error)
        assert value == 1
        position, result, error = sdk.read4ByteTxRx(port, id, PRESENT_POSITION)
        good(result, error)
        assert position == 2048 + 10 * id
        voltage, result, error = sdk.read2ByteTxRx(port, id, VOLTAGE)
        good(result, error)
        assert voltage == 120
    # Data that holds the header's pattern comes back as it is. It is written in halves: the Python SDK computes the
    # stuffing of a request and then sends it without (4.1.0, `txPacket` drops what `addStuffing` returns).
    pattern = [0xFF, 0xFF, 0xFD, 0x00, 0xFF, 0xFF, 0xFD, 0xFD]
    for at in range(0, len(pattern), 2):
        good(*sdk.writeTxRx(port, 1, 224 + at, 2, pattern[at : at + 2]))
    data, result, error = sdk.readTxRx(port, 1, 224, len(pattern))
    good(result, error)
    assert data == pattern


def test_what_a_servo_refuses_has_the_manuals_error_number(sdk, port):
    good(*sdk.write1ByteTxRx(port, 1, TORQUE, 1))
    cases = [
        (sdk.write1ByteTxRx(port, 1, RETURN_DELAY, 0), 7, "EEPROM while torque is on"),
        (sdk.write4ByteTxRx(port, 1, PRESENT_POSITION, 0), 7, "read-only register"),
        (sdk.write4ByteTxRx(port, 1, GOAL_POSITION, 5000), 6, "beyond Max Position Limit"),
        (sdk.write1ByteTxRx(port, 1, LED, 9), 4, "out of range"),
        (sdk.write2ByteTxRx(port, 1, GOAL_POSITION, 5), 5, "half a register"),
    ]
    for (result, error), number, what in cases:
        assert (result, error) == (dxl.COMM_SUCCESS, number), what


def test_sync_write_and_sync_read(sdk, port):
    write = dxl.GroupSyncWrite(port, sdk, GOAL_PWM, 2)
    for id in IDS:
        assert write.addParam(id, list((10 * id).to_bytes(2, "little")))
    good(write.txPacket())
    read = dxl.GroupSyncRead(port, sdk, GOAL_PWM, 2)
    for id in IDS:
        assert read.addParam(id)
    good(read.txRxPacket())
    assert [read.getData(id, GOAL_PWM, 2) for id in IDS] == [10 * id for id in IDS]


def test_bulk_read(sdk, port):
    read = dxl.GroupBulkRead(port, sdk)
    assert read.addParam(3, PRESENT_POSITION, 4)
    assert read.addParam(1, VOLTAGE, 2)
    assert read.addParam(2, TEMPERATURE, 1)
    good(read.txRxPacket())
    assert read.getData(3, PRESENT_POSITION, 4) == 2078
    assert read.getData(1, VOLTAGE, 2) == 120
    assert read.getData(2, TEMPERATURE, 1) == 32


def test_fast_sync_read(sdk, port):
    read = dxl.GroupSyncRead(port, sdk, PRESENT_PWM, 12)
    for id in IDS:
        assert read.addParam(id)
    good(read.fastSyncRead())
    assert [read.getData(id, PRESENT_POSITION, 4) for id in IDS] == [2048 + 10 * id for id in IDS]


def test_fast_bulk_read(sdk, port):
    read = dxl.GroupBulkRead(port, sdk)
    # The SDK looks a servo up by the first byte of the request that is its id (4.1.0, `fastBulkReadRx`).
    for id, at, size in ((16, PRESENT_POSITION, 4), (9, VOLTAGE, 2), (11, TEMPERATURE, 1)):
        assert read.addParam(id, at, size)
    good(read.fastBulkRead())
    assert read.getData(16, PRESENT_POSITION, 4) == 2048 + 160
    assert read.getData(9, VOLTAGE, 2) == 120
    assert read.getData(11, TEMPERATURE, 1) == 33


def test_bulk_write(bus, sdk, port):
    write = dxl.GroupBulkWrite(port, sdk)
    assert write.addParam(3, GOAL_POSITION, 4, list((512).to_bytes(4, "little")))
    assert write.addParam(7, LED, 1, [1])
    good(write.txPacket())
    bus.quiet()
    assert (bus.register(3, GOAL_POSITION, 4), bus.register(7, LED, 1)) == (512, 1)


def test_registered_writes_wait_for_action(bus, sdk, port):
    for id in (2, 3):
        good(*sdk.regWriteTxRx(port, id, LED, 1, [1]))
    assert sdk.regWriteTxRx(port, 2, LED, 1, [9]) == (dxl.COMM_SUCCESS, 4), "out of range"
    assert [bus.register(id, LED, 1) for id in (2, 3)] == [0, 0]
    assert sdk.action(port, dxl.BROADCAST_ID) == dxl.COMM_SUCCESS
    bus.quiet()
    assert [bus.register(id, LED, 1) for id in (2, 3)] == [1, 1]


def test_clear_forgets_the_revolutions(bus, sdk, port):
    bus.tell("mode 2 4")
    good(*sdk.write1ByteTxRx(port, 2, TORQUE, 1))
    good(*sdk.write4ByteTxRx(port, 2, GOAL_POSITION, 5000))
    eventually(lambda: sdk.read4ByteTxRx(port, 2, PRESENT_POSITION)[0] == 5000, "it does not arrive")
    good(*sdk.clearMultiTurn(port, 2))
    assert sdk.read4ByteTxRx(port, 2, PRESENT_POSITION)[0] == 5000 - 4096


def test_reboot_clears_a_hardware_error(bus, sdk, port):
    bus.tell("error 5 32")
    value, result, error = sdk.read1ByteTxRx(port, 5, HARDWARE_ERROR)
    good(result, error, ALERT)
    assert value == 32
    good(*sdk.write1ByteTxRx(port, 4, LED, 1))
    good(*sdk.reboot(port, 5), ALERT)
    # It says nothing until it has restarted.
    eventually(lambda: sdk.ping(port, 5)[1:] == (dxl.COMM_SUCCESS, 0), "it does not restart")
    assert sdk.read1ByteTxRx(port, 4, LED)[0] == 1


def test_a_motor_goes_where_it_is_told(sdk, port):
    good(*sdk.write1ByteTxRx(port, 2, TORQUE, 1))
    good(*sdk.write4ByteTxRx(port, 2, GOAL_POSITION, 2500))

    def arrived():
        position, result, error = sdk.read4ByteTxRx(port, 2, PRESENT_POSITION)
        good(result, error)
        assert 2068 <= position <= 2500
        return position == 2500

    eventually(arrived, "it does not arrive")


def test_the_status_return_level_decides_who_answers(sdk, port):
    good(*sdk.write1ByteTxRx(port, 1, RETURN_LEVEL, 1))
    assert sdk.write1ByteTxRx(port, 1, LED, 1)[0] == dxl.COMM_RX_TIMEOUT
    assert sdk.read1ByteTxRx(port, 1, LED)[:2] == (1, dxl.COMM_SUCCESS)
    sdk.write1ByteTxRx(port, 1, RETURN_LEVEL, 0)
    assert sdk.read1ByteTxRx(port, 1, LED)[1] == dxl.COMM_RX_TIMEOUT
    assert sdk.ping(port, 1)[1] == dxl.COMM_SUCCESS


@pytest.mark.parametrize(
    ("fault", "result"),
    [
        ("silent", dxl.COMM_RX_TIMEOUT),
        ("bad-crc", dxl.COMM_RX_CORRUPT),
        ("truncated:12", dxl.COMM_RX_CORRUPT),
        ("garbage:20", dxl.COMM_SUCCESS),
    ],
)
def test_faults_look_to_the_sdk_as_on_a_real_bus(bus, sdk, port, fault, result):
    bus.tell(f"fault 2 {fault}")
    assert sdk.read4ByteTxRx(port, 2, PRESENT_POSITION)[1] == result
    assert sdk.read4ByteTxRx(port, 1, PRESENT_POSITION)[1] == dxl.COMM_SUCCESS
    bus.tell("mend 2")
    assert sdk.read4ByteTxRx(port, 2, PRESENT_POSITION)[1] == dxl.COMM_SUCCESS


def signed(value, bits):
    return value - (1 << bits) if value >> (bits - 1) else value


@pytest.mark.parametrize("fast", ["off", "on"])
def test_our_reader_agrees_with_the_sdk_value_for_value(bus, sdk, fast):
    port = open_port(bus)
    # One goes elsewhere and one turns at a constant speed, so that no register is the same in all.
    for id in IDS:
        good(*sdk.write1ByteTxRx(port, id, 11, 16 if id == 7 else 3))
        good(*sdk.write1ByteTxRx(port, id, TORQUE, 1))
    good(*sdk.write4ByteTxRx(port, 9, GOAL_POSITION, 100))
    eventually(lambda: sdk.read4ByteTxRx(port, 9, PRESENT_POSITION)[0] == 100, "it does not arrive")
    bus.tell("error 11 4")
    port.closePort()

    # So that a busy machine makes nobody late.
    settings = ["--ids", "1-16", "--baud", BAUD, "--cycles", 1500, "--fast", fast, "--margin-ms", 10_000]
    reader = example("read_joints", bus.path, *settings)
    ours = json.loads(reader.communicate()[0])
    assert reader.returncode == 0

    port = open_port(bus)
    read = dxl.GroupSyncRead(port, sdk, PRESENT_PWM, 12)
    slow = dxl.GroupSyncRead(port, sdk, VOLTAGE, 3)
    for id in IDS:
        assert read.addParam(id) and slow.addParam(id)
    good(read.txRxPacket())
    good(slow.txRxPacket())
    compared = 0
    for row in ours["servos"]:
        id = row["id"]
        position = signed(read.getData(id, PRESENT_POSITION, 4), 32)
        velocity = signed(read.getData(id, 128, 4), 32)
        current = signed(read.getData(id, 126, 2), 16)
        pwm = signed(read.getData(id, PRESENT_PWM, 2), 16)
        if id != 7:
            assert row.get("position") == position, row
        assert row["angle_rad"] == pytest.approx((row["position"] - 2048) * math.tau / 4096)
        assert row["velocity_rad_s"] == pytest.approx(velocity * 0.229 * math.tau / 60)
        assert row["current_counts"] == current
        assert row["current_a"] == pytest.approx(current * 0.00269)
        assert row["pwm"] == pytest.approx(pwm * 0.00113)
        assert row["alert"] == (id == 11)
        assert row["hardware_error"] == (4 if id == 11 else 0)
        assert row["voltage_v"] == pytest.approx(slow.getData(id, VOLTAGE, 2) * 0.1)
        assert row["temperature_c"] == slow.getData(id, TEMPERATURE, 1)
        assert row["model"] == sdk.ping(port, id)[0]
        compared += 1
    assert compared == 16
    port.closePort()


def test_our_scan_agrees_with_the_sdks(bus, sdk, port):
    found, result = sdk.broadcastPing(port)
    good(result)
    port.closePort()
    scan = example("read_joints", bus.path, "--scan", "--baud", BAUD)
    rows = [json.loads(line) for line in scan.communicate()[0].splitlines()]
    assert {row["id"]: [row["model"], row["firmware"]] for row in rows} == found


def test_a_client_that_dies_leaves_the_bus_to_the_next(bus, sdk):
    for _ in range(5):
        port = open_port(bus)
        # Half a request, then nobody.
        port.writePort(bytes([0xFF, 0xFF, 0xFD, 0x00, 0x01]))
        port.closePort()
        port = open_port(bus)
        assert sdk.ping(port, 1)[1] == dxl.COMM_SUCCESS
        port.closePort()


def test_bytes_that_mean_nothing_do_not_stop_the_bus(bus, sdk, port):
    for n in range(1, 400, 7):
        port.writePort(bytes((n * i) & 0xFF for i in range(n)))
    assert any([sdk.ping(port, 3)[1] == dxl.COMM_SUCCESS for _ in range(5)])
