"""Spike streams in files: what opens them, what writes them."""

from cosim.files.dat import DatStream, write_dat
from cosim.files.intensities import read_intensities, write_intensities
from cosim.files.npz import read_npz, write_npz
from cosim.files.opening import FORMATS, open_stream, write_stream
from cosim.files.zarr_store import Recorder, ZarrStream, write_zarr

__all__ = [
    "FORMATS",
    "DatStream",
    "Recorder",
    "ZarrStream",
    "open_stream",
    "read_intensities",
    "read_npz",
    "write_dat",
    "write_intensities",
    "write_npz",
    "write_stream",
    "write_zarr",
]
