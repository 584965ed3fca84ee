"""The image that a run of a board uploads into its pattern memory, and waveforms of a virtual board
under it: its Verilog for a few frames, in lockstep with the cycle model.

The simulators are imported in the function that needs them, because they take seconds to load.
"""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from cosim import InputError
from cosim.run.folder import check_trace_file
from rtl_model.geometry import Geometry
from rtl_model.registers import MEMORIES, REGISTERS

_FRAMES = 2
_WORDS = 64  # of a request
_ANSWER = 6  # bytes' time that an answer of one word takes, with a margin


class Trace(NamedTuple):
    """Where waveforms are written, and of which build.

    Attributes:
        path: file.
        geometry: geometry of the build.
    """

    path: Path
    geometry: Geometry


def checked_trace(path: Path | None, geometry: Geometry | None) -> Trace | None:
    """Checks the file of `--trace`; None if there is none.

    Args:
        path: file, None for none.
        geometry: geometry of the virtual board, None for a real one.

    Raises InputError for a real board, another file ending, or a missing folder.
    """
    if path is None:
        return None
    if geometry is None:
        raise InputError(
            "--trace", "given with board.port=virtual", "with a real board",
            "leave it out: the internal signals of a real board are not on its line",
        )  # fmt: skip
    check_trace_file(path)
    return Trace(path, geometry)


def write_waves(trace: Trace, seed: int) -> None:
    """Writes the waveforms of the first frames under the image of `seed`, and a view of them.

    A host sends the image over the line, which is not in the waveforms, then starts the sensor, and
    reads the count of spikes after the frames. Markers are at the frames' first tiles.

    Raises RuntimeError if the Verilog's spikes differ from the cycle model's.
    """
    from rtl_model.cycle import System
    from rtl_model.host.uartbone import read_request, write_request
    from rtl_model.verilated import VerilatedPins, Waves, board_signals, write_view

    geometry = trace.geometry
    address = {entry.name: entry.address for entry in REGISTERS}
    base = next(memory.address for memory in MEMORIES if memory.name == "pattern_mem")
    padded = np.zeros((geometry.rows, geometry.tiles * geometry.lanes), np.uint8)
    padded[:, : geometry.columns] = make_image(geometry, seed)
    words = [int(word) for word in padded.view("<u4").reshape(-1)]
    upload = b"".join(
        write_request(base + 4 * n, words[n : n + _WORDS]) for n in range(0, len(words), _WORDS)
    )
    settings = [(address["sensor_threshold"], 0), (address["sensor_run"], 1)]
    begin = b"".join(write_request(place, [value]) for place, value in settings)
    request = read_request(address["sensor_spikes"], 1)
    line = 10 * geometry.bit_clocks
    first = len(upload) * line
    frames = _FRAMES * geometry.tick_clocks
    last = first + (len(begin) + len(request) + _ANSWER) * line + frames
    with VerilatedPins(geometry, Waves(trace.path, first, last)) as board:
        board.send(upload)
        tiles = np.concatenate([board.send(begin, frames), board.send(request, _ANSWER * line)])
    writes = [(n, base + 4 * n, word) for n, word in enumerate(words)]
    writes += [(len(words) + n, place, value) for n, (place, value) in enumerate(settings)]
    model = System(geometry)
    expected = model.run(len(writes) + last - first, writes)
    count = min(len(tiles), len(expected))
    places = ["frame", "row", "tile", "bits"]
    if not count or not np.array_equal(tiles[places][:count], expected[places][:count]):
        raise RuntimeError("the Verilog's spikes differ from the cycle model's")
    starts = tiles["clock"][(tiles["row"] == 0) & (tiles["tile"] == 0)]
    write_view(trace.path, geometry, board_signals(geometry), first, [int(at) for at in starts])


def make_image(size: Geometry, seed: int) -> npt.NDArray[np.uint8]:
    """A bright disc on a ramp with uniform noise: (rows, columns) uint8, electrons a tick.

    Args:
        size: geometry of the board.
        seed: seed of the noise.
    """
    row, column = np.mgrid[: size.rows, : size.columns]
    y, x = (row + 0.5) / size.rows - 0.5, (column + 0.5) / size.columns - 0.5
    light = 20 + 100 * (x + 0.5) + 110 * (x * x + y * y < 0.09)
    noise = np.random.Generator(np.random.Philox(seed)).integers(-12, 13, light.shape)
    return np.clip(np.rint(light) + noise, 0, 255).astype(np.uint8)
