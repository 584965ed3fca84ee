"""Light as it comes: in steps as long as the scene allows, for pixels without a common clock, and
frame by frame, for cameras that are live."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from cosim.clock import Clock
from cosim.errors import InputError
from cosim.light.light import Light, Piece, Plane
from cosim.light.source import Source
from cosim.stage import BLOCK, Block


def light_steps(
    source: Source,
    relay: Callable[[Light], Light],
    clock: Clock,
    stop: int,
    most: int | None = None,
) -> Iterator[tuple[Light, int, int]]:
    """Yields (light on the pixels, start, stop) for consecutive steps, in picoseconds.

    A step is the whole run if the light of the scene is known that far, and otherwise a block.

    Args:
        source: scene.
        relay: map from the light of the scene to the light on the pixels.
        clock: clock of the blocks.
        stop: end of the run, ps.
        most: upper limit of a step, cycles; None for no limit.
    """
    cycle, start = 0, 0
    cycles = clock.cycle_at(stop - 1) + 1
    while start < stop:
        block = Block(cycle, min(BLOCK, most or BLOCK, cycles - cycle))
        light = relay(source.step(None, block))
        cycle = block.stop
        if light.pieces[-1].stop >= stop:
            cycle = cycles if most is None else min(cycles, block.start + most)
        until = min(stop, clock.edge(cycle))
        yield light, start, until
        start = until


def is_steady(light: Light, stop: int) -> bool:
    """Whether the light is one level a pixel from its first instant to `stop` (ps)."""
    piece = light.pieces[0]
    return piece.constant and piece.stop >= stop


class PushedLight:
    """Light that comes frame by frame, and is linear in time between two frames.

    Args:
        most: brightest light of the scene, lux, that is taken.
        frames: clock of the frames.
        relay: map from the light of the scene to the light on the pixels.
    """

    def __init__(self, most: float, frames: Clock, relay: Callable[[Light], Light]) -> None:
        self._most, self._frames, self._relay = most, frames, relay
        self._count = 0
        self._last: Plane | None = None
        self._pieces: list[Piece] = []

    def push(self, plane: Plane) -> int | None:
        """Takes the next frame.

        Args:
            plane: (H, W) float32, lux of the scene at the instant of the frame.

        Returns:
            That instant, ps, up to which the light is known; None for the first frame.

        Raises:
            InputError: light outside 0 to `most`.
        """
        top = float(plane.max(initial=0))
        if not (plane.min(initial=0) >= 0 and top <= self._most * (1 + 1e-6)):
            raise InputError(
                "the light of a frame", f"from 0 to the {self._most:g} lux that was planned for",
                f"up to {top:g} lux", "open another camera with a larger white",
            )  # fmt: skip
        before, self._last = self._last, plane
        number, self._count = self._count, self._count + 1
        if before is None:
            return None
        begin, end = self._frames.edge(number - 1), self._frames.edge(number)
        self._pieces.append(Piece(begin, end, before, plane))
        return end

    def light(self) -> Light:
        """The light on the pixels since the instant that was forgotten last."""
        return self._relay(Light(tuple(self._pieces)))

    def forget(self, needed: int) -> None:
        """Gives back the light before an instant, ps, from which on it is needed."""
        self._pieces = [piece for piece in self._pieces if piece.stop > needed]
