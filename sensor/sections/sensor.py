"""The [sensor] section with those below it: the chip, how it is run, its lens, its device, its
filter array (`colour`) and its reading of dim light (`sub_threshold` and the key `dark_limit`;
Huang 2022, 4.4 and 4.5).
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from typing import Annotated, Any, Final, Literal, NamedTuple

from pydantic import Field, create_model, model_validator

from cosim import InputError
from cosim.config.quantity import DAY, Charge, Duration, Frequency, Quantity, Section, Wavelength
from sensor.device.chips import BOARD, CHIPS, Chip
from sensor.latched.effects.catalogue import CATALOGUE, all_keys
from sensor.latched.effects.effect import Key
from sensor.sections.own_chip import LEVELS, Writes, check_chip, check_writes, own_chip, row_skew
from sensor.sections.preset_file import with_preset
from sensor.sections.unlatched import AsynchronousSection, ChannelSection, ContinuousSection, Side

_DARK: Final = "dark current"
_MARGIN: Final = re.compile(r"(\d+\.?\d*(?:e-?\d+)?) ?(sigma|%)")
_MOST_SEEN: Final = 50
"""Largest share of the dark that a limit lets through, %."""
SPIKING = tuple(
    name for name, key in all_keys() if key.silicon is not None and "continuous" not in key.pixels
)
"""Faults that only a pixel which spikes has."""
DUPLICATED = ((0, 2), (1, 3))
"""Duplicated rows of SpikeOne under the preset `silicon`, as in a recording of a 400 x 250 chip."""
Pitch = Annotated[float, Quantity("length", above=0, most=1000)]
Part = Annotated[float, Field(gt=0, le=1)]
_OWN = "{}; the preset's number when absent"
_NEEDS = {name: key.needs for name, key in all_keys() if key.needs is not None}
"""Keys of [sensor.pattern] that depend on another one."""
_KEYS = [item for effect in CATALOGUE for item in effect.keys.items()]


class ColourSection(Section):
    """Colour filters on the pixels. Neither chip has any: their curves are assumed."""

    filter: Literal["rggb", "bggr", "grbg", "gbrg"] = Field(
        default="rggb", description="colours of rows 0 and 1, columns 0 and 1"
    )
    depth: Annotated[float, Quantity("length", above=0, most=1000)] = Field(
        default=3.0,
        examples=["3 um"],
        description="depth of the silicon that collects charge; with its absorption it is the "
        "quantum efficiency by wavelength",
    )


class DarkMargin(NamedTuple):
    """Dark limit by the device's dark current, below the mean width Q / I_dark of the dark.

    Attributes:
        sigmas: standard deviations of a width in the dark below its mean.
        percent: pixels in the dark that are seen as light, %; 0 if `sigmas` holds.
    """

    sigmas: float = 0.0
    percent: float = 0.0


class _DarkLimit(Quantity):
    """A duration, "dark current", deviations such as "3 sigma", or a share such as "0.1 %"."""

    def read(self, value: object) -> Any:
        if value == _DARK:
            return DarkMargin()
        known = _MARGIN.fullmatch(value) if isinstance(value, str) else None
        if known is not None:
            number, sigma = float(known[1]), known[2] == "sigma"
            if sigma or 0 < number <= _MOST_SEEN:
                return DarkMargin(number) if sigma else DarkMargin(percent=number)
            raise ValueError(f"must be a share of the dark above 0 % and at most {_MOST_SEEN:g} %")
        try:
            return super().read(value)
        except ValueError as exc:
            raise ValueError(f"{exc}, '{_DARK}', '3 sigma' or '0.1 %'") from None

    def write(self, value: Any) -> str:
        if not isinstance(value, DarkMargin):
            return super().write(value)
        number = repr(value.sigmas or value.percent).removesuffix(".0")
        return f"{number} {'%' if value.percent else 'sigma'}" if any(value) else _DARK


DarkLimit = Annotated[Any, _DarkLimit("time", above=0, most=DAY)]
"""Seconds, or a `DarkMargin`."""


class SubThresholdSection(Section):
    """Reading of the charge of pixels that have not fired for some time."""

    limit: Duration = Field(
        examples=["10 ms"],
        description="time between two readings: a pixel that has not fired in it is read",
    )
    levels: Annotated[int, Field(ge=1, le=65535)] = Field(
        default=100, description="N of a reading, floor(N charge / threshold)"
    )


class LensSection(Section):
    """The lens in front of the chip."""

    f_number: Annotated[float, Field(ge=0.5, le=1000)] | None = Field(
        default=None, description="chosen so that white fires at white_rate when absent"
    )
    white_rate: Annotated[float, Field(gt=0, le=1)] = Field(
        default=0.6, description="spikes a cycle of white, for a chosen f-number"
    )
    transmission: Annotated[float, Field(gt=0, le=1)] = 0.9
    magnification: Annotated[float, Field(ge=0, le=100)] = 0.0
    psf: Literal["none", "airy"] = "none"


def _extended(name: str, base: type[Section], keys: Iterable[tuple[str, Key]]) -> Any:
    """A section with the fields of `base`, then those of the effects."""
    ordered = sorted(keys, key=lambda item: not item[1].first)
    fields: dict[str, Any] = {key: (entry.annotation, entry.field) for key, entry in ordered}
    return create_model(name, __base__=base, **fields)


class _DeviceSection(Section):
    device_seed: Annotated[int, Field(ge=0, lt=2**32)] = 0


_Pattern: Any = _extended(
    "_Pattern", _DeviceSection, [item for e in CATALOGUE for item in e.pattern_keys.items()]
)


class PatternSection(_Pattern):
    """What differs from pixel to pixel of one device and stays. Nothing of it is published for the
    chips here: a size is the user's own, or assumed by the preset `silicon`."""

    @model_validator(mode="after")
    def _has_an_effect(self) -> PatternSection:
        """A key that would change nothing, because what it needs is absent, is a mistake."""
        for name, (needs, why, example) in _NEEDS.items():
            if getattr(self, name) > 0 and getattr(self, needs) == 0:
                raise InputError(
                    f"sensor.pattern.{needs}",
                    f"above 0 with {name} = {getattr(self, name):g}, which {why}", _none_of(needs),
                    f"write --set sensor.pattern.{needs}='{example}', or leave {name} out",
                )  # fmt: skip
        return self


