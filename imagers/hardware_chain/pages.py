"""Report sections of the hardware chain: noise by origin, stripes, tones (document 004, fig. 9)."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import numpy.typing as npt

from cosim.config.amounts import number
from cosim.report.drawn import Data, save_figure
from cosim.report.figures import INK, MARK, subplots
from cosim.report.parts import plot, table
from imagers.hardware_chain.model import FLOODED, HardwareChainModel
from imagers.report.figures import BLUE, stretch, style_axes
from imagers.report.page import ImagerRun
from sensor.dynamic_range import Mapping


def chain_sections(model: HardwareChainModel, run: ImagerRun) -> str:
    """Writes the figures and returns the HTML of the sections."""
    folder = run.folder / "figures"
    text = "<h2>Noise in the dark, and saturation</h2>" + _noise(model, run)
    dark = next((n for n, f in enumerate(run.frames) if f.state["light_most"] == 0), None)
    if dark is not None:
        stripes = _stripes(model, run.frame(dark), folder / "dark.png")
        text += (
            "<h2>A frame without light</h2><p>Left: the frame, stretched to three deviations about "
            "its mean. Right: its spectrum; a ripple of frequency f on the supply is a plane wave "
            "of f / f_clock cycles a column and f t_row cycles a row, less whole cycles, and of "
            "the amplitude that it has at the sensor's output times m n over the converter's step. "
            "Circles: where the closed form puts the scenario's ripple.</p>"
            + plot(folder / "dark.png", "a frame without light, and its spectrum", stripes)
        )
    tones = _tones(model, run, folder / "tones.png")
    holds = [(m, m.holds) for m in (Mapping(1.0, model.mapping.bits), model.mapping)]
    return (
        text + "<h2>Tones</h2><p>The frame of the widest spread by linear and by gamma mapping "
        "(figure 9 of its source); the pictures of this run are mapped by the latter. "
        + " "
        "".join(f"Gamma {number(m.gamma)} holds {db:.1f} dB in {m.bits} bits." for m, db in holds)
        + "</p>" + plot(folder / "tones.png", "a frame by linear and by gamma mapping", tones)
    )  # fmt: skip


def _noise(model: HardwareChainModel, run: ImagerRun) -> str:
    s, chain = model.section, model.chain
    sensor = model.sensor.noise.parts(s.temperature, s.clock, s.exposure)
    sine = model.pixels.ripple.rms / chain.sensitivity
    rows = [[f"sensor: {name}", f"{number(value, 4)} e"] for name, value in sensor.items() if value]
    rows += [["circuit", f"{number(s.circuit_noise / chain.sensitivity, 4)} e"]]
    rows += [["supply ripple, RMS", f"{number(sine, 4)} e"]] if sine else []
    rows += [
        [name, f"{number(value, 4)} e"] for name, value in chain.parts().items()
        if value and name not in ("sensor", "circuit")
    ]  # fmt: skip
    noise, full = model.measured(run.frames)
    rows += [["all, in quadrature", f"{number(chain.floor, 4)} e"]]
    rows += [["measured in the frames without light", _electrons(noise)]]
    rows += [["saturation, by the first stage that clips: " + chain.limit,
              f"{number(chain.saturation, 6)} e"]]  # fmt: skip
    rows += [["measured in the flooded frames", _electrons(full)]]
    return table(["noise by origin (RMS), and saturation", "electrons at the sensor"], rows)


def _electrons(value: float | None) -> str:
    return "no such frame" if value is None else f"{number(value, 6)} e"


def _stripes(model: HardwareChainModel, values: npt.NDArray[np.uint16], path: Path) -> Data:
    figure, (left, right) = subplots(1, 2, figsize=(9.5, 4.2), layout="constrained")
    mean, spread = float(values.mean()), max(float(values.std()), 0.5)
    shown = stretch(values, mean - 3 * spread, mean + 3 * spread)
    left.imshow(shown, cmap="gray", interpolation="nearest")
    left.axis("off")
    power = np.abs(np.fft.fftshift(np.fft.fft2(values - mean)))
    row, column = model.pixels.ripple.stripes()
    if model.section.ripple:
        right.plot([column, -column], [row, -row], "o", color=MARK, mfc="none", markersize=14)
    extent = (-0.5, 0.5, 0.5, -0.5)
    right.imshow(np.log(power + power.mean()), cmap="gray", extent=extent)
    style_axes(right, "cycles a column", "cycles a row")
    return save_figure(figure, path)


def _tones(model: HardwareChainModel, run: ImagerRun, path: Path) -> Data:
    clipped = FLOODED * model.chain.saturation / model.pixels.responsivity
    within = [n for n, f in enumerate(run.frames) if f.state["light_most"] < clipped]
    widest = max(within or range(len(run.frames)), key=lambda n: run.frames[n].spread)
    values = run.frame(widest)
    mappings = (Mapping(1.0, model.mapping.bits), model.mapping)
    figure, places = subplots(1, 3, figsize=(9.8, 3.4), layout="constrained")
    for axes, mapping in zip(places, mappings, strict=False):
        axes.imshow(model.mapped(values, mapping), cmap="gray", vmin=0, vmax=255)
        axes.set_title(f"gamma {number(mapping.gamma)}", fontsize=9, color=INK)
        axes.axis("off")
    light = np.linspace(0, 1, 400)
    for mapping, colour in zip(mappings, (MARK, BLUE), strict=True):
        places[2].step(light, mapping.codes(light), color=colour, linewidth=1.1,
                       label=f"gamma {number(mapping.gamma)}")  # fmt: skip
    style_axes(places[2], "light over that of saturation", "code")
    return save_figure(figure, path)
