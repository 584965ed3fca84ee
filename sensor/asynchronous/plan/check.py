"""The check of an asynchronous plan, by paired runs of a few tiles with the same random numbers.

The pixels as planned are compared with the reference, and with the same plan that keeps one effect
more. The quantity is the rate that a pixel reports: 1 / width of each interval that it sends,
before the clock counts it. Reports are matched by index as long as both runs draw the same numbers:
the first report under a rule of changes, the first REPORTS without one. For a pixel without a
report by the end (of the run, or of REPORTS spikes of the brightest pixel of the tile) it is the
share of its threshold that it has gathered, over that time.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from cosim import PS, Light
from cosim.plan.error import (
    EVERYTHING,
    Finding,
    Measured,
    accepted_error,
    beyond,
    reinstated,
)
from cosim.plan.planner import choose_tiles, left_out_rows
from sensor.asynchronous.model import EventModel, Firings
from sensor.asynchronous.pixel.reference import follow
from sensor.asynchronous.plan.effects import LATER
from sensor.asynchronous.plan.plan import EventPlan, PlannedPixels
from sensor.device.pattern import DevicePattern
from sensor.latched.pixel.interval import interval_table
from sensor.latched.pixel.thresholds import first_thresholds

REPORTS = 8
"""Reports of a pixel that are compared where every spike is sent."""
KIND = "rate of first reports, worst tile"

Reals = npt.NDArray[np.float64]
Numbers = npt.NDArray[np.uint32]


@dataclass(frozen=True, eq=False)
class View:
    """The array under the light of its run, as far as that is known before the run.

    Attributes:
        light: light on the pixels.
        until: instant up to which it is known, ps.
        shape: shape of the array.
        gain: photoelectrons a second for a unit of light.
        pattern: pattern of the device, None for none.
        seed: seed of the run.
    """

    light: Light
    until: int
    shape: tuple[int, int]
    gain: float
    pattern: DevicePattern | None
    seed: int


@dataclass(frozen=True)
class Checked:
    """A plan that holds.

    Attributes:
        plan: the plan.
        error: error of the worst tile that was compared. Its upper limit holds for all tiles: for
            the others it is the sum of the bounds of what is left out.
        tiles: tiles that were compared.
        over: number of them whose error is above the tolerance.
        left_out: effects that are left out, as result.json has them.
        notes: what the user must know.
        full_physics: time that full physics would take for the run, s; None if not measured.
    """

    plan: EventPlan
    error: Measured
    tiles: list[int]
    over: int
    left_out: list[dict[str, Any]]
    notes: list[str] = field(default_factory=list)
    full_physics: float | None = None


def tiles_of(plan: EventPlan, seed: int) -> list[int]:
    """Numbers of the tiles to look at: the brightest, the darkest, the steepest, the one whose
    bounds sum to most, for each effect the one in which leaving it out may change most, and some at
    random."""
    scene = plan.scene
    figures = [scene.mean, -scene.mean, scene.rms / np.maximum(scene.mean, 1e-300)]
    if plan.plan.left_out:
        figures.append(plan.plan.total)
    return sorted(choose_tiles(plan.plan, figures, np.arange(scene.mean.size), seed))


def _end(plan: EventPlan, view: View, tile: int) -> int:
    """Instant up to which a tile is compared, ps: the end, or REPORTS spikes of its brightest
    pixel. The share of a pixel that has not fired by then is as good an estimate."""
    brightest = float(plan.scene.brightest[tile])
    if brightest <= 0:
        return view.until
    return min(view.until, view.light.pieces[0].start + math.ceil(REPORTS / brightest * PS))


def _reported_rate(model: EventModel, exact: Reals, level: npt.NDArray[np.uint16]) -> Reals:
    """Spikes per second that reports stand for; a reading counts as the middle of its level."""
    read = np.where(level == 0, 0.0, (level + 0.5) / model.levels)
    return np.where(level == model.levels, 1.0, read) / np.maximum(exact, 1e-300) * PS


def _gathered(pixels: PlannedPixels, view: View, stop: int) -> tuple[Numbers, Reals]:
    """Share of its first threshold that each pixel would have gathered by `stop`, at most 1."""
    numbers, shares = [], []
    for group, model, pattern in pixels.groups:
        fixed = None if pattern is None else pattern.at(group)
        charge = np.zeros(group.size)
        for piece in view.light.pieces:
            a, b = piece.start, min(piece.stop, stop)
            if a >= b:
                break
            first, last = (p.ravel()[group].astype(np.float64) * view.gain
                           for p in (piece.first, piece.last))  # fmt: skip
            level = first + (last - first) * ((b - a) / (2 * (piece.stop - piece.start)))
            if fixed is not None:
                level = level * fixed.gain + fixed.dark
            charge += level * ((b - a) / PS)
        goals = np.full(group.size, float(model.threshold))
        if model.shot:
            table = interval_table(float(model.threshold))
            goals = first_thresholds(table, group, model.seed) * 2.0**-40
        numbers.append(group)
        shares.append(np.minimum(charge / goals, 1.0))
    return np.concatenate(numbers), np.concatenate(shares)


def _reports(firings: Firings, numbers: Numbers, most: int, last: bool) -> npt.NDArray[np.int64]:
    """Indices of the first reports of each pixel, (n, most), or of its last one; -1 for none."""
    order = np.argsort(firings.pixel, kind="stable")
    mine = firings.pixel[order]
    begin = np.searchsorted(mine, numbers)
    count = np.searchsorted(mine, numbers, side="right") - begin
    at = begin[:, None] + (np.maximum(count - 1, 0)[:, None] if last else np.arange(most))
    there = (count > 0)[:, None] if last else np.arange(most) < count[:, None]
    if not order.size:
        return np.full(at.shape, -1)
    return np.where(there, order[np.minimum(at, order.size - 1)], -1)


def _planned(plan: EventPlan, view: View, tile: int, *, last: bool = False) -> Reals:
    """Rates of a tile's pixels by the plan, (n, reports), NaN where there is none."""
    numbers = np.flatnonzero(plan.scene.tile_of == tile).astype(np.uint32)
    stop, begin = view.until if last else _end(plan, view, tile), view.light.pieces[0].start
    pixels = PlannedPixels(plan, view.pattern, view.shape, view.gain, numbers=numbers)
    firings = pixels.step(view.light, begin, stop)
    most = 1 if plan.scene.model.change else REPORTS
    at = _reports(firings, numbers, most, last)
    rates = np.full(at.shape, np.nan)
    reported = at >= 0
    rates[reported] = _reported_rate(
        plan.scene.model, firings.exact[at[reported]], firings.level[at[reported]]
    )
    silent = ~reported[:, 0]
    if silent.any():
        who, share = _gathered(pixels, view, stop)
        rates[silent, 0] = (share[np.argsort(who)] * (PS / (stop - begin)))[silent]
    return rates


