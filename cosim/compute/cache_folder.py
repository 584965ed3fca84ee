"""The folder of compiled kernels, and the variables by which libraries find it."""

from __future__ import annotations

import os
import stat
import tempfile
from contextlib import suppress
from pathlib import Path

from cosim.errors import say, shorten

_SAID: set[str] = set()
"""Values of VIFORM_CACHE that a line has said are not used."""


def cache_folder() -> Path:
    """A writable folder for compiled kernels: VIFORM_CACHE, the user's cache, or a temporary
    folder.

    Compiled kernels are executed. So VIFORM_CACHE and the temporary folder are used only if they
    are folders, not links to one, that this user owns and nobody else may enter; a line on standard
    error says why VIFORM_CACHE is not used. The user's cache is made so. The temporary folder has
    the user's number in its name, so that runs share it.
    """
    choices = (("XDG_CACHE_HOME", "viform"), ("HOME", ".cache/viform"))
    caches = [Path(os.environ[name]) / below for name, below in choices if os.environ.get(name)]
    shared = Path(tempfile.gettempdir()) / f"viform-{os.getuid()}"
    given = os.environ.get("VIFORM_CACHE")
    why, found = "", None
    if given:
        why = _objection(Path(given))
        found = Path(given) if not why else None
    if found is None:
        own = (folder for folder in caches if not _objection(folder, close=True))
        found = next(own, None) or (shared if not _objection(shared) else None)
    found = found or Path(tempfile.mkdtemp(prefix="viform-"))
    if given and why and given not in _SAID:
        _SAID.add(given)
        say(
            f"VIFORM_CACHE must be a folder of this user that nobody else may enter (mode "
            f"700), not {shorten(given)} ({why}); {found} is used"
        )
    return found


def _objection(folder: Path, close: bool = False) -> str:
    """Why a folder must not hold programs, "" if it may; it is made if it is not there.

    close: whether to take the permissions of others away, and to follow links to folders.
    """
    try:
        folder.parent.mkdir(parents=True, exist_ok=True)
        with suppress(FileExistsError):
            folder.mkdir(mode=0o700)
        found = folder.stat() if close else folder.lstat()
        if stat.S_ISLNK(found.st_mode):
            return "a link"
        if not stat.S_ISDIR(found.st_mode):
            return "no folder"
        if found.st_uid != os.getuid():
            return f"of user {found.st_uid}"
        if found.st_mode & 0o077:
            if not close:
                return f"mode {found.st_mode & 0o777:03o}"
            folder.chmod(0o700)
    except OSError as exc:
        return exc.strerror or type(exc).__name__
    return "" if os.access(folder, os.W_OK | os.X_OK) else "not writable"


def prepare_caches() -> None:
    """Directs the caches of PoCL and pyopencl to a writable folder, for this process and its
    children, and that of numba if the source folder is not writable. It must be called before numba
    is imported.

    VIFORM_CACHE is set to the folder. Otherwise a second call would use a folder below it, because
    the first has changed XDG_CACHE_HOME.
    """
    folder = cache_folder()
    os.environ["VIFORM_CACHE"] = str(folder)
    os.environ.setdefault("POCL_CACHE_DIR", str(folder / "pocl"))
    os.environ.setdefault("XDG_CACHE_HOME", str(folder))
    if not os.access(Path(__file__).parent, os.W_OK):
        os.environ.setdefault("NUMBA_CACHE_DIR", str(folder / "numba"))
    Path(os.environ["POCL_CACHE_DIR"]).mkdir(parents=True, exist_ok=True)
