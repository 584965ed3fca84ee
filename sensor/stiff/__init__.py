"""The stiff pixel: capacitance, leak, comparator and reset switch, by closed forms and by general
solvers of differential equations that hold them true."""

from typing import TYPE_CHECKING, Any

from sensor.stiff.circuit import Circuit
from sensor.stiff.lumped import Lumped

if TYPE_CHECKING:
    from sensor.stiff.solvers import solved_train
    from sensor.stiff.train import spike_train

__all__ = ["Circuit", "Lumped", "solved_train", "spike_train"]


def __getattr__(name: str) -> Any:
    """What is compiled brings numba, half a second of start-up that no setting need wait for."""
    if name == "solved_train":
        from sensor.stiff.solvers import solved_train

        return solved_train
    if name == "spike_train":
        from sensor.stiff.train import spike_train

        return spike_train
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
