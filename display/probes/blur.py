"""Measures the blur of a moving edge on the retina of an eye that follows it.

An edge moves along the rows at SPEED. The eye moves with it and integrates light with constant
weight for EXPOSURE, which has whole frames at 60 Hz and its multiples. The light at the position u
on the retina is the mean over this time of the light at u + v t, averaged over rows. The profile
includes the areas of the pixels of sensor and panel, which alone give a width of about 1.1 pixels
(0.28 ms).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
import numpy.typing as npt
from numba import njit

from display.drives import DRIVES
from display.panels.panel import FramePanel, Projector, SpikePanel
from display.probes.setup import MOST, ProbeCamera, edge_light, settling_cycles, too_much
from display.probes.waveform import every_drive
from display.quality.edges import bet, blur_edge_width, cmr_like, ebet
from display.references.displays import spread_errors

Values = npt.NDArray[np.float64]
SPEED: Final = 4000.0
"""Speed of the edge and of the eye, pixels/s."""
EXPOSURE: Final = 0.05
"""Integration time of the eye, s: 3 frames at 60 Hz."""
SPIKES: Final = 3000
"""Target number of spikes at a position of the profile, for a standard error of 2 %."""
ROWS: Final = 8, 32
"""Minimum and maximum number of rows for SPIKES."""
REACH: Final = 3.5
"""Extent of the profile behind the edge, mean intervals: held light settles after two."""
WIDEST: Final = 1024
"""Maximum number of recorded columns."""
MARGIN: Final = 10.0
"""Minimum extent of the profile on both sides, pixels."""
FINE: Final = 0.05
"""Distance of the samples of a profile for bright light, pixels."""
PHASES: Final = 4
"""Number of start positions of an edge within a pixel: at 1000 Hz it moves by whole pixels a
frame."""
SAMPLES: Final = 20
"""Minimum number of samples of the light of a frame, and of its flash."""
SETTLED: Final = 20.0
"""Number of time constants after which a pixel has settled."""
PROJECTED: Final = 32
"""Number of rows of the projector, which have different initial errors."""


@dataclass(frozen=True)
class Blur:
    """The blur of one edge on one display.

    Attributes:
        display, drive: see `Latency`.
        ahead, behind: light in front of the edge and behind it, spikes a cycle.
        width: BEW, pixels.
        bet, ebet: BET and EBET, s; NaN if the light does not settle within the recorded time (held
            light never becomes dark).
        cmr: CMR-like, %.
    """

    display: str
    drive: str
    ahead: float
    behind: float
    width: float
    bet: float
    ebet: float
    cmr: float

    @classmethod
    def of(cls, display: str, drive: str, edge: tuple[float, float], width: float) -> Blur:
        time = bet(width, SPEED)
        clear = cmr_like(ebet(time)) if time > 0 else math.nan
        return cls(display, drive, *edge, width, time, ebet(time), clear)


def retina(light: Values, begins: Values, length: float, at: Values, side: float = 1.0) -> Values:
    """The light on the retina of an eye that moves at SPEED, (n,): the mean over all spans of the
    light at the positions at + v t, in closed form.

    Args:
        light: (spans, columns), mean over square pixels; column j is [j, j + 1).
        begins: begin of each span, s, (spans,).
        length: length of a span, s.
        at: positions on the retina, pixels, (n,).
        side: side of the square in the centre of a pixel that emits its light, pixels.

    Raises:
        ValueError: a position is beyond the columns.
    """
    reach = at.min() + SPEED * begins.min(), at.max() + SPEED * (begins.max() + length)
    if reach[0] < 0 or reach[1] >= light.shape[1]:
        raise ValueError(f"places must stay within {light.shape[1]} columns, not {reach}")
    total, planes = np.zeros(len(at)), np.ascontiguousarray(light)
    for first in range(0, len(begins), 512):  # partial sums reduce rounding errors
        some = slice(first, first + 512)
        total += _gathered(planes[some], begins[some], length, at, side)
    return total / len(begins)


@njit(cache=True, nogil=True)
def _passed(place, side):  # type: ignore[no-untyped-def]
    """The light up to a place within a pixel of light 1, whose square of this side emits it."""
    return min(max((place - 0.5) / side + 0.5, 0.0), 1.0)


@njit(cache=True, nogil=True)
def _gathered(light, begins, length, at, side):  # type: ignore[no-untyped-def]
    """The sum over spans of their mean light at each position of the retina, (positions,)."""
    total = np.zeros(len(at))
    moved = SPEED * length
    for n in range(len(begins)):
        row, begun = light[n], SPEED * begins[n]
        for k in range(len(at)):
            place = at[k] + begun
            first, last = int(place), min(int(place + moved), len(row) - 1)
            seen = row[last] * _passed(place + moved - last, side)
            seen -= row[first] * _passed(place - first, side)
            for column in range(first, last):
                seen += row[column]
            total[k] += seen / moved
    return total


def _measured(x: Values, profile: Values, edge: tuple[float, float]) -> float:
    """BEW of a profile whose left side is behind the edge, pixels; NaN if it does not settle."""
    end = max(len(x) // 8, 1)
    low = 0.0 if edge[1] == 0 else float(profile[:end].mean())
    high = 0.0 if edge[0] == 0 else float(profile[-end:].mean())
    try:
        return blur_edge_width(x, profile, low, high)
    except ValueError:
        return math.nan


def _places(interval: float, slow: float) -> Values:
    """Positions of a profile relative to the edge, pixels.

    Args:
        interval: motion of the edge in a mean interval, pixels; the profile has two hundred
            positions in it.
        slow: motion of the edge while the emitter settles, pixels.
    """
    step = max(FINE, interval / 200)
    return np.arange(-MARGIN - REACH * interval - slow, MARGIN + interval, step)


def spike_blur(
    camera: ProbeCamera, panel: SpikePanel, edge: tuple[float, float], seed: int
) -> list[Blur]:
    """The blur of an edge for every drive of a panel; NaN if it needs more than WIDEST columns (dim
    light at a slow clock), or where `too_much`.

    Args:
        camera, panel: camera and panel.
        edge: light (ahead, behind) the edge, spikes a cycle.
        seed: seed of the noise.
    """
    hz = panel.clock.hz
    dimmest = min(rate for rate in edge if rate > 0)
    x = _places(SPEED / hz / min(dimmest, 1.0), SPEED / hz * settling_cycles(panel))
    # The exposure starts with the edge at column `begin`, so that all positions are on the chip.
    begin = math.ceil(-x[0]) + 1
    first = math.ceil(begin / SPEED * hz)
    planes = np.arange(first, first + max(round(EXPOSURE * hz), 1))
    width = begin + math.ceil(SPEED * (EXPOSURE + 1 / hz) + x[-1]) + 2
    width = max(width, math.ceil(SPEED * (planes[-1] + 1) / hz + x[-1]) + 2)
    cycles = math.ceil((begin / SPEED + EXPOSURE) * hz) + 2
    wanted = math.ceil(SPIKES / (EXPOSURE * hz * min(dimmest, 1.0)))
    rows = min(max(wanted, ROWS[0]), ROWS[1], camera.height)
    if width > WIDEST or too_much(camera, max(edge), cycles, rows * width, width):
        return [Blur.of("spike", drive, edge, math.nan) for drive in DRIVES]
    ahead, behind = (camera.lux(rate) for rate in edge)
    light = edge_light((rows, width), ahead, behind, SPEED, camera.clock, cycles + 2)
    stream = camera.film(light, cycles, (camera.height, width), seed, (0, rows))
    columns = np.broadcast_to(np.arange(width), (rows, width))
    side = math.sqrt(panel.fill)
    table = []
    for drive, light_of in every_drive(stream, panel, group=columns).items():
        light_of_planes = light_of[planes]
        lit = replace(panel, drive=drive).share if panel.rise == panel.decay == 0 else 1.0
        profile = retina(light_of_planes, planes / hz, lit / hz, x, side)
        table.append(Blur.of("spike", drive, edge, _measured(x, profile, edge)))
    return table


def _frames(panel: FramePanel, edge: tuple[float, float], times: Values, columns: Values) -> Values:
    """Light of a frame panel that shows the true edge, (instants, columns)."""
    rate, ahead, behind = panel.rate.hz, *edge
    at = times - panel.latency
    frame = np.floor(at * rate + 1e-9).astype(np.int64)
    settling = math.ceil(SETTLED * panel.response * rate)
    numbers = np.arange(frame[0] - settling, frame[-1] + 1)

    def target(k: int) -> Values:
        return ahead + (behind - ahead) * np.clip(SPEED * k / rate - columns, 0, 1)

    out = np.empty((len(times), len(columns)))
    level = target(int(numbers[0]) - 1)
    for k in numbers:
        inside = frame == k
        age = at[inside] - k / rate
        goal = target(int(k))
        left = np.exp(-age / panel.response) if panel.response > 0 else np.zeros(len(age))
        on = (age * rate < panel.persistence) / panel.persistence
        out[inside] = (goal + (level - goal) * left[:, None]) * on[:, None]
        whole = math.exp(-1 / rate / panel.response) if panel.response > 0 else 0.0
        level = goal + (level - goal) * whole
    return out


def _planes(panel: Projector, edge: tuple[float, float], times: Values, columns: Values) -> Values:
    """Light of binary planes that show the true edge, averaged over rows, (instants, columns)."""
    rate = panel.rate.hz
    at = np.floor((times - panel.latency) * rate + 1e-9).astype(np.int64)
    error = spread_errors(np.arange(PROJECTED)[:, None], columns)
    out = np.empty((len(times), len(columns)))
    for k in range(int(at[-1]) + 1):
        goal = edge[0] + (edge[1] - edge[0]) * np.clip(SPEED * k / rate - columns, 0, 1)
        error += goal
        lit = error >= 0.5
        error -= lit
        out[at == k] = lit.mean(axis=0)
    return out


def _frame_width(panel: FramePanel | Projector, edge: tuple[float, float]) -> float:
    """BEW of an edge on a reference panel, pixels; NaN if it cannot be computed."""
    travel, lag = SPEED / panel.rate.hz, panel.latency * SPEED
    if isinstance(panel, Projector):  # a dim pixel waits for its plane
        slow = travel / min(level for level in edge if level > 0)
    else:
        slow = 5 * panel.response * SPEED
    x = np.arange(
        -MARGIN - lag - 2 * (travel + slow), MARGIN + travel, max(FINE, (travel + slow) / 400)
    )
    # The eye integrates whole frames, from the start of one.
    rate, persistence = panel.rate.hz, getattr(panel, "persistence", 1.0)
    frames = max(1, math.ceil(EXPOSURE * rate - 1e-9))
    start = math.ceil((math.ceil(-x[0]) + 1) / SPEED * rate) / rate + panel.latency
    each = max(
        SAMPLES,
        math.ceil(SAMPLES / persistence),
        math.ceil(travel / max(0.1, (travel + slow) / 400)),
    )
    if isinstance(panel, Projector):
        each = math.ceil(travel / 0.1)
    count, wide = frames * each, math.ceil(SPEED * (start + frames / rate) + x[-1]) + 3
    if count * wide > MOST:
        return math.nan
    columns = np.arange(wide, dtype=np.float64)
    begins, length = start + np.arange(count) / (each * rate), 1 / (each * rate)
    times = begins + length / 2
    if isinstance(panel, Projector):
        return _measured(x, retina(_planes(panel, edge, times, columns), begins, length, x), edge)
    total = np.zeros(len(x))
    for part in np.arange(PHASES) / PHASES:
        light = _frames(panel, edge, times, columns - part)
        total += retina(light, begins, length, x + part)
    return _measured(x, total / PHASES, edge)


def frame_blur(
    panel: FramePanel | Projector, white_rate: float, edges: Sequence[tuple[float, float]]
) -> list[Blur]:
    """The blur of edges on a reference panel that shows the true light. Frames are linear in light,
    so all edges between two levels have the same profile.

    Args:
        panel: the reference panel.
        white_rate: light that it shows as white, spikes a cycle.
        edges: light (ahead, behind) of each edge, spikes a cycle.
    """
    if not isinstance(panel, Projector):
        width = _frame_width(panel, (0.0, 1.0))
        return [Blur.of(panel.name, "", edge, width) for edge in edges]
    table = []
    for edge in edges:
        share = min(edge[0] / white_rate, 1.0), min(edge[1] / white_rate, 1.0)
        table.append(Blur.of(panel.name, "", edge, _frame_width(panel, share)))
    return table
