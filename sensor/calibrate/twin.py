"""The twin of a camera: its preset, filmed under the light of the recording, and compared with it.

The preset is filmed FILMS times, each with seeds of its own, of the run and of the device: what it
gives is a law, and the recording is one draw of its own. A statistic of the recording is compared
with those of the films by Student's t for one more draw of the same normal law, of its logarithm
where it is positive by nature; the chances are judged together (Holm, Scand. J. Stat. 6:65, 1979),
so that a camera is told from its own twin in LEVEL of all comparisons.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
import numpy.typing as npt

from cosim.clock import Clock
from cosim.light.light import Light, Piece
from cosim.spikes.viform import Viform
from cosim.stage import Block
from sensor.calibrate.common import duplicated_rows
from sensor.calibrate.trains import Trains, read_trains
from sensor.laboratory.laws import Laws, measure_laws
from sensor.latched.camera import SpikeCamera
from sensor.latched.effects.effect import Operation
from sensor.latched.setting import CameraSetting
from sensor.latched.stages import DuplicatedRows
from sensor.sections.own_chip import LEVELS
from sensor.sections.provenance import effect_parameters
from sensor.sections.sensor import SensorSection

FILMS: Final = 8
LEVEL: Final = 0.05
"""Chance that a recording is told from films of its own camera, in any statistic."""
_WORK: Final = 6e7
"""Pixel-cycles of a film at most; a longer recording is compared in its first part."""
_LEAST: Final = 256
"""Cycles of such a part at least."""
_POOLED: Final = 30
"""Fewest pixels of a class of intervals that is compared."""
_APART: Final = 20
"""Columns between pixels whose counts are compared."""
_SMOOTH: Final = 9
"""Rows over which the interval variance is averaged."""
_DEAD: Final = -0.5
"""Response of a dead pixel over that of its surroundings, less 1, at most."""
Values = npt.NDArray[np.float64]


class Compared(NamedTuple):
    """A statistic of a recording beside that of the films of its twin.

    Attributes:
        name: what it is.
        recording: its value in the recording.
        twin, spread: mean and standard deviation over the films.
        chance: chance of a value so far away if the recording were one more film.
        told: whether it tells the recording from the twin, all statistics judged together.
    """

    name: str
    recording: float
    twin: float
    spread: float
    chance: float
    told: bool


@dataclass(frozen=True)
class Twin:
    """The comparison.

    Attributes:
        statistics: all that were compared.
        cycles: cycles that were compared.
    """

    statistics: tuple[Compared, ...]
    cycles: int

    @property
    def told_by(self) -> list[str]:
        """Names of the statistics that tell the recording from the twin."""
        return [each.name for each in self.statistics if each.told]

    @property
    def verdict(self) -> str:
        """The result in words."""
        if not self.told_by:
            return "the preset's films cannot be told from the recording"
        return f"the recording can be told from the preset's films by {', '.join(self.told_by)}"

    def document(self) -> dict[str, Any]:
        """For JSON."""
        return {
            "verdict": self.verdict, "films": FILMS, "cycles": self.cycles, "level": LEVEL,
            "told_by": self.told_by,
            "statistics": [each._asdict() for each in self.statistics],
        }  # fmt: skip


def compare_twin(recording: Trains, light: Values, preset: Path) -> Twin:
    """Films a preset and compares it with the recording.

    Args:
        recording: recording of still light.
        light: (n,) rate at which a pixel without a pattern fires there, spikes a cycle.
        preset: the preset's file.

    Raises:
        InputError: the preset cannot be used.
    """
    cycles = recording.cycles
    if recording.spikes.size * cycles > _WORK:
        cycles = min(cycles, max(int(_WORK / recording.spikes.size) // 64 * 64, _LEAST))
    words = recording.words.T.reshape(-1, *recording.shape)[: -(-cycles // 32)]
    known = statistics(_cut(words, cycles, recording.clock))
    found = []
    for n in range(FILMS):
        film = statistics(film_preset(preset, light.reshape(recording.shape), cycles, n + 1))
        found.append(film)
    names = [name for name in known if all(name in film for film in found)]
    rows = [(name, known[name], np.array([film[name] for film in found])) for name in names]
    chances = [_chance(value, films) for _, value, films in rows]
    told = _holm(chances)
    return Twin(
        tuple(
            Compared(name, value, float(films.mean()), float(films.std(ddof=1)), chance, each)
            for (name, value, films), chance, each in zip(rows, chances, told, strict=True)
        ),
        cycles,
    )


def _cut(words: npt.NDArray[np.uint32], cycles: int, clock: Clock) -> Viform:
    """The first cycles of a stream's words, (words, H, W)."""
    out = np.array(words)
    if cycles % 32:
        out[-1] &= np.uint32((1 << cycles % 32) - 1)
    return Viform(out, cycles, clock)


