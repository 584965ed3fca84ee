"""Standard output and standard error of the command: no text and no state of theirs ends a run.

A terminal may have an encoding without our signs, a name may command the terminal, and a log may be
on a full disk. Any of the standard streams may be closed: the next file that is opened then takes
its number, and what a library prints would go into that file.
"""

from __future__ import annotations

import codecs
import io
import json
import os
import re
import select
import sys
from typing import Any, Final

STDOUT: Final = "standard output"
"""File name in the errors of standard output."""
_COMMANDS: Final = re.compile(
    r"[\x00-\x08\x0b-\x1f\x7f-\x9f\u200e\u200f\u202a-\u202e\u2066-\u2069]"
)
"""Characters that command a terminal, or turn the order of what it shows."""
_SPELLED: Final = {
    "\N{MICRO SIGN}": "u", "\N{GREEK SMALL LETTER MU}": "u", "\N{MULTIPLICATION SIGN}": "x",
    "\N{PLUS-MINUS SIGN}": "+/-", "\N{MINUS SIGN}": "-", "\N{MIDDLE DOT}": " ",
    "\N{DEGREE SIGN}": "deg", "\N{INFINITY}": "inf", "\N{SECTION SIGN}": "section ",
    "\N{LEFT DOUBLE QUOTATION MARK}": '"', "\N{RIGHT DOUBLE QUOTATION MARK}": '"',
    "\N{NO-BREAK SPACE}": " ", "\N{NARROW NO-BREAK SPACE}": " ",
}  # fmt: skip
"""Our signs in an encoding without them; others become escapes."""
_RAISED: Final = dict(zip("⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "-0123456789", strict=True))
_ERRORS: Final = "viform"
"""Name of `_spell` as a handler of errors."""


def _escape(found: re.Match[str]) -> str:
    return found[0].encode("unicode_escape").decode()


def _spell(error: UnicodeError) -> tuple[str, int]:
    """What is written for a sign that cannot be encoded, and where the next one is."""
    if not isinstance(error, UnicodeEncodeError):
        raise error
    text, begin = error.object, error.start
    if text[begin] not in _RAISED:
        sign = text[begin]
        return _SPELLED.get(sign) or sign.encode("unicode_escape").decode(), begin + 1
    end = begin
    while end < len(text) and text[end] in _RAISED:  # a power is spelled whole
        end += 1
    return "^" + "".join(_RAISED[sign] for sign in text[begin:end]), end


codecs.register_error(_ERRORS, _spell)


class Printed(io.TextIOWrapper):
    """A stream of text on which characters that command a terminal are escapes."""

    def write(self, text: str, /) -> int:
        return super().write(_COMMANDS.sub(_escape, text))


class _Output(io.FileIO):
    """Standard output, which names itself in its errors."""

    def write(self, data: Any, /) -> int:
        try:
            return _write(self, data)
        except OSError as exc:
            raise OSError(exc.errno, exc.strerror, STDOUT) from exc


class _Log(io.FileIO):
    """Standard error, which loses what it cannot take: a run goes on without its log."""

    def write(self, data: Any, /) -> int:
        try:
            return _write(self, data)
        except OSError:
            return len(data)


def _write(file: io.FileIO, data: Any) -> int:
    """Number of bytes written. A program may have made the terminal non-blocking for all."""
    while (count := io.FileIO.write(file, data)) is None:
        select.select([], [file], [])
    return count


def protect() -> None:
    """Puts safe streams in the place of standard output and error. What somebody else has put
    there stays."""
    for number in range(3):
        try:
            os.fstat(number)
        except OSError:  # closed
            # It takes the lowest free number; child processes have it as well.
            os.set_inheritable(os.open(os.devnull, os.O_RDWR), True)
    if sys.stdout is sys.__stdout__:
        # With PYTHONUNBUFFERED, Python passes text on without lines.
        at_once = any(
            getattr(sys.stdout, name, False) for name in ("line_buffering", "write_through")
        )
        output = io.BufferedWriter(_Output(1, "w", closefd=False))
        sys.stdout = Printed(
            output, encoding=_encoding(sys.stdout), errors=_ERRORS, line_buffering=at_once
        )
    if sys.stderr is sys.__stderr__:  # not Printed: a bar of progress commands the terminal
        log = io.BufferedWriter(_Log(2, "w", closefd=False))
        sys.stderr = io.TextIOWrapper(
            log, encoding=_encoding(sys.stderr), errors=_ERRORS, line_buffering=True
        )


def _encoding(stream: Any) -> str:
    return getattr(stream, "encoding", None) or "utf-8"  # a text in memory has none


def json_for(stream: Any, text: str) -> str:
    """A JSON document for a stream. In an encoding other than UTF-8 it is ASCII, with the escapes
    of JSON, which every program reads."""
    if codecs.lookup(_encoding(stream)).name == "utf-8":
        return text
    return re.sub(r"[^\x00-\x7f]", lambda found: json.dumps(found[0])[1:-1], text)
