"""Writes the folder of a design atomically."""

from __future__ import annotations

import os
import shutil
from pathlib import Path

from cosim import InputError
from cosim.files.whole import refusal
from rtl_model.gateware.design import Design


def check_folder(folder: Path) -> None:
    """Raises InputError unless `folder` is empty, or a new name in an existing folder."""
    try:
        if folder.is_dir():
            if any(folder.iterdir()):
                raise InputError(
                    f"{folder}", "a new or an empty folder", "one with contents",
                    "choose another name, or empty it",
                )  # fmt: skip
        elif folder.exists() or folder.is_symlink():
            raise InputError(f"{folder}", "a folder", "a file", "choose another name")
        elif not folder.parent.is_dir():
            raise InputError(
                f"{folder}", "in a folder that exists", f"in {folder.parent}",
                f"mkdir -p {folder.parent}",
            )  # fmt: skip
    except OSError as exc:
        raise refusal(folder, exc) from exc


def write_folder(design: Design, folder: Path) -> list[str]:
    """Writes the files of a design; returns their sorted names.

    The files are written to a temporary folder and then moved, the Makefile last. After a failure,
    a new folder does not exist and an existing one is empty. Raises InputError as `check_folder`,
    and if the system refuses the write.
    """
    check_folder(folder)
    texts = design.files()
    new = not folder.exists()
    part = folder / f".{os.getpid()}.part"  # on the same file system
    try:
        part.mkdir(parents=True)
        try:
            for name, text in texts.items():
                (part / name).write_text(text, encoding="utf-8")
            for name in texts:
                os.replace(part / name, folder / name)
            part.rmdir()
        except BaseException:
            for name in reversed(texts):
                (folder / name).unlink(missing_ok=True)
            shutil.rmtree(part, ignore_errors=True)
            if new:
                folder.rmdir()
            raise
    except OSError as exc:
        raise refusal(folder, exc) from exc
    return sorted(texts)
