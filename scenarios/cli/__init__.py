"""The command line: `viform COMMAND`, one file a command."""

from scenarios.cli.entry import main

__all__ = ["main"]
