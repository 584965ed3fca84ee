"""The command line: `viform COMMAND`, one file a command."""

from scenarios.cli.start import BEGAN  # isort: skip  # first: the clock of run_time_s
from scenarios.cli.entry import main

__all__ = ["BEGAN", "main"]
