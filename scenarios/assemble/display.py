"""The display of a scenario as its error is told: the panel and the observer that is chosen."""

from __future__ import annotations

from collections.abc import Sequence

from display import DisplaySetting
from display.observe.showing import observers_of, panel_of
from scenarios.assemble.scenario import Scenario
from sensor import CameraSetting

__all__ = ["display_of"]


def display_of(
    scenario: Scenario, setting: CameraSetting, white_rate: float, instants: Sequence[int],
    cycles: int, velocity: float | None = None,
) -> DisplaySetting | None:  # fmt: skip
    """Everything of the display, None where the scenario has none.

    white_rate: spikes a cycle. instants: cycles. velocity: pixels a second of the pursuing eye
    where the section says none; without either it keeps still. The light that there is ends with
    the last row of the last plane: an eye's response cut within a plane would be an error of spans
    of planes that no display makes.
    """
    section = scenario.display
    if section is None:
        return None
    panel = panel_of(section, setting, white_rate)
    speed = velocity if section.pursuit is None else section.pursuit
    at = [setting.clock.middle(n) for n in instants]
    end = panel.start(cycles) + round(panel.row_delay)
    return DisplaySetting(panel, observers_of(section, at, end, speed or 0.0)[section.observer])
