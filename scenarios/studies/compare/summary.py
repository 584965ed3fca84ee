"""The summary on the page of a comparison."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, Final

from cosim.config.amounts import amount, count, decibel, elapsed, number, percent
from cosim.report.parts import Card, cards
from cosim.report.summary import Answer, big, listed, paragraph
from scenarios.studies.compare.row import FIGURES, Camera
from sensor.dynamic_range import decibels

_BEST: Final[tuple[tuple[str, str, bool, Callable[[float], str]], ...]] = (
    ("psnr", "highest PSNR", True, decibel),
    ("blur", "sharpest edge", False, lambda v: amount(v, "pixels")),
    ("noise", "least noise at mid-grey", False, lambda v: percent(v, 2)),
    ("dynamic_range_controls", "widest dynamic range with all controls", True,
     lambda v: amount(v, "dB")),
)  # fmt: skip
"""Figure, what its best value is, whether that is the highest, and its text."""


def summary_of_comparison(
    cameras: list[Camera], document: dict[str, Any], seconds: float
) -> list[Answer]:
    """The answers for a newcomer.

    Args:
        cameras: what was measured.
        document: document of the comparison so far.
        seconds: time that the comparison took, s.
    """
    kinds = len({camera.seconds for camera in cameras if camera.seconds})
    done = (
        f"{amount(document['duration_s'], 's')} of the scene {document['scene']} were recorded by "
        f"{kinds} simulated cameras, each with the same light on a pixel. {len(cameras)} images of "
        f"one instant, at {number(document['instant_ms'], 4)} ms, are compared; the spike camera "
        "has two, by the two usual ways to compute an image from spikes: TFI and TFP."
    )
    return [
        ("What was compared", paragraph(done)),
        ("How good the cameras are", cards(_best(cameras)) + paragraph(
            "The best value of each figure, and whose it is. No camera is best in all: what is "
            "sharp in motion is noisy, and what is quiet blurs. All figures are in the table."
        )),
        ("How wrong the comparison may be", _wrong(cameras)),
        ("How long it took", big(elapsed(seconds), _slowest(cameras))),
        ("What was left out", paragraph(_left_out(cameras))),
        ("Notes", listed(document["notes"])),
    ]  # fmt: skip


def _best(cameras: list[Camera]) -> list[Card]:
    rows: list[Card] = []
    for name, what, highest, text in _BEST:
        known = [
            (value, camera.title) for camera in cameras
            if (value := camera.figures[name].value) is not None and math.isfinite(value)
        ]  # fmt: skip
        if known:
            value, title = (max if highest else min)(known)
            rows.append(("first", text(value), f"{what}: {title}"))
    return rows


def _wrong(cameras: list[Camera]) -> str:
    off = [
        abs(decibels(point.measured) - decibels(point.formula))
        for camera in cameras for point in camera.snr
        if point.formula and point.measured > 0
    ]  # fmt: skip
    text = (
        "Each camera was simulated with every effect, so nothing is missing by choice. Each image "
        "is a single one: with another seed, noise and PSNR differ a little."
    )
    if not off:
        return paragraph(text)
    off.sort()
    return big(
        f"{number(off[len(off) // 2], 2)} dB",
        f"Half of {count(len(off))} measured values of signal over noise are nearer than this to "
        f"the closed form of the pixels; the farthest is off by {number(off[-1], 2)} dB. {text}",
    )


def _slowest(cameras: list[Camera]) -> str:
    slowest = max(cameras, key=lambda camera: camera.seconds)
    return (
        f"Of this, {elapsed(slowest.seconds)} for the slowest camera ({slowest.title}), images and "
        "measurements included."
    )


def _left_out(cameras: list[Camera]) -> str:
    missing = sum(camera.figures[name].value is None for camera in cameras for name in FIGURES)
    text = "No effect of any camera. Pixels of an imager beyond the scene were not simulated."
    if missing:
        text += (
            f" {count(missing)} of {count(len(cameras) * len(FIGURES))} figures cannot be measured "
            "in this scene, or do not exist for the camera: a dash stands for each."
        )
    return text
