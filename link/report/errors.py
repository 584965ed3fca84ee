"""What a link's report says of its raw bit errors beside theory."""

from __future__ import annotations

from link.evaluation.errors import Errors
from link.evaluation.finished import Theory

__all__ = ["of_end", "of_theory"]

_CHANCE = 1e-3
"""Of so many errors in the last symbol, below which they are told apart."""


def of_theory(theory: Theory) -> str:
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


def of_end(errors: Errors) -> str:
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
