"""The share of words that a mode's code cannot correct, for a bit error rate."""

from __future__ import annotations

from link.coding import WORD_BYTES
from link.mode import EVERY_RATE, Mode
from link.theory.ldpc_words import ldpc_word_error, sign_information
from link.theory.words import byte_error, rs_word_error


def word_loss(mode: Mode, errors: float) -> float:
    """Share of lost words, for independent bits of this error rate.

    With a low-density parity-check code it is an estimate: the bits are taken for signs in white
    noise, whose information follows from their errors. With a rate for each block it is the loss
    at the lowest one.
    """
    errors = min(errors, 0.5)
    if mode.parity is None:
        rate = min(EVERY_RATE) if mode.rate is None else mode.rate
        return ldpc_word_error(rate, sign_information(errors))
    of_a_byte = round(8 * mode.code.symbols / mode.code.bits)
    return float(rs_word_error(WORD_BYTES, WORD_BYTES - mode.parity, byte_error(errors, of_a_byte)))