def _none_of(key: str) -> str:
    """0 of a key, as text."""
    return "0" if key == "prnu" else "0 e/s"


class _ChipSection(Section):
    chip: Literal[tuple(CHIPS)] = "spiketwo"  # type: ignore[valid-type]  # the presets' names
    preset: str = Field(
        default="ideal",
        examples=["silicon", "my-camera.toml"],
        description="ideal; silicon: every fault absent here gets the size assumed for it; or a "
        "file that `viform calibrate` writes, whose keys stand for those absent here",
    )
    source: str | None = Field(
        default=None,
        description="serial:PORT, serial:PORT,BAUD or udp:HOST[:PORT]: a board makes the spikes, "
        "PORT of a serial line a device, a URL of pyserial or virtual; dtr=off and rts=off may "
        "follow a serial line; simulated when absent",
    )
    pixel: Literal["latched", "asynchronous", "continuous"] = Field(
        default="latched",
        description="kind of the pixel: spikes latched by the clock, spikes as pixels are full, or "
        "absolute intensities as they change",
    )
    clock: Frequency = 40e3
    clock_steering: bool | None = Field(
        default=None,
        description="whether a loop may lock the ticks to the panel of a link, as its camera: by "
        f"counts of {BOARD.step / 1e3:g} ns, up to {100 * BOARD.longest:g} % longer, and shorter "
        "by the readout's blank rest; by default as the chip's board can (spiketwo)",
    )
    threshold: Charge
    threshold_level: Annotated[int, Field(ge=1, le=LEVELS)] = Field(
        default=LEVELS, description=f"the chip's setting: level n fires at n/{LEVELS} of threshold"
    )
    dark_limit: DarkLimit | None = Field(
        default=None,
        examples=["64 ms", "dark current", "3 sigma", "0.1 %"],
        description="width from which on an interval is rejected as dark; 'dark current' for its "
        "mean in the dark, threshold over sensor.pattern.dark_current; '3 sigma' for 3 standard "
        "deviations less; '0.1 %' for the width that this share of the pixels in the dark stay "
        "below; nothing is rejected when absent",
    )
    wavelength: Wavelength = Field(
        default=555.0, description="wavelength at which lux are counted as photons"
    )
    reset: Literal["residual", "hard", "subtract"] = Field(
        default="residual", description="what becomes of charge beyond the threshold at a spike"
    )
    width: Side | None = Field(default=None, examples=[640], description=_OWN.format("pixels"))
    height: Side | None = Field(default=None, examples=[480], description=_OWN.format("pixels"))
    pitch: Pitch | None = Field(
        default=None, examples=["10 um"], description=_OWN.format("pitch of the pixels")
    )
    fill_factor: Part | None = Field(
        default=None, examples=[0.6], description=_OWN.format("share of the pitch's area")
    )
    quantum_efficiency: Part | None = Field(
        default=None, examples=[0.7], description=_OWN.format("electrons a photon")
    )
    row_time: Annotated[float, Quantity("time", least=0, most=0.1)] | None = Field(
        default=None,
        examples=["20 ns"],
        description="time to read a row; states row_skew = row_time x height x clock",
    )
    duplicated_rows: tuple[tuple[Annotated[int, Field(ge=0)], Annotated[int, Field(ge=0)]], ...] = (
        Field(
            default=(),
            examples=[[[0, 2], [1, 3]]],
            description="fault of the readout: pairs [source, target]; the target shows the bits "
            "of the source",
        )
    )


