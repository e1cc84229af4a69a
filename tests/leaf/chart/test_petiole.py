import numpy as np
import pytest
import shapely

from o3dleaf.core.mesh_arrays import triangle_areas
from o3dleaf.leaf.chart.petiole import find_petiole
from tests.sheet_shapes import blade, ellipse, lobed, rolled, stalked, triangulated


@pytest.mark.parametrize("stub", [0.0, 8.0])
@pytest.mark.parametrize("thickness", [2.0, 4.0])
def test_a_petiole_is_cut_off_at_the_blade_with_its_stub(stub, thickness):
    flat, triangles = triangulated(stalked(thickness=thickness, stub=stub), 0.9)
    sheet = rolled(flat)
    kept, petiole = find_petiole(sheet, triangles)
    outside = flat[triangles].mean(axis=1)[:, 0] < 40
    assert triangle_areas(sheet, triangles)[kept == outside].sum() < 0.02 * triangle_areas(sheet, triangles).sum()
    assert petiole.width == pytest.approx(thickness, rel=0.1)
    assert petiole.length == pytest.approx(40 + (6 if stub else 0), abs=3)
    junction = rolled(np.array([[40.0, 0.0]]))[0]
    assert np.linalg.norm(np.array(petiole.junction) - junction) < 4
    assert "petiole: 4" in str(petiole)


def finger(radius=1.0, length=30.0):
    """A blade in the plane whose petiole is a closed tube that hangs from a hole at its end."""
    around, along = np.meshgrid(np.arange(16), np.arange(41), indexing="ij")
    angle = around * 2 * np.pi / 16
    tube = np.stack([radius * np.cos(angle), radius * np.sin(angle), -along * length / 40], axis=-1).reshape(-1, 3)
    at = lambda i, j: (i % 16) * 41 + j  # noqa: E731
    i, j = around[:, :-1].ravel(), along[:, :-1].ravel()
    walls = np.concatenate(
        [
            np.stack([at(i, j), at(i, j + 1), at(i + 1, j + 1)], 1),
            np.stack([at(i, j), at(i + 1, j + 1), at(i + 1, j)], 1),
        ]
    )
    rings = np.concatenate([[radius], np.linspace(radius + 0.5, 15, 20)])
    disc = np.stack(
        [np.outer(np.cos(angle[:, 0]), rings), np.outer(np.sin(angle[:, 0]), rings), np.zeros((16, 21))], axis=-1
    ).reshape(-1, 3)
    on = lambda i, j: len(tube) + (i % 16) * 21 + j  # noqa: E731
    i, j = (each.ravel() for each in np.meshgrid(np.arange(16), np.arange(20), indexing="ij"))
    plate = np.concatenate(
        [
            np.stack([on(i, j), on(i, j + 1), on(i + 1, j + 1)], 1),
            np.stack([on(i, j), on(i + 1, j + 1), on(i + 1, j)], 1),
        ]
    )
    tip = len(tube) + len(disc)
    i = np.arange(16)
    cap = np.stack([at(i, 40), at(i + 1, 40), np.full(16, tip)], axis=1)
    vertices = np.concatenate([tube, disc, [[0, 0, -length]]])
    triangles = np.concatenate([walls[:, ::-1], plate, cap])
    first = np.arange(len(vertices))
    first[len(tube) + np.arange(16) * 21] = np.arange(16) * 41
    used, corner = np.unique(first[triangles], return_inverse=True)
    return vertices[used], corner.reshape(-1, 3)


def test_a_petiole_that_is_a_closed_tube_is_known_by_the_way_around_it():
    vertices, triangles = finger()
    kept, petiole = find_petiole(vertices, triangles)
    assert petiole.width == pytest.approx(2 * np.pi, rel=0.1)
    assert petiole.length == pytest.approx(31, abs=3)
    assert vertices[triangles[kept]][:, :, 2].min() > -4


TIPS = {
    "grass that tapers over its whole length": shapely.Polygon([(0, -6), (300, 0), (0, 6)]),
    "grass": blade(200, 10),
    "long drawn tip": shapely.Polygon([(0, -15), (40, -20), (80, -4), (140, 0), (80, 4), (40, 20), (0, 15)]),
    "ellipse": ellipse(100, 50),
    "lobed": lobed(),
    "shred at the margin": ellipse(100, 50).union(shapely.box(98, -1, 120, 1)),
}


@pytest.mark.parametrize("tip", TIPS)
def test_a_tip_is_no_petiole(tip):
    flat, triangles = triangulated(TIPS[tip], 1.2)
    kept, petiole = find_petiole(rolled(flat), triangles)
    assert petiole is None
    assert kept.all()
