"""The recording of events: firings pass the channel and become one stream."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from cosim import Events
from cosim.compute.memory import check_memory
from cosim.config.amounts import count
from cosim.run.result import Metric
from cosim.stage import section
from sensor.asynchronous.model import EventModel, Firings, latched
from sensor.asynchronous.readout.channel import Channel

STREAM = "stream.events.npz"
"""The event stream's name in a run's folder."""

STREAM_BYTES = 70
"""Memory that each event takes beside the firings themselves while the stream is made of them:
another copy in the stream's order, and the stream's own columns."""

_DRAINED = 2**62
_FEWER = "shorten duration, or send changes alone (sensor.asynchronous.change, 8 for example)"
Instants = npt.NDArray[np.int64]


@dataclass
class Output:
    """Takes firings step by step.

    Attributes:
        channel: shared output; None lets every event leave as its pixel fires.
        stop: end of the run, ps.
        pixels: number of pixels of the array.
        stamped_late: whether the time stamp is taken as an event leaves the channel. What leaves
            after the end is then under way and not in the stream. Otherwise the recording waits for
            all that has fired.
        parts, leaves: firings that have crossed, and when, ps.
        offered: number of firings so far.
        turns: turns of the pixels' loop.
        fired: whether a pixel has fired at all, (pixels,) bool.
    """

    channel: Channel | None
    stop: int
    pixels: int
    stamped_late: bool = False
    parts: list[Firings] = field(default_factory=list)
    leaves: list[Instants] = field(default_factory=list)
    offered: int = 0
    turns: int = 0
    fired: npt.NDArray[np.bool_] = field(init=False)

    def __post_init__(self) -> None:
        self.fired = np.zeros(self.pixels, np.bool_)

    @property
    def lost(self) -> int:
        return 0 if self.channel is None else self.channel.lost

    def step(self, firings: Firings, start: int, stop: int) -> None:
        """What fired from `start` to `stop`, ps."""
        self.offered += len(firings)
        self.turns += firings.work
        self.fired[firings.pixel] = True
        if self.channel is None:
            self.parts.append(firings)
            return
        sent = self.channel.step(firings, stop)
        self.parts.append(sent.firings)
        self.leaves.append(sent.leaves)

    def state(self) -> dict[str, npt.NDArray[Any]]:
        """The recording so far, and what the next step depends on."""
        self.parts, self.leaves = [Firings.join(self.parts)], [self._left()]
        state = {
            "counts": np.array([self.offered, self.turns]), "fired": self.fired,
            "leaves": self.leaves[0],
        }  # fmt: skip
        parts = {"crossed": self.parts[0].state()}
        if self.channel is not None:
            parts["channel"] = self.channel.state()
        for name, part in parts.items():
            state |= {f"{name}/{key}": value for key, value in part.items()}
        return state

    def restore(self, state: Mapping[str, npt.NDArray[Any]]) -> None:
        """Go on from a `state`."""
        self.offered, self.turns = (int(n) for n in state["counts"])
        self.fired, self.leaves = state["fired"], [state["leaves"]]
        self.parts = [Firings.of_state(section(state, "crossed"))]
        if self.channel is not None:
            self.channel.restore(section(state, "channel"))

    def _left(self) -> Instants:
        return np.concatenate([*self.leaves, np.zeros(0, np.int64)])

    def crossed(self) -> tuple[Firings, Instants]:
        """What the stream holds, in the order it left, and when it left, ps."""
        if self.channel is not None and not self.stamped_late:
            rest = self.channel.step(Firings.join([]), _DRAINED)
            self.parts.append(rest.firings)
            self.leaves.append(rest.leaves)
        count = sum(len(part) for part in self.parts)
        check_memory(f"the {count:,} events", STREAM_BYTES * count, _FEWER)
        firings = Firings.join(self.parts)
        if self.channel is None:
            self.parts = [firings]
            return firings, firings.instant
        leaves = self._left()
        self.parts, self.leaves = [firings], [leaves]  # a checkpoint may still be written
        inside = leaves <= (self.stop if self.stamped_late else _DRAINED)
        if inside.all():
            return firings, leaves
        return firings.take(inside), leaves[inside]

    def metrics(self, carried: int) -> dict[str, Metric]:
        """Offered = carried + lost + under way; the load is the share of time the bus needs."""
        figures = {
            "events_offered": Metric(float(self.offered), "1"),
            "events_carried": Metric(float(carried), "1"),
            "events_lost": Metric(float(self.lost), "1"),
            "events_under_way": Metric(float(self.offered - self.lost - carried), "1"),
        }
        if self.channel is not None:
            load = self.offered * self.channel.model.service / self.stop
            figures["channel_load"] = Metric(load, "1")
        return figures

    def losses(self) -> list[str]:
        """What a user must know of lost events."""
        if not self.lost:
            return []
        return [
            f"{count(self.lost)} of {count(self.offered)} events found their "
            "place taken and are lost: raise sensor.channel.rate, or send changes alone "
            "(sensor.asynchronous.change)"
        ]


def gather_events(
    firings: Firings, stamps: Instants, model: EventModel, shape: tuple[int, int], stop: int,
    begin: int = 0,
) -> Events:  # fmt: skip
    """The stream as it is read out, stamped with `stamps` (ps), from the tick that begins at
    `begin` to `stop`, ps."""
    ticks = latched(stamps, model.tick)
    ordered = firings
    if (ticks[1:] < ticks[:-1]).any():
        order = np.argsort(ticks, kind="stable")
        ordered, ticks = firings.take(order), ticks[order]
    return Events(
        (ordered.pixel // shape[1]).astype(np.uint16),
        (ordered.pixel % shape[1]).astype(np.uint16),
        ticks,
        ordered.width,
        shape,
        -(-stop // model.tick) - begin // model.tick,
        model.clock,
        begin // model.tick,
        level=ordered.level if model.longest else None,
        levels=model.levels,
    )
