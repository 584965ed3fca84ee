"""A camera with a rolling shutter before the panel: its files, and its section of the report."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final

import numpy as np

from cosim.config.amounts import amount, number, percent
from cosim.report.drawn import Data, save_figure
from cosim.report.figures import INK, LINE, subplots
from cosim.report.parts import Card, figure, plot
from cosim.report.png import for_display, pictures_wanted, write_linear_png
from cosim.run.result import Metric
from display.camera.stage import PanelCamera, pulse_banding
from display.report.shown import Shown

_PICTURES: Final = 8
"""Maximum number of frames that are written and drawn, evenly spaced."""
_DRAWN: Final = 4
"""Maximum number of frames in the report."""


class FramesFilmer:
    """A camera with a rolling shutter; implements `Filmer`.

    Attributes:
        camera: the stage.
    """

    figures: list[str] = ["figures/bands.png"]  # noqa: RUF012  # never changed

    def __init__(self, camera: PanelCamera) -> None:
        self.camera = camera

    def stages(self, folder: Path) -> dict[str, Any]:
        return {"film": self.camera}

    def _chosen(self) -> list[int]:
        """Numbers of the frames that are written."""
        last = len(self.camera.frames) - 1
        return sorted({round(n * last / (_PICTURES - 1)) for n in range(_PICTURES)})

    def write(self, folder: Path, at: list[int]) -> list[str]:
        """Writes chosen frames, evenly spaced; the instants are not used."""
        names: list[str] = []
        if not pictures_wanted():
            return names
        (folder / "images").mkdir(exist_ok=True)
        pictures = self.camera.pictures()
        for n in self._chosen():
            names.append(f"images/filmed-{n:05d}.png")
            write_linear_png(folder / names[-1], np.clip(pictures[n], 0, 1))
        return names

    def metrics(self) -> dict[str, Metric]:
        """Number of frames, mean contrast of the bands, flicker, and the contrast that white pixels
        in step would show; None where there is none."""
        contrasts, _ = self.camera.bands()
        mean = float(np.mean(contrasts)) if contrasts else None
        return {
            "camera_frames": Metric(float(len(self.camera.frames)), "1"),
            "camera_banding": Metric(mean, "1", "no frame has bands"),
            "camera_banding_in_step": Metric(
                self._in_step(), "1", "the display is not one whose pixels fire in step"
            ),
            "camera_flicker": Metric(self.camera.flicker(), "%", "one frame has no flicker"),
        }

    def _in_step(self) -> float | None:
        """Contrast of bands if all pixels were white and fired together, in closed form; None for a
        drive that does not emit packets."""
        panel = self.camera.shutter.panel
        if not panel.packets:
            return None
        frequency = panel.white_rate * panel.clock.hz
        duty = panel.white_rate * panel.share
        return pulse_banding(duty, frequency, self.camera.section.exposure)

    def cards(self) -> list[Card]:
        metrics = self.metrics()
        banding, flicker = metrics["camera_banding"].value, metrics["camera_flicker"].value
        other = ""
        if flicker is not None:
            other = f"; flicker from frame to frame {amount(flicker, '%', 2)}"
        return [("", percent(banding), f"contrast of the bands that the camera sees{other}")]

    def _draw_bands(self, path: Path) -> Data:
        """Writes the profile of each drawn frame over its rows."""
        drawing, ax = subplots(figsize=(8.5, 3.0))
        _, profiles = self.camera.bands()
        for n in self._chosen()[:_DRAWN]:
            profile = profiles[n]
            if np.nansum(profile) > 0:
                ax.plot(profile / np.nanmean(profile), linewidth=1, label=f"frame {n}")
        ax.set_xlabel("row", fontsize=9, color=INK)
        ax.set_ylabel("light over steady light", fontsize=9, color=INK)
        ax.spines[["top", "right"]].set_visible(False)
        ax.spines[["left", "bottom"]].set_color(LINE)
        ax.tick_params(color=LINE, labelcolor=INK, labelsize=8)
        if ax.get_legend_handles_labels()[0]:
            ax.legend(frameon=False, fontsize=8.5)
        drawing.tight_layout()
        return save_figure(drawing, path)

    def section(self, shown: Shown) -> str:
        section, shutter = self.camera.section, self.camera.shutter
        pictures, metrics = self.camera.pictures(), self.metrics()
        drawn = "".join(
            figure(for_display(np.clip(pictures[n], 0, 1)),
                   f"frame {n}, {number(shutter.begin(n) / 1e9, 4)} ms", exact=True)
            for n in self._chosen()[:_DRAWN]
        )  # fmt: skip
        path = shown.run.folder / self.figures[0]
        data = self._draw_bands(path)
        banding, flicker = metrics["camera_banding"].value, metrics["camera_flicker"].value
        step = metrics["camera_banding_in_step"].value
        told = "no row is lit" if banding is None else f"{percent(banding)} in the mean"
        if step is not None:
            told += f"; white pixels in step would show {percent(step)}"
        flicker_told = (
            "one frame has none" if flicker is None
            else f"{amount(flicker, '%', 2)} from the darkest to the brightest frame"
        )  # fmt: skip
        return (
            "<h2>What a camera with a rolling shutter sees</h2>"
            f"<p>{len(pictures)} frames of {shutter.shape[1]} x {shutter.shape[0]} pixels at "
            f"{number(section.frame_rate)} Hz, exposure {number(section.exposure * 1e3)} ms, rows "
            f"within {number(section.readout * 1e3)} ms; full well {number(section.full_well)} e, "
            f"of which the panel's white fills {percent(section.white)}. Pictures in "
            "<code>images/</code> are linear."
            f'</p><div class="grid by4">{drawn}</div>'
            "<p>Bands: the mean of each row over the mean light of that row within a period of the "
            "frame. Contrast (root 2 times the standard deviation over the mean; photon noise and "
            f"motion count as well): {told}. Flicker: {flicker_told}.</p>"
            + plot(path, "bands of the camera's frames: light of each row over steady light", data)
        )
