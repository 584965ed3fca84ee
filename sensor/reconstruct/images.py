"""The pictures of a run's instants, in its folder."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from cosim.report.png import write_linear_png
from sensor.reconstruct.fidelity import METHODS, Imaged

__all__ = ["write_images"]


def write_images(
    folder: Path, shots: Sequence[Imaged], methods: Sequence[str] = METHODS
) -> list[str]:
    """The linear pictures of every instant, 8-bit grey; their names in the folder."""
    if shots:
        (folder / "images").mkdir(exist_ok=True)
    names = []
    for shot in shots:
        for method in ("truth", *methods):
            names.append(f"images/{method}-{shot.cycle:05d}.png")
            write_linear_png(folder / names[-1], getattr(shot, method))
    return names
