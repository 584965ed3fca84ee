"""Pseudo-random words over the line, both ways, and how many bits of them are wrong."""

from __future__ import annotations

from typing import NamedTuple

from cosim import InputError
from rtl_model.host.board import Board
from rtl_model.host.faults import LineFault
from rtl_model.host.uartbone import FINAL
from rtl_model.prbs import ORDERS, Prbs

__all__ = ["ORDERS", "Exchanged", "PrbsReport", "check", "exchange"]

_FAULTS = 3  # of one run, before the line is said to be too bad to be measured


class PrbsReport(NamedTuple):
    """Words asked for each way; bits wrong in those that came; words that did not come; answers
    that broke off, after which the sequence was begun anew."""

    order: int
    words: int
    bits_wrong_from_board: int
    bits_wrong_to_board: int
    words_lost_to_board: int
    faults: int
    seconds: float

    @property
    def clean(self) -> bool:
        """Whether every bit was right at once."""
        wrong = self.bits_wrong_from_board + self.bits_wrong_to_board
        return wrong == self.words_lost_to_board == self.faults == 0


class Exchanged(NamedTuple):
    """wrong: for each word from the board, its wrong bits as 1s. checked, errors: words that the
    board held against its own sequence, and wrong bits in them. faults: answers that broke off,
    after which the sequence was begun anew."""

    wrong: list[int]
    checked: int
    errors: int
    faults: int


def exchange(board: Board, order: int, words: int, *, faults: int = 0) -> Exchanged:
    """Reads `words` words of the board's sequence and sends it as many. faults: answers that may
    break off before the LineFault of one is raised."""
    bone = board.bone
    source = board.csr.register("prbs_source").address
    wrong: list[int] = []
    broken = 0
    board.write("prbs_order", order)
    own = Prbs(order)
    while len(wrong) < words:
        count = min(bone.words_at_once, words - len(wrong))
        try:
            values = bone.read(source, count, fixed=True)
        except LineFault as fault:
            broken += 1
            if broken > faults or fault.cause in FINAL:
                raise
            board.write("prbs_order", order)  # where the sequence stands is not known: anew
            own = Prbs(order)
            continue
        wrong += [value ^ own.word() for value in values]
    board.write("prbs_order", order)
    own = Prbs(order)
    bone.write(
        board.csr.register("prbs_check").address, [own.word() for _ in range(words)], fixed=True
    )
    board.forget_counters()
    checked = board.read_twice("prbs_checked")
    return Exchanged(wrong, checked, board.read_twice("prbs_errors"), broken)


def check(board: Board, order: int, words: int) -> PrbsReport:
    """Counts wrong bits of `words` words each way.

    order: 7, 15, 23 or 31. LineFault where the line breaks off more than three times.
    """
    if order not in ORDERS:
        raise InputError("the order of a PRBS", "7, 15, 23 or 31", str(order), "choose one")
    begun = board.bone.port.now()
    made = exchange(board, order, words, faults=_FAULTS)
    return PrbsReport(
        order=order,
        words=words,
        bits_wrong_from_board=sum(word.bit_count() for word in made.wrong),
        bits_wrong_to_board=made.errors,
        words_lost_to_board=words - made.checked,
        faults=made.faults,
        seconds=board.bone.port.now() - begun,
    )
