"""Pictures show the mesh where it is, paper where it is not, and the same thing every time."""

from types import SimpleNamespace

import numpy as np
import open3d as o3d
import pytest
from matplotlib.image import imread

from mesh_fields import sphere, wavy_sheets
from o3dleaf import extract_isosurface
from o3dleaf.core.errors import InputError, O3DLeafError
from o3dleaf.core.mesh_arrays import mesh_arrays
from o3dleaf.core.units import name_length
from o3dleaf.output.view import render, show
from o3dleaf.output.view.camera import Camera, View
from o3dleaf.output.view.panel import Heading, lay_out, lines_of, round_length
from o3dleaf.output.view.picture import PAPER, Inset, Scalars, draw_page
from tolerances import BACKGROUND, SILHOUETTE

SIZE = (320, 200)


@pytest.fixture(scope="module")
def blade():
    """A long wavy strip of two sheets."""
    mesh = extract_isosurface(wavy_sheets(), 0.06, [[-1.2, -0.3, -0.6], [1.2, 0.3, 0.6]], closed=False)
    return mesh.scale(10.0, (0, 0, 0))


@pytest.fixture(scope="module")
def ball():
    return extract_isosurface(sphere(), 0.08)


def is_paper(page):
    return np.abs(page / 255.0 - PAPER).max(axis=2) < BACKGROUND


def test_a_sphere_is_a_disc_on_paper(ball):
    """Literal twin: the pixels whose middle lies in the projected circle are the sphere's, all others paper."""
    page = render(ball, size=SIZE, scale_bar=False)
    assert (page.shape, page.dtype) == ((SIZE[1], SIZE[0], 3), np.uint8)
    camera = Camera.framing(*mesh_arrays(ball), View(), SIZE[0] / SIZE[1])
    x, y = np.meshgrid(np.arange(SIZE[0]) + 0.5, np.arange(SIZE[1]) + 0.5)
    center = camera.project([[0.013, -0.021, 0.007]], SIZE)[0]
    radius = SIZE[0] / camera.width
    distance = np.hypot(x - center[0], y - center[1])
    assert not is_paper(page)[distance < radius - SILHOUETTE].any()
    assert is_paper(page)[distance > radius + SILHOUETTE].all()
    assert radius > 0.4 * SIZE[1]


def test_a_leaf_is_green_and_fills_the_picture(blade):
    page = render(blade, size=SIZE, scale_bar=False)
    leaf = ~is_paper(page)
    columns = np.flatnonzero(leaf.any(axis=0))
    assert np.ptp(columns) > 0.88 * SIZE[0]
    red, green, blue = page[leaf].mean(axis=0)
    assert green > red > blue


def test_the_same_input_gives_the_same_picture(blade, ball):
    pages = [render(blade, size=SIZE, insets=[Inset(ball)], unit="mm", title="leaf") for _ in range(2)]
    assert np.array_equal(*pages)


def test_insets_scale_bars_and_title_are_drawn_where_they_belong(blade, ball):
    plain = render(blade, size=SIZE, scale_bar=False)
    inset = Inset(ball, "detail", at=[[0, 0, 0]])
    full = render(blade, size=SIZE, insets=[inset, ball], unit="mm", title="leaf")
    ink = full.max(axis=2) < 100
    assert not (plain.max(axis=2) < 60).any()
    assert ink[:18, :60].any()  # the title, top left
    assert ink[-12:, :80].any()  # the scale bar, bottom left
    main, boxes = lay_out(SIZE, 2, 4.0, 20, 20)
    for box in (main, *boxes):
        panel = full[box.top : box.top + box.height, box.left : box.left + box.width]
        assert (~is_paper(panel)).mean() > 0.1


