"""The command line: `viform COMMAND`. One line on standard error and exit 2 for bad input."""

from __future__ import annotations

import os
import signal
import sys
from contextlib import suppress

import scenarios.cli.start  # noqa: F401  # first: its clock is the start of run_time_s
from scenarios.cli.packages import install_and_restart, read_launcher

_PIPE = 141
"""Exit code where who reads standard output has gone: 128 + SIGPIPE, as a shell has it."""


def main() -> None:
    """Entry point; ends the process with 0 done, 1 a check failed, 2 bad input, 130 interrupted,
    141 where nobody reads standard output any more."""
    # A request to end is met as Ctrl-C is: with what is done kept and one line of how to go on.
    # Not by SIGINT's own handler: a script's `viform ... &` has that ignored.
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    read_launcher()
    try:
        code = _main(sys.argv[1:] or ["--help"])
        sys.stdout.flush()  # what its buffer holds may yet meet a pipe that nobody reads
    except BrokenPipeError:
        code = _PIPE
        _drop_output()
    except OSError as exc:  # a file's own writer says more; this is for what has none
        from cosim.files.whole import NO_ROOM

        if exc.errno not in NO_ROOM:
            raise
        where = exc.filename or "standard output, or where it writes"
        print(
            f"viform: the command must have room for what it writes, not meet {exc.strerror!r} at "
            f"{where}; make room, then give it again",
            file=sys.stderr,
        )
        code = 2
        _drop_output()
    except KeyboardInterrupt:  # before a command has begun
        print("viform: interrupted", file=sys.stderr)
        code = 130
    sys.exit(code)


def _drop_output() -> None:
    """What is left in standard output's buffer has no place to go to."""
    with suppress(OSError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _main(arguments: list[str]) -> int:
    from typer.exceptions import Abort, TyperException
    from typer.main import get_command

    from cosim import Interrupted
    from cosim.compute.opencl import prepare_caches
    from cosim.errors import MissingPackages, ViformError
    from scenarios.cli.app import app

    with suppress(OSError):  # what needs no cache works without
        prepare_caches()
    try:
        code = get_command(app).main(arguments, prog_name="viform", standalone_mode=False)
    except TyperException as exc:
        text = " ".join(exc.format_message().split()).rstrip(".")
        context = getattr(exc, "ctx", None)
        where = context.command_path if context is not None else "viform"
        print(f"viform: {text}; see `{where} --help`", file=sys.stderr)
        return 2
    except Interrupted as exc:
        print(f"viform: {exc}", file=sys.stderr)
        return 130
    except ViformError as exc:
        if isinstance(exc, MissingPackages):
            install_and_restart(exc.packages)
        print(f"viform: {exc}", file=sys.stderr)
        return 2
    except (Abort, KeyboardInterrupt):
        print("viform: interrupted", file=sys.stderr)
        return 130
    except SystemExit as exc:  # what typer makes of a pipe that nobody reads
        if isinstance(exc.__context__, BrokenPipeError):
            return _PIPE
        raise
    if code == 130:  # what typer makes of Ctrl-C, without a word
        print("viform: interrupted", file=sys.stderr)
    return code if isinstance(code, int) else 0
