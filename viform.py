"""Viform: a spike camera, a spike-continuous display and an optical link, simulated together.

    import viform
    spikes = viform.film("clip.mp4", tolerance=1e-3)
    image = viform.reconstruct(spikes, at=1280)

The names are those of the parts; each is imported when it is first used.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from cosim import Clock, InputError, Viform
    from scenarios.python import Camera, Run, Stream, film, reconstruct, run, send, show
    from scenarios.python import open_stream as open
    from scenarios.python import save_stream as save
    from scenarios.studies.dataset.making import dataset
    from scenarios.studies.dataset.reading import SpikeDataset, torch_dataset

_PLACES = {
    "Camera": "scenarios.python:Camera",
    "Clock": "cosim:Clock",
    "InputError": "cosim:InputError",
    "Run": "scenarios.python:Run",
    "SpikeDataset": "scenarios.studies.dataset.reading:SpikeDataset",
    "Stream": "scenarios.python:Stream",
    "Viform": "cosim:Viform",
    "dataset": "scenarios.studies.dataset.making:dataset",
    "film": "scenarios.python:film",
    "open": "scenarios.python:open_stream",
    "reconstruct": "scenarios.python:reconstruct",
    "run": "scenarios.python:run",
    "save": "scenarios.python:save_stream",
    "send": "scenarios.python:send",
    "show": "scenarios.python:show",
    "torch_dataset": "scenarios.studies.dataset.reading:torch_dataset",
}

__all__ = [
    "Camera", "Clock", "InputError", "Run", "SpikeDataset", "Stream", "Viform", "dataset", "film",
    "open", "reconstruct", "run", "save", "send", "show", "torch_dataset",
]  # fmt: skip


def __getattr__(name: str) -> Any:
    if name not in _PLACES:
        raise AttributeError(f"module 'viform' has no attribute {name!r}")
    module, _, attribute = _PLACES[name].partition(":")
    value = getattr(import_module(module), attribute)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return __all__
