"""Tasks on the workers of a Dask scheduler."""

from __future__ import annotations

import time
from collections.abc import Iterator
from typing import Any

import pytest
from distributed import KilledWorker, LocalCluster, as_completed

from cosim import InputError
from cosim.run.workers import workers_for


@pytest.fixture
def cluster() -> Iterator[LocalCluster]:
    with LocalCluster(
        n_workers=0, processes=False, dashboard_address=None, host="127.0.0.1", protocol="tcp://"
    ) as made:
        yield made


def test_a_scheduler_that_ends_and_workers_that_are_lost_are_one_line(
    cluster: LocalCluster, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    def too_often(keys: Any) -> Any:
        raise KilledWorker("task", None, 3)

    def ended(keys: Any) -> Any:
        cluster.close()
        return as_completed(keys)

    lines = {
        too_often: r"memory for a task, not one of which 4 ended with the same task; give them",
        ended: r"--scheduler must be a Dask scheduler that runs until the end, not one that has",
    }
    for happens, line in lines.items():
        monkeypatch.setattr("distributed.as_completed", happens)
        with (
            pytest.raises(InputError, match=line),
            workers_for(1, cluster.scheduler_address) as pool,
        ):
            dict(pool.run(time.sleep, {1: (600,)}))
    assert capfd.readouterr().err == ""
