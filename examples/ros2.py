"""A running hand in ROS 2: what `taxel foxglove` serves, published byte by byte.

    taxel foxglove &
    python3 ros2.py [ws://localhost:8765]    # where ROS 2 is sourced; pip install websockets

Topics are those of a recording, /tactile_image, /joint_states and /diagnostics among them. Of types that are not installed
here, as taxel_msgs are not, nothing is published, and that is said. It waits for `taxel foxglove`, and for the next one.
"""

import importlib
import json
import struct
import sys
import time

import rclpy
from rclpy.executors import ExternalShutdownException
from rclpy.qos import DurabilityPolicy, QoSProfile
from websockets.exceptions import WebSocketException
from websockets.sync.client import connect

# Whoever subscribes later is given the last one, as of the description of the hand.
QOS = QoSProfile(depth=10, durability=DurabilityPolicy.TRANSIENT_LOCAL)


def advertised(node, channels, publishers):
    """Makes a publisher of each channel whose type is here; all of them by the channel's number."""
    of_channels = {}
    for channel in channels:
        topic, (package, _, name) = channel["topic"], channel["schemaName"].split("/")
        if topic not in publishers:
            try:
                kind = getattr(importlib.import_module(f"{package}.msg"), name)
            except (ImportError, AttributeError):
                node.get_logger().info(f"{topic} is left out: {package} is not installed, or has no {name}")
                publishers[topic] = None
            else:
                publishers[topic] = node.create_publisher(kind, topic, QOS)
        if publishers[topic]:
            of_channels[channel["id"]] = publishers[topic]
    return of_channels


def forward(node, url, publishers):
    """Publishes what comes of one connection, until it ends."""
    of_channels = {}
    with connect(url, subprotocols=["foxglove.websocket.v1"], max_size=None) as viewer:
        for message in viewer:
            if isinstance(message, bytes):
                _, channel, _ = struct.unpack_from("<BIQ", message)
                of_channels[channel].publish(message[13:])
                continue
            message = json.loads(message)
            if message["op"] == "advertise":
                of_channels.update(advertised(node, message["channels"], publishers))
                wanted = [{"id": channel, "channelId": channel} for channel in of_channels]
                viewer.send(json.dumps({"op": "subscribe", "subscriptions": wanted}))
            elif message["op"] == "status":
                node.get_logger().warning(message["message"])


def main():
    url = sys.argv[1] if len(sys.argv) > 1 else "ws://localhost:8765"
    rclpy.init()
    node, publishers = rclpy.create_node("taxel"), {}
    try:
        while rclpy.ok():
            try:
                forward(node, url, publishers)
            except (OSError, WebSocketException) as error:
                node.get_logger().warning(f"{url}: {error}; waiting for it", throttle_duration_sec=60)
            time.sleep(1)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass


if __name__ == "__main__":
    main()
