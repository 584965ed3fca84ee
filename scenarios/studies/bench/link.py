"""Throughput of a link: the modem whole, and its parts, each beside the plain way.

| rows | what |
|---|---|
| `link.modem` | the file of light-link, from spikes to bytes and from bytes to panel words |
| `link.acquisition` | what precedes the first data, once a transmission |
| `link.detector` | processor time of a cell's symbol, and information of a bit |
| `link.ldpc`, `link.reed-solomon` | codes of the words |
"""

from __future__ import annotations

from cosim.compute.opencl import Device
from cosim.run.timing import Row
from link.layout import TRAINING
from scenarios.studies.bench.detector import DETECTORS, information_rows, time_rows
from scenarios.studies.bench.ldpc import ldpc_rows
from scenarios.studies.bench.modem import film_link, modem_rows
from scenarios.studies.bench.reed_solomon import reed_solomon_rows

SYMBOLS = 40
"""Symbols that the detectors decide in a call: those of a call of the receiver."""


def link_rows(device: Device | None, ceiling: float | None) -> list[Row]:
    """The rows of a link; see above.

    Args:
        device: OpenCL device of the film and of the LDPC decoder; None for the compiled forms.
        ceiling: measured ceiling, pixel-cycles/s, None if unknown.
    """
    filmed = film_link(device)
    detectors = {name: filmed.detector(name) for name in DETECTORS}
    count = min(SYMBOLS, filmed.symbols)
    given = filmed.words, 0, TRAINING, count
    return [
        *modem_rows(filmed, device, ceiling),
        *time_rows(detectors, given, count * filmed.sent.layout.cells),
        *information_rows(),
        *ldpc_rows(device),
        *reed_solomon_rows(),
    ]
