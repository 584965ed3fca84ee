"""The report of a comparison, the summary on its page, and its picture."""

from __future__ import annotations

import html
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from cosim.config.amounts import amount, count, decibel, elapsed, number, percent
from cosim.config.toml import to_toml
from cosim.report.drawn import Data, save_figure, write_figure
from cosim.report.figures import INK, subplots
from cosim.report.page import write_page
from cosim.report.parts import Card, cards, figure, plot, table
from cosim.report.png import for_display
from cosim.report.summary import Answer, big, listed, paragraph, summary
from scenarios.studies.compare.measure import FIGURES, Camera, Figure
from scenarios.studies.compare.setting import SceneComparison
from sensor.dynamic_range import decibels

_BEST: Final[tuple[tuple[str, str, bool, Callable[[float], str]], ...]] = (
    ("psnr", "highest PSNR", True, decibel),
    ("blur", "sharpest edge", False, lambda v: amount(v, "pixels")),
    ("noise", "least noise at mid-grey", False, lambda v: percent(v, 2)),
    ("dynamic_range_controls", "widest dynamic range with all controls", True,
     lambda v: amount(v, "dB")),
)  # fmt: skip
"""Figure, what its best value is, whether that is the highest, and its text."""
PICTURE: Final = "side-by-side.png"
SNR: Final = "snr.png"
HEADS: Final = {
    "dynamic_range": "dynamic range, one image", "dynamic_range_controls": "with all controls",
    "blur": "edge 10-90 %", "noise": "noise at mid-grey", "data_rate": "data rate",
    "data_rate_pixel": "per pixel", "latency": "latency", "psnr": "PSNR",
    "psnr_smear_corrected": "PSNR, smear corrected",
    "skew": "first to last row", "exposure": "exposure", "saturated": "saturated",
    "off": "offset from the instant",
}  # fmt: skip
_EXPLAINED: Final = (
    "<p><b>Dynamic range</b>: light at saturation over the light whose signal equals the noise in "
    "the dark, 20 lg; of one image at its setting, and over all settings of exposure, gain and "
    "high voltage (for the spike camera: intervals up to the one that dark current fills). "
    "<b>Edge</b>: 10 to 90 % width of an edge at the mean speed: 0.8 of its path during the span "
    "of the scene whose mean fits the image best by least squares, with the instant of each row; "
    "without motion, the width of the Gaussian blur of the true scene that fits the image best. "
    "<b>Noise</b>: standard deviation between images where nothing moves, over the signal, at a "
    "reflectance of 0.3 to 0.7. <b>Data rate</b>: output of the imager, for all its pixels. "
    "<b>Latency</b>: from the middle of a pixel's exposure until the image has been read. "
    "<b>PSNR</b>: of the estimate of reflectance against the scene at the instant; for the EMCCD "
    "also after the standard correction of frame-transfer smear: the contribution of every other "
    "row of a column, its signal times row shift time over exposure, is subtracted. A dash: not "
    "measurable in this scene.</p>"
)


def summary_of_comparison(
    cameras: list[Camera], document: dict[str, Any], seconds: float
) -> list[Answer]:
    """The answers for a newcomer.

    Args:
        cameras: what was measured.
        document: document of the comparison so far.
        seconds: time that the comparison took, s.
    """
    kinds = len({camera.seconds for camera in cameras if camera.seconds})
    done = (
        f"{amount(document['duration_s'], 's')} of the scene {document['scene']} were recorded by "
        f"{kinds} simulated cameras, each with the same light on a pixel. {len(cameras)} images of "
        f"one instant, at {number(document['instant_ms'], 4)} ms, are compared; the spike camera "
        "has two, by the two usual ways to compute an image from spikes: TFI and TFP."
    )
    return [
        ("What was compared", paragraph(done)),
        ("How good the cameras are", cards(_best(cameras)) + paragraph(
            "The best value of each figure, and whose it is. No camera is best in all: what is "
            "sharp in motion is noisy, and what is quiet blurs. All figures are in the table."
        )),
        ("How wrong the comparison may be", _wrong(cameras)),
        ("How long it took", big(elapsed(seconds), _slowest(cameras))),
        ("What was left out", paragraph(_left_out(cameras))),
        ("Notes", listed(document["notes"])),
    ]  # fmt: skip


def _best(cameras: list[Camera]) -> list[Card]:
    rows: list[Card] = []
    for name, what, highest, text in _BEST:
        known = [
            (value, camera.title) for camera in cameras
            if (value := camera.figures[name].value) is not None and math.isfinite(value)
        ]  # fmt: skip
        if known:
            value, title = (max if highest else min)(known)
            rows.append(("first", text(value), f"{what}: {title}"))
    return rows


def _wrong(cameras: list[Camera]) -> str:
    off = [
        abs(decibels(point.measured) - decibels(point.formula))
        for camera in cameras for point in camera.snr
        if point.formula and point.measured > 0
    ]  # fmt: skip
    text = (
        "Each camera was simulated with every effect, so nothing is missing by choice. Each image "
        "is a single one: with another seed, noise and PSNR differ a little."
    )
    if not off:
        return paragraph(text)
    off.sort()
    return big(
        f"{number(off[len(off) // 2], 2)} dB",
        f"Half of {count(len(off))} measured values of signal over noise are nearer than this to "
        f"the closed form of the pixels; the farthest is off by {number(off[-1], 2)} dB. {text}",
    )


def _slowest(cameras: list[Camera]) -> str:
    slowest = max(cameras, key=lambda camera: camera.seconds)
    return (
        f"Of this, {elapsed(slowest.seconds)} for the slowest camera ({slowest.title}), images and "
        "measurements included."
    )


