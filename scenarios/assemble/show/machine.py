"""The machine of a source other than a latched chip, with the display that shows its output."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from cosim.report.parts import cards
from cosim.run.machine import Chain, Finding, Machine, Outcome, Page, Recording, Run
from cosim.run.progress import Progress
from cosim.run.result import Metric, Throughput
from display.chain.outcome import DisplayOutcome, chain_fidelity, write_observer_images
from display.probes.camera import ProbeCamera
from scenarios.assemble.show.feeds import Feed
from scenarios.assemble.show.playing import SHOWN, Playing
from scenarios.assemble.show.sections import display_cards, display_sections
from scenarios.assemble.show.shown import Shown
from scenarios.assemble.show.tables import display_lines

__all__ = ["ShownMachine", "ShownViews"]

OVERVIEW = "displays.png"
"""Figure of all displays; the page of the source has one of its own."""


@dataclass(frozen=True, eq=False)
class ShownViews:
    """What is made of a recording and of its display.

    Attributes:
        inner: the source's own outcome.
        display: what the observers have seen.
        stream: the planes shown.
    """

    inner: Outcome
    display: DisplayOutcome
    stream: Any


@dataclass(frozen=True, eq=False)
class ShownMachine:
    """A source and its display; see `Machine`.

    The source is planned, recorded and judged by its own machine. Then its output is played into
    the display, which keeps every effect. A run that is interrupted meanwhile goes on from the
    recording of the source and plays it again from the start.

    Attributes:
        inner: the machine of the source.
        feed: how its output becomes planes.
        playing: the display.
        probe: a camera for the probes of the display; None if the source has none.
    """

    inner: Machine
    feed: Feed
    playing: Playing
    probe: ProbeCamera | None

    @property
    def toml(self) -> str:
        return self.inner.toml

    @property
    def notes(self) -> Sequence[str]:
        kept = "the display keeps every effect"
        return [
            *self.inner.notes, f"white of the panel: {self.feed.white}", kept,
            *self.playing.chain.notes,
        ]  # fmt: skip

    @property
    def device(self) -> str:
        return self.inner.device

    @property
    def length(self) -> int:
        return self.inner.length

    @property
    def unit(self) -> str:
        return self.inner.unit

    @property
    def bits(self) -> int:
        height, width = self.feed.shape
        return self.inner.bits + self.feed.cycles * height * width

    def trial(self, progress: Progress) -> list[Finding]:
        return self.inner.trial(progress)

    def keep(self, effects: Sequence[str]) -> ShownMachine:
        return replace(self, inner=self.inner.keep(effects))

    def chain(self, folder: Path) -> Chain:
        return self.inner.chain(folder)

    def shortfall(self, recording: Recording) -> list[Finding]:
        return self.inner.shortfall(recording)

    def judge(self, recording: Recording, progress: Progress) -> Outcome:
        inner = self.inner.judge(recording, progress)
        planes = self.feed.planes(recording, inner)
        seconds, playing = recording.seconds, self.playing
        stream = playing.play(planes, recording.folder, seconds, progress)
        begin = time.perf_counter()
        # A minute of light, for PstLM, takes these pixels minutes.
        probes = None if self.probe is None else playing.chain.probes(self.probe, pst_lm=False)
        seconds["probes"] = time.perf_counter() - begin
        begin = time.perf_counter()
        outcome = DisplayOutcome.of(playing.chain, chain_fidelity(playing.chain), probes)
        files = write_observer_images(recording.folder, outcome)
        filmed = {}
        if playing.camera is not None:
            at = [playing.clock.middle(n) for n in playing.instants]
            files += playing.camera.write(recording.folder, at)
            filmed = playing.camera.metrics()
        seconds["images of the display"] = time.perf_counter() - begin
        stage = playing.chain.panel_stage
        effects = playing.chain.setting.acting_effects
        rate = stage.fired / (self.feed.cycles * self.feed.shape[0] * self.feed.shape[1])
        return replace(
            inner,
            renderer=stage.renderer.name,
            kept=[*inner.kept, *(effect.name for effect in effects)],
            metrics={
                **inner.metrics,
                **outcome.metrics(),
                **planes.metrics(),
                "shown_rate": Metric(rate, "spikes/cycle"),
                "shown_white_rate": Metric(self.feed.white_rate, "spikes/cycle"),
                **filmed,
            },
            latency=[*inner.latency, *outcome.latency()],
            throughput=[
                *inner.throughput,
                Throughput("display", self.feed.cycles / seconds["display"], "planes/s"),
            ],
            files=[*inner.files, *([] if planes.stored else [SHOWN]), *files],
            notes=[*inner.notes, *planes.notes()],
            table=display_lines(outcome),
            views=ShownViews(inner, outcome, stream),
        )

    def page(self, run: Run) -> Page:
        views: ShownViews = run.outcome.views
        page = self.inner.page(replace(run, outcome=views.inner))
        playing = self.playing
        shown = Shown(
            run, views.display, playing.clock, playing.instants, views.stream, playing.camera,
            OVERVIEW,
        )  # fmt: skip
        body, files = display_sections(shown)
        panel = playing.chain.panel
        told = (
            f"{page.subtitle}; {panel.shape[1]} x {panel.shape[0]} spike-continuous panel, "
            f"{panel.drive}, {panel.clock.hz / 1e3:g} kHz, drawn by {run.result.renderer}"
        )
        return replace(
            page,
            subtitle=told,
            cards=cards(display_cards(shown)) + page.cards,
            sections=[*body, *page.sections],
            files=list(dict.fromkeys([*page.files, *files])),
        )

    def close(self) -> None:
        self.playing.chain.close()
        self.inner.close()
