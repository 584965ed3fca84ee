"""The stiff pixel: capacitance, leak, comparator and reset switch.

Closed forms (phases.py) and general solvers of differential equations that hold them true
(solvers.py) bring numba, so they are imported by themselves.
"""
