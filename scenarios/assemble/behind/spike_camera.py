"""A latched spike camera that films the panel: the panel's planes as light, and its stream."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from cosim import Block, InputError, Light, Piece
from cosim.compute.opencl import Device
from cosim.config.amounts import count, number
from cosim.errors import section_at
from cosim.files import Recorder, ZarrStream
from cosim.report.parts import Card, figure
from cosim.report.png import for_display, pictures_wanted, write_linear_png
from cosim.run.result import Metric
from cosim.spikes.viform import Viform
from cosim.stage import section
from display.panels.panel import SpikePanel
from display.plan.pixels import FilmedPixels
from display.report.shown import Shown
from scenarios.assemble.chip import camera_setting
from scenarios.assemble.lens import LUMINANCE, LensChoice, choose_lens
from scenarios.assemble.schema.scenario import SpikesSection
from sensor import CameraSetting, SpikeCamera
from sensor.reconstruct.fidelity import to_white
from sensor.reconstruct.playback import tfp
from sensor.reconstruct.shots import spike_rate
from sensor.sections.sensor import SensorSection

CAMERA: Final = "camera.zarr"
"""The stream of the camera in the folder of a run."""
BLOCK: Final = 64
"""Cycles of the camera in a block."""
WINDOW: Final = 41
"""Cycles of its pictures; all of a shorter stream."""
_LATCHED: Final = (
    ("pixel", "latched"), ("source", None), ("colour", None), ("sub_threshold", None),
    ("dark_limit", None), ("asynchronous", None), ("continuous", None), ("channel", None),
    ("duplicated_rows", ()), ("width", None), ("height", None),
)  # fmt: skip
"""Keys of the sensor that this camera does not have, with their defaults."""
State = dict[str, npt.NDArray[Any]]


@dataclass(frozen=True)
class _Exitance:
    """A scene that is a panel.

    Attributes:
        illuminance: exitance of the panel's white, lux: pi times its luminance.
    """

    illuminance: float


@dataclass(frozen=True)
class _Before:
    """A panel and the chip before it, as the assembly of a camera reads a scenario."""

    sensor: SensorSection
    scene: _Exitance
    seed: int


class _Filming:
    """The stage: the planes of the display become light, the light spikes, and these a stream."""

    def __init__(self, filmer: SpikesFilmer, recorder: Recorder) -> None:
        self._filmer, self._recorder = filmer, recorder
        panel, setting = filmer.panel, filmer.setting
        height = panel.shape[0]
        self._pixels = FilmedPixels(panel, filmer.mapping)
        delay = np.floor(np.arange(height) * panel.row_delay / height).astype(np.int64)
        self._camera = SpikeCamera(setting, filmer.device, row_delay=delay)
        self._relay = filmer.choice.lens.relay(setting.chip.pitch)
        self._plane = self._cycle = 0
        dark = np.zeros(panel.shape, np.float32)
        self._pieces = [Piece(0, panel.start(0), dark, dark)]

    def step(self, data: Viform, block: Block) -> Viform:
        """Films the planes of one block; blocks begin at whole words."""
        filmer, panel = self._filmer, self._filmer.panel
        for planes, packets in self._pixels.words(data):
            light = packets * (filmer.lux / panel.white_rate)
            for level in light.reshape(planes, *panel.shape).astype(np.float32):
                start, stop = panel.start(self._plane), panel.start(self._plane + 1)
                self._pieces.append(Piece(start, stop, level, level))
                self._plane += 1
            self._expose()
        return data

    def _expose(self) -> None:
        """Exposes the camera as far as the light reaches."""
        filmer, clock = self._filmer, self._filmer.setting.clock
        before, after = filmer.setting.reach
        until = self._pieces[-1].stop
        while self._cycle < filmer.cycles:
            stop = min(self._cycle + BLOCK, filmer.cycles)
            if clock.edge(stop + after) + filmer.latest > until:
                return
            light = self._relay(Light(tuple(self._pieces)))
            block = Block(self._cycle, stop - self._cycle)
            self._recorder.step(self._camera.step(light, block), block)
            self._cycle = stop
            # Later rows of the panel still show earlier light.
            oldest = clock.edge(max(stop - before, 0)) - filmer.latest
            self._pieces = [piece for piece in self._pieces if piece.stop > oldest]

    def _parts(self) -> dict[str, Any]:
        """All parts with a state, by name."""
        return {"pixels": self._pixels, "camera": self._camera, "recorder": self._recorder}

    def state(self) -> State:
        """Everything that the next block depends on."""
        state: State = {
            "counts": np.array([self._plane, self._cycle]),
            "starts": np.array([p.start for p in self._pieces] + [self._pieces[-1].stop]),
            "levels": np.stack([piece.first for piece in self._pieces]),
        }
        for name, part in self._parts().items():
            state |= {f"{name}/{key}": value for key, value in part.state().items()}
        return state

    def restore(self, state: State) -> None:
        """Restores a `state`."""
        self._plane, self._cycle = (int(n) for n in state["counts"])
        edges = [int(n) for n in state["starts"]]
        self._pieces = [
            Piece(start, stop, level, level)
            for start, stop, level in zip(edges, edges[1:], state["levels"], strict=False)
        ]
        for name, part in self._parts().items():
            part.restore(section(state, name))

    def damage(self, state: State, checked: Callable[[int, int], None]) -> str | None:
        """See `WithFiles`."""
        return self._recorder.damage(section(state, "recorder"), checked)


class SpikesFilmer:
    """A spike camera before the panel; implements `Filmer`.

    Attributes:
        panel: the panel.
        setting, choice: the camera, of the panel's size, and its lens.
        cycles: length of its stream, cycles of its clock.
        lux: exitance of the panel's white, lux.
        latest: delay of the panel's last row, ps.
        device: OpenCL device, None for numba.
        mapping: maps words of the stream to words of the panel; None for equal sizes.
    """

    figures: list[str] = []  # noqa: RUF012  # it has none

    def __init__(
        self, panel: SpikePanel, planes: int, setting: CameraSetting, choice: LensChoice,
        lux: float, device: Device | None, mapping: Any,
    ) -> None:  # fmt: skip
        self.panel, self.setting, self.choice, self.lux = panel, setting, choice, lux
        self.device, self.mapping = device, mapping
        self.latest = round(panel.row_delay)
        end = panel.start(planes) - self.latest
        self.cycles = max(setting.clock.cycle_at(end) - setting.reach[1], 0)
        self._folder = Path()
        self._at: list[int] = []

    def stages(self, folder: Path) -> dict[str, Any]:
        self._folder = folder
        recorder = Recorder(folder / CAMERA, self.panel.shape, self.cycles, self.setting.clock)
        return {"film": _Filming(self, recorder)}

    @property
    def stream(self) -> ZarrStream:
        """Its stream, after the last block."""
        return ZarrStream(self._folder / CAMERA)

    def picture(self, cycle: int) -> Any:
        """TFP at a cycle, (H, W), the panel's white = 1."""
        window = min(WINDOW, self.cycles - 1 + self.cycles % 2)
        return to_white(tfp(self.stream, cycle, window), self.choice.white_rate)

    def write(self, folder: Path, at: list[int]) -> list[str]:
        clock, names = self.setting.clock, [CAMERA]
        self._at = sorted({min(clock.cycle_at(instant), self.cycles - 1) for instant in at})
        if not pictures_wanted():
            return names
        (folder / "images").mkdir(exist_ok=True)
        for cycle in self._at:
            names.append(f"images/filmed-{cycle:05d}.png")
            write_linear_png(folder / names[-1], self.picture(cycle))
        return names

    def metrics(self) -> dict[str, Metric]:
        return {
            "camera_cycles": Metric(float(self.cycles), "1"),
            "camera_spike_rate": Metric(spike_rate(self.stream), "spikes/cycle"),
            "camera_white_rate": Metric(self.choice.white_rate, "spikes/cycle"),
        }

    def cards(self) -> list[Card]:
        return [("", number(spike_rate(self.stream)), "spikes a cycle of the camera that films "
                 "the display")]  # fmt: skip

    def section(self, shown: Shown) -> str:
        clock = self.setting.clock
        drawn = "".join(
            figure(for_display(self.picture(cycle)), f"{number(clock.middle(cycle) / 1e9, 4)} ms")
            for cycle in self._at
        )
        return (
            "<h2>What a spike camera sees of the display</h2>"
            f"<p>{self.setting.chip.title}, {number(clock.hz / 1e3)} kHz, {count(self.cycles)} "
            f"cycles; a pixel for each of the {self.panel.shape[1]} x {self.panel.shape[0]} pixels "
            f"of the panel, f/{number(self.choice.lens.f_number)}: the panel's white, "
            f"{number(self.lux, 4)} lux of exitance, fires at {number(self.choice.white_rate)} a "
            "cycle. TFP images of its stream, "
            f'<code>{CAMERA}</code>.</p><div class="grid by3">{drawn}</div>'
        )


