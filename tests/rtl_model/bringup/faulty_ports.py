"""Boards of the cycle model, each with one fault."""

from collections.abc import Sequence
from typing import ClassVar

from rtl_model.geometry import Geometry
from tests.rtl_model.bringup.model_port import ModelPort

SIZE = Geometry(rows=4, columns=40, lanes=32)


class Silent(ModelPort):
    """Never answers."""

    def answer(self, data: bytes, clocks: Sequence[int]) -> None:
        pass


class Echo(ModelPort):
    """TX is tied to RX."""

    def write(self, data: bytes, deadline_s: float = 1.0) -> None:
        self.answer(data, [self._clock] * len(data))


class Console(ModelPort):
    """Another device, which answers all bytes with a prompt."""

    def write(self, data: bytes, deadline_s: float = 1.0) -> None:
        self.answer(b"\r\nlogin: ", [self._clock] * 9)


class Changed(ModelPort):
    """Changes reads of registers by the functions in `changed`, by byte address."""

    changed: ClassVar = {}

    def _power_on(self) -> None:
        super()._power_on()
        system = self.bridge.system
        read = system.read

        def faulty(address: int) -> int:
            value = read(address)
            make = self.changed.get(address)
            return value if make is None else make(value) & 0xFFFFFFFF

        system.read = faulty


class EveryByte(ModelPort):
    """Drops or doubles every `n`-th byte in one direction, or inverts its bit `bit`."""

    def __init__(self, kind: str, way: str, n: int, bit: int = 2, **more: object) -> None:
        self.kind, self.way, self.n, self.bit = kind, way, n, bit
        self.count = 0
        super().__init__(SIZE, **more)

    def hits(self) -> bool:
        """Whether the last counted byte is affected."""
        return self.count % self.n == 0

    def _spoil(self, data: list) -> list:
        result = []
        for item in data:
            self.count += 1
            hit = self.hits()
            if hit and self.kind == "drop":
                continue
            if hit and self.kind == "flip":
                mask = 1 << self.bit
                item = (item[0] ^ mask, item[1]) if isinstance(item, tuple) else item ^ mask
            result += [item, item] if hit and self.kind == "extra" else [item]
        return result

    def to_board(self, data: bytes) -> list[tuple[int, bool]]:
        heard = super().to_board(data)
        return self._spoil(heard) if self.way == "rx" else heard

    def to_host(self, data: bytes) -> bytes:
        heard = list(super().to_host(data))
        return bytes(self._spoil(heard) if self.way == "tx" else heard)
