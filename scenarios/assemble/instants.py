"""Selects the cycles whose images are reconstructed."""

from __future__ import annotations

from cosim import InputError
from scenarios.assemble.schema.scenario import ImageSection, RecordingScenario, Scenario


def choose_instants(scenario: Scenario | RecordingScenario, cycles: int) -> list[int]:
    """Cycles of sensor.clock whose images are reconstructed; see `even_instants`."""
    return even_instants(scenario.image, cycles)


def even_instants(image: ImageSection, cycles: int) -> list[int]:
    """Cycles of images: `image.at`, or five evenly spaced cycles by default.

    Raises:
        InputError: a cycle of `image.at` is beyond the end of the run.
    """
    at = image.at or tuple(sorted({cycles * (2 * i + 1) // 10 for i in range(5)}))
    beyond = [n for n in at if n >= cycles]
    if beyond:
        raise InputError(
            "image.at", f"cycles below {cycles}", f"{beyond[0]}", "lengthen duration or drop it"
        )
    return list(at)


def check_window(image: ImageSection) -> None:
    """Raises InputError for a centred window of an even number of cycles."""
    if image.window % 2 == 0 and not image.preceding:
        raise InputError("image.window", "odd", str(image.window), f"set {image.window + 1}")


def choose_windows(scenario: Scenario | RecordingScenario, cycles: int) -> list[int]:
    """The same for a latched stream. Each cycle has a window of `image.window` cycles.

    Raises:
        InputError: a centred window is even, the window is longer than the run, or a cycle is
            beyond the end.
    """
    check_window(scenario.image)
    window = scenario.image.window
    if cycles < window:
        raise InputError(
            "duration", f"at least image.window = {window} cycles", f"{cycles} cycles",
            "lengthen it or shorten image.window",
        )  # fmt: skip
    return choose_instants(scenario, cycles)
