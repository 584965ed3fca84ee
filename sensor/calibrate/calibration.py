"""The calibration of a camera from its recordings."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, Literal

import numpy as np
import numpy.typing as npt

from cosim.clock import Clock
from cosim.errors import InputError
from cosim.run.progress import Progress
from cosim.spikes.viform import SpikeStream
from sensor.calibrate.band import Band, band_parameters, band_pixels, measure_band
from sensor.calibrate.common import (
    drift_parameter,
    duplicate_parameter,
    duplicated_rows,
    line_parameters,
    measure_drift,
    measure_lines,
    originals,
)
from sensor.calibrate.defects import Defects, find_defects, shading
from sensor.calibrate.histograms import Histogram, compare_histograms
from sensor.calibrate.known import (
    Parameter,
    defect_parameters,
    noise_parameters,
    outside_parameters,
    pattern_parameters,
)
from sensor.calibrate.misfits import misfits
from sensor.calibrate.moving import moving_parameters, reset_rule
from sensor.calibrate.noise import Noise, measure_noise
from sensor.calibrate.pattern import PatternFit, fit_pattern
from sensor.calibrate.trains import Steps, Trains, read_trains
from sensor.laboratory.laws import measure_laws

Role = Literal["flat", "scene", "moving", "dark", "saturated"]
_SCENE: Final = 0.3
"""Correlation of neighbouring pixels from which constant light is a scene and not uniform."""
_MOST_RATE: Final = 0.8
"""Mean rate from which a flat is too bright: intervals shorter than a cycle are lost."""
_LEAST_SPIKES: Final = 10
"""Fewest spikes of the median pixel of a flat."""
_DARK_SPIKES: Final = 0.5
"""Spikes a pixel from which the dark recording is in the likelihood of the pattern."""
_ROUNDS: Final = 2
_FITS: Final = 2 * _ROUNDS + 2
"""Steps of a calibration beside the reading and comparing of each recording: fits of noise and
pattern in rounds, of the noise before, and of the reset rule."""


@dataclass(frozen=True, eq=False)
class Recording:
    """A recording to calibrate from.

    Attributes:
        name: name of the file.
        stream: its spikes.
        ratio: light of a flat in a unit common to the flats; None if unknown.
    """

    name: str
    stream: SpikeStream
    ratio: float | None = None


@dataclass(frozen=True, eq=False)
class Calibration:
    """The result.

    Attributes:
        parameters: parameters by name.
        roles: what each recording was used as, by its name.
        levels: name, light (thresholds a cycle, None if unknown) and rate of each flat.
        histograms: histograms of the recordings of constant light.
        does_not_fit: lines that name what the model does not explain.
        notes: what a reader must know.
        shape: (height, width), pixels.
        clock: stated.
        duplicated: pairs (source, target) of rows with the same bits.
        still: recording of still light with which a film of the preset is compared, and the rate,
            (n,) spikes a cycle, at which its pixels fire without a pattern; None for none.
    """

    parameters: dict[str, Parameter]
    roles: dict[str, Role]
    levels: tuple[tuple[str, float | None, float], ...]
    histograms: tuple[Histogram, ...]
    does_not_fit: tuple[str, ...]
    notes: tuple[str, ...]
    shape: tuple[int, int]
    clock: Clock
    duplicated: tuple[tuple[int, int], ...] = ()
    still: tuple[Trains, npt.NDArray[np.float64]] | None = None

    def document(self) -> dict[str, Any]:
        """For JSON."""
        return {
            "width": self.shape[1], "height": self.shape[0], "clock_hz": self.clock.hz,
            "confidence": 0.95, "roles": self.roles,
            "levels": [
                {"name": name, "light": light, "rate": rate} for name, light, rate in self.levels
            ],
            "parameters": {name: p.document() for name, p in self.parameters.items()},
            "histograms": [
                {
                    "name": h.name, "rate": h.rate, "measured": h.measured.tolist(),
                    "model": h.model.tolist(), "chi_square": h.chi_square, "bins": h.bins,
                    "chance": h.chance, "off": h.off,
                }
                for h in self.histograms
            ],
            "duplicated_rows": [list(pair) for pair in self.duplicated],
            "does_not_fit": list(self.does_not_fit), "notes": list(self.notes),
        }  # fmt: skip


def calibrate(
    recording: Recording,
    flats: Sequence[Recording] = (),
    dark: Recording | None = None,
    *,
    clock: Clock | None = None,
    progress: Progress | None = None,
) -> Calibration:
    """The parameters of a camera.

    Args:
        recording: any recording of it; of constant uniform light it counts as a flat, of constant
            light for the noise alone, and of a moving scene for limits.
        flats: recordings of constant uniform light, of unknown strength.
        dark: recording without light.
        clock: clock of the latches; None for the one that the recordings state.
        progress: receives the recordings that are read, and the fits.

    Raises:
        InputError: recordings that are too short, without spikes, of different sizes, or not what
            they are given as.
    """
    steps = Steps(progress, 2 * (len(flats) + 2) + _FITS)

    def read(each: Recording) -> Trains:
        steps(f"{Path(each.name).name} is read")
        return read_trains(each.stream, each.name, clock)

    notes: list[str] = []
    main = read(recording)
    given = [(read(each), each.ratio) for each in flats]
    black = None if dark is None else read(dark)
    for trains in (*(each for each, _ in given), *([black] if black else [])):
        _same_shape(main, trains)
    for each, (trains, _) in zip(flats, given, strict=True):
        _check_flat(each, trains)
    roles: dict[str, Role] = {trains.name: "flat" for trains, _ in given}
    role = _role(recording, main)
    roles.setdefault(main.name, role)
    if role == "flat" and all(trains.name != main.name for trains, _ in given):
        given.insert(0, (main, None))
    if black is not None:
        roles[black.name] = "dark"
        _check_dark(black, main, [trains for trains, _ in given])
    for trains, _ in given:
        if trains.rate > _MOST_RATE:
            roles[trains.name] = "saturated"
            notes.append(
                f"{trains.name} is left out: {trains.rate:.2f} spikes a cycle, above {_MOST_RATE}, "
                "where the latch hides spikes"
            )
    used = [(trains, ratio) for trains, ratio in given if roles[trains.name] == "flat"]
    if role == "moving":
        notes.append(
            f"the light of {main.name} was not constant"
            + ("; the parameters are those of the flats" if used else "")
        )
    if role == "scene":
        notes.append(f"{main.name} shows a scene at rest: it tells the noise, not the pattern")
    if role == "moving" and not used:
        pairs = duplicated_rows(main)
        found = [
            *moving_parameters(main), *([duplicate_parameter(pairs)] if pairs else []),
            *outside_parameters(False),
        ]  # fmt: skip
        return Calibration(
            {p.name: p for p in found}, roles, (), (), (), tuple(notes), main.shape, main.clock,
            pairs,
        )  # fmt: skip
    fits = _Fits(used, black, main if role == "scene" else None, notes, steps)
    parameters = {p.name: p for p in fits.parameters()}
    return Calibration(
        parameters, roles, fits.levels, fits.histograms,
        tuple(misfits(fits.histograms, fits.noise, fits.fit, parameters["reset"],
                      black, fits.good, fits.defects, fits.flats, fits.shade, fits.band)),
        tuple(notes), main.shape, main.clock, fits.duplicated, fits.still,
    )  # fmt: skip


class _Fits:
    """The fits to recordings of constant light.

    Args:
        flats: recordings with their ratios; may be empty if there is a scene.
        dark: recording without light, or None.
        scene: a scene at rest, or None.
        notes: notes, which are extended.
        steps: receives the fits.
    """

    def __init__(
        self, flats: Sequence[tuple[Trains, float | None]], dark: Trains | None,
        scene: Trains | None, notes: list[str], steps: Steps,
    ) -> None:  # fmt: skip
        self.flats = [trains for trains, _ in flats]
        self.dark, self.scene = dark, scene
        self.fit: PatternFit | None = None
        self.shade = np.zeros((scene or self.flats[0]).spikes.size)
        still = [*self.flats, *([scene] if scene else [])]
        if self.flats:
            self.defects = find_defects(self.flats, dark)
        else:
            none = np.zeros(self.shade.size, bool)
            self.defects = Defects(None, None, none, none)
        self.good = self.defects.good
        for each in self.flats:
            self.good = self.good & (each.spikes > 1)
        self.brightest = max(still, key=lambda each: each.rate)
        self.duplicated = duplicated_rows(self.brightest)
        self.good = self.good & originals(self.brightest, self.duplicated)
        if int(self.good.sum()) < 16:
            raise InputError(
                "the recordings", "of 16 good pixels or more", f"{int(self.good.sum())}",
                "record more pixels, or brighter light",
            )  # fmt: skip
        self.dim = dark is not None and float(dark.spikes[self.good].mean()) < _DARK_SPIKES
        steps("noise")
        noise = measure_noise([(each, self.good) for each in still], 0.0)
        if noise is None:
            raise InputError(
                "the recordings", "of nine intervals a pixel or more, each above a cycle", "fewer",
                "record longer, at 0.05 to 0.6 spikes a cycle",
            )  # fmt: skip
        self.noise: Noise = noise
        self.drift = measure_drift(max(still, key=lambda each: each.cycles), self.good)
        drift = self.drift.size if self.drift is not None and self.drift.known else 0.0
        if drift:
            self.noise = measure_noise([(each, self.good) for each in still], 0.0, drift) or noise
        self.band = self._band()
        self.even = self.good
        if self.band is not None:  # the noise that accumulates is that of the other rows
            self.even = self.good & ~band_pixels(self.band, self.brightest)
            self.noise = measure_noise([(each, self.even) for each in still], 0.0, drift) or noise
            self.band = self._band()
        if self.flats:
            self.shade = shading(self.flats, self.good)
            for _ in range(_ROUNDS):
                steps("pattern")
                self.fit = fit_pattern(
                    self.flats, None if self.dim else dark, [ratio for _, ratio in flats],
                    self.shade, self.good, self.noise.squared.value, self.timing,
                )  # fmt: skip
                steps("noise")
                again = measure_noise([(each, self.even) for each in still], self.dead, drift)
                self.noise = again or self.noise
            if float(np.ptp(self.shade)) > 0.02:
                notes.append(
                    f"a smooth shading of {np.ptp(self.shade):.1%} over the chip is taken as the "
                    "light's, not the camera's"
                )
        third = self.noise.third.value if self.noise.third is not None else 0.0
        compared = []
        for each in sorted(still, key=lambda t: t.rate):
            steps(f"intervals of {Path(each.name).name}")
            compared.append(
                compare_histograms(each, self.even, self.noise.squared.value, third, self.dead)
            )
        steps("reset rule")
        self.histograms = tuple(h for h in compared if h is not None)
        light: list[float | None] = [None] * len(self.flats)
        if self.fit is not None and (self.fit.dark is not None or self.dim):
            light = [float(value) for value in self.fit.light]
        self.levels = tuple(
            (t.name, each, t.rate) for t, each in zip(self.flats, light, strict=True)
        )

    def _band(self) -> Band | None:
        """The band of rows with timing noise, for the noise that is known so far."""
        noise = self.noise
        if not noise.mixed:
            return None
        return measure_band(self.brightest, self.good, noise.squared.value, 0.0, noise.timing)

    @property
    def still(self) -> tuple[Trains, npt.NDArray[np.float64]]:
        """See `Calibration`. Of a scene, a pixel's surroundings say its light."""
        trains = self.scene or max(self.flats, key=lambda each: each.spikes.sum())
        if self.scene is not None:
            from scipy.ndimage import median_filter

            rates = (trains.spikes / trains.cycles).reshape(trains.shape)
            return trains, np.asarray(median_filter(rates, 5, mode="nearest"), np.float64).ravel()
        rate = float(trains.spikes[self.good].mean() / trains.cycles)
        return trains, np.asarray(rate * (1 + self.shade))

    @property
    def timing(self) -> float:
        """Variance of the latch's instants, cycles^2."""
        return max(self.noise.jitter.value, 0.0) if self.noise.timing else 0.0

    @property
    def dead(self) -> float:
        """Dead time, cycles; 0 if unknown."""
        return max(self.fit.dead or 0.0, 0.0) if self.fit is not None else 0.0

    def parameters(self) -> list[Parameter]:
        """All parameters."""
        brightest = self.brightest
        hertz = brightest.clock.hz
        fit = self.fit
        error = 0.0 if fit is None or fit.dead is None else fit.error(0, 0, 0, 0, 1)
        out = noise_parameters(self.noise, error)
        if fit is not None:
            out += pattern_parameters(fit, hertz, self.dark, self.dim)
            flat = max(self.flats, key=lambda t: t.spikes.sum())
            squared = self.noise.squared.value
            out += line_parameters(measure_lines(flat, self.good, self.shade, squared))
            out += defect_parameters(self.defects, self.dark, fit, hertz)
        else:
            assert self.scene is not None
            limits = {"interval_noise", "threshold", "reset"}
            out += [p for p in moving_parameters(self.scene) if p.name not in limits]
        out += [drift_parameter(self.drift), *band_parameters(self.band, self.noise.mixed)]
        out.append(duplicate_parameter(self.duplicated))
        out.append(reset_rule(brightest, self.good, self.noise.squared.value))
        return [*out, *outside_parameters(bool(self.flats))]


