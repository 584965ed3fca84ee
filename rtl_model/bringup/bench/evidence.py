"""Transmission errors of the line in an interval, derived from the byte counts at both ends."""

from __future__ import annotations

from dataclasses import dataclass

from rtl_model.bringup.bench.stage import Figures


@dataclass(frozen=True)
class Evidence:
    """Transmission errors in an interval. Values are numbers of bytes unless noted.

    Attributes:
        known: whether the board's counters could be read; otherwise all counts are 0.
        to_board, from_board: bytes added (positive) or lost (negative) in that direction.
        framing, aborts, unknown: framing errors, watchdog aborts and unknown commands, counted by
            the board.
        unsolicited: bytes that the board sent beyond those requested.
        words: words that the board counted beyond those that the host wrote.
        crc: whether the CRC-32 of the written words differs.
        bus_errors: accesses to no register.
        address: answers that were wrong once and came from another register.
        answers: answers that were wrong once and were changed on the way from the board.
        open: answers that were wrong once, of undecided direction.
        early: reads repeated before the counters were known.
        misplaced: requests and writes that failed once and passed when repeated.
        repeats: all repeated reads.
        restarted: whether the counters restarted from 0, as after a loss of power.
    """

    known: bool = True
    to_board: int = 0
    from_board: int = 0
    framing: int = 0
    aborts: int = 0
    unknown: int = 0
    unsolicited: int = 0
    words: int = 0
    crc: bool = False
    bus_errors: int = 0
    address: int = 0
    answers: int = 0
    open: int = 0
    early: int = 0
    misplaced: int = 0
    repeats: int = 0
    restarted: bool = False

    @property
    def changed_to_board(self) -> bool:
        """Whether a byte to the board was changed.

        Then the board has done something that was not requested, and no byte of that direction is
        missing or added.
        """
        if self.to_board:
            return False
        counts = (
            self.aborts, self.unknown, self.unsolicited, self.words, self.bus_errors, self.address,
        )  # fmt: skip
        return bool(self.framing or self.crc or any(counts))

    @property
    def paused_to_board(self) -> bool:
        """Whether the board cut a request of which no byte is missing, and nothing else shows a
        changed byte.

        The rest of the request then counts as unknown commands, and the words of a write are
        missing in the CRC-32.
        """
        others = self.framing or self.bus_errors or self.address
        return bool(self.aborts > 0 and not self.to_board and self.words <= 0 and not others)

    @property
    def clean(self) -> bool:
        """Whether no error is known."""
        return self.known and not (
            self.to_board or self.from_board or self.changed_to_board or self.answers or self.open
            or self.early or self.misplaced
        )  # fmt: skip

    @property
    def directions(self) -> list[str]:
        """Directions with a proven error: "to-board", "from-board"."""
        directions = []
        if self.to_board or self.changed_to_board:
            directions.append("to-board")
        if self.from_board or self.answers:
            directions.append("from-board")
        return directions

    @property
    def text(self) -> str:
        """The errors in one clause; empty if there are none."""
        clauses = []
        if not self.known:
            return (
                "the board's counters cannot be read over this line, or they restarted: the "
                "direction of the errors is unknown"
            )
        if self.to_board:
            what = "lost" if self.to_board < 0 else "added"
            clauses.append(
                f"{_many(abs(self.to_board), 'byte')} to the board {what}{self._counted()}"
            )
        elif self.paused_to_board:
            clauses.append(
                f"{_many(self.aborts, 'request')} to the board cut by its watchdog, though every "
                "byte arrived: a pause of more than 100 ms within it, or a changed length; the "
                "counts do not distinguish the two"
            )
        elif self.changed_to_board:
            clauses.append(f"one byte or more to the board changed{self._counted()}")
        if self.from_board:
            what = "lost" if self.from_board < 0 else "added"
            clauses.append(f"{_many(abs(self.from_board), 'byte')} from the board {what}")
        if self.answers:
            clauses.append(f"{_many(self.answers, 'answer')} from the board changed on the way")
        if self.open:
            clauses.append(
                f"{_many(self.open, 'answer')} wrong once (a byte changed from the board, or to it "
                "in the request's address; the counts do not distinguish the two)"
            )
        if self.misplaced and not clauses:
            clauses.append(
                f"{_many(self.misplaced, 'request')} failed once and not again, though both ends "
                "counted the same bytes: its address changed on the way to the board, or the board "
                "did not accept it; the counts do not distinguish the two"
            )
        if self.early:
            clauses.append(
                f"{_many(self.early, 'answer')} wrong once while the board's counters were first "
                "read, in an unknown direction"
            )
        if not clauses and self.repeats:
            clauses.append(
                f"{_many(self.repeats, 'answer')} late or wrong once, though both ends counted the "
                "same bytes: delayed on the way"
            )
        return ", ".join(clauses)

    @property
    def figures(self) -> Figures:
        """The JSON document. `to_board_changed` and `from_board_changed` are lower bounds."""
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
            "bytes_unasked": self.unsolicited,
            "words_unasked": self.words,
            "words_crc_wrong": self.crc,
        }

    def _counted(self) -> str:
        """The board's error counters, in brackets."""
        counted = (
            (self.aborts, "request", "cut by its watchdog"),
            (self.unknown, "unknown command", ""),
            (self.framing, "stop bit", "low"),
            (self.bus_errors, "access", "to no register"),
        )
        counts = [" ".join((_many(n, what), how)).strip() for n, what, how in counted if n > 0]
        if self.address:
            counts.append("another register answered")
        if self.crc and not self.to_board:
            counts.append("the words written have another CRC-32")
        return f" ({', '.join(counts)})" if counts else ""

    @property
    def remedy(self) -> str:
        """What to check or repair."""
        directions = self.directions
        delayed = self.repeats and self.known and self.clean
        if delayed or (self.paused_to_board and directions == ["to-board"]):
            return "find what delays the bytes: a hub, a network, a busy host or a slow " \
                "simulator (--time-scale)"  # fmt: skip
        if directions == ["to-board"]:
            return "check the wire to the board's RX, its level and ground, and that no other " \
                "program writes to the port"  # fmt: skip
        if directions == ["from-board"]:
            return "check the wire from the board's TX, its level and ground, the adapter's " \
                "buffers, and that no other program reads the port"  # fmt: skip
        return "check cable, ground, levels and that no other program uses the port"


def _many(count: int, what: str) -> str:
    if count == 1:
        return f"1 {what}"
    return f"{count} {what}{'es' if what.endswith('s') else 's'}"
