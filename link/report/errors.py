"""The report's section on raw bit errors: theory, eye diagram and soft values."""

from __future__ import annotations

from pathlib import Path

from cosim.config.amounts import count, number, percent
from cosim.report.parts import plot
from link.evaluation.errors import Errors
from link.evaluation.eye import RARE
from link.evaluation.record import LinkEvaluation, Theory
from link.report.figures import errors_figure
from link.report.signal_figures import eye_figure, soft_figure

_CHANCE = 1e-3
"""Probability of so many errors in the last symbol below which they are reported."""


def errors_section(link: LinkEvaluation, figures: Path) -> str:
    """Section; writes its figures."""
    path, theory = figures / "errors.png", link.theory
    data = errors_figure(link, path)
    span = ""
    if theory.interval is not None:
        low, high = (number(end, 2) for end in theory.interval)
        span = f", 99.9 % interval {low} to {high}"
    return (
        f"<h2>Errors</h2><p>{count(link.errors.wrong)} of {count(link.errors.bits)} bits on data "
        f"cells were decided wrongly before any code{span}. The rate according to the soft values "
        "is the mean of 1/(1 + exp |L|) over all of them: their error rate if they were exact. "
        "They take a cell's pixels and ticks as independent, although neighbouring cells "
        "illuminate all of them; the receiver reduces them by a factor estimated from the "
        f"training. {theory_text(link.theory)}{end_text(link.errors)}</p>"
        + plot(path, "raw bit error rates: measured, by the soft values, by theory", data)
        + _eye(link, figures) + _soft(link, figures)
    )  # fmt: skip


def _eye(link: LinkEvaluation, figures: Path) -> str:
    eye = link.eye
    if eye is None:
        return ""
    path = figures / "eye.png"
    data = eye_figure(eye, path)
    text = (
        f"Without {percent(RARE)} of the traces of each bit it is {number(eye.height)} high and "
        f"{number(eye.width)} ticks wide; its middle level is {number(eye.level)}."
        if eye.height > 0
        else f"It is closed: without {percent(RARE)} of the traces of each bit, on and off overlap "
        f"by {number(abs(eye.height))}."
    )
    span = "one tick" if link.mode.ticks == 1 else f"{link.mode.ticks} ticks"
    at = " to ".join(number(tick, 2, sign=True) for tick in eye.sampled)
    return (
        f"<h3>The eye</h3><p>{count(eye.traces)} symbols of data cells, from the recording: spikes "
        "of a cell's pixels, each weighted by the cell's share of its light, "
        f"mean of a window of {span} that slides past the symbol, 1 if all fire. "
        "The phase of a symbol within the camera's ticks differs by row and, because of the "
        "clock offset, by symbol; traces are linear between ticks. "
        f"The window nearest to a symbol lies {at} ticks from its middle. {text} Detectors weight "
        "each tick by its information and use the preceding ones, and make fewer errors than this "
        "sum.</p>"
        + plot(path, "eye diagram: density of the received symbols, and the opening", data)
    )


def _soft(link: LinkEvaluation, figures: Path) -> str:
    if link.soft is None or not link.soft.soft.size:
        return ""
    path = figures / "soft.png"
    data = soft_figure(link.soft, path)
    return (
        f"<h3>Soft values</h3><p>Soft values of {count(link.soft.soft.size)} symbols, by the bit "
        "that was sent. A value on the wrong side of 0 is a wrong decision. Values are clipped at "
        "the detector's limit, so the outermost bins may be high.</p>"
        + plot(path, "histogram of soft values by the bit that was sent", data)
    )


def theory_text(theory: Theory) -> str:
    """What the theory includes, and what it leaves out."""
    span = theory.closed_interval
    if theory.closed is None:
        return (
            "There is no theoretical rate: the closed forms do not model a panel that is hidden, "
            "out of view, mirrored or off its clock, nor rates that underflow."
        )
    if span is None:
        return (
            "The theory is a coarse estimate, the Bhattacharyya bound for independent observations "
            "with normal light of the neighbours: the run may have many times more errors."
        )
    return (
        "The theory uses the exact law of spikes under random light of neighbouring and previous "
        f"cells, 99.9 % limits of the draws {number(span[0], 2)} to {number(span[1], 2)}. It takes "
        "position, phase and the laws of spikes as known, and leaves out turbulence, fog blur and "
        "fixed pattern."
    )


def end_text(errors: Errors) -> str:
    """A sentence on errors in the transmission's last symbol, if there are significantly many.

    A duration that cuts the transmission leaves darkness after that symbol.
    """
    from scipy.special import pdtrc

    rest = errors.bits - errors.bits // max(errors.symbols, 1)
    if not errors.at_end or not rest:
        return ""
    others = errors.wrong - errors.at_end
    if pdtrc(errors.at_end - 1, (others + 1) / (errors.symbols - 1)) > _CHANCE:
        return ""
    return (
        f" {count(errors.at_end)} of the wrong bits are of the transmission's last symbol, more "
        f"than of others; without that symbol {number(others / rest, 2)} are wrong."
    )
