"""Boards in a scenario: one in the sensor's place, one in the display's.

A board is a stage of the run's chain like the part whose place it takes: light in and spikes out,
or spikes in. The sensor then has the board's pixels: the scene is drawn for so many.
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
from rtl_model.registers import quantum
from scenarios.assemble.schema.scenario import Scenario
from sensor import CameraSetting
from sensor.latched.exposure import Exposure
from sensor.latched.pixel.fixed_point import ONE

if TYPE_CHECKING:
    from rtl_model.stand_in import BoardDisplay, StandIn

__all__ = ["NO_ERROR", "BoardCamera", "BoardPanel", "Boards", "open_boards", "refuse_boards"]

NO_ERROR: Final = "a board's spikes are not held against full physics"
_SIMULATED: Final = (
    ("pattern", None), ("circuit", None), ("threshold_noise", 0.0), ("dead_time", 0.0),
    ("row_skew", 0.0), ("comparator_delay", 0.0), ("crosstalk", 0.0),
)  # fmt: skip
"""What a simulated pixel may have and the board's has not."""


def refuse_boards(scenario: Scenario) -> None:
    """Raises InputError where a board is asked for by what simulates alone."""
    sink = None if scenario.display is None else scenario.display.sink
    for key, given in (("sensor.source", scenario.sensor.source), ("display.sink", sink)):
        if given is not None:
            raise InputError(key, "absent but for viform run", given, "leave it out")


class BoardCamera:
    """The board as the camera's stage. rate: the most of the scene, spikes a cycle.

    worst: largest error that whole electrons have made of a pixel's rate so far, spikes a cycle.
    """

    def __init__(self, place: StandIn, setting: CameraSetting, rate: float, cycles: int) -> None:
        from rtl_model.stand_in import BoardSensor, level_for

        self.shape = (place.info.rows, place.info.columns)
        self.name, self.worst = place.name, 0.0
        self.level = level_for(rate)
        self._setting = setting
        self._exposure = Exposure(setting.clock, setting.electrons_per_lux)
        self.sensor = BoardSensor(place, self.level, setting.reset, cycles)

    def step(self, light: Light, block: Block) -> Viform:
        """The latched flags of one block; ticks whose light is the same to the board are one
        burst."""
        steps = self._steps(light, block)
        changes = np.flatnonzero((steps[1:] != steps[:-1]).any(axis=(1, 2))) + 1
        edges = [0, *changes.tolist(), len(steps)]
        parts = [self.sensor.expose(steps[a], b - a) for a, b in pairwise(edges)]
        made = Viform.from_planes(np.concatenate(parts), self._setting.clock)
        return Viform(made.words, block.cycles, self._setting.clock, block.start)

    def _steps(self, light: Light, block: Block) -> npt.NDArray[np.uint8]:
        """The board's electrons in each cycle, (cycles, rows, columns)."""
        from rtl_model.stand_in import steps_of

        steps = np.empty((block.cycles, *self.shape), np.uint8)
        scale = 1 / (ONE * self._setting.threshold)
        for span in self._exposure.each(light, block.start, block.cycles):
            for n in range(span.cycles):
                if n and span.slope is None:
                    steps[span.first + n] = steps[span.first]
                    continue
                charge = span.charge
                if span.slope is not None:
                    charge = charge + span.slope * (span.elapsed + n)
                rate = charge.reshape(self.shape).astype(np.float64) * scale
                steps[span.first + n], off = steps_of(rate, self.level)
                self.worst = max(self.worst, float(np.abs(off).max()))
        return steps


class BoardPanel:
    """The board as the display's stage: what comes in goes out, and was shown."""

    def __init__(self, board: BoardDisplay, name: str, fit: str, shape: tuple[int, int]) -> None:
        self._board, self.name = board, name
        try:
            self._fit = fit_words(fit, shape, board.shape)  # type: ignore[arg-type]  # the schema's
        except ValueError as exc:
            raise InputError(
                "the stream for display.sink", f"of {board.shape[1]} x {board.shape[0]} pixels, "
                f"which {name} has", f"of {shape[1]} x {shape[0]}",
                "set display.fit=nearest or centre, or sensor.source to a board of that size",
            ) from exc  # fmt: skip
        self.planes = self.wrong = 0

    def step(self, data: Viform, block: Block) -> Viform:
        """Shows one block."""
        words = self._fit(data.words)
        shown = self._board.show(unpack_planes(words, 0, block.cycles).astype(bool))
        self.planes += shown.planes
        self.wrong += shown.wrong_crc
        return data


