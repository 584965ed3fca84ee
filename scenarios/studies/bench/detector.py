"""Joint and packed detector: processor time of a cell's symbol, and information of a bit.

The time is that on the spikes of `link.modem`, with all cores: processor time and not
wall time, so that other load of the machine counts less. The information is that of random data on
a strip of the panel of light-link, through its air with vibration and its camera
(`link.setup.pilot`): both detectors decide the same spikes.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import partial
from typing import Any, Final

from cosim.run.timing import Row, least_of
from link.detect.detector import Detector
from link.mode import Mode
from link.setting import link_setting
from link.setup.pilot import WIDTH, film_pilot, strip_of
from link.theory.soft_information import soft_information
from scenarios.assemble.chip import camera_setting
from scenarios.assemble.schema.loading import linked, load

DETECTORS: Final = ("joint", "packed")
"""Names; the ratio of a row is over the first."""
HEIGHT: Final = 480
"""Panel pixels of the strip's height."""
PHASES: Final = (0.25, 0.5, 0.75)
"""Delays of the panel's planes after the camera's ticks, ticks."""
TICKS: Final = (1, 2)
_TURNS: Final = 5
_SEED: Final = 1


def time_rows(
    detectors: dict[str, Detector], given: tuple[Any, ...], cell_symbols: int
) -> list[Row]:
    """Rows `link.detector`, ns of processor time for a symbol of a cell.

    Args:
        detectors: detectors by name, which have learned.
        given: arguments of `Detector.soft`.
        cell_symbols: soft values of a call.
    """
    calls: list[Callable[[], Any]] = [partial(each.soft, *given) for each in detectors.values()]
    seconds = least_of(calls, _TURNS, time.process_time)
    return [
        Row(
            "link.detector", name, 1e9 * each / cell_symbols, "ns/cell-symbol", None, None,
            seconds[0] / each,
        )
        for name, each in zip(detectors, seconds, strict=True)
    ]  # fmt: skip


def information_rows() -> list[Row]:
    """Rows `link.detector`, bits of information of a bit, by ticks and phase."""
    rows = []
    for ticks in TICKS:
        mode = Mode(WIDTH, HEIGHT, 2, ticks, "scrambled", 32)
        for phase in PHASES:
            sets = [f"link.panel.phase={phase}", f"link.panel.height={HEIGHT}"]
            scenario = linked(load("light-link", sets)[1], "bench link")
            strip = strip_of(link_setting(scenario, camera_setting(scenario)))
            for name in DETECTORS:
                pilot = film_pilot(strip, mode, name, _SEED, None)
                found = soft_information(pilot.soft, pilot.sent)
                assert found is not None
                tier = f"{name}, {ticks} ticks, phase {phase:g}"
                rows.append(Row("link.detector", tier, found.bits, "bit", None, None, None))
    return rows
