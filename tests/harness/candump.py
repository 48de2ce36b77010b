"""Recordings as can-utils writes them."""

PERIOD_US = 33_000
BETWEEN_US = 50


def write_candump(path, hand, frames, start_s):
    """The frames as `candump -l` writes them. The first line belongs to no board: it starts the clock."""
    with path.open("w") as log:
        log.write("(1700000000.000000) can0 7FF#00\n")
        for i, counts in enumerate(frames):
            for t_ns, (bus, message) in zip(sweep_times_ns(hand, i, start_s)[0], hand.sweep(counts)):
                t_us = int(t_ns) // 1000
                stamp = f"{1_700_000_000 + t_us // 1_000_000}.{t_us % 1_000_000:06d}"
                log.write(f"({stamp}) {hand.buses[bus]} {message.arbitration_id:03X}#{message.data.hex().upper()}\n")


def sweep_times_ns(hand, index, start_s):
    """When each taxel of a sweep is heard and when the sweep is complete, from the start of the recording."""
    first_us = round(start_s * 1e6) + index * PERIOD_US
    times = [1000 * (first_us + BETWEEN_US * j) for j in range(len(hand))]
    return times, times[-1]