def make_spikes_filmer(
    given: SpikesSection, panel: SpikePanel, planes: int, seed: int, device: Device | None,
    mapping: Any,
) -> SpikesFilmer:  # fmt: skip
    """The camera of a section. Raises InputError for one that is not latched, that cannot be
    exposed, or whose run has no cycle."""
    for name, default in _LATCHED:
        value = getattr(given.sensor, name)
        if value != default:
            raise InputError(
                f"camera.sensor.{name}", "absent" if default in (None, ()) else str(default),
                str(value) if isinstance(value, str) else "given",
                "leave it out: a latched, simulated chip films the display, with a pixel for each "
                "of the panel",
            )  # fmt: skip
    lux = float(np.pi) * panel.luminance
    scenario: Any = _Before(given.sensor, _Exitance(lux), seed)
    with section_at("camera.sensor"):
        setting = camera_setting(scenario, *panel.shape)
        choice = choose_lens(scenario, setting, LUMINANCE)
    filmer = SpikesFilmer(panel, planes, setting, choice, lux, device, mapping)
    if not filmer.cycles:
        raise InputError(
            "camera.sensor.clock", "one with a cycle within the light of the panel",
            f"{setting.clock.hz:g} Hz", "raise it, or lengthen duration",
        )  # fmt: skip
    return filmer
