"""Chips as presets. Each number says whether it was published or is assumed.

Published: Huang 2022 (DZXB 20221075) section 6 for sizes, clocks and process. Nothing found
publishes pitch, fill factor, quantum efficiency or full well of either chip; the paper's worked
example (100 um2 at QE 0.7, section 4.3) is the natural assumption.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import Any, Final

from sensor.device.steering import BOARD, ClockSteering


@dataclass(frozen=True)
class Chip:
    """A chip as a preset.

    Attributes:
        width, height: pixels.
        clocks: latch frequencies it runs at, Hz.
        pitch: pitch of the pixels, um.
        fill_factor, quantum_efficiency: fill factor and quantum efficiency, in (0, 1].
        threshold_levels: settings from outside.
        assumed: names of the numbers that are assumed.
        given: names of the numbers that the user gives in place of the preset's.
        steering: steering of the board that makes the chip's ticks; None if their length cannot be
            changed.
    """

    name: str
    title: str
    width: int
    height: int
    clocks: tuple[float, ...]
    threshold_levels: int
    pitch: float
    fill_factor: float
    quantum_efficiency: float
    assumed: frozenset[str]
    given: frozenset[str] = frozenset()
    steering: ClockSteering | None = None

    @property
    def pixel_area(self) -> float:
        """Light-gathering area of a pixel in m2."""
        return (self.pitch * 1e-6) ** 2 * self.fill_factor

    def electrons_per_lux(self, photons_per_lux: float) -> float:
        """Photoelectrons a second for a lux on the pixel, at so many photons / (s m2 lx)."""
        return photons_per_lux * self.pixel_area * self.quantum_efficiency

    def provenance(self) -> dict[str, str]:
        """ "published", "assumed" or "given by the user" for every number."""
        named = [f.name for f in fields(self) if f.name not in _NO_NUMBERS]
        origin = {n: "assumed" if n in self.assumed else "published" for n in named}
        return origin | dict.fromkeys(self.given, GIVEN)

    @property
    def size_origin(self) -> str:
        """Origin of the size, as in `provenance`."""
        wide, high = (self.provenance()[name] for name in ("width", "height"))
        return wide if wide == high else f"width {wide}, height {high}"

    def own(self, **numbers: float | None) -> Chip:
        """The chip with these numbers in place of the preset's; None leaves a number as it is."""
        given = {name: value for name, value in numbers.items() if value is not None}
        changed: dict[str, Any] = {**given, "given": self.given.union(given)}
        return replace(self, **changed)


GIVEN: Final = "given by the user"
"""Origin of a number that stands in the scenario."""
MOST_PIXELS: Final = 64_000_000
"""Largest array, 8000 x 8000: the size up to which runs are tested."""
_NO_NUMBERS: Final = ("name", "title", "assumed", "given", "steering")

_ASSUMED = frozenset({"pitch", "fill_factor", "quantum_efficiency"})

CHIPS = {
    c.name: c
    for c in (
        Chip(
            "spiketwo",
            "SpikeTwo (2021)",
            1000,
            1000,
            (40e3, 20e3),
            16,
            10.0,
            1.0,
            0.7,
            _ASSUMED,
            steering=BOARD,
        ),
        # The paper prints 450 x 200 "= 100 000"; every public recording of the chip is 400 x 250.
        Chip("spikeone", "SpikeOne (2017)", 400, 250, (40e3, 20e3), 16, 10.0, 1.0, 0.7, _ASSUMED),
        Chip(
            "spikeone-450x200",
            "SpikeOne as printed, 450 x 200",
            450,
            200,
            (40e3, 20e3),
            16,
            10.0,
            1.0,
            0.7,
            _ASSUMED,
        ),
        # No chip of sections 4.3 to 5.2 has been published: every number is assumed, the pixel's
        # after the worked example.
        Chip(
            "spikeasync",
            "an asynchronous spike camera, assumed",
            256,
            256,
            (),
            16,
            10.0,
            1.0,
            0.7,
            _ASSUMED | {"width", "height", "clocks", "threshold_levels"},
        ),
    )
}
"""Presets by name."""
