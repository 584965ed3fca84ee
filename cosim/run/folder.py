"""The folder of a run: its name, its room for the stream, and its lock for one run at a time."""

from __future__ import annotations

import fcntl
import os
import shlex
import shutil
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from cosim.errors import InputError
from cosim.files.whole import NO_ROOM, whole
from cosim.run.inputs import sealed

__all__ = [
    "PUT_BACK", "begin_folder", "check_room", "check_trace_file", "claimed",
    "how_to_resume", "output_folder", "room_for",
]  # fmt: skip

PUT_BACK = "put_back.json"
"""In a run's folder while it is not finished and effects were reinstated."""
_GIB = 2**30


def output_folder(name: str, out: Path | None, resume: bool) -> Path:
    """The folder of a run: `out`, else the first free runs/<name>-<n>. Nothing is made yet."""
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
                "--out", "a new or empty folder", str(out), "choose another, or add --resume"
            )
    except OSError as exc:
        raise _bad_out(out, exc) from exc
    return out


def _bad_out(out: Path, exc: OSError) -> InputError:
    return InputError(
        "--out", "a folder that can be written", f"{out} ({exc.strerror})", "choose another"
    )


def check_room(folder: Path, bits: int) -> None:
    """Raises InputError when the disk has not the room that a stream of so many bits may take."""
    place = folder.absolute()
    while not place.exists():
        place = place.parent
    disk = shutil.disk_usage(place)
    free = disk.free
    if disk.total and bits // 8 > free:  # 0 is no disk at all, which making the folder will say
        need, have = bits / 8 / _GIB, free / _GIB
        raise InputError(
            "the stream", f"small enough for the {have:.3g} GiB free at {place}",
            f"up to {need:.3g} GiB", "shorten duration, or choose another --out",
        )  # fmt: skip


def begin_folder(folder: Path, scenario: str) -> None:
    """The scenario's TOML is written first, sealed with what its files hold; what an earlier run
    said of itself here goes."""
    for name in ("result.json", "report.html"):
        (folder / name).unlink(missing_ok=True)
    for kind in ("t*", "eye", "pursuit", "camera"):
        for picture in (folder / "images").glob(f"{kind}-*.png"):
            picture.unlink()
    with whole(folder / "scenario.toml") as part:
        part.write_text(sealed(scenario), encoding="utf-8")


def how_to_resume(folder: Path) -> str:
    """How a run that did not get to its end goes on."""
    return f"go on with the same command and --out {shlex.quote(str(folder))} --resume"


@contextmanager
def room_for(what: str, folder: Path, then: str = "") -> Iterator[None]:
    """Makes a disk that is full, while `what` is written into a run's folder, an InputError. then:
    what to do with more room; goes on unless given."""
    try:
        yield
    except OSError as exc:
        if exc.errno not in NO_ROOM:
            raise
        raise InputError(
            "--out", f"where there is room for {what}", f"{folder} ({exc.strerror})",
            f"make room, then {then or how_to_resume(folder)}",
        ) from exc  # fmt: skip


@contextmanager
def claimed(name: str, out: Path | None, resume: bool, *, goes_on: bool = True) -> Iterator[Path]:
    """Makes the run's folder and keeps every other run out of it while this one lasts. A folder
    that it has made and that is still empty at the end, after an error, is removed.

    Args:
        name: short name of the scenario.
        out: folder; runs/<name>-<n> if None.
        resume: whether the run continues in a folder that an interrupted run has left.
        goes_on: whether the command has --resume, which a message about a full disk names.
    """
    folder = output_folder(name, out, resume)
    while True:
        new = not folder.exists()
        try:
            folder.mkdir(parents=True, exist_ok=out is not None)
            break
        except FileExistsError as exc:
            if out is not None:
                raise _bad_out(folder, exc) from exc
            folder = output_folder(name, None, False)  # another run was quicker
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
        with room_for("the run", folder, "" if goes_on else "run it again with another --out"):
            yield folder
    finally:
        if new:
            with suppress(OSError):  # it holds something
                folder.rmdir()
        os.close(handle)


def check_trace_file(trace: Path) -> None:
    """InputError for a waveform file of another ending than .fst or .vcd, or in no folder."""
    if trace.suffix.lower() not in (".fst", ".vcd"):
        raise InputError("--trace", "a name that ends in .fst or .vcd", str(trace), "rename it")
    if not trace.absolute().parent.is_dir():
        raise InputError("--trace", "in a folder that exists", str(trace), "make the folder")