@pytest.mark.parametrize("per", ["vertex", "triangle"])
def test_scalars_are_shown_in_the_colors_of_their_map(ball, per):
    vertices, triangles = mesh_arrays(ball)
    middle = vertices if per == "vertex" else vertices[triangles].mean(axis=1)
    view = View(direction=(0, 0, 1), tilt=0)
    page = render(ball, size=(200, 200), scalars=Scalars(middle[:, 0], "x", "coolwarm"), view=view).astype(float)
    sphere_rows = page[60:120]
    assert (sphere_rows[:, 30:60, 2] - sphere_rows[:, 30:60, 0]).mean() > 20  # blue where x is low
    assert (sphere_rows[:, 140:170, 0] - sphere_rows[:, 140:170, 2]).mean() > 20


def test_the_camera_projects_what_its_rays_go_through(blade):
    for perspective in (False, True):
        view = View(direction=(0.3, -0.4, 0.8), tilt=30, turn=20, perspective=perspective)
        camera = Camera.framing(*mesh_arrays(blade), view, 1.6)
        axes = np.stack([camera.right, camera.up, camera.toward])
        assert np.allclose(axes @ axes.T, np.eye(3))
        assert np.linalg.det(axes) > 0
        ray = camera.rays(np.array([50.0, 200.0]), np.array([70.0, 20.0]), SIZE).astype(float)
        points = ray[:, :3] + 2.5 * camera.width * ray[:, 3:] + camera.target
        assert np.allclose(camera.project(points, SIZE), [[50, 70], [200, 20]], atol=1e-2)


def test_a_bent_blade_shows_its_face_even_where_it_is_deeper_than_wide():
    angle = np.linspace(-1.2, 1.2, 50)
    arch = np.stack([np.sin(angle), np.cos(angle)], axis=1)
    vertices = np.concatenate([np.insert(arch, 1, side, axis=1) for side in (-0.1, 0.1)])
    start = np.arange(49)
    lower, upper = np.stack([start, start + 1, start + 51], axis=1), np.stack([start, start + 51, start + 50], axis=1)
    camera = Camera.framing(vertices, np.concatenate([lower, upper]), View(tilt=0))
    assert np.ptp(vertices[:, 2]) > 2 * np.ptp(vertices[:, 1])
    assert abs(camera.toward[2]) == pytest.approx(1)
    assert abs(camera.right[0]) == pytest.approx(1)


def test_a_single_sheet_faces_the_camera_with_the_side_of_its_triangles(blade):
    vertices, triangles = np.array([[0.0, 0, 0], [2, 0, 0], [2, 1, 0], [0, 1, 0]]), np.array([[0, 1, 2], [0, 2, 3]])
    for turned, sign in ((triangles, 1), (triangles[:, ::-1].copy(), -1)):
        camera = Camera.framing(vertices, turned, View(tilt=0))
        assert camera.toward[2] == pytest.approx(sign)
        assert abs(camera.right[0]) == pytest.approx(1)


def test_files_are_pictures_and_the_mesh_stays_as_it_was(ball, tmp_path):
    before = [part.copy() for part in mesh_arrays(ball)]
    page = render(ball, tmp_path / "ball.png", size=SIZE)
    assert np.array_equal(np.round(imread(tmp_path / "ball.png")[:, :, :3] * 255).astype(np.uint8), page)
    render(ball, tmp_path / "ball.jpg", size=SIZE, view=View(smooth=False, supersampling=1))
    assert sorted(path.name for path in tmp_path.iterdir()) == ["ball.jpg", "ball.png"]
    assert all(np.array_equal(*pair) for pair in zip(before, mesh_arrays(ball), strict=True))


@pytest.mark.parametrize(
    ("mesh", "arguments", "words"),
    [
        (o3d.geometry.TriangleMesh(), {}, "no triangles"),
        ((np.ones((3, 3)), [[0, 1, 2]]), {}, "one place"),
        (None, {"path": "ball.gif"}, "suffix"),
        (None, {"size": (10, 10)}, "size"),
        (None, {"scalars": [1.0, 2.0]}, "one per vertex"),
        (None, {"unit": "furlong"}, "unit"),
        (None, {"view": View(direction=(0, 0, 0))}, "direction"),
    ],
)
def test_what_cannot_be_drawn_is_refused(ball, mesh, arguments, words):
    with pytest.raises(InputError, match=words):
        render(ball if mesh is None else mesh, **{"size": SIZE, **arguments})


