"""The machine of a camera whose stream crosses a link before it is shown."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any

from cosim.run.machine import Finding, Outcome, Page, Recording, Run
from cosim.run.progress import Progress
from cosim.run.result import Throughput
from scenarios.assemble.camera.machine import LatchedMachine, assemble_latched
from scenarios.assemble.carrier.carrier import Carrier, make_carrier
from scenarios.assemble.carrier.judged import judge_carrier
from scenarios.assemble.carrier.page import FIGURE, RATES_FIGURE, carrier_sections
from scenarios.assemble.schema.scenario import Scenario

__all__ = ["CarriedMachine", "assemble_carried"]


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
        near = super().stages(folder)
        names = list(near)
        shown = names[names.index("display") :] if self.display is not None else []
        far = {name: near.pop(name) for name in shown}
        return self.carrier.join(near, far, folder)

    def identity(self) -> str:
        text = super().identity() + self.carrier.identity()
        return hashlib.sha256(text.encode()).hexdigest()

    def judge(self, recording: Recording, progress: Progress) -> Outcome:
        return judge_carrier(self.carrier, self, recording, super().judge(recording, progress))

    def throughput(self, recording: Recording) -> list[Throughput]:
        """Speeds of the stages; unknown for a resumed run."""
        if recording.resumed:
            return []
        seconds, pixels = recording.seconds, self.setup.cycles * self.pixels
        link = self.carrier.setup
        return [
            Throughput("sensor", pixels / seconds["sensor"], "pixel-cycles/s"),
            Throughput("code", pixels / seconds["code"], "pixel-cycles/s"),
            Throughput("air", link.symbols * link.mode.ticks / seconds["air"], "planes/s"),
            Throughput("link.sensor", link.pixel_cycles / seconds["link.sensor"], "pixel-cycles/s"),
            Throughput("receiver", link.cycles / seconds["receiver"], "planes/s"),
        ]

    def page(self, run: Run) -> Page:
        views = run.outcome.views.views
        page = super().page(replace(run, outcome=replace(run.outcome, views=views)))
        sections = carrier_sections(run)
        return replace(
            page, sections=[*sections, *page.sections],
            files=[*page.files, FIGURE, RATES_FIGURE],
        )  # fmt: skip


def assemble_carried(
    name: str, scenario: Scenario, device: str | None, resume: bool, progress: Progress
) -> CarriedMachine:
    """The machine of a scenario with a latched camera and a link. Raises InputError."""
    with ExitStack() as stack:
        latched = assemble_latched(name, scenario, device, resume)
        stack.callback(latched.close)
        carrier = make_carrier(scenario, latched.setup, device, progress)
        given = {f.name: getattr(latched, f.name) for f in fields(LatchedMachine)}
        stack.pop_all()
    return CarriedMachine(**given, carrier=carrier)
