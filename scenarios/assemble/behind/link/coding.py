"""The stream code at both ends of a link: of a run, of patches of it, and of probes."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from cosim import Clock, Light, Viform
from cosim.plan.tiles import PatchPlane
from cosim.spikes.ancillary import Ancillary, from_arrays, to_arrays
from cosim.spikes.viform import WORD, Words, words_for
from cosim.stage import BLOCK, State, blocks, section
from display.probes.setup import ProbeCamera
from sensor.codec.columns import Damaged
from sensor.codec.packets.ancillary import CODES, WRITE, AncillaryEncoder
from sensor.codec.packets.catalogue import StreamCode
from sensor.codec.packets.coder import StreamEncoder
from sensor.codec.packets.decoder import StreamDecoder
from sensor.codec.packets.packet import Packet, Tiles
from sensor.codec.packets.rate import RateControl
from sensor.codec.packets.section import BUFFER, CYCLES, CodeSection

Mask = npt.NDArray[np.bool_]
SIDE: Final = 8
"""Side of the tiles in which patches are coded, pixels: it divides that of every code."""


@dataclass(frozen=True)
class Counts:
    """What a sender has coded and sent.

    Attributes:
        coded_bytes: all packets of the code.
        sent_bytes: packets that the rate control has chosen.
        dropped: packets that it has left out.
        dropped_spikes: spikes whose time only those packets have.
        peak_bytes: largest content of the send buffer.
        layers: packets sent of each layer.
        ancillary_bytes: packets of what the source says beyond its spikes that were sent.
        ancillary_dropped: packets of it that found no room in the send buffer: charges in half of
            it, writes in all.
    """

    coded_bytes: int
    sent_bytes: int
    dropped: int
    dropped_spikes: int
    peak_bytes: int
    layers: tuple[int, ...]
    ancillary_bytes: int = 0
    ancillary_dropped: int = 0


class Sender:
    """Coder, rate control and the packets that wait for the panel.

    The rate control counts the bits that the link carries in simulated time. It never asks how far
    the panel is, so its choice does not depend on the order in which the stages of a chain run.

    Args:
        code: code of the stream.
        shape: (height, width) of the stream.
        cycles: length of the stream.
        control: rate control, with the bits a cycle that the link carries.
    """

    def __init__(
        self, code: StreamCode, shape: tuple[int, int], cycles: int, control: RateControl
    ) -> None:
        self._code, self._control = code, control
        self._encoder, self._offsets = StreamEncoder(code, shape), code.offsets(shape)
        self._ancillary = AncillaryEncoder(Tiles(shape, code.tile))
        self._said_bytes = self._said_dropped = self._begun = 0
        self._cycles = cycles
        self._queue: deque[tuple[int, bytes]] = deque()
        self._cut: dict[tuple[int, int], int] = {}

    @property
    def cut(self) -> dict[tuple[int, int], int]:
        """Number of layers sent, by first cycle and tile, where some of them were left out."""
        return self._cut

    @property
    def counts(self) -> Counts:
        count, control = self._control.statistics, self._control
        return Counts(
            count["offered_bytes"], count["sent_bytes"], count["dropped_packets"],
            count["dropped_spikes"], control.buffer.peak, tuple(control.layers_sent),
            self._said_bytes, self._said_dropped,
        )  # fmt: skip

    def put(self, data: Viform) -> None:
        """Codes the next block. A packet can be sent from the end of its last cycle on, and those
        of the last, shorter groups when whole ones would end: not all tiles at once."""
        self._ancillary.take(data.ancillary)
        packets = self._encoder.encode(data.words, data.start, data.cycles)
        stop = data.start + data.cycles
        if stop == self._cycles:
            packets += self._encoder.flush()
        groups: dict[int, list[Packet]] = {}
        for packet in packets:
            end = self._code.end(packet.first, int(self._offsets[packet.tile]))
            groups.setdefault(end, []).append(packet)
        for end, group in sorted(groups.items()):
            self._control.send(end)
            if end >= self._begun + self._code.cycles:
                self._say(end)
            left_out = self._control.offer(group, end)
            for packet in left_out:
                place = packet.first, packet.tile
                self._cut[place] = min(self._cut.get(place, packet.layer), packet.layer)
            left = {id(packet) for packet in left_out}
            self._queue.extend((end, p.to_bytes()) for p in group if id(p) not in left)

    def _say(self, end: int) -> None:
        """Sends the ancillary data of the next `cycles` cycles of the code, which all tiles have in
        common, at their end, before spikes. Charges leave half of the buffer to these."""
        buffer, first = self._control.buffer, self._begun
        for packet in self._ancillary.group(first, min(self._code.cycles, self._cycles - first)):
            most = buffer.limit if packet.code == WRITE else buffer.limit // 2
            if buffer.size + packet.size > most:
                self._said_dropped += 1
                continue
            buffer.push(packet, end)
            self._said_bytes += packet.size
            self._queue.append((end, packet.to_bytes()))
        self._begun += self._code.cycles

    def pop(self, before: int) -> bytes | None:
        """The next packet that can be sent from cycle `before` on or earlier; None for none."""
        if self._queue and self._queue[0][0] <= before:
            return self._queue.popleft()[1]
        return None

    def through(self, stream: Viform) -> Viform:
        """A whole stream as it is decoded from the packets that are sent; for studies without a
        link."""
        decoder = Decoder(self._code, stream.shape, stream.cycles)
        for block in blocks(stream.cycles, BLOCK):
            words = stream.words[block.start // WORD : words_for(block.stop)]
            self.put(Viform(words, block.cycles, stream.clock, block.start))
        while (packet := self.pop(stream.cycles + self._code.cycles)) is not None:
            decoder.take(packet)
        words, *_ = decoder.read(stream.cycles)
        return Viform(words, stream.cycles, stream.clock, stream.start)

    def state(self) -> State:
        waiting = [data for _, data in self._queue]
        parts = {"encoder": self._encoder.state(), "control": self._control.state()}
        return {
            "ends": np.array([end for end, _ in self._queue], np.int64),
            "lengths": np.array([len(data) for data in waiting], np.int64),
            "packets": np.frombuffer(b"".join(waiting), np.uint8).copy(),
            "said": np.array([self._said_bytes, self._said_dropped, self._begun], np.int64),
            **{f"ancillary/{key}": value
               for key, value in to_arrays(self._ancillary.state()).items()},
            "cut": np.array([(*key, n) for key, n in self._cut.items()], np.int64).reshape(-1, 3),
            **{f"{part}/{key}": value for part, state in parts.items()
               for key, value in state.items()},
        }  # fmt: skip

    def restore(self, state: State) -> None:
        for part, stage in (("encoder", self._encoder), ("control", self._control)):
            prefix = f"{part}/"
            stage.restore(
                {k.removeprefix(prefix): v for k, v in state.items() if k.startswith(prefix)}
            )
        self._said_bytes, self._said_dropped, self._begun = (int(n) for n in state["said"])
        self._ancillary.restore(from_arrays(section(state, "ancillary")), self._begun)
        self._cut = {(int(first), int(tile)): int(n) for first, tile, n in state["cut"]}
        data, at = state["packets"].tobytes(), 0
        self._queue.clear()
        for end, length in zip(state["ends"], state["lengths"], strict=True):
            self._queue.append((int(end), data[at : at + int(length)]))
            at += int(length)


class Decoder:
    """Packets to a stream.

    Args:
        code: code of the stream.
        shape: (height, width) of the stream.
        cycles: length of the stream.
    """

    def __init__(self, code: StreamCode, shape: tuple[int, int], cycles: int) -> None:
        self._decoder = StreamDecoder(code, shape, length=cycles)
        self._code, self._offsets = code, code.offsets(shape)

    def take(self, packet: bytes) -> int | None:
        """Takes a packet that has arrived. Returns the cycle at which it could be sent, that after
        its last one in a stream that goes on; None for a packet that is damaged, or late."""
        if not self._decoder.take(packet):
            return None
        try:
            read = Packet.of(packet)
        except Damaged:
            return None
        offset = 0 if read.code in CODES else int(self._offsets[read.tile])
        return self._code.end(read.first, offset)

    def due(self, cycle: int) -> None:
        """Decodes the groups that begin at a cycle or before it: what comes later is lost."""
        self._decoder.decode(cycle + 1)

    def read(self, stop: int) -> tuple[Words, Mask, Mask, tuple[Ancillary, ...]]:
        """The words of the cycles before `stop` that were not read yet, the tiles of which nothing
        has ever arrived, (rows, columns) bool, those that are shown with the rate that they had
        last, and what the source says beyond its spikes."""
        decoded = self._decoder.read(stop)
        return decoded.words, decoded.missing, decoded.held, decoded.ancillary


@dataclass(frozen=True, eq=False)
class CutCode:
    """A code, and the layers that a run has sent of each tile.

    Which spikes a decoder draws depends on the number of layers and on the block of 8 x 8 pixels
    alone. So patches can be coded without the rest of their tiles.

    Attributes:
        code: code of the run.
        shape: (height, width) of the stream.
        cut: number of layers sent, by first cycle and tile, where some were left out.
        plane: the patches.
    """

    code: StreamCode
    shape: tuple[int, int]
    cut: Mapping[tuple[int, int], int]
    plane: PatchPlane

    def through(self, words: Words, cycles: int) -> Words:
        """The words of the patches, (words, pixels), as they are decoded."""
        rows, columns = self.plane.rows, self.plane.columns
        split = self.plane.split(words).reshape(len(words), -1, rows, columns)
        parts = [
            self._patch(np.ascontiguousarray(split[:, n]), cycles, tile)
            for n, tile in enumerate(self.plane.tiles)
        ]
        return np.stack(parts, axis=1).reshape(words.shape)

    def _patch(self, words: Words, cycles: int, tile: int) -> Words:
        """One patch, (words, rows, columns). tile: its number on the plane."""
        code, columns = replace(self.code, tile=SIDE), words.shape[2]
        shape = words.shape[1], columns
        small, large = Tiles(shape, SIDE), Tiles(self.shape, self.code.tile)
        top, _, left, _ = self.plane.grid.box(tile)
        corners = [[part.start for part in small.place(n)] for n in range(len(small))]
        places = [
            (top + y) // large.side * large.grid[1] + (left + x) // large.side for y, x in corners
        ]
        offsets = self.code.offsets(self.shape)[places]
        encoder = StreamEncoder(code, shape, offsets)
        decoder = StreamDecoder(code, shape, 0, offsets, cycles)
        for packet in [*encoder.encode(words, 0, cycles), *encoder.flush()]:
            key = packet.first, places[packet.tile]
            if packet.layer < self.cut.get(key, packet.layer + 1):
                decoder.take(packet.to_bytes())
        return decoder.read(cycles).words


def of_a_part(section: CodeSection, clock: Clock) -> CodeSection:
    """The section for a few tiles, with their share of the bits: while their packets are sent,
    those of other tiles of the whole stream would not come."""
    buffer = BUFFER if section.buffer is None else section.buffer
    more = (section.cycles or CYCLES) / clock.hz
    return section.model_copy(update={"buffer": buffer + more})


@dataclass(frozen=True)
class CodedProbeCamera:
    """A probe camera whose stream is coded and decoded; implements `ProbeCamera`.

    The stream is in the time of the camera: the display shows it later by the hold of the link. An
    array has the share of the link's bits that as many pixels of the run have.

    Attributes:
        camera: the camera.
        section, code: the code of the run.
        bits: bits that the link carries for a pixel in a cycle.
    """

    camera: ProbeCamera
    section: CodeSection
    code: StreamCode
    bits: float

    @property
    def clock(self) -> Clock:
        return self.camera.clock

    @property
    def height(self) -> int:
        return self.camera.height

    @property
    def seed(self) -> int:
        return self.camera.seed

    @property
    def identity(self) -> Any:
        return object()  # its probes are computed in each run

    def lux(self, rate: float) -> float:
        return self.camera.lux(rate)

    def spikes(self, rate: float) -> float:
        return self.camera.spikes(rate)

    def row_delays(self, rows: int) -> npt.NDArray[np.int64]:
        return self.camera.row_delays(rows)

    def film(
        self,
        light: Light,
        cycles: int,
        shape: tuple[int, int],
        seed: int,
        rows: tuple[int, int] | None = None,
    ) -> Viform:
        return self.through(self.camera.film(light, cycles, shape, seed, rows))

    def through(self, stream: Viform) -> Viform:
        """The stream as it is decoded."""
        carried = self.bits * stream.shape[0] * stream.shape[1] * self.clock.hz
        control = of_a_part(self.section, self.clock).control(self.clock.hz, carried)
        assert control is not None
        return Sender(self.code, stream.shape, stream.cycles, control).through(stream)
