"""Images of reports at chosen instants, figures of merit, and the light of single pixels."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from cosim import Clock, Intensities, Lens, Light, Plane, last_reports
from cosim.light.source import Source
from cosim.run.result import Metric
from sensor.continuous.setting import ContinuousSetting
from sensor.latched.effects import EFFECTS
from sensor.latched.setting import CameraSetting
from sensor.reconstruct.fidelity import Estimate, to_white
from sensor.sections.sensor import SPIKING, SensorSection

FEW = 100
"""Electrons a time constant below which the shot noise drawn is a limit's (docs/continuous.md)."""
Instants = npt.NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class ContinuousShot:
    """One instant.

    Attributes:
        cycle: cycle of sensor.clock.
        truth: reflectance in its middle, white = 1, (H, W).
        continuous: last reports by its end, white = 1, (H, W); black without a report.
        age: ticks from that report to the instant, (H, W) int64; -1 without a report.
    """

    cycle: int
    truth: Plane
    continuous: Estimate
    age: Instants

    @property
    def silent(self) -> int:
        """Pixels that have not reported."""
        return int((self.age < 0).sum())


@dataclass
class PixelLight:
    """The light of a few pixels as the sensor receives it, knot by knot.

    Attributes:
        points: row, column and name of each pixel.
        when: instants of the knots, ps; two at one instant are a jump.
        level: lux at each knot, (points,).
    """

    points: list[tuple[int, int, str]]
    when: list[int] = field(default_factory=list)
    level: list[npt.NDArray[np.float32]] = field(default_factory=list)

    def take(self, light: Light, stop: int) -> None:
        """The pieces that are new, up to the run's end at `stop`."""
        rows = np.array([row for row, _, _ in self.points])
        columns = np.array([column for _, column, _ in self.points])
        for piece in light.pieces:
            if piece.start < stop and (not self.when or piece.start >= self.when[-1]):
                end = min(piece.stop, stop)
                last = piece.last if end == piece.stop else piece.level(end)
                self.when += [piece.start, end]
                self.level += [piece.first[rows, columns], last[rows, columns]]


def take_shots(
    reports: Intensities, source: Source, clock: Clock, instants: Sequence[int], white: float
) -> list[ContinuousShot]:
    """The image of each instant beside the truth. white: electrons a second of white."""
    shots = []
    for cycle in instants:
        place = last_reports(reports, cycle)
        there = place >= 0
        value, age = np.zeros(reports.shape), np.full(reports.shape, -1, np.int64)
        value[there] = reports.value[place[there]]
        age[there] = cycle - reports.time[place[there]]
        truth = source.truth(clock.middle(cycle))
        shots.append(ContinuousShot(cycle, truth, to_white(value, white), age))
    return shots


def report_ages(shots: Sequence[ContinuousShot], clock: Clock) -> Instants:
    """Ages of the reports that the images show, ps: pixels and instants together."""
    ages = np.concatenate([shot.age[shot.age >= 0] for shot in shots])
    return np.rint(ages * (1e12 / clock.hz)).astype(np.int64)


def report_metrics(reports: Intensities, setting: ContinuousSetting) -> dict[str, Metric]:
    """How much is put out; every pixel's report at the start counts as well."""
    pixels, seconds = reports.shape[0] * reports.shape[1], reports.ticks / reports.clock.hz
    rate = len(reports) / pixels / seconds
    return {
        "reports": Metric(float(len(reports)), "1"),
        "report_rate": Metric(rate, "reports/(pixel s)"),
        "report_bits": Metric(float(setting.report_bits), "bit"),
        "bit_rate": Metric(rate * setting.report_bits, "bit/(pixel s)"),
    }


def effect_names(setting: ContinuousSetting, camera: CameraSetting) -> list[str]:
    """Effects that act, by name."""
    names = ["shot noise"] * setting.noise + ["monitor's time constant", "change threshold"]
    names += ["measuring time"] * bool(setting.measure) + ["dead time"] * bool(setting.dead_time)
    names += ["converter", "report clock"]
    return names + [e.name for e in camera.acting_effects if e.name not in EFFECTS]


def notes_of(
    section: SensorSection, camera: CameraSetting, setting: ContinuousSetting, lens: Lens,
    white: float,
) -> list[str]:  # fmt: skip
    """What a user must know of the sensor as it is set. lens: its f-number is chosen where the
    section has none. white: electrons a second."""
    notes, electrons = [], white * setting.time_constant
    if section.lens.f_number is None:
        notes.append(
            f"f/{lens.f_number:.3g}, with which white would fire at "
            f"{section.lens.white_rate:.3g} a cycle in a spike camera of "
            f"{camera.threshold:g} e; nothing else here has that threshold"
        )
    if section.preset == "silicon":
        spiking = ", ".join(name.replace("_", " ") for name in SPIKING)
        notes.append(f"left out of the preset silicon, since no pixel spikes: {spiking}")
    if not setting.noise:
        notes.append("shot noise is off")
    if setting.floor > setting.contrast * white:
        notes.append(
            f"at any light only changes of {setting.floor / white:.2g} of white or more are "
            "reported: the floor is above the contrast; a longer time_constant lowers it"
        )
    if setting.converter.full_scale < white:
        share = setting.converter.full_scale / white
        notes.append(f"what reflects more than {share:.2g} of the light is beyond full_scale")
    if setting.noise and electrons < FEW:
        notes.append(
            f"white brings {electrons:.3g} electrons a time constant: shot noise is drawn in the "
            f"limit of many, which holds from some {FEW} up"
        )
    return notes
