"""The page of an imager's run: its frames, its metrics, and the effects kept and left out; and the
explorer of its frames, with exposure, controllers and registers of each.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from cosim.config.amounts import UNKNOWN, amount, count, number, percent
from cosim.report.frames import FrameColumn, frames_part
from cosim.report.parts import Card, figure, table
from cosim.report.png import for_display
from cosim.run.machine import Page, Run
from cosim.run.result import Metric
from imagers.common.kind import ImagerKind
from imagers.common.model import FrameFigures
from imagers.run.chain import FrameChain
from imagers.run.plan import PlannedRun
from imagers.run.tape import FRAMES, read_frame

_TEXTS = {
    "exposure": "of the first row", "ready": "end of the last row's readout",
    "mean": "of all pixels",
    "spread": "standard deviation of all pixels", "full_scale": "share of pixels at full scale",
}  # fmt: skip
_MAIN = {
    "frame_rate": "frame rate", "exposure": "exposure of the last frame",
    "dynamic_range": "dynamic range of one frame", "dark_noise": "noise in the dark",
    "effective_read_noise": "read noise over the gain", "contrast_to_noise": "contrast to noise",
    "settled_share": "", "saturated": "",
}  # fmt: skip
"""Metrics that the summary shows where a run has them, and what they are."""
_SHARES = {
    "saturated": "of the pixels of the last frame have the largest value",
    "saturated_most": "of the pixels, in the frame with the largest share",
    "gain_lost_by_phase": "of the gain, because the high-voltage crest is early or late",
    "gain_ripple": "of the gain, amplitude, from the ripple of the high voltage",
    "gain_of_a_code": "of the gain, from one code of the potentiometer to the next",
    "settled_share": "of the live frames have a settled exposure loop",
}
_ANSWERS = {"settled": "whether the exposure loop is settled in the last live frame"}
_COUNTS = {
    "frames": "frames", "dark_frames": "frames", "pulses_lost": "pulses of external sync",
    "potentiometer_words": "words over SPI", "ageing_codes": "codes that ageing has cost the gain",
    "resets_disturbed": "resets within another row's sampling", "saturated_pixels": "pixels of the "
    "last frame's window over full scale, by the comparator",
}  # fmt: skip


@dataclass(frozen=True, eq=False)
class ImagerRun:
    """A finished run.

    Attributes:
        run: the run as in the report of every machine.
        chain: the chain that has filmed, with the check of its plan.
        pictures: numbers of the frames in images/, in order.
    """

    run: Run
    chain: FrameChain
    pictures: list[int]

    @property
    def folder(self) -> Path:
        return self.run.folder

    @property
    def planned(self) -> PlannedRun:
        return self.chain.planned

    @property
    def frames(self) -> list[FrameFigures]:
        return self.chain.frames

    @property
    def imager(self) -> Any:
        """The imager in its state after the run."""
        return self.chain.imager

    @property
    def reinstated(self) -> set[str]:
        """Effects that the check has reinstated."""
        return {finding.effect for finding in self.run.reinstated}

    def frame(self, n: int) -> npt.NDArray[np.uint16]:
        """Values of the n-th frame, (rows, W), DN."""
        return read_frame(self.folder / FRAMES, n)


def frames_explorer(kind: ImagerKind, run: ImagerRun) -> str:
    """The HTML of the explorer."""
    frames, registers = run.frames, run.chain.registers
    columns = [
        FrameColumn("Frame", "begin", "ms", [one.begin * 1e-9 for one in frames]),
        FrameColumn("Frame", "exposure", "ms", [one.seconds * 1e3 for one in frames]),
        FrameColumn("Frame", "ready", "ms", [one.ready * 1e-9 for one in frames]),
        FrameColumn("Frame", "mean", "DN", [one.mean for one in frames]),
        FrameColumn("Frame", "spread", "DN", [one.spread for one in frames]),
        FrameColumn("Frame", "least", "DN", [one.least for one in frames]),
        FrameColumn("Frame", "most", "DN", [one.most for one in frames]),
        FrameColumn("Frame", "full_scale", "", [one.full for one in frames]),
    ]
    for name in sorted({name for one in frames for name in one.state}):
        values = [one.state.get(name) for one in frames]
        columns.append(FrameColumn("Controller", name, "", values))
    specific = kind.design().specific if registers else ()
    texts = {"begin": "of the first row's exposure", **_TEXTS}
    for entry in specific:
        held = registers.get(entry.name)
        if held is None:
            continue
        texts[entry.name] = entry.text
        if not entry.fields:
            columns.append(FrameColumn("Registers", entry.name, "", held))
        for part in entry.fields:
            name, mask = f"{entry.name}.{part.name}", (1 << (part.high - part.low + 1)) - 1
            columns.append(
                FrameColumn("Registers", name, "", [value >> part.low & mask for value in held])
            )
            texts[name] = part.text
    explorer = frames_part(
        [one.shape for one in frames], run.frame, (1 << run.planned.pixels.bits) - 1,
        [one.number for one in frames], [one.ready * 1e-9 for one in frames], columns, texts,
    )  # fmt: skip
    about = ", and what a host reads in each register once the frame is ready" if registers else ""
    return (
        f"<h3>Frame by frame</h3><p>Each frame with its exposure, the state of its controllers"
        f"{about}. What differs from the frame before is marked. Pictures show the values as they "
        f"are.</p>{explorer}"
    )


def _simulated(kind: ImagerKind, run: ImagerRun) -> str:
    """What was simulated, for a newcomer."""
    rows, columns = run.planned.model.shape
    return (
        f"A conventional camera with {columns} x {rows} pixels takes frames of the scene "
        f"“{run.planned.spec.title}” for {amount(run.run.result.simulated_s, 's', 4)}: "
        f"{kind.title}. Its digital side was simulated clock by clock, its pixels with the noise "
        "of the light and of the circuit."
        + (f" Its source, to whose figures this page refers: {kind.document[1]}."
           if kind.document is not None else "")
    )  # fmt: skip


def _cards(run: ImagerRun) -> list[Card]:
    rows: list[Card] = [("first", count(len(run.frames)), "frames")]
    for name, text in _MAIN.items():
        metric = run.run.result.metrics.get(name)
        if metric is not None and metric.value is not None:
            value, of = metric_text(name, metric)
            rows.append(("", value, text or of))
    return rows


def metric_text(name: str, metric: Metric) -> tuple[str, str]:
    """Text of a metric with its unit, and what it is a share or a count of: a share is in per cent,
    an answer yes or no, a count whole."""
    value = metric.value
    if value is None:
        return UNKNOWN, _COUNTS.get(name, "")
    if name in _SHARES:
        return percent(value), _SHARES[name]
    if name in _ANSWERS:
        return "yes" if value else "no", _ANSWERS[name]
    if name in _COUNTS:
        return count(value), _COUNTS[name]
    return amount(value, metric.unit, 4), ""


def _metrics(run: ImagerRun) -> str:
    rows = [
        [name.replace("_", " "), *metric_text(name, m)]
        for name, m in run.run.result.metrics.items()
    ]
    page = "<h2>Figures of the run</h2>" + table(["what", "value", "of what"], rows)
    delays = [
        [row.stage, *(amount(us * 1e-6, "s", 4) for us in (row.min_us, row.median_us, row.max_us))]
        for row in run.run.result.latency
    ]
    if delays:
        page += "<h2>Delays in the machine</h2>"
        page += table(["from what to what", "least", "median", "most"], delays)
    return page


def _frames(run: ImagerRun) -> str:
    """Chosen frames, with full scale as white, in sRGB."""
    full = (1 << run.planned.pixels.bits) - 1
    figures = []
    for n in run.pictures:
        frame = run.frames[n]
        caption = (
            f"frame {frame.number}, read at {number(frame.ready * 1e-9, 4)} ms, exposed for "
            f"{amount(frame.seconds, 's', 4)}, mean {number(frame.mean, 4)} DN"
        )
        figures.append(figure(for_display(run.frame(n) / full), caption))
    return (
        "<h2>Frames</h2><p>These frames are evenly spaced over the run. They are shown in sRGB, "
        "with full scale as white. All frames, (n, rows, columns) uint16, are in "
        f"<code>zarr.open('{FRAMES}', mode='r')['values']</code>. 8-bit pictures of these frames, "
        "linear unless the imager maps tones, are in <code>images/</code>.</p>"
        f'<div class="grid by4">{"".join(figures)}</div>'
    )


def _kept(run: ImagerRun) -> str:
    plan, summary, patches = run.planned.plan, run.planned.summary, run.chain.patches
    sources = {name: effect.source for name, effect in run.planned.pixels.effects.items()}
    out = set(plan.left_out)
    rows = []
    for row in plan.rows:
        state = "reinstated" if row.effect in run.reinstated else "kept"
        check = ""
        if row.effect in out:
            state, measured = "left out", patches.measured(row.effect)
            check = "not measured" if measured is None else f"at most {number(measured.high, 2)}"
        about = "about" if row.kind == "estimate" else "at most"
        cost = f"{number(row.cost_ns)} ns"
        rows.append(
            [row.effect, state, f"{about} {number(row.bound, 2)}", cost, check, sources[row.effect]]
        )
    head = ["effect", "", "change if left out", "cost per pixel and frame", "measured", "source"]
    exposures, decisions = run.planned.exposures, run.chain.decisions
    text = ""
    if out and decisions is not None:
        text = (
            f"<p>Decisions: {decisions.text()}. For each frame, the check determines how far the "
            "omitted effects can move the statistic of the controller. If this reaches a decision "
            "threshold, the frame is converted with every effect and the decision is repeated.</p>"
        )
    return (
        "<h2>What was kept and what was left out</h2><p>A change is the larger of two: that of the "
        "mean of a pixel value, relative to the mean (at least one DN), and that of its noise, "
        "relative to the noise (at least that of rounding). It is the largest one over all light "
        "and exposures foreseen: "
        f"{number(exposures.seconds[0] * 1e3)} to {number(exposures.seconds[1] * 1e3)} ms, "
        f"{number(summary.darkest)} to {number(summary.brightest)} photoelectrons. Estimates are "
        f"doubled. The check converts {patches.count} patches of the exposures of this run "
        "repeatedly, with and without the effect and with the same random numbers; the table gives "
        "the upper limit at 99.9 %. The bounds of a plan add up to at most "
        f"{number(0.5 * run.run.result.tolerance)}.</p>" + text + table(head, rows)
    )


def imager_page(kind: ImagerKind, run: ImagerRun) -> Page:
    """Writes the figures and returns the page."""
    folder = run.folder / "figures"
    for old in folder.glob("*.png"):
        old.unlink()
    spec, (rows, columns) = run.planned.spec, run.planned.model.shape
    specific, frames = "", ""
    if run.frames:
        specific, frames = kind.sections(run.planned.model, run), _frames(run)
        frames += frames_explorer(kind, run)
    return Page(
        title=spec.title,
        subtitle=f"{kind.title}, {columns} x {rows} pixels",
        simulated=_simulated(kind, run),
        cards=_cards(run),
        quality="A wider dynamic range and less noise are better. What a frame needs beyond these "
        "figures is told in the sections.",
        sections=[specific, frames, _metrics(run), _kept(run)],
        commands_do="<p>The bits are the same however often the run is interrupted.</p>",
        files=sorted(f"figures/{path.name}" for path in folder.glob("*.png")),
    )
