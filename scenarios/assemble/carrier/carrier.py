"""The link of a scenario: it carries a coded stream of spike planes."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import dropwhile
from pathlib import Path
from typing import Any, Final

from cosim import InputError
from cosim.config.amounts import number
from cosim.errors import section_at
from cosim.files import Recorder
from cosim.run.machine import Finding
from cosim.run.progress import Progress
from cosim.stage import BLOCK
from display.probes.setup import ProbeCamera
from link.air import ber
from link.receiving.packets import PacketReceiver
from link.section import LinkScenario
from link.setting import check_receiver
from link.setup.stream import StreamSetup, set_up_stream
from link.trial.check import goodput_change
from link.trial.plan import LinkPlan
from link.trial.planned import PlannedLink, check_plan, plan_link
from scenarios.assemble.carrier.coding import Decoder, Sender
from scenarios.assemble.carrier.far import FarEnd, Schedule
from scenarios.assemble.carrier.near import NearEnd
from scenarios.assemble.carrier.probe import CodedProbeCamera
from scenarios.assemble.carrier.stages import EachBlock, Later
from scenarios.assemble.carrier.stream import CarriedStream
from scenarios.assemble.chip import camera_setting
from sensor import CameraSetting
from sensor.codec.packets.catalogue import StreamCode
from sensor.codec.packets.section import CodeSection
from sensor.latched.stages import readout_stages

LINK_STREAM: Final = "link.zarr"
"""Recording of the link's camera in the folder of a run."""
RECEIVED: Final = "received.zarr"
"""The stream as it was decoded, in the folder of a run."""
_TOLERANCES: Final = (1.0, 0.3, 0.1, 0.03, 0.01, 1e-3, 0.0)
"""Tolerances of the link that are tried, half-widths of its bit error rate's interval."""
_SHARE: Final = 0.1
"""Largest share of the scenario's tolerance for the link."""
_PREFIX: Final = "link: "
"""Begins the name of an effect of the link among those of all parts."""
_FAR: Final = ("sink", "display")
"""Stages of a chain that take the decoded stream, each with all after it; the others make it."""


@dataclass(eq=False)
class Carrier:
    """The link, planned, and the code of the stream.

    Attributes:
        stream: what is sent.
        link: the link and its plan.
        setup: the link.
        promised: bound of the share of codewords that arrive otherwise than with full physics.
    """

    stream: CarriedStream
    link: PlannedLink
    setup: StreamSetup
    promised: float

    @property
    def section(self) -> CodeSection:
        """The section [code]."""
        return self.stream.code

    @property
    def hold(self) -> int:
        """Cycles from filming to showing: the group, the wait in the send buffer, the link."""
        return self.section.cycles + self.stream.wait + self.setup.delay

    @property
    def code(self) -> StreamCode:
        """The code, for the pixels that fire."""
        return self.section.code(self.stream.threshold, self.stream.noise)

    def probe(self, camera: ProbeCamera) -> CodedProbeCamera:
        """A camera of probes behind the code."""
        height, width = self.stream.shape
        return CodedProbeCamera(camera, self.section, self.code, self.setup.rate / (height * width))

    @property
    def device(self) -> str:
        """Device of the link's chip, for the result."""
        return f"link: {self.setup.device_name}"

    @property
    def cycles(self) -> int:
        """Cycles of the link."""
        return self.setup.cycles

    @property
    def joins(self) -> int:
        """Cycle of the link from which on the receiver listens: the start of a block."""
        late = round(self.stream.link.join * self.stream.clock.hz) // BLOCK * BLOCK
        return self.setup.lead + late if late else 0

    def stream_ms(self, cycle: int) -> float:
        """Time of a cycle of the link from the start of the stream, ms."""
        return (cycle - self.setup.lead) / self.stream.clock.hz * 1e3

    @property
    def pixel_cycles(self) -> int:
        """Of the link's camera and of the decoded stream."""
        return self.setup.pixel_cycles + self.stream.pixel_cycles

    @property
    def notes(self) -> list[str]:
        hz = self.stream.clock.hz
        return [
            *self.setup.notes(),
            f"the link carries {number(self.setup.rate * hz / 1e9)} Gbit/s of packets; the stream "
            f"is shown {number(self.hold / hz * 1e3)} ms after it is filmed",
        ]

    @property
    def kept(self) -> list[str]:
        """Effects of the link that are simulated."""
        return [_PREFIX + name for name in self.link.plan.simulated]

    @property
    def left_out(self) -> list[dict[str, Any]]:
        """Rows of `result.json` for the effects of the link that are left out."""
        check = self.link.check
        rows = self.link.plan.documents(None if check is None else check.measured)
        return [row | {"effect": _PREFIX + row["effect"]} for row in rows]

    def trial(self, progress: Progress) -> list[Finding]:
        """Checks the plan of the link on patches."""
        self.link, findings = check_plan(self.link, progress)
        return [replace(each, effect=_PREFIX + each.effect) for each in findings]

    def keep(self, effects: Sequence[str]) -> list[str]:
        """Plans the link with those of these effects that are its own; returns the others."""
        mine = [name.removeprefix(_PREFIX) for name in effects if name.startswith(_PREFIX)]
        if mine:
            self.link = self.link.keep(mine)
            self.promised = _promised(self.setup, self.link.plan)
        return [name for name in effects if not name.startswith(_PREFIX)]

    def identity(self) -> str:
        """Text of the properties on which a checkpoint depends, beyond the scenario."""
        return f"{self.setup.mode} {self.link.plan.tier} {sorted(self.link.plan.left_out)}"

    def join(self, stages: Mapping[str, Any], folder: Path) -> dict[str, Any]:
        """The stages of the whole chain.

        Args:
            stages: stages that make the stream and those that take it, by name, in their order.
            folder: folder of the run.
        """
        far = dict(dropwhile(lambda item: item[0] not in _FAR, stages.items()))
        near = {name: stage for name, stage in stages.items() if name not in far}
        setup, clock, cycles = self.setup, self.stream.clock, self.stream.cycles
        shape = self.stream.shape
        code = self.code
        control = self.section.control(clock.hz, setup.rate * clock.hz)
        assert control is not None  # the link limits the rate
        end = NearEnd(Sender(code, shape, cycles, control), setup)
        air = setup.setting.make_air(end.sent, end.sent.planes, self.link.plan.air_effects)
        sensor = self.link.make_camera(air.row_delay)
        recorder = Recorder(folder / LINK_STREAM, sensor.shape, setup.cycles, clock)
        modem = setup.scenario.link.modem
        receiver = PacketReceiver(
            sensor.shape,
            setup.cycles,
            detector=modem.detector,
            interleave=modem.interleave,
            begin=self.joins,
            device=setup.device,
        )
        schedule = Schedule(setup.lead, self.hold, self.section.cycles, cycles, clock)
        decoder = Decoder(code, shape)
        return {
            **{name: Later(stage, setup.lead, cycles) for name, stage in near.items()},
            "code": end,
            "air": air,
            "link.sensor": sensor,
            **{
                f"link.{name}": stage for name, stage in
                readout_stages(setup.scenario.sensor.duplicated_rows).items()
            },
            "link.recorder": recorder,
            "receiver": FarEnd(receiver, decoder, schedule, recorder.read_back),
            "received": EachBlock(Recorder(folder / RECEIVED, shape, cycles, clock)),
            **{name: EachBlock(stage) for name, stage in far.items()},
        }  # fmt: skip


