"""No wrong byte is taken for right: files through random channels, and receivers that are broken.

The receiver's promise is that a frame counts only if its CRC-32C is right, and the file only if
its CRC-64 is. A test of it must be able to fail, so the same channels are sent through receivers
without the one check or the other.
"""

from __future__ import annotations

import struct
from typing import Any

import numpy as np
import pytest

import link.coding.boxes
import link.coding.fountain
import link.coding.packed_file
from link.coding.boxes import Frame, read_frame
from link.coding.crc import crc32c
from link.coding.ldpc import Ldpc
from link.layout import Layout
from link.mode import PARITIES, RATES, Mode
from tests.link.coding.random_channels import Totals, send_file

PANELS = {(960, 960, 2): 4_000_000, (512, 480, 2): 1_000_000, (256, 224, 2): 60_000,
          (128, 160, 4): 4_000}  # fmt: skip
"""Sides and cell of a panel -> bytes of a file at most."""
BITS = 10**9


def layouts(panel: tuple[int, int, int]) -> list[Layout]:
    """Every code of words on a panel, and the line codes with one of them."""
    modes: list[tuple[str, int | None, float | None]] = [("scrambled", None, r) for r in RATES]
    modes += [("scrambled", p, None) for p in PARITIES]
    modes += [(line, 32, None) for line in ("8b10b", "4b6b", "manchester", "none")]
    width, height, cell = panel
    return [Layout(Mode(width, height, cell, 1, *each)) for each in modes]


def send_through_all(bits: int, panels: dict[tuple[int, int, int], int], seed: int) -> Totals:
    """Sends files in all modes of panels in turn, until so many file bits were read."""
    rng, totals = np.random.default_rng(seed), Totals()
    while totals.bits < bits:
        for panel, most in panels.items():
            for layout in layouts(panel):
                size = int(most * rng.random())
                send_file(layout, size, rng, totals, interleave=bool(rng.random() < 0.8))
    return totals


def test_no_wrong_byte_is_taken_for_right() -> None:
    small = {panel: most for panel, most in PANELS.items() if panel[0] < 500}
    totals = send_through_all(4_000_000, small, 1)
    assert totals.wrong == totals.false == 0
    assert min(totals.right, totals.lost) > 100 and totals.errors > 10_000
    assert 0 < totals.delivered < totals.files


@pytest.mark.slow
def test_no_wrong_byte_of_a_thousand_million_bits_is_taken_for_right() -> None:
    totals = send_through_all(BITS, PANELS, 2)
    print(totals)
    assert totals.bits >= BITS and totals.errors > BITS / 1000
    assert totals.wrong == totals.false == 0
    assert min(totals.right, totals.lost) > 10_000 and min(totals.kinds.values()) > 10


def _without_crc(data: np.ndarray, symbol: int) -> Frame | None:
    """`read_frame` of a frame whose CRC is made right."""
    body = data.tobytes()[:-4]
    return read_frame(np.frombuffer(body + struct.pack("<I", crc32c(body)), np.uint8), symbol)


def _trusting(self: Ldpc, *given: Any, **named: Any) -> Any:
    """`Ldpc.decode` that takes every word for right."""
    data, ok, rounds = DECODE(self, *given, **named)
    return data, np.ones_like(ok), rounds


DECODE = Ldpc.decode


def test_a_receiver_that_trusts_every_word_is_saved_by_the_crc(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(Ldpc, "decode", _trusting)
    totals, rng = Totals(), np.random.default_rng(3)
    for rate in RATES:
        send_file(Layout(Mode(256, 224, 2, 1, "scrambled", None, rate)), 60_000, rng, totals)
    assert totals.wrong == totals.false == 0 and totals.lost > 30


@pytest.mark.parametrize("code", ["reed-solomon", "ldpc"])
def test_without_the_frames_crc_wrong_bytes_are_found(
    code: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(link.coding.boxes, "read_frame", _without_crc)
    monkeypatch.setattr(Ldpc, "decode", _trusting)
    totals, rng = Totals(), np.random.default_rng(4)
    kinds = [(16, None)] * 8 if code == "reed-solomon" else [(None, rate) for rate in RATES]
    for each in kinds:
        send_file(Layout(Mode(256, 224, 2, 1, "scrambled", *each)), 60_000, rng, totals)
    assert totals.wrong > 0
    assert totals.false == 0  # the CRC of the file is left


def test_without_both_checks_a_wrong_file_is_delivered(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(link.coding.boxes, "read_frame", _without_crc)
    monkeypatch.setattr(Ldpc, "decode", _trusting)
    monkeypatch.setattr(link.coding.fountain, "unpack_file", _any_file)
    totals, rng = Totals(), np.random.default_rng(5)
    for rate in RATES * 3:
        send_file(Layout(Mode(256, 224, 2, 1, "scrambled", None, rate)), 60_000, rng, totals)
    assert totals.false > 0


def _any_file(packed: bytes) -> link.coding.packed_file.Delivered:
    """`unpack_file` without the CRC."""
    return link.coding.packed_file.Delivered(packed[10:], "x")
