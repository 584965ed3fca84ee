"""The page of a run without a display: images, their fidelity, run time, and the plan."""

from __future__ import annotations

import html
import shlex
from dataclasses import dataclass
from typing import Any

import numpy as np

from cosim.compute.stopping import threads
from cosim.config.amounts import count, decibel, number
from cosim.files import streams_kept
from cosim.light.mosaic import in_colour
from cosim.light.source import truth_at
from cosim.report.explorer import INSTANTS, Truths, explorer_part, span_of
from cosim.report.figures import overview_figure, sheet_figure
from cosim.report.parts import Card, figure, plot, table, video
from cosim.report.pictures import WINDOWS, accumulation, busiest_box, crop, mark_pixels
from cosim.report.png import Levels, coloured, for_display, to_linear_bytes, write_png
from cosim.run.machine import Page
from scenarios.assemble.source.latched.judged import LatchedRun
from scenarios.assemble.source.latched.pages.chip import (
    machine,
    motion_section,
    plan_files,
    simulated,
    subtitle,
    unmeasured,
)
from scenarios.assemble.source.latched.pages.plan import plan_section
from sensor import tau_levels
from sensor.codec.size import size_rows, size_text
from sensor.reconstruct.clip import write_clip
from sensor.reconstruct.fidelity import LEAST_RATE
from sensor.reconstruct.figure import interval_figure
from sensor.reconstruct.shots import Shot

_WHERE = {"exact": "on any device", "fast": "on any OpenCL device"}
_QUALITY = (
    "Higher is better. TFP and TFI are two ways to make an image of spikes; the true light is "
    "known because the scene is simulated."
)
_CLIP_FRAMES = 75
_LONG = 800
"""Length of a long exposure, cycles, as in figures 3 and 4 of Huang 2022."""


def _cards(run: LatchedRun) -> list[Card]:
    metrics = run.result.metrics

    def fidelity(method: str) -> Card:
        structure = number(metrics[f"{method}_ssim"].value)
        value = decibel(metrics[f"{method}_psnr"].value)
        return "first", value, f"PSNR of {method.upper()} against the true light; SSIM {structure}"

    rate = number(metrics["spike_rate"].value)
    return [fidelity("tfp"), fidelity("tfi"), ("", rate, "spikes per pixel and cycle, mean")]


def _instants(run: LatchedRun) -> str:
    window, ms = run.scenario.image.window, 1e3 / run.stream.clock.hz
    parts = [
        "<h2>Images at chosen instants</h2>",
        f"<p>True light at the instant, TFP (mean of {window} cycles) and TFI (1/ISI of the "
        "interval that contains the instant). White is the white of the scene; the images have "
        "the sRGB curve. Linear images are in <code>images/</code>.</p>",
    ]
    for shot in run.shots:
        when = number((shot.cycle + 0.5) * ms, 4)
        parts.append(f"<h3>cycle {count(shot.cycle)}, {when} ms</h3>")
        triple = (("true light", shot.truth), ("TFP", shot.tfp), ("TFI", shot.tfi))
        pictures = "".join(figure(for_display(plane), name) for name, plane in triple)
        if run.mosaic is not None:
            for name, plane in triple:
                picture = coloured(in_colour(run.mosaic, plane))
                pictures += figure(picture, f"{name}, in colour")
        parts.append(f'<div class="grid by3">{pictures}</div>')
    return "".join(parts)


def _accumulation(run: LatchedRun) -> str:
    fitting = [w for w in WINDOWS if w <= run.stream.cycles]
    ms = 1e3 / run.stream.clock.hz
    pictures = "".join(
        figure(
            accumulation(run.stream, w, run.white_rate),
            f"{w} cycle{'s' * (w > 1)}, {number(w * ms, 4)} ms",
            exact=w < 10,
        )
        for w in fitting
    )
    return (
        "<h2>Accumulation</h2><p>Sums of the first cycles of the stream over growing windows: "
        "single spikes become an image, and moving objects blur (after figure 3 of Huang 2022).</p>"
        f'<div class="grid by3">{pictures}</div>'
    )


@dataclass(frozen=True, eq=False)
class _Long:
    """A long exposure.

    Attributes:
        first: first cycle.
        cycles: number of cycles.
        image: accumulated image, (H, W) uint8.
    """

    first: int
    cycles: int
    image: Any

    @property
    def name(self) -> str:
        last = self.first + self.cycles - 1
        return f"cycles {count(self.first)} to {count(last)} accumulated"


