"""The share of words and frames that a run of an LDPC mode is expected to lose.

It follows from the information of the run's soft values, as `link.theory.ldpc_words` has it for
signs in white noise. It is not known
- without a sample of soft values,
- with Reed-Solomon, whose wrong bytes come in clusters of unknown size,
- with a rate for each block, of which few blocks have any one rate,
- and with symbols that drift through the tick: the information changes from block to block, and the
  share of lost words is not that at its mean.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

from link.mode import Mode
from link.theory import ldpc_word_error
from link.theory.soft_information import SoftInformation

_OFF: Final = 0.002
"""Information, bits, by which the table of `ldpc_words` may be off (its tests hold this)."""
_STILL: Final = 1 / 16
"""Ticks that symbols may move within the tick in a run of one information."""
_OUTSIDE: Final = 0.0005
"""Share of runs below the limits, and above them."""


@dataclass(frozen=True)
class LostShare:
    """Expected share of lost words or frames of a run.

    Attributes:
        value: the share.
        low, high: 99.9 % limits of what a run of this length measures, with the limits of its
            information.
    """

    value: float | None = None
    low: float | None = None
    high: float | None = None


def lost_share(
    mode: Mode, data_bits: int, information: SoftInformation | None, drift: float,
    words: int, together: int = 1,
) -> LostShare:  # fmt: skip
    """Expected share of frames that are lost with any of their words.

    If words fail independently, 1 - (1 - p)^n of the frames of n words are lost. The limits hold
    for any dependence: from p to n p.

    Args:
        mode: mode of the transmission.
        data_bits: data bits of a word.
        information: information of a bit with its soft value.
        drift: drift of the symbols within the tick in the run, ticks.
        words: number of words that were read, or of frames.
        together: words of a frame; 1 for the share of words.
    """
    if mode.rate is None or information is None or abs(drift) > _STILL or not words:
        return LostShare()
    share, most, least = (
        ldpc_word_error(mode.rate, each, data_bits)
        for each in (information.bits, information.low - _OFF, information.high + _OFF)
    )
    low = _quantile(_OUTSIDE, words, least) / words
    high = _quantile(1 - _OUTSIDE, words, min(together * most, 1.0)) / words
    return LostShare(1 - (1 - share) ** together, low, high)


def _quantile(chance: float, count: int, share: float) -> int:
    """The least number of hits, of `count` trials that hit with probability `share` each, that is
    not exceeded with probability `chance`."""
    from scipy.special import bdtr, bdtrik  # scipy.stats, which has it too, takes 0.4 s to load

    if share >= 1:
        return count
    if bdtr(0, count, share) >= chance:  # of no hit; bdtrik has no answer for the least shares
        return 0
    found = math.ceil(bdtrik(chance, count, share))
    return found - 1 if bdtr(found - 1, count, share) >= chance else found
