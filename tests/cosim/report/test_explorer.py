"""The explorer's data in a page."""

from __future__ import annotations

import base64
import json
import re
import zlib
from typing import Any

import numpy as np
import pytest

from cosim import Clock, Viform
from cosim.report import explorer as module
from cosim.report.explorer import Truths, explorer_part, span_of
from cosim.spikes.viform import pack_planes, words_for


def stream(cycles: int, shape: tuple[int, int]) -> Viform:
    planes = np.random.default_rng(5).random((cycles, *shape)) < 0.2
    return Viform(pack_planes(planes), cycles, Clock(40_000))


def given(page: str) -> dict[str, Any]:
    found = re.search(r"<script type='application/json'>(.*?)</script>", page, re.S)
    assert found is not None
    document: dict[str, Any] = json.loads(found[1])
    return document


def unpacked(text: str, kind: Any) -> np.ndarray:
    return np.frombuffer(zlib.decompress(base64.b64decode(text)), kind)


def test_a_small_stream_is_whole() -> None:
    spikes = stream(70, (5, 8))
    document = given(explorer_part(spikes, 30, 0.6, 41, None))
    (view,) = document["views"]
    assert (view["step"], view["width"], view["height"]) == (1, 8, 5) and "truth" not in view
    assert (document["first"], document["stop"], document["at"]) == (0, 70, 30)
    words = unpacked(view["data"], "<u4").reshape(5, 8, words_for(70))
    assert (np.moveaxis(words, -1, 0) == spikes.words).all()


def test_a_large_stream_is_thinned_and_has_a_square(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "WHOLE", 64 * 100)
    monkeypatch.setattr(module, "REGION", 64 * 49)
    spikes = stream(64, (40, 60))
    planes = [np.zeros((40, 60), np.float32) for _ in range(3)]
    planes[-1][20:27, 30:37] = 1
    page = given(explorer_part(spikes, 32, 0.6, 41, Truths([0, 32, 63], planes)))
    whole, square = page["views"]
    step = whole["step"]
    assert whole["name"] == "whole chip, one pixel of 5 x 5"
    assert step == 5 and whole["width"] * whole["height"] * 64 <= 64 * 100
    assert (square["x"], square["y"], square["width"], square["height"]) == (30, 20, 7, 7)
    words = unpacked(whole["data"], "<u4").reshape(whole["height"], whole["width"], 2)
    picked = spikes.words[:, whole["y"] :: step, whole["x"] :: step]
    assert (np.moveaxis(words, -1, 0) == picked).all()
    light = unpacked(square["truth"]["data"], np.uint8).reshape(3, 7, 7)
    assert (light[:2] == 0).all() and (light[2] == 255).all()


def test_the_cycles_of_a_long_stream() -> None:
    assert span_of(100, 50) == (0, 100)
    first, stop = span_of(20_000, 10_000)
    assert first % 32 == 0 and first <= 10_000 < stop and stop - first == module.CYCLES
    assert span_of(20_000, 19_999)[1] == 20_000
    first, stop = span_of(module.CYCLES + 20, module.CYCLES + 19)  # behind the last whole word
    assert first % 32 == 0 and first < module.CYCLES + 19 < stop <= first + module.CYCLES
    assert span_of(20_000, 0) == (0, module.CYCLES)


def test_text_cannot_end_the_script() -> None:
    page = module.explorer({"note": "</script><b>"})
    assert page.count("</script>") == 1
