import pytest
from harness.bus import MulticastBuses
from harness.daemon import Programs, must_be_built
from harness.servos import Servos


def pytest_configure():
    must_be_built("taxeld", "taxel", "examples/servo_bus")


@pytest.fixture
def buses(hand):
    with MulticastBuses(len(hand.buses)) as buses:
        yield buses


@pytest.fixture
def play(folder):
    """Starts `taxel sim` of a scene to these sources; it is gone after the test."""
    with Programs() as taxel, (folder / "sim.log").open("wb") as log:

        def play(scene, sources, *options):
            targets = [argument for source in sources for argument in ("--to", source)]
            return taxel("sim", scene, *targets, *options, stdout=log, stderr=log)

        yield play


@pytest.fixture
def servos():
    """The servos 1 to 16 of a hand."""
    with Servos("--ids", "1-16") as servos:
        yield servos
