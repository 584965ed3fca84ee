"""The [imager] section of the hardware chain."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from cosim.config.quantity import Quantity, Temperature
from imagers.common.section import ImagerSection
from imagers.hardware_chain.parts import AdcTable, Gain, SensorTable, Volts

__all__ = ["HardwareChainSection"]


class HardwareChainSection(ImagerSection):
    """Sensor, circuit, analog gain, converter, digital gain and tone mapping of document 004;
    rolling shutter, fixed exposure."""

    kind: Literal["hardware-chain"]
    rows: Annotated[int, Field(ge=8, le=4096)] = 512
    columns: Annotated[int, Field(ge=8, le=4096)] = 512
    sensor: Literal["kodak-full-frame", "dalsa", "cmos-3t", "ccd97", "cmos-4t"] = Field(
        default="kodak-full-frame", description="as of `viform design dynamic-range`"
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
        default=9.0, examples=["9 um"], description="of square pixels; assumed"
    )
    quantum_efficiency: Annotated[float, Field(gt=0, le=1)] = Field(
        default=0.4, description="at 555 nm, fill factor included; assumed"
    )
    temperature: Temperature = Field(default=25.0, description="of the sensor")
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
        default=None, description="as fast as exposure and readout allow when absent"
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
        default=2.2, description="of the pictures' tones; 1 is the linear mapping"
    )
    output_bits: Annotated[int, Field(ge=1, le=8)] = Field(
        default=8, description="of the pictures' tones"
    )
