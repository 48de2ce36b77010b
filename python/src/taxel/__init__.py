"""Tactile images of a robot hand, from taxeld, as numpy arrays.

    import taxel

    for image in taxel.connect():
        print(image.seq, image.pixels.max(), image.actuators.level)

SPDX-License-Identifier: Apache-2.0 OR MIT
"""

from . import aio
from ._reader import DecodeError
from .control import Control, mark, pause, profile, resume, rezero, status
from .errors import Refused
from .fake import FakeDaemon
from .files import Images, load
from .frames import Frames, load_frames
from .messages import Event, Image, Message, Raw, Text
from .place import running_socket
from .requests import Mark
from .stream import Stream, connect

__version__ = "0.1.0"

__all__ = [
    "Control",
    "DecodeError",
    "Event",
    "FakeDaemon",
    "Frames",
    "Image",
    "Images",
    "Mark",
    "Message",
    "Raw",
    "Refused",
    "Stream",
    "Text",
    "aio",
    "connect",
    "load",
    "load_frames",
    "mark",
    "pause",
    "profile",
    "resume",
    "rezero",
    "running_socket",
    "status",
]
