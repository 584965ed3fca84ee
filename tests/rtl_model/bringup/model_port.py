"""The cycle model as a port: a complete, reproducible board without Verilator or a pty.

Time is simulated: `now()` is the board's clock, and waits take no wall time. Both lines are 8N1.
The receivers sample mid-bit from the edge of the start bit, so a wrong baud acts as on a board.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence

from rtl_model.cycle import Bridge
from rtl_model.geometry import Geometry

_BITS = 10


def received(data: Sequence[int], ratio: float) -> list[tuple[int, bool]]:
    """Bytes that a receiver reads from bytes sent back to back: (byte, stop bit is high).

    Args:
        data: bytes sent.
        ratio: bit of the receiver divided by that of the sender.
    """
    line = [bit for byte in data for bit in (0, *(byte >> n & 1 for n in range(8)), 1)]
    decoded: list[tuple[int, bool]] = []
    free = 0.0  # from here on a falling edge is a start bit
    for edge, bit in enumerate(line):
        if bit or edge < free or (edge and not line[edge - 1]):
            continue
        samples = [int(edge + (n + 0.5) * ratio) for n in range(1, _BITS)]
        values = [line[at] if at < len(line) else 1 for at in samples]
        decoded.append((sum(value << n for n, value in enumerate(values[:8])), values[8] == 1))
        free = edge + 9.5 * ratio
    return decoded


class ModelPort:
    """A port on a board of the cycle model.

    Args:
        geometry: of the board.
        baud: initial rate of the host; the geometry's if None.
        baud_error: relative error of the board's rate.
    """

    def __init__(
        self,
        geometry: Geometry | None = None,
        *,
        baud: int | None = None,
        baud_error: float = 0.0,
    ) -> None:
        self.geometry = geometry or Geometry()
        self.board_baud = self.geometry.baud * (1 + baud_error)
        self.baud = self.geometry.baud if baud is None else baud
        self.name = "model"
        self._clock = 0
        self._power_on()

    def _power_on(self) -> None:
        bit = max(1, round(self.geometry.clock_hz / self.board_baud))
        self.bridge = Bridge(self.geometry, byte_clocks=_BITS * bit)
        self._coming: deque[tuple[int, int]] = deque()

    def write(self, data: bytes, deadline_s: float = 1.0) -> None:
        """Sends bytes, which advances the clock by their duration."""
        for byte, whole in self.to_board(data):
            self._clock += round(_BITS * self.geometry.clock_hz / self.baud)
            if not whole:
                self.bridge.wait(self._clock)
                self.bridge.system.line.framing_errors += 1
                continue
            reply = self.bridge.feed(bytes([byte]), self._clock)
            self.answer(reply.data, reply.clocks)

    def to_board(self, data: bytes) -> list[tuple[int, bool]]:
        """The host's bytes as the board receives them: (byte, whether its stop bit is high)."""
        # The board counts in its own clock, whose error is its baud's.
        fast = self.board_baud / self.geometry.baud
        low = round(self.geometry.clock_hz * fast / self.baud)
        line = self.bridge.system.line
        line.shortest_low = min(line.shortest_low, low)
        return received(data, self.baud / self.board_baud)

    def to_host(self, data: bytes) -> bytes:
        """The board's bytes as the host receives them.

        Bytes with a low stop bit are passed on too, as by common adapters.
        """
        return bytes(byte for byte, _ in received(data, self.board_baud / self.baud))

    def answer(self, data: bytes, clocks: Sequence[int]) -> None:
        """Puts bytes of the board on the line to the host."""
        if not data:
            return
        step = self.bridge.byte_clocks
        for n, byte in enumerate(self.to_host(data)):
            begun = clocks[n] if n < len(clocks) else clocks[-1] + step
            self._coming.append((begun + step, byte))

    def read(self, count: int, deadline_s: float) -> bytes:
        """Reads `count` bytes, or those that arrive within `deadline_s` of simulated time."""
        end = self._clock + int(deadline_s * self.geometry.clock_hz)
        got = b""
        while len(got) < count:
            if not self._coming or self._coming[0][0] > end:
                self._clock = max(self._clock, end)
                self.bridge.wait(self._clock)
                break
            at, byte = self._coming.popleft()
            self._clock = max(self._clock, at)
            got += bytes([byte])
        return got

    def drain(self) -> bytes:
        """Bytes that have arrived."""
        got = b""
        while self._coming and self._coming[0][0] <= self._clock:
            got += bytes([self._coming.popleft()[1]])
        return got

    def set_baud(self, baud: int) -> None:
        """Changes the host's rate."""
        self.baud = baud

    def now(self) -> float:
        """Simulated time, s."""
        return self._clock / self.geometry.clock_hz

    def close(self) -> None:
        """Does nothing: no port is open."""
