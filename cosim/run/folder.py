"""The folder of a run: its name, free disk space, and a lock against other runs."""

from __future__ import annotations

import fcntl
import os
import shlex
import shutil
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from cosim.errors import InputError
from cosim.files.atomic import NO_ROOM, atomic_write, how_to_make_room, remove_parts
from cosim.run.inputs import add_digests

REINSTATED = "put_back.json"
"""File in the folder of a run that is not finished and has reinstated effects."""
_GIB = 2**30


def output_folder(name: str, out: Path | None, resume: bool, *, goes_on: bool = True) -> Path:
    """The folder of a run: `out`, or else the first free runs/<name>-<n>. It is not created
    here. goes_on: whether the command has --resume, for the message."""
    if out is None:
        if resume:
            raise InputError("--resume", "given with --out", "alone", "add --out and the folder")
        n = 1
        while (Path("runs") / f"{name}-{n}").exists():
            n += 1
        return Path("runs") / f"{name}-{n}"
    try:
        if out.exists() and not out.is_dir():
            raise InputError("--out", "a folder", f"the file {out}", "choose another name")
        if out.is_dir() and any(out.iterdir()) and not resume:
            raise InputError(
                "--out", "a new or empty folder", str(out),
                "choose another, or add --resume" if goes_on else "choose another",
            )  # fmt: skip
    except OSError as exc:
        raise _bad_out(out, exc) from exc
    return out


def _bad_out(out: Path, exc: OSError) -> InputError:
    """The error for a folder that cannot be created."""
    return InputError(
        "--out", "a folder that can be written", f"{out} ({exc.strerror})", "choose another"
    )


def check_room(folder: Path, bits: int) -> None:
    """Raises InputError if the disk has less free space than a stream of `bits` bits may need."""
    place = folder.absolute()
    while not place.exists():
        place = place.parent
    disk = shutil.disk_usage(place)
    free = disk.free
    if disk.total and bits // 8 > free:  # 0 means no disk; creating the folder will fail
        need, have = bits / 8 / _GIB, free / _GIB
        raise InputError(
            "the stream", f"small enough for the {have:.3g} GiB free at {place}",
            f"up to {need:.3g} GiB", "shorten duration, or choose another --out",
        )  # fmt: skip


def begin_folder(folder: Path, scenario: str) -> None:
    """Writes a scenario (TOML) with the digests of its files, and removes the results of an earlier
    run."""
    for name in ("result.json", "report.html"):
        (folder / name).unlink(missing_ok=True)
    for kind in ("t*", "eye", "pursuit", "camera", "filmed"):
        for picture in (folder / "images").glob(f"{kind}-*.png"):
            picture.unlink()
    with atomic_write(folder / "scenario.toml") as part:
        part.write_text(add_digests(scenario), encoding="utf-8")


def how_to_resume(folder: Path) -> str:
    """Instruction to continue a run that has not reached its end."""
    return f"go on with the same command and --out {shlex.quote(str(folder))} --resume"


@contextmanager
def room_for(what: str, folder: Path, then: str = "") -> Iterator[None]:
    """Raises InputError if the disk is full within this context.

    Args:
        what: description of the data.
        folder: folder of the run.
        then: instruction after "make room, then"; by default, to resume.
    """
    try:
        yield
    except OSError as exc:
        if exc.errno not in NO_ROOM:
            raise
        raise InputError(
            "--out", f"where there is room for {what}", f"{folder} ({exc.strerror})",
            f"{how_to_make_room(exc)}, then {then or how_to_resume(folder)}",
        ) from exc  # fmt: skip


@contextmanager
def claim_folder(
    name: str, out: Path | None, resume: bool, *, goes_on: bool = True
) -> Iterator[Path]:
    """Creates the folder of a run and locks it against other runs. A new folder that is still empty
    at the end, after an error, is removed.

    Args:
        name: short name of the scenario.
        out: folder; runs/<name>-<n> if None.
        resume: whether the run continues in the folder of an interrupted run.
        goes_on: whether the command has --resume, for messages.
    """
    folder = output_folder(name, out, resume, goes_on=goes_on)
    while True:
        new = not folder.exists()
        try:
            folder.mkdir(parents=True, exist_ok=out is not None)
            break
        except FileExistsError as exc:
            if out is not None:
                raise _bad_out(folder, exc) from exc
            folder = output_folder(name, None, False)  # another run has created it
        except OSError as exc:
            raise _bad_out(folder, exc) from exc
    handle = os.open(folder, os.O_RDONLY)
    try:
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise InputError(
                "--out", "a folder that no other run is writing", str(folder), "choose another"
            ) from None
        if not new:
            remove_parts(folder)  # of killed runs: no other one has the lock
        with room_for("the run", folder, "" if goes_on else "run it again with another --out"):
            yield folder
    finally:
        if new:
            with suppress(OSError):  # not empty
                folder.rmdir()
        os.close(handle)


def check_trace_file(trace: Path) -> None:
    """Raises InputError unless a waveform file is named .fst or .vcd and its folder exists."""
    if trace.suffix.lower() not in (".fst", ".vcd"):
        raise InputError("--trace", "a name that ends in .fst or .vcd", str(trace), "rename it")
    if not trace.absolute().parent.is_dir():
        raise InputError("--trace", "in a folder that exists", str(trace), "make the folder")
