"""Capacity of a link over distance, light and cell, and the information that its modes achieve
there.

The achieved information is found by simulation. A strip of the panel shows random bits through the
link's air and camera (`link.setup.pilot`). The detector's soft values give the generalised mutual
information of a bit, which a code that decides by them can reach (`link.theory.soft_information`);
times the symbols of all data cells it is a rate. The receiver's estimates of place and time are
those of the strip: known, but for the vibration. Bits are random and independent: a line code can
only lower the figure.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from link.layout import Layout
from link.mode import CELLS, Mode, ticks_chosen
from link.prediction.capacity import capacity_bps, capacity_input
from link.prediction.light import cell_scene
from link.section import LinkScenario
from link.setting import LinkSetting, link_setting
from link.setup.pilot import film_pilot, strip_of
from link.setup.truth import panel_in_view, tag_module
from link.theory.soft_information import SoftInformation, soft_information
from sensor import CameraSetting

LINE: Final = "scrambled"
"""Line of the pilots: random bits, and training of random bits."""
_BATCHES: Final = 64
"""Bands of rows whose means give the interval: bits in a band share pixels and their fixed
pattern. The position of cells between the pixels repeats over the strip, so that its share of the
spread between bands makes the interval wider than need be."""
CURVES: Final = ("distance", "luminance", "ambient", "cell")
"""Names of the curves."""
_STEP: Final = 1.02
"""Ratio of the distances at which the ends of the range are looked for."""
_STEPS: Final = 300
"""Largest number of these steps to either side: a ratio of 380."""
_BRIGHTER: Final = 4.0
"""Range of luminances: the scenario's over this, to the scenario's times this."""
_AMBIENT: Final = (100.0, 100_000.0)
"""Range of illuminances, lux: a dim room to full daylight."""
_CELLS: Final = CELLS[:6]
"""Cells of the last curve: 1 to 8 panel pixels."""


class CapacityStudy:
    """Capacity and achievable information of a link and of its neighbours."""

    def __init__(
        self, scenario: LinkScenario, camera: CameraSetting, mode: Mode, symbols: int
    ) -> None:
        """Prepares.

        Args:
            scenario: the link; its lens is kept at all points.
            camera: camera of the scenario.
            mode: mode of the transmission.
            symbols: number of symbols of random data that a pilot decides.

        Raises:
            InputError: if the scenario cannot be simulated.
        """
        self._camera, self._mode, self._symbols = camera, mode, symbols
        setting = link_setting(scenario, camera)
        aim = scenario.link.aim.model_copy(update={"f_number": setting.optics.f_number})
        self._scenario = _with(scenario, aim=aim)
        self._home = self._point(0.0, self._scenario)

    def _point(self, x: float, scenario: LinkScenario) -> _Point:
        setting = link_setting(scenario, self._camera)
        detector = scenario.link.modem.detector
        return _Point(x, setting, CellInformation(
            setting, self._mode, detector, self._symbols, scenario.seed
        ))  # fmt: skip

    def document(self) -> dict[str, Any]:
        """Information of the run's mode and of the best mode, at the scenario's own distance and
        light; null where a receiver cannot find the panel."""
        mine, best = self._figures(self._home)
        tried = self._home.information.found.values()
        return {
            **_rates("information", mine),
            "information_bit": None if mine is None else mine.bit.bits,
            "information_best": _best(best),
            "tried": [_best(one) for one in sorted(tried, key=lambda one: -one.raw_bps)],
            "phase": self._home.setting.phase,
        }

    def curve(self, name: str, points: int, on_point: Callable[[], None]) -> dict[str, Any]:
        """A curve of CURVES as a document.

        Args:
            name: name of the curve.
            points: number, but for that of cells, which has one for each cell.
            on_point: called after each point.
        """
        title, unit, marks, made = {
            "distance": self._distance, "luminance": self._luminance, "ambient": self._ambient,
            "cell": self._cells,
        }[name](points)  # fmt: skip
        rows: list[dict[str, Any]] = []
        for point in made:
            mine, best = self._figures(point)
            mode = self._mode if point.cell is None else replace(self._mode, cell=point.cell)
            bound = capacity_bps(capacity_input(point.setting, cell_scene(point.setting), mode))
            row = {"x": point.x, "capacity_bps": bound, **_rates("information", mine)}
            cell_and_ticks = None if best is None else {
                "cell": best.mode.cell, "ticks": best.mode.ticks
            }  # fmt: skip
            rows.append({**row, **_rates("best", best), "best_mode": cell_and_ticks})
            on_point()
        columns = {key: [row[key] for row in rows] for key in rows[0]}
        return {"name": name, "title": title, "x_unit": unit, "marks": marks, **columns}

    def _figures(self, point: _Point) -> tuple[Achievable | None, Achievable | None]:
        if not can_be_read(point.setting, self._mode):
            return None, None
        mine = point.information.of(point.cell or self._mode.cell, self._mode.ticks)
        cells = CELLS if point.cell is None else (point.cell,)
        return mine, point.information.best(cells, ticks_chosen(LINE))

    def _varied(self, x: float, own: float, changed: Callable[[float], LinkScenario]) -> _Point:
        """The point of a value; the scenario's own keeps what is simulated."""
        if np.isclose(x, own):
            return replace(self._home, x=own)
        return self._point(x, changed(x))

    def _distance(self, points: int) -> tuple[str, str, list[float], list[_Point]]:
        own = self._home.setting.air.distance

        def at(distance: float) -> LinkScenario:
            return _with(self._scenario, distance=distance * 1e6)

        def holds(distance: float) -> bool:
            return can_be_read(link_setting(at(distance), self._camera), self._mode)

        near = far = own
        if holds(own):
            near, far = _last(holds, own, 1 / _STEP), _last(holds, own, _STEP)
        marks = _spread(near, far, own, points)
        return "distance", "m", [near, far], [self._varied(x, own, at) for x in marks]

    def _luminance(self, points: int) -> tuple[str, str, list[float], list[_Point]]:
        panel = self._scenario.link.panel
        own = panel.luminance

        def at(luminance: float) -> LinkScenario:
            return _with(self._scenario, panel=panel.model_copy(update={"luminance": luminance}))

        marks = _spread(own / _BRIGHTER, own * _BRIGHTER, own, points)
        return (
            "luminance of the panel, at the same lens", "cd/m2", [own],
            [self._varied(x, own, at) for x in marks],
        )  # fmt: skip

    def _ambient(self, points: int) -> tuple[str, str, list[float], list[_Point]]:
        air = self._scenario.link.air
        own = air.ambient

        def at(ambient: float) -> LinkScenario:
            return _with(self._scenario, air=air.model_copy(update={"ambient": ambient}))

        marks = _spread(*_AMBIENT, own, points)
        return ("illuminance of the room", "lux", [own], [self._varied(x, own, at) for x in marks])

    def _cells(self, points: int) -> tuple[str, str, list[float], list[_Point]]:
        made = [replace(self._home, x=float(cell), cell=cell) for cell in _CELLS]
        title = f"side of a cell, with symbols of {_ticks(self._mode.ticks)} and of any length"
        return title, "panel pixels", [float(self._mode.cell)], made


