"""The mode of a link: given by its modem, or the best of those that this leaves open."""

from __future__ import annotations

import math
import time
from dataclasses import replace

import numpy as np

from cosim import InputError
from cosim.compute.opencl import Device
from cosim.config.amounts import at_most
from cosim.run.progress import Progress, duration_text
from link.mode import CELLS, LINE_CODES, RATES, Mode, Modem, codes_of, ticks_chosen
from link.prediction.error_bound import LEAST_CELL
from link.prediction.light import cell_scene
from link.receiving.tags import LEAST_MODULE
from link.setting import LinkSetting
from link.setup.adapting import Course
from link.setup.choosing import Choice, Trial, choose, foresee
from link.setup.pilot import film_pilot, strip_of
from link.setup.truth import panel_in_view, tag_module

_TRIED = 8
"""Largest number of modes that are tried."""
_DRIFT = 0.02
"""Drift of the phase while a file is sent, ticks, from which a mode is tried at its end as well."""
_STEP, _FINE = 0.25, 0.0625
"""Largest distance of the phases at which a mode is tried, ticks; _FINE where blocks may have a
rate each and symbols have one tick, whose information depends most on the phase."""
_RESOLVED = 0.5
"""Side of a cell, camera pixels, below which no light of it can be told from its neighbours': the
receiver does not look for smaller ones."""
_LONG = 60.0
"""Time of the pilots from which on it is told beforehand, s."""
_NEVER = 0.8
"""Share of the required size of a tag's module below which tags were never detected, in a sharp
image."""


def tag_warning(setting: LinkSetting, mode: Mode) -> str | None:
    """A warning if the tags are too small to be detected, else None."""
    module, least = tag_module(setting, mode)
    if module >= least:
        return None
    blurred = ", or make the image sharper" if least > LEAST_MODULE else ""
    return (
        f"tags too small: a module of theirs has {module:.2g} camera pixels and is found from "
        f"{least:.2g} on; step nearer, or take a longer lens or a larger panel{blurred}"
    )


def check_reach(setting: LinkSetting) -> None:
    """Raises InputError for a panel so far away that not even its largest cells can be told apart:
    nothing that it shows can be read, and the light of thousands of its pixels for each of the
    camera's would take much memory to add up."""
    largest, here = CELLS[-1] * setting.scale, setting.air.distance
    if largest >= _RESOLVED:
        return
    focal = setting.optics.focal_length
    most = focal + (here - focal) * largest / _RESOLVED
    raise InputError(
        "link.distance",
        f"at most {at_most(most, 3)} m, where the largest cells, {CELLS[-1]} panel pixels "
        f"wide, have {_RESOLVED:g} camera pixels", f"{here:g} m",
        "step nearer, or give a longer link.aim.focal_length or a larger link.panel.pitch",
    )  # fmt: skip


def fixed_mode(modem: Modem, panel: tuple[int, int]) -> Mode | None:
    """Mode of a modem on a panel of (height, width); None if a part of it is to be chosen."""
    parts = modem.cell, modem.ticks, modem.line
    codes = _codes(modem, modem.line)
    if "auto" in parts or len(codes) != 1:
        return None
    return Mode(panel[1], panel[0], *parts, *codes[0])


def _codes(modem: Modem, line: str) -> list[tuple[int | None, float | None]]:
    """Parities and rates that the modem leaves open with a line code."""
    return [
        (parity, rate) for parity, rate in codes_of(line)
        if modem.code in ("auto", "reed-solomon" if rate is None else "ldpc")
        and (modem.parity == "auto" or parity == modem.parity)
        and (modem.rate == "auto" or rate == modem.rate)
    ]  # fmt: skip


def _candidates(modem: Modem, setting: LinkSetting, adaptive: bool) -> list[Mode]:
    """Modes that the modem leaves open, with cells somewhat larger than a camera pixel. adaptive:
    whether blocks may have a rate each; such modes are the last ones.

    The line code `none`, which is that of earlier recordings, is only chosen on request.
    """
    size = setting.panel.shape[1], setting.panel.shape[0]
    cells = [c for c in CELLS if c * setting.scale >= LEAST_CELL] or [CELLS[-1]]
    symbols = [
        (cell, ticks, line)
        for cell in (cells if modem.cell == "auto" else [modem.cell])
        for line in (LINE_CODES[1:] if modem.line == "auto" else [modem.line])
        for ticks in (ticks_chosen(line) if modem.ticks == "auto" else [modem.ticks])
    ]
    modes = [
        Mode(*size, cell, ticks, line, parity, rate)
        for cell, ticks, line in symbols
        for parity, rate in _codes(modem, line)
    ]
    return modes + [
        Mode(*size, cell, ticks, line, None, adaptive=True)
        for cell, ticks, line in symbols
        if adaptive and line == "scrambled"
    ]


def _may_adapt(modem: Modem, setting: LinkSetting) -> bool:
    """Whether blocks may have a rate each: where the modem asks for it, and where it leaves the
    code open and the phase drifts."""
    if modem.rate == "adaptive":
        return True
    drifts = setting.camera.clock.hz != setting.panel.clock.hz
    return drifts and modem.rate == modem.parity == "auto" and modem.code in ("auto", "ldpc")


