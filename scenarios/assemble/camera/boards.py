"""Boards that replace the sensor or the display of a scenario.

Each is a stage of the run's chain with the inputs and outputs of the part that it replaces. The
scene is drawn for the board's number of pixels. `rtl_model.stand_in` is imported only for scenarios
with a board.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, Any, Final

import numpy as np
import numpy.typing as npt

from cosim import Block, InputError, Light, Summary, Viform
from cosim.run.result import Metric
from cosim.spikes.viform import unpack_planes
from display import fit_words
from display.section import DisplaySection
from rtl_model.registers import quantum
from scenarios.assemble.schema.scenario import Scenario
from sensor import CameraSetting
from sensor.latched.exposure import Exposure
from sensor.latched.pixel.charge import ONE

if TYPE_CHECKING:
    from rtl_model.stand_in import BoardDisplay, OpenBoard

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


class BoardPanel:
    """A board as the display stage of the chain. The stage passes the stream on unchanged.

    Attributes:
        name: name of the board, for messages.
        planes: number of planes displayed so far.
        wrong: number of bursts with a wrong CRC-32.
    """

    def __init__(self, board: BoardDisplay, name: str, fit: str, shape: tuple[int, int]) -> None:
        self._board, self.name = board, name
        try:
            self._fit = fit_words(fit, shape, board.shape)  # type: ignore[arg-type]  # the schema's
        except ValueError as exc:
            raise InputError(
                "the stream for display.sink", f"of {board.shape[1]} x {board.shape[0]} pixels, "
                f"the size of {name}", f"of {shape[1]} x {shape[0]}",
                "set display.fit=nearest or centre, or sensor.source to a board of that size",
            ) from exc  # fmt: skip
        self.planes = self.wrong = 0

    def step(self, data: Viform, block: Block) -> Viform:
        """Displays the planes of one block."""
        words = self._fit(data.words)
        burst = self._board.show(unpack_planes(words, 0, block.cycles).astype(bool))
        self.planes += burst.planes
        self.wrong += burst.wrong_crc
        return data

    @property
    def note(self) -> str:
        """A note for the user before the run."""
        return f"{self.name} displays the planes; no light is rendered"

    def metrics(self) -> dict[str, Metric]:
        return {
            "sink_planes": Metric(self.planes, "planes"),
            "sink_crc_wrong": Metric(self.wrong, "bursts"),
        }

    def faults(self) -> list[str]:
        """Faults that make the outcome "failed"."""
        if not self.wrong:
            return []
        return [f"the planes that {self.name} displayed differ from those sent: CRC-32"]


@contextmanager
def open_panel(section: DisplaySection, shape: tuple[int, int]) -> Iterator[BoardPanel | None]:
    """Opens the board of `display.sink` as a stage, None without one, and closes it at the end of
    the context. Raises InputError if it does not answer or does not hold the stream.

    shape: (height, width) of the stream.
    """
    if section.sink is None:
        yield None
        return
    from rtl_model.stand_in import BoardDisplay, open_board

    with open_board(section.sink, "display.sink") as board:
        yield BoardPanel(BoardDisplay(board), board.name, section.fit, shape)


@dataclass
class Boards:
    """The open boards of a run.

    Attributes:
        simulated: the scenario without the parts that boards replace.
        source: board that replaces the sensor, None for none.
        sink: board that replaces the display, None for none.
        fit: `display.fit` of the scenario.
        panel: stage of the sink, None until the size of the stream is known.
    """

    simulated: Scenario
    source: OpenBoard | None = None
    sink: OpenBoard | None = None
    fit: str = "exact"
    panel: BoardPanel | None = None

    @property
    def size(self) -> tuple[int, int] | None:
        """Rows and columns of the source, None without one."""
        return None if self.source is None else (self.source.info.rows, self.source.info.columns)

    def camera(self, setting: CameraSetting, scene: Summary, cycles: int) -> BoardCamera | None:
        """The camera stage of the source, None without one; also creates the stage of the sink.

        Args:
            setting: the camera of the scenario, in the size of the board.
            scene: survey of the scene, for the brightest light.
            cycles: length of the run.
        """
        if self.sink is not None and self.panel is None:
            from rtl_model.stand_in import BoardDisplay

            shape = (setting.chip.height, setting.chip.width)
            self.panel = BoardPanel(BoardDisplay(self.sink), self.sink.name, self.fit, shape)
        if self.source is None:
            return None
        rate = float(np.max(scene.brightest)) / setting.threshold
        return BoardCamera(self.source, setting, rate, cycles)

    def notes(self, camera: Any) -> list[str]:
        """Notes for the user before the run."""
        notes = []
        if isinstance(camera, BoardCamera):
            height, width = camera.shape
            q = quantum(camera.level)
            notes.append(
                f"{camera.name} generates the spikes: {width} x {height} pixels, threshold {q} of "
                f"its electrons; the error of a rate is at most {0.5 / q:.2g} spikes a cycle; the "
                "board has no shot noise, and it is stepped: its ticks are not those of the clock"
            )
        if self.panel is not None:
            notes.append(self.panel.note)
        return notes

    def metrics(self, camera: Any) -> dict[str, Metric]:
        """Metrics of the boards."""
        metrics: dict[str, Metric] = {}
        if isinstance(camera, BoardCamera):
            metrics["board_bits_wrong"] = Metric(camera.sensor.wrong_bits, "bits")
            metrics["board_quantisation"] = Metric(camera.worst, "spikes/cycle")
            metrics["board_bytes"] = Metric(camera.sensor.bytes, "bytes")
        if self.panel is not None:
            metrics |= self.panel.metrics()
        return metrics

    def faults(self, camera: Any) -> list[str]:
        """Faults of the boards that make the outcome "failed"."""
        faults = []
        if isinstance(camera, BoardCamera) and camera.sensor.wrong_bits:
            faults.append(
                f"{camera.sensor.wrong_bits} bits of {camera.name} differ from the cycle model"
            )
        if self.panel is not None:
            faults += self.panel.faults()
        return faults


@contextmanager
def open_boards(scenario: Scenario, resume: bool) -> Iterator[Boards]:
    """Opens the boards of a scenario, and closes them at the end of the context.

    Raises InputError if a board does not answer or cannot replace the sensor, and if `resume` is
    set: the charge of a board's pixels cannot be restored.
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
    from rtl_model.stand_in import open_board

    sensor = section.model_copy(update={"source": None})
    update = {"sensor": sensor} | ({} if sink is None else {"display": None})
    boards = Boards(scenario.model_copy(update=update), fit="exact" if panel is None else panel.fit)
    with ExitStack() as stack:
        if section.source is not None:
            for name, default in _SIMULATED:
                value = getattr(section, name)
                if value != default:
                    raise InputError(
                        f"sensor.{name}", "absent with sensor.source", "given",
                        "leave it out: the board's array is of its own kind and size",
                    )  # fmt: skip
            boards.source = stack.enter_context(open_board(section.source, "sensor.source"))
        if sink is not None:
            boards.sink = stack.enter_context(open_board(sink, "display.sink"))
        yield boards
