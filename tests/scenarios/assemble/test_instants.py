"""The instants of a run's images: five even ones, or those that the scenario names."""

from __future__ import annotations

import pytest

from cosim import InputError


@pytest.mark.parametrize(
    ("assignments", "expected"),
    [
        (("image.window=40",), "image.window must be odd, not 40; set 41"),
        (("duration=1 ms",),
         "duration must be at least image.window = 41 cycles, not 40 cycles; lengthen it or "
         "shorten image.window"),
        (("image.at=[3, 100]",),
         "image.at must be cycles below 100, not 100; lengthen duration or drop it"),
        (("scene.start=1 s", "scene.path=nosuch.png"), None),
    ],
)  # fmt: skip
def test_what_a_run_cannot_show_is_refused_before_anything_is_written(
    film, tmp_path, assignments, expected
):
    with pytest.raises(InputError) as caught:
        film("film", tmp_path / "run", *assignments)
    if expected is not None:
        assert str(caught.value) == expected
    assert list(tmp_path.iterdir()) == []


def test_images_are_made_at_five_even_instants_unless_others_are_given(step_run, film, tmp_path):
    names = [name for name in step_run.result.files if name.startswith("images/tfp")]
    assert names == [f"images/tfp-{cycle:05d}.png" for cycle in (10, 30, 50, 70, 90)]
    _, folder = film("step", tmp_path / "run", "image.at=[99, 0]", "image.window=1")
    pictures = {f"{kind}-{at:05d}.png" for kind in ("tfi", "tfp", "truth") for at in (0, 99)}
    floats = {"truth-00000.npy", "truth-00099.npy"}
    assert {path.name for path in (folder / "images").iterdir()} == pictures | floats
