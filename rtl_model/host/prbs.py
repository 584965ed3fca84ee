"""Pseudo-random words over the line, both ways, and how many bits of them are wrong."""

from __future__ import annotations

from typing import NamedTuple

from cosim import InputError
from rtl_model.host.board import Board
from rtl_model.host.faults import Cause, LineFault
from rtl_model.prbs import ORDERS, Prbs

__all__ = ["ORDERS", "PrbsReport", "check"]

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


def check(board: Board, order: int, words: int) -> PrbsReport:
    """Reads `words` words of the board's sequence and sends it as many.

    order: 7, 15, 23 or 31. LineFault where the line breaks off more than three times.
    """
    if order not in ORDERS:
        raise InputError("the order of a PRBS", "7, 15, 23 or 31", str(order), "choose one")
    bone = board.bone
    begun = bone.port.now()
    source = board.csr.register("prbs_source").address
    wrong = faults = got = 0
    board.write("prbs_order", order)
    own = Prbs(order)
    while got < words:
        count = min(bone.words_at_once, words - got)
        try:
            values = bone.read(source, count, fixed=True)
        except LineFault as fault:
            faults += 1
            if faults > _FAULTS or fault.cause in (Cause.GONE, Cause.ECHO, Cause.DIFFERS):
                raise
            board.write("prbs_order", order)  # where the sequence stands is not known: anew
            own = Prbs(order)
            continue
        wrong += sum((value ^ own.word()).bit_count() for value in values)
        got += count
    board.write("prbs_order", order)
    own = Prbs(order)
    bone.write(
        board.csr.register("prbs_check").address, [own.word() for _ in range(words)], fixed=True
    )
    board.forget_counters()
    checked = board.read_twice("prbs_checked")
    return PrbsReport(
        order=order,
        words=words,
        bits_wrong_from_board=wrong,
        bits_wrong_to_board=board.read_twice("prbs_errors"),
        words_lost_to_board=words - checked,
        faults=faults,
        seconds=bone.port.now() - begun,
    )