def _promised(setup: StreamSetup, plan: LinkPlan) -> float:
    """Bound of the share of codewords that arrive otherwise than with full physics, from the bound
    of the bit error rate."""
    rate = float(ber(plan.scene))
    return goodput_change(rate, rate + plan.promised, setup.mode)


def make_carrier(stream: CarriedStream, device: str | None, progress: Progress) -> Carrier:
    """The link for a stream, planned. Raises InputError.

    One tolerance holds for all parts. What the link's plan leaves out changes its bit error rate,
    but the picture only through codewords that its code cannot mend. So the link takes the largest
    tolerance of its own at which that change is at most `_SHARE` of the scenario's.

    Args:
        stream: what is sent.
        device: number or part of the name of an OpenCL device, "numba", or None for the default.
        progress: progress of the pilots.
    """
    link = stream.scenario()
    with section_at("link.sensor"):
        setup = set_up_stream(
            link, _receiver(link, stream), device, progress, stream.cycles,
            2 * stream.code.cycles + stream.wait,
        )  # fmt: skip
    planned, promised = plan_link(setup), 0.0
    for tolerance in _TOLERANCES:
        planned = plan_link(replace(setup, chosen=replace(setup.chosen, tolerance=tolerance)))
        promised = _promised(setup, planned.plan)
        if promised <= _SHARE * stream.tolerance:
            break
    return Carrier(stream, planned, setup, promised)


def _receiver(link: LinkScenario, stream: CarriedStream) -> CameraSetting:
    """The chip at the far end, which counts the cycles of the stream. Raises InputError."""
    check_receiver(link.sensor, "link.sensor")
    setting, hz = camera_setting(link), stream.clock.hz
    if not math.isclose(setting.clock.hz, hz, rel_tol=1e-9):
        raise InputError(
            "link.sensor.clock", f"the stream's, {hz:g} Hz", f"{setting.clock.hz:g} Hz",
            f"write --set link.sensor.clock='{hz:.10g} Hz'",
        )  # fmt: skip
    return replace(setting, clock=stream.clock)  # one of 1e6 / 3 Hz has no decimal text
