"""A hand of uSkin modules as the bus sees it: which frames a sweep is, and which pixel each taxel has.

Read from the layout file and protocols 2.2 and 2.3, not from the daemon, so that a taxel on a wrong pixel shows.
"""

import tomllib
from pathlib import Path
from typing import NamedTuple

import can
import numpy as np

LAYOUTS = Path(__file__).resolve().parents[2] / "crates/skin/layouts"
# Within a row of a phalange module the columns run 0, 2, 1, 3.
DEFAULT_ORDER = [[0, 2, 1, 3], [4, 6, 5, 7], [8, 10, 9, 11], [12, 14, 13, 15]]
STREAMING = 0x80  # status byte of a chip that is fine


class Taxel(NamedTuple):
    bus: int
    board: int
    k: int
    x: int
    y: int


class Hand:
    """Taxels in the order of the layout: modules as in the file, within a module ascending k."""

    def __init__(self, name="allegro-uskin-15"):
        layout = tomllib.loads((LAYOUTS / f"{name}.toml").read_text())
        self.name = name
        self.buses = layout["buses"]
        self.shape = (layout["image"]["height"], layout["image"]["width"])
        self.modules = [m["name"] for m in layout["module"]]
        self.taxels = []
        for module in layout["module"]:
            assert module["protocol"] == "uskin-l2" and not module.get("rotation"), "the harness speaks L2, unrotated"
            order = module.get("order", DEFAULT_ORDER)
            at = {k: (col, row) for row, ks in enumerate(order) for col, k in enumerate(ks) if k >= 0}
            x0, y0 = module["at"]
            for k in sorted(at):
                bus = self.buses.index(module["bus"])
                self.taxels.append(Taxel(bus, module["board"], k, x0 + at[k][0], y0 + at[k][1]))
        self.xy = np.array([(t.x, t.y) for t in self.taxels])

    def __len__(self):
        return len(self.taxels)

    def message(self, n, counts, status=STREAMING):
        """The frame in which the board of taxel `n` sends its counts (layout L2, big-endian)."""
        taxel = self.taxels[n]
        sda, chip = taxel.k >> 2, taxel.k & 3
        values = b"".join(int(c).to_bytes(2, "big") for c in counts)
        return can.Message(
            arbitration_id=taxel.board << 8 | sda << 4 | chip,
            is_extended_id=False,
            data=bytes([status]) + values + bytes([sda + 1]),
        )

    def sweep(self, counts, order=None):
        """The frames of one sweep as (bus, message), in the order of the taxels or in `order`."""
        taxels = range(len(self)) if order is None else order
        return [(self.taxels[n].bus, self.message(n, counts[n])) for n in taxels]
