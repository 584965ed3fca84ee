"""Stage prbs: pseudo-random words both ways, and of wrong bits, which bit and byte of the word."""

from __future__ import annotations

from rtl_model.bringup.bench import Bench
from rtl_model.bringup.stage import Figures, StageFault
from rtl_model.prbs import ORDERS, Prbs

__all__ = ["check_prbs", "which_bits"]

_WORDS = 256  # each way and order: 32 768 bits in all


def check_prbs(bench: Bench, *, orders: tuple[int, ...] = ORDERS, words: int = _WORDS) -> Figures:
    """Holds the board's sequence against ours and ours against the board's. StageFault
    from-board, to-board or words-lost."""
    figures: Figures = {"words": words, "orders": list(orders), "bits": 0}
    for order in orders:
        bench.put("prbs_order", order)
        own = Prbs(order)
        must = [own.word() for _ in range(words)]
        got = bench.bone.read(bench.address("prbs_source"), words, fixed=True)
        wrong = [one ^ other for one, other in zip(got, must, strict=True)]
        figures["bits"] += 2 * 32 * words
        if any(wrong):
            raise _from_board(order, wrong, figures)
        bench.put("prbs_order", order)
        bench.bone.write(bench.address("prbs_check"), must, fixed=True)
        checked, errors = bench.sure("prbs_checked"), bench.sure("prbs_errors")
        if checked != words:
            raise StageFault(
                "words-lost",
                f"order {order}, to the board: {checked} of {words} words arrived",
                "check cable and flow control, and that bytes are taken back to back",
                figures,
            )
        if errors:
            raise StageFault(
                "to-board",
                f"order {order}, to the board: {errors} of {32 * words} bits are wrong",
                "check the level at the board's receiver and the baud",
                figures | {"bits_wrong": errors},
            )
    bench.put("prbs_order", 31)
    return figures | {"bits_wrong": 0}


def which_bits(wrong: list[int]) -> str:
    """Returns where in the words wrong bits stand: one bit, one byte, or neither. wrong: words
    whose 1s are wrong bits, at least one."""
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
