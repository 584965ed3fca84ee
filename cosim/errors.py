"""The one exception family. Which to raise when:

- `InputError`: something the user gave cannot be used (file, flag, scenario, machine without a
  device). The command line prints its one line and exits with 2.
- `MissingPackages`: an `InputError` that system packages would mend. The launcher installs them.
- `Interrupted`: the user stopped a run; its checkpoint stands and the text says how to go on.
- Anything else is a fault of ours and keeps its traceback.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

__all__ = ["InputError", "Interrupted", "MissingPackages", "ViformError", "quote", "shorten"]

LONGEST: Final = 80
"""Characters of a wrong value that a message repeats."""

WHOLE: Final = 200
"""Characters of the name of a wrong thing, or of what is said of it."""


def shorten(text: str, longest: int = LONGEST) -> str:
    """The text, or so many of its first characters and an ellipsis."""
    return text if len(text) <= longest else f"{text[:longest]}..."


def quote(value: object) -> str:
    """A wrong value as a message repeats it."""
    try:
        return shorten(repr(value))
    except ValueError:  # Python refuses to print integers of thousands of digits
        return "a number of thousands of digits"
    except RecursionError:
        return "a value nested thousands of levels deep"


class ViformError(Exception):
    """Base of every error that this project raises on purpose."""


class InputError(ViformError):
    """A user's input cannot be used. The text is one line: "WHAT must be MUST, not ACTUAL; REMEDY".

    Attributes:
        what: name of the thing, such as "sensor.clock".
        must: what it must be.
        actual: what it is.
        remedy: an instruction.
    """

    def __init__(self, what: str, must: str, actual: str, remedy: str) -> None:
        self.what, self.must, self.actual, self.remedy = what, must, actual, remedy
        super().__init__(what, must, actual, remedy)  # all of them, so that it can be pickled

    def __str__(self) -> str:
        # A file's name may be long, with the reason behind it.
        what, actual = (
            text
            if len(text) <= WHOLE
            else f"{text[:-LONGEST][: WHOLE - LONGEST]}...{text[-LONGEST:]}"
            for text in (self.what, self.actual)
        )
        line = " ".join(f"{what} must be {self.must}, not {actual}; {self.remedy}".split())
        return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in line)


class MissingPackages(InputError):
    """The machine lacks system packages.

    Attributes:
        packages: names of Debian's packages, empty where none would help.
    """

    def __init__(
        self, what: str, must: str, actual: str, remedy: str, packages: Sequence[str] = ()
    ) -> None:
        super().__init__(what, must, actual, remedy)
        self.packages = tuple(packages)
        self.args = (what, must, actual, remedy, self.packages)


class Interrupted(ViformError):
    """A run was stopped by the user; nothing is lost.

    Attributes:
        done, total: work done and work in all, in `unit`.
        remedy: how to go on.
        unit: of the work; cycles by default.
    """

    def __init__(self, done: int, total: int, remedy: str, unit: str = "cycles") -> None:
        self.done, self.total, self.remedy, self.unit = done, total, remedy, unit
        super().__init__(done, total, remedy, unit)

    def __str__(self) -> str:
        return f"interrupted after {self.done} of {self.total} {self.unit}; {self.remedy}"
