"""The order of sections: what can follow what in a scenario, in one place.

A scenario's sections are its chain: a source (a scene before a chip, an imager or a board, or a
recorded stream), then the readout of a chip, then the code and the link that carry the stream, then
the display that shows it, then the camera that films the display.
Everything here is said of the data before they are checked key by key. Each rule refuses one
combination, in one line with its remedy; what no rule refuses is assembled.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

from cosim import InputError
from cosim.run.inputs import FILE, PIPE

Data = dict[str, Any]
_IMAGER = (
    "remove one of them: an [imager] is the sensor itself, before a [scene] and a [lens], and may "
    "have a [link] and a [display]"
)
_BOARD = (
    "remove one of them: a bring-up makes no stream; sensor.source = serial:PORT puts a board into "
    "a chain"
)


class _Rule(NamedTuple):
    """A combination that has no meaning.

    Attributes:
        breaks: whether a scenario has it.
        what, must, actual, remedy: parts of the InputError.
    """

    breaks: Callable[[Data], bool]
    what: str
    must: str
    actual: str
    remedy: str


def _value(data: Data, section: str, key: str) -> Any:
    """A value of a section; None if the section is absent or no section."""
    inner = data.get(section)
    return inner.get(key) if isinstance(inner, dict) else None


def is_recording(data: Data) -> bool:
    """Whether a stream that was or is recorded takes the place of the chip."""
    source = _value(data, "sensor", "source")
    return isinstance(source, str) and source.startswith((FILE, PIPE))


def _sourceless(data: Data) -> bool:
    """Whether what sensor.source names is neither a recording nor a board, in a scenario that has
    nothing else to film."""
    source = _value(data, "sensor", "source")
    known = (FILE, PIPE, "serial:", "udp:")
    return isinstance(source, str) and "scene" not in data and not source.startswith(known)


def _unlatched(data: Data) -> bool:
    return _value(data, "sensor", "pixel") in ("asynchronous", "continuous")


RULES: tuple[_Rule, ...] = (
    _Rule(
        _sourceless, "sensor.source", "file:PATH, pipe:PATH, serial:PORT or udp:HOST",
        "one without these",
        "write --set sensor.source=file:PATH for a recording",
    ),
    _Rule(
        lambda data: "code" in data and "link" not in data, "code",
        "given with a [link]", "given without one",
        "add a [link], or write a coded file with `viform convert`",
    ),
    _Rule(
        lambda data: "imager" in data and "sensor" in data, "imager",
        "absent in a scenario with [sensor]", "given with it", _IMAGER,
    ),
    _Rule(
        lambda data: "imager" in data and "image" in data
        and not {"display", "link"} & data.keys(),
        "image", "absent with an [imager] without a [display] or a [link]", "given",
        "leave it out, or add one of them: its keys set the instants at which they are seen",
    ),
    *(
        _Rule(
            lambda data, other=other: "board" in data and other in data, "board",  # type: ignore[misc]
            f"absent in a scenario with a [{other}]", "given with one", _BOARD,
        )
        for other in ("scene", "link", "sensor", "imager", "display", "camera")
    ),
    _Rule(
        lambda data: is_recording(data) and "scene" in data, "scene",
        "absent with sensor.source = file:PATH or pipe:PATH, a recorded stream", "given with it",
        "remove it, or start from `viform run playback`, which has none",
    ),
    _Rule(
        lambda data: _value(data, "sensor", "source") is not None and _unlatched(data)
        and not is_recording(data),
        "sensor.source", "absent unless sensor.pixel = latched", "given with another",
        "leave it out: the board latches its spikes by a clock",
    ),
    _Rule(
        lambda data: "readout" in data
        and (_unlatched(data) or _value(data, "sensor", "source") is not None
             or not data.keys().isdisjoint(("imager", "board"))),
        "readout", "given with a simulated chip whose pixels a clock latches",
        "with another source or kind of pixels",
        "leave it out: the row scan is that of such a chip",
    ),
    _Rule(
        lambda data: "camera" in data and "display" not in data, "camera",
        "absent without a [display]", "given alone",
        "add a [display], which it films, or leave it out",
    ),
    _Rule(
        lambda data: "camera" in data and _value(data, "display", "sink") is not None, "camera",
        "absent with display.sink", "given with it",
        "leave one of them out: a board displays the planes, and no light is rendered",
    ),
    _Rule(
        lambda data: _value(data, "display", "clock") is not None and "imager" not in data,
        "display.clock", "absent unless an [imager] feeds the display", "given",
        "leave it out: the planes have the clock of the stream, sensor.clock",
    ),
    _Rule(
        lambda data: _value(data, "display", "tone") not in (None, "none")
        and (not _unlatched(data) or is_recording(data) or "imager" in data),
        "display.tone", "given with asynchronous or continuous pixels alone", "with another source",
        "leave it out: the spikes of a latched pixel, and digital numbers, are at most white",
    ),
    _Rule(
        lambda data: _value(data, "display", "colour") is not None
        and (_unlatched(data) or is_recording(data) or "imager" in data),
        "display.colour", "given with sensor.colour of a latched chip alone", "with another source",
        "leave it out: the panel then has one colour",
    ),
)  # fmt: skip
"""Rules in the order in which they are said."""


def check_order(data: Data) -> None:
    """Raises InputError for the first combination of sections that has no meaning."""
    for rule in RULES:
        if rule.breaks(data):
            raise InputError(rule.what, rule.must, rule.actual, rule.remedy)
