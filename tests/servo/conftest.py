from harness.daemon import must_be_built


def pytest_configure():
    must_be_built("examples/servo_bus", "examples/read_joints")
