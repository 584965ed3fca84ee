"""The command line `viform COMMAND`, in rooms; commands on one subject share a file.

A command imports its libraries in its function: they take seconds to load, and `viform --help` does
not need them.
"""

from scenarios.cli.entry import main

__all__ = ["main"]
