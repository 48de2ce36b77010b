"""Recordings as can-utils writes them."""

PERIOD_S = 0.033


def write_candump(path, hand, frames, start_s):
    """The frames as `candump -l` writes them. The first line belongs to no board: it starts the clock."""
    with path.open("w") as log:
        log.write("(1700000000.000000) can0 7FF#00\n")
        for i, counts in enumerate(frames):
            for j, (bus, message) in enumerate(hand.sweep(counts)):
                t = 1_700_000_000 + start_s + i * PERIOD_S + j * 50e-6
                log.write(f"({t:.6f}) {hand.buses[bus]} {message.arbitration_id:03X}#{message.data.hex().upper()}\n")
