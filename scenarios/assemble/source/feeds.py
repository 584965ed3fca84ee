"""The output of every kind of source as spike planes for a display.

| source | planes |
|---|---|
| asynchronous pixels | each full spike in the cycle of sensor.clock that latches it |
| the same, sending changes alone | the rate Q / width, held until the next event |
| continuous pixels | the reported value, held; the scene's white fires at sensor.lens.white_rate |
| imagers | the digital number, held from the end of one readout to that of the next |
| a recorded stream | its planes as they are |

Held values fire by a digital integrate-and-fire in integers (`HeldPlanes`): their rate is the value
over that of a spike in every cycle, and the number of spikes is within one of the closed form.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar, Final

import numpy as np

from cosim import Block, Clock, Light, Piece, Plane
from cosim.compute.opencl import Device
from cosim.light.mosaic import Mosaic
from cosim.light.source import Source
from cosim.run.machine import Outcome, Recording
from cosim.run.result import Metric
from cosim.spikes.clocked import ClockedEvents, HeldPlanes
from cosim.spikes.viform import Words
from cosim.stage import Stage
from display.chain.pursuit import Pursuit, pursuit_of, pursuit_without_scene
from display.panels.tone import Tone
from display.probes.setup import ProbeCamera
from display.section import DisplaySection
from display.setting import DisplaySetting
from scenarios.scenes.catalogue import SceneSection
from scenarios.scenes.kinds.grid import SceneGrid
from sensor.latched.writes import Registers

if TYPE_CHECKING:
    from cosim.plan.tiles import PatchPlane

    Through = Callable[[PatchPlane], Callable[[Words, int], Words]]

THRESHOLD: Final = 1000.0
"""Threshold of pixels that have none, electrons: of an unknown chip, and of held values. The
statistical code takes its noise for that of the spikes, and the link's chip has it by default."""


@dataclass(frozen=True, eq=False)
class Planes:
    """The stage that makes the planes of what stands behind a source from its recording.

    Attributes:
        stage: emits the planes of each block; its input is not used.
        stored: whether the planes are the stream of the run's folder already.
        partial: readings of the charge without a spike, which are not shown.
    """

    stage: Stage
    stored: bool = False
    partial: int = 0

    def metrics(self) -> dict[str, Metric]:
        """What the planes hold and lack, after the last block."""
        stage, found = self.stage, {}
        if isinstance(stage, ClockedEvents):
            found = {
                "shown_spikes": stage.spikes, "shown_lost": stage.lost, "shown_late": stage.late,
                "shown_readings_left_out": self.partial,
            }  # fmt: skip
        if isinstance(stage, HeldPlanes):
            found = {
                "shown_spikes": stage.spikes, "shown_values": stage.given,
                "shown_clipped": stage.clipped,
            }  # fmt: skip
        return {name: Metric(float(count), "1") for name, count in found.items()}

    def notes(self) -> list[str]:
        """What the user must know of the planes."""
        stage, notes = self.stage, []
        if isinstance(stage, ClockedEvents) and stage.lost:
            share = stage.lost / (stage.spikes + stage.lost)
            notes.append(
                f"{stage.lost} spikes ({share:.2g} of all) came in a cycle in which their pixel "
                "had fired already and are not shown: raise sensor.clock"
            )
        if isinstance(stage, HeldPlanes) and stage.clipped:
            notes.append(
                f"{stage.clipped} of {stage.given} values are above a spike in every cycle and are "
                "shown as that"
            )
        if self.partial:
            notes.append(f"{self.partial} readings of pixels that did not fire are not shown")
        return notes


