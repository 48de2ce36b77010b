import pytest

from harness.daemon import must_be_built
from harness.servos import Servos


def pytest_configure():
    must_be_built("examples/servo_bus", "examples/read_joints")


@pytest.fixture
def bus():
    """The servos 1 to 16."""
    bus = Servos("--ids", "1-16")
    yield bus
    bus.close()
