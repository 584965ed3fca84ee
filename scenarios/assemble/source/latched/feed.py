"""The planes of a latched camera for what stands behind it, and its camera for probes."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Final

import numpy as np
import numpy.typing as npt

from cosim import Block, Clock, Light, Viform
from cosim.compute.opencl import Device
from cosim.compute.stopping import heed
from cosim.config.amounts import number
from cosim.light.source import Source
from cosim.plan.error import accepted_error
from cosim.run.machine import Outcome
from cosim.spikes.viform import WORD, Words
from cosim.stage import BLOCK, blocks
from display import DisplaySetting
from display.chain.pursuit import Pursuit
from display.section import DisplaySection
from scenarios.assemble.source.feeds import Feed
from scenarios.assemble.source.latched.dim import dark_cycles, rejected_from
from sensor import CameraSetting, SpikeCamera
from sensor.latched.ancillary import AncillaryStage
from sensor.latched.reading import ReadingCamera
from sensor.latched.sampling import row_offsets
from sensor.latched.stages import readout_stages

NOISY: Final = 1 << 16
"""Cycles of a recording up to which the sampling instants of its rows are noisy: each cycle then
takes 0.1 ms. The noise moves single spikes by less than a cycle and does not accumulate, so a
recording of a minute, for what is slower than 100 Hz, goes without, as does one of a second at a
clock above 60 kHz."""
PART: Final = 4096
"""Cycles that are simulated at once, whole words: a noisy camera looks through all pieces of its
light in each cycle."""
SETTLE: Final = 64
"""Cycles before a sample, in which pixels fire once or more and forget how they began."""

if TYPE_CHECKING:
    from scenarios.assemble.source.feeds import Through
    from scenarios.assemble.source.latched.machine import LatchedMachine


class LatchedFeed(Feed):
    """The planes of a latched camera, which its own chain makes. Its plan may simulate the display
    as well."""

    pst_lm = True

    def __init__(self, machine: LatchedMachine) -> None:
        setup, setting = machine.setup, machine.setup.setting
        self._machine = machine
        super().__init__(
            setup.shape, setting.clock, setup.cycles, setup.white_rate, "", machine.scenario.scene,
            setting.threshold, setting.threshold_noise, live=True, device=setup.device,
            mosaic=setup.mosaic, dark=rejected_from(machine.scenario.sensor, setting),
            residues=machine.scenario.sensor.sub_threshold is not None,
            registers=setting.registers,
        )  # fmt: skip

    @property
    def planned(self) -> DisplaySetting | None:
        return self._machine.plan.display

    @property
    def source(self) -> Source:
        return self._machine.source

    def pursuit(self, section: DisplaySection) -> Pursuit:
        return self._machine.setup.pursuit

    def probe_camera(self) -> SpikeProbeCamera:
        # Probes are of the threshold before the first write.
        return SpikeProbeCamera(replace(self._machine.setup.setting, writes=()), self.device)

    def telling(self) -> AncillaryStage | None:
        machine = self._machine
        setup, setting = machine.setup, machine.setup.setting
        if not setup.says_more:
            return None
        charges = machine.camera if isinstance(machine.camera, ReadingCamera) else None
        dark = dark_cycles(machine.scenario.sensor, setting)
        return AncillaryStage(setup.shape, setting.phases, setting.threshold, charges, dark)

    def sample(self, first: int, cycles: int) -> Words | None:
        """See `Feed`. A camera that begins a little earlier films a part of the scene."""
        machine, setup = self._machine, self._machine.setup
        if machine.plan_check is None:  # a board makes the spikes
            return None
        begin = max(first - SETTLE, 0)
        stages = [
            *setup.stages(setup.source()).values(), machine.plan.camera(setup.device),
            *readout_stages(machine.scenario.sensor.duplicated_rows).values(),
        ]  # fmt: skip
        words: list[Words] = []
        for block in blocks(first + cycles - begin, BLOCK):
            data: Any = None
            for stage in stages:
                data = stage.step(data, Block(begin + block.start, block.cycles))
            words.append(np.array(data.words))
        return np.concatenate(words)[(first - begin) // WORD :]

    def renewed(self, machine: LatchedMachine) -> LatchedFeed:
        return LatchedFeed(machine)

    def behind_code(self, outcome: Outcome, through: Through) -> Outcome:
        """See `Feed`. What arrives whole has the error of the camera's own stream."""
        check, tolerance = self._machine.plan_check, self._machine.scenario.tolerance
        if check is None or check.displays is None:
            return outcome
        error = check.error_behind(through(check.plane), "behind a code that left layers out")
        high = error.ci[1] if error.ci is not None else 0.0
        if high <= accepted_error(tolerance):
            return replace(outcome, error=error)
        note = (
            f"behind the code the error is {number(error.value, 2)} (up to {number(high, 2)}) "
            f"where the tolerance is {number(tolerance)}: where layers were left out, each spike "
            "stands for several, and a spike that the plan has moved for as many"
        )
        return replace(
            outcome, error=error, notes=[*outcome.notes, note],
            outcome="degraded" if outcome.outcome == "ok" else outcome.outcome,
        )  # fmt: skip


@dataclass(frozen=True)
class SpikeProbeCamera:
    """Small arrays of the scenario's pixels; implements `display.probes.setup.ProbeCamera`.

    It uses the exact tier, so that the bits do not depend on the device. The circuit of the pixel
    has its lumped form, as in every tier except the reference.

    Attributes:
        setting: the scenario's camera.
        device: OpenCL device, None for the compiled form on the processor.
    """

    setting: CameraSetting
    device: Device | None

    @property
    def clock(self) -> Clock:
        return self.setting.clock

    @property
    def height(self) -> int:
        return self.setting.chip.height

    @property
    def seed(self) -> int:
        return self.setting.seed

    @property
    def identity(self) -> Any:
        return self.setting  # the bits are those of any device

    def lux(self, rate: float) -> float:
        return rate / self.setting.rate(1.0)

    def spikes(self, rate: float) -> float:
        return 0.0

    def row_delays(self, rows: int) -> npt.NDArray[np.int64]:
        return row_offsets(self.clock, rows, self.setting.row_skew, 0.0, (0, rows))

    def film(
        self,
        light: Light,
        cycles: int,
        shape: tuple[int, int],
        seed: int,
        rows: tuple[int, int] | None = None,
    ) -> Viform:
        setting = self.setting
        if cycles > NOISY:
            setting = replace(setting, parameters={**setting.parameters, "row_timing": None})
        chip = replace(setting.chip, height=shape[0], width=shape[1])
        camera = SpikeCamera(replace(setting, chip=chip, seed=seed), self.device, rows)
        words = []
        for first in range(0, cycles, PART):
            heed()
            block = Block(first, min(PART, cycles - first))
            words.append(np.array(camera.step(light, block).words))
        return Viform(np.concatenate(words), cycles, self.clock)
