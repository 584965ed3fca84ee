"""Random scenarios, drawn from the schema: a new key is drawn as soon as the schema has it.

A scenario is a function of its number alone. Even numbers are constrained: values lie near their
defaults, and sections fit each other. In odd ones every value comes from its whole range. The sizes
of all are capped, so that a run takes a second.
"""

from __future__ import annotations

import copy
import random
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Final, get_args

from cosim import InputError
from cosim.config.units import KINDS, parse_quantity
from cosim.run.machine import Options
from scenarios.assemble.machine import check_options
from scenarios.assemble.schema.export import export
from scenarios.assemble.schema.messages import validate
from scenarios.scenes.catalogue import SceneSection

Node = dict[str, Any]
Data = dict[str, Any]

INPUTS: Final = ("picture.png", "frames.npy", "recording.npz", "recording.dat",
                 "recording.events.npz", "sent.txt")  # fmt: skip
"""Files that scenarios name; `tests.fuzz.judging` makes them."""

_SCENES = tuple(
    get_args(scene.model_fields["kind"].annotation)[0]
    for scene in get_args(get_args(SceneSection)[0])
)
_SMALL: Final = {"width": 24, "height": 16}


def _chip(**keys: Any) -> Data:
    return {"duration": "2 ms", "sensor": {"threshold": "1000 e", **_SMALL} | keys}


def _imager(kind: str, duration: str, **keys: Any) -> Data:
    return {"duration": duration, "lens": {"f_number": 1.4}, "imager": {"kind": kind} | keys}


_FEW: Final = {"rows": 8, "columns": 16}
_SOURCES: Final[dict[str, tuple[float, str, Data]]] = {
    "latched": (8, "Scenario", _chip()),
    "readout": (0.5, "Scenario", {"duration": "0.4 ms", "readout": {},
                                "sensor": {"threshold": "1000 e", "pixel": "latched"}}),
    "asynchronous": (3, "Scenario", _chip(pixel="asynchronous",
                                          asynchronous=_SMALL | {"most_events": 100_000})),
    "continuous": (3, "Scenario", _chip(pixel="continuous",
                                        continuous=_SMALL | {"most_reports": 100_000})),
    "adaptive-exposure": (1, "ImagerScenario", _imager("adaptive-exposure", "3 ms",
                                                       frame_rate="2 kHz", **_FEW)),
    "ebaps": (0.5, "ImagerScenario", _imager("ebaps", "200 ms", **_FEW)),
    "emccd": (0.5, "ImagerScenario", _imager("emccd", "60 ms", exposure="1 ms", rows=8,
                                           pulse_rate="50 Hz")),
    "hardware-chain": (1, "ImagerScenario", _imager("hardware-chain", "3 ms", exposure="200 us",
                                                    frame_rate="1 kHz", **_FEW)),
    "pwm": (1, "ImagerScenario", _imager("pwm", "3 ms", exposure="500 us", frame_rate="1 kHz",
                                         threshold="100 e", **_FEW)),
    "pfm": (1, "ImagerScenario", _imager("pfm", "3 ms", exposure="500 us", frame_rate="1 kHz",
                                         threshold="100 e", **_FEW)),
    "recording": (3, "RecordingScenario", {"sensor": {"source": "file:recording.npz"}}),
    "link": (0.3, "LinkScenario", {"link": {}, "sensor": {"chip": "spikeone", "reset": "hard",
                                                        "threshold": "1000 e"}}),
    "board": (0.3, "BoardScenario", {"board": {"level": "model", "rows": 4, "columns": 40,
                                             "frames": 12}}),
}  # fmt: skip
"""A source: its weight, its schema, and the least that it needs to be small."""
_LINK: Final = {
    "panel": {"width": 192, "height": 192},
    "modem": {"cell": 2, "ticks": 2, "line": "8b10b", "parity": 16, "detector": "threshold"},
}  # fmt: skip
_DISPLAY: Final = {"beside": ["1000 Hz"], "projector": "none", "renderer": "opencl"}
_FILM: Final = {"kind": "frames", "frame_rate": "1 kHz", "exposure": "300 us", "readout": "400 us"}
_SPIKES: Final = {"kind": "spikes", "sensor": {"threshold": "1000 e", "clock": "20 kHz"}}

