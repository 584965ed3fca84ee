"""Faults of a line or of the board behind it, each with advice."""

from __future__ import annotations

import enum

from cosim import ViformError


class Cause(enum.Enum):
    """Why a board does not answer correctly. The value is the name in documents."""

    NO_PORT = "no-port"
    BUSY = "busy"
    PERMISSION = "permission"
    GONE = "gone"
    STUCK = "stuck"
    SILENT = "silent"
    SHORT = "short"
    GARBLED = "garbled"
    BAUD = "baud"
    ECHO = "echo"
    WATCHDOG = "watchdog"
    RESTARTED = "restarted"
    NOT_OURS = "not-ours"
    MISPLACED = "misplaced"
    LATE = "late"
    DIFFERS = "differs"

    @property
    def advice(self) -> str:
        """What to do, one line."""
        return _ADVICE[self]


_ADVICE = {
    Cause.NO_PORT: "plug the board in, or name an existing port",
    Cause.BUSY: "end the other program that uses the port (`fuser -v` names it)",
    Cause.PERMISSION: "join the group that owns the port (`sudo usermod -aG dialout $USER`) "
    "and log in again",
    Cause.GONE: "check cable and power of the board, then open the port again",
    Cause.STUCK: "check flow control and that something reads the other end",
    Cause.SILENT: "check power, that TX and RX are crossed, the baud and the board's clock",
    Cause.SHORT: "bytes were lost: check cable, baud, buffers and the board's counters",
    Cause.GARBLED: "check cable, ground, levels and baud",
    Cause.BAUD: "give the board's real baud, or correct its clock or divider",
    Cause.ECHO: "the line returns what is sent: remove the loop, or turn the adapter's echo off",
    Cause.WATCHDOG: "the board cut the transaction after 100 ms: raise the baud, or give the "
    "time scale of a simulated board",
    Cause.RESTARTED: "the board restarted: check its supply and its reset",
    Cause.NOT_OURS: "give the csr.csv of the loaded design, or load the right design",
    Cause.MISPLACED: "words went to a wrong address: check the line, then reset the board",
    Cause.LATE: "the expected event did not happen: check that the sensor runs",
    Cause.DIFFERS: "replay with the program version and settings of the log",
}


class LineFault(ViformError):
    """The line or the board failed.

    Attributes:
        cause: kind of the fault.
        text: what happened.
        advice: what to do; that of the cause by default.
    """

    def __init__(self, cause: Cause, text: str, advice: str | None = None) -> None:
        self.cause, self.text = cause, text
        self.advice = cause.advice if advice is None else advice
        super().__init__(cause, text, advice)  # all of them, so that it can be pickled

    def __str__(self) -> str:
        return " ".join(f"{self.text}; {self.advice}".split())
