"""The far end of a link: spikes of its camera become packets, and packets the stream to show.

Cycle n of the stream is shown `lead + n + hold` cycles after the link has started, so packets that
arrive later than that are lost to it. What is shown depends on the simulated time of their arrival
only, never on the time that decoding takes.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np
import numpy.typing as npt

from cosim import Clock
from cosim.spikes.viform import WORD, Viform, Words
from cosim.stage import BLOCK, Block, State, blocks
from link.receiving.packets import PacketReceiver
from sensor.codec.packets.packet import LENGTH

Mask = npt.NDArray[np.bool_]
ReadBack = Callable[[int, int], Words]


class PacketDecoder(Protocol):
    """Packets to a stream."""

    def take(self, packet: bytes) -> int | None:
        """Takes a packet that has arrived. Returns the cycle after its last one; None for a packet
        that is damaged, or of cycles that were read already."""
        ...

    def read(self, stop: int) -> tuple[Words, Mask, Mask]:
        """The words of the cycles before `stop` that were not read yet, and which tiles of them,
        (rows, columns) bool, are missing, because nothing of them has ever arrived, and which are
        shown with the rate that they had last."""
        ...


@dataclass(frozen=True)
class Schedule:
    """When cycles of the stream are shown, in cycles of the link.

    Attributes:
        lead: cycle of the link at which cycle 0 of the stream is filmed.
        hold: cycles from filming to showing.
        group: cycles that are coded together.
        cycles: length of the stream.
        clock: clock of the stream.
    """

    lead: int
    hold: int
    group: int
    cycles: int
    clock: Clock

    def due(self, stop: int) -> int:
        """Cycle of the link before which packets of the group that ends at `stop` must arrive."""
        return self.lead + stop - self.group + self.hold


class FarEnd:
    """Receiver, decoder and the wait until a block is shown: a stage after the link's camera. A run
    that resumes receives the link's recording again from its start.

    Args:
        receiver: receiver of the packets.
        decoder: decoder of the packets.
        schedule: instants at which the stream is shown.
        read_back: words `first` to `stop` of the link's recording so far.

    Attributes:
        arrivals: cycle of the link at which each packet arrived, if it did in time, its bytes with
            its length, and the cycle of the stream after its last one.
        late: packets that arrived too late.
        gaps: cycle of the stream at which each group that was not shown whole begins, its missing
            tiles, and those that were shown with the rate that they had last.
        missing: tiles of groups of which nothing has ever arrived.
        tiles: tiles of all groups shown.
    """

    def __init__(
        self, receiver: PacketReceiver, decoder: PacketDecoder, schedule: Schedule,
        read_back: ReadBack,
    ) -> None:  # fmt: skip
        self.receiver, self._decoder, self._schedule = receiver, decoder, schedule
        self._read_back = read_back
        self._waiting: deque[tuple[int, bytes]] = deque()
        self._shown = self._stepped = 0
        self.gaps: list[tuple[int, int, int]] = []
        self.arrivals: list[tuple[int, int, int]] = []
        self.late = self.missing = self.tiles = 0

    def step(self, data: Viform, block: Block) -> list[Viform]:
        """The blocks of the stream whose packets have all arrived or are lost."""
        self._waiting.extend(self.receiver.step(data))
        self._stepped = block.stop
        out: list[Viform] = []
        plan = self._schedule
        while self._shown < plan.cycles:
            stop = min(self._shown + plan.group, plan.cycles)
            due = plan.due(self._shown + plan.group)
            if self.receiver.known < due and self.receiver.received is None:
                break
            while self._waiting and self._waiting[0][0] < due:
                self._take(*self._waiting.popleft())
            out += self._blocks(stop)
        if self._shown == plan.cycles:
            self.late += len(self._waiting)
            self._waiting.clear()
        return out

    def _take(self, tick: int, packet: bytes) -> None:
        end = self._decoder.take(packet)
        if end is None:
            self.late += 1
        else:
            self.arrivals.append((tick, LENGTH + len(packet), end))

    def _blocks(self, stop: int) -> list[Viform]:
        words, missing, held = self._decoder.read(stop)
        lost, kept = int(missing.sum()), int(held.sum())
        if lost or kept:
            self.gaps.append((self._shown, lost, kept))
        self.missing += lost
        self.tiles += missing.size
        first, self._shown = self._shown, stop
        return [
            Viform(
                words[each.start // WORD : -(-each.stop // WORD)], each.cycles,
                self._schedule.clock, first + each.start,
            )
            for each in blocks(stop - first, BLOCK)
        ]  # fmt: skip

    def state(self) -> State:
        return {"stepped": np.array([self._stepped])}

    def restore(self, state: State) -> None:
        """Receives the recording again; what it gives has been shown already."""
        for block in blocks(int(state["stepped"][0]), BLOCK):
            words = self._read_back(block.start // WORD, -(-block.stop // WORD))
            self.step(Viform(words, block.cycles, self._schedule.clock, block.start), block)
