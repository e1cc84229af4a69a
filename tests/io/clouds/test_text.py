"""A text file of points is read as it says, or refused with the line that is wrong."""

import numpy as np
import pytest

from o3dleaf import read_point_cloud
from o3dleaf.core.errors import DataWarning, InputError

POINTS = np.random.default_rng(1).uniform(-900, 900, (7, 3))
NORMALS = POINTS[:, ::-1] / np.linalg.norm(POINTS, axis=1, keepdims=True)
COLORS = np.arange(21).reshape(7, 3)
INTENSITY = np.arange(7.0)[:, np.newaxis]
ALL = np.hstack([POINTS, NORMALS, COLORS, INTENSITY])
NAMES = ["x", "y", "z", "nx", "ny", "nz", "r", "g", "b", "intensity"]


def rows(table, separator=" ", last=""):
    return "".join(separator.join(map(repr, map(float, row))) + last + "\n" for row in table)


def written(folder, content, name="scan.txt", encoding="utf-8"):
    (folder / name).write_bytes(content.encode(encoding))
    return folder / name


@pytest.mark.parametrize("separator", [" ", "\t", ",", ";", " ; ", ", ", "   "])
@pytest.mark.parametrize("head", ["{}\n", "# {}\n", "//{}\n", "# made by a scanner\n\n{}\n7\n", "\ufeff{}\r\n"])
def test_every_digit_of_all_columns_is_read(tmp_path, separator, head):
    content = head.format(separator.join(NAMES)) + rows(ALL, separator)
    cloud = read_point_cloud(written(tmp_path, content, "scan.CSV" if "," in separator else "scan.asc"))
    assert np.array_equal(cloud.points, POINTS)
    assert np.array_equal(cloud.normals, NORMALS)
    assert np.array_equal(cloud.colors, COLORS / 255)


@pytest.mark.parametrize("head", ["Z;Y [mm];X(m)\n", '"z";"y";"x"\n', "# z;y;x\n# all in mm\n"])
def test_names_say_which_column_is_which(tmp_path, head):
    cloud = read_point_cloud(written(tmp_path, head + rows(POINTS, ";")))
    assert np.array_equal(cloud.points, POINTS[:, ::-1])
    assert not cloud.has_normals()


def test_columns_that_are_asked_for_go_before_the_header(tmp_path):
    file = written(tmp_path, "x y z a b c\n" + rows(ALL[:, [3, 4, 5, 0, 1, 2]]))
    cloud = read_point_cloud(file, columns="nx ny nz x y z")
    assert np.array_equal(cloud.points, POINTS)
    assert np.array_equal(cloud.normals, NORMALS)
    assert np.array_equal(read_point_cloud(file, columns=["-", "-", "-", "x", "y", "z"]).points, POINTS)


@pytest.mark.parametrize(
    "head", ["", "# exported today\n", "Leaf no 3, of Monday\n", "7\n", "// a\n# b\n\n", "# x is up\n"]
)
def test_without_names_the_first_three_are_coordinates_and_no_more_is_guessed(tmp_path, head):
    cloud = read_point_cloud(written(tmp_path, head + rows(ALL[:, [0, 1, 2, 6, 7, 8]])))
    assert np.array_equal(cloud.points, POINTS)
    assert not cloud.has_normals()
    assert not cloud.has_colors()


@pytest.mark.parametrize("name", ["scan.txt", "scan.xyz"])
@pytest.mark.parametrize(
    ("order", "names"),
    [([0, 1, 2, 3, 4, 5], "x y z nx ny nz"), ([0, 1, 2, 9, 3, 4, 5, 6], "x y z - nx ny nz")],
)
def test_unit_vectors_without_names_are_told_and_read_by_the_names_that_are_told(tmp_path, name, order, names):
    file = written(tmp_path, "# exported today\n" + rows(ALL[:, order]), name)
    with pytest.warns(DataWarning, match=f"unit vectors, .* name the columns, as '{names}'"):
        cloud = read_point_cloud(file)
    assert not cloud.has_normals()
    assert np.array_equal(read_point_cloud(file, columns=names).normals, NORMALS)


@pytest.mark.parametrize("scale", [0.98, 1.02])
@pytest.mark.filterwarnings("error::o3dleaf.core.errors.DataWarning")
def test_columns_of_another_length_than_one_are_no_normals(tmp_path, scale):
    cloud = read_point_cloud(written(tmp_path, rows(np.hstack([POINTS, scale * NORMALS]))))
    assert not cloud.has_normals()


MORE = np.random.default_rng(2).uniform(-900, 900, (12, 3))
COUNTED = np.column_stack([np.arange(12), MORE])
CROPPED = np.column_stack([np.flatnonzero(np.random.default_rng(3).random(40) < 0.4)[:12], MORE])
WHOLE = np.column_stack([np.arange(5, 17), np.round(MORE)])


@pytest.mark.parametrize("table", [COUNTED, CROPPED, WHOLE])
@pytest.mark.parametrize("name", ["scan.txt", "scan.xyz"])
def test_a_column_that_counts_the_points_is_left_out_and_told(tmp_path, table, name):
    file = written(tmp_path, rows(table), name)
    with pytest.warns(DataWarning, match=r"first of its columns counts the points .* name the columns, as 'x y z'"):
        cloud = read_point_cloud(file)
    assert np.array_equal(cloud.points, table[:, 1:])
    assert np.array_equal(read_point_cloud(file, columns="x y z").points, table[:, :3])


