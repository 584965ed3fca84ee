"""Delivery of the received file, and the verdict."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final

from cosim.files.whole import whole
from cosim.run.result import dumps
from link.receiving import Received
from link.setting import Payload
from link.setup.setup import FileSetup
from link.verdict import Cause, Verdict

RECEIVED: Final = "received"
"""Folder of the received file in a run's folder."""
VERDICT: Final = "verdict.json"
"""File of the verdict in a run's folder."""


def judge_delivery(setup: FileSetup, received: Received) -> tuple[Verdict, bool]:
    """Verdict, and whether the file arrived as it was sent."""
    delivered = received.delivered
    if delivered is not None:
        if delivered == (setup.payload.data, setup.payload.name):
            return received.verdict, True
        text = "the receiver took other bytes for the file: nothing is handed out"
        return Verdict(Cause.NOISY, text), False
    if setup.shortened:
        text = f"{received.verdict.text}; {setup.shortened_message()}"
        return Verdict(received.verdict.cause, text), False
    if not setup.sent.sent_whole and received.verdict.cause in (Cause.TRUNCATED, Cause.NOISY):
        text = (
            f"the run's duration has room for {setup.sent.symbols} symbols, which do not hold the "
            f"file's {len(setup.payload.data):,} bytes; lengthen duration or leave it out"
        )
        return Verdict(Cause.TOO_LARGE, text), False
    return received.verdict, False


def write_delivery(
    folder: Path, payload: Payload, delivered: bool, verdict: dict[str, Any]
) -> list[str]:
    """Writes the document of the verdict, and the file if it was delivered. Returns their names."""
    names = [VERDICT]
    place = folder / RECEIVED / payload.name
    for old in (folder / RECEIVED).glob("*"):
        old.unlink()
    if delivered:
        (folder / RECEIVED).mkdir(exist_ok=True)
        with whole(place) as part:
            part.write_bytes(payload.data)
        names.append(f"{RECEIVED}/{payload.name}")
    with whole(folder / VERDICT) as part:
        part.write_text(dumps(verdict) + "\n", encoding="utf-8")
    return names
