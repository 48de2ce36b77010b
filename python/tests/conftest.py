import pytest
import taxel


@pytest.fixture
def daemon():
    with taxel.FakeDaemon(width=4, height=3, levels=4, joints=["a", "b"]) as daemon:
        yield daemon
