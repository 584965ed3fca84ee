"""A port over the cycle model of a board: simulated time, faults at chosen bytes."""

import pytest

from rtl_model.cycle import Bridge
from rtl_model.geometry import Geometry
from rtl_model.host import Board, Uartbone

SMALL = Geometry(rows=3, columns=40, clock_hz=1_000_000, baud=50_000, capture_words=256)


class ModelPort:
    """The model behind a line with a duration in simulated time; no wall time passes.

    faults: {("rx" to the board or "tx" from it, number of the byte): "drop", "flip" or "extra"}.
    """

    name = "model"

    def __init__(self, geometry=SMALL, faults=None, bridge=None):
        self.geometry = geometry
        self.bridge = bridge or Bridge(geometry)
        self.baud = geometry.baud
        self.faults = dict(faults or {})
        self.clock = 0
        self.input = []
        self.count = {"rx": 0, "tx": 0}
        self.dead = False
        self.sent = []

    def now(self):
        return self.clock / self.geometry.clock_hz

    def bend(self, way, data):
        made = bytearray()
        for byte in data:
            fault = self.faults.pop((way, self.count[way]), None)
            self.count[way] += 1
            if fault == "flip":
                byte ^= 0x10
            if fault == "extra":
                made.append(0x55)
            if fault != "drop":
                made.append(byte)
        return bytes(made)

    def write(self, data, deadline_s=1.0):
        assert deadline_s > 0
        self.sent.append(data)
        arrived = self.bend("rx", data)
        if self.dead:
            return
        reply = self.bridge.feed(arrived, self.clock + self.bridge.byte_clocks)
        self.clock += len(arrived) * self.bridge.byte_clocks
        for byte, clock in zip(reply.data, reply.clocks, strict=True):
            for bent in self.bend("tx", bytes([byte])):
                self.input.append((clock + self.bridge.byte_clocks, bent))

    def read(self, count, deadline_s):
        assert deadline_s < 5
        end = self.clock + int(deadline_s * self.geometry.clock_hz)
        got = b""
        while len(got) < count and self.input and self.input[0][0] <= end:
            at, byte = self.input.pop(0)
            self.clock = max(self.clock, at)
            got += bytes([byte])
        if len(got) < count:
            self.clock = end
        self.bridge.wait(self.clock)
        return got

    def drain(self):
        return self.read(sum(at <= self.clock for at, _ in self.input), 0.0)

    def set_baud(self, baud):
        self.baud = baud

    def close(self):
        pass


@pytest.fixture
def make_port():
    return ModelPort


@pytest.fixture
def port():
    return ModelPort()


@pytest.fixture
def board(port):
    return Board(Uartbone(port))
