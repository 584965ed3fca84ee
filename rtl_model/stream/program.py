"""Random inputs of a source and its stream: back-pressure, settings, faults of the lanes.

They depend on the case and its seed only.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from rtl_model.geometry import Geometry
from rtl_model.lockstep import Program
from rtl_model.stream.external import state_words
from rtl_model.stream.lines import SKEW, disturbed, lane_words

Numbers = npt.NDArray[np.uint64]


@dataclass(frozen=True)
class Case:
    """A source under random inputs.

    Attributes:
        source: "array", "external" or "lines".
        rows, columns, lanes: rows, columns and lanes of the build.
        depth: depth of the ring, beats.
        seed: seed of the inputs.
        clocks: number of clocks to run, about.
        pixels, in_flight, latency: settings of "external": pixels of a memory word, most words
            between read and write, clocks of a read.
    """

    source: str
    rows: int = 6
    columns: int = 40
    lanes: int = 32
    depth: int = 16
    seed: int = 0
    clocks: int = 20_000
    pixels: int = 4
    in_flight: int = 8
    latency: int = 5

    @cached_property
    def geometry(self) -> Geometry:
        """The build."""
        if self.source == "array":
            return self._program.geometry
        return Geometry(self.rows, self.columns, self.lanes)

    @property
    def settings(self) -> dict[str, int]:
        """Parameters of the Verilog besides the geometry."""
        external = {"PIXELS": self.pixels, "IN_FLIGHT": self.in_flight}
        return {"DEPTH": self.depth} | (external if self.source == "external" else {})

    @cached_property
    def memory(self) -> list[int]:
        """Contents of the external memory: random electrons."""
        rng = np.random.default_rng((self.seed, 1))
        electrons = rng.integers(0, 256, (self.rows, self.columns)).astype(np.uint8)
        return state_words(self.geometry, self.pixels, electrons)

    @cached_property
    def inputs(self) -> Numbers:
        """(clocks, inputs) uint64, in the order of the shim; the first is TREADY."""
        rng = np.random.default_rng((self.seed, 0))
        made = {"array": self._array, "external": self._external, "lines": self._lines}
        rest = made[self.source](rng)
        return np.column_stack([_pressure(rng, len(rest)), rest]).astype(np.uint64)

    @cached_property
    def _program(self) -> Program:
        return Program(self.rows, self.columns, self.lanes, self.seed)

    def _array(self, rng: np.random.Generator) -> npt.NDArray[np.int64]:
        """The bus writes of the lockstep of the whole board."""
        number, clock, writes = 0, 0, []
        while clock < self.clocks:
            chunk = self._program.chunk(number, clock)
            writes += chunk.writes
            number, clock = number + 1, chunk.stop
        out = np.zeros((clock, 3), np.int64)
        for write in writes:
            out[write.clock] = 1, write.address, write.value
        return out

    def _external(self, rng: np.random.Generator) -> npt.NDArray[np.int64]:
        clocks, rows, columns = self.clocks, self.rows, self.columns

        def held(low: int, high: int, most: int = 1000) -> npt.NDArray[np.int64]:
            """Values of [low, high) that hold for random times."""
            times = rng.integers(1, most, 2 * clocks // most + 100)
            return np.repeat(rng.integers(low, high, times.size), times)[:clocks]

        first_row, first_column = held(0, rows), held(0, columns)
        narrow = held(0, 3) == 0  # a window, else all
        last_row = np.minimum(first_row + held(0, rows), 0xFFFF)
        last_column = np.minimum(first_column + held(0, columns), 0xFFFF)
        frame = 2 * rows * self.geometry.tiles * self.lanes // self.pixels  # read and write
        return np.column_stack([
            _pressure(rng, clocks),
            held(0, 8) > 0,
            rng.random(clocks) < 2 / (20 * frame),
            held(0, 16) * held(0, 2), held(0, 2), held(0, 4),
            np.where(narrow, last_row << 16 | first_row, (rows - 1) << 16),
            np.where(narrow, last_column << 16 | first_column, (columns - 1) << 16),
            held(0, 2 * frame),
            held(0, 4), held(0, 256),
        ]).astype(np.int64)  # fmt: skip

    def _lines(self, rng: np.random.Generator) -> npt.NDArray[np.int64]:
        """Random planes on lanes with skew, bit slips and bit errors."""
        size = self.geometry
        sent = size._replace(rows=size.rows + 1)  # the last row is none of the build
        parts, clocks, number = [], 0, int(rng.integers(4096))
        while clocks < self.clocks:
            planes = {}
            for _ in range(int(rng.integers(1, 5))):
                planes[number] = rng.random((sent.rows, size.columns)) < rng.choice([0.1, 0.5, 1])
                number += int(rng.choice([1, 1, 1, 1, 2, 300]))
            settings = {
                "training": int(rng.integers(0, 60)), "pause": int(rng.choice([4, 5, 25, 60])),
            }  # fmt: skip
            part = lane_words(planes, sent, **settings)
            if rng.random() < 0.1:  # one lane sends rows of other planes
                others = {n + 1: plane for n, plane in planes.items()}
                lane = int(rng.integers(part.shape[1]))
                part[:, lane] = lane_words(others, sent, **settings)[:, lane]
            parts.append(part)
            clocks += len(part)
        words = np.concatenate(parts)
        bits = 8 * len(words)
        for lane in range(words.shape[1]):
            # A lane may be late by up to the skew, and rarely by more. What slips in is taken out
            # later, so that rows come together again.
            most = 8 * SKEW if rng.random() < 0.95 else 8 * SKEW + 15
            skew = int(rng.choice([0, most, int(rng.integers(most + 1))]))
            slips = [(0, skew)]
            for at in rng.integers(0, bits, bits // 40_000).tolist():
                count, later = int(rng.choice([1, 2, 7, 9])), int(rng.integers(100, 8000))
                slips += [(at, count), (at + later, -count)]
            wrong = set(rng.integers(0, bits, bits // 10_000).tolist())
            for at in rng.integers(0, bits - 80, bits // 40_000).tolist():
                wrong |= set(range(at, at + 80, 16))  # in every second word of ten
            words[:, lane] = disturbed(words[:, lane], slips=slips, wrong=sorted(wrong))
        shifts = 8 * np.arange(words.shape[1], dtype=np.int64)
        return (words.astype(np.int64) << shifts).sum(axis=1)[:, None]


def _pressure(rng: np.random.Generator, clocks: int) -> npt.NDArray[np.bool_]:
    """Readiness: always, never, or at random, for random times; (clocks,) bool."""
    times = rng.integers(1, 400, clocks // 100 + 10)
    share = np.repeat(rng.choice([0, 0.1, 0.5, 0.9, 1], times.size), times)[:clocks]
    return rng.random(clocks) < share
