"""Output of commands: documents on standard output, progress and notes on standard error."""

from __future__ import annotations

import sys
from typing import Annotated, Any

import typer

from cosim.errors import one_line
from scenarios.cli.streams import json_for

Json = Annotated[bool, typer.Option("--json", help="one JSON document on standard output")]


def print_document(document: Any) -> None:
    """Writes one JSON document to standard output."""
    from cosim.run.result import dumps

    print_json(dumps(document) + "\n")


def print_json(text: str) -> None:
    """Writes the text of a JSON document to standard output."""
    sys.stdout.write(json_for(sys.stdout, text))


def tell(*lines: object) -> None:
    """Prints lines on standard output. A line break in a name stays in its line, as an escape."""
    for line in lines:
        print(one_line(str(line)))


def size_option(text: str | None) -> tuple[int, int] | None:
    """(width, height) of a text WIDTHxHEIGHT; None for None. Raises InputError."""
    from cosim import InputError

    if text is None:
        return None
    width, x, height = text.lower().partition("x")
    if not (x and width.isdecimal() and height.isdecimal() and int(width) and int(height)):
        raise InputError(
            "--size", "WIDTHxHEIGHT such as 400x250", repr(text), "write it in this form"
        )
    if int(width) * int(height) > 10**9:
        raise InputError("--size", "at most 1e9 pixels", text, "check it")
    return int(width), int(height)
