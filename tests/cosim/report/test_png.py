"""Picture files: refused names."""

from pathlib import Path

import numpy as np
import pytest

from cosim import InputError
from cosim.report.png import write_png


@pytest.mark.parametrize(
    ("name", "tried"), [("a.jpg", "a.png"), ("a", "a.png"), (".", "image.png"), ("/", "/image.png")]
)
def test_another_ending_is_refused(name: str, tried: str) -> None:
    with pytest.raises(InputError) as caught:
        write_png(Path(name), np.zeros((2, 2), np.uint8))
    assert str(caught.value) == f"--out must be a name ending in .png, not {name}; try {tried}"