def test_boxes_stay_on_the_page_and_apart():
    for wide in (0.5, 1.0, 3.0, 20.0):
        for count in (0, 1, 3):
            main, boxes = lay_out((1600, 1000), count, wide, 50, 40)
            page = np.zeros((1000, 1600), dtype=int)
            for box in (main, *boxes):
                assert min(box.left, box.top) >= 0
                assert box.left + box.width <= 1600
                assert box.top + box.height <= 1000
                assert min(box.size) > 100
                page[box.top : box.top + box.height, box.left : box.left + box.width] += 1
            assert page.max() == 1


@pytest.mark.parametrize(("at", "marks"), [((0.0, 0.0), 1), ((0.0, 40.0), 0), ((-90.0, 0.0), 0), (None, 1)])
def test_no_line_leaves_the_page(blade, ball, at, marks):
    """An inset of a place beside the picture has no marker; one that is wider than it is marked as far as it goes."""
    at = [[-99.0, -1.0, 0.0], [3.0, 1.0, 0.0]] if at is None else [[*at, 0.0]]
    page = draw_page(Inset(blade, unit="mm"), [Inset(ball, at=at), Inset(ball, at=[])], SIZE)
    drawn = [each.get_xydata() for each in page.axes.lines]
    drawn += [each.get_bbox().get_points() for each in page.axes.patches]
    assert len(page.axes.patches) == 2 + marks
    assert np.min([each.min(axis=0) for each in drawn]) >= 0
    assert (np.max([each.max(axis=0) for each in drawn], axis=0) <= SIZE).all()


def test_lengths_are_round_and_named_in_a_unit_that_fits():
    assert [round_length(length) for length in (0.7, 1.0, 4.9, 20.0, 0.0031)] == [0.5, 1.0, 2.0, 20.0, 0.002]
    named = [name_length(*case) for case in ((0.2, "mm"), (20.0, "mm"), (5.0, "um"), (2.0, None), (0.5, "m"))]
    assert named == ["200 µm", "20 mm", "5 µm", "2", "500 mm"]


def test_no_screen_is_an_error_with_a_cure(ball, monkeypatch):
    monkeypatch.setattr("sys.platform", "linux")
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    with pytest.raises(O3DLeafError, match="render"):
        show(ball)
    with pytest.raises(InputError, match="nothing"):
        show()


def test_a_title_is_no_formula(ball):
    """Names of files may hold dollar signs, between which Matplotlib would look for one."""
    render(ball, size=SIZE, title=r"$\frac{$ leaf, 5 $ a kilogram")


@pytest.mark.parametrize("text", ["title", "title\na line", "\na line", "title\n" + "many words " * 1000, ""])
def test_a_heading_has_room_for_its_lines_and_leaves_a_quarter_of_the_page(text):
    size, em, baselines = (800, 500), 9.0, []
    heading = Heading.of(text, size, em)
    heading.draw(SimpleNamespace(write=lambda _x, y, _line, scale: baselines.append(y + 0.25 * scale * em)))
    assert len(baselines) == bool(heading.title) + len(heading.lines)
    assert max(baselines, default=0) <= heading.height <= 0.75 * size[1] + em


def test_no_line_ends_between_a_number_and_its_unit():
    text = "0.29 % at 3.5 mm, 12 µm and 4 more"
    for letters in range(8, 40):
        lines = lines_of([text, "5 m"], letters)
        assert " ".join(lines).replace("\u00a0", " ") == f"{text} 5 m"
        assert not [line for line in lines if line.startswith(("%", "mm", "µm", "m "))]
