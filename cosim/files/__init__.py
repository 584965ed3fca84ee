"""Spike streams in files: reading and writing of all formats."""

from cosim.files.event_file import write_events
from cosim.files.opening import (
    FORMATS,
    ending_of,
    locate_stream,
    losses,
    notes_of,
    open_stream,
    write_stream,
)
from cosim.files.recorder import NOT_KEPT, STORES, Recorder, kept_bytes, storing, streams_kept
from cosim.files.zarr_store import ZarrStream

__all__ = [
    "FORMATS",
    "NOT_KEPT",
    "STORES",
    "Recorder",
    "ZarrStream",
    "ending_of",
    "kept_bytes",
    "locate_stream",
    "losses",
    "notes_of",
    "open_stream",
    "storing",
    "streams_kept",
    "write_events",
    "write_stream",
]
