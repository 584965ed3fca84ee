"""All documents' rows in order; what one document needs is imported for it alone."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from importlib import import_module
from typing import Final, NamedTuple

from scenarios.studies.paper.row import Row

__all__ = ["DOCUMENTS", "Document", "paper_rows"]


class Document(NamedTuple):
    """title: of the document. makers: functions that give its rows, by module and name."""

    title: str
    makers: tuple[tuple[str, str], ...]


DOCUMENTS: Final = {
    "000": Document(
        "Huang, Spiking Continuous Photographing Principle, Acta Electronica Sinica 50:2919 (2022)",
        (("spike_principle", "principle_rows"), ("spike_chips", "chip_rows")),
    ),
    "001": Document(
        "CMOS image sensor with wide dynamic range and adaptive exposure",
        (("adaptive_exposure", "adaptive_rows"),),
    ),
    "002": Document(
        "Yang, Qian, Liu, Lu, imaging circuit for an electron-bombarded CMOS sensor (EBAPS)",
        (("ebaps", "ebaps_rows"),),
    ),
    "003": Document(
        "Wang, Li, Ye, four drive modes of a frame-transfer electron-multiplying CCD",
        (("emccd", "emccd_rows"),),
    ),
    "004": Document(
        "Wang et al., patent on the dynamic range of a system from a hardware model (2017)",
        (("dynamic_range", "dynamic_range_rows"),),
    ),
}
"""By number, as the sources are numbered."""


def paper_rows(documents: tuple[str, ...] = tuple(DOCUMENTS)) -> Iterator[Row]:
    """Rows of these documents, in order, as they are computed."""
    for name in documents:
        for module, maker in DOCUMENTS[name].makers:
            make: Callable[[], list[Row]] = getattr(
                import_module(f"scenarios.studies.paper.{module}"), maker
            )
            yield from make()
