"""Figures show the numbers that they are drawn of, and what cannot be drawn is said."""

from dataclasses import replace

import numpy as np
import pytest
from matplotlib.colors import to_rgb
from matplotlib.image import imread

import o3dleaf as o3l
from leaf_fields import leaf_of, texture
from o3dleaf import AlphaShape, HeightMap, MultiscaleLeaf, Volume, draw_figures
from o3dleaf.commands.figures import FiguresJob
from o3dleaf.core.errors import InputError, ReconstructionError
from o3dleaf.core.journal import Journal
from o3dleaf.core.mesh_arrays import mesh_arrays
from o3dleaf.output.figures import flattened_scan, height_map, histogram, pictures, scan_picture
from o3dleaf.output.figures.draw import CAPTIONS, FIGURES
from o3dleaf.output.figures.pictures import CUT, block, whole_tiles
from o3dleaf.output.figures.style import COLUMN, PICTURE, VERMILION
from o3dleaf.output.view.picture import PAPER, draw_page
from tolerances import ON_A_SEAM


@pytest.fixture(scope="module")
def leaf():
    """A strip 20 by 6 with a layer half a unit thick, wavy along, in tiles of 2 by 2, bent about a circle."""
    field = texture(lambda x, y, z: 0.25 + 0.1 * np.cos(np.pi * x) - np.abs(z) + 0 * y, half=0.6)
    return leaf_of(field, bend=30.0, frame="paper")[0]


@pytest.fixture(scope="module")
def scan(leaf):
    return leaf.blade.lift(np.column_stack([leaf.blade.outline.points, np.zeros(len(leaf.blade.outline.points))]))


@pytest.fixture(scope="module")
def volume():
    rng = np.random.default_rng(0)
    data = np.where(np.arange(24) < 9, 0.2, 0.01) + rng.normal(0, 0.01, (30, 28, 24))
    data[:2] = 0.0
    return Volume(data.astype(np.float32), 24.0, unit="um")


@pytest.fixture(scope="module")
def uneven(leaf):
    """The same strip, its height map a slope along and across, and beyond 9 along too narrow for a tile."""
    s, c = (grid.ravel() for grid in np.meshgrid(np.linspace(0, 20, 81), np.linspace(-3, 3, 25)))
    heights = HeightMap.fit(np.column_stack([s, c, 0.02 * s + 0.05 * c]), smoothing=0.0, unit="mm")
    narrow = (s < 9) | (np.abs(c) < 0.9)
    outline = AlphaShape(np.column_stack([s, c])[narrow], 0.5)
    return MultiscaleLeaf(leaf.texture, leaf.blade.frame, heights, outline)


@pytest.fixture
def quick(monkeypatch):
    """Coarse meshes, one ray a pixel."""

    def draw(subject, insets=(), size=PICTURE, **options):
        single = [replace(each, view=replace(each.view, supersampling=1)) for each in (subject, *insets)]
        return draw_page(single[0], single[1:], size, **options)

    monkeypatch.setattr(pictures, "draw_page", draw)
    monkeypatch.setattr(pictures, "TILE_STEPS", 24)
    monkeypatch.setattr(pictures, "LEAF_STEPS", 8)


class Notes(Journal):
    def __init__(self):
        super().__init__()
        self.notes = []

    def note(self, text):
        self.notes.append(text)


def test_the_flattened_scan_is_drawn_at_its_leaf_coordinates(leaf, scan):
    figure, caption = flattened_scan(leaf.blade, scan)
    expected = leaf.blade.frame.to_leaf(scan)
    for axis, column in zip(figure.axes[:2], (1, 2), strict=True):
        dots = axis.collections[0]
        assert np.allclose(dots.get_offsets(), expected[:, [0, column]])
        assert np.allclose(dots.get_array(), expected[:, 0])
        assert axis.get_ylabel().endswith(", mm")
    assert f"{len(scan):,} points" in caption


