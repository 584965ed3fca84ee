"""Frames of files that are needed again: one bounded cache of the process.

A run needs the frames of its clip several times: it surveys their light, films it, and compares
images with it; a data set films one clip with several cameras. So each is decoded once, and fitted
to a grid of pixels once, as long as they fit in the cache. When it is full, the frames of the file
that was opened least recently go first. Of one file that is larger, the first frames stay: passes
from begin to end would find none of the last ones.
"""

from __future__ import annotations

import os
from collections import OrderedDict
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from threading import RLock
from typing import Any, Final

from cosim import Plane

KEPT_BYTES: Final = 1 << 28
"""Bytes of all frames that are kept, at most, in a process."""
_FILES: Final = 1 << 12
"""Files of which something is kept, at most."""


@dataclass(frozen=True)
class Opened:
    """What is known of a file when its first two frames are decoded.

    Attributes:
        size: (height, width) of a picture, its pixels.
        aspect: width of a stored pixel over its height.
        rate: frame rate, 1/s; 0 for a still image.
        index: number of the stream in the file.
        strict: whether damaged pictures are refused.
        stamps: times of the first two frames, ticks of the stream; None if they have none.
    """

    size: tuple[int, int]
    aspect: float
    rate: Fraction
    index: int
    strict: bool
    stamps: tuple[int | None, int | None]


@dataclass(frozen=True, eq=False)
class Fitted:
    """A frame on the pixels of a grid.

    Attributes:
        plane: (H, W) float32, white = 1, or (H, W, 3); not to be changed.
        notes: what the user is told of it.
        most: highest light of the frames up to it, white = 1.
    """

    plane: Plane
    notes: tuple[str, ...]
    most: float


class CachedFile:
    """What is kept of a file.

    Args:
        path: the file.

    Attributes:
        lock: lock that is held by who decodes or converts one of its frames: a decoded frame is
            converted by one thread at a time.
        opened: decoder of the file; None before it was opened.
        count: number of its frames; None before its end was reached.
        notes: what the user is told of decoding, each with the number of the frame.
        bytes: bytes of its frames; None if nothing is kept of it any more.
    """

    def __init__(self, path: Path) -> None:
        self._path, self._known = path, _named(path)
        self.lock = RLock()
        self.opened: Opened | None = None
        self.count: int | None = None
        self.notes: list[tuple[int, str]] = []
        self.bytes: int | None = None
        self._frames: dict[int, Any] = {}
        self._fitted: dict[Any, Fitted] = {}

    @property
    def changed(self) -> bool:
        """Whether the path names another file by now, or this one with other content."""
        return _named(self._path) != self._known

    def frame(self, n: int) -> Any | None:
        """Decoded frame n; None if it is not kept."""
        return self._frames.get(n)

    def fitted(self, grid: Any, n: int) -> Fitted | None:
        """Frame n on a grid; None if it is not kept."""
        return self._fitted.get((grid, n))

    def keep(self, grid: Any, n: int, fitted: Fitted, frame: Any) -> None:
        """Keeps frame n on a grid, if there is room, and then as it was decoded, unless that is the
        larger one: another grid may need it."""
        size = fitted.plane.nbytes
        fitted.plane.setflags(write=False)  # who changed it would change what others are given
        decoded = sum(plane.buffer_size for plane in frame.planes)
        with _CACHE.lock:
            if _CACHE.room(self, size):
                self._fitted[grid, n] = fitted
            if n not in self._frames and decoded <= size and _CACHE.room(self, decoded):
                self._frames[n] = frame

    def empty(self) -> None:
        """Forgets its frames."""
        self._frames.clear()
        self._fitted.clear()


class _Cache:
    """The files of which frames are kept, by what names each as it now is; the one that was opened
    last is at the end. `lock` is held by who changes them; `bytes` are those of all frames."""

    def __init__(self) -> None:
        self.lock = RLock()
        self._files: OrderedDict[Any, CachedFile] = OrderedDict()
        self.bytes = 0

    def file(self, path: Path) -> CachedFile:
        key = _named(path)
        with self.lock:
            found = self._files.get(key)
            if found is None:
                found = self._files[key] = CachedFile(path)
            found.bytes = found.bytes or 0
            self._files.move_to_end(key)
            if len(self._files) > _FILES:
                self._empty(self._files.popitem(last=False)[1], None)
            return found

    def room(self, file: CachedFile, size: int) -> bool:
        """Takes more bytes for a file; False if there is no room for them."""
        if file.bytes is None:
            return False
        for each in self._files.values():
            if self.bytes + size <= KEPT_BYTES or each is file:
                break
            self._empty(each, 0)
        if self.bytes + size > KEPT_BYTES:
            return False
        file.bytes += size
        self.bytes += size
        return True

    def _empty(self, file: CachedFile, bytes_after: int | None) -> None:
        self.bytes -= file.bytes or 0
        file.bytes = bytes_after
        file.empty()

    def clear(self) -> None:
        with self.lock:
            for each in self._files.values():
                self._empty(each, None)
            self._files.clear()


_CACHE = _Cache()


def _named(path: Path) -> tuple[Any, ...] | None:
    """What names a file as it now is; None for a path that cannot be read."""
    try:
        file = path.stat()
    except OSError:
        return None
    return str(path.absolute()), file.st_ino, file.st_mtime_ns, file.st_ctime_ns, file.st_size


def cached_file(path: Path) -> CachedFile:
    """What is kept of a file as it now is; nothing of a path that cannot be read."""
    return CachedFile(path) if _named(path) is None else _CACHE.file(path)


def _forked() -> None:
    """A forked process begins with an empty cache: a thread of its parent may hold the locks."""
    global _CACHE
    _CACHE = _Cache()


os.register_at_fork(after_in_child=_forked)