def film_preset(preset: Path, light: Values, cycles: int, seed: int) -> Viform:
    """A recording of still light by the camera of a preset, in the exact tier.

    Args:
        preset: the preset's file.
        light: (H, W) rate at which a pixel without a pattern fires, spikes a cycle.
        cycles: number of cycles.
        seed: seed of the run and of the device.
    """
    section: Any = SensorSection(preset=str(preset))
    clock = Clock.from_hz(section.clock)
    threshold = section.threshold * section.threshold_level / LEVELS
    parameters = effect_parameters(section, Operation(clock, threshold, 25.0))
    if parameters.get("pattern") is not None:
        parameters["pattern"] = replace(parameters["pattern"], device_seed=seed)
    setting = CameraSetting(
        section.own_chip, clock, threshold, seed, reset=section.reset, parameters=parameters
    )
    x = light / (1 - np.minimum(light * setting.dead_time * clock.hz, 0.9))
    lux = (_lit(x, setting) / setting.rate(1.0)).astype(np.float32)
    camera = SpikeCamera(setting, None, tier="exact")
    words = np.array(
        camera.step(Light((Piece(-(2**40), 2**61, lux, lux),)), Block(0, cycles)).words
    )
    if section.duplicated_rows:
        DuplicatedRows(section.duplicated_rows).duplicate(words)
    return Viform(words, cycles, clock)


def _lit(x: Values, setting: CameraSetting) -> Values:
    """The part of a rate without dead time, spikes a cycle, that is light's: by (1) of pattern.py
    the mean of x over pixels is (L + D) times the mean of 1/(1 + f), which is 1 + fpn^2."""
    pattern = setting.pattern
    if pattern is None:
        return x
    dark = pattern.dark * float(setting.clock.period) / setting.threshold
    return np.maximum(x / (1 + pattern.threshold_fpn**2) - dark, 0.0)


def statistics(stream: Viform) -> dict[str, float]:
    """The statistics of a recording of still light, by their names; those that it has."""
    laws, trains = measure_laws(stream), read_trains(stream, "")
    out = {"rate, spikes a cycle": float(trains.rate)}
    # Dead pixels have a few spikes in the dark, whose noise is large; the pattern's tell of them.
    lit = np.nan_to_num(laws.excess) > _DEAD
    out |= _of_intervals(trains, laws, lit) | _of_counts(stream, lit) | _of_pattern(laws)
    out["pairs of duplicated rows"] = float(len(duplicated_rows(trains)))
    return {name: value for name, value in out.items() if np.isfinite(value)}


def _of_intervals(trains: Trains, laws: Laws, lit: npt.NDArray[np.bool_]) -> dict[str, float]:
    """Statistics of intervals. lit: see `_of_counts`."""
    many = (trains.spikes > 8) & lit.ravel()
    if not many.any():
        return {}
    squares, products = trains.successive(many)
    number = np.where(many, trains.spikes - 1, 0)
    out = {
        "variance of an interval, cycles^2": float(squares.sum() / number.sum()),
        "correlation of successive intervals": float(products.sum() / squares.sum()),
    }
    shares = trains.histogram(64, many).sum(axis=0)
    top = np.argsort(shares)[::-1][:3]
    out |= {f"share of intervals of {n + 1} cycles": float(shares[n] / shares.sum()) for n in top
            if shares[n] > 0 and n < 64}  # fmt: skip
    for law in laws.intervals:
        if law.pixels >= _POOLED:
            out[f"variance of intervals near {law.mean:g} cycles, cycles^2"] = law.variance
    each, total = (
        np.asarray(np.where(many, x, 0).reshape(trains.shape).sum(axis=1), np.float64)
        for x in (squares, number)
    )
    rows = each / np.maximum(total, 1)
    if rows.size >= 2 * _SMOOTH:
        smooth = np.convolve(rows, np.ones(_SMOOTH) / _SMOOTH, "valid")
        out["spread of the interval variance over rows"] = float(smooth.std() / smooth.mean())
    return out