def test_names_of_rows_before_those_of_a_header_are_left_out(tmp_path):
    """As R's write.table has them: the header names one column fewer than there are."""
    lines = "".join(f'"{i + 1}" {x!r} {y!r} {z!r} {i}\n' for i, (x, y, z) in enumerate(MORE.tolist()))
    with pytest.warns(DataWarning, match="counts the points"):
        cloud = read_point_cloud(written(tmp_path, '"x" "y" "z" "intensity"\n' + lines))
    assert np.array_equal(cloud.points, MORE)


@pytest.mark.parametrize("suffix", ["txt", "xyz", "xyzn", "xyzrgb"])
def test_the_cure_of_a_text_that_is_refused_is_one_that_its_reader_takes(tmp_path, suffix):
    """Before the coordinates stand three columns of which the suffix knows nothing; the third is a number at first."""
    lines = rows(ALL).splitlines(keepends=True)
    content = "".join(f"7 7 {'leaf' if number else 7} {line}" for number, line in enumerate(lines))
    path = written(tmp_path, content, f"scan.{suffix}")
    with pytest.raises(InputError, match="name the columns, as 'x y z'"):
        read_point_cloud(path)
    cloud = read_point_cloud(path, columns="- - - x y z nx ny nz")
    assert np.array_equal(cloud.points, POINTS)
    assert np.array_equal(cloud.normals, NORMALS)


def test_a_coordinate_that_counts_behind_another_column_is_kept(tmp_path):
    table = np.column_stack([MORE[:, 0], COUNTED[:, :3], MORE[:, 0]])
    cloud = read_point_cloud(written(tmp_path, "time x y z\n" + rows(table)))
    assert np.array_equal(cloud.points, table[:, 1:4])


@pytest.mark.parametrize(
    "table",
    [
        COUNTED[:, :3],  # no column is over
        COUNTED[:9],  # too few to count
        COUNTED[[0, 2, 1, *range(3, 12)]],  # not in order
        COUNTED + [0.5, 0, 0, 0],  # not whole
        np.column_stack([2 * np.arange(12), np.round(MORE)]),  # a row of a lattice of whole numbers
        COUNTED[:, [1, 0, 2, 3]],
    ],
)
def test_a_coordinate_is_taken_for_no_counter(tmp_path, table):
    assert np.array_equal(read_point_cloud(written(tmp_path, rows(table))).points, table[:, :3])


def test_decimal_commas_and_comments_between_points(tmp_path):
    body = rows(POINTS, ";").replace(".", ",").splitlines()
    body.insert(3, "# a second pass")
    body.insert(5, "")
    body[1] += "  // the last of the first"
    assert np.array_equal(read_point_cloud(written(tmp_path, "\n".join(body), encoding="latin-1")).points, POINTS)


def test_colors_are_shares_whatever_their_range(tmp_path):
    for full in (1.0, 255.0, 65535.0):
        shares = np.linspace(0, 1, 21).reshape(7, 3)
        file = written(tmp_path, "x,y,z,red,green,blue\n" + rows(np.hstack([POINTS, shares * full]), ","))
        assert np.asarray(read_point_cloud(file).colors) == pytest.approx(shares)


@pytest.mark.parametrize(
    ("content", "columns", "message"),
    [
        ("1 2 3\n4 5\n6 7 8\n", None, r"line 2: '4 5' has no number in column 3, z"),
        ("x y z\n1 2 3\n# c\n4 5 six\n", None, r"line 4: '4 5 six' has no number in column 3, z"),
        ("0,5 38,25 7,1\n1,5 2,5 3,5\n", None, "line 1: .* write decimals with points, not commas"),
        ("1;2;3\n4;;6\n", None, r"line 2: '4;;6' has no number in column 2, y"),
        ("x y z nx ny nz\n1 2 3 0 0 1\n1 2 3\n", None, r"line 3: '1 2 3' has no number in column 4, nx"),
        ("1 2\n3 4\n", None, r"line 1: '1 2' has 2 columns, none for z"),
        ("1 2 3\n", "x y z nx ny nz", r"line 1: '1 2 3' has 3 columns, none for nx"),
        ("East,North,x\n1,2,3\n", None, r"line 1: 'East North x' does not name x, y and z"),
        ("1 2 3\n", "a b c", r"columns: 'a b c' do not name x, y and z"),
        ("only words\n", None, "no line begins with three numbers"),
        ("", None, "empty"),
        ("1 2 " + 500 * "3" + " x\n1 2 a" + 500 * "b", None, r"line 2: '1 2 a(b){55}…'"),
        ("1 2 3\n4 5 nan\n6 7 8\n", None, "NaN"),
    ],
)
def test_a_bad_file_is_refused_with_its_line(tmp_path, content, columns, message):
    with pytest.raises(InputError, match=message) as caught:
        read_point_cloud(written(tmp_path, content), columns=columns)
    assert "\n" not in str(caught.value)


def test_columns_belong_to_text(tmp_path):
    file = written(tmp_path, rows(POINTS[:, ::-1]), "scan.xyz")
    assert np.array_equal(read_point_cloud(file, columns="z y x").points, POINTS)
    with pytest.raises(InputError, match="leave columns out"):
        read_point_cloud(written(tmp_path, "ply", "scan.ply"), columns="x y z")
