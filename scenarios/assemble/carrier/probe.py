"""The camera of a display's probes behind the code of the link."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from cosim import Clock, Light, Viform
from display.probes.setup import ProbeCamera
from scenarios.assemble.carrier.coding import Sender
from sensor.codec.packets.catalogue import StreamCode
from sensor.codec.packets.section import CodeSection


@dataclass(frozen=True)
class CodedProbeCamera:
    """A probe camera whose stream is coded and decoded; implements `ProbeCamera`.

    The stream is in the time of the camera: the display shows it later by the hold of the link. An
    array has the share of the link's bits that as many pixels of the run have.

    Attributes:
        camera: the camera.
        section, code: the code of the run.
        bits: bits that the link carries for a pixel in a cycle.
    """

    camera: ProbeCamera
    section: CodeSection
    code: StreamCode
    bits: float

    @property
    def clock(self) -> Clock:
        return self.camera.clock

    @property
    def height(self) -> int:
        return self.camera.height

    @property
    def seed(self) -> int:
        return self.camera.seed

    @property
    def identity(self) -> Any:
        return object()  # its probes are computed in each run

    def lux(self, rate: float) -> float:
        return self.camera.lux(rate)

    def spikes(self, rate: float) -> float:
        return self.camera.spikes(rate)

    def row_delays(self, rows: int) -> npt.NDArray[np.int64]:
        return self.camera.row_delays(rows)

    def film(
        self,
        light: Light,
        cycles: int,
        shape: tuple[int, int],
        seed: int,
        rows: tuple[int, int] | None = None,
    ) -> Viform:
        return self.through(self.camera.film(light, cycles, shape, seed, rows))

    def through(self, stream: Viform) -> Viform:
        """The stream as it is decoded."""
        carried = self.bits * stream.shape[0] * stream.shape[1] * self.clock.hz
        control = self.section.control(self.clock.hz, carried)
        assert control is not None
        return Sender(self.code, stream.shape, stream.cycles, control).through(stream)