_Pixel: Any = _extended("_Pixel", _ChipSection, [i for i in _KEYS if not i[1].section])


class _LensedSection(_Pixel):
    lens: LensSection = LensSection()
    pattern: PatternSection | None = None


_Sections: Any = _extended("_Sections", _LensedSection, [i for i in _KEYS if i[1].section])


class SensorSection(_Sections):
    """The chip and how it is run."""

    asynchronous: AsynchronousSection | None = None
    continuous: ContinuousSection | None = None
    sub_threshold: SubThresholdSection | None = Field(
        default=None, description="readings of the charge of pixels that do not fire"
    )
    colour: ColourSection | None = Field(
        default=None, description="colour filters on the pixels; none when absent"
    )
    channel: ChannelSection | None = Field(
        default=None, description="output that asynchronous pixels share; none when absent"
    )
    writes: Writes | None = Field(
        default=None,
        examples=[[{"cycle": 400, "threshold_level": 8}]],
        description="register writes in mid-run, in their order; none when absent",
    )

    @model_validator(mode="before")
    @classmethod
    def _silicon(cls, data: Any) -> Any:
        """Fills in what the preset says of keys that are absent."""
        if not isinstance(data, dict) or data.get("preset", "ideal") == "ideal":
            return data
        if data["preset"] != "silicon":
            return with_preset(data, LEVELS) if isinstance(data["preset"], str) else data
        sizes = _silicon_sizes(data)
        if data.get("row_time") is not None:  # which states the skew
            sizes.pop("row_skew", None)
        if data.get("circuit") is not None:  # whose reset takes its own time
            sizes.pop("dead_time", None)
        pattern = data.get("pattern", {})
        if isinstance(pattern, dict):
            for name, needs in _NEEDS.items():
                # Taken out of the preset, or of unknown size: it has no share.
                if _is_none(pattern.get(needs.key)) or needs.key not in {*sizes, *pattern}:
                    sizes.pop(name, None)
            pattern = {n: v for n, v in sizes.items() if n in PatternSection.model_fields} | pattern
        own = {n: v for n, v in sizes.items() if n in cls.model_fields}
        latched = data.get("pixel", "latched") == "latched" and not data.get("source")
        own_height = data.get("height")
        tall = not isinstance(own_height, int) or own_height > max(map(max, DUPLICATED))
        if latched and data.get("chip") == "spikeone" and tall:
            own["duplicated_rows"] = DUPLICATED
        return own | data | {"pattern": pattern}

    @property
    def own_chip(self) -> Chip:
        """The preset with the numbers of this section in their places."""
        return own_chip(self)

    @property
    def skew(self) -> float:
        """Share of a cycle in which the rows are sampled, by row_time if it is given."""
        return row_skew(self)

    @model_validator(mode="after")
    def _can_be_built(self) -> SensorSection:
        check_chip(self)
        check_writes(self)
        return self

    @model_validator(mode="after")
    def _has_these_rows(self) -> SensorSection:
        pairs, height = self.duplicated_rows, self.own_chip.height
        if pairs and (self.pixel != "latched" or self.source is not None):
            raise InputError(
                "sensor.duplicated_rows", "empty, except with simulated latched pixels",
                str([list(pair) for pair in pairs]), "leave it out",
            )  # fmt: skip
        sources, targets = {pair[0] for pair in pairs}, [pair[1] for pair in pairs]
        twice = len(set(targets)) < len(targets) or sources & set(targets)
        if twice or max((*sources, *targets), default=0) >= height:
            raise InputError(
                "sensor.duplicated_rows",
                f"pairs [source, target] of rows from 0 to {height - 1}, whose targets differ and "
                "are no sources", str([list(pair) for pair in pairs]),
                "change the pairs, or leave it out",
            )  # fmt: skip
        return self


def _silicon_sizes(data: dict[str, Any]) -> dict[str, Any]:
    """Size that the preset assumes of every key that the section's pixel has, as text."""
    sizes: dict[str, Any] = {}
    for name, key in all_keys():
        if key.silicon is None or data.get("pixel", "latched") not in key.pixels:
            continue
        size = key.silicon.value
        if key.share_of_threshold:
            try:  # a wrong threshold is refused on its own
                charge = Quantity("charge").read(data.get("threshold"))
                size *= charge * int(data.get("threshold_level", LEVELS)) / LEVELS
            except (ValueError, TypeError):
                continue
        metadata = getattr(key.annotation, "__metadata__", ())
        unit = next((m for m in metadata if isinstance(m, Quantity)), None)
        sizes[name] = size if unit is None else unit.write(size)
    return sizes


def _is_none(value: Any) -> bool:
    """Whether a current or a spread is given as 0; a wrong one is refused on its own."""
    if value is None:
        return False
    for read in (float, Quantity("current").read):  # a spread is a number, also as text
        try:
            return read(value) == 0
        except (ValueError, TypeError):
            continue
    return False
