"""Types of the module `viform`, whose names are imported when they are first used."""

from cosim import Clock, InputError, Viform
from scenarios.python import Camera, Display, Link, Run, Stream, film, reconstruct, run, send, show
from scenarios.python import open_stream as open
from scenarios.python import save_stream as save
from scenarios.python.training import SpikeStream
from scenarios.studies.dataset.build import dataset
from scenarios.studies.dataset.reading import SpikeDataset, torch_dataset

__all__ = [
    "Camera", "Clock", "Display", "InputError", "Link", "Run", "SpikeDataset", "SpikeStream",
    "Stream", "Viform", "dataset", "film", "open", "reconstruct", "run", "save", "send", "show",
    "torch_dataset",
]  # fmt: skip
