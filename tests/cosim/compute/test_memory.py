"""Free memory and cores, as control groups of Linux limit them: a made-up /sys/fs/cgroup."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import pytest

from cosim import InputError
from cosim.compute import cores, memory
from cosim.compute.cgroup import cores_in_groups, free_in_groups
from cosim.compute.memory import check_memory, check_program, free_memory
from scenarios.cli.maintenance.doctor import _memory

MIB = 1 << 20
V1 = ("memory.limit_in_bytes", "memory.usage_in_bytes", "total_inactive_file")
V2 = ("memory.max", "memory.current", "inactive_file")


def group(folder: Path, limit: object, used: int, idle: int | None, names=V2) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    (folder / names[0]).write_text(f"{limit}\n")
    (folder / names[1]).write_text(f"{used}\n")
    if idle is not None:
        (folder / "memory.stat").write_text(f"anon 5\n{names[2]} {idle}\nfile 7\n")


def own(place: Path, text: str) -> Path:
    (place / "own").write_text(text)
    return place / "own"


def test_the_tightest_group_above_the_process_counts(tmp_path: Path) -> None:
    file = own(tmp_path, "0::/batch/job\n")
    group(tmp_path, 900 * MIB, 100 * MIB, 0)
    group(tmp_path / "batch", 800 * MIB, 300 * MIB, None)
    group(tmp_path / "batch/job", "max", 50 * MIB, 0)
    assert free_in_groups(tmp_path, file) == 500 * MIB
    group(tmp_path / "batch/job", 200 * MIB, 150 * MIB, 120 * MIB)  # files that are read
    assert free_in_groups(tmp_path, file) == 170 * MIB
    group(tmp_path / "batch/job", 200 * MIB, 250 * MIB, 0)  # already over it
    assert free_in_groups(tmp_path, file) == 0


def test_groups_of_version_1(tmp_path: Path) -> None:
    file = own(tmp_path, "5:cpu,cpuacct:/x\n4:memory:/docker/ab\n0::/\n")
    group(tmp_path / "memory", 9223372036854771712, 100 * MIB, 0, V1)
    assert (free_in_groups(tmp_path, file) or 0) > 1 << 60
    group(tmp_path / "memory/docker/ab", 500 * MIB, 400 * MIB, 100 * MIB, V1)
    assert free_in_groups(tmp_path, file) == 200 * MIB


def test_a_container_that_sees_the_path_of_its_host(tmp_path: Path) -> None:
    group(tmp_path, 300 * MIB, 100 * MIB, None)
    assert free_in_groups(tmp_path, own(tmp_path, "0::/../../host/job\n")) == 200 * MIB
    assert free_in_groups(tmp_path, own(tmp_path, "0::/kubepods/pod\n")) == 200 * MIB


@pytest.mark.parametrize("text", ["", "0::/\n", "nonsense\n", "4:memory:/a\n"])
def test_no_limit(tmp_path: Path, text: str) -> None:
    assert free_in_groups(tmp_path, own(tmp_path, text)) is None
    assert free_in_groups(tmp_path, tmp_path / "none") is None


def test_the_tightest_group_of_cores_counts(tmp_path: Path) -> None:
    file = own(tmp_path, "5:cpu,cpuacct:/x\n0::/batch/job\n")
    assert cores_in_groups(tmp_path, file) is None
    for folder, limit in (("batch", "250000 100000"), ("batch/job", "max 100000")):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "cpu.max").write_text(f"{limit}\n")
    assert cores_in_groups(tmp_path, file) == 3
    (tmp_path / "cpu/x").mkdir(parents=True)
    (tmp_path / "cpu/x/cpu.cfs_period_us").write_text("100000\n")
    for quota, found in ((-1, 3), (50_000, 1)):
        (tmp_path / "cpu/x/cpu.cfs_quota_us").write_text(f"{quota}\n")
        assert cores_in_groups(tmp_path, file) == found


@pytest.mark.parametrize(("limit", "count"), [(None, 6), (2, 2), (9, 6)])
def test_cores_are_those_that_the_process_may_use(
    monkeypatch: pytest.MonkeyPatch, limit: int | None, count: int
) -> None:
    monkeypatch.setattr("os.sched_getaffinity", lambda _: set(range(6)))
    monkeypatch.setattr("os.cpu_count", lambda: 64)
    monkeypatch.setattr(cores, "_limit", lambda: limit)
    assert cores.cores() == count
    assert f", {count} cores" in _memory().state


def test_a_group_limits_what_a_run_may_take(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(memory, "free_in_groups", lambda: 100 * MIB)
    assert free_memory() == 100 * MIB
    check_memory("the run", 90 * MIB, "shorten it")
    with pytest.raises(InputError, match=r"for the 0\.0977 GiB of memory that is free"):
        check_memory("the run", 110 * MIB, "shorten it")


def test_a_limit_of_addresses_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    process = SimpleNamespace(memory_info=lambda: SimpleNamespace(rss=100 * MIB, vms=500 * MIB))
    monkeypatch.setattr(memory.psutil, "Process", lambda: process)
    monkeypatch.setattr(memory, "cores", lambda: 2)
    monkeypatch.setattr("resource.getrlimit", lambda _: (1500 * MIB, -1))
    check_program("the run", 400 * MIB, "shorten it")  # 300 more, 400 of libraries, 4 x 72
    check_program("the run", 800 * MIB, "shorten it", loaded=True)
    with pytest.raises(InputError) as refused:
        check_program("the run", 500 * MIB, "shorten it")
    assert str(refused.value) == (
        "the limit of the address space (ulimit -v) must be 1.55 GiB or more for this run, not "
        "1.46 GiB; raise it, or shorten it"
    )
