"""Modules that a run imports, imported once by the server that runs are forked from.

Nothing is executed here: threads of OpenCL or numba would not survive the fork.
"""

import av  # noqa: F401
import cv2  # noqa: F401
import matplotlib.figure  # noqa: F401
import moderngl  # noqa: F401
import numba  # noqa: F401
import pyopencl  # noqa: F401
import scipy.optimize  # noqa: F401
import zarr.codecs  # noqa: F401

import scenarios.assemble.schema.loading
import scenarios.assemble.source.asynchronous
import scenarios.assemble.source.continuous
import scenarios.assemble.source.imager
import scenarios.assemble.source.latched
import scenarios.assemble.source.link
import scenarios.cli.entry
import scenarios.run  # noqa: F401
