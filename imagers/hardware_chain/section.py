"""The [imager] section of the hardware chain; its sensor and its converter may be tables, as in a
budget of `viform design`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Literal

from pydantic import Field

from cosim.config.quantity import Current, Quantity, Section, Temperature
from imagers.common.kind import ImagerSection

if TYPE_CHECKING:
    from sensor.dynamic_range import ConverterPart, SensorPart

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


class HardwareChainSection(ImagerSection):
    """Sensor, circuit, analog gain, converter, digital gain and tone mapping of document 004;
    rolling shutter, fixed exposure."""

    kind: Literal["hardware-chain"]
    rows: Annotated[int, Field(ge=8, le=4096)] = 512
    columns: Annotated[int, Field(ge=8, le=4096)] = 512
    sensor: Literal["kodak-full-frame", "dalsa", "cmos-3t", "ccd97", "cmos-4t"] = Field(
        default="kodak-full-frame", description="name as of `viform design dynamic-range`"
    )
    adc: Literal["8-bit", "12-bit", "14-bit", "16-bit"] = Field(
        default="14-bit", description="converter, as of `viform design dynamic-range`"
    )
    own_sensor: SensorTable | None = Field(
        default=None, description="a sensor in the place of `sensor`"
    )
    own_adc: AdcTable | None = Field(
        default=None, description="a converter of at most 16 bits in the place of `adc`"
    )
    pitch: Annotated[float, Quantity("length", above=0, most=1000)] = Field(
        default=9.0, examples=["9 um"], description="pitch of square pixels; assumed"
    )
    quantum_efficiency: Annotated[float, Field(gt=0, le=1)] = Field(
        default=0.4, description="quantum efficiency at 555 nm, fill factor included; assumed"
    )
    temperature: Temperature = Field(default=25.0, description="temperature of the sensor")
    clock: Annotated[float, Quantity("frequency", least=1e3, most=1e9)] = Field(
        default=27e6, examples=["27 MHz"], description="pixels a second"
    )
    blanking: Annotated[int, Field(ge=0, le=65535)] = Field(
        default=48, description="cycles of the clock after the pixels of a row"
    )
    exposure: Annotated[float, Quantity("time", least=1e-6, most=100)] = Field(
        default=5e-3, examples=["5 ms"]
    )
    frame_rate: Annotated[float, Quantity("frequency", above=0, most=1e5)] | None = Field(
        default=None, description="frame rate; as fast as exposure and readout allow when absent"
    )
    circuit_noise: Volts = Field(
        default=1e-4, examples=["0.1 mV"], description="RMS at the sensor's output"
    )
    ripple: Volts = Field(
        default=0.0,
        examples=["3 mV"],
        description="amplitude of the supply's ripple at the sensor's output",
    )
    ripple_frequency: Annotated[float, Quantity("frequency", above=0, most=1e10)] = Field(
        default=1e5, examples=["100 kHz"]
    )
    analog_gain: Gain = 1.0
    digital_gain: Gain = 1.0
    black: Annotated[int, Field(ge=0, le=65535)] | None = Field(
        default=None,
        description="value of darkness at the converter; when absent the least that six deviations "
        "of the noise in the dark do not take below 0",
    )
    gamma: Annotated[float, Field(ge=1, le=10)] = Field(
        default=2.2, description="exponent of the pictures' tones; 1 is the linear mapping"
    )
    output_bits: Annotated[int, Field(ge=1, le=8)] = Field(
        default=8, description="bits of the pictures' tones"
    )
