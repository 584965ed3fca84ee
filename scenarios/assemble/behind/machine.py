"""The machine of a source other than a latched chip, with what its output is sent and shown by."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from cosim.files import ZarrStream
from cosim.run.machine import Chain, Finding, Machine, Outcome, Page, Recording, Run
from cosim.run.progress import Progress
from scenarios.assemble.behind.display.screen import ScreenViews
from scenarios.assemble.behind.link.judged import Watch, carrier_speeds, judge_carrier
from scenarios.assemble.behind.link.page import carried_page
from scenarios.assemble.behind.playing import SHOWN, Played, Playing
from scenarios.assemble.camera.boards import BoardPanel
from scenarios.assemble.schema.scenario import ImageSection
from scenarios.assemble.source.feeds import Feed, Planes


@dataclass(frozen=True, eq=False)
class _Views:
    """What is made of a recording and of its display.

    Attributes:
        inner: the source's own outcome.
        screen: what the display has shown; None without one.
    """

    inner: Outcome
    screen: ScreenViews | None


@dataclass(frozen=True, eq=False)
class PlayedMachine:
    """A source, and the link and the display that its output is played into; see `Machine`.

    The source is planned, recorded and judged by its own machine. Then its output is played: sent
    over the link, if there is one, and shown on the display, which keeps every effect, or on a
    board. A run that is interrupted meanwhile goes on from the recording of the source and plays it
    again from the start.

    Attributes:
        inner: the machine of the source.
        feed: how its output becomes planes.
        playing: link, and display or board.
        image: the instants and the window of images at both ends of the link.
        instants: cycles of these images.
    """

    inner: Machine
    feed: Feed
    playing: Playing
    image: ImageSection
    instants: list[int]

    @property
    def toml(self) -> str:
        return self.inner.toml

    @property
    def notes(self) -> Sequence[str]:
        return [*self.inner.notes, f"white of the planes: {self.feed.white}", *self.playing.notes]

    @property
    def device(self) -> str:
        carrier = self.playing.carrier
        return self.inner.device if carrier is None else f"{self.inner.device}; {carrier.device}"

    @property
    def length(self) -> int:
        return self.inner.length

    @property
    def unit(self) -> str:
        return self.inner.unit

    @property
    def bits(self) -> int:
        return self.inner.bits + self.playing.pixel_cycles

    def trial(self, progress: Progress) -> list[Finding]:
        """Checks the plan of the source, then that of the link."""
        found, carrier = self.inner.trial(progress), self.playing.carrier
        return found if found or carrier is None else carrier.trial(progress)

    def keep(self, effects: Sequence[str]) -> PlayedMachine:
        carrier = self.playing.carrier
        rest = effects if carrier is None else carrier.keep(effects)
        return replace(self, inner=self.inner.keep(rest)) if rest else self

    def chain(self, folder: Path) -> Chain:
        return self.inner.chain(folder)

    def shortfall(self, recording: Recording) -> list[Finding]:
        return self.inner.shortfall(recording)

    def judge(self, recording: Recording, progress: Progress) -> Outcome:
        inner = self.inner.judge(recording, progress)
        planes = self.feed.planes(recording, inner)
        played = self.playing.play(planes, recording.folder, recording.seconds, progress)
        return self.judge_played(recording, inner, planes, played, progress)

    def judge_played(
        self, recording: Recording, inner: Outcome, planes: Planes, played: Played,
        progress: Progress,
    ) -> Outcome:  # fmt: skip
        """Evaluates a stream that has been played.

        Args:
            recording: recording of the source.
            inner: the source's own outcome.
            planes: the planes, after their last block.
            played: the link and the display, after their last block.
            progress: told of what takes long.
        """
        folder, seconds, playing = recording.folder, recording.seconds, self.playing
        outcome = replace(
            inner,
            metrics=inner.metrics | planes.metrics(),
            files=[*inner.files, *([] if planes.stored else [SHOWN])],
            notes=[*inner.notes, *planes.notes()],
        )
        screen, carrier, seen = playing.screen, playing.carrier, None
        if screen is not None:
            outcome = screen.judge(outcome, ZarrStream(played.shown), folder, seconds, progress)
            seen = outcome.views
        if playing.board is not None:
            outcome = _displayed(outcome, playing.board)
        outcome = replace(outcome, views=_Views(inner, seen))
        if carrier is None:
            return outcome
        speeds = carrier_speeds(carrier, played.spent)
        watch = Watch(
            playing.scene, self.instants, self.image, self.feed.white_rate,
            None if screen is None else screen.chain, None if screen is None else screen.probe,
            inner.latency, outcome.latency[len(inner.latency) :],
        )  # fmt: skip
        return judge_carrier(
            carrier, watch, played.stages, played.given, seconds,
            replace(outcome, throughput=[*outcome.throughput, *speeds]),
        )  # fmt: skip

    def page(self, run: Run) -> Page:
        return self._page(run) if self.playing.carrier is None else carried_page(run, self._page)

    def _page(self, run: Run) -> Page:
        """The page without the link."""
        views, screen = run.outcome.views, self.playing.screen
        page = self.inner.page(replace(run, outcome=views.inner))
        return page if screen is None else screen.page(run, views.screen, page)

    def close(self) -> None:
        self.playing.opened.close()
        self.inner.close()


def _displayed(outcome: Outcome, board: BoardPanel) -> Outcome:
    """The outcome of a source with that of the board that has displayed its planes."""
    faults = board.faults()
    return replace(
        outcome,
        outcome="failed" if faults else outcome.outcome,
        metrics=outcome.metrics | board.metrics(),
        notes=[*outcome.notes, *faults],
    )