def _of_counts(stream: Viform, lit: npt.NDArray[np.bool_]) -> dict[str, float]:
    """Statistics of counts in time. lit: (H, W) pixels whose own noise counts."""
    words = stream.read_words(0, stream.cycles // 32)
    halves = [np.bitwise_count(words & np.uint32(0xFFFF)), np.bitwise_count(words >> np.uint32(16))]
    counts = np.stack(halves, axis=1).reshape(-1, *stream.shape).astype(np.float32)
    off = counts - counts.mean(axis=0)
    alone, mean = np.asarray((off**2).mean(axis=0)), np.asarray(counts.mean(axis=0))
    told = np.nonzero(lit & (mean > 0))
    out = {"Fano factor of 16 cycles": float((alone[told] / mean[told]).mean())}
    whole = len(counts) // 4
    longer = counts[: 4 * whole].reshape(whole, 4, *stream.shape).sum(axis=1)
    if whole >= 4:
        variance = longer.var(axis=0, ddof=1)
        ratio = variance[told] / longer.mean(axis=0)[told]
        out["Fano factor of 64 cycles"] = float(ratio.mean())
        total = longer.sum(axis=(1, 2), dtype=np.float64)
        out["common noise of 64 cycles"] = float(total.var(ddof=1) / variance.sum())
    each = np.asarray(alone.sum(axis=1))
    some = np.flatnonzero(each)
    rows = (off.sum(axis=2) ** 2).mean(axis=0)
    out["variance of row sums over independent pixels"] = float((rows[some] / each[some]).mean())
    if stream.shape[1] > 2 * _APART:
        far = float((off[..., _APART:] * off[..., :-_APART]).mean() / alone.mean())
        out[f"covariance at {_APART} columns"] = far
    return out


def _of_pattern(laws: Laws) -> dict[str, float]:
    """Statistics of the fixed pattern, against the median of the surroundings."""
    excess = np.where(np.abs(laws.excess) < 5 * max(laws.core, 1e-9), laws.excess, np.nan)
    out = {
        "spread of the pattern without its tails": laws.core,
        "neighbours in a row": laws.neighbours[0], "neighbours in a column": laws.neighbours[1],
        "pixels beyond 15 %": float(laws.above + laws.below),
    }  # fmt: skip
    variance = float(np.nanvar(excess))
    for name, axis in (("row", 1), ("column", 0)):
        number = np.asarray(np.isfinite(excess).sum(axis=axis))
        mean = np.nansum(excess, axis=axis) / np.maximum(number, 1)
        used = np.flatnonzero(number > 1)
        if variance > 0 and used.size > 2:
            told = mean[used].var(ddof=1) * number[used].mean() / variance
            out[f"{name} profile over independent pixels"] = float(told)
    return out


def _chance(value: float, films: Values) -> float:
    """Chance of a value as far from the films as this one, if it is one more of them."""
    from scipy.stats import t

    if films.min() > 0 and value > 0:
        value, films = float(np.log(value)), np.log(films)
    spread = float(films.std(ddof=1))
    if spread == 0:
        return 1.0 if np.isclose(value, films[0]) else 0.0
    away = abs(value - float(films.mean())) / (spread * (1 + 1 / films.size) ** 0.5)
    return float(2 * t.sf(away, films.size - 1))


def _holm(chances: Sequence[float]) -> list[bool]:
    """Which of the chances are too small at LEVEL, judged together."""
    told = [False] * len(chances)
    for place, n in enumerate(np.argsort(chances)):
        if chances[n] > LEVEL / (len(chances) - place):
            break
        told[n] = True
    return told
