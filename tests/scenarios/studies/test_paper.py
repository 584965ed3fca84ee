"""`viform paper`: every row holds, none is a copied constant, and a wrong number is seen."""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import Any

import pytest

from cosim.run.printed import PrintedRow, agreement, listed, number, unprinted
from scenarios.studies.paper import DOCUMENTS, paper_rows


@pytest.fixture(scope="module")
def rows() -> list[PrintedRow]:
    return list(paper_rows())


def test_every_row_holds(rows: list[PrintedRow]) -> None:
    assert [row for row in rows if not row.holds] == []
    for name in DOCUMENTS:
        assert sum(row.source.startswith(name) for row in rows) >= 10


def test_every_row_says_what_computed_it(rows: list[PrintedRow]) -> None:
    assert {row.by for row in rows} <= {"run", "component", "formula", "constant"}
    for name in DOCUMENTS:
        simulated = [r for r in rows if r.source.startswith(name) and r.by in ("run", "component")]
        assert simulated, name
    assert sum(row.by in ("run", "component") for row in rows) >= 100


def test_a_document_s_errors_are_proved_and_told(rows: list[PrintedRow]) -> None:
    wrong = {
        (r.source, r.printed, r.computed) for r in rows
        if (r.printed is not None and r.relation == "=" and "the document" in r.note
        and isinstance(r.printed, int | float) and abs(r.printed - r.computed) > 0.05 * r.computed)
        or (r.source == "000 §6" and r.what == "450 x 200")
    }  # fmt: skip
    # N at 0.1 s, 450 x 200, 100 frames/s at 65 ms, 37-50 V, gains counted twice, and noises added.
    found = {(s, p) for s, p, _ in wrong}
    assert ("000 §4.5", 10) in found and ("000 §6", 100_000) in found
    assert ("001 §5", 100) in found and ("003 §3", 50) in found
    named = [r for r in rows if "the document's error" in r.note]
    assert {r.source for r in named} >= {
        "000 §4.5", "000 §6", "001 §3.3", "001 §5", "003 §2", "004 formula",
    }  # fmt: skip
    assert any("contradicts itself" in r.note and r.source == "004 fig. 2" for r in rows)


@pytest.mark.parametrize(
    ("printed", "computed", "how"),
    [
        ("3.5", 3.492, "rounded"), ("65", 65.536, "cut"), ("4", 4.096, "rounded"),
        ("64.08", 64.0824, "rounded"), ("64.08", 64.07, None), ("65", 66.01, None),
        ("65", 64.4, None), ("4.09e10", 4.0907e10, "rounded"), ("4.09e10", 4.11e10, None),
        ("-10", -10.4, "rounded"), ("-10", -10.7, "cut"), ("-10", -9.4, None), ("3", 2.0, None),
        ("3", float("inf"), None), ("3", float("nan"), None),
    ],
)  # fmt: skip
def test_digits_agree_as_printed(printed: str, computed: float, how: str | None) -> None:
    assert agreement(printed, computed) == how
    assert number("", "", printed, computed, by="formula").holds is (how is not None)


def test_a_proof_is_needed_where_the_document_errs_and_only_there() -> None:
    assert number("", "", "10", 100.0, by="formula", proof=True).holds
    assert not number("", "", "10", 100.0, by="formula", proof=False).holds
    assert not number("", "", "10", 10.0, by="formula", proof=True).holds  # then there is no error
    assert not listed("", "", [1, 5], [1, 6], by="formula").holds
    assert not number("", "", "5.165", 6.0, by="formula", relation="<").holds
    assert number("", "", "0.1", 0.06, by="formula", relation="<=").holds
    assert not unprinted("", "", 1.0, by="formula", holds=False, note="").holds


def test_the_command_prints_both_forms(
    viform: Callable[..., Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    answer = viform("paper", "004", "--json")
    found = json.loads(answer.out)["rows"]
    assert answer.code == 0
    assert set(found[0]) == {
        "source", "what", "printed", "relation", "computed", "unit", "holds", "note", "by",
    }  # fmt: skip
    text = viform("paper", "004")
    assert text.code == 0 and "64.08" in text.out and "rows hold" in text.out
    from imagers.hardware_chain import paper

    monkeypatch.setattr(paper, "sensor_dynamic_range", lambda a, b: 60.0)
    assert viform("paper", "004", "--json").code == 1


def test_a_document_that_is_none_is_refused(viform: Callable[..., Any]) -> None:
    answer = viform("paper", "005")
    assert answer.code == 2 and answer.err.count("\n") == 1 and "000, 001" in answer.err
