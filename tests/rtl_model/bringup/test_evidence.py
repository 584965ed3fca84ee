"""One byte of the line lost, changed or added: the direction that the bring-up names is never
wrong, and where the board's counters can tell it, it is named."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

import pytest

from rtl_model.bringup.bench.monitor import LineMonitor
from rtl_model.bringup.run import ALLOWED_S, BringUp, bring_up
from rtl_model.host import Uartbone, default_map
from tests.rtl_model.bringup.faulty_ports import SIZE, EveryByte
from tests.rtl_model.bringup.model_port import ModelPort

WAYS = {"rx": "to-board", "tx": "from-board"}
DID = {"drop": "lost", "extra": "added", "flip": "changed"}
OF_WAY = {
    "from-board": "tx", "to-board": "rx", "words-lost": "rx", "words-changed": "rx",
    "bytes-lost": "rx", "bytes-added": "rx", "framing-errors": "rx", "watchdog-aborts": "rx",
    "unknown-commands": "rx",
}  # fmt: skip
"""Kinds of stages that name a way by themselves."""


class OneByte(EveryByte):
    """The `n`-th byte of a way alone, from 1."""

    def hits(self) -> bool:
        return self.count == self.n


def seen(kind: str, way: str, number: int) -> tuple[str, str]:
    """What became of the fault: (found, missed, open or the stage's own kind; the cause)."""
    port = OneByte(kind, way, number, number % 8)
    report = bring_up(port, BringUp(simulated=True, frames=2))
    if port.count < number:
        return "not met", ""
    told = f"{kind}:{way}@{number}: {report.cause}"
    if report.ok:
        return "unseen", told
    stage = report.failed
    assert stage is not None and stage.kind != "restarted", told
    if stage.kind in OF_WAY:
        assert OF_WAY[stage.kind] == way, told
    line = stage.figures.get("line")
    if line is None:
        return stage.kind or "", told
    assert set(line["directions"]) <= {WAYS[way]}, told
    if not line["directions"]:
        return "open", told
    field = f"{WAYS[way].replace('-', '_')}_{DID[kind]}"
    assert line[field] >= 1, told
    assert f"{WAYS[way].replace('-', ' ')}".replace("to ", "to the ").replace(
        "from ", "from the "
    ) in str(stage.cause), told
    if kind != "flip":
        assert line[field] == 1, told
    return "named", told


@pytest.mark.parametrize("kind", DID)
@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize(
    ("first", "last", "step"),
    [(100, 900, 97), pytest.param(99, 28_500, 607, marks=pytest.mark.slow)],
    ids=["some", "many"],
)
def test_the_direction_named_is_never_wrong(kind, way, first, last, step):
    counts: Counter[str] = Counter()
    others = []
    for number in range(first, last, step):
        became, told = seen(kind, way, number)
        counts[became] += 1
        if became not in ("named", "not met"):
            others.append(f"{became}: {told}")
    print(f"\n{kind}:{way}", dict(counts), *others, sep="\n  ")
    assert counts["named"] > 0
    if kind != "flip":
        assert set(counts) <= {"named", "not met"}, "\n".join(others)


class Late(ModelPort):
    """Answers come two seconds late."""

    def answer(self, data: bytes, clocks: Sequence[int]) -> None:
        super().answer(data, [clock + 2 * SIZE.clock_hz for clock in clocks])


@pytest.mark.parametrize("simulated", [True, False])
def test_a_board_that_answers_late_is_slow(simulated):
    report = bring_up(Late(SIZE), BringUp(simulated=simulated))
    assert report.failed is not None and report.failed.kind == "slow", report.cause
    assert report.failed.figures["late_s"] == pytest.approx(2.0, abs=0.01)
    assert "--time-scale 1" in str(report.cause)
    scale = report.failed.figures["time_scale"]
    again = bring_up(Late(SIZE), BringUp(simulated=simulated, time_scale=scale, frames=2))
    assert [stage.outcome for stage in again.stages[:4]] == ["ok"] * 4, again.cause


@pytest.mark.parametrize("way", WAYS)
def test_a_line_that_is_cut_at_once_is_told(way):
    """While the counters are first read: a board that was just switched on counts from 0."""

    class Cut(OneByte):
        def _spoil(self, data: list) -> list:
            self.count += len(data)
            return [] if self.count - len(data) < self.n <= self.count else data

    report = bring_up(Cut("drop", way, 50), BringUp(simulated=True))
    assert report.failed is not None
    assert report.failed.figures["line"]["directions"] == [WAYS[way]], report.cause


def test_a_board_that_began_anew_has_lost_no_bytes():
    """Though it counted fewer than were sent, and nothing had been written or cut before."""
    port = ModelPort(SIZE)
    bone = Uartbone(port)
    bone.read(0)
    line = LineMonitor(bone, default_map())
    line.begin()
    assert line.take_evidence().clean
    port._power_on()
    bone.read(0)
    found = line.take_evidence()
    assert not found.known
    assert found.directions == []


def test_nine_thousand_six_hundred_baud_are_within_the_times():
    """With an adapter that holds each answer back by 16 ms as well."""
    port = ModelPort(SIZE._replace(baud=9600))
    report = bring_up(port, BringUp(baud=9600, simulated=False, frames=8))
    assert report.ok, report.cause
    for stage in report.stages:
        assert stage.seconds < 0.5 * ALLOWED_S.get(stage.name, 60.0), stage.name
