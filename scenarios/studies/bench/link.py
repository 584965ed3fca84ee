"""Throughput of a link: the modem whole, and its parts, each beside the plain way.

LDPC words are decoded from noise in which the rate of the code is a fixed share of what the channel
carries, because the number of rounds depends on it. The plain way is the numpy form. Reed-Solomon
words have no plain way: a second decoder stands in the tests only.

The time of a detector is that on the spikes of `link.modem`, with all cores: processor time and not
wall time, so that other load of the machine counts less. Its information is that of random data on
a strip of the panel of light-link, through its air with vibration and its camera
(`link.setup.pilot`): both detectors decide the same spikes.

| rows | what |
|---|---|
| `link.modem` | the file of light-link, from spikes to bytes and from bytes to panel words |
| `link.acquisition` | what precedes the first data, once a transmission |
| `link.detector` | processor time of a cell's symbol, and information of a bit |
| `link.ldpc`, `link.reed-solomon` | codes of the words |
"""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import partial
from typing import Any, Final

import numpy as np

from cosim.compute.opencl import Device
from cosim.run.timing import TimingRow, least_of
from link.coding.ldpc import ROUNDS, Ldpc, quantise
from link.coding.ldpc_decoding import decode_in_numpy
from link.coding.reed_solomon import WORD_BYTES, ReedSolomon
from link.detect.detector import Detector
from link.layout import TRAINING
from link.mode import Mode
from link.setting import link_setting
from link.setup.pilot import WIDTH, film_pilot, strip_of
from link.theory.soft_information import soft_information
from scenarios.assemble.chip import camera_setting
from scenarios.assemble.schema.loading import linked, load
from scenarios.studies.bench.modem import film_link, modem_rows

AIM: Final = 8e9
"""Data that the link should carry, bit/s."""
DATA_BITS: Final = 8448
CODES: Final = {9216: 0.4000, 9600: 0.4687, 10368: 0.5539}
"""Bits of a word as sent -> standard deviation of the noise on signs of +-1 in which the rate is
.94 of the capacity."""
LDPC_WORDS, PLAIN_WORDS, LDPC_TURNS = 512, 8, 3
PARITY: Final = 32
WRONG: Final = (0, 4, 16)
"""Wrong bytes of a word."""
RS_WORDS, RS_TURNS = 4096, 3
DETECTORS: Final = ("joint", "packed")
"""Names; the ratio of a row is over the first."""
HEIGHT: Final = 480
"""Panel pixels of the strip's height."""
PHASES: Final = (0.25, 0.5, 0.75)
"""Delays of the panel's planes after the camera's ticks, ticks."""
TICKS: Final = (1, 2)
_TURNS: Final = 5
_SEED: Final = 1
SYMBOLS = 40
"""Symbols that the detectors decide in a call: those of a call of the receiver."""


def code_rows(
    name: str, what: str, call: Callable[[], Any], bits: int, aim: float, turns: int,
    plain: tuple[Callable[[], Any], float] | None = None,
) -> list[TimingRow]:  # fmt: skip
    """Rows of a call: over all cores, and per core, from processor time.

    Args:
        name, what: name of the rows, and their tier.
        call: what is timed.
        bits: data bits of a call.
        aim: bit/s that are real time.
        turns: timed calls.
        plain: the plain way, and the share of the call's bits that it takes; None without one.
    """
    calls = [call] if plain is None else [call, plain[0]]
    wall, *rest = least_of(calls, turns)
    begin = time.process_time()
    for _ in range(turns):
        call()
    each = (time.process_time() - begin) / turns
    ratio = None if plain is None else rest[0] / plain[1] / wall
    return [
        TimingRow(name, what, bits / wall, "bit/s", bits / wall / aim, None, ratio),
        TimingRow(name, f"{what}, a core", bits / each, "bit/s", bits / each / aim, None, None),
    ]


def _row(what: str, call: Callable[[], Any], plain: Callable[[], Any] | None) -> list[TimingRow]:
    """The rows of a call for WORDS words."""
    share = None if plain is None else (plain, PLAIN_WORDS / LDPC_WORDS)
    return code_rows("link.ldpc", what, call, LDPC_WORDS * DATA_BITS, AIM, LDPC_TURNS, share)


