"""rustypot, Pollen Robotics' driver of Dynamixel servos, unchanged, on the simulated servo bus."""

import pytest
import rustypot

from harness.servos import BAUD

IDS = list(range(1, 17))
MODEL = 1030
TIMEOUT_S = 20.0  # bounds a failure only: an answer that came late would be one more
# Register and size of what rustypot reads by name; its XL430 has these where an XM430 has them.
REGISTERS = {
    "model_number": (0, 2),
    "return_delay_time": (9, 1),
    "operating_mode": (11, 1),
    "torque_enable": (64, 1),
    "hardware_error_status": (70, 1),
    "goal_position": (116, 4),
    "present_velocity": (128, 4),
    "present_position": (132, 4),
    "present_input_voltage": (144, 2),
    "present_temperature": (146, 1),
}


@pytest.fixture
def driver(bus):
    driver = rustypot.Xl430PyController(bus.path, BAUD, TIMEOUT_S)
    yield driver
    driver.close()


def test_it_finds_every_servo_by_broadcast_and_by_name(driver):
    assert driver.broadcast_scan() == dict.fromkeys(IDS, MODEL)
    assert all(driver.ping(id) for id in IDS)


@pytest.mark.parametrize("fast", [False, True], ids=["sync", "fast sync"])
def test_it_reads_every_register_value_for_value(bus, driver, fast):
    driver.set_fast_sync_read(fast)
    for name, (address, size) in REGISTERS.items():
        values = getattr(driver, f"sync_read_{name}")(IDS)
        assert list(map(int, values)) == [bus.register(id, address, size) for id in IDS], name


def test_what_it_writes_is_in_the_table(bus, driver):
    goals = [2000 + 10 * id for id in IDS]
    driver.sync_write_goal_position(IDS, goals)
    assert list(driver.sync_read_goal_position(IDS)) == goals
    assert [bus.register(id, 116, 4) for id in IDS] == goals
    driver.write_led(3, True)
    assert bus.register(3, 65, 1) == 1 and bus.register(4, 65, 1) == 0
