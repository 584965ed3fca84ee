"""Measures bit errors of the line with pseudo-random words in both directions."""

from __future__ import annotations

from typing import NamedTuple

from cosim import InputError
from rtl_model.host.board import Board
from rtl_model.host.faults import LineFault
from rtl_model.host.uartbone import FINAL
from rtl_model.prbs import ORDERS, Prbs

_FAULTS = 3  # most interrupted answers of one measurement over a serial line
_MISMATCHES = 2  # wrong blocks over UDP in a row that are read again
_IN_A_ROW = 8  # most consecutive ones over UDP, which may lose any packet


class PrbsReport(NamedTuple):
    """Bit errors of the line.

    Attributes:
        order: order of the sequence.
        words: number of words sent in each direction.
        bits_wrong_from_board, bits_wrong_to_board: wrong bits of the received words.
        words_lost_to_board: words that did not arrive.
        faults: interrupted answers, after each of which the sequence was restarted.
        seconds: duration, s.
    """

    order: int
    words: int
    bits_wrong_from_board: int
    bits_wrong_to_board: int
    words_lost_to_board: int
    faults: int
    seconds: float

    @property
    def clean(self) -> bool:
        """Whether every bit was right at the first attempt."""
        wrong = self.bits_wrong_from_board + self.bits_wrong_to_board
        return wrong == self.words_lost_to_board == self.faults == 0


class Exchanged(NamedTuple):
    """Result of an exchange in both directions.

    Attributes:
        wrong: wrong bits of each word from the board, as 1s.
        checked: words that the board has compared with its own sequence.
        errors: wrong bits in these.
        faults: interrupted answers, after each of which the sequence was restarted.
    """

    wrong: list[int]
    checked: int
    errors: int
    faults: int


def exchange(board: Board, order: int, words: int, *, faults: int = 0) -> Exchanged:
    """Reads words of the board's sequence, and sends it the same number.

    Args:
        board: a Viform board.
        order: order of the sequence.
        words: number of words in each direction.
        faults: most interrupted answers over a serial line; the LineFault of the next one is
            raised.
    """
    bone = board.bone
    source = board.csr.register("prbs_source").address
    wrong: list[int] = []
    interrupted = in_a_row = mismatches = 0
    board.write("prbs_order", order)
    sequence = Prbs(order)
    while len(wrong) < words:
        count = min(bone.words_at_once, words - len(wrong))
        try:
            values = bone.read(source, count, fixed=True)
            bits = [value ^ sequence.word() for value in values]
            # A datagram that arrived twice has read the source twice, but hardly three times.
            doubtful = bone.confirms and any(bits) and mismatches < _MISMATCHES
            mismatches += doubtful
        except LineFault as fault:
            if (interrupted >= faults and not bone.confirms) or fault.cause in FINAL:
                raise
            if in_a_row >= _IN_A_ROW:
                raise
            doubtful = True
        if doubtful:
            interrupted, in_a_row = interrupted + 1, in_a_row + 1
            board.write("prbs_order", order)  # the position in the sequence is unknown: restart
            sequence = Prbs(order)
            continue
        wrong += bits
        in_a_row = mismatches = 0
    board.write("prbs_order", order)
    sequence = Prbs(order)
    bone.write(
        board.csr.register("prbs_check").address,
        [sequence.word() for _ in range(words)],
        fixed=True,
    )
    board.forget_counters()
    checked = board.read_twice("prbs_checked")
    return Exchanged(wrong, checked, board.read_twice("prbs_errors"), interrupted)


def check(board: Board, order: int, words: int) -> PrbsReport:
    """Counts wrong bits of words in both directions.

    Args:
        board: a Viform board.
        order: order of the sequence, 7, 15, 23 or 31.
        words: number of words in each direction.

    Raises:
        InputError: for another order.
        LineFault: if more than three answers are interrupted.
    """
    if order not in ORDERS:
        raise InputError("the order of a PRBS", "7, 15, 23 or 31", str(order), "choose one")
    begun = board.bone.port.now()
    result = exchange(board, order, words, faults=_FAULTS)
    return PrbsReport(
        order=order,
        words=words,
        bits_wrong_from_board=sum(word.bit_count() for word in result.wrong),
        bits_wrong_to_board=result.errors,
        words_lost_to_board=words - result.checked,
        faults=result.faults,
        seconds=board.bone.port.now() - begun,
    )