def ldpc_rows(device: Device | None) -> list[TimingRow]:
    """The rows `link.ldpc`: encoding at the first rate, and decoding at each.

    Args:
        device: OpenCL device that decodes; None for the compiled form.
    """
    random = np.random.default_rng(1)
    rows: list[TimingRow] = []
    for word_bits, noise in CODES.items():
        code = Ldpc(DATA_BITS, word_bits)
        data = random.integers(0, 256, (LDPC_WORDS, DATA_BITS // 8), dtype=np.uint8)
        if not rows:
            rows += _row("encode", partial(code.encode, data), None)
        seen = np.unpackbits(code.encode(data), axis=1, bitorder="little") * np.float32(2) - 1
        seen += np.float32(noise) * random.standard_normal(seen.shape, np.float32)
        soft = quantise(seen * np.float32(2 / noise**2))
        ours = partial(code.decode, soft, ROUNDS, device)
        plain = partial(decode_in_numpy, code, soft[:PLAIN_WORDS], ROUNDS)
        rows += _row(f"decode, rate {code.rate:.3f}", ours, plain)
    return rows


def reed_solomon_rows() -> list[TimingRow]:
    """The rows `link.reed-solomon`: encoding, and decoding by the wrong bytes of a word."""
    code, random = ReedSolomon(PARITY), np.random.default_rng(1)
    data = random.integers(0, 256, (RS_WORDS, code.data_bytes), dtype=np.uint8)
    sent, bits = code.encode(data), 8 * data.size
    name = "link.reed-solomon"
    rows = code_rows(name, "encode", partial(code.encode, data), bits, AIM, RS_TURNS)
    for wrong in WRONG:
        seen = sent.copy()
        place = random.permuted(np.tile(np.arange(WORD_BYTES), (RS_WORDS, 1)), axis=1)[:, :wrong]
        seen[np.arange(RS_WORDS)[:, None], place] ^= random.integers(
            1, 256, place.shape, dtype=np.uint8
        )
        what = f"decode, {wrong} of {WORD_BYTES} bytes wrong"
        rows += code_rows(name, what, partial(code.decode, seen), bits, AIM, RS_TURNS)
    return rows


def time_rows(
    detectors: dict[str, Detector], given: tuple[Any, ...], cell_symbols: int
) -> list[TimingRow]:
    """Rows `link.detector`, ns of processor time for a symbol of a cell.

    Args:
        detectors: detectors by name, which have learned.
        given: arguments of `Detector.soft`.
        cell_symbols: soft values of a call.
    """
    calls: list[Callable[[], Any]] = [partial(each.soft, *given) for each in detectors.values()]
    seconds = least_of(calls, _TURNS, time.process_time)
    return [
        TimingRow(
            "link.detector", name, 1e9 * each / cell_symbols, "ns/cell-symbol", None, None,
            seconds[0] / each,
        )
        for name, each in zip(detectors, seconds, strict=True)
    ]  # fmt: skip


def information_rows() -> list[TimingRow]:
    """Rows `link.detector`, bits of information of a bit, by ticks and phase."""
    rows = []
    for ticks in TICKS:
        mode = Mode(WIDTH, HEIGHT, 2, ticks, "scrambled", 32)
        for phase in PHASES:
            sets = [f"link.panel.phase={phase}", f"link.panel.height={HEIGHT}"]
            scenario = linked(load("light-link", sets)[1], "bench link")
            strip = strip_of(link_setting(scenario, camera_setting(scenario)))
            for name in DETECTORS:
                pilot = film_pilot(strip, mode, name, _SEED, None)
                found = soft_information(pilot.soft, pilot.sent)
                assert found is not None
                tier = f"{name}, {ticks} ticks, phase {phase:g}"
                rows.append(TimingRow("link.detector", tier, found.bits, "bit", None, None, None))
    return rows


def link_rows(device: Device | None, ceiling: float | None) -> list[TimingRow]:
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
