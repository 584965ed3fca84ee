"""The report and the picture of a comparison."""

from __future__ import annotations

import html
from pathlib import Path
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from cosim.config.amounts import amount, decibel, elapsed, percent
from cosim.config.toml import to_toml
from cosim.report.drawn import Data, save_figure, write_figure
from cosim.report.figures import INK, subplots
from cosim.report.page import write_page
from cosim.report.parts import figure, plot, table
from cosim.report.png import for_display
from cosim.report.summary import summary
from scenarios.studies.compare.row import FIGURES, Camera, Figure
from scenarios.studies.compare.setting import SceneComparison
from scenarios.studies.compare.summary import summary_of_comparison
from sensor.dynamic_range import decibels

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
