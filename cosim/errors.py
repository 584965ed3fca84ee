"""The one exception family. Which to raise when:

- `InputError`: something the user gave cannot be used (file, flag, scenario, machine without a
  device). The command line prints its one line and exits with 2.
- `Interrupted`: the user stopped a run; its checkpoint stands and the text says how to go on.
- Anything else is a fault of ours and keeps its traceback.
"""

from __future__ import annotations

__all__ = ["InputError", "Interrupted", "ViformError"]


class ViformError(Exception):
    """Base of every error that this project raises on purpose."""


class InputError(ViformError):
    """A user's input cannot be used: what must be, what was given, how to mend it.

    `what` names the thing ("sensor.clock"), `must` completes "must be", `given` completes "not",
    `mend` is an instruction. The text is always one line.
    """

    def __init__(self, what: str, must: str, given: str, mend: str) -> None:
        self.what, self.must, self.given, self.mend = what, must, given, mend
        super().__init__(what, must, given, mend)  # all of them, so that it can be pickled

    def __str__(self) -> str:
        return " ".join(f"{self.what} must be {self.must}, not {self.given}; {self.mend}".split())


class Interrupted(ViformError):
    """A run was stopped by the user after `done` of `total` cycles, or what `unit` says; nothing is
    lost."""

    def __init__(self, done: int, total: int, mend: str, unit: str = "cycles") -> None:
        self.done, self.total, self.mend, self.unit = done, total, mend, unit
        super().__init__(done, total, mend, unit)

    def __str__(self) -> str:
        return f"interrupted after {self.done} of {self.total} {self.unit}; {self.mend}"