def test_the_height_map_is_that_of_the_blade_clipped_by_its_outline(uneven):
    figure, _ = height_map(uneven.blade)
    axis = figure.axes[0]
    (picture,) = axis.images
    grid = picture.get_array()
    left, right, bottom, top = picture.get_extent()
    along, across = np.linspace(left, right, grid.shape[1]), np.linspace(bottom, top, grid.shape[0])
    for row, column in ((0, 0), (40, 500), (149, 17)):
        assert grid[row, column] == pytest.approx(uneven.blade.height_map([[along[column], across[row]]])[0])
    outline = axis.patches[0].get_path()
    places = np.random.default_rng(1).uniform([left, bottom], [right, top], (500, 2))
    assert np.array_equal(outline.contains_points(places), uneven.blade.outline.contains(places))
    assert picture.get_clip_path() is not None
    assert figure.get_figwidth() == COLUMN


@pytest.mark.parametrize("level", ["mixture", "otsu", 0.07])
def test_the_histogram_counts_voxels_and_marks_the_threshold(volume, level):
    figure, caption = histogram(volume, level)
    axis = figure.axes[0]
    counts, edges, _ = axis.patches[0].get_data()
    data = volume.data[volume.data != 0]
    for lower, upper, share in zip(edges[:-1], edges[1:], counts, strict=True):
        assert share == pytest.approx(100 * np.mean((data >= lower) & (data < upper)), abs=0.02)
    threshold = volume.threshold(level)
    assert axis.lines[0].get_xdata()[0] == pytest.approx(threshold)
    names = {text.get_text(): text.xy[0] for text in axis.texts}
    assert names["air"] < threshold < names["leaf"]
    assert f"{threshold:.4g}" in caption


def test_control_points_are_marked_where_they_are(leaf, scan, quick):
    """The midrib is in front of the scan all the way along the leaf."""
    figure, caption = scan_picture(leaf.blade, scan)
    pixels = figure.axes[0].images[0].get_array()[..., :3]
    reddish = np.argwhere((pixels[..., 0] > 1.8 * pixels[..., 2]) & (pixels[..., 0] > 1.3 * pixels[..., 1]))
    assert f"{len(leaf.blade.frame.breaks)} control points" in caption
    assert len(np.unique(reddish[:, 1])) > 0.85 * pixels.shape[1]


@pytest.mark.parametrize(("which", "count"), [("leaf", (1, 1)), ("leaf", (2, 2)), ("uneven", (3, 1))])
def test_windows_are_whole_tiles_inside_the_outline(which, count, request):
    leaf = request.getfixturevalue(which)
    region, tile = whole_tiles(leaf, count)
    first = leaf.texture.cell[0, :2] / leaf.scale
    place = (region - first) / tile
    assert np.abs(place - np.round(place)).max() < ON_A_SEAM
    assert np.allclose(np.diff(region, axis=0)[0], tile * count)
    rim = np.random.default_rng(2).uniform(region[0], region[1], (1000, 2))
    assert leaf.blade.outline.contains(rim).all()


def test_a_leaf_too_small_for_its_tiles_is_an_error_with_a_cure(leaf):
    with pytest.raises(ReconstructionError, match="4 × 4 whole tiles"):
        whole_tiles(leaf, (4, 4))


