"""Commands in messages and reports as this user calls them: `viform run` or `./viform run`."""

from __future__ import annotations

import os
import re
import shlex

_COMMAND = re.compile(
    r"viform (?<![\w./-]viform )(?=(?:run|list|plan|test|doctor|convert|image|reconstruct|accuracy|"
    r"stability|paper|bench|link|board|design|compare|compare-methods|live|view|sweep|dataset|calibrate|"
    r"laboratory)\b)"
)
"""The program's name before a command; "viform 1.2" is no command. The name comes first in the
pattern: it is then searched as a text, which in the megabytes of a page takes a hundredth."""


def as_called(text: str) -> str:
    """The text with the name by which the launcher was called, VIFORM_CALLED, before each command.
    Without it the program is on the user's path as `viform`."""
    name = shlex.quote(os.environ.get("VIFORM_CALLED") or "viform")
    return _COMMAND.sub(lambda _: f"{name} ", text)
