"""Steering of a chip's clock: the counter that makes its ticks may be told to count more or less.

A tick ends when a counter of a faster master clock reaches its end value; a register of the board
changes that value from tick to tick, by whole counts. To pull the crystal oscillator itself would
be too slow: one of +-100 parts per million (the usual pull range of a VCXO) takes 5000 ticks for
half a tick, and a file of 8 MB takes 350.

A tick may be shortened only by what the readout leaves blank between the last row of a plane and
the first row of the next one. It may be lengthened by more, since the readout then only waits.
"""

from __future__ import annotations

from dataclasses import dataclass

from cosim.clock import PS, Clock


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
