"""The rows of a chip in bands, which workers simulate; the bits are those of one run."""

from scenarios.assemble.camera.bands.chain import BandChain, BandedCamera, Bands, refuse_bands

__all__ = ["BandChain", "BandedCamera", "Bands", "refuse_bands"]
