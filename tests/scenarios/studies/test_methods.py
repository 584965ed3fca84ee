"""The methods of images beside the true light: motion alignment on moving scenes, and the table."""

from __future__ import annotations

import json

import cv2
import numpy as np
import pytest

from cosim import Clock, InputError, Viform
from cosim.files import open_stream
from cosim.files.npz import write_npz
from cosim.stage import blocks
from scenarios.assemble.schema.loading import filmed, load
from scenarios.assemble.source.latched.setup import set_up_camera
from scenarios.python import reconstruct as reconstruct_in_python
from scenarios.studies.methods import truth_of_file
from sensor import SpikeCamera, tfp
from sensor.reconstruct import METHODS, reconstruct
from sensor.reconstruct.fidelity import psnr, ssim, to_white
from tests.scenarios.scenes.clips.test_sizes import png


@pytest.mark.parametrize(
    "scene",
    ["film", "star", "wave"],  # a chart whose strips move, a turning star, a person who waves
)
def test_motion_alignment_is_2_db_above_the_best_plain_window(scene):
    """With its default window, against every odd window; the camera has all its noise."""
    sets = [f"scene.kind={scene}", "sensor.chip=spikeone", "duration=12.8 ms", "image.at=[256]"]
    setup = set_up_camera(filmed(load("film", sets)[1], "run"), None)
    source, camera, cycles = setup.source(), SpikeCamera(setup.setting, setup.device), setup.cycles
    stages = setup.stages(source)
    words = []
    for block in blocks(cycles):
        light = None
        for stage in (*stages.values(), camera):
            light = stage.step(light, block)
        words.append(light.words)
    stream, at = Viform(np.concatenate(words), cycles, setup.setting.clock), 256
    truth = source.truth(stream.clock.middle(at))

    def fidelity(rate):
        return psnr(to_white(rate, setup.white_rate), truth)

    best = max(fidelity(tfp(stream, at, window)) for window in range(1, 2 * at, 2))
    assert fidelity(reconstruct(stream, "motion-tfp", at).rate) > best + 2


def test_the_table_has_every_method_with_its_best_window(step_run, viform):
    answer = viform("compare-methods", step_run.folder, "--json")
    told = json.loads(answer.out)
    white = step_run.result.metrics["white_rate"].value
    assert (told["white_rate"], told["cycles"]) == (white, 100)
    truths = {
        cycle: cv2.imread(
            str(step_run.folder / f"images/truth-{cycle:05d}.png"), cv2.IMREAD_UNCHANGED
        ) / 255
        for cycle in told["instants"]
    }  # fmt: skip
    assert len(truths) == 5
    assert [row["method"] for row in told["rows"]] == list(METHODS)
    stream = open_stream(step_run.folder)
    for row in told["rows"]:
        assert row["processor_s"] > 0
        for tried in row["searched"]:
            assert tried["psnr_db"] <= row["psnr_db"]
        images = [
            to_white(reconstruct(stream, row["method"], at, row["window"]).rate, white)
            for at in truths
        ]
        measured = np.mean([psnr(*pair) for pair in zip(images, truths.values(), strict=True)])
        assert row["psnr_db"] == pytest.approx(measured, abs=1e-4)
        measured = np.mean([ssim(*pair) for pair in zip(images, truths.values(), strict=True)])
        assert row["ssim"] == pytest.approx(measured, abs=1e-4)
    # Those of the run are from the light itself, not from 8 bits of it.
    own = step_run.result.metrics["tfi_psnr"].value
    assert told["rows"][1]["psnr_db"] == pytest.approx(own, abs=0.05)


@pytest.fixture
def known(tmp_path):
    """A stream of a quarter and half a spike a cycle, white being one, and its truth by name."""
    planes = np.zeros((64, 16, 24), np.uint8)
    planes[::4] = 1
    planes[::2, :, 12:] = 1
    truth = np.full((16, 24), 64, np.uint8)
    truth[:, 12:] = 128
    write_npz(Viform.from_planes(planes, Clock(40_000)), tmp_path / "a.npz")
    np.save(tmp_path / "t.npy", truth / 256)
    cv2.imwrite(str(tmp_path / "t.png"), truth)
    return tmp_path


