"""The stream code at both ends of a link, as its near and far end use it."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from cosim.spikes.viform import WORD, Viform, Words, words_for
from cosim.stage import BLOCK, State, blocks
from sensor.codec.columns import Damaged
from sensor.codec.packets.catalogue import StreamCode
from sensor.codec.packets.coder import StreamDecoder, StreamEncoder
from sensor.codec.packets.packet import Packet
from sensor.codec.packets.rate import RateControl

Mask = npt.NDArray[np.bool_]


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
    """

    coded_bytes: int
    sent_bytes: int
    dropped: int
    dropped_spikes: int
    peak_bytes: int
    layers: tuple[int, ...]


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
        self._encoder = StreamEncoder(code, shape)
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
        )  # fmt: skip

    def put(self, data: Viform) -> None:
        """Codes the next block. A packet can be sent from the end of its last cycle on."""
        packets = self._encoder.encode(data.words, data.start, data.cycles)
        stop = data.start + data.cycles
        if stop == self._cycles:
            packets += self._encoder.flush()
        groups: dict[int, list[Packet]] = {}
        for packet in packets:
            groups.setdefault(packet.first + packet.cycles, []).append(packet)
        for end, group in groups.items():
            self._control.send(end)
            left_out = self._control.offer(group, end)
            for packet in left_out:
                place = packet.first, packet.tile
                self._cut[place] = min(self._cut.get(place, packet.layer), packet.layer)
            left = {id(packet) for packet in left_out}
            self._queue.extend((end, p.to_bytes()) for p in group if id(p) not in left)

    def pop(self, before: int) -> bytes | None:
        """The next packet that can be sent from cycle `before` on or earlier; None for none."""
        if self._queue and self._queue[0][0] <= before:
            return self._queue.popleft()[1]
        return None

    def through(self, stream: Viform) -> Viform:
        """A whole stream as it is decoded from the packets that are sent; for studies without a
        link."""
        decoder = Decoder(self._code, stream.shape)
        for block in blocks(stream.cycles, BLOCK):
            words = stream.words[block.start // WORD : words_for(block.stop)]
            self.put(Viform(words, block.cycles, stream.clock, block.start))
        while (packet := self.pop(stream.cycles)) is not None:
            decoder.take(packet)
        words, _, _ = decoder.read(stream.cycles)
        return Viform(words, stream.cycles, stream.clock, stream.start)

    def state(self) -> State:
        waiting = [data for _, data in self._queue]
        parts = {"encoder": self._encoder.state(), "control": self._control.state()}
        return {
            "ends": np.array([end for end, _ in self._queue], np.int64),
            "lengths": np.array([len(data) for data in waiting], np.int64),
            "packets": np.frombuffer(b"".join(waiting), np.uint8).copy(),
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
        self._cut = {(int(first), int(tile)): int(n) for first, tile, n in state["cut"]}
        data, at = state["packets"].tobytes(), 0
        self._queue.clear()
        for end, length in zip(state["ends"], state["lengths"], strict=True):
            self._queue.append((int(end), data[at : at + int(length)]))
            at += int(length)


class Decoder:
    """Packets to a stream; see `PacketDecoder`.

    Args:
        code: code of the stream.
        shape: (height, width) of the stream.
    """

    def __init__(self, code: StreamCode, shape: tuple[int, int]) -> None:
        self._decoder = StreamDecoder(code, shape)

    def take(self, packet: bytes) -> int | None:
        """Takes a packet. Returns the cycle after its last one; None if it is of no use."""
        if not self._decoder.take(packet):
            return None
        try:
            read = Packet.of(packet)
        except Damaged:
            return None
        return read.first + read.cycles

    def read(self, stop: int) -> tuple[Words, Mask, Mask]:
        """The words of the cycles before `stop` that were not read yet, the tiles of which nothing
        has ever arrived, and those that are shown with the rate that they had last."""
        decoded = self._decoder.read(stop)
        return decoded.words, decoded.missing, decoded.held
