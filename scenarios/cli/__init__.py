"""The command line `viform COMMAND`, one file for each command, in rooms.

A command imports its libraries in its function: they take seconds to load, and `viform --help` does
not need them.
"""

from scenarios.cli.entry import main

__all__ = ["main"]
