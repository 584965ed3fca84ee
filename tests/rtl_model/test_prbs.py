"""PRBS against the properties of maximal sequences, and the registers that send and check them."""

import numpy as np
import pytest

from rtl_model.cycle import System
from rtl_model.prbs import TAPS, Prbs
from rtl_model.registers import REGISTERS

ADDRESS = {register.name: register.address for register in REGISTERS}


@pytest.mark.parametrize("order", [7, 15])
def test_period_and_balance(order):
    """A maximal sequence has period 2^n - 1, 2^(n-1) ones, and each window of n bits once."""
    period = (1 << order) - 1
    bits = np.array(Prbs(order).bits(2 * period + order))
    np.testing.assert_array_equal(bits[period : 2 * period], bits[:period])
    windows = np.lib.stride_tricks.sliding_window_view(bits, order)[:period] @ (
        1 << np.arange(order)
    )
    assert np.array_equal(np.sort(windows), np.arange(1, period + 1))
    assert bits[:period].sum() == 1 << (order - 1)


@pytest.mark.parametrize("order", [7, 15, 23, 31])
def test_linear_recurrence(order):
    """b(t) = b(t - 1 - first tap) xor b(t - 1 - second tap), from a state of all ones."""
    sent = np.array([1] * order + Prbs(order).bits(2000))
    first, second = TAPS[order]
    t = np.arange(order, sent.size)
    np.testing.assert_array_equal(sent[t], sent[t - 1 - first] ^ sent[t - 1 - second])


def test_first_words():
    """x^31 + x^28 + 1 from all ones: 28 zeros, then the first three ones, then a zero."""
    assert Prbs(31).word() == 0b1110
    assert Prbs(3).order == 31


@pytest.mark.parametrize("order", [7, 15, 23, 31])
def test_the_registers_give_and_check(order):
    system = System()
    system.write(ADDRESS["prbs_order"], order)
    truth = Prbs(order)
    for flipped in (0, 0, 0x80000001, 0, 0xFFFFFFFF):
        word = truth.word()
        assert system.read(ADDRESS["prbs_source"]) == word
        system.write(ADDRESS["prbs_check"], word ^ flipped)
    assert system.read(ADDRESS["prbs_checked"]) == 5
    assert system.read(ADDRESS["prbs_errors"]) == 34
    system.write(ADDRESS["prbs_order"], order)
    assert system.read(ADDRESS["prbs_source"]) == Prbs(order).word()
    assert system.read(ADDRESS["prbs_checked"]) == 0
