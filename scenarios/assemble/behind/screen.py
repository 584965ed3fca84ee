"""The display of a run, behind any source: made, judged and told of here."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from cosim import SpikeStream
from cosim.compute.opencl import Device
from cosim.compute.stopping import threads
from cosim.config.amounts import number
from cosim.light.mosaic import Mosaic, balanced
from cosim.run.machine import Outcome, Page, Run
from cosim.run.progress import Progress
from cosim.run.result import Metric, Throughput
from display.camera.rolling import make_shutter
from display.camera.stage import PanelCamera
from display.chain.display import SPIKE, DisplayChain, make_display_chain
from display.chain.outcome import (
    Colours,
    DisplayOutcome,
    chain_fidelity,
    write_observer_images,
)
from display.panels.panel import fit_words
from display.panels.tone import SeenRange, Tone, seen_range
from display.probes.setup import ProbeCamera
from display.report.filmed import FramesFilmer
from display.report.sections import (
    display_cards,
    display_quality,
    display_sections,
    display_simulated,
)
from display.report.shown import Filmer, Shown
from display.report.tables import display_lines
from scenarios.assemble.behind.spike_camera import make_spikes_filmer
from scenarios.assemble.schema.scenario import RecordingScenario, SpikesSection, StreamScenario
from scenarios.assemble.source.feeds import Feed, TonedSource
from scenarios.scenes.charts.patches import ColourChart, chart_matrix


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
    """A display that a stream is played into.

    Attributes:
        chain: the stages of the display.
        camera: the camera that films it; None without one.
        feed: what it shows.
        probe: a camera for its probes; None if the source has none.
        instants: cycles of the images.
        anew: makes the same display for a feed with another plan.
    """

    chain: DisplayChain
    camera: Filmer | None
    feed: Feed
    probe: ProbeCamera | None
    instants: Sequence[int]
    anew: Callable[[Feed], Screen]

    @property
    def notes(self) -> list[str]:
        every = [] if self.feed.planned else ["the display keeps every effect"]
        return [*every, *self.chain.notes]

    def renewed(self, feed: Feed) -> Screen:
        """The same display before its first block, for a feed with another plan."""
        self.chain.close()
        return self.anew(feed)

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
        chain, feed, begin = self.chain, self.feed, time.perf_counter()
        with threads(1) as beside:  # neither of the two loads two cores
            probing = beside.submit(self._probes, progress)
            fidelity = chain_fidelity(chain)
            seen = DisplayOutcome.of(chain, fidelity, probing.result())
        seconds["probes"] = time.perf_counter() - begin
        begin = time.perf_counter()
        colours = _colours(chain.section.colour, feed.mosaic)
        files, filmed = write_observer_images(folder, seen, colours), {}
        if colours is not None and isinstance(feed.source, ColourChart):
            filmed = _chart_metrics(seen, colours, feed.source)
        told: list[str] = []
        if feed.tone is not None:
            found = self._seen_range(seen, feed.tone)
            filmed |= _range_metrics(found)
            told = [] if found is None else [found.told]
        if self.camera is not None:
            files += self.camera.write(folder, [feed.clock.middle(n) for n in self.instants])
            filmed |= self.camera.metrics()
        seconds["images of the display"] = time.perf_counter() - begin
        effects, own = [], {}
        if not feed.planned:  # else the plan of the source says both
            effects = [effect.name for effect in chain.setting.acting_effects]
            rate = chain.panel_stage.fired / (feed.cycles * feed.shape[0] * feed.shape[1])
            own = {
                "shown_rate": Metric(rate, "spikes/cycle"),
                "shown_white_rate": Metric(feed.white_rate, "spikes/cycle"),
            }
        speeds = []
        if seconds.get("display"):  # a run that goes on may have left nothing to do
            speeds = [Throughput("display", feed.cycles / seconds["display"], "planes/s")]
        return replace(
            outcome,
            renderer=chain.panel_stage.renderer.name,
            kept=[*outcome.kept, *effects],
            metrics={**outcome.metrics, **seen.metrics(), **own, **filmed},
            latency=[*outcome.latency, *seen.latency()],
            throughput=[*outcome.throughput, *speeds],
            files=[*outcome.files, *files],
            notes=[*outcome.notes, *told],
            table=display_lines(seen),
            views=ScreenViews(seen, stream),
        )

    def _seen_range(self, seen: DisplayOutcome, tone: Tone) -> SeenRange | None:
        """What an eye at rest sees of the targets of a scene in its last image; None where it has
        none, or where no eye is at rest."""
        scene, images = self.feed.source, seen.images[SPIKE].get("eye")
        if not isinstance(scene, TonedSource) or images is None:
            return None
        targets = sorted(getattr(scene.bare, "targets", []), key=lambda target: -target.lux)
        if len(targets) < 2 or images.shape[1:] != scene.shape:
            return None
        luminance = images[-1].astype(np.float64) * (tone.white * tone.peak)
        dark = ~np.logical_or.reduce([target.mask for target in targets])
        truth = scene.bare.truth(0).astype(np.float64)
        light = np.array([float(truth[target.mask].mean()) for target in targets])
        shown = np.array([float(luminance[target.mask].mean()) for target in targets])
        around = float(luminance[dark].mean()) if dark.any() else 0.0
        return seen_range(tone, light, shown, around, float(luminance.mean()))

    def _probes(self, progress: Progress) -> Any:
        """Blur, flicker and delay; None without a camera to probe with."""
        if self.probe is None:
            return None
        return self.chain.probes(self.probe, progress, self.feed.pst_lm)

    def page(self, run: Run, views: ScreenViews, page: Page) -> Page:
        """The page of a source with the sections of its display first."""
        lit, panel = self.chain.references is not None, self.chain.panel
        shown = Shown(
            run, views.display, self.feed.clock, list(self.instants), views.stream, self.camera,
            # The page of a source whose images are not those of the display has an overview too.
            "overview.png" if self.feed.planned else "displays.png",
        )  # fmt: skip
        body, (*files, clip) = display_sections(shown)
        told = (
            f"{page.subtitle}; {panel.shape[1]} x {panel.shape[0]} spike-continuous panel, "
            f"{panel.drive}, {number(panel.clock.hz / 1e3)} kHz, {number(panel.luminance)} cd/m², "
            f"drawn by {run.result.renderer}"
        )
        return replace(
            page,
            subtitle=told,
            simulated=f"{page.simulated} {display_simulated(shown)}",
            cards=[*display_cards(shown), *page.cards],
            good=f"How good {'camera and display are together' if lit else 'the display is'}",
            quality=display_quality(shown),
            sections=[*body, *page.sections],
            files=list(dict.fromkeys([*files, *page.files, clip])),
        )


def _colours(kind: str | None, mosaic: Mosaic | None) -> Colours | None:
    """The colours of a panel: with "as-camera" those that the camera's pixels see, balanced to
    white, with "matrix" what the fitted matrix makes of them; None for a panel of one colour."""
    if kind is None or mosaic is None:
        return None
    if kind == "as-camera":
        return partial(balanced, mosaic)
    matrix = chart_matrix(mosaic).astype(np.float32)
    return lambda image: balanced(mosaic, image) @ matrix.T


def _range_metrics(found: SeenRange | None) -> dict[str, Metric]:
    """The range that an eye sees, and where the rest of the scene's was lost."""
    why = "the scene has no targets of known light, or no eye at rest sees them"
    names = ("scene", "seen", "lost_at_the_peak", "lost_to_the_eye", "lost_before_the_panel")
    if found is None:
        return {f"{name}_decades": Metric(None, "decades", why) for name in names}
    values = found.scene, found.seen, found.clipped, found.eye, found.camera
    return {
        **{f"{n}_decades": Metric(v, "decades") for n, v in zip(names, values, strict=True)},
        "seen_range": Metric(20 * found.seen, "dB"),
        "eye_threshold": Metric(found.threshold, "cd/m2"),
        "eye_adapted_to": Metric(found.adapted, "cd/m2"),
    }


