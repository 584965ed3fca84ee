"""The machine of a source and of what stands behind it: a link, and a display or a board.

It is one for every source. The stages behind a source that makes its planes in its own chain, as a
latched camera and a live stream do, run in that chain. Any other source is recorded first, and its
recording is then played into them.
"""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any, Final

from cosim import run_blocks
from cosim.compute.opencl import choose_device
from cosim.files import Recorder, ZarrStream
from cosim.plan.error import Finding
from cosim.run.chain import STREAM
from cosim.run.folder import how_to_resume, room_for
from cosim.run.machine import Chain, Machine, Outcome, Page, Recording, Run
from cosim.run.progress import Progress
from cosim.run.result import Metric
from scenarios.assemble.behind.board import BoardPanel, open_panel
from scenarios.assemble.behind.link.coding import CutCode
from scenarios.assemble.behind.link.ends import bare
from scenarios.assemble.behind.link.judged import Watch, judge_stream_link, stream_link_speeds
from scenarios.assemble.behind.link.page import stream_link_page
from scenarios.assemble.behind.link.stream_link import (
    RECEIVED,
    SentStream,
    StreamLink,
    make_stream_link,
)
from scenarios.assemble.behind.screen import Screen, ScreenViews, make_screen
from scenarios.assemble.instants import check_window, even_instants
from scenarios.assemble.schema.scenario import ImageSection, StreamScenario
from scenarios.assemble.source.feeds import Feed, Planes
from sensor.latched.stages import SceneStage

SHOWN: Final = "shown.zarr"
"""The planes that stand behind the source, in the folder of a run whose recording are others."""


def of_source(recording: Recording) -> Recording:
    """The recording of a source alone, whose stages a link has put into its own clock."""
    stages = getattr(recording.chain, "stages", None)
    if not stages or "receiver" not in stages:
        return recording
    own = {name: bare(stage) for name, stage in stages.items()}
    return replace(recording, chain=SimpleNamespace(stages=own))