@dataclass
class Boards:
    """A run's open boards, None where it has none. panel: the sink's stage, once the stream's size
    is known."""

    source: StandIn | None = None
    sink: StandIn | None = None
    fit: str = "exact"
    panel: BoardPanel | None = None

    @property
    def size(self) -> tuple[int, int] | None:
        """Rows and columns of a board in the sensor's place."""
        return None if self.source is None else (self.source.info.rows, self.source.info.columns)

    def simulated(self, scenario: Scenario) -> Scenario:
        """What is left of the scenario to be simulated and planned."""
        if self.source is not None:
            sensor = scenario.sensor.model_copy(update={"source": None})
            scenario = scenario.model_copy(update={"sensor": sensor})
        return scenario if self.sink is None else scenario.model_copy(update={"display": None})

    def camera(self, setting: CameraSetting, scene: Summary, cycles: int) -> BoardCamera | None:
        """The board's camera, and the sink's stage, made ready; None where pixels are simulated."""
        if self.sink is not None and self.panel is None:
            from rtl_model.stand_in import BoardDisplay

            shape = (setting.chip.height, setting.chip.width)
            self.panel = BoardPanel(BoardDisplay(self.sink), self.sink.name, self.fit, shape)
        if self.source is None:
            return None
        rate = float(np.max(scene.brightest)) / setting.threshold
        return BoardCamera(self.source, setting, rate, cycles)

    def notes(self, camera: Any) -> list[str]:
        """What a user must know before the run."""
        told = []
        if isinstance(camera, BoardCamera):
            height, width = camera.shape
            q = quantum(camera.level)
            told.append(
                f"{camera.name} makes the spikes: {width} x {height} pixels, threshold {q} of its "
                f"electrons, so a rate is off by at most {0.5 / q:.2g} spikes a cycle; it has no "
                "shot noise, and is stepped, so its own ticks are not the clock's"
            )
        if self.panel is not None:
            told.append(f"{self.panel.name} shows the planes; no light is rendered")
        return told

    def metrics(self, camera: Any) -> dict[str, Metric]:
        """What the boards did."""
        made: dict[str, Metric] = {}
        if isinstance(camera, BoardCamera):
            made["board_bits_wrong"] = Metric(camera.sensor.wrong_bits, "bits")
            made["board_quantisation"] = Metric(camera.worst, "spikes/cycle")
            made["board_bytes"] = Metric(camera.sensor.bytes, "bytes")
        if self.panel is not None:
            made["sink_planes"] = Metric(self.panel.planes, "planes")
            made["sink_crc_wrong"] = Metric(self.panel.wrong, "bursts")
        return made

    def faults(self, camera: Any) -> list[str]:
        """What makes the run a failed one."""
        told = []
        if isinstance(camera, BoardCamera) and camera.sensor.wrong_bits:
            told.append(
                f"{camera.sensor.wrong_bits} bits of {camera.name} are not those of the cycle model"
            )
        if self.panel is not None and self.panel.wrong:
            told.append(f"what {self.panel.name} showed is not what it was sent: CRC-32")
        return told


@contextmanager
def open_boards(scenario: Scenario, resume: bool) -> Iterator[Boards]:
    """The boards that the scenario names, open. Raises InputError where one does not answer, or
    cannot stand in for this sensor."""
    section, panel = scenario.sensor, scenario.display
    sink = None if panel is None else panel.sink
    if section.source is None and sink is None:
        yield Boards()
        return
    if resume:
        raise InputError(
            "--resume", "given for a run without a board, whose charge cannot be put back", "one "
            "with a board", "run it afresh with another --out",
        )  # fmt: skip
    from rtl_model.stand_in import stand_in

    boards = Boards(fit="exact" if panel is None else panel.fit)
    with ExitStack() as stack:
        if section.source is not None:
            for name, plain in _SIMULATED:
                value = getattr(section, name)
                if value != plain:
                    raise InputError(
                        f"sensor.{name}", "absent with sensor.source", "given",
                        "leave it out: the board's pixels have none",
                    )  # fmt: skip
            boards.source = stack.enter_context(stand_in(section.source, "sensor.source"))
        if sink is not None:
            boards.sink = stack.enter_context(stand_in(sink, "display.sink"))
        yield boards
