"""Looking at spans of light: against the definition, one shifted plane after another."""

from __future__ import annotations

import numpy as np
import pytest

from cosim import PS, Clock, Light, Piece
from display import CameraPlane, FixedEye, PursuingEye
from display.observe.integration import WAITING, LightPlanes, ObserverImages, Span
from display.references.displays import TruthShow
from display.render.golden import _shifted

MS = PS // 1000
SHAPE = (12, 50)
RNG = np.random.default_rng(5)
PLANE = RNG.random(SHAPE).astype(np.float32)
EYE = FixedEye((3 * MS, 7 * MS), 300.0, 0, 10 * MS)


def defined(span: Span, plane: np.ndarray, observer: PursuingEye, parts: int) -> np.ndarray:
    """Images of a span as `display.plain` says, the span in so many parts."""
    edges = span.start + (span.stop - span.start) * np.arange(parts + 1) // parts
    weight = observer.weights(edges[:-1], edges[1:])
    dy, dx = observer.shifts((edges[:-1] + edges[1:]) // 2)
    images = np.zeros((observer.images, *plane.shape))
    for image, w, y, x in zip(images, weight, dy, dx, strict=True):
        for k in range(parts):
            down, along = (np.full((len(plane), 1), s[k]) for s in (y, x))
            image += w[k] * _shifted(plane.astype(np.float64), down, along)
    return images


@pytest.mark.parametrize("velocity", [(0.0, 4000.0), (0.0, -4000.0), (900.0, 2500.0), (0.0, 0.0)])
def test_a_short_span_is_one_shifted_plane(velocity):
    observer = PursuingEye(EYE, velocity)
    images = ObserverImages([observer], SHAPE)
    span = Span(0, 2 * MS, 2 * MS + 60 * PS // 10**6)  # a quarter of a pixel at 4 000 px/s
    images.add(LightPlanes(PLANE[None], [span]))
    expected = defined(span, PLANE, observer, 1)
    assert expected.max() > 1e-3
    np.testing.assert_allclose(images.images, expected, rtol=0, atol=3e-7 * expected.max())


@pytest.mark.parametrize("velocity", [(0.0, 4000.0), (900.0, -2500.0)])
def test_a_long_span_smears_as_a_thousand_short_ones_do(velocity):
    observer = PursuingEye(EYE, velocity)
    images = ObserverImages([observer], SHAPE)
    span = Span(0, 1 * MS, 5 * MS)
    images.add(LightPlanes(PLANE[None], [span]))
    expected = defined(span, PLANE, observer, 1024)
    # Shifts that differ by at most 1/8 pixel each way cancel to second order, 1/4^2 / 24 of a
    # curvature of at most 4 of noise between 0 and 1; the light is dark outside.
    assert expected.max() > 0.15
    assert np.abs(images.images - expected).max() < 0.0105 * expected.max()


def test_several_planes_at_once_are_their_sum():
    observer = PursuingEye(EYE, (0.0, 4000.0))
    planes = (RNG.random((3, *SHAPE)) < 0.4).astype(np.uint8)
    spans = [Span(n % 3, n * MS, (n + 1) * MS) for n in range(7)]
    together, alone = ObserverImages([observer], SHAPE), ObserverImages([observer], SHAPE)
    together.add(LightPlanes(planes, spans))
    for span in spans:
        plane = planes[span.plane].astype(np.float32)[None]
        alone.add(LightPlanes(plane, [Span(0, span.start, span.stop)]))
    np.testing.assert_allclose(together.images, alone.images, rtol=0, atol=1e-6)
    with pytest.raises(ValueError, match="planes must be of"):
        together.add(LightPlanes(planes[:, :3], spans))


def test_planes_that_wait_are_part_of_the_state():
    observer = PursuingEye(EYE, (0.0, 4000.0))
    lights = [
        LightPlanes(RNG.random((1, *SHAPE)).astype(np.float32), [Span(0, n * MS, (n + 1) * MS)])
        for n in range(WAITING + 2)
    ]
    straight, cut = ObserverImages([observer], SHAPE), ObserverImages([observer], SHAPE)
    for light in lights:
        straight.add(light)
        again = ObserverImages([observer], SHAPE)
        again.restore(cut.state())
        again.add(light)
        cut = again
    assert straight.images.std() > 1e-3
    np.testing.assert_array_equal(cut.images, straight.images)


def test_several_observers_see_what_each_sees_alone():
    each = EYE, PursuingEye(EYE, (0.0, 4000.0)), CameraPlane((MS,), 2 * MS)
    light = LightPlanes(
        RNG.random((3, *SHAPE)).astype(np.float32),
        [Span(n, n * MS, (n + 1) * MS) for n in range(3)],
    )
    together, alone = ObserverImages(each, SHAPE), []
    together.add(light)
    for observer in each:
        alone.append(ObserverImages([observer], SHAPE))
        alone[-1].add(light)
    expected = np.concatenate([images.images for images in alone])
    np.testing.assert_allclose(together.images, expected, rtol=0, atol=1e-6)


def test_reduced_images_are_means_of_the_images():
    camera, by = CameraPlane((MS, 2 * MS), 2 * MS), 3
    for dtype in (np.float32, np.uint8):
        planes = (RNG.random((4, *SHAPE)) * 2).astype(dtype)
        light = LightPlanes(planes, [Span(n, n * MS, (n + 1) * MS) for n in range(4)])
        whole = ObserverImages([camera], SHAPE)
        whole.add(light)
        height, width = SHAPE[0] // by, SHAPE[1] // by
        squares = whole.images[:, : height * by, : width * by]
        means = squares.reshape(2, height, by, width, by).mean(axis=(2, 4))
        np.testing.assert_allclose(light.reduced(camera, by), means, rtol=0, atol=1e-6)
    with pytest.raises(ValueError, match="by must be 1 to"):
        light.reduced(camera, max(SHAPE) + 1)


def test_light_that_has_left_the_retina_is_dark():
    observer = PursuingEye(CameraPlane((MS,), 2 * MS), (0.0, 1e6))  # 1 000 pixels each way
    images = ObserverImages([observer], SHAPE)
    images.add(LightPlanes(np.ones((1, *SHAPE), np.float32), [Span(0, 0, 2 * MS)]))
    # A pixel looks at the plane for as long as it takes to cross its 50 columns.
    np.testing.assert_allclose(images.images, 50 / 2000, rtol=2e-3)


def ramps(clock: Clock, count: int, every: int) -> list[Piece]:
    """Light that runs between planes of noise, `every` cycles a piece."""
    planes = [700 * RNG.random(SHAPE).astype(np.float32) for _ in range(count + 1)]
    return [
        Piece(clock.edge(n * every), clock.edge((n + 1) * every), planes[n], planes[n + 1])
        for n in range(count)
    ]


def test_the_truth_is_the_integral_of_the_light():
    clock = Clock(40_000)
    pieces = ramps(clock, 20, 10)
    camera = CameraPlane((clock.edge(37), clock.edge(120)), clock.edge(50))
    show = TruthShow(700.0, clock.edge(16), clock.edge(200))
    images = ObserverImages([camera], SHAPE)
    for lit in show.step(Light(tuple(pieces)), clock.edge(200)):
        images.add(lit)
    for image, centre in zip(images.images, camera.instants, strict=True):
        begin = centre - camera.exposure // 2
        exact = Light(tuple(pieces)).integral(begin, begin + camera.exposure)
        exact *= PS / camera.exposure / 700
        # A ramp that is cut by the exposure's end counts there with its whole span's slope: at
        # most an eighth of one span's change at each end, of a span of 10 of 50 cycles.
        assert np.abs(image - exact).max() < 2 * 10 / 50 / 8
        assert abs(image.mean() - exact.mean()) < 2e-3


def test_a_truth_that_stands_still_is_itself():
    plane = (700 * RNG.random(SHAPE)).astype(np.float32)
    clock = Clock(40_000)
    light = Light((Piece(0, 2**62, plane, plane),))
    eye = FixedEye((2 * MS, 6 * MS), 300.0, 0, clock.edge(320))
    show, images = TruthShow(700.0, clock.edge(16), clock.edge(320)), ObserverImages([eye], SHAPE)
    for stop in (64, 100, 320):
        for lit in show.step(light, clock.edge(stop)):
            images.add(lit)
    np.testing.assert_allclose(images.images, np.stack([plane / 700] * 2), rtol=2e-6)
