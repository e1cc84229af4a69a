"""Clouds are drawn where their points are, things of a scene keep their own colors, and both engines draw the same."""

import numpy as np
import open3d as o3d
import pytest

from mesh_fields import sphere
from o3dleaf import extract_isosurface
from o3dleaf.core.errors import InputError, MemoryBudgetError, O3DLeafError
from o3dleaf.core.mesh_arrays import build_mesh, mesh_arrays
from o3dleaf.core.processes.child_process import run_in_subprocess
from o3dleaf.output.view import Points, offscreen, render, scene
from o3dleaf.output.view import points as points_module
from o3dleaf.output.view.camera import View
from o3dleaf.output.view.picture import PAPER, Inset, Scalars, draw_page
from o3dleaf.output.view.points import make_facets, make_spheres
from tolerances import BACKGROUND, ENGINES_COLOR, ENGINES_COVER, SILHOUETTE

SIZE = (320, 200)
FACE_ON = View(direction=(0.0, 0.0, 1.0), tilt=0.0)


@pytest.fixture(scope="module")
def ball():
    return extract_isosurface(sphere(), 0.08)


@pytest.fixture(scope="module")
def scattered():
    """Points of a wavy strip, 4 by 2, well apart."""
    x, y = (grid.ravel() for grid in np.meshgrid(np.linspace(-2, 2, 9), np.linspace(-1, 1, 5)))
    return np.column_stack([x, y, 0.1 * np.sin(3 * x)])


def is_paper(page):
    return np.abs(page / 255.0 - PAPER).max(axis=2) < BACKGROUND


def test_a_cloud_is_a_disc_at_each_point(scattered):
    """Literal twin: pixels in a circle about a projected point are drawn, those outside all circles are paper."""
    page = render(Points(scattered, 0.1), size=SIZE, scale_bar=False, view=FACE_ON)
    columns = np.flatnonzero(~is_paper(page).all(axis=0))
    scale = np.ptp(columns) / 4.2
    middle = (columns[0] + columns[-1] + 1) / 2
    x, y = np.meshgrid(np.arange(SIZE[0]) + 0.5, np.arange(SIZE[1]) + 0.5)
    place = np.stack([middle + scale * scattered[:, 0], SIZE[1] / 2 - scale * scattered[:, 1]], axis=1)
    away = np.min(np.hypot(x[..., np.newaxis] - place[:, 0], y[..., np.newaxis] - place[:, 1]), axis=-1)
    assert not is_paper(page)[away < 0.1 * scale - SILHOUETTE].any()
    assert is_paper(page)[away > 0.1 * scale + SILHOUETTE].all()
    assert 0.1 * scale > 3 * SILHOUETTE


def test_a_cloud_shows_its_face_and_its_points_by_default_do_not_touch(scattered):
    turned = scattered @ np.linalg.qr(np.random.default_rng(0).normal(size=(3, 3)))[0]
    page = draw_page(Inset(turned, view=View(tilt=0.0)), size=SIZE, scale_bar=False).pixels()
    rows, columns = np.nonzero(~is_paper(page))
    assert np.ptp(columns) / np.ptp(rows) == pytest.approx(2.0, rel=0.15)
    assert Points(scattered).size(scattered) == pytest.approx(0.25, rel=0.1)


