"""Error-rate curves of a link: theory, and Monte Carlo trials with their intervals."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, Final, get_args

import numpy as np
import numpy.typing as npt

from link.theory import (
    JUDGED,
    Convention,
    PixelChannel,
    Reset,
    amplitude_of,
    awgn_ook,
    burst_byte_error,
    burst_word_error,
    charge_errors,
    clopper_pearson,
    gamma_gamma,
    gamma_gamma_ook,
    log_normal_ook,
    log_normal_sigma,
    pointwise_level,
    poisson_threshold,
    rs_word_error,
    scintillation_index,
)
from link.theory.trials import (
    awgn_trials,
    burst_word_trials,
    charge_trials,
    gamma_gamma_trials,
    log_normal_trials,
    poisson_trials,
    rs_word_trials,
)

LEVEL: Final = 0.99
"""Probability that all judged points of a document are inside their intervals if theory is
correct."""
WANTED, LEAST, MOST = 400, 20_000, 2_000_000
"""WANTED: expected errors that the number of trials of a point is chosen for. LEAST, MOST: limits
of the trials."""
STREAMS: Final = 256
"""Streams of random numbers of a curve, and so its largest number of points."""
Q: Final = 100
"""Threshold, electrons."""
DATA, WORD = 223, 255
BURST, DEPTH = 16, 128
"""BURST: bytes of a burst. DEPTH: codewords of an interleaver's block."""
RYTOV: Final = 0.2
ALPHA, BETA = 4.0, 1.9

Trial = Callable[[int, int, int, int], int]
"""(point, trials, seed, stream) -> errors."""


@dataclass(frozen=True)
class Curve:
    """A curve of an error rate.

    Attributes:
        name, title: name for the document, and title for a reader.
        x, x_unit: points.
        theory: error rate at the points.
        trial: counts errors.
        panel: part of the figure.
        least, most: limits of the trials of a point.
        unit: unit of a trial.
        other: rates of a theory that must be refuted.
        other_name: name of that theory.
    """

    name: str
    title: str
    x: list[float]
    x_unit: str
    theory: list[float]
    trial: Trial
    panel: str
    least: int = LEAST
    most: int = MOST
    unit: str = "bit"
    other: list[float] = field(default_factory=list)
    other_name: str = ""


def _slot(points: int) -> Curve:
    """Curve of a tick that begins with no charge."""
    level, off = np.linspace(1.05, 1.45, points), 0.7 * Q
    p01, p10 = poisson_threshold(Q, level * Q, off)

    def trial(i: int, trials: int, seed: int, stream: int) -> int:
        return poisson_trials(Q, level[i] * Q, off, trials, seed, stream)

    title = f"one slot, Q = {Q} e, OFF {off:g} e"
    theory = ((p01 + p10) / 2).tolist()
    return Curve("poisson-threshold", title, level.tolist(), "ON / Q", theory, trial, "poisson")


def _charge(points: int, reset: Reset) -> Curve:
    """Curve of a pixel that carries charge from tick to tick, ON 1.4 Q over the background."""
    share = np.geomspace(0.02, 0.2, points)

    def channel(background: float) -> PixelChannel:
        return PixelChannel(reset, Q, (1.4 + background) * Q, background * Q)

    errors = [sum(charge_errors(channel(b))) / 2 for b in share.tolist()]
    warm, least, most = (400, 2_000, 4_000) if reset == "subtract" else (24, 10_000, 400_000)

    def trial(i: int, trials: int, seed: int, stream: int) -> int:
        return charge_trials(channel(share[i]), trials, seed, stream, warm)

    return Curve(
        f"reset-{reset}", f"{reset} reset, Q = {Q} e, ON 1.4 Q + OFF", share.tolist(), "OFF / Q",
        errors, trial, "reset", least, most,
    )  # fmt: skip


def _keyed(points: int, convention: Convention) -> list[Curve]:
    """Curves of on-off keying in Gaussian noise under three laws of fading.

    They are over the signal-to-noise ratio of a convention.
    """
    sigma = float(log_normal_sigma(scintillation_index(*gamma_gamma(RYTOV))))
    laws: list[tuple[str, str, float, Callable[..., Any], Callable[..., int], tuple[float, ...]]]
    laws = [
        ("awgn", "no fading", 16.0, awgn_ook, awgn_trials, ()),
        ("log-normal", f"log-normal, Rytov variance {RYTOV:g}", 24.0, log_normal_ook,
         log_normal_trials, (sigma,)),
        ("gamma-gamma", f"gamma-gamma, α {ALPHA:g}, β {BETA:g}", 36.0, gamma_gamma_ook,
         gamma_gamma_trials, (ALPHA, BETA)),
    ]  # fmt: skip
    curves = []
    for name, law_title, most, theory, trials, law in laws:
        snr = np.linspace(0, most, points)
        amplitude = amplitude_of(snr, convention)
        curves.append(
            Curve(
                f"{name}-{convention}", f"{law_title}, {convention} SNR", snr.tolist(), "dB",
                theory(amplitude, *law).tolist(), _by_amplitude(amplitude, trials, law), "fading",
            )
        )  # fmt: skip
    return curves


