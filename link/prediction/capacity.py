"""The capacity of a link: the limits of its light, pixels and ticks, and what it uses of them.

Its input comes from a scenario, or from a link that is set up.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from link.layout import Layout
from link.mode import CELLS, Mode
from link.prediction.error_bound import LEAST_CELL, CellScene
from link.prediction.light import cell_scene
from link.section import LinkScenario
from link.setting import LinkSetting, link_setting
from link.theory import Reset, count_capacity, count_laws, one_bit_capacity, poisson_capacity
from link.theory.information import fsc_information_rate
from sensor import CameraSetting

LARGEST: Final = 1000.0
"""Largest threshold that is modelled electron by electron; a larger one is scaled down together
with the means."""
DEFAULT_MODE: Final[dict[str, Any]] = {"cell": 2, "ticks": 1, "line": "scrambled", "parity": 32}
"""Parts of a mode that are assumed if the scenario leaves them to the pilots of a run; larger cells
where these are smaller than LEAST_CELL in the image."""


def capacity_document(link: CapacityInput, mode: Mode, seed: int = 1) -> dict[str, Any]:
    """Document of `viform link capacity --json`.

    `budget` goes from every pixel of the sensor at one bit per tick to the coded rate. Each row has
    its factor, the remaining rate, and its share of the total loss in logarithms.

    Args:
        link: the link.
        mode: mode of the transmission.
        seed: seed of the information rate's simulation.
    """
    layout = Layout(mode)
    pixel = _pixel(link, mode, seed)
    per_tick = pixel_bound(link)
    rows, columns = layout.shape
    cells, free = rows * columns, int(layout.free.sum())
    line = mode.code.bits / layout.group
    factors = [
        ("view", "camera pixels that see the panel", link.on_panel / link.sensor),
        ("light", "bits that a tick's electrons can carry, at most 1", per_tick),
        ("cell", f"camera pixels to a cell of {mode.cell} x {mode.cell} panel pixels",
         min(cells / link.on_panel, 1.0)),
        ("ticks", "ticks to a symbol", 1 / mode.ticks),
        ("tags", "cells under the four tags", free / cells),
        ("pilots", "cells that are pilots", layout.cells / free),
        ("line code", f"{mode.code.bits} bits in {layout.group} symbols", line),
        ("words", mode.word_code, mode.word_rate),
    ]  # fmt: skip
    rate = link.sensor * link.hz
    lost = sum(math.log(f) for _, _, f in factors if 0 < f < 1)
    budget: list[dict[str, Any]] = [
        {"name": "sensor", "what": "every pixel, one bit a tick", "factor": 1.0, "bps": rate,
         "share_of_loss": 0.0},
    ]  # fmt: skip
    for name, what, factor in factors:
        rate *= factor
        cost = math.log(factor) / lost if 0 < factor < 1 and lost else 0.0
        budget.append(
            {"name": name, "what": what, "factor": factor, "bps": rate, "share_of_loss": cost}
        )
    # Cells that the camera does not resolve carry no more than its pixels.
    shown = layout.cells * link.hz / mode.ticks * min(link.on_panel / cells, 1.0)
    capacity = capacity_bps(link)
    raw = min(shown, capacity)
    return {
        "capacity_bps": capacity,
        "cells_bps": min(shown * pixel["cell"]["value"], capacity),
        "raw_bps": raw, "coded_bps": raw * line * mode.word_rate,
        "share": raw * line * mode.word_rate / capacity if capacity else None,
        "pixel": pixel, "budget": budget,
        "given": {
            "on": link.on, "off": link.off, "threshold": link.threshold, "reset": link.reset,
            "hz": link.hz, "sensor": link.sensor, "seen": link.on_panel, "looks": link.cell_pixels,
        },
        "mode": {
            "width": mode.width, "height": mode.height, "cell": mode.cell, "ticks": mode.ticks,
            "line": mode.line, "parity": mode.parity, "rate": mode.rate,
        },
    }  # fmt: skip


def capacity_bps(link: CapacityInput) -> float:
    """Bits per second of all camera pixels on the panel's image, each at its `pixel_bound`."""
    return link.on_panel * link.hz * pixel_bound(link)


def pixel_bound(link: CapacityInput) -> float:
    """Bits per tick that no modulation of one pixel's light can exceed.

    It is one bit of a latch, or the capacity of light of this peak and background if less.
    """
    peak = max(link.on - link.off, 1e-300)
    return min(1.0, float(poisson_capacity(link.off / peak)) * peak)


