"""ROBOTIS's SDK on the simulated servo bus: its packets, its waits and its verdicts, on a bus that may be held up."""

import select

import dynamixel_sdk as dxl


class SdkPort(dxl.PortHandler):
    """The SDK's own port, whose answers are missed only when the bus has none to give.

    On a busy machine the simulated servos can be given no processor for longer than the SDK waits. So when the SDK's
    time is over, the bus is asked whether it has heard every byte that was sent, has said all that it will say, and
    whether all that has been read. If not, the answer is still under way, and the SDK goes on waiting.
    """

    def __init__(self, bus):
        super().__init__(bus.path)
        self.bus = bus
        self.taken = 0  # bytes of what the bus has said that nobody else will read: read here, or flushed

    def setupPort(self, cflag_baud):
        if self.is_open:
            self.closePort()
        before = self.bus.free()
        self.bus.written = before.heard
        self.taken = before.said
        return super().setupPort(cflag_baud)

    def clearPort(self):
        quiet = self.bus.quiet()
        super().clearPort()
        self.taken = quiet.said

    def writePort(self, packet):
        written = super().writePort(packet)
        self.bus.written += written
        return written

    def readPort(self, length):
        # The SDK asks again and again; whoever is to answer needs the processor.
        select.select([self.ser.fileno()], [], [], 0.001)
        read = super().readPort(length)
        self.taken += len(read)
        return read

    def isPacketTimeout(self):
        if not super().isPacketTimeout():
            return False
        traffic = self.bus.traffic()
        return (traffic.heard, traffic.due, traffic.said) == (self.bus.written, 0, self.taken)
