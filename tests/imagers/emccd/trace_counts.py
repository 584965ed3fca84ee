"""What a cycle's trace holds, counted in its signals alone: exposure, frame time, rows, pixels."""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

from imagers.emccd.device.sequencer import Cycle, Phase, signal_changes


class Counted(NamedTuple):
    """Clocks of the frame and of the exposure; pulses of the image's and the store's clock; rows
    that leave by the register; pixel clocks; pixels of the columns; rows dumped before and after.
    """

    clocks: int
    exposure: int
    image_shifts: int
    store_shifts: int
    rows: int
    pixel_clocks: int
    columns: int
    before: int
    after: int


def counted(cycle: Cycle) -> Counted:
    """Counts one cycle's trace. The exposure ends with the second transfer's first pulse, and
    began a row's clocks after the first transfer's last one."""
    since: dict[str, int] = {}
    high: dict[str, int] = {}
    rises: dict[str, int] = {}
    dumped: dict[int, int] = {}
    shifts: list[int] = []
    phase, begun, ended = Phase.WAIT, None, 0
    for edge, name, value in signal_changes(cycle):
        if name == "phase":
            phase = Phase(value)
            begun = edge if begun is None else begun
            ended = edge
        elif value and name not in since:
            since[name] = edge
            rises[name] = rises.get(name, 0) + 1
            if name == "image_clock":
                shifts.append(edge)
            if name == "store_clock":
                dumped[phase] = dumped.get(phase, 0) + 1
        elif not value and name in since:
            high[name] = high.get(name, 0) + edge - since.pop(name)
    gap = max(later - sooner for sooner, later in pairwise(shifts))
    return Counted(
        clocks=ended - (begun or 0),
        exposure=gap - cycle.timing.transfer,
        image_shifts=rises["image_clock"],
        store_shifts=rises["store_clock"],
        rows=rises["register_clock"],
        pixel_clocks=high["register_clock"],
        columns=high["line_sync"],
        before=dumped.get(Phase.DUMP_BEFORE, 0),
        after=dumped.get(Phase.DUMP_AFTER, 0),
    )
