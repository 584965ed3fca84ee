"""The setting of a comparison: one scene, one lens, and a section for each camera. They come from
the name or file of a scenario, or a kind of scene, and from --set."""

from __future__ import annotations

import tomllib
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final, cast, get_args

from cosim import InputError
from cosim.config.toml import to_toml
from imagers.catalogue import IMAGERS
from imagers.common.kind import Comparison
from scenarios.assemble.chip import camera_setting
from scenarios.assemble.lens import choose_lens
from scenarios.assemble.schema.loading import assign, load, shipped
from scenarios.assemble.schema.messages import validate
from scenarios.assemble.schema.scenario import ImagerScenario, Scenario
from scenarios.scenes.catalogue import SceneSection
from sensor import CHIPS

CHIP: Final = "spikeone"
SHAPE: Final = (CHIPS[CHIP].height, CHIPS[CHIP].width)
"""Size of the scene on every camera, (rows, columns): the whole array of SpikeOne, which two cores
simulate at 40 kHz in seconds. Other imagers use as many of their pixels, with the same light."""
DURATION: Final = "64 ms"
ILLUMINANCE: Final = "700 lux"
"""Illuminance of a scene that is selected by its kind."""
_NIGHT: Final = 1.4
"""f-number if no lens exposes white as the spike camera requires: that of the EBAPS document,
assumed."""
_KINDS: Final = tuple(
    get_args(part.model_fields["kind"].annotation)[0]
    for part in get_args(get_args(SceneSection)[0])
)


@dataclass(frozen=True)
class SceneComparison:
    """One scene and its cameras.

    Attributes:
        name: name of the scene.
        spike: scenario of the spike camera; all cameras share its lens.
        imagers: scenario of each imager with the keys of the user.
        user_keys: keys that the user has set, by section.
        notes: notes for the user on the choice of the lens.
    """

    name: str
    spike: Scenario
    imagers: dict[str, ImagerScenario]
    user_keys: dict[str, frozenset[str]]
    notes: tuple[str, ...]


def compared_imagers() -> dict[str, Comparison]:
    """The imagers of the catalogue that take part in comparisons, by name."""
    sides = {name: kind.comparison() for name, kind in IMAGERS.items()}
    return {name: side for name, side in sides.items() if side is not None}


def _scene(name: str) -> tuple[str, dict[str, Any]]:
    """Short name, and data with the sections [scene] and [lens] of the scenario."""
    if name not in shipped() and name in _KINDS:
        return name, {"scene": {"kind": name, "illuminance": ILLUMINANCE}}
    try:
        short, loaded = load(name)
    except InputError as exc:
        if exc.what == "the scenario" and exc.remedy == "see `viform list`":
            known = ", ".join([*shipped(), *(k for k in _KINDS if k not in shipped())])
            raise InputError(
                "the scene", f"one of {known} or a TOML file", repr(name), "see `viform list`"
            ) from None
        raise
    data = tomllib.loads(to_toml(loaded))
    if "scene" not in data:
        raise InputError(
            "the scene", "that of a scenario with a [scene]",
            "a link" if "link" in data else "a board", "see `viform list`",
        )  # fmt: skip
    lens = data.get("lens") or data.get("sensor", {}).get("lens") or {}
    shared = ("f_number", "transmission", "magnification")
    return short, {
        "scene": data["scene"], "lens": {k: v for k, v in lens.items() if k in shared},
    }  # fmt: skip


def load_comparison(
    name: str, assignments: Sequence[str] = (), seed: int | None = None
) -> SceneComparison:
    """Loads and checks the setting of a comparison.

    Args:
        name: name of a scenario, a TOML file, or a kind of scene.
        assignments: values of --set.
        seed: seed of all temporal noise, None to keep that of the setting.

    Raises:
        InputError: the scene or a key does not exist, or a value is out of range.
    """
    short, data = _scene(name)
    defaults: dict[str, Any] = {"duration": DURATION, "seed": 1, "lens": {}, "spike": {}}
    data = defaults | data
    sides = compared_imagers()
    data |= {kind: {} for kind in sides}
    for assignment in assignments:
        assign(data, assignment)
    if seed is not None:
        data["seed"] = seed
    known = ("scene", "lens", "duration", "seed", "spike", *sides)
    for key, value in data.items():
        if key not in known:
            raise InputError("--set", f"a key of {', '.join(known)}", key, "check its name")
        if key not in ("duration", "seed") and not isinstance(value, dict):
            raise InputError(
                f"--set {key}", "a key of the section", "the section itself", "write a key"
            )
    lens: dict[str, Any] = dict(data["lens"])
    notes: list[str] = []
    common = {"title": f"{short}: all imagers", **{k: data[k] for k in ("duration", "seed")}}
    sensor = {"chip": CHIP, "preset": "silicon", "threshold": "1000 e"} | data["spike"]
    if sensor["chip"] != CHIP or sensor.get("pixel", "latched") != "latched":
        raise InputError(
            "spike", f"a synchronous {CHIP} in a comparison", f"{data['spike']}", "leave it out"
        )
    spike = _spike(common, data["scene"], sensor, lens)
    if "f_number" not in lens:
        lens["f_number"] = _f_number(spike, notes)
        spike = _spike(common, data["scene"], sensor, lens)
    imagers = {}
    for kind, side in sides.items():
        section = side.keys(SHAPE) | data[kind]
        whole = common | {
            "scene": data["scene"], "lens": lens, "imager": {"kind": kind, **section}
        }  # fmt: skip
        imagers[kind] = cast(ImagerScenario, validate(whole))
    user_keys = {kind: frozenset(data[kind]) for kind in sides}
    return SceneComparison(short, spike, imagers, user_keys, tuple(notes))


def _spike(
    common: dict[str, Any], scene: dict[str, Any], sensor: dict[str, Any], lens: dict[str, Any]
) -> Scenario:
    whole = common | {"scene": scene, "sensor": sensor | {"lens": lens}}
    return cast(Scenario, validate(whole))


def _f_number(spike: Scenario, notes: list[str]) -> float:
    """The f-number that the spike camera selects, or _NIGHT; appends a note."""
    try:
        number = choose_lens(spike, camera_setting(spike)).lens.f_number
    except InputError:
        notes.append(f"no lens exposes white as the spike camera requires: f/{_NIGHT} is used")
        return _NIGHT
    notes.append(
        f"f/{number:.3g}: white fires at {spike.sensor.lens.white_rate:g} spikes a cycle in the "
        "spike camera"
    )
    return number
