"""The camera of a scenario that films its display."""

from __future__ import annotations

from cosim.compute.opencl import Device
from display.camera.rolling import make_shutter
from display.camera.stage import PanelCamera
from display.chain.display import DisplayChain
from display.panels.panel import fit_words
from scenarios.assemble.schema.filming import CameraSection, SpikesSection
from scenarios.assemble.show.filmed import FramesFilmer
from scenarios.assemble.show.filmer import Filmer
from scenarios.assemble.show.spike_camera import make_spikes_filmer


def make_camera(
    section: CameraSection | None,
    display: DisplayChain,
    stream: tuple[int, int],
    cycles: int,
    seed: int,
    device: Device | None = None,
    recorded: bool = False,
) -> Filmer | None:
    """The camera that films a display; None without a section.

    Args:
        section: the section [camera].
        display: the display.
        stream: (height, width) of the stream.
        cycles: length of the run, cycles.
        seed: seed of the noise.
        device: OpenCL device of a spike camera, None for numba; the bits are the same.
        recorded: whether a recording is shown, which cannot be lengthened.

    Raises:
        InputError: the camera does not fit the panel or the run.
    """
    if section is None:
        return None
    panel = display.panel
    mapping = None if panel.shape == stream else fit_words(display.section.fit, stream, panel.shape)
    if isinstance(section, SpikesSection):
        return make_spikes_filmer(section, panel, cycles, seed, device, mapping)
    shutter = make_shutter(section, panel, cycles, recorded)
    return FramesFilmer(PanelCamera(section, shutter, seed, mapping))
