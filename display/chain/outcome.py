"""The outcome of the display in a run: observer images, their fidelity, and metrics."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from cosim.compute.stopping import threads
from cosim.light.mosaic import Image
from cosim.report.png import coloured, pictures_wanted, write_linear_png, write_png
from cosim.run.result import Latency, Metric
from display.chain.display import SPIKE, DisplayChain
from display.panels.panel import metric_key
from display.probes.latency import PARTS
from display.probes.metrics import GREY, Probes, display_metrics
from display.quality.colorvideovdp import color_video_vdp
from display.quality.fidelity import Fidelity, ImagesByObserver, display_fidelity
from display.references.stage import TRUTH

Colours = Callable[[Image], Image]
"""Linear red, green and blue, (H, W, 3), of an image of a panel, (H, W); white = 1."""


@dataclass(frozen=True, eq=False)
class DisplayOutcome:
    """The display of a run after the last block.

    Attributes:
        chain: stages of the display.
        images: images by display ("truth", "spike", "60 Hz", ...) and observer; only "spike"
            without a scene.
        fidelity: fidelity of every display for every observer, by `chain_fidelity`; [] without a
            scene.
        frames: slow motion by display, (frames, h, w) uint8 with the sRGB curve applied.
        total_light: emitted light over the displayed spikes, packets; None without a spike, and
            with planes of charges beside them.
        probes: latency, blur and flicker; None without a camera to probe with.
        jod: ColorVideoVDP by display, by `color_video_vdp`.
    """

    chain: DisplayChain
    images: ImagesByObserver
    fidelity: list[Fidelity]
    frames: dict[str, npt.NDArray[np.uint8]]
    total_light: float | None
    probes: Probes | None
    jod: dict[str, float]

    @classmethod
    def of(
        cls, chain: DisplayChain, fidelity: list[Fidelity], probes: Probes | None
    ) -> DisplayOutcome:
        emitted, packets = chain.panel_stage.emitted, chain.panel_stage.packets
        # What charges have shown of a packet that has not come yet is known of no pixel by then.
        known = emitted is not None and packets and not chain.panel.residues
        total = emitted / packets if known and emitted is not None else None
        frames, section = chain.frames(), chain.section
        jod = {}
        if TRUTH in frames:
            jod = color_video_vdp(frames, TRUTH, chain.motion, section.distance, section.luminance)
        return cls(chain, chain.images(), fidelity, frames, total, probes, jod)

    @property
    def displays(self) -> list[str]:
        """All displays except the truth, the spike display first."""
        return [name for name in self.images if name != TRUTH]

    def title(self, display: str) -> str:
        """Title of a display in figures and tables."""
        if display == TRUTH:
            return "clear glass"
        return f"spikes, {self.chain.panel.drive}" if display == SPIKE else display

    def fidelity_of(self, display: str, observer: str) -> Fidelity:
        return next(f for f in self.fidelity if (f.display, f.observer) == (display, observer))

    def metrics(self) -> dict[str, Metric]:
        """The metrics of `result.json`."""
        out: dict[str, Metric] = {}
        for fidelity in self.fidelity:
            out |= fidelity.metrics()
        out |= {f"jod_{metric_key(name)}": Metric(jod, "JOD") for name, jod in self.jod.items()}
        total = Metric(self.total_light, "emitted/expected")
        if not self.fidelity:
            none = "without a scene there is no true light"
            out |= {
                f"psnr_{SPIKE}": Metric(None, "dB", none),
                f"ssim_{SPIKE}": Metric(None, "1", none),
            }
        probed = {} if self.probes is None else display_metrics(self.probes)
        return probed | out | {"total_light": total}

    def latency(self) -> list[Latency]:
        """Photon-to-photon latency by stage, from dark to mid grey with the drive of the run:
        median and 5 to 95 % of the pixels. Without probes, the closed form of the panel alone: from
        the latch of a spike to its row, over all rows."""
        if self.probes is None:
            panel = self.chain.panel
            scan = panel.row_delay * (panel.shape[0] - 1) / panel.shape[0]
            least, most = panel.transport / 1e6, (panel.transport + scan) / 1e6
            return [Latency("latch to light", least, (least + most) / 2, most)]
        return [
            Latency(stage, part.low, part.median, part.high)
            for row in self.probes.latency
            if (row.display, row.drive) == ("spike", self.probes.drive)
            and (row.rate, row.way) == (GREY, "rise")
            for stage, part in zip(PARTS, row.parts, strict=True)
            if np.isfinite(part.median)
        ]


def chain_fidelity(chain: DisplayChain) -> list[Fidelity]:
    """Fidelity of every display for every observer, [] without a scene; valid after the last
    block."""
    if chain.references is None:
        return []
    return display_fidelity(chain.images(), list(chain.observers))


def write_observer_images(
    folder: Path, outcome: DisplayOutcome, colours: Colours | None = None
) -> list[str]:
    """Writes the linear images of the middle instant, white = 255: images/eye-60hz.png,
    images/pursuit-truth.png, ... Returns their names.

    colours: makes a picture in colour, (H, W, 3), of an image, None for a panel of one colour. The
    images at rest are then written in colour too: images/colour-eye-60hz.png, ...
    """
    if not pictures_wanted():
        return []
    (folder / "images").mkdir(exist_ok=True)
    made: dict[str, Future[None]] = {}
    with threads(2) as pool:
        for display, by_observer in outcome.images.items():
            for observer, images in by_observer.items():
                name, image = f"{observer}-{metric_key(display)}.png", images[len(images) // 2]
                path = folder / "images" / name
                made[f"images/{name}"] = pool.submit(write_linear_png, path, image)
                if colours is not None and observer != "pursuit":
                    path = path.with_name(f"colour-{name}")
                    picture = coloured(colours(image))
                    made[f"images/{path.name}"] = pool.submit(write_png, path, picture)
        return [name for name, each in made.items() if each.result() is None]