class TonedSource:
    """A scene behind a law of tone mapping, as a `Source`: what the displays beside a panel with
    that law show, and what its picture is compared with. White stays white.

    Args:
        source: the scene.
        tone: the law.
        white: illuminance of white, lux.
    """

    def __init__(self, source: Source, tone: Tone, white: float) -> None:
        self.bare, self._tone, self._white = source, tone, white
        self.shape, self.notes, self.degraded = source.shape, source.notes, source.degraded
        self._known: list[tuple[Piece, Piece]] = []

    def step(self, data: None, block: Block) -> Light:
        """See `Source`. Between its knots the light is linear, as before the law."""
        return Light(tuple(self._piece(piece) for piece in self.bare.step(data, block).pieces))

    def truth(self, ps: int) -> Plane:
        return self._shown(self.bare.truth(ps))

    def points(self) -> Any:
        return self.bare.points()

    def _shown(self, plane: Plane) -> Plane:
        return np.asarray(self._tone.share(plane) / self._tone.white, np.float32)

    def _piece(self, piece: Piece) -> Piece:
        """The same object for the same piece, which others prepare once."""
        for known, made in self._known:
            if known is piece:
                return made
        white = np.float32(self._white)
        first = self._shown(piece.first / white) * white
        last = first if piece.constant else self._shown(piece.last / white) * white
        made = Piece(piece.start, piece.stop, first, last)
        self._known = [*self._known[-3:], (piece, made)]
        return made


@dataclass(frozen=True, eq=False)
class Feed:
    """How the output of a machine feeds what stands behind it.

    Attributes:
        shape: (height, width) of the planes.
        clock, cycles: clock and number of the planes.
        white_rate: spikes a cycle of the scene's white.
        white: what white means, in words, for the notes; "" for nothing to say.
        scene: section [scene]; None for a stream without one.
        threshold, noise: threshold and noise of the pixels whose spikes the planes are, electrons;
            of pixels that have none, those of an unknown chip.
        live: whether the stages of the machine's own chain make the planes, so that all that stands
            behind it runs in that chain.
        pst_lm: whether PstLM is probed: a minute of light takes slow pixels minutes.
        device: OpenCL device that the machine has opened; None for none.
        mosaic: filter array on the pixels; None for none.
        dark: cycles from which on the chip rejects an interval, 0 for none: what stands behind it
            has the planes without those spikes.
        residues: whether planes of charges below threshold come with the spikes.
        registers: thresholds and windows that are written during the stream; None for none.
        tone: law by which the planes show the source's values; None for the values themselves.
    """

    pst_lm: ClassVar[bool] = False
    shape: tuple[int, int]
    clock: Clock
    cycles: int
    white_rate: float
    white: str
    scene: SceneSection | None = None
    threshold: float = THRESHOLD
    noise: float = 0.0
    live: bool = False
    device: Device | None = None
    mosaic: Mosaic | None = None
    dark: int = 0
    residues: bool = False
    registers: Registers | None = None
    tone: Tone | None = None

    @property
    def planned(self) -> DisplaySetting | None:
        """The display as the plan of the machine simulates it; None where it keeps every effect."""
        return None

    @cached_property
    def source(self) -> Source | None:
        """The scene of the recording, for one pass, its light as a panel of its tone would show it;
        None without one."""
        drawn = self._draw()
        if drawn is None or self.tone is None or self.scene is None:
            return drawn
        return TonedSource(drawn, self.tone, self.scene.illuminance)

    def _draw(self) -> Source | None:
        """The scene on the pixels of the planes."""
        if self.scene is None:
            return None
        return self.scene.source(SceneGrid(self.shape, self.clock, self.cycles, aligned=False))

    def pursuit(self, section: DisplaySection) -> Pursuit:
        """Motion that the pursuing eye of a display follows."""
        scene = self._draw()
        if scene is None:
            return pursuit_without_scene(section.pursuit)
        return pursuit_of(scene, self.clock.edge(self.cycles), section.pursuit)

    def sample(self, first: int, cycles: int) -> Words | None:
        """Words of the planes from a cycle on, before the run; None where they are not known."""
        return None

    def probe_camera(self) -> ProbeCamera | None:
        """The source in the small, for the probes of a display; None if it has none."""
        return None

    def telling(self) -> Stage | None:
        """The stage that adds to planes that are live what their source says beyond the spikes;
        None if it says nothing."""
        return None

    def planes(self, recording: Recording, outcome: Outcome) -> Planes:
        """The planes of a recording and its evaluation by the machine, where they are not live."""
        raise NotImplementedError

    def behind_code(self, outcome: Outcome, through: Through) -> Outcome:
        """The outcome with the error behind a code that has left layers out, where one is measured.

        through: makes, for patches, the map from their words and cycles to those behind the code.
        """
        return outcome

    def renewed(self, machine: Any) -> Feed:
        """The feed of the same machine with another plan."""
        return self
