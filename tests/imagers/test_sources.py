"""Sources that the pages of imagers name."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import pytest

from imagers.catalogue import IMAGERS
from imagers.report.page import ImagerRun, _simulated


def run_of(title: str) -> ImagerRun:
    planned = SimpleNamespace(
        model=SimpleNamespace(shape=(30, 40)), spec=SimpleNamespace(title=title)
    )
    result = SimpleNamespace(simulated_s=0.064)
    made: Any = SimpleNamespace(planned=planned, run=SimpleNamespace(result=result))
    return cast(ImagerRun, made)


def test_each_source_is_a_number_and_a_name_of_its_own() -> None:
    documents = [kind.document for kind in IMAGERS.values() if kind.document is not None]
    assert documents and len(set(documents)) == len(documents)
    for number, name in documents:
        assert number.isdecimal() and len(number) == 3
        assert name and name == name.strip() and not name.endswith(".")  # the page adds the stop


@pytest.mark.parametrize("name", IMAGERS)
def test_a_page_names_the_source_of_its_imager(name: str) -> None:
    kind = IMAGERS[name]
    text = _simulated(kind, run_of("A chart"))
    assert "40 x 30 pixels" in text and kind.title in text
    if kind.document is None:
        assert "source" not in text
    else:
        assert text.endswith(f"Its source, to whose figures this page refers: {kind.document[1]}.")