def _chart_metrics(
    seen: DisplayOutcome, colours: Colours, chart: ColourChart
) -> dict[str, Metric]:  # fmt: skip
    """Colour differences of the patches of the chart as an eye at rest sees them on the panel."""
    image = seen.images[SPIKE].get("eye")
    found = None if image is None else chart.differences(colours(image[len(image) // 2]))
    why = "no eye at rest sees the patches, or they are too small"
    mean, most = (None, None) if found is None else (float(found.mean()), float(found.max()))
    return {
        "eye_delta_e_2000": Metric(mean, "1", why),
        "eye_delta_e_2000_max": Metric(most, "1", why),
    }


def make_screen(
    scenario: StreamScenario, instants: Sequence[int], device: Device | None, feed: Feed
) -> Screen:
    """The display of a scenario.

    Args:
        scenario: the scenario, with a [display].
        instants: cycles of the images.
        device: OpenCL device of the display and of a spike camera before it, None for the default.
        feed: what the display shows.

    Raises:
        InputError: the panel cannot show the stream, the display cannot be rendered, or no frame
            of the camera fits.
    """
    section = scenario.display
    assert section is not None
    pursuit, setting = feed.pursuit(section), feed.planned
    if setting is None:
        panel = section.panel(feed.shape, feed.clock, 0.0, feed.white_rate)
        panel = replace(panel, dark=feed.dark, residues=feed.residues)
        setting = section.setting(panel, instants, feed.cycles, pursuit.velocity)
    chain = make_display_chain(
        section, feed.shape, None if feed.scene is None else feed.scene.illuminance, feed.cycles,
        instants, setting, pursuit, [] if feed.source is None else feed.source.points(), device,
    )  # fmt: skip
    try:
        camera = _camera(scenario, chain, feed, device)
        anew = partial(make_screen, scenario, instants, device)
        return Screen(chain, camera, feed, feed.probe_camera(), instants, anew)
    except BaseException:
        chain.close()
        raise


def _camera(
    scenario: StreamScenario, display: DisplayChain, feed: Feed, device: Device | None
) -> Filmer | None:
    """The camera that films a display; None without a [camera]. Raises InputError if it does not
    fit the panel or the run."""
    section, panel, mapping = scenario.camera, display.panel, None
    if section is None:
        return None
    if panel.shape != feed.shape:
        mapping = fit_words(display.section.fit, feed.shape, panel.shape)
    if isinstance(section, SpikesSection):
        return make_spikes_filmer(section, panel, feed.cycles, scenario.seed, device, mapping)
    shutter = make_shutter(section, panel, feed.cycles, isinstance(scenario, RecordingScenario))
    return FramesFilmer(PanelCamera(section, shutter, scenario.seed, mapping))
