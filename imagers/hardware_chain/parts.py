"""A sensor and a converter as tables of a budget (`viform design`) or of an [imager] section."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

from pydantic import Field

from cosim.config.quantity import Current, Quantity, Section, Temperature

if TYPE_CHECKING:  # the schema must not load the physics
    from sensor.dynamic_range import ConverterPart, SensorPart

__all__ = [
    "AdcTable", "Electrons", "Gain", "PixelClock", "Price", "SensorTable", "Volts", "Watts",
]  # fmt: skip

Well = Annotated[float, Quantity("charge", least=1, most=1e9)]
Electrons = Annotated[float, Quantity("charge", least=0, most=1e6)]
PixelClock = Annotated[float, Quantity("frequency", least=1, most=1e11)]
Volts = Annotated[float, Quantity("voltage", least=0, most=100)]
Scale = Annotated[float, Quantity("voltage", least=1e-6, most=1000)]
Conversion = Annotated[float, Quantity("conversion gain", least=1e-3, most=1e6)]
Watts = Annotated[float, Quantity("power", least=0, most=1e6)]
Price = Annotated[float, Field(ge=0, le=1e12)]
Gain = Annotated[float, Field(ge=1 / 1024, le=1024)]
Name = Annotated[str, Field(min_length=1, max_length=40, pattern=r"^[^\x00-\x1f\x7f]+$")]


class SensorTable(Section):
    """A sensor of a budget or of an imager; `part` converts it to a `SensorPart`. Noises apply at
    `noise_temperature` and `noise_clock`."""

    name: Name
    full_well: Well
    sensitivity: Conversion
    reset_noise: Electrons = 0.0
    white_noise: Electrons = 0.0
    transfer_noise: Electrons = 0.0
    dark_current: Current = 0.0
    dark_temperature: Temperature = 25.0
    dark_doubling: Annotated[float, Field(ge=1, le=100)] = 6.5
    dark_activation: Annotated[float, Field(ge=0.01, le=3)] | None = None
    noise_temperature: Temperature = 25.0
    noise_clock: PixelClock = 30e6
    power: Watts | None = None
    price: Price | None = None

    def part(self) -> SensorPart:
        from sensor.dynamic_range import DarkLaw, SensorNoise, SensorPart

        dark = DarkLaw(
            self.dark_current, self.dark_temperature, self.dark_doubling, self.dark_activation
        )
        noise = SensorNoise(
            self.reset_noise, self.white_noise, self.transfer_noise, dark,
            self.noise_temperature, self.noise_clock,
        )  # fmt: skip
        return SensorPart(
            self.name, self.full_well, self.sensitivity * 1e-6, noise, self.power, self.price
        )


class AdcTable(Section):
    """A converter of a budget or of an imager; `part` converts it to a `ConverterPart`.

    Attributes:
        noise: RMS noise at the input without quantisation, V.
        rate: maximum sampling rate, Hz.
    """

    name: Name
    bits: Annotated[int, Field(ge=1, le=24)]
    full_scale: Scale
    noise: Volts = 0.0
    rate: PixelClock
    power: Watts | None = None
    price: Price | None = None

    def part(self) -> ConverterPart:
        from sensor.dynamic_range import Converter, ConverterPart

        converter = Converter(self.bits, self.full_scale, self.noise, self.rate)
        return ConverterPart(self.name, converter, self.power, self.price)
