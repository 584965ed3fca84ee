"""What the command line's parser says about an option, in the form of all refusals."""

from __future__ import annotations

import re
from collections.abc import Sequence

_SAID = re.compile(r"Invalid value for '(?P<name>[^']+)': (?:Value error, )?(?P<why>.*)", re.DOTALL)
_MUST = (
    (re.compile(r"Input should be greater than or equal to (\S+)"), "at least {}"),
    (re.compile(r"Input should be less than or equal to (\S+)"), "at most {}"),
    (re.compile(r"Input should be a valid integer.*"), "a whole number"),
    (re.compile(r"Input should be a valid number.*"), "a number"),
    (re.compile(r"'[^']*' is not one of (.*)"), "one of {}"),
)
"""Texts of pydantic and of Typer, and what must be."""


def _given(name: str, arguments: Sequence[str]) -> str | None:
    """The last value of an option in a command's words; None if it is not there."""
    values = [
        value if sign else after
        for word, after in zip(arguments, (*arguments[1:], None), strict=True)
        for option, sign, value in (word.partition("="),)
        if option == name
    ]
    return values[-1] if values else None


def parser_refusal(text: str, arguments: Sequence[str], commands: Sequence[str] = ()) -> str:
    """Parser's text as "NAME must be X, not Y"; another text as it is.

    Args:
        text: text of the parser.
        arguments: words of the command, in which the value is looked up.
        commands: commands of the group that the words name, if they name a group.
    """
    if text == "Missing command" and commands:
        group = " ".join(arguments)
        return f"the command after `viform {group}` must be one of {', '.join(commands)}, not none"
    said = _SAID.fullmatch(text)
    if said is None:
        return text
    name, why = said["name"], said["why"]
    for pattern, must in _MUST:
        found = pattern.fullmatch(why)
        if found is not None:
            quoted = re.match(r"'([^']*)' is not one of", why)
            given = quoted[1] if quoted else _given(name, arguments)
            unlike = "" if given is None else f", not {given!r}"
            return f"{name} must be {must.format(*found.groups())}{unlike}"
    return text
