"""The rows of all source documents. The modules of a document are imported when its rows are
computed."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from importlib import import_module
from typing import Final, NamedTuple

from cosim.run.printed import PrintedRow
from imagers.catalogue import IMAGERS

Rows = Callable[[], list[PrintedRow]]


class Document(NamedTuple):
    """A source document.

    Attributes:
        title: title of the document.
        makers: functions that return its rows.
    """

    title: str
    makers: tuple[Rows, ...]


def _rows(module: str, function: str) -> Rows:
    """A function of a module in this package, which is imported at the first call."""

    def compute() -> list[PrintedRow]:
        rows: list[PrintedRow] = getattr(
            import_module(f"scenarios.studies.paper.{module}"), function
        )()
        return rows

    return compute


_OF_SPIKE_CAMERAS: Final = {
    "000": Document(
        "Huang, Spiking Continuous Photographing Principle, Acta Electronica Sinica 50:2919 (2022)",
        (_rows("spike_camera", "principle_rows"), _rows("spike_camera", "chip_rows")),
    ),
}
_OF_IMAGERS: Final = {
    kind.document[0]: Document(kind.document[1], (kind.printed,))
    for kind in IMAGERS.values() if kind.document is not None
}  # fmt: skip
DOCUMENTS: Final = dict(sorted({**_OF_SPIKE_CAMERAS, **_OF_IMAGERS}.items()))
"""The documents by their numbers."""


def paper_rows(documents: tuple[str, ...] = tuple(DOCUMENTS)) -> Iterator[PrintedRow]:
    """Yields the rows of these documents, in order."""
    for name in documents:
        for make in DOCUMENTS[name].makers:
            yield from make()
