"""Spike streams in files: what opens them, what writes them."""

from cosim.files.config_yaml import Config, read_config, write_config
from cosim.files.dat import DatStream, write_dat
from cosim.files.event_file import read_events, write_events
from cosim.files.intensities import read_intensities, write_intensities
from cosim.files.npz import read_npz, write_npz
from cosim.files.opening import (
    FORMATS,
    ending_of,
    locate_stream,
    notes_of,
    open_stream,
    write_stream,
)
from cosim.files.raw import RawStream, write_raw
from cosim.files.zarr_store import Recorder, ZarrStream, write_zarr

__all__ = [
    "FORMATS",
    "Config",
    "DatStream",
    "RawStream",
    "Recorder",
    "ZarrStream",
    "ending_of",
    "locate_stream",
    "notes_of",
    "open_stream",
    "read_config",
    "read_events",
    "read_intensities",
    "read_npz",
    "write_config",
    "write_dat",
    "write_events",
    "write_intensities",
    "write_npz",
    "write_raw",
    "write_stream",
    "write_zarr",
]
