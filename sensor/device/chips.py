"""Chips as presets. Each number says whether it was published or is assumed.

Published: Huang 2022 (DZXB 20221075) section 6 for sizes, clocks and process. Nothing found
publishes pitch, fill factor, quantum efficiency or full well of either chip; the paper's worked
example (100 um2 at QE 0.7, section 4.3) is the natural assumption.

The board of a chip may steer its clock. A tick ends when a counter of a faster master clock reaches
its end value; a register of the board changes that value from tick to tick, by whole counts. To
pull the crystal oscillator itself would be too slow: one of +-100 parts per million (the usual pull
range of a VCXO) takes 5000 ticks for half a tick, and a file of 8 MB takes 350. A tick may be
shortened only by what the readout leaves blank between the last row of a plane and the first row of
the next one. It may be lengthened by more, since the readout then only waits.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import Any, Final

from cosim.clock import PS, Clock

GIVEN: Final = "given by the user"
"""Origin of a number that stands in the scenario."""
MOST_PIXELS: Final = 64_000_000
"""Largest array, 8000 x 8000: the size up to which runs are tested."""
_NO_NUMBERS: Final = ("name", "title", "assumed", "given", "steering")
_ASSUMED = frozenset({"pitch", "fill_factor", "quantum_efficiency"})


@dataclass(frozen=True)
class ClockSteering:
    """A counter whose end value can be written.

    Attributes:
        master_hz: clock that is counted.
        longest: largest change of a tick, as a share of it.
    """

    master_hz: float
    longest: float

    @property
    def step(self) -> int:
        """A count, ps."""
        return round(PS / self.master_hz)

    def most(self, clock: Clock) -> int:
        """Counts by which a tick may be lengthened."""
        return int(self.longest * self.master_hz / clock.hz)

    def least(self, clock: Clock, row_skew: float, rows: int) -> int:
        """Counts by which a tick may be shortened: at most as it may be lengthened, and at most the
        blank rest of it.

        Args:
            clock: nominal one of the ticks.
            row_skew: share of a tick over which `rows` rows are read, one after another.
            rows: number of rows of the chip.
        """
        blank = 1 - row_skew * (rows - 1) / rows
        return min(self.most(clock), int(blank * self.master_hz / clock.hz))


BOARD = ClockSteering(100e6, 0.01)
"""Assumed, since no board of SpikeTwo is published. 100 MHz is the usual oscillator of boards with
an FPGA (as of the Arty A7, reference manual section 6): a count is 10 ns, 1/2500 of a tick at 40
kHz. 1 % is 25 counts, a register of five bits. A tick that is 1 % longer has 1 % more charge, a
third of the shot noise at a threshold of 1000 electrons."""


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