def test_spheres_have_their_radius_and_are_closed(monkeypatch):
    monkeypatch.setattr(points_module, "FINENESS", ((10, 3), (100, 1), (1000, 0)))
    for count in (2, 50, 500, 2000):
        points = np.random.default_rng(1).normal(size=(count, 3)) * 100
        vertices, triangles, owner = make_spheres(points, 0.5)
        assert len(vertices) % count == 0
        assert len(triangles) == len(owner)
        away = np.linalg.norm(vertices[triangles[:, 0]] - points[owner], axis=1)
        assert away == pytest.approx(np.full(len(away), 0.5))
        one = triangles[owner == count - 1]
        assert len(np.unique(np.sort(one[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1), axis=0)) * 2 == 3 * len(one)


def test_facets_lie_in_the_cloud(scattered):
    turn = np.linalg.qr(np.random.default_rng(3).normal(size=(3, 3)))[0]
    vertices, triangles = make_facets(scattered * [1, 1, 0] @ turn)
    corners = vertices[triangles]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert np.abs((vertices @ turn.T)[:, 2]).max() < 1e-9
    assert np.abs(normals.sum(axis=0)).max() < 1e-12 < np.abs(normals).max()


def test_things_of_a_list_are_drawn_together_each_in_its_color(ball):
    things = [ball, Points([[-3.0, 0, 0]], 0.8, "#d55e00"), Points([[3.0, 0, 0]], 0.8, "#0072b2")]
    page = render(things, size=SIZE, scale_bar=False, view=FACE_ON).astype(float)
    drawn = ~is_paper(page)
    left, middle, right = (page[:, part][drawn[:, part]].mean(axis=0) for part in np.split(np.arange(300), 3))
    assert left.argmax() == 0
    assert middle.argmax() == 1
    assert right.argmax() == 2


def test_each_mesh_of_a_list_keeps_the_colors_of_its_vertices(ball):
    halves = []
    for shift, colors in ((-1.5, ([1, 0, 0], [0, 0, 1])), (1.5, ([0, 0, 1], [1, 0, 0]))):
        # Longest along x, which tells the picture's right.
        vertices, triangles = mesh_arrays(ball)
        mesh = build_mesh(vertices * [1.3, 1, 1] + [shift, 0, 0], triangles)
        upper = np.asarray(mesh.vertices)[:, 1] > 0
        mesh.vertex_colors = o3d.utility.Vector3dVector(np.where(upper[:, np.newaxis], *np.array(colors, float)))
        halves.append(mesh)
    page = render(halves, size=SIZE, scale_bar=False, view=FACE_ON).astype(float)
    warm = (page[..., 0] - page[..., 2]) * ~is_paper(page)
    quarters = [[warm[:90, :140], warm[:90, 180:]], [warm[110:, :140], warm[110:, 180:]]]
    assert [[quarter.sum() > 0 for quarter in row] for row in quarters] == [[True, False], [False, True]]
    assert min(abs(quarter.sum()) for row in quarters for quarter in row) > 1e5


def test_scalars_of_a_list_are_those_of_the_first(scattered):
    things = [Points(scattered, 0.2), Points([[0, 1.6, 0.0]], 0.2, "#ff00ff")]
    page = render(things, size=(400, 300), scalars=Scalars(scattered[:, 0], "x", "coolwarm"), view=FACE_ON)
    upper = page[:60, 150:250].reshape(-1, 3).astype(float)
    magenta = upper[np.abs(upper / 255 - PAPER).max(axis=1) > 0.2].mean(axis=0)
    assert min(magenta[0], magenta[2]) > 2 * magenta[1]
    part = page[70:, :].astype(float)
    assert (part[:100, 40:80, 2] - part[:100, 40:80, 0]).max() > 60
    assert (part[:100, 320:360, 0] - part[:100, 320:360, 2]).max() > 60
    with pytest.raises(InputError, match="one per point"):
        render(things, size=SIZE, scalars=[1.0, 2.0])


@pytest.mark.parametrize("kind", ["legacy", "tensor", "cloud"])
def test_a_geometry_keeps_its_own_colors(ball, scattered, kind):
    if kind == "cloud":
        thing = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(scattered))
        thing.paint_uniform_color([0.8, 0.1, 0.1])
    else:
        thing = o3d.geometry.TriangleMesh(ball).paint_uniform_color([0.8, 0.1, 0.1])
        thing = o3d.t.geometry.TriangleMesh.from_legacy(thing) if kind == "tensor" else thing
    page = render(thing, size=SIZE, scale_bar=False)
    red, green, blue = page[~is_paper(page)].mean(axis=0)
    assert red > 2 * max(green, blue)


@pytest.mark.parametrize(
    ("thing", "error", "words"),
    [
        (lambda: np.zeros((0, 3)), InputError, "at least 1"),
        (lambda: np.ones((5, 3)), InputError, "radius"),
        (lambda: Points(np.eye(3), -1.0), InputError, "radius"),
        (lambda: Points(np.eye(3), 1.0, "leafy"), InputError, "color"),
        (lambda: [Points(np.eye(3), 1.0), np.full((2, 3), np.nan)], InputError, "NaN"),
    ],
)
def test_clouds_that_cannot_be_drawn_are_refused(thing, error, words):
    with pytest.raises(error, match=words):
        render(thing(), size=SIZE)