def _followed(plan: EventPlan, view: View, tile: int) -> Reals:
    """The same by the reference, full physics."""
    numbers = np.flatnonzero(plan.scene.tile_of == tile).astype(np.uint32)
    stop, begin = _end(plan, view, tile), view.light.pieces[0].start
    most = 1 if plan.scene.model.change else REPORTS
    model = plan.scene.model
    followed = follow(model, numbers, view.light, view.gain, view.pattern, stop, most)
    rates = np.where(
        np.arange(most) < followed.count[:, None],
        _reported_rate(model, followed.exact, followed.level),
        np.nan,
    )
    silent = followed.count == 0
    rates[silent, 0] = followed.progress[silent] * (PS / (stop - begin))
    return rates


def _distance(one: Reals, two: Reals, scale: float, tile: int) -> Measured:
    square = (one - two) ** 2
    there = ~np.isnan(square)
    each = np.where(there, square, 0.0).sum(1) / np.maximum(there.sum(1), 1)
    return Measured.rms(each, scale, tile)


def _scale(plan: EventPlan, rates: Reals) -> float:
    return max(float(np.nanmean(rates[:, 0])), plan.scene.floor)


def _measured(plan: EventPlan, view: View, tiles: list[int]) -> list[Measured]:
    """The plan against the reference, tile by tile."""
    found = []
    for tile in tiles:
        truth = _followed(plan, view, tile)
        found.append(_distance(_planned(plan, view, tile), truth, _scale(plan, truth), tile))
    return found


def measure(plan: EventPlan, view: View, tiles: list[int]) -> Measured:
    """The plan against the reference; the worst of these tiles."""
    worst = Measured.worst(_measured(plan, view, tiles))
    assert worst is not None  # of no tile
    return worst


def _left_out(
    plan: EventPlan, view: View, tiles: list[int]
) -> tuple[list[dict[str, Any]], list[Finding]]:
    """What leaving out each effect changes, as result.json has it, and the bounds that fail."""
    measured: dict[str, float | None] = {}
    findings: list[Finding] = []
    for name in plan.plan.left_out:
        other, last, found = plan.keeping({name}), name == LATER, []
        for tile in np.array(tiles)[plan.where(name)[tiles]].tolist():
            full = _planned(other, view, tile, last=last)
            found.append(
                _distance(_planned(plan, view, tile, last=last), full, _scale(plan, full), tile)
            )
        measured[name] = max((change.value for change in found), default=0.0)
        promised = plan.plan.promise[name]
        over = [change for change in found if change.high > promised[change.tile]]
        if over:
            tile = over[0].tile
            assert tile is not None
            findings.append(reinstated(name, float(promised[tile]), over[0].high, tile))
    return left_out_rows(plan.absent, measured), findings


def check_plan(
    plan: EventPlan, view: View, tolerance: float
) -> tuple[list[Finding], Checked | None]:
    """Checks a plan against its bounds and the tolerance on a few tiles.

    Returns the effects to reinstate, or else what was measured.
    """
    tiles = tiles_of(plan, view.seed)
    rows, findings = _left_out(plan, view, tiles)
    if findings:
        return findings, None
    found = _measured(plan, view, tiles)
    error = Measured.worst(found)
    assert error is not None
    if plan.plan.left_out and error.high > tolerance:
        return [reinstated(EVERYTHING, tolerance, error.high)], None
    notes = []
    if not plan.plan.left_out and error.high > accepted_error(tolerance):
        notes.append(beyond(error, tolerance))
    others = np.delete(plan.plan.total, tiles)
    whole = replace(error, high=max(error.high, float(others.max(initial=0.0))))
    over = sum(distance.value > accepted_error(tolerance) for distance in found)
    return [], Checked(plan, whole, tiles, over, rows, notes)


def check_events(plan: EventPlan, view: View, tolerance: float) -> Checked:
    """Checks a plan and reinstates effects until its bounds hold. Its notes begin with the reason
    for each."""
    notes: list[str] = []
    while True:
        findings, checked = check_plan(plan, view, tolerance)
        if checked is not None:
            return replace(checked, notes=[*notes, *checked.notes])
        notes += [finding.message for finding in findings]
        plan = plan.keeping(finding.effect for finding in findings)
