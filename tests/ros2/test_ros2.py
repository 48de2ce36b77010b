"""examples/ros2.py between `taxel foxglove` and stock subscribers of ROS 2."""

import json
import os
import subprocess
import sys

import pytest
from harness.daemon import REPOSITORY, HANGS_AFTER_S, die_with_parent, eventually
from harness.foxglove import Bridge

rclpy = pytest.importorskip("rclpy", reason="no ROS 2: tests/ros2/requirements.txt has it")
from diagnostic_msgs.msg import DiagnosticArray  # noqa: E402
from rcl_interfaces.msg import Log  # noqa: E402
from rclpy.qos import DurabilityPolicy, QoSProfile  # noqa: E402
from sensor_msgs.msg import Image  # noqa: E402
from std_msgs.msg import String  # noqa: E402

LATE = QoSProfile(depth=10, durability=DurabilityPolicy.TRANSIENT_LOCAL)
# Of other tests on this machine nothing is heard.
DOMAIN = str(os.getpid() % 200)


@pytest.fixture
def listener():
    """A node; call it with a type and a topic for the list that its messages come into, and spin it by `until`."""
    os.environ |= {"ROS_DOMAIN_ID": DOMAIN, "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}
    rclpy.init()
    node = rclpy.create_node("listener")

    class Listener:
        def __call__(self, kind, topic):
            heard = []
            node.create_subscription(kind, topic, heard.append, LATE)
            return heard

        def until(self, condition, what):
            def met():
                rclpy.spin_once(node, timeout_sec=0.1)
                return condition()

            return eventually(met, what, HANGS_AFTER_S)

    yield Listener()
    rclpy.shutdown()


def test_a_hand_is_in_ros_2_and_comes_back_with_the_next_daemon(start, folder, listener):
    daemon = start(["sim:ball-grasp"] * 2, tick={"rate_hz": 50.0}, boards={"mode": "free-running"})
    images, problems, logs = listener(Image, "/tactile_image"), listener(DiagnosticArray, "/diagnostics"), listener(Log, "/rosout")
    with Bridge(daemon, folder) as bridge:
        url = f"ws://127.0.0.1:{bridge.port}"
        with (folder / "ros2.log").open("wb") as log:
            node = subprocess.Popen(
                [sys.executable, REPOSITORY / "examples/ros2.py", url], stdout=log, stderr=log, preexec_fn=die_with_parent
            )
        try:
            said = (folder / "ros2.log").read_text
            is_touched = lambda: images and max(images[-1].data) > 0  # noqa: E731
            listener.until(lambda: is_touched() and problems, lambda: f"nothing comes: {said()} {bridge.said}")
            assert (images[-1].width, images[-1].height, images[-1].encoding) == (16, 16, "mono8")
            assert problems[0].status[0].name.startswith("taxeld")
            assert "taxel_msgs is not installed" in said()
            # Whoever comes late is told the hand.
            hello = listener(String, "/taxel/hello")
            listener.until(lambda: hello, "the hand is not described")
            assert json.loads(hello[0].data)["layout"] == "allegro-uskin-15"
            daemon.control("mark", text="in ROS")
            listener.until(lambda: any(log.msg == "in ROS" for log in logs), "the mark does not come")
            daemon.kill()
            daemon.start()
            images.clear()
            listener.until(lambda: images, said)
        finally:
            node.kill()
            node.wait()
