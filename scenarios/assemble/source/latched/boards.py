"""A board in the place of the sensor of a scenario.

It is a stage of the run's chain with the inputs and outputs of the sensor that it replaces. The
scene is drawn for the board's number of pixels. `rtl_model.stand_in` is imported only for scenarios
with a board.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, Any, Final

import numpy as np
import numpy.typing as npt

from cosim import Block, InputError, Light, Summary, Viform
from cosim.run.result import Metric
from rtl_model.registers import quantum
from scenarios.assemble.schema.scenario import Scenario
from sensor import CameraSetting
from sensor.latched.exposure import Exposure
from sensor.latched.pixel.charge import ONE

if TYPE_CHECKING:
    from rtl_model.stand_in import OpenBoard

NO_ERROR: Final = "a board's spikes are not held against full physics"
_SIMULATED: Final = (
    ("pattern", None), ("circuit", None), ("threshold_noise", 0.0), ("dead_time", 0.0),
    ("width", None), ("height", None), ("row_time", None),
    ("row_skew", 0.0), ("comparator_delay", 0.0), ("row_jitter", 0.0),
    ("row_wander", 0.0), ("drift", 0.0), ("crosstalk", 0.0), ("sub_threshold", None),
)  # fmt: skip
"""Keys of the sensor that a board has no such effect for, or a size of its own, with their
defaults."""


def refuse_boards(scenario: Scenario) -> None:
    """Raises InputError for a scenario with a board, for commands that only simulate."""
    sink = None if scenario.display is None else scenario.display.sink
    for key, value in (("sensor.source", scenario.sensor.source), ("display.sink", sink)):
        if value is not None:
            raise InputError(key, "absent except for viform run", value, "leave it out")


class BoardCamera:
    """A board as the camera stage of the chain.

    Attributes:
        shape: (rows, columns) of the board.
        name: name of the board, for messages.
        worst: largest error of a pixel's rate so far by rounding to electrons, spikes a cycle.
        level: threshold level of the board, at the lowest threshold of the run.
        sensor: the board's sensor.
    """

    def __init__(self, place: OpenBoard, setting: CameraSetting, rate: float, cycles: int) -> None:
        from rtl_model.stand_in import BoardSensor

        self.shape = (place.info.rows, place.info.columns)
        self.name, self.worst = place.name, 0.0
        self._setting, self._phases = setting, setting.phases
        self._levels = self._levels_of(rate)
        self._first, self.level = self._levels[0], min(self._levels)
        self._exposure = Exposure(setting.clock, setting.electrons_per_lux)
        self.sensor = BoardSensor(place, self._first, setting.reset, cycles)

    def _levels_of(self, rate: float) -> list[int]:
        """The board's level in each phase. Raises InputError if the light is too bright for levels
        with the ratios of the written ones."""
        from rtl_model.stand_in import finest_level, written_levels

        if not self._setting.writes:
            return [finest_level(rate)]
        thresholds = [phase.threshold for phase in self._phases]
        first = thresholds[0]
        levels = written_levels(
            rate * self._setting.threshold / first, [each / first for each in thresholds]
        )
        if levels is None:
            raise InputError(
                "sensor.writes", f"threshold levels that {self.name} has for this light, of at "
                "most 255 electrons a tick", f"thresholds of {sorted(set(thresholds))} e",
                "lower sensor.lens.white_rate, or choose levels of a simpler ratio",
            )  # fmt: skip
        return levels

    def step(self, light: Light, block: Block) -> Viform:
        """The latched flags of one block. Consecutive ticks with equal electrons are one burst."""
        steps = self._steps(light, block)
        changes = np.flatnonzero((steps[1:] != steps[:-1]).any(axis=(1, 2))) + 1
        writes = {
            phase.start - block.start: n for n, phase in enumerate(self._phases)
            if block.start <= phase.start < block.stop and self._setting.writes
        }  # fmt: skip
        edges = sorted({0, *changes.tolist(), *writes, len(steps)})
        parts = []
        for a, b in pairwise(edges):
            if a in writes:
                self.sensor.write(self._levels[writes[a]], self._phases[writes[a]].window)
            parts.append(self.sensor.expose(steps[a], b - a))
        stream = Viform.from_planes(np.concatenate(parts), self._setting.clock)
        return Viform(stream.words, block.cycles, self._setting.clock, block.start)

    def _steps(self, light: Light, block: Block) -> npt.NDArray[np.uint8]:
        """Electrons that each pixel of the board receives, (cycles, rows, columns) uint8."""
        from rtl_model.stand_in import quantise

        steps = np.empty((block.cycles, *self.shape), np.uint8)
        scale = 1 / (ONE * self._phases[0].threshold)
        for span in self._exposure.each(light, block.start, block.cycles):
            for n in range(span.cycles):
                if n and span.slope is None:
                    steps[span.first + n] = steps[span.first]
                    continue
                charge = span.charge
                if span.slope is not None:
                    charge = charge + span.slope * (span.elapsed + n)
                rate = charge.reshape(self.shape).astype(np.float64) * scale
                steps[span.first + n], off = quantise(rate, self._first)
                most = float(np.abs(off).max()) * quantum(self._first) / quantum(self.level)
                self.worst = max(self.worst, most)
        return steps

    @property
    def note(self) -> str:
        """A note for the user before the run."""
        (height, width), q = self.shape, quantum(self.level)
        return (
            f"{self.name} generates the spikes: {width} x {height} pixels, threshold {q} of its "
            f"electrons; the error of a rate is at most {0.5 / q:.2g} spikes a cycle; the board "
            "has no shot noise, and it is stepped: its ticks are not those of the clock"
        )

    def metrics(self) -> dict[str, Metric]:
        return {
            "board_bits_wrong": Metric(self.sensor.wrong_bits, "bits"),
            "board_quantisation": Metric(self.worst, "spikes/cycle"),
            "board_bytes": Metric(self.sensor.bytes, "bytes"),
        }

    def faults(self) -> list[str]:
        """Faults that make the outcome "failed"."""
        wrong = self.sensor.wrong_bits
        return [f"{wrong} bits of {self.name} differ from the cycle model"] if wrong else []


@dataclass(frozen=True)
class Boards:
    """The board of a run in the place of its sensor.

    Attributes:
        simulated: the scenario without the parts that boards replace.
        source: board that replaces the sensor, None for none.
    """

    simulated: Scenario
    source: OpenBoard | None = None

    @property
    def size(self) -> tuple[int, int] | None:
        """Rows and columns of the source, None without one."""
        return None if self.source is None else (self.source.info.rows, self.source.info.columns)

    def camera(self, setting: CameraSetting, scene: Summary, cycles: int) -> BoardCamera | None:
        """The camera stage of the source, None without one.

        Args:
            setting: the camera of the scenario, in the size of the board.
            scene: survey of the scene, for the brightest light.
            cycles: length of the run.
        """
        if self.source is None:
            return None
        rate = float(np.max(scene.brightest)) / setting.threshold
        return BoardCamera(self.source, setting, rate, cycles)


@contextmanager
def open_boards(scenario: Scenario, resume: bool) -> Iterator[Boards]:
    """Opens the board of `sensor.source`, and closes it at the end of the context.

    Raises InputError if it does not answer or cannot replace the sensor, and if `resume` is set
    with a board at either end: the charge of a board's pixels cannot be restored.
    """
    section, panel = scenario.sensor, scenario.display
    sink = None if panel is None else panel.sink
    if section.source is None and sink is None:
        yield Boards(scenario)
        return
    if resume:
        raise InputError(
            "--resume", "given for a run without a board, whose charge cannot be restored",
            "given for one with a board", "start it again with another --out",
        )  # fmt: skip
    update: dict[str, Any] = {"sensor": section.model_copy(update={"source": None})}
    simulated = scenario.model_copy(update=update | ({} if sink is None else {"display": None}))
    if section.source is None:
        yield Boards(simulated)
        return
    for name, default in _SIMULATED:
        if getattr(section, name) != default:
            raise InputError(
                f"sensor.{name}", "absent with sensor.source", "given",
                "leave it out: the board's array is of its own kind and size",
            )  # fmt: skip
    from rtl_model.stand_in import open_board

    with open_board(section.source, "sensor.source") as board:
        yield Boards(simulated, board)
