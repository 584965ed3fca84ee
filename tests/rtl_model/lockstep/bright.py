"""A program that saturates the charges, which random programs do once in some 10^7 pixel-cycles."""

from rtl_model.lockstep import Program
from rtl_model.lockstep.program import ADDRESS, Chunk, Write

FRAMES = 20  # of light, then of darkness
HELD = 16  # quanta of 255 in a full charge of 4095 electrons

_SETTINGS = {
    "sensor_threshold": 0,  # Q = 255
    "sensor_reset_rule": 2,  # one quantum is taken, the rest stays
    "sensor_clock_select": 1,  # 20 kHz: a tick collects twice
    "sensor_pattern": 1,  # the same light everywhere
    "sensor_level": 255,  # 2 * 255 - Q = 255 more each tick: full after 17
    "sensor_tick_clocks": 0,
    "sensor_run": 1,
}


class Bright(Program):
    """Light that saturates every charge, then darkness in which the residual charge fires.

    Each pixel fires in all `FRAMES` frames of light and `HELD` times after them.
    """

    @property
    def pixels(self) -> int:
        """Pixel-cycles of the whole program."""
        return 2 * FRAMES * self.rows * self.columns

    def chunk(self, number: int, clock: int) -> Chunk:
        """The program, which is one chunk."""
        writes = [
            Write(clock + place, ADDRESS[name], value)
            for place, (name, value) in enumerate(_SETTINGS.items())
        ]
        begun = clock + len(writes)  # the first frame, a clock after the write of sensor_run
        scan = self.geometry.tick_minimum  # half of a period: the other half is rest
        light = begun + FRAMES * 2 * scan
        writes.append(Write(light - scan // 2, ADDRESS["sensor_level"], 0))
        stop = light + FRAMES * 2 * scan - scan // 2
        return Chunk(stop, writes, [ADDRESS["sensor_spikes"]], 0, 0)


BRIGHT = Bright(rows=4, columns=40, lanes=32)