def _pixel(link: CapacityInput, mode: Mode, seed: int) -> dict[str, Any]:
    """Capacity of a pixel in a tick, and of a cell in a symbol, bits."""
    on, off, q = link.on, link.off, link.threshold
    peak, scale = max(on - off, 1e-300), max(link.threshold / LARGEST, 1.0)
    whole = max(round(q / scale), 1)
    ticks = 12_800 if whole <= 200 else 1_600
    rate = fsc_information_rate(
        link.reset, whole, on / scale, off / scale, ticks=ticks, seed=seed
    )  # fmt: skip
    off_law, on_law = count_laws(q, on, off, link.reset, mode.ticks, mode.code.run_limit)
    cell, share = count_capacity(
        _sum_law(off_law, link.cell_pixels), _sum_law(on_law, link.cell_pixels)
    )
    return {
        "poisson": {
            "value": float(poisson_capacity(off / peak)) * peak, "unit": "bit/tick",
            "what": "light of this peak and background, switched at any speed, every electron seen",
        },
        "one_bit": {"value": 1.0, "unit": "bit/tick", "what": "a latch says one bit a tick"},
        "slot": {
            "value": float(one_bit_capacity(q, on, off)), "unit": "bit/tick",
            "what": "a pixel that begins every tick empty, at its best share of ON",
        },
        "memory": {
            "value": rate.rate, "ci": [rate.low, rate.high], "unit": "bit/tick",
            "ticks": rate.ticks, "threshold": whole,
            "what": f"random bits through a pixel with {link.reset} reset, Arnold and Loeliger, "
            "99 % limits",
        },
        "cell": {
            "value": cell, "share_on": share, "looks": link.cell_pixels * mode.ticks,
            "unit": "bit/symbol",
            "what": "the count of spikes of a cell's pixels in a symbol's ticks, at its best share "
            "of ON, pixels independent",
        },
    }  # fmt: skip


def _sum_law(law: npt.NDArray[np.float64], count: int) -> npt.NDArray[np.float64]:
    """Distribution of the sum of independent counts."""
    total = np.ones(1)
    for _ in range(count):
        total = np.convolve(total, law)
    return total


@dataclass(frozen=True)
class CapacityInput:
    """Input of the capacity of a link.

    Attributes:
        on, off: mean electrons of a tick of a pixel in the middle of ON and of OFF cells.
        threshold: electrons.
        reset: reset rule of the pixels.
        hz: ticks per second.
        sensor: number of pixels of the camera.
        on_panel: number of those on the image of the panel.
        cell_pixels: camera pixels with light of one cell alone, at least 1.
    """

    on: float
    off: float
    threshold: float
    reset: Reset
    hz: float
    sensor: int
    on_panel: float
    cell_pixels: int


def scenario_input(
    scenario: LinkScenario, camera: CameraSetting
) -> tuple[CapacityInput, Mode, list[str]]:
    """Input of a scenario, its mode, and the names of the assumed parts of the mode.

    Raises:
        InputError: if the scenario cannot be simulated.
    """
    setting = link_setting(scenario, camera)
    modem, panel = scenario.link.modem, scenario.link.panel
    soft = modem.rate != "auto"
    assumed = [
        name for name in DEFAULT_MODE
        if getattr(modem, name) == "auto" and not (soft and name == "parity")
    ]  # fmt: skip
    parts = {
        name: default if name in assumed else getattr(modem, name)
        for name, default in DEFAULT_MODE.items()
    }
    if "cell" in assumed:  # as a run: none smaller than the camera resolves
        parts["cell"] = next(
            (c for c in CELLS if c >= parts["cell"] and c * setting.scale >= LEAST_CELL), CELLS[-1]
        )
    if soft:
        parts |= {"parity": None, "rate": modem.rate}
    mode = Mode(panel.width, panel.height, **parts)
    return capacity_input(setting, cell_scene(setting), mode), mode, assumed


def capacity_input(setting: LinkSetting, scene: CellScene, mode: Mode) -> CapacityInput:
    """Input of a link that is set up.

    Args:
        setting: the link.
        scene: light of its cells.
        mode: mode of the transmission.
    """
    camera, panel = setting.camera, setting.optics
    sensor = camera.chip.width * camera.chip.height
    on_panel = panel.width * panel.height * setting.scale**2 * (1 - setting.aim.occluded)
    whole = max(1, int(mode.cell * setting.scale))
    return CapacityInput(
        (scene.on + scene.background) * scene.threshold, scene.background * scene.threshold,
        scene.threshold, camera.reset, camera.clock.hz, sensor, min(on_panel, sensor),
        whole * whole,
    )  # fmt: skip
