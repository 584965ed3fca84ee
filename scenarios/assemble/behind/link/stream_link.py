"""Stream links: a link behind a source, which carries its coded stream of spike planes.

`SentStream` is what is sent, `StreamLink` the link with its plan; `make_stream_link` sets it up.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import dropwhile
from pathlib import Path
from typing import Any, Final

from cosim import Clock, InputError
from cosim.config.amounts import number
from cosim.errors import section_at
from cosim.files import Recorder
from cosim.plan.error import Finding
from cosim.run.progress import Progress
from cosim.stage import BLOCK
from display.probes.setup import ProbeCamera
from link.air import ber
from link.plan.check import goodput_change, left_out_documents
from link.plan.plan import LinkPlan
from link.plan.planned import PlannedLink, check_plan, plan_link
from link.receiving.packets import PacketReceiver
from link.section import LinkScenario, LinkSection
from link.setting import check_receiver
from link.setup.stream import StreamSetup, set_up_stream
from scenarios.assemble.behind.link.coding import CodedProbeCamera, Decoder, Sender
from scenarios.assemble.behind.link.ends import EachBlock, FarEnd, Later, NearEnd, Schedule
from scenarios.assemble.behind.link.hold import PHASES, Stretch, choose_hold
from scenarios.assemble.chip import camera_setting
from scenarios.assemble.schema.scenario import Scenario, StreamScenario
from scenarios.assemble.source.feeds import THRESHOLD, Feed
from sensor import CameraSetting
from sensor.codec.packets.catalogue import StreamCode
from sensor.codec.packets.section import CodeSection
from sensor.latched.stages import readout_stages
from sensor.sections.sensor import SensorSection

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
_DEFAULT_TOLERANCE: Final = Scenario.model_fields["tolerance"].default
"""Tolerance of the link for a scenario without one: a recording has no error of its own."""
_NOISE_APART: Final = 0x9E3779B9
"""Added to the seed: the chips at both ends have noise of their own."""


@dataclass(frozen=True, eq=False)
class SentStream:
    """A stream of 1-bit planes for a link.

    Attributes:
        title, tolerance, seed: title, tolerance and seed of the scenario.
        code, link: its sections.
        chip: section of the chip that makes the stream; None for another source.
        feed: planes that are sent.
    """

    title: str
    tolerance: float
    seed: int
    code: CodeSection
    link: LinkSection
    chip: SensorSection | None
    feed: Feed

    @classmethod
    def of(cls, scenario: StreamScenario, feed: Feed) -> SentStream:
        """The stream of a scenario with a [link]."""
        assert scenario.link is not None and scenario.code is not None
        chip = getattr(scenario, "sensor", None)
        return cls(
            scenario.title, getattr(scenario, "tolerance", _DEFAULT_TOLERANCE), scenario.seed,
            scenario.code, scenario.link, chip if isinstance(chip, SensorSection) else None, feed,
        )  # fmt: skip

    @property
    def shape(self) -> tuple[int, int]:
        """(height, width) of the stream."""
        return self.feed.shape

    @property
    def clock(self) -> Clock:
        """Clock of the stream, and so of the link."""
        return self.feed.clock

    @property
    def cycles(self) -> int:
        """Length of the stream, cycles."""
        return self.feed.cycles

    @property
    def wait(self) -> int:
        """Largest wait in the send buffer, cycles."""
        assert self.code.buffer is not None
        return math.ceil(round(self.code.buffer * self.clock.hz, 6))

    @property
    def hold(self) -> int:
        """Cycles that a spike waits for its packet and in the send buffer."""
        assert self.code.cycles is not None
        return self.code.cycles + self.wait

    def chosen(self, carried: float) -> tuple[SentStream, str]:
        """The stream with packets and a buffer for a link that carries so many bits a cycle, and a
        note on their choice."""
        feed = self.feed
        stretch = Stretch(
            self.shape, self.cycles, self.clock, feed.threshold, feed.noise, feed.sample
        )
        code, note = choose_hold(self.code, stretch, carried)
        return replace(self, code=code), note

    @property
    def pixel_cycles(self) -> int:
        """Pixels times cycles of the stream."""
        return self.cycles * self.shape[0] * self.shape[1]

    @property
    def seconds(self) -> float:
        """Length of the stream, s."""
        return self.cycles / self.clock.hz

    def scenario(self) -> LinkScenario:
        """The link as a scenario of its own, with random numbers of its own. Raises InputError for
        keys of [link] that a link with a stream does not have."""
        link = self.link
        for name, value, plain in (
            ("file", link.file, None),
            ("loop", link.loop, None),
            ("size", link.size, type(link).model_fields["size"].default),
        ):
            if value != plain:
                raise InputError(
                    f"link.{name}", "absent in a link that carries a stream", f"{value}",
                    "leave it out: there is no file to send",
                )  # fmt: skip
        return LinkScenario(
            title=self.title, tolerance=self.tolerance, seed=(self.seed + _NOISE_APART) % 2**32,
            link=link.model_copy(update={"sensor": None, "join": 0.0}),
            sensor=self._receiver() if link.sensor is None else link.sensor,
        )  # fmt: skip

    def _receiver(self) -> SensorSection:
        """The chip at the far end where the scenario says none: that of the source, if it has one,
        with a hard reset."""
        own, rate = self.chip, f"{self.clock.hz} Hz"
        if own is None:
            return SensorSection(clock=rate, threshold=f"{THRESHOLD} e", reset="hard")
        return SensorSection(
            chip=own.chip, clock=rate, threshold=f"{own.threshold} e", reset="hard"
        )


@dataclass(eq=False)
class StreamLink:
    """A link that carries a coded stream of spike planes, with its plan.

    Attributes:
        stream: what is sent.
        planned: the link and its plan.
        setup: mode, timing and cameras of the link.
        promised: bound of the share of codewords that arrive otherwise than with full physics.
        choice: how packets and buffer were chosen, for the notes; "" if they are given.
    """

    stream: SentStream
    planned: PlannedLink
    setup: StreamSetup
    promised: float
    choice: str

    @property
    def section(self) -> CodeSection:
        """The section [code]."""
        return self.stream.code

    @property
    def group(self) -> int:
        """Cycles of a packet."""
        assert self.section.cycles is not None
        return self.section.cycles

    @property
    def hold(self) -> int:
        """Cycles from filming to showing: the group, the wait in the send buffer, the link."""
        return self.stream.hold + self.setup.delay

    @property
    def code(self) -> StreamCode:
        """The code, for the pixels that fire."""
        return self.section.code(self.stream.feed.threshold, self.stream.feed.noise, PHASES)

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
        """Recorded pixel-cycles: of the link's camera and of the decoded stream."""
        return self.setup.pixel_cycles + self.stream.pixel_cycles

    @property
    def notes(self) -> list[str]:
        """Notes for the user: those of the set-up, rate and delay."""
        hz = self.stream.clock.hz
        return [
            *self.setup.notes(),
            *([self.choice] if self.choice else []),
            f"the link carries {number(self.setup.rate * hz / 1e9)} Gbit/s of packets; the stream "
            f"is shown {number(self.hold / hz * 1e3)} ms after it is filmed",
        ]

    @property
    def kept(self) -> list[str]:
        """Effects of the link that are simulated."""
        return [_PREFIX + name for name in self.planned.plan.simulated]

    @property
    def left_out(self) -> list[dict[str, Any]]:
        """Rows of `result.json` for the effects of the link that are left out."""
        rows = left_out_documents(self.planned.plan, self.planned.check)
        return [row | {"effect": _PREFIX + row["effect"]} for row in rows]

    def check(self, progress: Progress) -> list[Finding]:
        """Checks the plan of the link on patches."""
        self.planned, findings = check_plan(self.planned, progress)
        return [replace(each, effect=_PREFIX + each.effect) for each in findings]

    def keep(self, effects: Sequence[str]) -> list[str]:
        """Plans the link with those of these effects that are its own; returns the others."""
        mine = [name.removeprefix(_PREFIX) for name in effects if name.startswith(_PREFIX)]
        if mine:
            self.planned = self.planned.keep(mine)
            self.promised = _promised(self.setup, self.planned.plan)
        return [name for name in effects if not name.startswith(_PREFIX)]

    def identity(self) -> str:
        """Text of the properties on which a checkpoint depends, beyond the scenario."""
        plan = self.planned.plan
        return f"{self.setup.mode} {self.section} {plan.tier} {sorted(plan.left_out)}"

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
        air = setup.setting.make_air(end.sent, end.sent.planes, self.planned.plan.air_effects)
        sensor = self.planned.make_camera(air.row_delay)
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
        group = code.cycles
        schedule = Schedule(setup.lead, self.hold, group, group // PHASES, cycles, clock)
        decoder = Decoder(code, shape, cycles)
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


def make_stream_link(stream: SentStream, device: str | None, progress: Progress) -> StreamLink:
    """The link for a stream, planned. Raises InputError.

    One tolerance holds for all parts. What the link's plan leaves out changes its bit error rate,
    but the picture only through codewords that its code cannot mend. So the link takes the largest
    tolerance of its own at which that change is at most `_SHARE` of the scenario's.

    Args:
        stream: what is sent.
        device: number or part of the name of an OpenCL device, "numba", or None for the default.
        progress: progress of the pilots.
    """
    link, choice = stream.scenario(), ""

    def hold(carried: float) -> int:
        nonlocal stream, choice
        stream, choice = stream.chosen(carried)
        return stream.hold

    with section_at("link.sensor"):
        setup = set_up_stream(link, _receiver(link, stream), device, progress, stream.cycles, hold)
    planned, promised = plan_link(setup), 0.0
    for tolerance in _TOLERANCES:
        planned = plan_link(replace(setup, chosen=replace(setup.chosen, tolerance=tolerance)))
        promised = _promised(setup, planned.plan)
        if promised <= _SHARE * stream.tolerance:
            break
    return StreamLink(stream, planned, setup, promised, choice)


def _receiver(link: LinkScenario, stream: SentStream) -> CameraSetting:
    """The chip at the far end, which counts the cycles of the stream. Raises InputError."""
    check_receiver(link.sensor, "link.sensor")
    setting, hz = camera_setting(link), stream.clock.hz
    if not math.isclose(setting.clock.hz, hz, rel_tol=1e-9):
        raise InputError(
            "link.sensor.clock", f"the stream's, {hz:g} Hz", f"{setting.clock.hz:g} Hz",
            f"write --set link.sensor.clock='{hz:.10g} Hz'",
        )  # fmt: skip
    return replace(setting, clock=stream.clock)  # one of 1e6 / 3 Hz has no decimal text
