"""The stream codes: a line each, and those of one layer, which are the words as they are and the
first-spike codes, anew in every packet. The number of a code in packets is its place in `KINDS`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from cosim.spikes.viform import Words, spikes_beyond, words_for
from sensor.codec.coding import Code, decode_band, encode_band
from sensor.codec.columns import Damaged
from sensor.codec.packets.event import MOST_EVENT_CYCLES, Event
from sensor.codec.packets.layered import LAYERS, Layered
from sensor.codec.packets.packet import MOST_CYCLES, Layer, TileCode, Tiles


@dataclass(frozen=True)
class StreamCode:
    """A code and its settings. Raises ValueError for settings out of range.

    Attributes:
        kind: name in the catalogue.
        cycles: cycles of a packet, a multiple of 32.
        tile: side of a tile, pixels.
        layers: number of layers that are made, of `layered`.
        k, refine, threshold, threshold_noise: settings of `statistical`, see `Code`; electrons.
        phases: number of instants in the cycles of a packet at which packets end, each of a part of
            the tiles: a link then has bits to carry all the time, and they wait less.
    """

    kind: str = "layered"
    cycles: int = 128
    tile: int = 64
    layers: int = LAYERS
    k: float = 0.0
    refine: int = 0
    threshold: float = 0.0
    threshold_noise: float = 0.0
    phases: int = 1

    def __post_init__(self) -> None:
        if self.kind not in KINDS:
            raise ValueError(f"code must be one of {', '.join(KINDS)}, not {self.kind!r}")
        if not 32 <= self.cycles <= MOST_CYCLES or self.cycles % 32:
            raise ValueError(
                f"cycles must be a multiple of 32 from 32 to {MOST_CYCLES}, not {self.cycles}"
            )
        if self.kind == "event" and self.cycles > MOST_EVENT_CYCLES:
            raise ValueError(
                f"cycles must be at most {MOST_EVENT_CYCLES} with event, not {self.cycles}"
            )
        if not 8 <= self.tile <= 128 or self.tile % 8:
            raise ValueError(f"tile must be a multiple of 8 from 8 to 128, not {self.tile}")
        if self.phases < 1 or self.cycles % self.phases:
            raise ValueError(f"phases must divide {self.cycles} cycles, not {self.phases}")
        if self.kind != "layered" and self.layers != LAYERS:
            raise ValueError(f"layers must be given with layered, not {self.kind}")
        settings = (self.k, self.refine, self.threshold, self.threshold_noise)
        if self.kind != "statistical" and settings != (0, 0, 0, 0):
            raise ValueError(f"the code {self.kind} must stand without settings of statistical")
        self.make()

    @property
    def lossless(self) -> bool:
        """Whether the decoder has every bit again, if no packet is lost."""
        return self.kind != "statistical" and self.layers == LAYERS

    def offsets(self, shape: tuple[int, int]) -> npt.NDArray[np.int64]:
        """First cycle of the second packet of each tile of a sensor, (tiles,)."""
        return Tiles(shape, self.tile).offsets(self.cycles, self.phases)

    def end(self, first: int, offset: int) -> int:
        """Cycle at which the packets of a tile end that begin at a cycle, in a stream that goes on.
        offset: cycle at which the second packet of the tile begins."""
        return first + (self.cycles if first or not offset else offset)

    @property
    def number(self) -> int:
        """The code's number in packets."""
        return list(KINDS).index(self.kind)

    def make(self) -> TileCode:
        """The code of one tile."""
        return KINDS[self.kind](self)


def _statistical(code: StreamCode) -> TileCode:
    return FirstSpike(
        Code("statistical", code.k, code.threshold, code.threshold_noise, code.refine)
    )


KINDS: Final[dict[str, Callable[[StreamCode], TileCode]]] = {
    "raw": lambda code: Raw(),
    "first-spike": lambda code: FirstSpike(Code("repeat")),
    "statistical": _statistical,
    "layered": lambda code: Layered(code.layers),
    "event": lambda code: Event(),
}


class Raw:
    """Words as they are, one bit a pixel and cycle: 32-bit words, little-endian, of the first 32
    cycles of all pixels, then of the next."""

    layers = 1

    def encode(self, words: Words, cycles: int) -> list[Layer]:
        """As `TileCode.encode`."""
        spikes = int(np.bitwise_count(words).sum(dtype=np.int64))
        return [Layer(words.astype("<u4").tobytes(), spikes, float(spikes))]

    def decode(self, layers: Sequence[bytes], shape: tuple[int, int], cycles: int) -> Words:
        """As `TileCode.decode`."""
        if len(layers[0]) != 4 * words_for(cycles) * shape[0] * shape[1]:
            raise Damaged("raw words of another size")
        words: Words = np.frombuffer(layers[0], "<u4").astype(np.uint32).reshape(-1, *shape)
        if spikes_beyond(words[-1], cycles):
            raise Damaged("spikes beyond the last cycle")
        return words


class FirstSpike:
    """A first-spike code (coding.py), whose pixels begin and end with the packet."""

    layers = 1

    def __init__(self, code: Code) -> None:
        self._code = code

    def encode(self, words: Words, cycles: int) -> list[Layer]:
        """As `TileCode.encode`."""
        spikes = int(np.bitwise_count(words).sum(dtype=np.int64))
        frame = encode_band(self._code, words.reshape(len(words), -1), cycles)
        return [Layer(frame.data, spikes, float(spikes))]

    def decode(self, layers: Sequence[bytes], shape: tuple[int, int], cycles: int) -> Words:
        """As `TileCode.decode`."""
        data = memoryview(layers[0])
        words = decode_band(self._code, [data], shape[0] * shape[1], cycles)
        return words.reshape(-1, *shape)