_CYCLES: Final = 160
"""Cycles of a run at most, at whatever clock."""
_CAPS: Final[dict[str, float]] = {
    "width": 32, "height": 24, "rows": 16, "columns": 48, "duration": 0.2, "frames": 24,
    "size": 400, "link.panel.width": 192, "link.panel.height": 192, "objects": 12,
    "most_events": 100_000, "most_reports": 100_000, "layers": 8, "bits": 16, "window": 99,
    "source_timeout": 1.0,
}  # fmt: skip
"""Largest values of keys that set how long a run takes, by their whole or last name."""
_RECORDINGS: Final = ("file:recording.npz", "file:recording.dat", "file:recording.events.npz")
_TEXTS: Final[dict[str, tuple[str, ...]]] = {
    "scene.path": ("picture.png", "frames.npy"),
    "sensor.preset": ("ideal", "silicon"), "camera.sensor.preset": ("ideal",),
    "link.sensor.preset": ("ideal", "silicon"), "link.file": ("sent.txt",),
    "board.port": ("virtual",), "board.faults": ("stuck=3,7",),
    "imager.supplies.failed": ("substrate", "high_voltage", "no such rail"),
    "imager.writes": ("exposure", "gain", "rows", "no such register"),
}  # fmt: skip
"""Texts that mean something; another key of text gets its example, or none is drawn."""
_ELSEWHERE: Final = {"display.sink", "link.loop", "board.csr", "board.time_scale", "sensor.source"}
"""Keys that need a board or a file of a board."""
_FREE: Final = {"image", "lens"}
"""Sections that `draw` leaves to chance; it chooses the others, such as a display."""
_TEXT: Final = "text"
LATER: Final = 2000
"""Number from which on silicon is drawn before a display as well, and the detector of a link: those
below keep their meaning."""


@dataclass(frozen=True)
class Drawn:
    """A scenario and the options of its command.

    Attributes:
        number: from which it is made again.
        data: content of its TOML file.
        options: Options of `viform run`.
        fit: whether it is constrained.
    """

    number: int
    data: Data
    options: tuple[str, ...]
    fit: bool


def draw(number: int) -> Drawn:
    """The scenario of this number."""
    rng = random.Random(f"scenario {number}")
    fit = number % 2 == 0
    source = rng.choices(list(_SOURCES), [weight for weight, _, _ in _SOURCES.values()])[0]
    _, schema, least = _SOURCES[source]
    data: Data = {"title": f"scenario {number}"} | copy.deepcopy(least)
    if source == "recording":
        data["sensor"]["source"] = rng.choice(_RECORDINGS)
    node = _resolved({"$ref": f"#/$defs/{schema}"})
    if "scene" in node["properties"]:
        kind = rng.choice(_SCENES)
        data["scene"] = {"kind": kind, "illuminance": "700 lux"}
    if "display" in node["properties"] and rng.random() < 0.4:
        data["display"] = copy.deepcopy(_DISPLAY)
        if rng.random() < 0.4:
            data["camera"] = copy.deepcopy(rng.choice((_FILM, _SPIKES)))
    if "link" in data or ("link" in node["properties"] and rng.random() < 0.01):
        data["link"] = copy.deepcopy(_LINK) | ({"size": 100} if source == "link" else {})
        if number >= LATER:
            del data["link"]["modem"]["detector"]
        if source != "link":
            data["code"] = {"cycles": 64, "buffer": "1 ms"}
            data["link"]["sensor"] = {"chip": "spikeone", "threshold": "1000 e", "reset": "hard"}
    _hold_small(data)
    _Drawing(rng, fit, data, number >= LATER).fill(node, data, "", 0.3)
    _hold_small(data)
    if source == "latched" and rng.random() < 0.3:
        data["tolerance"] = rng.choice((0.0, 1e-5, 1.0))
    options = ("--device", "numba") if source == "latched" and rng.random() < 0.2 else ()
    return Drawn(number, data, options, fit)


def _resolved(node: Node) -> Node:
    if "$ref" not in node:
        return node
    target: Node = export()["$defs"][node["$ref"].rsplit("/", 1)[1]]
    return target | {key: value for key, value in node.items() if key != "$ref"}


def _choices(node: Node) -> Iterator[Node]:
    """The alternatives of a node, without null."""
    node = _resolved(node)
    inner = node.get("oneOf") or node.get("anyOf")
    if inner:
        for part in inner:
            yield from _choices(part)
    elif node.get("type") != "null":
        yield node