def can_be_read(setting: LinkSetting, mode: Mode) -> bool:
    """Whether a receiver can find the panel: all of it in view, tags large enough."""
    module, least = tag_module(setting, mode)
    return panel_in_view(setting) and module >= least


@dataclass(frozen=True)
class Achievable:
    """Information of a mode.

    Attributes:
        mode: the mode.
        raw_bps: a bit of every data cell in every symbol, bit/s.
        sent: bits of the pilot.
        bit: information of a bit, with its 99.9 % interval.
    """

    mode: Mode
    raw_bps: float
    sent: int
    bit: SoftInformation

    @property
    def rates(self) -> tuple[float, float, float]:
        """Information of all data cells and the ends of its interval, bit/s."""
        return (
            self.raw_bps * self.bit.bits, self.raw_bps * self.bit.low, self.raw_bps * self.bit.high
        )  # fmt: skip


class CellInformation:
    """Information of modes of one link; each cell and symbol length is simulated once.

    Attributes:
        found: what has been simulated, by (cell, ticks).
    """

    def __init__(
        self, setting: LinkSetting, mode: Mode, detector: str, symbols: int, seed: int
    ) -> None:
        """Prepares.

        Args:
            setting: the link.
            mode: mode of the transmission; other modes differ from it in cell, ticks and line.
            detector: name, of `link.detect.catalogue.DETECTORS`.
            symbols: number of symbols of random data that a pilot decides.
            seed: seed of the data.
        """
        self._setting, self._mode, self._detector = setting, mode, detector
        self._symbols, self._seed = symbols, seed
        self.found: dict[tuple[int, int], Achievable] = {}

    @cached_property
    def _strip(self) -> LinkSetting:
        return strip_of(self._setting)

    def _raw(self, cell: int, ticks: int) -> float:
        mode = replace(self._mode, cell=cell, ticks=ticks, line=LINE)
        return Layout(mode).cells * self._setting.panel.clock.hz / ticks

    def of(self, cell: int, ticks: int) -> Achievable:
        """Information of a cell and a symbol length."""
        if (cell, ticks) not in self.found:
            mode = replace(self._mode, cell=cell, ticks=ticks, line=LINE)
            narrow = replace(mode, width=self._strip.optics.width)
            pilot = film_pilot(self._strip, narrow, self._detector, self._seed, None, self._symbols)
            layout = Layout(narrow)
            band = layout.data // layout.shape[1] * _BATCHES // layout.shape[0]
            bands = np.broadcast_to(band, pilot.soft.shape)
            bit = soft_information(pilot.soft.ravel(), pilot.sent.ravel(), bands.ravel())
            assert bit is not None
            self.found[cell, ticks] = Achievable(mode, self._raw(cell, ticks), pilot.sent.size, bit)
        return self.found[cell, ticks]

    def best(
        self, cells: Iterable[int] = CELLS, ticks: Iterable[int] = ticks_chosen(LINE)
    ) -> Achievable:
        """Mode with the highest information of these.

        A mode is not simulated where it cannot be the best: if its raw rate is no higher, or if a
        mode with cells and symbols at least as large carries too little in a bit. A bit of a
        larger cell or a longer symbol is taken to carry no less.
        """
        lengths = tuple(ticks)
        left = sorted(((c, t) for c in cells for t in lengths), key=lambda m: self._raw(*m))
        if not left:
            raise ValueError("cells and ticks must hold at least one mode, not none")
        best = None
        while left:
            known = [m for m in left if m in self.found]
            now = self.of(*(known[0] if known else left[len(left) // 2]))
            if best is None or now.rates[0] > best.rates[0]:
                best = now
            least = best.rates[0]
            left = [m for m in left if m != _key(now) and self._most(*m) > least]
        assert best is not None
        return best

    def _most(self, cell: int, ticks: int) -> float:
        """An upper limit of a mode's information, bit/s, by those that are known."""
        bits = [
            one.bit.high for one in self.found.values()
            if one.mode.cell >= cell and one.mode.ticks >= ticks
        ]  # fmt: skip
        return self._raw(cell, ticks) * min(bits, default=1.0)


def _key(one: Achievable) -> tuple[int, int]:
    return one.mode.cell, one.mode.ticks


@dataclass(frozen=True)
class _Point:
    x: float
    setting: LinkSetting
    information: CellInformation
    cell: int | None = None
    """Side of all cells; None for the mode's, and any for the best."""


def _ticks(count: int) -> str:
    return "1 tick" if count == 1 else f"{count} ticks"


def _with(scenario: LinkScenario, **link: Any) -> LinkScenario:
    """Scenario with other values in its [link]."""
    return scenario.model_copy(update={"link": scenario.link.model_copy(update=link)})


def _last(holds: Callable[[float], bool], start: float, ratio: float) -> float:
    """The last of start, start ratio, start ratio^2, ... up to which `holds`."""
    at = start
    for _ in range(_STEPS):
        if not holds(at * ratio):
            break
        at *= ratio
    return at


def _spread(low: float, high: float, own: float, points: int) -> npt.NDArray[np.float64]:
    """Values evenly spread in their logarithm, the nearest one moved to the own."""
    marks = np.geomspace(low, high, points) if high > low else np.array([low])
    if low <= own <= high:
        marks[np.abs(np.log(marks / own)).argmin()] = own
    return marks


def _rates(name: str, one: Achievable | None) -> dict[str, float | None]:
    low_high = (None, None, None) if one is None else one.rates
    return dict(zip((f"{name}_bps", f"{name}_low", f"{name}_high"), low_high, strict=True))


def _best(one: Achievable | None) -> dict[str, Any] | None:
    if one is None:
        return None
    return {
        "cell": one.mode.cell, "ticks": one.mode.ticks, "raw_bps": one.raw_bps,
        "information_bit": one.bit.bits, **_rates("information", one), "bits_sent": one.sent,
    }  # fmt: skip