def _same_shape(main: Trains, other: Trains) -> None:
    if other.shape != main.shape:
        raise InputError(
            other.name, f"of {main.shape[1]} x {main.shape[0]} pixels, as {main.name} is",
            f"{other.shape[1]} x {other.shape[0]}", "give recordings of one camera, or its --size",
        )  # fmt: skip


def _check_flat(each: Recording, trains: Trains) -> None:
    if not trains.spikes.any():
        raise InputError(trains.name, "one with spikes", "none", "record brighter light")
    laws = measure_laws(each.stream)
    if laws.motion is not None:
        raise InputError(
            f"--flat {trains.name}", "of constant light", f"changing light ({laws.motion})",
            "record a still, uniform surface under light without flicker",
        )  # fmt: skip
    middle = float(np.median(trains.spikes))
    if middle < _LEAST_SPIKES:
        raise InputError(
            f"--flat {trains.name}", f"of {_LEAST_SPIKES} spikes a pixel or more", f"{middle:g}",
            "record longer or brighter light",
        )  # fmt: skip


def _role(recording: Recording, trains: Trains) -> Role:
    if not trains.spikes.any():
        raise InputError(trains.name, "one with spikes", "none", "record brighter light")
    laws = measure_laws(recording.stream)
    if laws.motion is not None or _changes(trains):
        return "moving"
    if max((c for c in laws.neighbours if np.isfinite(c)), default=1.0) > _SCENE:
        return "scene"
    return "flat" if np.median(trains.spikes) >= _LEAST_SPIKES else "scene"


def _changes(trains: Trains) -> bool:
    """Whether the counts of parts of the recording differ by more than rounding (1/4) and a noise
    of 15 % of an interval allow, over all pixels."""
    parts = trains.parts(min(8, trains.cycles // 32))
    if len(parts) < 2:
        return False
    variance = parts.var(axis=0, ddof=1)
    return bool(variance.mean() > 2 * (0.25 + 0.02 * float(parts.mean())))


def _check_dark(dark: Trains, main: Trains, flats: Sequence[Trains]) -> None:
    for lit in flats or [main]:
        if dark.rate >= lit.rate:
            raise InputError(
                f"--dark {dark.name}", f"darker than {lit.name}, {lit.rate:.4g} spikes a cycle",
                f"{dark.rate:.4g}", "exchange the two, or cap the lens",
            )  # fmt: skip