def _delays(setting: LinkSetting, mode: Mode, size: int, step: float = _STEP) -> list[int]:
    """How much later the planes come at the phases at which a mode is tried, ps: 0, and those that
    the clocks drift through while a file of `size` bytes is sent, at most a tick."""
    period = setting.camera.clock.edge(1)
    ratio = setting.camera.clock.hz / setting.panel.clock.hz
    goodput = foresee(mode, 0.0, size, setting.panel.clock.hz)[2]
    ticks = 8 * size * setting.panel.clock.hz / goodput if goodput else 0.0
    drift = float(np.clip((ratio - 1) * ticks, -1, 1))
    if abs(drift) < _DRIFT:
        return [0]
    steps = max(math.ceil(abs(drift) / step), 1)
    return [round(drift * n / steps * period) for n in range(steps + 1)]


class _Forecast:
    """Says once how long the pilots take, if that is long: by the time of the second one, as the
    first one compiles.

    Args:
        progress: receives the note.
        detector: name of the detector.
    """

    def __init__(self, progress: Progress, detector: str) -> None:
        self._progress, self._detector = progress, detector
        self._last, self._filmed = time.monotonic(), 0

    def film(self, left: int) -> None:
        """A pilot was filmed and read; at most so many are left."""
        now = time.monotonic()
        seconds, self._last = (now - self._last) * left, now
        self._filmed += 1
        if self._filmed == 2 and seconds > _LONG:
            self._progress.note(
                f"the pilots take up to {duration_text(seconds)} with the detector "
                f"{self._detector}; give link.modem.cell, ticks, line and parity or rate to go "
                "without, or leave link.modem.detector out"
            )


def choose_mode(
    modem: Modem, setting: LinkSetting, size: int, device: Device | None,
    progress: Progress, adaptive: bool = False, most_lost: float = 1.0,
) -> tuple[Mode, Choice | None]:  # fmt: skip
    """Mode, and how it was chosen; None if the modem gives it, or nothing can arrive.

    Args:
        modem, setting: the link.
        size: size of the file, bytes; an empty file counts as one byte.
        device: OpenCL device, None for numba.
        progress: progress of the pilots.
        adaptive: whether blocks can have a rate each.
        most_lost: largest share of frames lost, as in `choosing.foresee`.

    Raises:
        InputError: if the modem asks for such rates where they cannot be.
    """
    mode = fixed_mode(modem, setting.panel.shape)
    if mode is not None:
        return mode, None
    if modem.rate == "adaptive" and not adaptive:
        raise InputError(
            "link.modem.rate", "a rate, or auto, where the link carries a stream", "adaptive",
            "leave it out",
        )  # fmt: skip
    adapts = adaptive and _may_adapt(modem, setting)
    modes = _candidates(modem, setting, adapts)
    # If nothing can arrive in any mode, take the first one, which takes the shortest time.
    # Through a blur the pilots are filmed all the same: they say how many bits it leaves right.
    if tag_module(setting, modes[0])[0] < _NEVER * LEAST_MODULE or not panel_in_view(setting):
        return modes[0], None
    strip = strip_of(setting)
    progress.start("pilots", _TRIED)
    tried, most = 0, min(_TRIED, len(modes))
    forecast = _Forecast(progress, modem.detector)

    def trial(mode: Mode) -> Trial:
        nonlocal tried
        narrow = replace(mode, width=strip.optics.width)
        if mode.adaptive:  # the code of the words has no influence
            narrow = replace(narrow, rate=RATES[0], adaptive=False)
        step = _FINE if adapts and mode.ticks == 1 else _STEP
        delays = _delays(setting, mode, max(size, 1), step)
        found: list[Trial] = []
        for late in delays:
            progress.tell(
                f"pilots: mode {tried + 1} of up to {most}, {modem.detector}, phase "
                f"{len(found) + 1} of {len(delays)}"
            )
            at = replace(strip, first_light=strip.first_light + late)
            pilot = film_pilot(at, narrow, modem.detector, setting.air.seed, device)
            found.append(Trial.of(narrow, pilot.sent, pilot.soft))
            forecast.film(len(delays) - len(found) + (most - tried - 1) * len(delays))
        tried += 1
        progress.advance(tried)
        worst = max(found, key=lambda one: one.values_wrong)
        if len(found) == 1 or worst.information is None:
            return worst
        clocks = setting.camera.clock.hz / setting.panel.clock.hz
        course = Course(
            tuple(late / setting.camera.clock.edge(1) for late in delays),
            tuple(one.information or 0.0 for one in found), clocks - 1,
        )  # fmt: skip
        return replace(worst, course=course)

    camera, scene = setting.camera, cell_scene(setting)
    choice = choose(
        trial, modes, size=max(size, 1), hz=setting.panel.clock.hz, most_trials=_TRIED,
        threshold=camera.threshold if camera.reset == "hard" else None,
        background=scene.background, on=scene.on,
        most_overhead=modem.overhead, most_lost=most_lost,
    )  # fmt: skip
    progress.advance(_TRIED)
    return choice.mode, choice