def _by_amplitude(
    amplitude: npt.NDArray[np.float64], trials: Callable[..., int], law: tuple[float, ...]
) -> Trial:
    def trial(i: int, bits: int, seed: int, stream: int) -> int:
        return trials(float(amplitude[i]), *law, bits, seed, stream)

    return trial


def _words(points: int) -> list[Curve]:
    """Curves of RS(255, 223) codewords.

    Errors are scattered, or as many in bursts, with and without an interleaver.
    """
    p = np.linspace(0.035, 0.075, points)
    start = -np.expm1(np.log1p(-p) / BURST)
    scattered = rs_word_error(WORD, DATA, p).tolist()
    interleaved = rs_word_error(WORD, DATA, burst_byte_error(start, BURST)).tolist()
    plain = [burst_word_error(WORD, DATA, float(s), BURST) for s in start]

    def alone(i: int, words: int, seed: int, stream: int) -> int:
        return rs_word_trials(WORD, DATA, float(p[i]), words, seed, stream)

    def bursts(depth: int) -> Trial:
        def trial(i: int, words: int, seed: int, stream: int) -> int:
            return burst_word_trials(
                WORD, DATA, float(start[i]), BURST, depth, words, seed, stream
            )  # fmt: skip

        return trial

    def curve(name: str, title: str, theory: list[float], trial: Trial, most: int) -> Curve:
        return Curve(
            name, f"RS({WORD},{DATA}), {title}", p.tolist(), "byte error rate", theory, trial,
            "words", 1_000, most, "codeword",
            *((scattered, "as if errors were scattered") if trial is unmixed else ()),
        )  # fmt: skip

    unmixed = bursts(1)
    return [
        curve("rs-scattered", "scattered errors, decoded", scattered, alone, 60_000),
        curve(
            "rs-bursts-interleaved", f"bursts of {BURST} bytes, {DEPTH} codewords interleaved",
            interleaved, bursts(DEPTH), 12_000,
        ),
        curve("rs-bursts-plain", f"bursts of {BURST}, no interleaver", plain, unmixed, 10_000),
    ]  # fmt: skip


def error_curves(points: int) -> list[Curve]:
    """All curves. points: of each curve, 2 to 256."""
    if not 2 <= points <= STREAMS:
        raise ValueError(f"points must be 2 to {STREAMS}, not {points}")
    curves = [_slot(points), *(_charge(points, reset) for reset in get_args(Reset))]
    for convention in get_args(Convention):
        curves += _keyed(points, convention)
    return [*curves, *_words(points)]


def measure_curves(
    curves: list[Curve], seed: int, report: Callable[[str], None] | None = None
) -> dict[str, Any]:
    """Document {curves, level, points_judged, pointwise_level, holds, seed}.

    The number of trials of a point follows from theory alone, so that the count is binomial: for
    400 expected errors, within the curve's limits. Points with 100 errors or more are judged. All
    intervals are Clopper-Pearson intervals at 1 - 0.01 / (points judged), so that all judged points
    hold together at 99 % (Bonferroni). `beside.refuted`: judged points whose interval excludes the
    other theory.

    Args:
        curves: curves to measure.
        seed: seed of the trials.
        report: called with the title of each curve as it begins.
    """
    counted = []
    for number, curve in enumerate(curves, 1):
        if report is not None:
            report(curve.title)
        row = []
        for i, p in enumerate(curve.theory):
            wanted = int(min(np.ceil(WANTED / max(p, 1e-9)), curve.most))
            trials = max(wanted, curve.least)
            row.append((curve.trial(i, trials, seed, STREAMS * number + i), trials))
        counted.append(row)
    judged = sum(errors >= JUDGED for row in counted for errors, _ in row)
    level = pointwise_level(LEVEL, judged)
    documents = [_document(c, row, level) for c, row in zip(curves, counted, strict=True)]
    return {
        "curves": documents, "level": LEVEL, "points_judged": judged, "pointwise_level": level,
        "holds": all(
            inside or not counts
            for d in documents for inside, counts in zip(d["inside"], d["judged"], strict=True)
        ),
        "seed": seed,
    }  # fmt: skip


def _document(curve: Curve, counted: list[tuple[int, int]], level: float) -> dict[str, Any]:
    errors, trials = (np.array(x) for x in zip(*counted, strict=True))
    low, high = clopper_pearson(errors, trials, level)
    theory, counts = np.array(curve.theory), errors >= JUDGED
    out: dict[str, Any] = {
        "name": curve.name, "title": curve.title, "x": curve.x, "x_unit": curve.x_unit,
        "theory": curve.theory, "measured": (errors / trials).tolist(), "low": low.tolist(),
        "high": high.tolist(), "errors": errors.tolist(), "bits": trials.tolist(),
        "trial": curve.unit, "judged": counts.tolist(),
        "inside": ((low <= theory) & (theory <= high)).tolist(), "panel": curve.panel,
    }  # fmt: skip
    if curve.other:
        other = np.array(curve.other)
        refuted = counts & ((other < low) | (other > high))
        out["beside"] = {
            "name": curve.other_name, "theory": curve.other, "refuted": refuted.tolist(),
        }  # fmt: skip
    return out
