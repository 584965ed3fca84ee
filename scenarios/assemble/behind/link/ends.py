"""The two ends of a link in the chain of a run, and the stages in its clock.

At the near end the stream becomes packets, which wait until the panel has room. At the far end the
spikes of the link's camera become packets, and these the stream to show. Cycle n of the stream is
shown `lead + n + hold` cycles after the link has started, so packets that arrive later than that
are lost to it. What is shown depends on the simulated time of their arrival only, never on the time
that decoding takes.

The link starts before its stream, and what arrives is shown later than it was sent. The chain
counts the cycles of the link. Its stages before the link run `lead` cycles late (`Later`); those
after it run whenever the decoder has a block for them (`EachBlock`).
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from cosim import Clock
from cosim.spikes.viform import WORD, Viform, Words
from cosim.stage import BLOCK, Block, Stage, State, Stateful, WithFiles, blocks
from link.coding.stream_boxes import StreamOutbox
from link.receiving.packets import PacketReceiver
from link.sending import Transmission
from link.setup.stream import StreamSetup
from scenarios.assemble.behind.link.coding import Decoder, Sender
from sensor.codec.packets.packet import LENGTH

ReadBack = Callable[[int, int], Words]


class NearEnd:
    """Coder, send buffer and the panel's frames: a stage after the camera, and the source of what
    the panel shows.

    Args:
        sender: coder and buffer.
        setup: the link.

    Attributes:
        sent: the transmission, which takes packets as the panel needs them.
    """

    def __init__(self, sender: Sender, setup: StreamSetup) -> None:
        self.sender, self._setup = sender, setup
        self._outbox = StreamOutbox(setup.form, setup.blocks, self._ready)
        self.sent = Transmission(setup.mode, self._outbox)

    def _ready(self, block: int) -> bytes | None:
        return self.sender.pop(self._setup.made_at(block))

    def step(self, data: Viform | None, block: Block) -> Viform | None:
        """Codes a block of the stream; None before and after it."""
        if data is not None:
            self.sender.put(data)
        return data

    def state(self) -> State:
        return {
            f"{name}/{key}": value
            for name, part in self._parts().items()
            for key, value in part.state().items()
        }

    def restore(self, state: State) -> None:
        for name, part in self._parts().items():
            prefix = f"{name}/"
            part.restore(
                {k.removeprefix(prefix): v for k, v in state.items() if k.startswith(prefix)}
            )

    def _parts(self) -> dict[str, Sender | StreamOutbox | Transmission]:
        return {"sender": self.sender, "outbox": self._outbox, "panel": self.sent}


@dataclass(frozen=True)
class Schedule:
    """When cycles of the stream are shown, in cycles of the link.

    Attributes:
        lead: cycle of the link at which cycle 0 of the stream is filmed.
        hold: cycles from filming to showing.
        group: cycles that are coded together.
        step: cycles from the begin of one group to that of the next, of other tiles.
        cycles: length of the stream.
        clock: clock of the stream.
    """

    lead: int
    hold: int
    group: int
    step: int
    cycles: int
    clock: Clock

    def due(self, first: int) -> int:
        """Cycle of the link before which packets of groups that begin at `first` must arrive."""
        return self.lead + first + self.hold


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
            its length, and the cycle of the stream from which on it could be sent.
        late: packets that arrived too late.
        gaps: cycle of the stream at which each group that was not shown whole begins, its missing
            tiles, and those that were shown with the rate that they had last.
        missing: tiles of groups of which nothing has ever arrived.
        tiles: tiles of all groups shown.
    """

    def __init__(
        self, receiver: PacketReceiver, decoder: Decoder, schedule: Schedule,
        read_back: ReadBack,
    ) -> None:  # fmt: skip
        self.receiver, self._decoder, self._schedule = receiver, decoder, schedule
        self._read_back = read_back
        self._waiting: deque[tuple[int, bytes]] = deque()
        self._shown = self._begun = self._stepped = 0
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
            due = plan.due(self._begun)
            if self.receiver.known < due and self.receiver.received is None:
                break
            while self._waiting and self._waiting[0][0] < due:
                self._take(*self._waiting.popleft())
            self._decoder.due(self._begun)
            self._begun += plan.step
            stop = min(self._shown + plan.group, plan.cycles)
            if self._begun >= stop:
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
        words, missing, held, said = self._decoder.read(stop)
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
                tuple(e for e in said if each.start <= e.cycle - first < each.stop),
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


class _Wrapped:
    """A stage with the state of another one, `stage`."""

    def __init__(self, stage: Stage) -> None:
        self.stage = stage
        self.one_thread = getattr(stage, "one_thread", False)

    def state(self) -> State:
        return self.stage.state() if isinstance(self.stage, Stateful) else {}

    def restore(self, state: State) -> None:
        if isinstance(self.stage, Stateful):
            self.stage.restore(state)

    def damage(self, state: State, checked: Callable[[int, int], None]) -> str | None:
        return self.stage.damage(state, checked) if isinstance(self.stage, WithFiles) else None


def bare(stage: Any) -> Any:
    """A stage without what has put it into the clock of a link."""
    return stage.stage if isinstance(stage, _Wrapped) else stage


class Later(_Wrapped):
    """A stage that begins `lead` cycles after the chain and runs for `cycles` cycles.

    Args:
        stage: the stage.
        lead: a multiple of the chain's blocks, so that its blocks are those of a run by itself.
        cycles: length of its run.
    """

    def __init__(self, stage: Stage, lead: int, cycles: int) -> None:
        super().__init__(stage)
        self._lead, self._cycles = lead, cycles

    def step(self, data: Any, block: Block) -> Any:
        """The stage's output for its part of the block; None before and after its run."""
        start = max(block.start - self._lead, 0)
        stop = min(block.stop - self._lead, self._cycles)
        return self.stage.step(data, Block(start, stop - start)) if stop > start else None


class EachBlock(_Wrapped):
    """A stage that takes any number of blocks at a time."""

    def step(self, data: list[Viform], block: Block) -> list[Viform]:
        """The blocks, each after the stage."""
        return [self.stage.step(each, Block(each.start, each.cycles)) for each in data]