def test_a_block_is_the_closed_leaf_in_two_colors_cut_at_the_window(leaf):
    window = whole_tiles(leaf, (2, 2))
    surface, cut = block(leaf, 0.1, window.region, seams=True)
    whole = leaf.extract_mesh(0.1, window.region, closed=True)
    assert surface.get_surface_area() + cut.get_surface_area() == pytest.approx(whole.get_surface_area())
    vertices, triangles = mesh_arrays(cut)
    plane = leaf.blade.flatten(vertices)[:, :2]
    assert np.abs(plane[:, np.newaxis] - window.region).min(axis=(1, 2)).max() < 0.03
    assert len(triangles) > 0
    assert np.allclose(cut.vertex_colors, to_rgb(CUT))
    colors = np.asarray(surface.vertex_colors)
    flat = leaf.blade.flatten(np.asarray(surface.vertices))[:, :2]
    red = np.abs(colors - to_rgb(VERMILION)).max(axis=1) < 1e-6
    middle = window.region.mean(axis=0)
    assert np.abs(flat[red] - middle).min(axis=1).max() < 0.1
    assert red[np.abs(flat - middle).min(axis=1) < 1e-6].mean() > 0.9
    quarter = (flat > middle).sum(axis=1) % 2
    green = colors[~red]
    assert len(np.unique(green[quarter[~red] == 0], axis=0)) == len(np.unique(green[quarter[~red] == 1], axis=0)) == 1
    assert len(np.unique(green, axis=0)) == 2


def test_figures_of_a_blade_say_what_is_left_out(leaf, scan, quick, tmp_path):
    journal = Notes()
    with journal:
        drawn = draw_figures(leaf.blade, tmp_path / "new" / "folder", scan=scan, formats=["png", "svg"])
    names = [f"{number}-{name}.{suffix}" for number, name in ((1, "scan"), (2, "flattened"), (3, "height-map"))
             for suffix in ("png", "svg")]  # fmt: skip
    assert [path.name for path in drawn.paths] == [*names, CAPTIONS]
    assert sorted(path.name for path in (tmp_path / "new" / "folder").iterdir()) == sorted([*names, CAPTIONS])
    assert list(drawn.left_out) == list(FIGURES)[3:]
    assert len(journal.notes) == 5
    assert all("give" in note for note in journal.notes)
    text = drawn.paths[-1].read_text()
    assert all(f"**{name.split('.')[0]}.**" in text for name in names)
    assert all(f"*{name}* was left out" in text for name in drawn.left_out)
    assert all("figure" in name for name in journal.seconds)


@pytest.mark.slow
def test_pictures_of_a_leaf_are_as_wide_as_a_column(leaf, quick, tmp_path):
    drawn = o3l.draw_figures(leaf, tmp_path, formats=["png"], only=["four-tiles", "cross-section", "whole-leaf"])
    assert not drawn.left_out
    for path in drawn.paths[:-1]:
        page = imread(path)
        assert page.shape[1] == PICTURE[0]
        covered = (np.abs(page[..., :3] - PAPER).max(axis=2) > 0.1).mean()
        assert 0.05 < covered < 0.6


@pytest.mark.parametrize(
    ("arguments", "words"),
    [({"formats": ["bmp"]}, "formats"), ({"only": ["flower"]}, "only"), ({"only": ["scan"]}, "none can be drawn"),
     ({"formats": []}, "must not be empty")],
)  # fmt: skip
def test_what_there_is_not_is_refused(leaf, tmp_path, arguments, words):
    with pytest.raises(InputError, match=words):
        draw_figures(leaf, tmp_path, **arguments)


def test_a_job_takes_a_saved_leaf_and_refuses_what_does_not_go_together(leaf, tmp_path):
    leaf.save(tmp_path / "leaf.o3l")
    job = FiguresJob(output=tmp_path / "out", model=tmp_path / "leaf.o3l", formats="pdf", only="height-map")
    assert [path.name for path in job.run().paths] == ["3-height-map.pdf", CAPTIONS]
    leaf.texture.save(tmp_path / "micro.o3l")
    with pytest.raises(InputError, match="no leaf"):
        FiguresJob(output=tmp_path / "out", model=tmp_path / "micro.o3l").run()
    for wrong, words in (
        ({"midrib": tmp_path}, "scan"),
        ({"model": tmp_path, "midrib": tmp_path}, "midrib: cannot act where"),
    ):
        with pytest.raises(InputError, match=words):
            FiguresJob(output=tmp_path / "out", **wrong).run()
    with pytest.raises(InputError, match="folder"):
        FiguresJob(output=tmp_path / "leaf.o3l", model=tmp_path / "leaf.o3l").run()
