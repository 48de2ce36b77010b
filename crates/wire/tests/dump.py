"""Decodes the packets on standard input, each behind its length as u32, and prints a JSON line per packet."""

import json
import math
import os
import struct
import sys

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "python"))
sys.dont_write_bytecode = True
import taxel_reader


def finite(value):
    return value if math.isfinite(value) else None


def dump(packet):
    try:
        message = taxel_reader.decode_packet(packet)
    except taxel_reader.DecodeError as error:
        return {"error": error.name}
    out = message.header._asdict()
    if isinstance(message, taxel_reader.Image):
        for key in ("width", "height", "contacts", "faulty", "missing"):
            out[key] = getattr(message, key)
        out["levels"] = [finite(force) for force in message.levels]
        out["actuators"] = [list(actuator) for actuator in message.actuators]
        out["joints"] = [finite(joint) for joint in message.joints]
        out["pixels"] = message.pixels.hex()
        assert b"".join(message.rows()) == message.pixels
    elif isinstance(message, taxel_reader.Raw):
        out["threshold"] = finite(message.threshold)
        out["joints"] = [finite(joint) for joint in message.joints]
        out["taxels"] = []
        for taxel in message.taxels:
            row = taxel._asdict()
            row.update(force=finite(taxel.force), contact=int(taxel.contact), repaired=int(taxel.repaired))
            out["taxels"].append(row)
        if message.joint_ages_us is not None:
            out["joint_ages_us"] = list(message.joint_ages_us)
        if message.joint_velocities is not None:
            out["joint_velocities"] = [finite(velocity) for velocity in message.joint_velocities]
        if message.joint_currents is not None:
            out["joint_currents"] = [finite(current) for current in message.joint_currents]
        if message.baselines is not None:
            presses = [taxel.press(rest) for taxel, rest in zip(message.taxels, message.baselines)]
            out["baselines"] = [[finite(value) for value in axes] for axes in message.baselines]
            out["presses"] = [[finite(value) for value in axes] for axes in presses]
    elif isinstance(message, taxel_reader.Text):
        out["payload"] = message.text.hex()
    else:
        out["payload"] = message.payload.hex()
    return out


data = sys.stdin.buffer.read()
at = 0
while at < len(data):
    (length,) = struct.unpack_from("<I", data, at)
    print(json.dumps(dump(data[at + 4 : at + 4 + length]), allow_nan=False))
    at += 4 + length
