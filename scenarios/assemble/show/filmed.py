"""The frames of the camera before the panel: figures, files, and their section of the report."""

from __future__ import annotations

from pathlib import Path
from typing import Final

import numpy as np

from cosim.report.figures import INK, LINE, pyplot
from cosim.report.parts import figure, plot
from cosim.report.pictures import enlarge
from cosim.report.png import for_display, write_linear_png
from cosim.run.result import Metric
from display.camera.law import pulse_banding
from display.camera.stage import PanelCamera
from scenarios.assemble.show.shown import Shown

__all__ = ["filmed_cards", "filmed_metrics", "filmed_section", "write_frames"]

_PICTURES: Final = 8
"""Maximum number of frames that are written and drawn, evenly spaced."""


def _chosen(camera: PanelCamera) -> list[int]:
    """Numbers of the frames that are written."""
    last = len(camera.frames) - 1
    return sorted({round(n * last / (_PICTURES - 1)) for n in range(_PICTURES)})


def write_frames(folder: Path, camera: PanelCamera) -> list[str]:
    """Writes chosen frames as linear 8-bit pictures, the panel's white = 255; their names."""
    (folder / "images").mkdir(exist_ok=True)
    pictures, names = camera.pictures(), []
    for n in _chosen(camera):
        names.append(f"images/filmed-{n:05d}.png")
        write_linear_png(folder / names[-1], np.clip(pictures[n], 0, 1))
    return names


def filmed_metrics(camera: PanelCamera) -> dict[str, Metric]:
    """The metrics of the camera's frames: their number, mean contrast of the bands, flicker, and
    the contrast that white pixels in step would show; None where there is none."""
    contrasts, _ = camera.bands()
    mean = float(np.mean(contrasts)) if contrasts else None
    return {
        "camera_frames": Metric(float(len(camera.frames)), "1"),
        "camera_banding": Metric(mean, "1"),
        "camera_banding_in_step": Metric(_in_step(camera), "1"),
        "camera_flicker": Metric(camera.flicker(), "%"),
    }


def _in_step(camera: PanelCamera) -> float | None:
    """Contrast of bands if all pixels were white and fired together, in closed form; None for a
    drive that does not emit packets."""
    panel = camera.shutter.panel
    if not panel.packets:
        return None
    frequency = panel.white_rate * panel.clock.hz
    return pulse_banding(panel.white_rate * panel.share, frequency, camera.section.exposure)


def filmed_cards(shown: Shown) -> list[tuple[str, str, str]]:
    """Large figures of the camera, for `cards`."""
    metrics = shown.run.result.metrics
    banding, flicker = metrics["camera_banding"].value, metrics["camera_flicker"].value
    other = "" if flicker is None else f"; flicker from frame to frame {flicker:.2g} %"
    told = "unknown" if banding is None else f"{banding:.1%}"
    return [("", told, f"contrast of the bands that the camera sees{other}")]


def _bands_figure(camera: PanelCamera, path: Path) -> None:
    """Writes the profile of each drawn frame over its rows."""
    plt = pyplot()
    figure_, ax = plt.subplots(figsize=(8.5, 3.0))
    _, profiles = camera.bands()
    for n in _chosen(camera)[:4]:
        profile = profiles[n]
        if np.isfinite(profile).any():
            ax.plot(profile / np.nanmean(profile), linewidth=1, label=f"frame {n}")
    ax.set_xlabel("row", fontsize=9, color=INK)
    ax.set_ylabel("light over steady light", fontsize=9, color=INK)
    ax.spines[["top", "right"]].set_visible(False)
    ax.spines[["left", "bottom"]].set_color(LINE)
    ax.tick_params(color=LINE, labelcolor=INK, labelsize=8)
    if ax.get_legend_handles_labels()[0]:
        ax.legend(frameon=False, fontsize=8.5)
    figure_.tight_layout()
    figure_.savefig(path, dpi=110)
    plt.close(figure_)


def filmed_section(shown: Shown) -> str:
    """HTML of the camera's section; writes figures/bands.png."""
    camera = shown.camera
    assert camera is not None
    section, shutter = camera.section, camera.shutter
    pictures = camera.pictures()
    drawn = "".join(
        figure(enlarge(for_display(np.clip(pictures[n], 0, 1))),
               f"frame {n}, {(shutter.begin(n)) / 1e9:.4g} ms", exact=True)
        for n in _chosen(camera)[:4]
    )  # fmt: skip
    path = shown.run.folder / "figures" / "bands.png"
    _bands_figure(camera, path)
    metrics = shown.run.result.metrics
    banding, flicker = metrics["camera_banding"].value, metrics["camera_flicker"].value
    step = metrics["camera_banding_in_step"].value
    told = "no row is lit" if banding is None else f"{banding:.2%} in the mean"
    if step is not None:
        told += f"; white pixels in step would show {step:.2%}"
    flicker_told = (
        "one frame has none" if flicker is None
        else f"{flicker:.2g} % from the darkest to the brightest frame"
    )  # fmt: skip
    return (
        "<h2>What a camera with a rolling shutter sees</h2>"
        f"<p>{len(camera.frames)} frames of {shutter.shape[1]} x {shutter.shape[0]} pixels at "
        f"{section.frame_rate:g} Hz, exposure {section.exposure * 1e3:g} ms, rows within "
        f"{section.readout * 1e3:g} ms; full well {section.full_well:g} e, of which the panel's "
        f"white fills {section.white:.0%}. Pictures in <code>images/</code> are linear.</p>"
        f'<div class="grid by4">{drawn}</div>'
        f"<p>Bands: the mean of each row over the mean light of that row within a period of the "
        f"frame. Contrast (root 2 times the standard deviation over the mean; photon noise and "
        f"motion count as well): {told}. Flicker: {flicker_told}.</p>"
        + plot(path, "bands of the camera's frames")
    )
