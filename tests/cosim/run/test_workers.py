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
        n_workers=0,
        processes=False,
        dashboard_address="127.0.0.1:0",
        host="127.0.0.1",
        protocol="tcp://",
    ) as made:
        yield made


def test_a_scheduler_that_ends_and_workers_that_are_lost_are_one_line(
    cluster: LocalCluster, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    def too_often(keys: Any) -> Any:
        raise KilledWorker("task", None, 3)  # type: ignore[arg-type]

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


@pytest.mark.parametrize(
    ("address", "why"),
    [
        ("tls://127.0.0.1:9", "no certificate: distributed.comm.tls of Dask's configuration"),
        ("nowhere", "no address"),
    ],
)  # fmt: skip
def test_an_address_that_is_none_is_one_line(address: str, why: str) -> None:
    with pytest.raises(InputError, match=why), workers_for(1, address):
        pass
