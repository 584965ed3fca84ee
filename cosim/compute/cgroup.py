"""The memory and the cores that control groups leave to this process, as a container or a batch
system sets them.

Every group above the process counts. What the system would give up without loss, files that are
read and not in use, counts as free: a group's usage contains them.

Sources: Linux, Documentation/admin-guide/cgroup-v2.rst (memory.max, memory.current, memory.stat,
cpu.max), cgroup-v1/memory.rst (memory.limit_in_bytes, memory.usage_in_bytes), and
scheduler/sched-bwc.rst (cpu.cfs_quota_us, cpu.cfs_period_us).
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Final, NamedTuple

_GROUPS: Final = Path("/sys/fs/cgroup")
_OWN: Final = Path("/proc/self/cgroup")


class _Files(NamedTuple):
    """Names of a group's files, and of the entry in the third that says what can be given up."""

    limit: str
    usage: str
    stat: str
    idle: str


_V2: Final = _Files("memory.max", "memory.current", "memory.stat", "inactive_file")
_V1: Final = _Files(
    "memory.limit_in_bytes", "memory.usage_in_bytes", "memory.stat", "total_inactive_file"
)


def free_in_groups(groups: Path = _GROUPS, own: Path = _OWN) -> int | None:
    """Bytes that this process may still take; None without a limit, or where none can be read.

    Args:
        groups: folder in which the groups are mounted.
        own: file that says which are those of this process.
    """
    free = [
        left
        for folder, second in _above("memory", groups, own)
        if (left := _left(folder, _V2 if second else _V1)) is not None
    ]
    return max(min(free), 0) if free else None


def cores_in_groups(groups: Path = _GROUPS, own: Path = _OWN) -> int | None:
    """Number of cores whose time this process may take, rounded up; None without a limit, or where
    none can be read. Args as for `free_in_groups`."""
    shares = []
    for folder, second in _above("cpu", groups, own):
        with suppress(OSError, ValueError):  # `max`, or no such file
            if second:
                quota, period = map(int, (folder / "cpu.max").read_bytes().split())
            else:
                quota = int((folder / "cpu.cfs_quota_us").read_bytes())  # -1 without a limit
                period = int((folder / "cpu.cfs_period_us").read_bytes())
            if quota > 0 and period > 0:
                shares.append(-(-quota // period))
    return min(shares, default=None)


def _above(controller: str, groups: Path, own: Path) -> Iterator[tuple[Path, bool]]:
    """The groups of this process for a controller, and those that contain them, and whether they
    are of version 2. Within a container the path may be that of the host, which is not mounted:
    then what is mounted is the container's own."""
    try:
        lines = own.read_text(encoding="utf-8").splitlines()
    except OSError:
        return
    for line in lines:
        _, controllers, path = (*line.split(":", 2), "", "")[:3]
        if controller in controllers.split(","):
            root, second = groups / controller, False
        elif not controllers:
            root, second = groups, True
        else:
            continue
        place = root / path.lstrip("/")
        while place != root and place.is_relative_to(root):
            yield place, second
            place = place.parent
        yield root, second


def _left(folder: Path, files: _Files) -> int | None:
    """What one group leaves; None without a limit."""
    with suppress(OSError, ValueError):  # `max`, or no such file
        limit = int((folder / files.limit).read_text(encoding="utf-8"))
        used = int((folder / files.usage).read_text(encoding="utf-8"))
        idle = 0
        with suppress(OSError, ValueError):
            for line in (folder / files.stat).read_text(encoding="utf-8").splitlines():
                if line.startswith(f"{files.idle} "):
                    idle = int(line.split()[1])
        return limit - max(used - idle, 0)
    return None
