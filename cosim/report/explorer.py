"""The explorer inside report.html: the spikes of some pixels, compressed, and their true light.

A page holds two parts of the chip. The whole chip has every n-th pixel, and the busiest square has
all of its pixels, so that a page stays below `LARGEST`. Of a long stream it holds the cycles around
the instant that the report shows first; `viform view` has all pixels and cycles.
"""

from __future__ import annotations

import base64
import json
import math
import re
import zlib
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from cosim.compute.stopping import threads
from cosim.light.light import Box, Plane
from cosim.report.pictures import busiest_box
from cosim.report.png import to_linear_bytes
from cosim.spikes.viform import WORD, SpikeStream, Words, words_for

CYCLES: Final = 4096
"""Cycles in a page, at most."""
WHOLE, REGION = 30_000_000, 20_000_000
"""Bits of the two parts, at most, before compression to a third."""
_ELEMENT: Final = re.compile(r"<section class='explorer' data-kind='(\w+)'")
INSTANTS: Final = 17
"""Instants of the true light in a page, linear in between."""
_LEVEL: Final = 1
"""Level of zlib: the next ones take several times as long for a tenth less."""


@dataclass(frozen=True, eq=False)
class Truths:
    """True light at some cycles.

    Attributes:
        cycles: cycles of the instants, ascending; the light is that of the middle of each.
        planes: (H, W) each, white = 1.
    """

    cycles: Sequence[int]
    planes: Sequence[Plane]


def span_of(cycles: int, at: int) -> tuple[int, int]:
    """First cycle in the page of a stream, a multiple of `WORD`, and the one after its last."""
    latest = words_for(max(cycles - CYCLES, 0)) * WORD
    first = min(max(at - CYCLES // 2, 0) // WORD * WORD, latest)
    return first, min(first + CYCLES, cycles)


def packed(values: npt.NDArray[Any]) -> str:
    """The bytes of an array as text of a page, compressed."""
    return base64.b64encode(zlib.compress(values.tobytes(), _LEVEL)).decode()


def _part(
    name: str, box: Box, step: int, words: Words, truths: Truths | None
) -> dict[str, Any]:  # fmt: skip
    """One part of the chip: every `step`-th pixel of a box. words: of these pixels, (n, h, w)."""
    height, width = words.shape[1:]
    made: dict[str, Any] = {
        "name": name, "x": box[2], "y": box[0], "step": step, "width": width, "height": height,
        "data": packed(np.ascontiguousarray(np.moveaxis(words, 0, -1))),
    }  # fmt: skip
    if truths is not None:
        planes = [plane[box[0] : box[1] : step, box[2] : box[3] : step] for plane in truths.planes]
        shown = np.stack([to_linear_bytes(plane) for plane in planes])
        made["truth"] = {"cycles": list(truths.cycles), "data": packed(shown)}
    return made


def explorer_part(
    stream: SpikeStream, at: int, white: float, window: int, truths: Truths | None, *,
    told: bool = True,
) -> str:  # fmt: skip
    """The HTML of the explorer in a page.

    Args:
        stream: the stream.
        at: cycle that is shown first.
        white: rate that is white, spikes a cycle.
        window: window of TFP, cycles.
        truths: true light, None without any.
        told: whether the page names `viform view`, which needs a run that records planes.
    """
    first, stop = span_of(stream.cycles, at)
    height, width = stream.shape
    step = max(1, math.ceil(math.sqrt(height * width * (stop - first) / WHOLE)))
    side = min(height, width, math.isqrt(REGION // (stop - first)))
    change = np.ones(stream.shape, np.float32)
    if truths is not None:
        change = np.abs(truths.planes[-1] - truths.planes[0]).astype(np.float32)
    off = step // 2  # the middle of each square that a pixel stands for
    boxes = [(off, height, off, width)]
    if step > 1:
        boxes.append(busiest_box(change, side))
    steps = [step, 1]
    words = [
        np.empty((-(-(stop - first) // WORD), -(-(y1 - y0) // n), -(-(x1 - x0) // n)), np.uint32)
        for (y0, y1, x0, x1), n in zip(boxes, steps, strict=False)
    ]
    for k in range(len(words[0])):
        word = stream.read_words(first // WORD + k, first // WORD + k + 1)[0]
        for (y0, y1, x0, x1), n, into in zip(boxes, steps, words, strict=False):
            into[k] = word[y0:y1:n, x0:x1:n]
    every = "whole chip" if step == 1 else f"whole chip, one pixel of {step} x {step}"
    names = [every, f"{side} x {side} pixels, all"]
    with threads(2) as pool:  # zlib releases the interpreter
        made = [
            pool.submit(_part, names[n], boxes[n], steps[n], words[n], truths)
            for n in range(len(boxes))
        ]
        views = [one.result() for one in made]
    more = "viform view has all pixels and cycles." if told else ""
    note = f"Cycles {first} to {stop - 1} of {stream.cycles} are in this page; "
    note += f"the true light at {len(truths.cycles)} instants. " if truths is not None else ""
    given = {
        "hz": stream.clock.hz, "first": first, "stop": stop, "at": at, "white": white,
        "window": window, "views": views, "note": f"{note}{more}",
    }  # fmt: skip
    return explorer(given)


def explorer(given: dict[str, Any], kind: str = "stream") -> str:
    """The element of an explorer, with what it shows as JSON; its page adds style and script.
    kind: name of its file in `script/`."""
    data = json.dumps(given).replace("<", "\\u003c")
    return (
        f"<section class='explorer' data-kind='{kind}' aria-label='explorer'>"
        f"<script type='application/json'>{data}</script></section>"
    )


def kinds_in(page: str) -> list[str]:
    """The kinds of the explorers in the HTML of a page, each once."""
    return sorted(set(_ELEMENT.findall(page)))
