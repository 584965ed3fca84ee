"""Commands whose results must not change: every scenario that ships, shortened, in both tiers."""

from __future__ import annotations

from typing import NamedTuple


class Case(NamedTuple):
    """One command. quick: it runs in the ordinary suite; the others are slow tests.

    name: of the case, unique. words: the command without `--json` and `--out`.
    """

    name: str
    words: tuple[str, ...]
    quick: bool


def _sets(*assignments: str) -> tuple[str, ...]:
    return tuple(word for each in assignments for word in ("--set", each))


SMALL = _sets("sensor.chip=spikeone")
EIGHT = (*SMALL, *_sets("duration=8 ms"))
LINK = _sets(
    "sensor.chip=spikeone", "link.panel.width=384", "link.panel.height=224", "link.size=20000",
    "link.modem.cell=2", "link.modem.ticks=2", "link.modem.line=8b10b", "link.modem.parity=32",
)  # fmt: skip
AT = "image.at=[60, 100]"

SCENARIOS: dict[str, tuple[str, tuple[str, ...]]] = {
    "film": ("film", EIGHT),
    "glass": ("glass", EIGHT),
    "glass-hold": ("glass", (*EIGHT, *_sets("display.drive=hold"))),
    "glass-impulse": ("glass", (*EIGHT, *_sets(
        "display.drive=impulse", "display.observer=camera"
    ))),
    "star": ("star", EIGHT),
    "step": ("step", EIGHT),
    "wave": ("wave", (*SMALL, *_sets("duration=6 ms", AT))),
    "shockwave": ("shockwave", _sets("duration=3 ms", AT)),
    "silicon": ("film", (*EIGHT, *_sets(
        "sensor.preset=silicon", "sensor.row_skew=1.0", "sensor.lens.white_rate=0.4"
    ))),
    "hard-reset": ("film", (*EIGHT, *_sets(
        "sensor.reset=hard", "sensor.threshold=500 e", "sensor.dead_time=1 us",
        "sensor.crosstalk=0.01",
    ))),
    "subtract": ("step", (*EIGHT, *_sets("sensor.reset=subtract", "sensor.threshold_noise=20 e"))),
    "sun-and-stars": ("sun-and-stars", _sets("duration=0.1 s")),
    "asynchronous": ("film", _sets(
        "sensor.chip=spikeone", "sensor.readout=asynchronous", "duration=3 ms"
    )),
    "continuous": ("film", _sets(
        "sensor.chip=spikeone", "sensor.readout=continuous", "duration=3 ms"
    )),
    "light-link": ("light-link", LINK),
    "link-chosen": ("light-link", LINK[:8]),
    "adaptive-exposure": ("adaptive-exposure", _sets("duration=160 ms")),
    "ebaps-night": ("ebaps-night", _sets("duration=500 ms", "imager.rows=64", "imager.columns=80")),
    "emccd-window": ("emccd-window", _sets("duration=230 ms")),
}  # fmt: skip
"""Name, scenario and settings."""

LATCHED = (
    "film", "glass", "glass-hold", "glass-impulse", "star", "step", "wave", "shockwave", "silicon",
    "hard-reset", "subtract", "light-link", "link-chosen",
)  # fmt: skip
"""Those of a latched chip, which has two tiers, an OpenCL form and a compiled one."""

QUICK = {
    "run small glass", "run film 0", "run small silicon 0.1",
    "run emccd-window default",
    "run step numba", "plan film", "plan light-link", "plan ebaps-night", "accuracy step",
    "list schema", "paper",
}  # fmt: skip


def _cases() -> list[Case]:
    found: list[tuple[str, tuple[str, ...]]] = []
    for name, (scenario, sets) in SCENARIOS.items():
        words = ("run", scenario, *sets)
        found.append((f"run {name} default", words))
        found.append((f"run {name} 0", (*words, "--tolerance", "0")))
        found.append((f"run {name} 0.1", (*words, "--tolerance", "0.1")))
        if name in LATCHED:
            found.append((f"run {name} numba", (*words, "--device", "numba")))
        found.append((f"plan {name}", ("plan", scenario, *sets)))
        found.append((f"accuracy {name}", ("accuracy", scenario, *sets)))
    board = _sets("board.level=model", "board.rows=4", "board.columns=40", "board.frames=12")
    at_both_ends = _sets(
        "sensor.source=serial:virtual",
        "display.sink=serial:virtual",
        "duration=1.1 ms",
        "image.at=[22]",
    )
    whole = _sets(
        "sensor.width=96", "sensor.height=64", "duration=8 ms", "image.at=[160]",
        "link.panel.width=192", "link.panel.height=192", "link.sensor.chip=spikeone",
        "code.cycles=64", "code.tile=32",
    )  # fmt: skip
    small = _sets("sensor.width=96", "sensor.height=64")
    found += [
        ("run small glass", ("run", "glass", *small, *_sets("duration=4 ms"))),
        ("run small silicon 0.1", (
            "run", "film", *small, *SCENARIOS["silicon"][1][2:], "--tolerance", "0.1"
        )),
        ("run glass-over-light", ("run", "glass-over-light", *whole)),
        ("run megapixel", ("run", "glass", *_sets("duration=2 ms", "image.at=[40]"))),
        ("run bring-up", ("run", "bring-up", *board)),
        ("run boards", ("run", "step", *at_both_ends)),
        ("list schema", ("list", "--schema")),
        ("paper", ("paper",)),
        ("stability", ("stability",)),
        ("compare step", ("compare", "step")),
        ("design", ("design", "dynamic-range")),
        ("link ber", ("link", "ber")),
        ("link capacity", ("link", "capacity")),
    ]  # fmt: skip
    return [Case(name, words, name in QUICK) for name, words in found]


CASES = _cases()
