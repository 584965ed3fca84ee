"""One lost, changed or added byte: the bring-up never names a wrong direction, and names the right
one whenever the board's counters determine it."""

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
"""Kinds of faults that imply a direction."""


class OneByte(EveryByte):
    """Affects only the `n`-th byte of a direction, from 1."""

    def hits(self) -> bool:
        return self.count == self.n


def result_of(kind: str, way: str, number: int) -> tuple[str, str]:
    """Result of a fault ("named", "open", "unseen" or the stage's kind), and the cause."""
    port = OneByte(kind, way, number, number % 8)
    report = bring_up(port, BringUp(simulated=True, frames=2))
    if port.count < number:
        return "not met", ""
    text = f"{kind}:{way}@{number}: {report.cause}"
    if report.ok:
        return "unseen", text
    stage = report.failed
    assert stage is not None and stage.kind != "restarted", text
    if stage.kind in OF_WAY:
        assert OF_WAY[stage.kind] == way, text
    line = stage.figures.get("line")
    if line is None:
        return stage.kind or "", text
    assert set(line["directions"]) <= {WAYS[way]}, text
    if not line["directions"]:
        return "open", text
    field = f"{WAYS[way].replace('-', '_')}_{DID[kind]}"
    assert line[field] >= 1, text
    assert f"{WAYS[way].replace('-', ' ')}".replace("to ", "to the ").replace(
        "from ", "from the "
    ) in str(stage.cause), text
    if kind != "flip":
        assert line[field] == 1, text
    return "named", text


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
        result, text = result_of(kind, way, number)
        counts[result] += 1
        if result not in ("named", "not met"):
            others.append(f"{result}: {text}")
    print(f"\n{kind}:{way}", dict(counts), *others, sep="\n  ")
    assert counts["named"] > 0
    if kind != "flip":
        assert set(counts) <= {"named", "not met"}, "\n".join(others)


class Late(ModelPort):
    """Answers two seconds late."""

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
def test_a_line_that_is_cut_at_once_is_reported(way):
    """At the first reading of the counters, which start from 0 at power-on."""

    class Cut(OneByte):
        def _spoil(self, data: list) -> list:
            self.count += len(data)
            return [] if self.count - len(data) < self.n <= self.count else data

    report = bring_up(Cut("drop", way, 50), BringUp(simulated=True))
    assert report.failed is not None
    assert report.failed.figures["line"]["directions"] == [WAYS[way]], report.cause


def test_a_board_that_restarted_has_lost_no_bytes():
    """It counted fewer bytes than were sent, without a write or a cut before."""
    port = ModelPort(SIZE)
    bone = Uartbone(port)
    bone.read(0)
    line = LineMonitor(bone, default_map())
    line.begin()
    assert line.take_evidence().clean
    port._power_on()
    bone.read(0)
    evidence = line.take_evidence()
    assert not evidence.known
    assert evidence.directions == []


def test_nine_thousand_six_hundred_baud_are_within_the_times():
    """Also with an adapter that delays each answer by 16 ms."""
    port = ModelPort(SIZE._replace(baud=9600))
    report = bring_up(port, BringUp(baud=9600, simulated=False, frames=8))
    assert report.ok, report.cause
    for stage in report.stages:
        assert stage.seconds < 0.5 * ALLOWED_S.get(stage.name, 60.0), stage.name
