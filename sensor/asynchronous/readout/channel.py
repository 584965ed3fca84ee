"""The shared output channel: many pixels, one bus, one event at a time.

Address-event representation (AER): a pixel that fires asks for the bus, an arbiter chooses among
those that ask, and the event crosses in a fixed time (Mahowald, thesis, Caltech 1992; Boahen, IEEE
Trans. Circuits Syst. II 47:416, 2000). What finds its place taken is lost here; a chip whose pixels
wait to be acknowledged before they reset would lose light instead, which is not modelled.

Arbitration: `fifo`, in order of asking; `priority`, the topmost row that asks, its leftmost pixel
(a daisy chain); `round-robin`, the next row that asks after the one served last, as a token that
goes round the rows grants it (Imam and Manohar, ASYNC 2011). Buffer: `pixel`, each pixel holds one
event until the bus takes it; `row`, each row does; `fifo`, one queue of `depth` events for all,
served in order.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final, Literal

import numpy as np
import numpy.typing as npt
from numba import njit

from cosim.stage import section
from sensor.asynchronous.model import Firings

Arbitration = Literal["fifo", "priority", "round-robin"]
Buffer = Literal["pixel", "row", "fifo"]

_RULE: Final = {"fifo": 0, "priority": 1, "round-robin": 2}
_PLACE: Final = {"pixel": 0, "row": 1, "fifo": 2}


@dataclass(frozen=True)
class ChannelModel:
    """The rules of the channel.

    Attributes:
        service: time that an event occupies the bus, ps.
        arbitration, buffer: see above.
        depth: depth of the common queue, without the event on the bus; for the `fifo` buffer.
    """

    service: int
    arbitration: Arbitration = "fifo"
    buffer: Buffer = "pixel"
    depth: int = 0

    def __post_init__(self) -> None:
        if self.service < 1 or self.depth < 0:
            raise ValueError("service must be 1 ps or more, depth 0 or more")
        if self.buffer == "fifo" and self.arbitration != "fifo":
            raise ValueError("a common queue must be served in order, by arbitration fifo")


@dataclass(frozen=True, eq=False)
class Sent:
    """Events that have crossed.

    Attributes:
        firings: firings in the order in which they left.
        leaves: instant at which each had crossed, ps, (n,) int64.
    """

    firings: Firings
    leaves: npt.NDArray[np.int64]

    @property
    def delay(self) -> npt.NDArray[np.int64]:
        """Time from the firing to the end of the crossing, picoseconds."""
        return self.leaves - self.firings.instant


@njit(cache=True, nogil=True)
def _choose(waiting, row_count, rule, last_row):  # type: ignore[no-untyped-def]
    """The event that a fixed priority or the token of the rows grants."""
    rows = row_count.size
    width = waiting.size // rows
    row = 0 if rule == 1 else (last_row + 1) % rows
    while row_count[row] == 0:
        row = (row + 1) % rows
    place = row * width
    while waiting[place] < 0:
        place += 1
    return waiting[place]


# A compiled kernel takes its arrays one by one: a record of them would be taken apart each call.
@njit(cache=True, nogil=True)
def _serve(  # type: ignore[no-untyped-def]
    instant, pixel, carried, stop, service, rule, buffer, depth, free, last_row, columns, waiting,
    row_count, begins, lost,
):  # fmt: skip
    """Takes firings in order of asking and serves until `stop`, that included.

    The first `carried` wait since an earlier call.

    Args:
        waiting: the event in each place (pixel or row), -1 for none; unused by a common queue.
        row_count: events that wait in each row.
        begins: instant each is put on the bus, left as it is while it waits.
        lost: firings that found no place. Gives (instant the bus is free, the row served last).
    """
    n = instant.size
    queue = np.empty(n, np.int64)
    head, tail, asked = 0, 0, 0
    for i in range(n + 1):
        # What asks at one instant competes, so the bus takes nothing at `now` itself.
        now = stop + 1 if i == n else instant[i]
        while i >= carried and tail > head and max(free, asked) < now:
            chosen = queue[head] if rule == 0 else _choose(waiting, row_count, rule, last_row)
            head += 1
            if buffer < 2:
                row = pixel[chosen] // columns
                waiting[pixel[chosen] if buffer == 0 else row] = -1
                row_count[row] -= 1
                last_row = row
            begins[chosen] = max(free, asked)
            free = begins[chosen] + service
        if i == n:
            break
        row = pixel[i] // columns
        if i >= carried:
            if buffer == 2:
                lost[i] = tail - head >= depth + (0 if free > now else 1)
            else:
                lost[i] = waiting[pixel[i] if buffer == 0 else row] >= 0
            if lost[i]:
                continue
        if tail == head:
            asked = now
        if buffer < 2:
            waiting[pixel[i] if buffer == 0 else row] = i
            row_count[row] += 1
        queue[tail] = i
        tail += 1
    return free, last_row


class Channel:
    """A channel that serves an array of `shape` pixels, step by step.

    offered, lost: firings so far. waiting: those that have not been put on the bus yet.
    """

    def __init__(self, model: ChannelModel, shape: tuple[int, int]) -> None:
        self.model, self._shape = model, shape
        self._free, self._row = 0, -1
        self._held = Firings.join([])
        self.offered = self.lost = 0

    def state(self) -> dict[str, npt.NDArray[Any]]:
        """Everything the next step depends on."""
        counts = np.array([self._free, self._row, self.offered, self.lost])
        return {"counts": counts} | {f"held/{k}": v for k, v in self._held.state().items()}

    def restore(self, state: Mapping[str, npt.NDArray[Any]]) -> None:
        """Go on from a `state`."""
        self._free, self._row, self.offered, self.lost = (int(n) for n in state["counts"])
        self._held = Firings.of_state(section(state, "held"))

    @property
    def waiting(self) -> int:
        return len(self._held)

    def step(self, firings: Firings, stop: int) -> Sent:
        """What was put on the bus up to `stop` (ps); firings: those since the last step."""
        model, (rows, columns) = self.model, self._shape
        carried = len(self._held)
        asking = Firings.join([self._held, firings])
        n = len(asking)
        begins, lost = np.full(n, -1, np.int64), np.zeros(n, np.bool_)
        places = rows * columns if model.buffer == "pixel" else rows
        self._free, self._row = _serve(
            asking.instant, asking.pixel.astype(np.int64), carried, stop, model.service,
            _RULE[model.arbitration], _PLACE[model.buffer], model.depth, self._free, self._row,
            columns, np.full(places, -1, np.int64), np.zeros(rows, np.int64), begins, lost,
        )  # fmt: skip
        self.offered += len(firings)
        self.lost += int(lost.sum())
        self._held = asking.take((begins < 0) & ~lost)
        gone = np.flatnonzero(begins >= 0)
        gone = gone[np.argsort(begins[gone], kind="stable")]
        return Sent(asking.take(gone), begins[gone] + model.service)
