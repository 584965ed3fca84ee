"""What a link's report says of its raw bit errors beside theory."""

from __future__ import annotations

from scenarios.link_run.errors import Errors
from scenarios.link_run.finished import Theory

__all__ = ["of_end", "of_theory"]


def of_theory(theory: Theory) -> str:
    """What the theory beside the measured rate is, and what it leaves out."""
    span = theory.closed_interval
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
    """How many errors are of the transmission's last symbol; nothing where none is."""
    rest = errors.bits - errors.bits // max(errors.symbols, 1)
    if not errors.at_end or not rest:
        return ""
    return (
        f" {errors.at_end:,} of the wrong bits are of the transmission's last symbol, which has "
        "darkness behind it, as neither the training nor the theory has; without that symbol "
        f"{(errors.wrong - errors.at_end) / rest:.2g} are wrong."
    )
