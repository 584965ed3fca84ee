"""The stiff pixel: capacitance, leak, comparator and reset switch, by closed forms (train.py) and
by general solvers of differential equations that hold them true (solvers.py). Those two are
imported by themselves: they bring numba, half a second of start-up that no setting need wait for.
"""

from sensor.circuit.circuit import Circuit
from sensor.circuit.lumped import Lumped

__all__ = ["Circuit", "Lumped"]
