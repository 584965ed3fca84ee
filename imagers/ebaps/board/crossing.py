"""Clock-by-clock model of the frame path: pixels, FIFO, AXI4, DDR, AXI4, FIFOs, display.

Three clocks, in integer ps: the pixel clock writes 16-bit pixels, eight to a word, the memory clock
moves words, the display clock reads. The FIFOs of all regions that are read together share one
rd_en, which rises only if each has a value. A live pixel is therefore always combined with its own
dark values (document 002, section 3.2).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from imagers.ebaps.board.axi import (
    BEAT_BYTES,
    BURST_BEATS,
    AxiRules,
    Burst,
    ReadMaster,
    Signals,
    WriteMaster,
)
from imagers.ebaps.board.cameralink import LINK_HZ
from imagers.ebaps.board.fifo import AsyncFifo, Packer, Unpacker, edges_of
from imagers.ebaps.board.memory import LATENCY_CLOCKS, MEMORY_HZ, Ddr, DdrPort
from imagers.ebaps.board.timing import CLOCK_HZ, FRAME_RATE, REGIONS

FIFO_WORDS = 512
"""Depth of each FIFO, words of 128 bits: assumed (two block memories of 36 Kbit)."""
_STUCK = 512
"""Edges of every clock without movement after which a transfer has failed, if nothing stalls."""

Image = npt.NDArray[np.uint16]


@dataclass(frozen=True)
class Clocks:
    """Frequencies, Hz, and the time of the first edge of each clock, ps.

    Attributes:
        pixel: document 002.
        memory: assumed.
        display: the Camera Link's.
    """

    pixel: int = CLOCK_HZ
    memory: int = MEMORY_HZ
    display: int = LINK_HZ
    phases: tuple[int, int, int] = (0, 0, 0)


@dataclass
class Transfer:
    """Result of a transfer of frames.

    Attributes: frames: (H, W) read, by region. writes, reads: bursts in order. clocks: of the
    memory. overflows, underflows: over all FIFOs. most, most_read: largest number of words in the
    write FIFO and in a read FIFO. written: ps at which the last burst was acknowledged. shown: ps
    of the first and the last value that were read. pixels: that were written. faults: of the bus.
    done: whether all words arrived.
    """

    frames: dict[int, Image] = field(default_factory=dict)
    writes: list[Burst] = field(default_factory=list)
    reads: list[Burst] = field(default_factory=list)
    faults: list[str] = field(default_factory=list)
    clocks: int = 0
    overflows: int = 0
    underflows: int = 0
    most: int = 0
    most_read: int = 0
    written: int = 0
    shown: tuple[int, int] = (0, 0)
    pixels: int = 0
    done: bool = False


class _Source:
    """Writes pixels to the write FIFO, one per pixel clock without pause."""

    def __init__(self, fifo: AsyncFifo, frame: Image) -> None:
        self._fifo, self._values = fifo, frame.ravel().tolist()
        self._packer, self._at = Packer(), 0

    def edge(self, now: int) -> None:
        word = None
        if self._at < len(self._values):
            last = self._at == len(self._values) - 1
            word = self._packer.push(self._values[self._at], last)
            self._at += 1
        self._fifo.write_edge(now, word)


class _Display:
    """Reads the FIFOs of all regions under one rd_en, one value of each per display clock."""

    def __init__(self, fifos: list[AsyncFifo], count: int) -> None:
        self._fifos, self._count = fifos, count
        self._unpackers = [Unpacker() for _ in fifos]
        self.values: list[list[int]] = [[] for _ in fifos]
        self.first = self.last = 0

    @property
    def done(self) -> bool:
        return all(len(values) == self._count for values in self.values)

    def edge(self, now: int) -> None:
        wants = [unpacker.wants for unpacker in self._unpackers]
        there = all(not f.empty for f, want in zip(self._fifos, wants, strict=True) if want)
        rd_en = there and not self.done
        for n, fifo in enumerate(self._fifos):
            word = fifo.read_edge(now, rd_en and wants[n])
            if word is not None:
                self._unpackers[n].load(word)
            if rd_en:
                self.values[n].append(self._unpackers[n].take())
        if rd_en:
            self.last = now
            self.first = self.first or now


@dataclass(frozen=True)
class Path:
    """Parameters of the path of frames to and from the memory.

    Attributes:
        bias: byte address of region 0 (ADDR_BIAS).
        clocks: clocks of pixels, memory and display.
        stall: share of the memory's clocks in which it is not ready.
        latency: clocks from a read's address to its first data.
        seed: seed of the stalls and of the FIFOs' synchronisers.
        beats: number of beats of a burst.
        depth: words of a FIFO.
    """

    bias: int = 0
    clocks: Clocks = Clocks()
    stall: float = 0.0
    latency: int = LATENCY_CLOCKS
    seed: int = 0
    beats: int = BURST_BEATS
    depth: int = FIFO_WORDS


def transfer(
    ddr: Ddr, path: Path = Path(), *, write: tuple[int, Image] | None = None,
    read: tuple[Sequence[int], tuple[int, int]] | None = None,
) -> Transfer:  # fmt: skip
    """Writes a frame to a region and reads frames of one shape from other regions, concurrently.

    Args: ddr: the memory. path: parameters of the path to it. write: (region, frame); None for
        nothing. read: (regions, (H, W)); None for nothing.

    `done` of the result is False if words were lost (a FIFO overflowed).
    """
    at, bias, beats, depth, seed = path.clocks, path.bias, path.beats, path.depth, path.seed
    levels = (min(beats, depth), depth - beats)
    inward = AsyncFifo(depth, prog_empty=levels[0], prog_full=levels[1], seed=seed)
    regions, shape = (list(read[0]), read[1]) if read else ([], (0, 0))
    outward = [
        AsyncFifo(depth, prog_empty=levels[0], prog_full=levels[1], seed=seed + 1 + n)
        for n in range(len(regions))
    ]
    writer, reader = WriteMaster(inward, bias, beats), ReadMaster(outward, bias, beats)
    port, rules = DdrPort(ddr, stall=path.stall, latency=path.latency, seed=seed), AxiRules()
    frame = write[1] if write else np.zeros((0, 0), np.uint16)
    source = _Source(inward, frame)
    display = _Display(outward, shape[0] * shape[1])
    if write:
        writer.begin(write[0], 2 * frame.size)
    if regions:
        reader.begin(regions, 2 * shape[0] * shape[1])
    hertz = {"pixel": at.pixel, "memory": at.memory, "display": at.display}
    patience = (_STUCK + 4 * path.latency) / (1 - path.stall)
    still, before, written = dict.fromkeys(hertz, 0), (0, 0, 0), 0
    for now, name in edges_of(hertz, dict(zip(hertz, at.phases, strict=True))):
        still[name] += 1
        if name == "pixel":
            source.edge(now)
        elif name == "display":
            display.edge(now)
        else:
            seen = Signals(
                writer.aw, port.awready, writer.w, port.wready, port.b, writer.bready,
                reader.ar, port.arready, port.r, reader.rready,
            )  # fmt: skip
            rules.see(seen)
            port.edge(seen)
            writer.edge(now, seen)
            reader.edge(now, seen)
            if not written and writer.idle:
                written = now
            moved = (inward.inside, len(writer.bursts), sum(map(len, display.values)))
            if moved != before:
                still, before = dict.fromkeys(hertz, 0), moved
            if (writer.idle and display.done) or min(still.values()) > patience:
                break
    fifos = [inward, *outward]
    return Transfer(
        frames={
            region: np.array(values, np.uint16).reshape(shape)
            for region, values in zip(regions, display.values, strict=True)
            if display.done
        },
        writes=writer.bursts, reads=reader.bursts, faults=rules.faults, clocks=rules.clock,
        overflows=sum(f.overflows for f in fifos), underflows=sum(f.underflows for f in fifos),
        most=inward.most, most_read=max((f.most for f in outward), default=0), written=written,
        shown=(display.first, display.last), pixels=frame.size,
        done=writer.idle and display.done,
    )  # fmt: skip


def burst_clocks(
    beats: int = BURST_BEATS, latency: int = LATENCY_CLOCKS, *, write: bool = True
) -> int:
    """Memory clocks between the starts of successive bursts without stalls: beats, latency, and the
    handshakes of address and (for a write) response."""
    return beats + latency + (3 if write else 2)


def memory_load(
    pixels: int = 1280 * 1024, rate: int = FRAME_RATE, writes: int = 1, reads: int = REGIONS,
    beats: int = BURST_BEATS, latency: int = LATENCY_CLOCKS, hertz: int = MEMORY_HZ,
) -> float:  # fmt: skip
    """Largest share of the memory's clocks that frames need without stalls: each frame is written
    once, and read together with its four dark frames."""
    bursts = -(-2 * pixels // (beats * BEAT_BYTES))
    clocks = writes * burst_clocks(beats, latency) + reads * burst_clocks(
        beats, latency, write=False
    )
    return bursts * rate * clocks / hertz
