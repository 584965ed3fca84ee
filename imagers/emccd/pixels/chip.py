"""Parameters of the CCD97-like chip of the document, each with its source.

Document: seed 003 (Wang, Li, Ye: four drive modes of a frame-transfer EMCCD). Data sheet: E2V
CCD97-00, which the document cites. Figures that neither prints are marked "assumed".
"""

from __future__ import annotations

from typing import Final

__all__ = [
    "ADC_BITS",
    "CLOCK_INDUCED",
    "COLUMNS",
    "DARK_COLUMNS",
    "DARK_ROWS",
    "IMAGE_COLUMNS",
    "IMAGE_ROWS",
    "IMAGE_WELL",
    "LINE_CLOCKS",
    "OFFSET",
    "PITCH",
    "PRNU",
    "QUANTUM_EFFICIENCY",
    "READOUT",
    "READ_NOISE",
    "REGISTER_WELL",
    "ROWS",
    "ROW_SHIFT",
    "STAGES",
    "TRANSITION_CELLS",
    "WAVELENGTH",
    "WORKING_KELVIN",
    "ZERO_CELSIUS",
]

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
"""Between horizontal and multiplication register (document)."""
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
