"""The best mode by simulated information: the search against all modes, and a link so bright that
nothing is lost."""

from __future__ import annotations

import numpy as np
import pytest

from link.evaluation.capacity_curves import Achievable, CellInformation
from link.mode import CELLS, Mode, ticks_chosen
from link.setting import LinkSetting, link_setting
from link.theory.soft_information import SoftInformation
from scenarios.assemble.chip import camera_setting
from scenarios.assemble.schema.loading import linked, load

MODE = Mode(128, 128, 2, 1, "scrambled", 32)
SIDES = ["link.panel.width=128", "link.panel.height=128"]


def setting(*sets: str) -> LinkSetting:
    scenario = linked(load("light-link", [*SIDES, *sets])[1], "a test")
    return link_setting(scenario, camera_setting(scenario))


class Law(CellInformation):
    """Information by a formula that grows with cell and ticks: 1 - exp(-(cell / side)^2 ticks)."""

    side = 2.0

    def of(self, cell: int, ticks: int) -> Achievable:
        bits = 1 - np.exp(-((cell / self.side) ** 2) * ticks)
        mode = Mode(128, 128, cell, ticks, "scrambled", 32)
        found = Achievable(mode, self._raw(cell, ticks), 1, SoftInformation(bits, bits, bits, 1))
        self.found[cell, ticks] = found
        return found


@pytest.mark.parametrize("side", [0.3, 1.0, 2.0, 3.7, 9.0, 30.0])
def test_the_search_finds_the_best_of_all_and_tries_few(side: float) -> None:
    every = Law(setting(), MODE, "packed", 8, 1)
    some = Law(setting(), MODE, "packed", 8, 1)
    every.side = some.side = side
    best = max(every.of(c, t).rates[0] for c in CELLS for t in ticks_chosen("scrambled"))
    assert some.best().rates[0] == best
    if side <= 9:  # beyond, all modes carry nearly the same
        assert len(some.found) <= 0.6 * len(every.found)


@pytest.mark.slow
def test_large_cells_in_long_symbols_carry_a_bit_each_and_the_rate_is_that_of_the_panel() -> None:
    found = CellInformation(setting("link.panel.phase=0"), MODE, "packed", 8, 1).of(8, 4)
    rows = 128 // 8
    cells = rows * rows - 4 * 5 * 5 - 2 * (rows - 10)  # tags of 5 x 5 cells; pilots in 2 columns
    assert found.raw_bps == pytest.approx(cells * 40e3 * (1 + 20e-6) / 4)  # 20 ppm: the panel's
    assert found.sent == 8 * cells
    assert found.bit.bits == pytest.approx(1, abs=1e-3) and found.bit.high == 1
