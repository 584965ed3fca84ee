"""Latency of a byte by stage, in the simulated machine."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import numpy.typing as npt

from cosim import Clock
from cosim.run.result import Latency, latency_rows
from link.layout import TRAINING, Layout
from link.setting import LinkSetting

LIGHT = 299_792_458.0
"""Speed of light in vacuum, m/s (BIPM, SI brochure, 9th ed.); in air it is lower by 3e-4."""


def _group_times(layout: Layout, panel: Clock, group: int) -> tuple[int, int]:
    """Start and end of a group in the panel's first row, ps after first light."""
    first = TRAINING + group * layout.group
    ticks = layout.mode.ticks
    return panel.edge(first * ticks), panel.edge((first + layout.group) * ticks)


def group_delays(
    setting: LinkSetting, layout: Layout, verified: Mapping[int, int]
) -> npt.NDArray[np.int64]:
    """Delay of every verified group, (groups,) int64 ps.

    The delay is from the group's first light on the panel to the end of the camera cycle in which
    it was verified.

    Args:
        setting, layout: the link.
        verified: cycle of verification by group.
    """
    camera, panel = setting.camera.clock, setting.panel.clock
    return np.array(
        [
            camera.edge(cycle + 1) - setting.first_light - _group_times(layout, panel, group)[0]
            for group, cycle in sorted(verified.items())
        ],
        np.int64,
    )


def link_latency(
    setting: LinkSetting, layout: Layout, verified: Mapping[int, int]
) -> list[Latency]:
    """A row for each stage, over all verified groups; together they cover the way of a byte.

    - encoder: a group leaves when it is complete; at the link's own rate its bytes arrive evenly
      while the previous group is shown;
    - panel: from a group's first plane to the end of its last one, with the scan of the rows;
    - air: the time of flight;
    - readout: from the end of the light to the camera row's latch and the cycle's end;
    - decoder: further cycles until the group was verified, by the receiver's schedule. Computing
      takes no time of the simulated machine.

    The list is empty if no group was verified.
    """
    if not verified:
        return []
    camera, panel = setting.camera.clock, setting.panel.clock
    group = _group_times(layout, panel, 0)
    length = group[1] - group[0]
    flight = round(setting.air.distance / LIGHT * 1e12)
    scan = round(setting.panel.row_delay)
    read, decode = [], []
    for number, cycle in sorted(verified.items()):
        dark = setting.first_light + _group_times(layout, panel, number)[1] + scan + flight
        at = camera.cycle_at(dark - 1)  # the cycle in which the last row's light ends
        done = camera.edge(max(at, cycle) + 1)
        latched = min(camera.edge(at + 1), done)
        read.append(max(latched - dark, 0))
        decode.append(done - latched)
    stages = {
        "encoder": [0, length // 2, length],
        "panel": [length, length + scan // 2, length + scan],
        "air": [flight],
        "readout": read,
        "decoder": decode,
    }
    return [
        row for name, ps in stages.items() for row in latency_rows(name, np.array(ps, np.int64))
    ]
