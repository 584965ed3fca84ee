"""The nine drive signals stepped clock by clock, with counters as an FPGA would have them."""

from imagers.ebaps.device.drive import LAG, READING, RESETTING


class _Rows:
    """A clock within the row and a row counter; starts when told, stops after the last row."""

    def __init__(self, columns, rows):
        self.columns, self.rows = columns, rows
        self.column = self.row = None

    def start(self):
        self.column, self.row = 0, 0

    def step(self):
        if self.row is None:
            return
        self.column += 1
        if self.column == self.columns:
            self.column, self.row = 0, self.row + 1
            if self.row == self.rows + 1:  # one more for pulses that outlast the last row
                self.column = self.row = None


def dense(timing, exposures, clocks):
    """Per signal, a list of its level in each clock.

    exposures: ns of frames 0, 1, ...; those after have none. Pulses here all end within a row.
    """
    columns, rows = timing.columns, timing.rows
    levels = {name: [0] * clocks for name in [*READING, "VSYNC", "hclk_on"]}
    reading = _Rows(columns, rows)
    counters = [_Rows(columns, rows), _Rows(columns, rows)]  # resets of frames in turn
    period, shift = 0, 0
    vsync = 0
    for clock in range(clocks):
        # a period ends at the last clock that is not after its third of a second
        if (clock + 1) * timing.rate > (period + 1) * timing.clock_hz:
            if period < len(exposures):
                reading.start()
                shift = -LAG
            period += 1
            vsync = 0
        if period < len(exposures):
            left = (period + 1) * timing.clock_hz // timing.rate - clock
            if left == exposures[period] * timing.clock_hz // 10**9:
                vsync = 1
                counters[period % 2].start()
        levels["VSYNC"][clock] = vsync
        if reading.row is not None and reading.row < rows:
            for name, (rise, fall) in READING.items():
                levels[name][clock] |= rise <= reading.column < fall
        for resetting in counters:
            if resetting.row is not None and resetting.row < rows:
                for name, (rise, fall) in RESETTING.items():
                    levels[name][clock] |= rise <= resetting.column < fall
        if period and reading.row is not None:
            levels["hclk_on"][clock] = int(0 <= shift < columns * rows)
        shift += 1
        reading.step()
        for resetting in counters:
            resetting.step()
    return levels


def intervals(levels):
    """[(rise, fall)] of a list of levels."""
    found, begin = [], None
    for clock, level in enumerate([*levels, 0]):
        if level and begin is None:
            begin = clock
        elif not level and begin is not None:
            found.append((begin, clock))
            begin = None
    return found


def disturbed(drive, frame, exposure, following):
    """Rows of a frame in whose SEL a reset's T is high out of step with their own, pair by pair."""
    selected = list(zip(*drive.reading("SEL", frame), strict=True))
    own = list(zip(*drive.reading("T", frame), strict=True))
    found = 0
    for number, ns in ((frame, exposure), (frame + 1, following)):
        for rise, fall in zip(*drive.resetting("T", number, ns), strict=True):
            for (on, off), mine in zip(selected, own, strict=True):
                if rise < off and fall > on and (rise, fall) != mine:
                    found += 1
    return found


def exposed_rows(timing, exposures, frame):
    """Clocks that each row of a frame gathers, stepped clock by clock: a shift register of resets
    with one token a frame, all of whose rows each pulse of RST and T resets, and the reading that
    ends it. exposures: ns of frames 0, 1, ..., which follow each other."""
    columns, rows = timing.columns, timing.rows
    on, off = RESETTING["T"]
    tokens = []  # clocks since each frame's reset began
    starts = [timing.vsync(n + 1) - ns * timing.clock_hz // 10**9 for n, ns in enumerate(exposures)]
    last = [None] * rows
    gathered = [None] * rows
    reading = timing.vsync(frame + 1)
    for clock in range(timing.vsync(frame + 2) + columns * rows):
        tokens = [t + 1 for t in tokens if t + 1 < columns * rows]
        tokens += [0 for start in starts if start == clock]
        if any(t % columns == off - 1 for t in tokens):  # the pulse's last clock
            for t in tokens:
                last[t // columns] = clock
        since = clock - reading
        if since >= 0 and since % columns == off - 1 and since // columns < rows:
            row = since // columns
            gathered[row] = clock - last[row]
            last[row] = clock
    assert on < off
    return gathered
