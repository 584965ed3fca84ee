"""The display of a stream that is played: its stages, its outcome and its part of the page."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from cosim import Clock, SpikeStream
from cosim.compute.opencl import Device
from cosim.config.amounts import number
from cosim.light.source import Source
from cosim.run.machine import Outcome, Page, Run
from cosim.run.progress import Progress
from cosim.run.result import Metric, Throughput
from display.chain.display import DisplayChain, make_display_chain
from display.chain.outcome import DisplayOutcome, chain_fidelity, write_observer_images
from display.chain.pursuit import pursuit_of, pursuit_without_scene
from display.probes.setup import ProbeCamera
from display.section import DisplaySection
from scenarios.assemble.schema.filming import CameraSection
from scenarios.assemble.show.feeds import Feed
from scenarios.assemble.show.filmer import Filmer
from scenarios.assemble.show.filming import make_camera
from scenarios.assemble.show.sections import (
    display_cards,
    display_quality,
    display_sections,
    display_simulated,
)
from scenarios.assemble.show.shown import Shown
from scenarios.assemble.show.tables import display_lines

OVERVIEW = "displays.png"
"""Figure of all displays; the page of the source has one of its own."""


@dataclass(frozen=True, eq=False)
class ScreenViews:
    """What is made of a stream on its display.

    Attributes:
        display: what the observers have seen.
        stream: the planes shown.
    """

    display: DisplayOutcome
    stream: SpikeStream


@dataclass(frozen=True, eq=False)
class Screen:
    """A display that a stream is played into. It keeps every effect.

    Attributes:
        chain: the stages of the display.
        camera: the camera that films it; None without one.
        probe: a camera for its probes; None if the source has none.
        clock, cycles, shape: clock, cycles and shape of the stream.
        white_rate: spikes a cycle of white.
        instants: cycles of the images.
    """

    chain: DisplayChain
    camera: Filmer | None
    probe: ProbeCamera | None
    clock: Clock
    cycles: int
    shape: tuple[int, int]
    white_rate: float
    instants: Sequence[int]

    @property
    def notes(self) -> list[str]:
        return ["the display keeps every effect", *self.chain.notes]

    def stages(self, stages: dict[str, Any], folder: Path) -> dict[str, Any]:
        """The stages of a stream with those of the display and its camera."""
        filming = {} if self.camera is None else self.camera.stages(folder)
        return self.chain.stages(stages) | filming

    def judge(
        self, outcome: Outcome, stream: SpikeStream, folder: Path, seconds: dict[str, float],
        progress: Progress,
    ) -> Outcome:  # fmt: skip
        """The outcome of a source with that of its display; its views are `ScreenViews`. Writes the
        observers' images.

        Args:
            outcome: outcome of the source.
            stream: the planes shown.
            folder: folder of the run.
            seconds: wall time of each stage, s; that of probes and images is added.
            progress: told of the probes.
        """
        begin = time.perf_counter()
        # A minute of light, for PstLM, takes these pixels minutes.
        probes = None
        if self.probe is not None:
            probes = self.chain.probes(self.probe, progress, pst_lm=False)
        seconds["probes"] = time.perf_counter() - begin
        begin = time.perf_counter()
        seen = DisplayOutcome.of(self.chain, chain_fidelity(self.chain), probes)
        files, filmed = write_observer_images(folder, seen), {}
        if self.camera is not None:
            files += self.camera.write(folder, [self.clock.middle(n) for n in self.instants])
            filmed = self.camera.metrics()
        seconds["images of the display"] = time.perf_counter() - begin
        stage, effects = self.chain.panel_stage, self.chain.setting.acting_effects
        rate = stage.fired / (self.cycles * self.shape[0] * self.shape[1])
        return replace(
            outcome,
            renderer=stage.renderer.name,
            kept=[*outcome.kept, *(effect.name for effect in effects)],
            metrics={
                **outcome.metrics,
                **seen.metrics(),
                "shown_rate": Metric(rate, "spikes/cycle"),
                "shown_white_rate": Metric(self.white_rate, "spikes/cycle"),
                **filmed,
            },
            latency=[*outcome.latency, *seen.latency()],
            throughput=[
                *outcome.throughput,
                Throughput("display", self.cycles / seconds["display"], "planes/s"),
            ],
            files=[*outcome.files, *files],
            table=display_lines(seen),
            views=ScreenViews(seen, stream),
        )

    def page(self, run: Run, views: ScreenViews, page: Page) -> Page:
        """The page of a source with the sections of its display first."""
        shown = Shown(
            run, views.display, self.clock, list(self.instants), views.stream, self.camera, OVERVIEW
        )
        body, files = display_sections(shown)
        panel = self.chain.panel
        told = (
            f"{page.subtitle}; {panel.shape[1]} x {panel.shape[0]} spike-continuous panel, "
            f"{panel.drive}, {number(panel.clock.hz / 1e3)} kHz, drawn by {run.result.renderer}"
        )
        return replace(
            page,
            subtitle=told,
            simulated=f"{page.simulated} {display_simulated(shown)}",
            cards=[*display_cards(shown), *page.cards],
            good="How good the display is",
            quality=display_quality(shown),
            sections=[*body, *page.sections],
            files=list(dict.fromkeys([*page.files, *files])),
        )


def make_screen(
    section: DisplaySection,
    camera: CameraSection | None,
    feed: Feed,
    instants: Sequence[int],
    seed: int,
    scene: Source | None,
    pursued: Source | None,
    white: float | None,
    probe: ProbeCamera | None,
    device: Device | None,
    recorded: bool = False,
) -> Screen:
    """The display of a scenario, with every effect.

    Args:
        section: the section [display].
        camera: the section [camera]; None without one.
        feed: what the display shows.
        instants: cycles of the images.
        seed: seed of the camera's noise.
        scene: the scene; None without one.
        pursued: the same scene once more, on which the motion of the pursuing eye is measured.
        white: illuminance of the scene's white, lux; None without a scene.
        probe: a camera for the probes of the display; None for none.
        device: OpenCL device of the display, None for the default one.
        recorded: whether the feed is a recording.

    Raises:
        InputError: the panel cannot show the stream, the display cannot be rendered, or no frame
            of the camera fits.
    """
    panel = section.panel(feed.shape, feed.clock, 0.0, feed.white_rate)
    pursuit = pursuit_without_scene(section.pursuit)
    if pursued is not None:
        pursuit = pursuit_of(pursued, feed.clock.edge(feed.cycles), section.pursuit)
    setting = section.setting(panel, instants, feed.cycles, pursuit.velocity)
    chain = make_display_chain(
        section, feed.shape, white, feed.cycles, instants, setting, pursuit,
        [] if scene is None else scene.points(), device,
    )  # fmt: skip
    try:
        filming = make_camera(camera, chain, feed.shape, feed.cycles, seed, recorded=recorded)
    except BaseException:
        chain.close()
        raise
    return Screen(
        chain, filming, probe, feed.clock, feed.cycles, feed.shape, feed.white_rate, instants
    )