def _left_out(cameras: list[Camera]) -> str:
    missing = sum(camera.figures[name].value is None for camera in cameras for name in FIGURES)
    text = "No effect of any camera. Pixels of an imager beyond the scene were not simulated."
    if missing:
        text += (
            f" {count(missing)} of {count(len(cameras) * len(FIGURES))} figures cannot be measured "
            "in this scene, or do not exist for the camera: a dash stands for each."
        )
    return text


def figure_text(name: str, figure: Figure) -> str:
    """Text of a figure."""
    value = figure.value
    if value is None:
        return "-"
    if figure.unit.startswith("bit/s"):
        return amount(value, "bit/s") + figure.unit.removeprefix("bit/s")
    if name in ("noise", "saturated"):
        return percent(value, 2)
    if figure.unit == "dB":
        return amount(value, "dB") if name.startswith("dynamic") else decibel(value)
    return amount(value, figure.unit)


def _panels(
    cameras: list[Camera], truth: npt.NDArray[np.float64]
) -> list[tuple[str, str, npt.NDArray[np.uint8]]]:
    """Title, setting and grey image of the truth, (H, W) reflectance, and of every camera."""
    panels = [("truth", "", truth)]
    panels += [(c.title, c.setting, c.image) for c in cameras]
    panels += [
        (c.title, "frame-transfer smear corrected column by column", c.corrected)
        for c in cameras if c.corrected is not None
    ]  # fmt: skip
    return [(title, text, for_display(np.clip(image, 0, 1))) for title, text, image in panels]


def write_picture(path: Path, cameras: list[Camera], truth: npt.NDArray[np.float64]) -> None:
    """Draws the image of every camera at the instant, and the true reflectance, (H, W)."""
    height, width = truth.shape
    panels = _panels(cameras, truth)
    columns = 3
    rows = -(-len(panels) // columns)
    drawing, axes = subplots(
        rows, columns, figsize=(4.4 * columns, (4.4 * height / width + 0.62) * rows), squeeze=False
    )
    for ax in axes.flat:
        ax.axis("off")
    for (title, setting, grey), ax in zip(panels, axes.flat, strict=False):
        ax.imshow(grey, cmap="gray", vmin=0, vmax=255, interpolation="nearest")
        ax.set_title(f"{title}\n", fontsize=11, color=INK)
        ax.text(0.5, 1.02, setting, transform=ax.transAxes, ha="center", fontsize=7.5, color=INK)
    drawing.tight_layout(pad=0.4, w_pad=0.6)
    write_figure(drawing, path)


def write_snr(path: Path, cameras: list[Camera]) -> Data:
    """Draws signal over noise against reflectance: measured, and lines of the closed forms.
    Returns what was drawn."""
    drawing, ax = subplots(figsize=(8.8, 4.6), layout="constrained")
    for camera in (camera for camera in cameras if camera.snr):
        at = [point.reflectance for point in camera.snr]
        (drawn,) = ax.plot(
            at, [decibels(point.measured) for point in camera.snr], "o", markersize=4,
            label=camera.title,
        )  # fmt: skip
        lines = [(p.reflectance, decibels(p.formula)) for p in camera.snr if p.formula]
        ax.plot(
            *zip(*lines, strict=True),
            color=drawn.get_color(),
            linewidth=0.9,
            label=f"_{camera.title}, closed form",
        ) if lines else None
    ax.set_xscale("log")
    ax.set_xlabel("reflectance", fontsize=9, color=INK)
    ax.set_ylabel("signal over noise, dB", fontsize=9, color=INK)
    ax.legend(fontsize=7.5, frameon=False, ncols=2)
    return save_figure(drawing, path)


def write_compare_report(
    folder: Path, comparison: SceneComparison, document: dict[str, Any], cameras: list[Camera],
    truth: npt.NDArray[np.float64], snr: Data,
) -> None:  # fmt: skip
    """Writes report.html into the folder. truth: as of `write_picture`; snr: what `write_snr` has
    drawn."""
    head = ["figure", *(c.title for c in cameras)]
    rows = [[HEADS[n], *(figure_text(n, c.figures[n]) for c in cameras)] for n in FIGURES]
    settings = table(
        ["camera", "setting", "note", "run time"],
        [[c.title, c.setting, c.note, elapsed(c.seconds) if c.seconds else ""] for c in cameras],
    )
    title = f"{comparison.name}: the same instant by every camera"
    subtitle = f"{len(cameras)} images, seed {document['seed']}, viform {document['version']}"
    images = "".join(
        figure(grey, f"{title}: {text}" if text else title, exact=True)
        for title, text, grey in _panels(cameras, truth)
    )
    answers = summary_of_comparison(cameras, document, document["run_time_s"])
    write_page(folder, title, summary(title, subtitle, answers), "".join([
        "<h2>The images</h2>", f'<div class="grid by3">{images}</div>',
        "<h2>The figures</h2>", table(head, rows), _EXPLAINED,
        "<h2>Signal over noise against light</h2><p>Dots: measured where nothing moves. Lines: the "
        "closed form of the pixels at the setting of power-on, without the noise of a subtracted "
        "dark frame. The signal of the EMCCD is without the smear of frame transfer, whose shot "
        "noise remains.</p>", plot(folder / SNR, "signal over noise against reflectance", snr),
        "<h2>Cameras</h2>", settings,
        "<h2>The spike camera's scenario</h2>"
        f"<pre>{html.escape(to_toml(comparison.spike))}</pre>",
    ]))  # fmt: skip
