import pytest
from harness.bus import MulticastBuses
from harness.daemon import must_be_built
from harness.servos import Servos


def pytest_configure():
    must_be_built("taxeld", "taxel", "examples/servo_bus")


@pytest.fixture
def buses(hand):
    with MulticastBuses(len(hand.buses)) as buses:
        yield buses


@pytest.fixture
def servos(folder):
    """Two servos in PWM mode with something springy between them, and potentiometers at `folder / "lines"`."""
    servos = Servos("--ids", "1-2", "--load", "--potentiometers", folder / "lines")
    yield servos
    servos.close()
