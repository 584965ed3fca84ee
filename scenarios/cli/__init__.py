"""The command line: `viform COMMAND`, one file a command.

A command imports what it needs when it runs, in its own function: the libraries of a run take
seconds to load, and `viform --help` must not wait for them.
"""

from scenarios.cli.entry import main

__all__ = ["main"]
