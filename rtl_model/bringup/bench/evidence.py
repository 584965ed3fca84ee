"""What the line did to bytes between two moments, as far as both ends' counts tell it."""

from __future__ import annotations

from dataclasses import dataclass

from rtl_model.bringup.bench.stage import Figures

__all__ = ["Evidence"]


@dataclass(frozen=True)
class Evidence:
    """What happened to bytes between two moments; numbers of bytes unless said.

    to_board, from_board: more (added) or fewer (lost) than set out that way. framing, aborts,
    unknown: as the board counted them. unasked: that the board sent beyond those asked for.
    words: that the board took beyond those written. crc: whether their CRC-32 is another.
    bus_errors: accesses to no register. Of answers that were wrong once, `address` were another
    register's, `answers` were not, and `open` may be either. early: readings sent again before the
    counters were known. misplaced: requests and writes that failed once and not when sent again.
    repeats: all reads that were sent again. known: whether the board's counters could be read; else
    all of the line's own is 0. anew: these began at 0 again meanwhile, as when power or
    configuration goes.
    """

    known: bool = True
    to_board: int = 0
    from_board: int = 0
    framing: int = 0
    aborts: int = 0
    unknown: int = 0
    unasked: int = 0
    words: int = 0
    crc: bool = False
    bus_errors: int = 0
    address: int = 0
    answers: int = 0
    open: int = 0
    early: int = 0
    misplaced: int = 0
    repeats: int = 0
    anew: bool = False

    @property
    def changed_to_board(self) -> bool:
        """Whether a byte to the board was changed, for all that is known: the board did what it was
        not told to, and no byte of the way is missing or too many."""
        if self.to_board:
            return False
        odd = (self.aborts, self.unknown, self.unasked, self.words, self.bus_errors, self.address)
        return bool(self.framing or self.crc or any(odd))

    @property
    def clean(self) -> bool:
        """Whether nothing happened to any byte, as far as it shows."""
        return self.known and not (
            self.to_board or self.from_board or self.changed_to_board or self.answers or self.open
            or self.early or self.misplaced
        )  # fmt: skip

    @property
    def directions(self) -> list[str]:
        """Which ways were hit beyond doubt: "to-board", "from-board"."""
        made = []
        if self.to_board or self.changed_to_board:
            made.append("to-board")
        if self.from_board or self.answers:
            made.append("from-board")
        return made

    @property
    def text(self) -> str:
        """What happened, one clause; empty where nothing did."""
        told = []
        if not self.known:
            return (
                "the line is too bad for the board's counters to be read, or these began anew: "
                "which way it fails cannot be told"
            )
        if self.to_board:
            what = "lost" if self.to_board < 0 else "added"
            told.append(f"{_many(abs(self.to_board), 'byte')} to the board {what}{self._saw()}")
        elif self.changed_to_board:
            told.append(f"one byte or more to the board changed{self._saw()}")
        if self.from_board:
            what = "lost" if self.from_board < 0 else "added"
            told.append(f"{_many(abs(self.from_board), 'byte')} from the board {what}")
        if self.answers:
            told.append(f"{_many(self.answers, 'answer')} from the board changed on the way")
        if self.open:
            told.append(
                f"{_many(self.open, 'answer')} wrong once (a byte changed from the board, or to it "
                "in the request's address: these cannot be told apart)"
            )
        if self.misplaced and not told:
            told.append(
                f"{_many(self.misplaced, 'request')} failed once and not again, though both ends "
                "counted the same bytes: its address changed on the way to the board, or the board "
                "did not take it, which cannot be told apart"
            )
        if self.early:
            told.append(
                f"{_many(self.early, 'answer')} wrong once while the board's counters were first "
                "read, of which the direction cannot be told"
            )
        if not told and self.repeats:
            told.append(
                f"{_many(self.repeats, 'answer')} late or wrong once, though both ends counted the "
                "same bytes: held up on the way"
            )
        return ", ".join(told)

    @property
    def figures(self) -> Figures:
        """As JSON says it. `to_board_changed` and `from_board_changed` are at least so many."""
        return {
            "counters_read": self.known,
            "directions": self.directions,
            "to_board_lost": max(0, -self.to_board),
            "to_board_added": max(0, self.to_board),
            "to_board_changed": int(self.changed_to_board),
            "from_board_lost": max(0, -self.from_board),
            "from_board_added": max(0, self.from_board),
            "from_board_changed": self.answers,
            "undecided": self.open + self.early + self.misplaced,
            "framing_errors": self.framing,
            "watchdog_aborts": self.aborts,
            "unknown_commands": self.unknown,
            "bus_errors": self.bus_errors,
            "bytes_unasked": self.unasked,
            "words_unasked": self.words,
            "words_crc_wrong": self.crc,
        }

    def _saw(self) -> str:
        """The board's own counters of errors, in brackets."""
        counted = (
            (self.aborts, "request", "cut by its watchdog"),
            (self.unknown, "unknown command", ""),
            (self.framing, "stop bit", "low"),
            (self.bus_errors, "access", "to no register"),
        )
        seen = [" ".join((_many(n, what), how)).strip() for n, what, how in counted if n > 0]
        if self.address:
            seen.append("another register answered")
        if self.crc and not self.to_board:
            seen.append("the words written have another CRC-32")
        return f" ({', '.join(seen)})" if seen else ""

    @property
    def mend(self) -> str:
        """What to do about it."""
        ways = self.directions
        if ways == ["to-board"]:
            return "check the wire to the board's RX, its level and ground, and that no other " \
                "program writes to the port"  # fmt: skip
        if ways == ["from-board"]:
            return "check the wire from the board's TX, its level and ground, the adapter's " \
                "buffers, and that no other program reads the port"  # fmt: skip
        return "check cable, ground, levels and that no other program uses the port"


def _many(count: int, what: str) -> str:
    if count == 1:
        return f"1 {what}"
    return f"{count} {what}{'es' if what.endswith('s') else 's'}"