def _expose_long(run: LatchedRun, shot: Shot) -> _Long:
    """A long exposure centred at the instant, within the run."""
    cycles = min(_LONG, run.stream.cycles)
    first = min(max(shot.cycle - cycles // 2, 0), run.stream.cycles - cycles)
    return _Long(first, cycles, accumulation(run.stream, cycles, run.white_rate, first))


def _long_and_instant(shot: Shot, long: _Long) -> str:
    tau = tau_levels(shot.tau)
    low, high = (int(x) for x in np.percentile(tau, (1, 99)))
    spread = (tau - np.float32(low)) / np.float32(max(high - low, 1))
    pictures = (
        figure(long.image, long.name)
        + figure(tau, f"255 − τ at cycle {shot.cycle}, as in the paper")
        + figure(to_linear_bytes(spread), f"the same, {low} to {high} mapped to black to white")
    )
    return (
        "<h2>Long exposure and one instant</h2><p>The same stream accumulated as in a conventional "
        "exposure, and one instant by interval length, 255 − τ (after figure 4 of Huang 2022).</p>"
        f'<div class="grid by3">{pictures}</div>'
    )


def _moving_part(run: LatchedRun, shot: Shot, long: _Long) -> str:
    title = "<h2>The moving part</h2>"
    truths = np.stack([each.truth for each in run.shots])
    change = truths.max(axis=0) - truths.min(axis=0)
    if float(change.max()) < 0.02:
        return f"{title}<p>The images of this run show no motion.</p>"
    box = busiest_box(change, max(64, min(run.stream.shape) // 4))

    def part(plane: Levels) -> Any:
        return crop(for_display(plane), box)

    pictures = "".join(
        (
            figure(part(shot.truth), f"true light, cycle {count(shot.cycle)}", exact=True),
            figure(part(shot.tfp), "TFP", exact=True),
            figure(part(shot.tfi), "TFI", exact=True),
            figure(crop(long.image, box), long.name, exact=True),
        )
    )
    return (
        f"{title}<p>Rows {box[0]} to {box[1] - 1}, columns {box[2]} to {box[3] - 1}: the square in "
        "which the true light changes most between the images.</p>"
        f'<div class="grid by4">{pictures}</div>'
    )


def _playback(run: LatchedRun) -> str:
    every = max(1, run.stream.cycles // _CLIP_FRAMES)
    path = run.folder / "playback.mp4"
    write_clip(
        run.stream, path, window=run.scenario.image.window, every=every,
        scale=max(run.white_rate, LEAST_RATE), rate=25.0, largest=640, smallest=2,
        crf=27,
    )  # fmt: skip
    slower = 25.0 * every / run.stream.clock.hz
    return (
        f"<h2>Playback</h2><p>TFP every {f'{every} cycles' if every > 1 else 'cycle'}, "
        f"{count(1 / slower)} times slower than real time (<code>playback.mp4</code>).</p>"
        + video(path, "the run in slow motion, TFP", 720)
    )


def _intervals(run: LatchedRun, shot: Shot, long: _Long) -> str:
    points = run.source.points()
    clock, knots = run.stream.clock, 120
    # More cycles than the figure has dots would cause aliasing.
    span = (long.first, long.first + long.cycles)
    start, stop = clock.edge(span[0]), clock.edge(span[1]) - 1
    truth = np.empty((len(points), knots))
    for k in range(knots):
        truth[:, k] = truth_at(run.source, start + (stop - start) * k // (knots - 1), points)
        if (registers := run.setting.registers) is not None:
            cycle = clock.cycle_at(start + (stop - start) * k // (knots - 1))
            share = registers.shares(cycle, cycle + 1)
            truth[:, k] *= [float(share[row, 0]) for row, _, _ in points]
    truth *= run.white_rate
    figures = run.folder / "figures"
    instants = [s.cycle for s in run.shots]
    drawn = interval_figure(
        run.stream, points, truth, span, instants, figures / "intervals.png"
    )  # fmt: skip
    marks = mark_pixels(for_display(shot.tfp), points)
    write_png(figures / "pixels.png", marks)
    marked = figure(marks, f"the pixels, on TFP at cycle {shot.cycle}")
    return (
        "<h2>Intervals of single pixels</h2><p>Each bar is one interval: its width is its "
        "duration, its height the estimated light, its area one threshold (after figure 5 of "
        "Huang 2022).</p>"
        + plot(
            figures / "intervals.png",
            "light of single pixels over time: 1/ISI (bars) and true light (line)",
            drawn,
        )
        + f'<div class="grid by2">{marked}</div>'
    )


def _size(run: LatchedRun) -> str:
    if run.sizes is None:
        return ""
    head = ["form", "bits per pixel and cycle", "compression ratio against raw"]
    rows = table(head, size_rows(run.sizes))
    return f"<h2>Size of the stream</h2><p>{html.escape(size_text(run.sizes))}</p>{rows}"


def _overview(run: LatchedRun, shot: Shot, long: _Long) -> None:
    """Writes figures/overview.png: the true light, both estimates and a long exposure."""
    ms = 1e3 / run.stream.clock.hz
    panels = [
        (f"true light at {number((shot.cycle + 0.5) * ms, 4)} ms", for_display(shot.truth)),
        (f"TFP, {run.scenario.image.window} cycles", for_display(shot.tfp)),
        ("TFI, one interval", for_display(shot.tfi)),
        (f"accumulated over {number(long.cycles * ms)} ms", long.image),
    ]
    overview_figure(panels, run.folder / "figures" / "overview.png")


def _sheet(run: LatchedRun) -> None:
    """Writes figures/instants.png: the true light and both estimates at up to eight instants (after
    figure 6 of Huang 2022)."""
    step = -(-len(run.shots) // 8)
    shots, ms = run.shots[::step], 1e3 / run.stream.clock.hz
    rows = [
        (name, [for_display(getattr(shot, kind)) for shot in shots])
        for name, kind in (("true light", "truth"), ("TFP", "tfp"), ("TFI", "tfi"))
    ]
    heads = [f"{number((shot.cycle + 0.5) * ms, 4)} ms" for shot in shots]
    sheet_figure(heads, rows, run.folder / "figures" / "instants.png")


def _explorer(run: LatchedRun) -> str:
    """The explorer, with the true light at instants throughout its cycles."""
    at = run.shots[len(run.shots) // 2].cycle
    first, stop = span_of(run.stream.cycles, at)
    cycles = np.unique(np.linspace(first, stop - 1, INSTANTS).round().astype(int)).tolist()
    truths = None
    if run.mosaic is None:
        planes = [run.source.truth(run.stream.clock.middle(cycle)) for cycle in cycles]
        truths = Truths(cycles, planes)
    part = explorer_part(run.stream, at, run.white_rate, run.scenario.image.window, truths)
    return f"<h2>Explore the stream</h2>{part}"


def stream_page(run: LatchedRun) -> Page:
    """The page of a run without a display; writes its figures and playback.mp4."""
    middle = run.shots[len(run.shots) // 2]
    long = _expose_long(run, middle)
    with threads(1) as beside:  # the clip takes as long as the figures
        clip = beside.submit(_playback, run)
        _overview(run, middle, long)
        _sheet(run)
        rest = [
            _explorer(run),
            _instants(run),
            _moving_part(run, middle, long),
            _accumulation(run),
            _long_and_instant(middle, long),
            _intervals(run, middle, long),
            _size(run),
            motion_section(run.source),
            plan_section(run),
            machine(run),
        ]
        pictures = [clip.result(), *rest]
    shot = run.shots[len(run.shots) // 2]
    placing = " --preceding" if run.scenario.image.preceding else ""
    image = (
        f"viform image {shlex.quote(str(run.folder))} --at {shot.cycle} --method tfp "
        f"--window {run.scenario.image.window}{placing} --scale {shot.white!r} --out a.png"
    )
    where = _WHERE[run.plan.tier] if run.scenario.sensor.source is None else "from the same board"
    files = [
        "figures/overview.png",
        "figures/instants.png",
        "figures/intervals.png",
        "figures/pixels.png",
        *plan_files(run),
        "playback.mp4",
    ]
    does = (
        "<p>The first line reproduces one of the linear images from the stream, the second the "
        f"whole run, with the same bits {where}.</p>"
    )
    lines = [image]
    if not streams_kept():
        does, lines = f"<p>This line reproduces the whole run, with the same bits {where}.</p>", []
    return Page(
        run.scenario.title, subtitle(run), simulated(run), _cards(run), pictures, quality=_QUALITY,
        commands=lines, commands_do=does, files=files, unmeasured=unmeasured(run),
    )  # fmt: skip
