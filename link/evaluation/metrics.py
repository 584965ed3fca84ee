"""The metrics of a link's run, among them the share of words and frames that it is expected to
lose.

The expected share is known for LDPC modes. It follows from the information of the run's soft
values, as `link.theory.words` has it for signs in white noise. It is not known
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

import numpy as np

from cosim.run.result import Metric
from link.coding import blocks_of
from link.evaluation.record import LinkEvaluation
from link.mode import Mode
from link.plan.check import LinkCheck
from link.receiving import Received
from link.setup.locking.loop import ClockLock
from link.setup.setup import FileLinkSetup
from link.theory import ldpc_word_error
from link.theory.soft_information import SoftInformation

_OFF: Final = 0.002
"""Information, bits, by which the table of `ldpc_words` may be off (its tests hold this)."""
_STILL: Final = 1 / 16
"""Ticks that symbols may move within the tick in a run of one information."""
_OUTSIDE: Final = 0.0005
"""Share of runs below the limits, and above them."""
_NOT_READ: Final = "the receiver found no symbols, or its detector gives no soft values"
_NO_BITS: Final = "no codeword was verified, so no bit could be compared"
_NO_LAW: Final = (
    "no closed form covers the cause of the failure, or the limits of this mode, or it underflows"
)
_NO_EYE: Final = "no symbol was read"
_NO_SHARE: Final = "no words of an ldpc code of a fixed rate were read in the mode that was sent"
_NO_CHECK: Final = "the plan leaves out nothing, or nothing was read: no check on patches"
_FREE: Final = "no clock was locked: link.sensor.clock_steering, or its reset, has none"
"""Why a metric is unknown."""


def link_metrics(link: LinkEvaluation, camera_s: float) -> dict[str, Metric]:
    """Metrics by name. camera_s: wall time of air and camera, s."""
    setup, received, theory, rates = link.setup, link.received, link.theory, link.rates
    sent = _frames_sent_meanwhile(setup, received)
    lost = max(sent - received.frames_right, 0)
    low, high = theory.interval or (None, None)
    repair, fill = setup.sent.outbox.frames_beyond(setup.sent.groups)
    information, least, most = link.information_bps
    words_lost, frames_lost = _expected(link, sent)
    delays, eye, full_ns = link.delays, link.eye, link.check.full_ns
    full_s = None if full_ns is None else full_ns * 1e-9 * setup.pixel_cycles
    return {
        "raw_bps": Metric(rates.raw, "bit/s"),
        "information_bps": Metric(information, "bit/s", _NOT_READ),
        "information_low": Metric(least, "bit/s", _NOT_READ),
        "information_high": Metric(most, "bit/s", _NOT_READ),
        "coded_bps": Metric(rates.coded, "bit/s"),
        "goodput_bps": Metric(rates.goodput, "bit/s", "the file did not arrive"),
        "capacity_bps": Metric(link.capacity, "bit/s", "the panel is not wholly in view"),
        "ber": Metric(link.errors.rate, "1", _NO_BITS),
        "ber_low": Metric(low, "1", _NO_BITS),
        "ber_high": Metric(high, "1", _NO_BITS),
        "ber_theory": Metric(theory.closed, "1", _NO_LAW),
        "ber_theory_low": Metric(
            theory.closed_interval and theory.closed_interval[0], "1", _NO_LAW
        ),
        "ber_theory_high": Metric(
            theory.closed_interval and theory.closed_interval[1], "1", _NO_LAW
        ),
        "ber_soft": Metric(theory.soft, "1", "the detector has given no soft values"),
        "bits_compared": Metric(link.errors.bits, "bits"),
        "fer": Metric(lost / sent if sent else None, "1", "no frame was sent meanwhile"),
        **_limits("fer_theory", frames_lost),
        "frames_sent": Metric(setup.sent.outbox.frames_by(setup.sent.groups), "frames"),
        "frames_received": Metric(received.frames_right, "frames"),
        "frames_lost": Metric(lost, "frames"),
        "frames_needed": Metric(received.frames_needed, "frames", "the file did not arrive"),
        "frames_repair": Metric(repair, "frames"),
        "frames_fill": Metric(fill, "frames"),
        "eye_height": Metric(None if eye is None else eye.height, "1", _NO_EYE),
        "eye_width": Metric(None if eye is None else eye.width, "ticks", _NO_EYE),
        "latency_us": Metric(
            float(np.median(delays)) / 1e6 if delays.size else None, "us", "no frame arrived"
        ),
        "file_bytes": Metric(len(setup.payload.data), "bytes"),
        "cell": Metric(setup.mode.cell, "panel pixels"),
        "ticks": Metric(setup.mode.ticks, "panel planes"),
        "parity": Metric(
            setup.mode.parity, "bytes", "the words have an ldpc code, and no Reed-Solomon parity"
        ),
        "code_rate": Metric(setup.sent.outbox.word_rate, "1"),
        "words": Metric(received.codewords, "words"),
        "words_lost": Metric(received.codewords_wrong, "words"),
        **_limits("words_theory", words_lost),
        "decoder_rounds": Metric(
            _rounds(received), "rounds/word", "no word was read, or its code has no rounds"
        ),
        "f_number": Metric(setup.setting.optics.f_number, "1"),
        "goodput_error": Metric(
            link.check.goodput if link.delivered else None,
            "1",
            "the file did not arrive, or nothing is left out",
        ),
        "full_physics": Metric(full_s, "s", "nothing is left out, so full physics was not timed"),
        **_check_metrics(link.check),
        "camera": Metric(camera_s, "s"),
    }


def lock_metrics(lock: ClockLock | None) -> dict[str, Metric]:
    """Metrics of a locked clock, unknown without one: rms and largest true phase of the planes over
    the run, and the ticks that the loop took to lock before it."""
    return {
        "phase_error": Metric(None if lock is None else lock.rms, "ticks", _FREE),
        "phase_error_most": Metric(None if lock is None else lock.most, "ticks", _FREE),
        "lock_ticks": Metric(None if lock is None else lock.acquired, "ticks", _FREE),
    }


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


def _expected(link: LinkEvaluation, frames: int) -> tuple[LostShare, LostShare]:
    """Expected shares of lost words, and of lost frames of `frames`."""
    received, mode, timing = link.received, link.mode, link.received.timing
    if timing is None or received.mode != mode or mode.rate is None:
        return LostShare(), LostShare()
    form = blocks_of(link.layout)
    drift = (timing.period - mode.ticks) * link.setup.sent.symbols
    given = mode, 8 * form.data_bytes, link.information, drift
    words = lost_share(*given, received.codewords)
    return words, lost_share(*given, frames, form.frame_words)


def _limits(name: str, share: LostShare) -> dict[str, Metric]:
    """Metrics of an expected share."""
    return {
        name: Metric(share.value, "1", _NO_SHARE),
        f"{name}_low": Metric(share.low, "1", _NO_SHARE),
        f"{name}_high": Metric(share.high, "1", _NO_SHARE),
    }


def _rounds(received: Received) -> float | None:
    """Mean number of decoding rounds of a word; None for a code without rounds."""
    if received.mode is None or received.mode.parity is not None or not received.codewords:
        return None
    return received.rounds / received.codewords


def _frames_sent_meanwhile(setup: FileLinkSetup, received: Received) -> int:
    """Number of frames that were sent before the receiver stopped.

    It stops as soon as the file is complete; later frames are not lost.
    """
    groups = setup.sent.groups
    if received.whole and received.instants:
        groups = min(groups, max(instant.group for instant in received.instants) + 1)
    return setup.sent.outbox.frames_by(groups)


def _check_metrics(check: LinkCheck) -> dict[str, Metric]:
    """Number of bits of the error's measurement, and of those decided differently."""
    paired = check.paired
    near = None if paired is None else paired.near
    bits = "bits"
    paired_figures = {
        "check_bits": (None if paired is None else paired.bits, bits),
        "check_otherwise": (None if paired is None else paired.more + paired.fewer, bits),
        "check_otherwise_high": (None if paired is None else paired.differing_limit, "1"),
        "check_counted_high": (None if paired is None else paired.counted.high, "half-widths"),
        "check_near": (None if near is None else near.count, bits),
        "check_near_otherwise": (None if near is None else near.more + near.fewer, bits),
    }
    reason = _NO_CHECK if paired is None else "wrong bits alone are counted"
    return {name: Metric(*figure, reason) for name, figure in paired_figures.items()}


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
