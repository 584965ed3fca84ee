"""Parameters of the CCD97-like chip of the document, each with its source.

Document: 003 of `docs/paper.md` (Wang, Li, Ye: four drive modes of a frame-transfer EMCCD). Data
sheet: E2V CCD97-00, which the document cites. Figures that neither prints are marked "assumed".

Dark current in inverted mode, over temperature:

Qd = Qd0 * 1.14e6 T^3 exp(-9080 / T), E2V's data sheet of the CCD97 for inverted mode operation,
which the document's device uses ("inverted output suppresses dark current noise"). (E2V's other
form, 122 T^3 exp(-6400 / T), is for chips that are not inverted.)
"""

from __future__ import annotations

import math
from typing import Final

IMAGE_ROWS: Final = 512
"""Document: resolution 512 x 512."""
IMAGE_COLUMNS: Final = 512
DARK_ROWS: Final = 8
"""Dark reference rows at the head, and as many at the tail (document)."""
DARK_COLUMNS: Final = 12
"""Dark reference columns on either side (document)."""
ROWS: Final = IMAGE_ROWS + 2 * DARK_ROWS
"""528, as the document prints."""
COLUMNS: Final = IMAGE_COLUMNS + 2 * DARK_COLUMNS
"""536, as the document prints; also the cells of the horizontal register."""
TRANSITION_CELLS: Final = 16
"""Elements between horizontal and multiplication register (document)."""
LINE_CLOCKS: Final = COLUMNS + TRANSITION_CELLS
"""552 pixel clocks a line, as the document prints."""
STAGES: Final = 536
"""Multiplication stages of a CCD97; not in the document, recalled: assumed."""
PITCH: Final = 16e-6
"""m; data sheet."""
QUANTUM_EFFICIENCY: Final = 0.93
"""Document: up to 93 % in visible light, here at `WAVELENGTH`. (Data sheet: .90 at 630 nm.)"""
WAVELENGTH: Final = 555.0
"""nm: lux count as light of this wavelength, 4.09e15 photons / (s m2 lx)."""
IMAGE_WELL: Final = 130e3
"""e-; recalled of the data sheet: assumed."""
REGISTER_WELL: Final = 800e3
"""e-, of the multiplication register; recalled of the data sheet: assumed."""
READ_NOISE: Final = 30.0
"""e- RMS at the output, after multiplication, at about 10 MHz: assumed (the data sheet has 2.2 e-
at 50 kHz)."""
CLOCK_INDUCED: Final = 0.005
"""e- a pixel and frame: reported are .002 to .01; the middle is assumed."""
PRNU: Final = 0.01
"""Relative: assumed."""
ADC_BITS: Final = 16
"""Document."""
OFFSET: Final = 500.0
"""DN without charge: assumed."""
READOUT: Final = ROWS * LINE_CLOCKS / 10e6
"""s of a whole frame at 10 MHz, 29.1 ms (assumed): how long the last row waits in storage."""
ROW_SHIFT: Final = 1e-6
"""s of one row in a frame transfer: reported are .3 to 1 us; assumed. A sequencer gives its own."""
ZERO_CELSIUS: Final = 273.15
WORKING_KELVIN: Final = ZERO_CELSIUS - 10.0
"""Document: the cooler holds -10 degC."""


DARK_AT_20C: Final = 400.0
"""e- / (pixel s), typical; 800 at most (data sheet)."""
DSNU_SHARE: Final = 60.0 / 400.0
"""Standard deviation of pixels' dark currents over their mean: 60 of 400 e- / (pixel s) at 20 degC
(data sheet); taken as the same share at any temperature (assumed)."""

_FACTOR: Final = 1.14e6
_KELVIN: Final = 9080.0


def dark_current(kelvin: float, at_20c: float = DARK_AT_20C) -> float:
    """e- / (pixel s): 33.5, 8.5 and 1.93 at 0, -10 and -20 degC for the typical chip.

    The printed factor is rounded and gives 1.012 at 20 degC; here it is scaled to exactly 1.
    """
    if not kelvin > 0:
        raise ValueError(f"kelvin must be positive, not {kelvin:g}")
    return at_20c * _factor(kelvin) / _factor(ZERO_CELSIUS + 20.0)


def _factor(kelvin: float) -> float:
    return _FACTOR * kelvin**3 * math.exp(-_KELVIN / kelvin)
