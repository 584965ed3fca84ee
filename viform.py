"""Viform: a spike camera, a spike-continuous display and an optical link, simulated together.

    import viform
    spikes = viform.film("clip.mp4", tolerance=1e-3)
    image = viform.reconstruct(spikes, at=1280)

The names are those of the parts; each is imported when it is first used. Their types stand in
`viform-stubs`: this module is a single file, which cannot be marked as typed.
"""

from __future__ import annotations

import signal
import sys
import warnings
from importlib import import_module
from importlib.machinery import ModuleSpec, PathFinder
from pathlib import Path
from typing import Any

_PLACES = {
    "Camera": "scenarios.python:Camera",
    "Clock": "cosim:Clock",
    "Display": "scenarios.python:Display",
    "InputError": "cosim:InputError",
    "Link": "scenarios.python:Link",
    "Run": "scenarios.python:Run",
    "SpikeDataset": "scenarios.studies.dataset.reading:SpikeDataset",
    "SpikeStream": "scenarios.python.training:SpikeStream",
    "Stream": "scenarios.python:Stream",
    "Viform": "cosim:Viform",
    "dataset": "scenarios.studies.dataset.build:dataset",
    "film": "scenarios.python:film",
    "open": "scenarios.python:open_stream",
    "reconstruct": "scenarios.python:reconstruct",
    "run": "scenarios.python:run",
    "save": "scenarios.python:save_stream",
    "send": "scenarios.python:send",
    "show": "scenarios.python:show",
    "torch_dataset": "scenarios.studies.dataset.reading:torch_dataset",
}

__all__ = list(_PLACES)


_HERE = Path(__file__).resolve().parent
_PACKAGES = ("cosim", "display", "imagers", "link", "rtl_model", "scenarios", "sensor")


class _Packages:
    """Finds the packages of viform beside this file, whatever else has their names: a `sensor.py`
    beside the user's script comes first in `sys.path`. Other modules are found as ever."""

    @staticmethod
    def find_spec(name: str, path: object = None, target: object = None) -> ModuleSpec | None:
        return PathFinder.find_spec(name, [str(_HERE)]) if name in _PACKAGES else None


def _another(spec: ModuleSpec | None, name: str) -> str:
    """The place of a module that has the name of a package of viform and is none; else ""."""
    if spec is None:
        return ""
    place = spec.origin or next(iter(spec.submodule_search_locations or ()), "")
    return "" if Path(place).resolve() == _HERE / name / "__init__.py" else place


def _claim_names() -> dict[str, str]:
    """Makes this process find the packages of viform by their names; returns the places of the
    modules that are hidden by that, by name. Raises ImportError if one of them was imported."""
    hidden = {}
    for name in _PACKAGES:
        if name in sys.modules:
            if place := _another(sys.modules[name].__spec__, name):
                raise ImportError(
                    f"{name} must be the package of viform, not {place}, which was imported first: "
                    "rename that"
                )
        elif place := _another(PathFinder.find_spec(name), name):
            hidden[name] = place
    sys.meta_path.insert(0, _Packages)
    return hidden


_HIDDEN = _claim_names()


def main() -> None:
    """Runs the command `viform`."""
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, signal.SIG_DFL)  # Ctrl-C while it starts: no traceback
    import_module("scenarios.cli").main()


def __getattr__(name: str) -> Any:
    if name not in _PLACES:
        raise AttributeError(f"module 'viform' has no attribute {name!r}")
    while _HIDDEN:  # the command, which uses no name of this file, need not say so
        module, place = _HIDDEN.popitem()
        warnings.warn(
            f"`import {module}` gives the package of viform, not {place}: rename that if your "
            "program imports it", stacklevel=2,
        )  # fmt: skip
    module, _, attribute = _PLACES[name].partition(":")
    value = getattr(import_module(module), attribute)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return __all__