def test_too_many_triangles_are_refused(monkeypatch, scattered):
    monkeypatch.setattr(scene, "MAX_TRIANGLES", 100)
    with pytest.raises(MemoryBudgetError, match="simplify"):
        render(scattered, size=SIZE)


@pytest.mark.parametrize("suffix", [".pdf", ".svg"])
def test_vectors_are_the_same_every_time(ball, tmp_path, suffix):
    pages = [tmp_path / f"{name}{suffix}" for name in "ab"]
    for page in pages:
        render(ball, page, size=(120, 80), unit="mm")
    assert pages[0].read_bytes() == pages[1].read_bytes()
    assert pages[0].read_bytes()[:5] in {b"%PDF-", b"<?xml"}


@pytest.mark.slow
def test_the_engines_draw_the_same_picture(ball):
    """Same silhouettes, furniture and colors, orthographic and in perspective; shadows and hidden sky aside."""
    if offscreen.find_renderer() is None:
        pytest.skip("Open3D's renderer does not work here: no Vulkan driver")
    heights = np.asarray(ball.vertices)[:, 1]
    # A bowl, seen from its inside too.
    vertices, triangles = mesh_arrays(ball)
    bowl = vertices, triangles[vertices[triangles, 2].mean(axis=1) < 0]
    pages = []
    for engine in ("cpu", "open3d"):
        view = View(tilt=30.0, perspective=True)
        inset = Inset(bowl, "inset", at=[[0, 0, 1]], view=View((0.0, 0.0, 1.0), tilt=30.0))
        flat = Inset(ball, at=[], view=View(tilt=60.0, smooth=False))
        things = [ball, Points([[1.5, 0, 0]], 0.2, "#d55e00")]
        colors = Scalars(heights, "height", "coolwarm")
        page = render(
            things, size=(480, 300), insets=[inset, flat], scalars=colors, unit="mm", view=view, engine=engine
        )
        pages.append(page / 255.0)
    covered = [np.abs(page - PAPER).max(axis=2) > 0.1 for page in pages]
    assert np.mean(covered[0] != covered[1]) < ENGINES_COVER
    both = covered[0] & covered[1]
    apart = np.where(both, np.abs(pages[0] - pages[1]).max(axis=2), np.nan)
    assert both.mean() > 0.15
    # The main picture, then each inset.
    for panel in (apart[:, :300], apart[:150, 300:], apart[150:, 300:]):
        assert np.nanmedian(panel) < ENGINES_COLOR


@pytest.mark.slow
def test_without_a_driver_auto_is_the_cpu_and_open3d_an_error_with_a_cure(ball, monkeypatch):
    for name in ("VK_DRIVER_FILES", "VK_ICD_FILENAMES"):
        monkeypatch.setenv(name, "/nowhere")
    calls = []

    def counted(*arguments, **options):
        calls.append(arguments)
        return run_in_subprocess(*arguments, **options)

    monkeypatch.setattr(offscreen, "run_in_subprocess", counted)
    expected = render(ball, size=SIZE)
    offscreen.find_renderer.cache_clear()
    for _ in range(2):
        assert np.array_equal(render(ball, size=SIZE, engine="auto"), expected)
    assert len(calls) == 1
    with pytest.raises(O3DLeafError, match=r"renderer: (failed|died) .*Vulkan driver .*engine='cpu'$") as caught:
        render(ball, size=SIZE, engine="open3d")
    assert "\n" not in str(caught.value)
    monkeypatch.setattr(offscreen, "SECONDS", 0.01)
    with pytest.raises(O3DLeafError, match=r"did not end within 0\.01 s .*engine='cpu'$"):
        render(ball, size=SIZE, engine="open3d")
    with pytest.raises(InputError, match="engine"):
        render(ball, size=SIZE, engine="gpu")
    offscreen.find_renderer.cache_clear()