def test_a_truth_of_the_user_is_met(known, viform):
    stream, words = known / "a.npz", ["--at", 32, "--scale", 1]
    told = json.loads(
        viform("compare-methods", stream, "--truth", known / "t.npy", *words, "--json").out
    )
    rows = {row["method"]: row for row in told["rows"]}
    assert told["instants"] == [32]
    assert rows["tfi"]["psnr_db"] is None  # infinite: no error
    assert rows["tfi"]["edge_px"] == 0 and rows["tfi"]["window"] is None
    assert rows["tfi"]["ssim"] == pytest.approx(1)
    plain = {tried["window"]: tried["psnr_db"] for tried in rows["tfp"]["searched"]}
    # 3 cycles from 31 on hold one spike of either, 1/3 for 1/4 and for 1/2.
    assert plain[3] == pytest.approx(-10 * np.log10((1 / 12**2 + 1 / 6**2) / 2), abs=1e-4)
    assert max(plain) == 61 and plain[rows["tfp"]["window"]] == max(plain.values())
    half = viform("compare-methods", stream, "--truth", known / "t.png", "--at", 32)
    lines = half.out.splitlines()
    assert lines[0].split()[:2] == ["method", "window"]
    assert [line.split()[0] for line in lines[1:5]] == list(METHODS)
    eight = np.array([64, 128]) / 255 - np.array([1 / 4, 1 / 2])  # 8-bit levels of the truth
    assert lines[2].split()[1] == f"{-10 * np.log10(np.mean(eight**2)):.2f}"


def test_the_interval_of_a_spike_at_the_instant_is_chosen(tmp_path, viform):
    """Spikes 4 and 10 cycles apart: 1/4 before the one between, as by default, and 1/10 after."""
    planes = np.zeros((20, 16, 24), np.uint8)
    planes[[4, 8, 18]] = 1
    stream, truth, out = (tmp_path / name for name in ("a.npz", "t.npy", "i.npy"))
    write_npz(Viform.from_planes(planes, Clock(40_000)), stream)
    np.save(truth, np.full((16, 24), 0.2))
    for ties, cycles in (("before", 4), ("after", 10)):
        words = [] if ties == "before" else ["--ties", ties]
        assert viform("image", stream, "--at", 8, "--method", "tfi", "--out", out, *words).code == 0
        assert (np.load(out) == np.float32(1 / cycles)).all()
        made = [
            reconstruct_in_python(stream, 8, method, ties=ties, preceding=preceding)[0, 0]
            for method in ("tfi", "tau") for preceding in (False, True)
        ]  # fmt: skip
        assert made == [np.float32(1 / cycles), np.float32(1 / 4), 255 - cycles, 251]
        given = ("--truth", truth, "--at", 8, "--scale", 1, "--json", *words)
        told = json.loads(viform("compare-methods", stream, *given).out)
        assert told["ties"] == ties and told["rows"][1]["method"] == "tfi"
        expected = -20 * np.log10(abs(1 / cycles - 0.2))
        assert told["rows"][1]["psnr_db"] == pytest.approx(expected, abs=1e-3)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ((), "STREAM must be the folder of a run with images of its truth, not {folder}/a.npz; "
         "give --truth FILE --at N --scale RATE"),
        (("--truth", "{folder}/t.npy"),
         "--at must be given with --truth, not absent; add the cycle of its instant"),
        (("--at", "3"), "--at must be given with --truth, not 3 alone; leave it out"),
        (("--truth", "{folder}/t.npy", "--at", "64"),
         "--at must be a cycle from 0 to 63, not 64; try --at 32"),
        (("--truth", "{folder}/t.npy", "--at", "9", "--scale", "0"),
         "--scale must be a number above 0, not 0; write the rate of white"),
        (("--truth", "{folder}/wide.npy", "--at", "9"),
         "the truth must be 24x16, as the stream, not 25x16; give that of the stream"),
        (("--truth", "{folder}/a.npz", "--at", "9"),
         "the truth must be a grey PNG, or a .npy of (H, W) finite numbers, not {folder}/a.npz "
         "(no PNG); check it"),
    ],
)  # fmt: skip
def test_what_cannot_be_compared_is_one_line(known, refused, words, said):
    np.save(known / "wide.npy", np.zeros((16, 25)))
    given = [word.format(folder=known) for word in words]
    assert refused("compare-methods", known / "a.npz", *given) == said.format(folder=known)


def test_a_run_whose_white_changes_is_refused(step_run, refused, tmp_path):
    for name in ("stream.zarr", "images", "result.json"):
        (tmp_path / name).symlink_to(step_run.folder / name)
    text = (step_run.folder / "scenario.toml").read_text()
    (tmp_path / "scenario.toml").write_text(text + '\n[sensor.colour]\nfilter = "rggb"\n')
    assert "must be a run without sensor.colour" in refused("compare-methods", tmp_path)


def test_a_truth_of_many_pixels_is_refused_before_it_is_unpacked(tmp_path, monkeypatch):
    png(tmp_path / "a.png", 4000, 3000)
    monkeypatch.setattr(cv2, "imdecode", None)
    with pytest.raises(InputError, match="the truth must be 24x16, as the stream, not 4000x3000"):
        truth_of_file(tmp_path / "a.png", (16, 24))
