"""CySkin hubs as Genoa's own CAN library drives them, read from docs/protocols.md ("CySkin packets") and from nothing
else: what it makes and takes is compared with the Rust, so neither is to be changed to agree with the other.

`python tests/harness/cyskin.py` prints the vectors of crates/skin/tests/vectors/cyskin.txt.
"""

EVERYBODY = 0xFF
SENSOR_DATA, AUTO_SYNC, AUTO_SYNC_PERIOD = 0x43, 0x37, 0x38
FIRST, MIDDLE, LAST, SINGLE = 1, 2, 4, 5
SENSORS = 12  # values of a module; number 0 is its temperature


def crc_table():
    """What each byte makes of an empty register, by long division of polynomials."""
    table = []
    for byte in range(256):
        remainder = byte << 8
        for bit in range(15, 7, -1):
            if remainder >> bit & 1:
                remainder ^= 0x107 << (bit - 8)
        table.append(remainder)
    return table


TABLE = crc_table()


def checksum(data):
    register = 0xFF
    for byte in data:
        register = TABLE[register ^ byte]
    return register


def frames(hub, command, data):
    """A packet as (id, bytes) of each of its frames."""
    packet = bytes([command, len(data), *data])
    packet += bytes([checksum(packet)])
    pieces = [packet[i : i + 8] for i in range(0, len(packet), 8)]
    if len(pieces) == 1:
        places = [SINGLE]
    else:
        places = [FIRST] + [MIDDLE] * (len(pieces) - 2) + [LAST]
    return [(place << 8 | hub, piece) for place, piece in zip(places, pieces, strict=True)]


def values_packet(hub, module, sensor, values):
    """The packet of values from one sensor of a module on."""
    data = [module, sensor]
    for value in values:
        data += divmod(value, 256)
    return frames(hub, SENSOR_DATA, data)


class Reader:
    """Packets from frames, of any number of hubs: `take` gives (hub, command, data) with the last frame of one."""

    def __init__(self):
        self.open = {}

    def take(self, id, data):
        place, hub = id >> 8, id & 0xFF
        assert place in (FIRST, MIDDLE, LAST, SINGLE), f"{id:03X} says no place in a packet"
        if place & FIRST:
            assert hub not in self.open, f"hub {hub:#x} begins a packet within one"
            self.open[hub] = b""
        self.open[hub] += bytes(data)
        assert place & LAST or len(data) == 8, "only the last frame is shorter"
        if not place & LAST:
            return None
        packet = self.open.pop(hub)
        assert packet[1] == len(packet) - 3, f"{packet.hex()} says another length"
        assert checksum(packet[:-1]) == packet[-1], f"{packet.hex()} has another checksum"
        return hub, packet[0], packet[2:-1]


def values_of(data):
    """The (module, sensor, value) of a packet of values."""
    module, sensor = data[:2]
    for high, low in zip(data[2::2], data[3::2], strict=True):
        yield module, sensor, high << 8 | low
        sensor += 1
        if sensor == SENSORS:
            module, sensor = module + 1, 0


class Hub:
    """A hub with modules of twelve sensors: silent until it is told a period and then to send by itself."""

    def __init__(self, address, modules):
        self.address = address
        self.modules = modules
        self.period_ms = None
        self.sends = False
        self.heard = []
        self.reader = Reader()

    def hear(self, id, data):
        """Takes a frame of the host's."""
        if id & 0xFF not in (EVERYBODY, self.address):
            return
        packet = self.reader.take(id, data)
        if packet is None:
            return
        self.heard.append(f"{id:03X}#{bytes(data).hex().upper()}")
        _, command, data = packet
        if command == AUTO_SYNC_PERIOD:
            assert len(data) == 2, "the period has two bytes"
            self.period_ms = data[0] << 8 | data[1]
        elif command == AUTO_SYNC:
            self.sends = data[0] == 1 and self.period_ms is not None

    def sweep(self, value):
        """The frames of one sweep; `value(module, sensor)` is what each sensor reads."""
        for module in self.modules:
            yield from values_packet(self.address, module, 0, [value(module, s) for s in range(SENSORS)])


def vectors():
    """Lines `hub module sensor values.. = frames..`, and `hub command data = frame` of what the library sends."""
    hex_of = lambda packet: " ".join(f"{id:03X}#{data.hex().upper()}" for id, data in packet)  # noqa: E731
    yield "# Made by tests/harness/cyskin.py; tests/e2e/test_cyskin_hub.py holds the two together."
    for hub, command, data in [(EVERYBODY, AUTO_SYNC_PERIOD, [0, 50]), (EVERYBODY, AUTO_SYNC, [1]), (EVERYBODY, AUTO_SYNC, [0])]:
        yield f"command {hub} {command} {' '.join(map(str, data))} = {hex_of(frames(hub, command, data))}"
    state = 1
    for count in range(1, 20):
        hub, module, sensor = 1 + 13 * count % 254, 7 * count % 240, 5 * count % SENSORS
        values = []
        for _ in range(count):
            state = state * 75 % 65537
            values.append(state % 65536)
        yield f"values {hub} {module} {sensor} {' '.join(map(str, values))} = {hex_of(values_packet(hub, module, sensor, values))}"


if __name__ == "__main__":
    print("\n".join(vectors()))