@dataclass(frozen=True, eq=False)
class Behind:
    """What takes the planes of a source.

    Attributes:
        feed: the planes.
        link: the link; None without one.
        screen: the display; None without one.
        board: the board that displays the planes; None without one.
        opened: stack that closes the board.
    """

    feed: Feed
    link: StreamLink | None
    screen: Screen | None
    board: BoardPanel | None
    opened: ExitStack

    @property
    def notes(self) -> list[str]:
        return [
            *([f"white of the planes: {self.feed.white}"] if self.feed.white else []),
            *([] if self.screen is None else self.screen.notes),
            *([] if self.board is None else [self.board.note]),
            *([] if self.link is None else self.link.notes),
        ]

    @property
    def bits(self) -> int:
        """Upper limit of what is recorded beside the recording of the source, bits."""
        (height, width), sent = self.feed.shape, self.link
        own = 0 if self.feed.live and not self.feed.dark else self.feed.cycles * height * width
        return own + (0 if sent is None else sent.pixel_cycles)

    @property
    def lead(self) -> int:
        """Cycles of the chain before the first one of the stream."""
        return 0 if self.link is None else self.link.setup.lead

    @property
    def length(self) -> int:
        """Length of the chain, cycles."""
        return self.feed.cycles if self.link is None else self.link.cycles

    def identity(self) -> str:
        """Text of the properties on which a checkpoint depends, beyond the scenario."""
        parts = [] if self.screen is None else [self.screen.chain.identity()]
        return " ".join([*parts, *([] if self.link is None else [self.link.identity()])])

    def renewed(self, feed: Feed) -> Behind:
        """The same, before the first block, for a feed with another plan."""
        screen = None if self.screen is None else self.screen.renewed(feed)
        return replace(self, feed=feed, screen=screen)

    def join(self, stages: dict[str, Any], folder: Path) -> dict[str, Any]:
        """The whole chain: stages that make planes, then those of the link and the display."""
        telling = self.feed.telling()
        if telling is not None:
            stages = stages | {"ancillary": telling}
        if self.feed.dark:  # these are other planes than those of the source's own recording
            feed = self.feed
            stages = stages | {
                "planes to disk": Recorder(folder / SHOWN, feed.shape, feed.cycles, feed.clock)
            }
        if self.board is not None:
            stages = stages | {"sink": self.board}
        if self.screen is not None:
            stages = self.screen.stages(stages, folder)
        return stages if self.link is None else self.link.join(stages, folder)

    def play(
        self, planes: Planes, folder: Path, seconds: dict[str, float], progress: Progress
    ) -> tuple[dict[str, Any], dict[str, float]]:
        """Sends and shows the planes of a recording, and records them if they are not in the folder
        yet. An interrupted run plays them from the start again.

        Args:
            planes: the planes.
            folder: folder of the run.
            seconds: wall time of each stage, s; that of the stages here is added.
            progress: receives the progress.

        Returns:
            The stages of the chain, after their last block, and the wall time of each, s.

        Raises:
            Interrupted, InputError: the user stopped it; the disk is full.
        """
        what, feed = "the display" if self.screen or self.board else "the link", self.feed
        stages: dict[str, Any] = {}
        if self.screen is not None and feed.source is not None:
            stages["scene"] = SceneStage(feed.source, (0, 0))
        stages["planes"] = planes.stage
        if not planes.stored:
            stages["planes to disk"] = Recorder(folder / SHOWN, feed.shape, feed.cycles, feed.clock)
        stages = self.join(stages, folder)
        progress.start(what, self.length)
        with room_for(f"the planes of {what}", folder):
            spent = run_blocks(
                stages, self.length, progress=progress.advance, remedy=how_to_resume(folder),
                parallel=self.link is not None,
            )  # fmt: skip
        # The scene and the recording of the source have times of their own.
        seconds |= {f"{what[4:]}: {name}" if name in seconds else name: s
                    for name, s in spent.items()}  # fmt: skip
        return stages, spent

    def close(self) -> None:
        if self.screen is not None:
            self.screen.chain.close()
        self.opened.close()


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
class ChainMachine:
    """A source, and the link and the display behind it; see `Machine`.

    A run that is interrupted while a recording is played goes on from that recording and plays it
    again from the start.

    Attributes:
        inner: the machine of the source.
        behind: link, and display or board.
        image: the instants and the window of images at both ends of the link.
        instants: cycles of these images.
    """

    inner: Machine
    behind: Behind
    image: ImageSection
    instants: list[int]

    @property
    def feed(self) -> Feed:
        """The planes of the source."""
        return self.behind.feed

    @property
    def toml(self) -> str:
        return self.inner.toml

    @property
    def notes(self) -> Sequence[str]:
        return [*self.inner.notes, *self.behind.notes]

    @property
    def device(self) -> str:
        link = self.behind.link
        return self.inner.device if link is None else f"{self.inner.device}; {link.device}"

    @property
    def length(self) -> int:
        return self.behind.length if self.feed.live else self.inner.length

    @property
    def unit(self) -> str:
        return self.inner.unit

    @property
    def bits(self) -> int:
        return self.inner.bits + self.behind.bits

    def check(self, progress: Progress) -> list[Finding]:
        """Checks the plan of the source, then that of the link."""
        found, link = self.inner.check(progress), self.behind.link
        return found if found or link is None else link.check(progress)

    def keep(self, effects: Sequence[str]) -> ChainMachine:
        link = self.behind.link
        rest = effects if link is None else link.keep(effects)
        if not rest and not self.feed.live:
            return self
        inner = self.inner.keep(rest)
        return replace(self, inner=inner, behind=self.behind.renewed(self.feed.renewed(inner)))

    def chain(self, folder: Path) -> Chain:
        chain: Any = self.inner.chain(folder)
        if not self.feed.live:
            return chain
        chain.stages, chain.cycles = self.behind.join(chain.stages, folder), self.length
        text = chain.identity + self.behind.identity()
        chain.identity = hashlib.sha256(text.encode()).hexdigest()
        if self.behind.link is not None:
            chain.title += f", {self.length} with those of the link"
        if self.behind.screen is not None:
            chain.every_s = 60.0  # a display's state is half a gigabyte
        return chain

    def shortfall(self, recording: Recording) -> list[Finding]:
        return self.inner.shortfall(of_source(recording))

    def judge(self, recording: Recording, progress: Progress) -> Outcome:
        folder, seconds, behind = recording.folder, recording.seconds, self.behind
        inner = self.inner.judge(of_source(recording), progress)
        outcome = inner
        if self.feed.live:
            given = SHOWN if self.feed.dark else STREAM
            stages, spent = recording.chain.stages, seconds
        else:
            planes = self.feed.planes(recording, inner)
            given = STREAM if planes.stored and not self.feed.dark else SHOWN
            stages, spent = behind.play(planes, folder, seconds, progress)
            outcome = replace(
                inner,
                metrics=inner.metrics | planes.metrics(),
                files=[*inner.files, *([] if planes.stored else [SHOWN])],
                notes=[*inner.notes, *planes.notes()],
            )
        if self.feed.dark:
            rejected = Metric(float(bare(stages["ancillary"]).rejected), "1")
            outcome = replace(
                outcome, files=[*outcome.files, SHOWN],
                metrics=outcome.metrics | {"dark_spikes_rejected": rejected},
            )  # fmt: skip
        screen, link, seen = behind.screen, behind.link, None
        if screen is not None:
            shown = ZarrStream(folder / (given if link is None else RECEIVED))
            outcome = screen.judge(outcome, shown, folder, seconds, progress)
            seen = outcome.views
        if behind.board is not None:
            outcome = behind.board.judge(outcome)
        outcome = replace(outcome, views=_Views(inner, seen))
        if link is None:
            return outcome
        if cut := stages["code"].sender.cut:
            sent = partial(CutCode, link.code, self.feed.shape, cut)
            outcome = self.feed.behind_code(outcome, lambda plane: sent(plane).through)
        if not recording.resumed:
            speeds = [*outcome.throughput, *stream_link_speeds(link, spent)]
            outcome = replace(outcome, throughput=speeds)
        watch = Watch(
            self.feed, self.instants, self.image,
            None if screen is None else screen.chain, None if screen is None else screen.probe,
            # Those of a latched camera are of its images, not of its stream.
            () if self.feed.live else inner.latency, outcome.latency[len(inner.latency) :],
        )  # fmt: skip
        return judge_stream_link(link, watch, stages, folder / given, seconds, outcome)

    def page(self, run: Run) -> Page:
        return self._page(run) if self.behind.link is None else stream_link_page(run, self._page)

    def _page(self, run: Run) -> Page:
        """The page without the link."""
        views, screen = run.outcome.views, self.behind.screen
        own = replace(run, outcome=views.inner, recording=of_source(run.recording))
        page = self.inner.page(own)
        return page if screen is None else screen.page(run, views.screen, page)

    def close(self) -> None:
        self.behind.close()
        self.inner.close()


def with_behind(
    scenario: StreamScenario, machine: Machine, feed: Feed, device: str | None, progress: Progress
) -> ChainMachine:
    """A source with the link and the display of its scenario.

    Args:
        scenario: the scenario, with one of them.
        machine: machine of the source.
        feed: planes of the source.
        device: number or part of the name of an OpenCL device, "numba", or None for the default.
        progress: progress of the pilots of a link.

    Raises:
        InputError: the planes, a link, a display or a camera do not fit.
    """
    image = scenario.image or ImageSection()
    check_window(image)
    instants = even_instants(image, feed.cycles)
    screen = board = link = None
    with ExitStack() as stack:
        if scenario.display is not None:
            board = stack.enter_context(open_panel(scenario.display, feed.shape))
        if scenario.display is not None and board is None:
            opened = feed.device or (None if device is None else choose_device(device))
            screen = make_screen(scenario, instants, opened, feed)
            stack.callback(screen.chain.close)
        if scenario.link is not None:
            link = make_stream_link(SentStream.of(scenario, feed), device, progress)
        behind = Behind(feed, link, screen, board, stack.pop_all())
    return ChainMachine(machine, behind, image, instants)
