"""The exceptions of this project, and when to raise which:

- `InputError`: an input of the user cannot be used (file, flag, scenario, machine without a
  device). The command line prints its one line and exits with 2.
- `MissingPackages`: an `InputError` that system packages would resolve. The launcher installs them.
- `Interrupted`: the user stopped a run. Its checkpoint exists, and the text says how to continue.
- Any other exception is a fault of this project and keeps its traceback.

Lines for the user go to standard error by `say`. Foreign text, such as a file's name or the answer
of a board, is printed by it or by `one_line`.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from copy import copy
from typing import Final

LONGEST: Final = 80
"""Characters of a wrong value that a message repeats."""

WHOLE: Final = 200
"""Characters of the name of a wrong thing, or of what is said of it."""

_BLANKS: Final = "\N{NO-BREAK SPACE}\N{NARROW NO-BREAK SPACE}"
"""Characters of our own texts that Python does not count as printable."""


def shorten(text: str, longest: int = LONGEST) -> str:
    """The text, or so many of its first characters and an ellipsis."""
    return text if len(text) <= longest else f"{text[:longest]}..."


def one_line(text: str) -> str:
    """Foreign text as a line for a terminal: what is not printable becomes an escape. A file's
    name, a key or the answer of a board may hold a line break, or a sequence that commands the
    terminal."""
    if text.isprintable():
        return text
    return "".join(
        c if c.isprintable() or c in _BLANKS else c.encode("unicode_escape").decode() for c in text
    )


def say(text: str) -> None:
    """Prints a line of the program on standard error, if that can be written."""
    if sys.stderr is not None:  # print would choose standard output
        with suppress(OSError):
            print(f"viform: {one_line(text)}", file=sys.stderr, flush=True)


def quote(value: object) -> str:
    """A wrong value as a message repeats it."""
    try:
        return shorten(repr(value))
    except ValueError:  # Python refuses to print integers of thousands of digits
        return "a number of thousands of digits"
    except RecursionError:
        return "a value nested thousands of levels deep"


class ViformError(Exception):
    """Base class of all errors that this project raises on purpose."""


class InputError(ViformError):
    """A user's input cannot be used. The text is one line: "WHAT must be MUST, not ACTUAL; REMEDY".

    Attributes:
        what: name of the input, such as "sensor.clock".
        must: requirement.
        actual: actual value.
        remedy: instruction to the user.
    """

    def __init__(self, what: str, must: str, actual: str, remedy: str) -> None:
        self.what, self.must, self.actual, self.remedy = what, must, actual, remedy
        super().__init__(what, must, actual, remedy)  # all arguments, for pickle

    def __str__(self) -> str:
        # A file's name may be long, with the reason behind it.
        what, actual = (
            text
            if len(text) <= WHOLE
            else f"{text[:-LONGEST][: WHOLE - LONGEST]}...{text[-LONGEST:]}"
            for text in (self.what, self.actual)
        )
        line = f"{what} must be {self.must}, not {actual}; {self.remedy}"
        return one_line(" ".join(line.split()))

    def moved(self, home: str, path: str) -> InputError:
        """The same refusal, of a section that stands at `path` and not at `home`."""
        names = re.compile(rf"(?<![\w.]){re.escape(home)}(?=\.[a-z]|\])")
        texts = [
            names.sub(lambda _: path, text)
            for text in (self.what, self.must, self.actual, self.remedy)
        ]
        made = copy(self)
        made.what, made.must, made.actual, made.remedy = texts
        made.args = (*texts, *self.args[4:])
        return made


@contextmanager
def section_at(path: str, home: str = "sensor") -> Iterator[None]:
    """Refusals within this context name the keys of a section as the user wrote them.

    Args:
        path: the section's, such as "link.sensor".
        home: the path that its refusals name.
    """
    try:
        yield
    except InputError as exc:
        raise exc.moved(home, path) from exc.__cause__


class MissingPackages(InputError):
    """The machine lacks system packages.

    Attributes:
        packages: names of Debian packages, empty if none would help.
    """

    def __init__(
        self, what: str, must: str, actual: str, remedy: str, packages: Sequence[str] = ()
    ) -> None:
        super().__init__(what, must, actual, remedy)
        self.packages = tuple(packages)
        self.args = (what, must, actual, remedy, self.packages)


class Interrupted(ViformError):
    """The user stopped a run; its checkpoint is complete.

    Attributes:
        done, total: completed work and total work, in `unit`; a total of 0 is not known.
        remedy: how to continue.
        unit: unit of the work, "cycles" by default.
    """

    def __init__(self, done: int, total: int, remedy: str, unit: str = "cycles") -> None:
        self.done, self.total, self.remedy, self.unit = done, total, remedy, unit
        super().__init__(done, total, remedy, unit)

    def __str__(self) -> str:
        before = ", before the images and the report" if 0 < self.total == self.done else ""
        of = f" of {self.total}" if self.total else ""
        return f"interrupted after {self.done}{of} {self.unit}{before}; {self.remedy}"
