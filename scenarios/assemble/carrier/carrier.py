"""The link of a scenario with a scene: it carries the coded stream of the camera to the display."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

from cosim import InputError
from cosim.files import Recorder
from cosim.run.machine import Finding
from cosim.run.progress import Progress
from cosim.stage import BLOCK
from display.probes.camera import ProbeCamera
from link.air import ber
from link.receiving.packets import PacketReceiver
from link.section import LinkScenario
from link.setting import check_receiver
from link.setup.stream import StreamSetup, set_up_stream
from link.trial.check import goodput_change
from link.trial.plan import LinkPlan
from link.trial.planned import PlannedLink, check_plan, plan_link
from scenarios.assemble.camera.setup import CameraSetup
from scenarios.assemble.carrier.coding import Decoder, Sender
from scenarios.assemble.carrier.far import FarEnd, Schedule
from scenarios.assemble.carrier.near import NearEnd
from scenarios.assemble.carrier.probe import CodedProbeCamera
from scenarios.assemble.carrier.stages import EachBlock, Later
from scenarios.assemble.chip import camera_setting
from scenarios.assemble.schema.scenario import Scenario
from sensor.codec.packets.catalogue import StreamCode
from sensor.codec.packets.section import CodeSection
from sensor.latched.readout import readout_stages

__all__ = ["LINK_STREAM", "RECEIVED", "Carrier", "make_carrier"]

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


@dataclass(eq=False)
class Carrier:
    """The link, planned, and the code of the stream.

    Attributes:
        section: the code.
        camera: the camera whose stream is sent.
        link: the link and its plan.
        setup: the link.
        promised: bound of the share of codewords that arrive otherwise than with full physics.
    """

    section: CodeSection
    camera: CameraSetup
    link: PlannedLink
    setup: StreamSetup
    promised: float

    @property
    def hold(self) -> int:
        """Cycles from filming to showing: the group, the wait in the send buffer, the link."""
        return self.section.cycles + _wait(self.section, self.camera) + self.setup.delay

    @property
    def code(self) -> StreamCode:
        """The code, for the pixels of the camera."""
        model = self.camera.setting
        return self.section.code(model.threshold, model.threshold_noise)

    def probe(self, camera: ProbeCamera) -> CodedProbeCamera:
        """A camera of probes behind the code."""
        height, width = self.camera.shape
        return CodedProbeCamera(
            camera, self.section, self.code, self.setup.rate / (height * width)
        )

    @property
    def cycles(self) -> int:
        """Cycles of the link."""
        return self.setup.cycles

    @property
    def joins(self) -> int:
        """Cycle of the link from which on the receiver listens: the start of a block."""
        assert self.camera.scenario.link is not None
        join = self.camera.scenario.link.join
        late = round(join * self.camera.setting.clock.hz) // BLOCK * BLOCK
        return self.setup.lead + late if late else 0

    def stream_ms(self, cycle: int) -> float:
        """Time of a cycle of the link from the start of the stream, ms."""
        return (cycle - self.setup.lead) / self.camera.setting.clock.hz * 1e3

    @property
    def pixel_cycles(self) -> int:
        """Of the link's camera and of the decoded stream."""
        return self.setup.pixel_cycles + self.camera.cycles * self.camera.setting.chip.width * (
            self.camera.setting.chip.height
        )

    @property
    def notes(self) -> list[str]:
        rate = self.setup.rate * self.camera.setting.clock.hz
        return [
            *self.setup.notes(),
            f"the link carries {rate / 1e9:.3g} Gb/s of packets; the stream is shown "
            f"{self.hold / self.camera.setting.clock.hz * 1e3:.3g} ms after it is filmed",
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

    def join(self, near: Mapping[str, Any], far: Mapping[str, Any], folder: Path) -> dict[str, Any]:
        """The stages of the whole chain.

        Args:
            near: stages of the camera, by name.
            far: stages that take the decoded stream.
            folder: of the run.
        """
        setup, clock, cycles = self.setup, self.camera.setting.clock, self.camera.cycles
        shape = self.camera.shape
        code = self.code
        control = self.section.control(clock.hz, setup.rate * clock.hz)
        assert control is not None  # the link limits the rate
        end = NearEnd(Sender(code, shape, cycles, control), setup)
        air = setup.setting.make_air(end.sent, end.sent.planes, self.link.plan.air_effects)
        sensor = self.link.make_camera(air.row_delay)
        recorder = Recorder(folder / LINK_STREAM, sensor.shape, setup.cycles, clock)
        modem = setup.scenario.link.modem
        receiver = PacketReceiver(
            sensor.shape, setup.cycles, detector=modem.detector, interleave=modem.interleave,
            begin=self.joins,
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


def _wait(section: CodeSection, camera: CameraSetup) -> int:
    """Largest wait in the send buffer, cycles."""
    return math.ceil(section.buffer * camera.setting.clock.hz)


def _promised(setup: StreamSetup, plan: LinkPlan) -> float:
    """Bound of the share of codewords that arrive otherwise than with full physics, from the bound
    of the bit error rate."""
    rate = float(ber(plan.scene))
    return goodput_change(rate, rate + plan.promised, setup.mode)


def make_carrier(
    scenario: Scenario, camera: CameraSetup, device: str | None, progress: Progress
) -> Carrier:
    """The link of a scenario with a scene, planned. Raises InputError.

    One tolerance holds for all parts. What the link's plan leaves out changes its bit error rate,
    but the picture only through codewords that its code cannot mend. So the link takes the largest
    tolerance of its own at which that change is at most `_SHARE` of the scenario's.
    """
    assert scenario.link is not None and scenario.code is not None
    section = scenario.code
    link = _link_scenario(scenario)
    check_receiver(link.sensor, "link.sensor")
    setting = camera_setting(link)
    if setting.clock != camera.setting.clock:
        raise InputError(
            "link.sensor.clock", f"the sensor's, {camera.setting.clock.hz:g} Hz",
            f"{setting.clock.hz:g} Hz", "leave it out: the link counts the sensor's cycles",
        )  # fmt: skip
    setup = set_up_stream(
        link, setting, device, progress, camera.cycles, 2 * section.cycles + _wait(section, camera)
    )
    planned, promised = plan_link(setup), 0.0
    for tolerance in _TOLERANCES:
        planned = plan_link(
            replace(setup, scenario=link.model_copy(update={"tolerance": tolerance}))
        )
        promised = _promised(setup, planned.plan)
        if promised <= _SHARE * scenario.tolerance:
            break
    return Carrier(section, camera, planned, setup, promised)


def _link_scenario(scenario: Scenario) -> LinkScenario:
    """The link as a scenario of its own, with random numbers of its own."""
    link = scenario.link
    assert link is not None
    for name, value, plain in (
        ("file", link.file, None),
        ("loop", link.loop, None),
        ("size", link.size, type(link).model_fields["size"].default),
    ):
        if value != plain:
            raise InputError(
                f"link.{name}", "absent with a [scene]", f"{value}",
                "leave it out: the link carries the stream of the camera",
            )  # fmt: skip
    sensor = link.sensor
    if sensor is None:
        own = scenario.sensor
        sensor = type(own)(
            chip=own.chip, clock=f"{own.clock} Hz", threshold=f"{own.threshold} e", reset="hard"
        )
    return LinkScenario(
        title=scenario.title, tolerance=scenario.tolerance,
        seed=(scenario.seed + 0x9E3779B9) % 2**32,  # the two chips have noise of their own
        link=link.model_copy(update={"sensor": None, "join": 0.0}), sensor=sensor,
    )  # fmt: skip