class _Drawing:
    """Draws keys into a scenario.

    Args:
        rng: Random generator of the scenario.
        fit: whether values lie near their defaults.
        whole: the scenario so far.
        later: whether its number is LATER or more.
    """

    def __init__(self, rng: random.Random, fit: bool, whole: Data, later: bool = False) -> None:
        self._rng, self._fit, self._whole, self._later = rng, fit, whole, later

    def fill(self, node: Node, data: Data, at: str, share: float) -> None:
        """Draws all keys of a section that are required, and some of the others.

        Args:
            node, data, at: schema, content and name of the section; "" for the scenario.
            share: Share of the other keys.
        """
        required = set(node.get("required", ()))
        for name in sorted(node["properties"], key=lambda name: name not in required):
            inner = node["properties"][name]
            key = f"{at}.{name}" if at else name
            sections = [one for one in _choices(inner) if "properties" in one]
            if name in data or name in required:
                if sections:
                    self._section(sections, data, name, key)
                elif name not in data:
                    value = self.value(inner, key)
                    data[name] = _TEXT if value is None else value
            elif self._rng.random() < share and (at or not sections or name in _FREE):
                self._add(inner, sections, data, name, key)

    def _add(self, node: Node, sections: list[Node], data: Data, name: str, key: str) -> None:
        """Draws a key or a section that is not required; a constrained scenario stays sound."""
        if key in _ELSEWHERE:
            return
        if sections:
            data[name] = {}
            self._section(sections, data, name, key)
        elif (value := self.value(node, key)) is not None:
            data[name] = value
        if self._fit and name in data and _refused(self._whole):
            del data[name]

    def _section(self, sections: list[Node], data: Data, name: str, key: str) -> None:
        inner = data.setdefault(name, {})
        kinds = {one["properties"].get("kind", {}).get("const"): one for one in sections}
        section = kinds.get(inner.get("kind")) or self._rng.choice(sections)
        self.fill(section, inner, key, 0.12 if self._fit else 0.25)

    def value(self, node: Node, key: str) -> Any:
        """A value of a key; None for none."""
        whole = _resolved(node)
        one = self._rng.choice(list(_choices(node)))
        default = whole.get("default")
        examples = whole.get("examples") or one.get("examples") or ()
        if "const" in one:
            return one["const"]
        if "enum" in one:
            return self._rng.choice(one["enum"])
        if one.get("type") == "boolean":
            return self._rng.random() < 0.5
        if "properties" in one:
            data: Data = {}
            self.fill(one, data, key, 0.5)
            return data
        if "quantity" in one:
            return self._quantity(one["quantity"], (default, *examples), key)
        if one.get("type") in ("integer", "number"):
            given = default if isinstance(default, int | float) else next(iter(examples), None)
            low, high = _limits(one)
            number = self._number(low, high, given, key, _above(one), one["type"] == "integer")
            step = one.get("multipleOf", 1)
            return (
                max(round(number / step), bool(low)) * step if one["type"] == "integer" else number
            )
        if one.get("type") == "array":
            return self._list(one, key)
        if key == "sensor.preset" and "display" in self._whole and not self._later:
            return "ideal"
        known = _TEXTS.get(key) or tuple(text for text in examples if " " in text)
        return self._rng.choice(known) if known else None

    def _list(self, node: Node, key: str) -> Any:
        if "prefixItems" in node:
            values = [self.value(item, key) for item in node["prefixItems"]]
            ordered = self._fit and all(isinstance(value, int) for value in values)
            return sorted(values) if ordered else values
        most = min(node.get("maxItems", 3), 3)
        items = [self.value(node["items"], key) for _ in range(self._rng.randint(1, most))]
        items = [item for item in items if item is not None]
        return items or None

    def _quantity(self, quantity: Node, given: tuple[Any, ...], key: str) -> str:
        kind = KINDS[quantity["kind"]]
        low, high = (
            None if text is None else parse_quantity(text, kind)
            for text in (
                quantity.get("minimum", quantity.get("exclusiveMinimum")), quantity.get("maximum")
            )
        )  # fmt: skip
        near = (
            parse_quantity(text, kind) for text in given if isinstance(text, str) and " " in text
        )
        middle = next((value for value in near if value), None)
        number = self._number(low, high, middle, key, "exclusiveMinimum" in quantity)
        return f"{number:.6g} {kind.unit}"

    def _number(
        self,
        low: float | None,
        high: float | None,
        near: float | None,
        key: str,
        above: bool,
        whole: bool = False,
    ) -> float:
        """A number of a range; near a value if the scenario is constrained."""
        rng = self._rng
        top = 1e6 if high is None else high
        cap = _CAPS.get(key, _CAPS.get(key.rsplit(".", 1)[-1]))
        if cap is not None:
            top = max(min(top, cap), low or 0)
        least = low if low is not None else (-top if top > 0 else 0.0)
        if self._fit:
            usual = near if near else min(max(least, 1.0) * 8, top) if whole else 0.02 * min(top, 1)
            number = usual * 2 ** rng.uniform(-2, 0 if near is None else 1)
        elif least < 0:
            number = rng.uniform(least, top)
        else:
            bottom = least or min(top, 1.0) * 1e-6
            number = rng.choice((
                least, top, *[bottom * (top / bottom) ** rng.random() for _ in range(6)]
            ))  # fmt: skip
        number = min(max(float(f"{number:.6g}"), least), top)
        return number if number > least or not above else least + (top - least) * 1e-3


def _refused(data: Data) -> bool:
    """Whether the checks before a machine is assembled refuse a scenario."""
    try:
        check_options(validate(copy.deepcopy(data)), Options())
    except InputError:
        return True
    return False


def _limits(node: Node) -> tuple[float | None, float | None]:
    below = node.get("exclusiveMaximum")
    high = node.get("maximum", None if below is None else below - 1)
    return node.get("minimum", node.get("exclusiveMinimum")), high


def _above(node: Node) -> bool:
    return "exclusiveMinimum" in node


def _hold_small(data: Data) -> None:
    """Shortens a run to a few cycles."""
    if "duration" not in data:
        return
    clock = data.get("sensor", {}).get("clock", "40 kHz")
    seconds = parse_quantity(data["duration"], KINDS["time"])
    if "sensor" in data:
        seconds = min(seconds, _CYCLES / parse_quantity(clock, KINDS["frequency"]))
    data["duration"] = f"{seconds:.6g} s"
