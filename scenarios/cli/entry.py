"""Entry point of the command line `viform COMMAND`. Invalid input gives one line on standard error
and exit code 2."""

from __future__ import annotations

import errno
import gc
import os
import re
import signal
import sys
from collections.abc import Sequence
from contextlib import suppress

# The first of ours: its clock is the start of run_time_s.
from scenarios.cli.start import install_and_restart, read_launcher
from scenarios.cli.streams import STDOUT, protect

_NO_MEMORY = (
    (RuntimeError, "can't start new thread"), (ImportError, "failed to map segment"),
    (ImportError, "annot allocate memory"), (RuntimeError, "OUT_OF_HOST_MEMORY"),
    (RuntimeError, "MEM_OBJECT_ALLOCATION_FAILURE"), (RuntimeError, "OUT_OF_RESOURCES"),
)  # fmt: skip
"""Errors, and what they say, of Python, the loader and OpenCL without memory."""
_PIPE = 141
"""Exit code after the reader of standard output has closed it: 128 + SIGPIPE, as in a shell."""
_SAID = re.compile(r"Invalid value for '(?P<name>[^']+)': (?:Value error, )?(?P<why>.*)", re.DOTALL)
_MUST = (
    (re.compile(r"Input should be greater than or equal to (\S+)"), "at least {}"),
    (re.compile(r"Input should be less than or equal to (\S+)"), "at most {}"),
    (re.compile(r"Input should be a valid integer.*"), "a whole number"),
    (re.compile(r"Input should be a valid number.*"), "a number"),
    (re.compile(r"'[^']*' is not one of (.*)"), "one of {}"),
)
"""Texts of pydantic and of Typer, and what must be."""


def main() -> None:
    """Runs the command and ends the process with exit code 0 (success), 1 (a check failed), 2
    (invalid input), 130 (interrupted), or 141 (standard output was closed)."""
    # SIGTERM has the effect of Ctrl-C: the state is saved, and a line explains how to resume.
    # SIGINT's current handler is not used: a shell script ignores SIGINT for `viform ... &`.
    from cosim.compute.stopping import (
        end_now,
        end_on_signals,
        ending,
        interrupt,
        leave,
        said,
    )

    signal.signal(signal.SIGTERM, interrupt)
    if signal.getsignal(signal.SIGINT) in (signal.default_int_handler, signal.SIG_DFL):
        signal.signal(signal.SIGINT, interrupt)
    if sys.flags.optimize > 1 and os.environ.pop("PYTHONOPTIMIZE", ""):
        os.execv(sys.executable, [sys.executable, *sys.orig_argv[1:]])  # the help is in docstrings
    read_launcher()
    os.umask(os.umask(0o077) & 0o077)  # the user may enter the folders that the command makes
    protect()
    try:
        end_on_signals()
        code = _main(sys.argv[1:] or ["--help"])
        sys.stdout.flush()  # this may raise BrokenPipeError
    except BrokenPipeError:
        code = _PIPE
        _drop_output()
    except KeyboardInterrupt:  # before the start of a command
        said()
        print("viform: interrupted", file=sys.stderr)
        code = 130
    except Exception as exc:
        from cosim.errors import say

        line = _of_the_machine(exc)
        if ending():  # an interrupt within a library leaves it in a state that it takes for a fault
            end_now()
        if line is None:
            raise
        say(line)
        code = 2
        _drop_output()
    if code == 130:  # who interrupts once more does not want a traceback of what is left to do
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, lambda *_: os._exit(code))
    if ending():
        leave(code)
    gc.freeze()  # otherwise the interpreter searches all objects for dead ones before it ends
    sys.exit(code)


def _of_the_machine(error: Exception) -> str | None:
    """The line for an error that is the machine's, not the program's: a full disk, or no memory.
    Most writers of files raise InputError, and runs state what they need; this is for the rest."""
    from cosim.files.atomic import NO_ROOM, how_to_make_room

    if isinstance(error, OSError) and error.errno in NO_ROOM:
        return (
            f"the disk must have room for the output, not fail with {error.strerror!r} at "
            f"{error.filename or 'an output file'}; "
            f"{how_to_make_room(error)} and repeat the command"
        )
    if isinstance(error, OSError) and error.filename == STDOUT:
        return (
            f"{STDOUT} must be a file or a program that takes it, not fail with "
            f"{error.strerror!r}; repeat the command with another, or with > /dev/null"
        )
    cause: BaseException | None = error
    while cause is not None:
        if isinstance(cause, OSError) and cause.errno in (errno.EMFILE, errno.ENFILE):
            return (
                "the limit of open files must be enough for the command, not reached; raise it "
                "(ulimit -n)"
            )
        if _no_memory(cause):
            return (
                "the memory must be enough for the command, not used up; close other programs, "
                "raise the limit (ulimit -v), or make the input smaller"
            )
        cause = cause.__cause__ or cause.__context__
    return None


def _no_memory(error: BaseException) -> bool:
    """Whether an error says that the system gave no memory: to an array, a thread, a library that
    is loaded, or OpenCL."""
    text = str(error)
    return (
        isinstance(error, MemoryError)
        or (isinstance(error, OSError) and error.errno == errno.ENOMEM)
        or any(isinstance(error, kind) and said in text for kind, said in _NO_MEMORY)
    )


def _drop_output() -> None:
    """Discards the buffer of standard output, which cannot be written."""
    with suppress(OSError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _main(arguments: list[str]) -> int:
    from typer.exceptions import Abort, TyperException
    from typer.main import get_command

    from cosim import Interrupted
    from cosim.compute.cache_folder import prepare_caches
    from cosim.compute.stopping import said
    from cosim.errors import InputError, MissingPackages, ViformError, say
    from cosim.run.called import as_called
    from scenarios.cli.app import app

    with suppress(OSError):  # most commands work without a cache
        prepare_caches()
        os.environ.setdefault("MPLCONFIGDIR", f"{os.environ['VIFORM_CACHE']}/matplotlib")
    try:
        try:
            os.getcwd()
        except OSError as exc:
            raise InputError(
                "the working folder", "one that exists", f"lost ({exc.strerror})",
                "change to another (cd) and repeat the command",
            ) from exc  # fmt: skip
        code = get_command(app).main(arguments, prog_name="viform", standalone_mode=False)
    except TyperException as exc:
        text = " ".join(exc.format_message().split()).rstrip(".")
        context = getattr(exc, "ctx", None)
        commands = getattr(getattr(context, "command", None), "commands", ())
        text = parser_refusal(text, arguments, [*commands])
        where = context.command_path if context is not None else "viform"
        say(as_called(f"{text}; see `{where} --help`"))
        return 2
    except Interrupted as exc:
        said()
        say(as_called(str(exc)))
        return 130
    except ViformError as exc:
        if isinstance(exc, MissingPackages):
            install_and_restart(exc.packages)
        say(as_called(str(exc)))
        return 2
    except (Abort, KeyboardInterrupt) as exc:
        if isinstance(exc.__cause__, EOFError):  # typer takes it for an end of the user's input
            raise exc.__cause__ from None
        said()
        print("viform: interrupted", file=sys.stderr)
        return 130
    except SystemExit as exc:  # typer raises this after a BrokenPipeError
        if isinstance(exc.__context__, BrokenPipeError):
            return _PIPE
        raise
    if code == 130:  # typer returns this after Ctrl-C, without a message
        said()
        print("viform: interrupted", file=sys.stderr)
    return code if isinstance(code, int) else 0


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
    """What the parser says about an option, in the form of all refusals: "NAME must be X, not Y";
    another text as it is.

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
