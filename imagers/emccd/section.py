"""The [imager] section of the EMCCD."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import AfterValidator, Field, model_validator

from cosim import InputError
from cosim.config.quantity import Quantity, Section, Temperature, Time
from imagers.common.kind import Device, ImagerSection, Writes
from imagers.emccd.device.supplies import ORDER, broken_interlock


class EmccdDriveSection(Section):
    """[imager.drive]: the high-voltage sine and the loop that holds its peak."""

    phase: Annotated[float, Quantity("angle", least=-90, most=90)] = Field(
        default=0.0, examples=["5 deg"], description="phase of the crest after the fall of R1"
    )
    trough: Annotated[float, Quantity("voltage", least=-10, most=20)] = Field(
        default=0.0, examples=["0 V"], description="trough of the sine"
    )
    transfer: Annotated[float, Quantity("time", least=0, most=50e-9)] = Field(
        default=10e-9, examples=["10 ns"], description="time in which the charge drops"
    )
    loop_gain: Annotated[float, Field(ge=1, le=1e5)] = Field(
        default=200.0, description="gain of the loop at the largest peak"
    )
    response: Annotated[float, Quantity("time", least=1e-6, most=1e-3)] = Field(
        default=20e-6, examples=["20 us"], description="time constant of the loop"
    )
    quality: Annotated[float, Field(ge=1, le=200)] = Field(
        default=20.0, description="Q of the tuned transformer"
    )
    attack: Annotated[float, Field(ge=0.01, le=1)] = Field(
        default=0.5, description="share of its distance by which the detector rises at a crest"
    )
    droop: Annotated[float, Quantity("time", least=1e-6, most=10e-3)] = Field(
        default=100e-6, examples=["100 us"], description="time constant of the detector's fall"
    )
    drift: Annotated[float, Field(ge=-0.01, le=0.01)] = Field(
        default=-2e-3,
        description="drift of the transformer's strength, a kelvin of ambient from 25 degC",
    )
    ripple: Annotated[float, Field(ge=0, le=0.01)] = Field(
        default=1e-4, description="relative amplitude, of the amplifier's supply"
    )
    ripple_frequency: Annotated[float, Quantity("frequency", above=0, most=5e6)] = Field(
        default=100e3, examples=["100 kHz"]
    )


def _known(name: str) -> str:
    if name not in ORDER:
        raise ValueError(f"must be one of {', '.join(ORDER)}")
    return name


def _safe(order: tuple[str, ...]) -> tuple[str, ...]:
    if sorted(order) != sorted(ORDER):
        raise ValueError(f"must be {', '.join(ORDER)}, each once, in a safe order")
    if (pair := broken_interlock(order)) is not None:
        raise ValueError(f"must be an order in which {pair[0]} comes up before {pair[1]}")
    return order


class EmccdSuppliesSection(Section):
    """[imager.supplies]: how the rails come up and go down."""

    on: Time | None = Field(
        default=None, description="instant of the switch-on in the run; else the run begins later"
    )
    off: Time | None = Field(default=None, description="instant of the switch-off")
    order: Annotated[tuple[str, ...], AfterValidator(_safe)] = Field(
        default=ORDER, description="order in which the rails come up"
    )
    ramp: Annotated[float, Quantity("time", least=1e-4, most=0.1)] | None = Field(
        default=None, description="ramp of every rail; else each has its own"
    )
    delay: Annotated[float, Quantity("time", least=0, most=0.1)] | None = Field(
        default=None, description="delay before every rail; else each has its own"
    )
    failed: Annotated[str, AfterValidator(_known)] | None = Field(
        default=None, description="rail that gives no voltage"
    )


class EmccdSection(ImagerSection):
    """The frame-transfer EMCCD: exposure between two transfers, gain in 256 steps, window, sync."""

    kind: Literal["emccd"]
    exposure: Annotated[float, Quantity("time", least=1e-5, most=40.96e-3)] = Field(
        default=2e-3, examples=["2 ms"], description="whole steps of 10 us"
    )
    gain_step: Annotated[int, Field(ge=0, le=255)] | None = Field(
        default=None, description="step of the digital potentiometer"
    )
    gain: Annotated[float, Field(ge=1, le=1000)] | None = Field(
        default=None, description="wanted: the nearest step is taken; 1 when neither is given"
    )
    first_row: Annotated[int, Field(ge=0, le=511)] = 0
    rows: Annotated[int, Field(ge=1, le=512)] = 512
    sync: Literal["internal", "external"] = "internal"
    pulses: tuple[Time, ...] = Field(
        default=(), max_length=100_000, description="instants of external sync"
    )
    pulse_rate: Annotated[float, Quantity("frequency", above=0, most=10_000)] | None = Field(
        default=None, examples=["50 Hz"],
        description="rate of external sync, the first at 0, in the place of pulses",
    )  # fmt: skip
    temperature: Annotated[float, Quantity("temperature", least=-59, most=99)] = Field(
        default=-10.0, examples=["-10 degC"],
        description="temperature that the cooling loop holds, in the range of its thermistor",
    )  # fmt: skip
    ambient: Temperature = Field(default=25.0, description="temperature of the camera's body")
    ageing: Annotated[float, Quantity("voltage", least=0, most=5)] = Field(
        default=0.0, examples=["0.2 V"],
        description="peak that the gain of a new chip takes more, after use",
    )  # fmt: skip
    calibrated: bool = Field(
        default=True, description="gain is set by the curve of the aged chip, not of a new one"
    )
    drive: EmccdDriveSection = EmccdDriveSection()
    supplies: EmccdSuppliesSection = EmccdSuppliesSection()
    device_seed: Device = 1
    writes: Writes = ()

    @model_validator(mode="after")
    def _check(self) -> EmccdSection:
        pulses = bool(self.pulses) + (self.pulse_rate is not None)
        both = self.gain is not None and self.gain_step is not None
        last = self.first_row + self.rows
        unsorted = list(self.pulses) != sorted(self.pulses)
        for wrong, key, must, actual, remedy in (
            (both, "gain", "absent with gain_step", f"{self.gain}", "give one of them"),
            (last > 512, "rows", "a window within its 512 rows", f"one to row {last}",
             "lower it or first_row"),
            (self.sync == "external" and not pulses, "sync",
             "internal without pulses or pulse_rate to wait for", "external", "give one of them"),
            (pulses > 1, "pulse_rate", "absent with pulses", f"{self.pulse_rate} Hz",
             "give one of them"),
            (unsorted, "pulses", "in order of time", "unsorted", "sort them"),
        ):  # fmt: skip
            if wrong:
                raise InputError(f"imager.{key}", must, actual, remedy)
        return self
