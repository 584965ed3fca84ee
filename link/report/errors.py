"""The section on raw bit errors: beside theory, the eye, and soft values."""

from __future__ import annotations

from pathlib import Path

from cosim.report.parts import plot
from link.evaluation.errors import Errors
from link.evaluation.eye import RARE
from link.evaluation.record import LinkEvaluation, Theory
from link.report.figures import errors_figure
from link.report.signal_figures import eye_figure, soft_figure

__all__ = ["end_text", "errors_section"]

_CHANCE = 1e-3
"""Of so many errors in the last symbol, below which they are told apart."""


def errors_section(link: LinkEvaluation, figures: Path) -> str:
    path, theory = figures / "errors.png", link.theory
    errors_figure(link, path)
    span = ""
    if theory.interval is not None:
        span = f", 99.9 % interval {theory.interval[0]:.2g} to {theory.interval[1]:.2g}"
    return (
        f"<h2>Errors</h2><p>{link.errors.wrong:,} of {link.errors.bits:,} bits on data cells were "
        f"decided wrong before any code{span}. The soft values' own promise is the mean of "
        "1/(1 + exp |L|) over all of them: what they would be wrong by if they were the truth. "
        "They take a cell's pixels and ticks as independent of each other, though the cells beside "
        "light them together; the receiver shrinks them by the factor that the training asks for. "
        f"{theory_text(link.theory)}{end_text(link.errors)}</p>"
        + plot(path, "bit error rates") + _eye(link, figures) + _soft(link, figures)
    )  # fmt: skip


def _eye(link: LinkEvaluation, figures: Path) -> str:
    eye = link.eye
    if eye is None:
        return ""
    path = figures / "eye.png"
    eye_figure(eye, path)
    text = (
        f"With {RARE:.0%} of each bit left aside it is {eye.height:.3f} high and {eye.width:.3g} "
        f"ticks wide; the level half-way is {eye.level:.3f}."
        if eye.height > 0
        else f"It is closed: with {RARE:.0%} of each bit left aside, on and off overlap by "
        f"{abs(eye.height):.3f}."
    )
    at = " to ".join(f"{tick:+.2f}" for tick in eye.sampled)
    return (
        f"<h3>The eye</h3><p>{eye.traces:,} symbols of data cells, from the recording: spikes of "
        "the pixels that see a cell, each weighted by the share of its light that is the cell's, "
        f"mean of a window of {link.mode.ticks} ticks as it slides past the symbol, 1 where all "
        "fire. The camera sees whole ticks; where a symbol begins between them differs by row and, "
        "with the clocks' offset, by symbol; in between traces are drawn straight. "
        f"The window nearest to a symbol lies {at} ticks from its middle. {text} Detectors weigh "
        "each tick by what it tells, and by what came before, and err less than this sum.</p>"
        + plot(path, "eye diagram")
    )


def _soft(link: LinkEvaluation, figures: Path) -> str:
    if link.soft is None or not link.soft.soft.size:
        return ""
    path = figures / "soft.png"
    soft_figure(link.soft, path)
    return (
        f"<h3>Soft values</h3><p>What the detector made of {link.soft.soft.size:,} symbols, by "
        "what was sent: how sure it was, and how seldom in vain. What lies on the wrong side of 0 "
        "was decided wrong; a value is cut at what a detector gives at most, so the outermost bins "
        "may stand high.</p>" + plot(path, "histogram of soft values")
    )


def theory_text(theory: Theory) -> str:
    """What the theory beside the measured rate is, and what it leaves out."""
    span = theory.closed_interval
    if theory.closed is None:
        return (
            "What theory would say is not known: its closed forms have no panel that is hidden, "
            "out of view, mirrored or off its clock, and tell no rate too small for a number."
        )
    if span is None:
        return (
            "The theory is a coarse estimate, by Bhattacharyya's bound for looks that err "
            "independently, with the neighbours' light normal: the run may err many times more."
        )
    return (
        "The theory has the exact law of spikes under drawn light of the cells beside and before, "
        f"99.9 % limits of the drawing {span[0]:.2g} to {span[1]:.2g}. It takes place, phase and "
        "the spikes' laws as known, and leaves out turbulence, fog blur and fixed pattern."
    )


def end_text(errors: Errors) -> str:
    """How many errors are of the transmission's last symbol, where they are more than chance brings
    among so many symbols: a duration that cuts the transmission leaves darkness behind it."""
    from scipy.stats import poisson

    rest = errors.bits - errors.bits // max(errors.symbols, 1)
    if not errors.at_end or not rest:
        return ""
    others = errors.wrong - errors.at_end
    if poisson.sf(errors.at_end - 1, (others + 1) / (errors.symbols - 1)) > _CHANCE:
        return ""
    return (
        f" {errors.at_end:,} of the wrong bits are of the transmission's last symbol, more than of "
        f"others; without that symbol {others / rest:.2g} are wrong."
    )
