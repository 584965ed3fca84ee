"""The cycle model as a port, in this process and in its own time: a whole board that needs neither
Verilator nor a pty, and that does the same twice.

Time is simulated: `now()` is the board's clock, waiting costs none of ours. Both lines are 8N1
with a receiver that samples mid-bit from the start bit's edge, so a wrong baud does what it does on
a board.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence

from rtl_model.cycle import Bridge
from rtl_model.geometry import Geometry

__all__ = ["ModelPort", "received"]

_BITS = 10


def received(data: Sequence[int], ratio: float) -> list[tuple[int, bool]]:
    """Returns what a receiver makes of bytes sent back to back: (byte, whether its stop bit was
    high). ratio: a bit of the receiver in bits of the sender; 1 is no error."""
    line = [bit for byte in data for bit in (0, *(byte >> n & 1 for n in range(8)), 1)]
    made: list[tuple[int, bool]] = []
    free = 0.0  # from then on a falling edge is a start bit
    for edge, bit in enumerate(line):
        if bit or edge < free or (edge and not line[edge - 1]):
            continue
        samples = [int(edge + (n + 0.5) * ratio) for n in range(1, _BITS)]
        values = [line[at] if at < len(line) else 1 for at in samples]
        made.append((sum(value << n for n, value in enumerate(values[:8])), values[8] == 1))
        free = edge + 9.5 * ratio
    return made


class ModelPort:
    """A port on a board of the cycle model.

    baud: of the host, at first; the board's is its geometry's times `1 + baud_error`.
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
        """Sends bytes, which takes their time on the line."""
        for byte, whole in self.to_board(data):
            self._clock += round(_BITS * self.geometry.clock_hz / self.baud)
            if not whole:
                self.bridge.framing_error(self._clock)
                continue
            reply = self.bridge.feed(bytes([byte]), self._clock)
            self.answer(reply.data, reply.clocks)

    def to_board(self, data: bytes) -> list[tuple[int, bool]]:
        """What the board's receiver makes of the host's bytes: (byte, stop bit high)."""
        # The board counts in its own clock, whose error is its baud's.
        fast = self.board_baud / self.geometry.baud
        low = round(self.geometry.clock_hz * fast / self.baud)
        line = self.bridge.system.line
        line.shortest_low = min(line.shortest_low, low)
        return received(data, self.baud / self.board_baud)

    def to_host(self, data: bytes) -> bytes:
        """What the host's receiver makes of the board's bytes; those with a low stop bit it
        hands on too, as common adapters do."""
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
        """Returns `count` bytes, or those that come within `deadline_s` simulated seconds."""
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
        """Returns what has come by now."""
        got = b""
        while self._coming and self._coming[0][0] <= self._clock:
            got += bytes([self._coming.popleft()[1]])
        return got

    def set_baud(self, baud: int) -> None:
        """Changes the host's rate."""
        self.baud = baud

    def now(self) -> float:
        """Returns simulated seconds."""
        return self._clock / self.geometry.clock_hz

    def close(self) -> None:
        """Does nothing: there is no port to give back."""
