"""Stage prbs: pseudo-random words in both directions; locates wrong bits in the word."""

from __future__ import annotations

from rtl_model.bringup.bench.bench import Bench
from rtl_model.bringup.bench.stage import Figures, StageFault
from rtl_model.host import Board, prbs
from rtl_model.host.prbs import ORDERS

_WORDS = 256  # for each direction and order


def check_prbs(bench: Bench, *, orders: tuple[int, ...] = ORDERS, words: int = _WORDS) -> Figures:
    """Compares the board's sequence with the host's here, and the host's on the board.

    Raises StageFault from-board, to-board or words-lost.
    """
    figures: Figures = {"words": words, "orders": list(orders), "bits": 0}
    board = Board(bench.bone, bench.csr, verify=False)
    for order in orders:
        result = prbs.exchange(board, order, words)
        if sum(map(bool, result.wrong)) > 1 and bench.monitor is not None:
            # More than one word: the request may have been changed, which does not happen twice.
            again = prbs.exchange(board, order, words)
            if not any(again.wrong):
                bench.monitor.count_misplaced()
                result = again
        figures["bits"] += 2 * 32 * words
        if any(result.wrong):
            raise _from_board(order, result.wrong, figures)
        if result.checked != words:
            raise StageFault(
                "words-lost",
                f"order {order}, to the board: {result.checked} of {words} words arrived",
                "check cable and flow control, and that the receiver accepts bytes back to back",
                figures,
            )
        if result.errors:
            raise StageFault(
                "to-board",
                f"order {order}, to the board: {result.errors} of {32 * words} bits are wrong",
                "check the level at the board's receiver and the baud",
                figures | {"bits_wrong": result.errors},
            )
    bench.write("prbs_order", 31)
    return figures | {"bits_wrong": 0}


def which_bits(wrong: list[int]) -> str:
    """The location of wrong bits in the words: one bit, one byte, or several.

    Args:
        wrong: words whose 1s are wrong bits, at least one.
    """
    union = 0
    for word in wrong:
        union |= word
    bits = [n for n in range(32) if union >> n & 1]
    if len(bits) == 1:
        return f"all in bit {bits[0]} of the word, byte {3 - bits[0] // 8} on the line"
    octets = sorted({3 - bit // 8 for bit in bits})
    if len(octets) == 1:
        return f"all in byte {octets[0]} of the word as it is sent"
    return f"in {len(bits)} bits of the word"


def _from_board(order: int, wrong: list[int], figures: Figures) -> StageFault:
    count = sum(word.bit_count() for word in wrong)
    first = next(n for n, word in enumerate(wrong) if word)
    return StageFault(
        "from-board",
        f"order {order}, from the board: {count} of {32 * len(wrong)} bits are wrong, first in "
        f"word {first}, {which_bits(wrong)}",
        "check the board's transmitter, its level, and the baud",
        figures | {"bits_wrong": count},
    )
