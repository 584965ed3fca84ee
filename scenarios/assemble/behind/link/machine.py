"""The machine of a camera whose stream crosses a link before it is shown."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any

from cosim.config.amounts import number
from cosim.plan.planner import accepted_error
from cosim.run.chain import STREAM
from cosim.run.machine import Finding, Outcome, Page, Recording, Run
from cosim.run.progress import Progress
from cosim.run.result import Throughput
from scenarios.assemble.behind.link.carrier import Carrier, make_carrier
from scenarios.assemble.behind.link.cut import CutCode
from scenarios.assemble.behind.link.judged import Watch, carrier_speeds, judge_carrier
from scenarios.assemble.behind.link.page import carried_page
from scenarios.assemble.behind.link.stream import CarriedStream
from scenarios.assemble.camera.machine import LatchedMachine, assemble_latched
from scenarios.assemble.schema.scenario import Scenario


@dataclass(frozen=True, eq=False)
class CarriedMachine(LatchedMachine):
    """A latched camera, planned and ready to run, whose stream crosses a link.

    Attributes:
        carrier: code and link.
    """

    carrier: Carrier

    @property
    def notes(self) -> list[str]:
        return [*super().notes, *self.carrier.notes]

    @property
    def length(self) -> int:
        return self.carrier.cycles

    @property
    def bits(self) -> int:
        return super().bits + self.carrier.pixel_cycles

    def trial(self, progress: Progress) -> list[Finding]:
        """Checks the link's plan; the camera's is checked during the recording."""
        return self.carrier.trial(progress)

    def keep(self, effects: Sequence[str]) -> CarriedMachine:
        latched = super().keep(self.carrier.keep(effects))
        assert isinstance(latched, CarriedMachine)
        return latched

    def stages(self, folder: Path) -> dict[str, Any]:
        return self.carrier.join(super().stages(folder), folder)

    def recorder(self, recording: Recording) -> Any:
        return super().recorder(recording).stage  # which runs later

    def identity(self) -> str:
        text = super().identity() + self.carrier.identity()
        return hashlib.sha256(text.encode()).hexdigest()

    def judge(self, recording: Recording, progress: Progress) -> Outcome:
        setup = self.setup
        watch = Watch(
            self.source, setup.instants, self.scenario.image, setup.white_rate, self.display,
            self.probe_camera(),
        )  # fmt: skip
        stages = recording.chain.stages
        outcome = self._behind_code(super().judge(recording, progress), stages["code"].sender.cut)
        return judge_carrier(
            self.carrier, watch, stages, recording.folder / STREAM, recording.seconds, outcome
        )

    def _behind_code(self, outcome: Outcome, cut: dict[tuple[int, int], int]) -> Outcome:
        """The outcome with the error of the display behind the code, if layers were left out:
        number of layers sent by first cycle and tile. What arrives whole has the error of the
        camera's own stream."""
        verifier, tolerance = self.verifier, self.scenario.tolerance
        if verifier is None or verifier.displays is None or not cut:
            return outcome
        code = CutCode(self.carrier.code, self.setup.shape, cut, verifier.plane)
        error = verifier.error_behind(code.through, "behind a code that left layers out")
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

    def throughput(self, recording: Recording) -> list[Throughput]:
        """Speeds of the stages; unknown for a resumed run."""
        if recording.resumed:
            return []
        pixels, seconds = self.setup.cycles * self.pixels, recording.seconds
        return [
            Throughput("sensor", pixels / seconds["sensor"], "pixel-cycles/s"),
            *carrier_speeds(self.carrier, seconds),
        ]

    def page(self, run: Run) -> Page:
        return carried_page(run, super().page)


def assemble_carried(
    name: str, scenario: Scenario, device: str | None, resume: bool, progress: Progress
) -> CarriedMachine:
    """The machine of a scenario with a latched camera and a link. Raises InputError."""
    with ExitStack() as stack:
        latched = assemble_latched(name, scenario, device, resume)
        stack.callback(latched.close)
        setup, setting = latched.setup, latched.setup.setting
        stream = CarriedStream.of(
            scenario, setup.shape, setting.clock, setup.cycles, setting.threshold,
            setting.threshold_noise,
        )  # fmt: skip
        carrier = make_carrier(stream, device, progress)
        given = {f.name: getattr(latched, f.name) for f in fields(LatchedMachine)}
        stack.pop_all()
    return CarriedMachine(**given, carrier=carrier)
