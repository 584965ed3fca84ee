"""The stiff pixel: capacitance, leak, comparator and reset switch, by closed forms and by general
solvers of differential equations that hold them true."""

from sensor.stiff.circuit import Circuit
from sensor.stiff.lumped import Lumped
from sensor.stiff.solvers import solved_train
from sensor.stiff.train import spike_train

__all__ = ["Circuit", "Lumped", "solved_train", "spike_train"]
