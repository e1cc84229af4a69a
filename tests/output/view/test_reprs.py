"""What a public object of pictures, volumes, textures and samples prints is one short line, whatever it holds."""

import numpy as np
import pytest

import o3dleaf as o3l


def things():
    """One of each, with arrays that would fill a page."""
    volume, patch = o3l.samples.wheat_ct(size=(600.0, 600.0, 480.0))
    scan = o3l.samples.wheat_scan(count=500)
    points = np.random.default_rng(0).normal(size=(2000, 3))
    field = o3l.PUInterpolant.fit(points, points[:, 2], smoothing=1.0, unit="um")
    texture = o3l.TiledField(field)
    sphere = o3l.samples.Sphere()
    return [
        volume,
        patch,
        scan,
        scan.truth,
        texture,
        o3l.PatchBlend([texture, texture], [0.5], 0.1),
        o3l.samples.Figure(),
        o3l.samples.WavySheet(),
        o3l.samples.Torus(),
        o3l.samples.Block(),
        o3l.samples.Wires(),
        sphere,
        sphere.closest(points),
        o3l.view.Points(points, color="#d55e00"),
        o3l.view.Scalars(points[:, 0], "height, mm"),
        o3l.view.Inset((points, np.arange(1500).reshape(-1, 3)), "close-up"),
        o3l.view.View(),
    ]


@pytest.mark.parametrize("thing", things(), ids=lambda thing: type(thing).__name__)
def test_a_repr_is_one_short_line_that_begins_with_the_name(thing):
    text = repr(thing)
    assert text.startswith(f"{type(thing).__name__}(")
    assert "\n" not in text
    assert len(text) < 200
