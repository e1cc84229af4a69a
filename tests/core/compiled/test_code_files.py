"""A file of code is read for the key that it was made for, whole and unchanged, or not at all."""

import pytest

from o3dleaf.core.compiled.code_files import file_name, read_code, write_code

KEY = "Numba 0.68.1\nx86-64-v3\nmodule.function\nint64\nstamp"


@pytest.fixture
def path(tmp_path):
    path = tmp_path / "folder" / file_name("module.function", KEY)
    write_code(path, KEY, b"payload" * 100)
    return path


def test_it_comes_back(path):
    assert read_code(path, KEY) == b"payload" * 100
    assert [each.name for each in path.parent.iterdir()] == [path.name]


@pytest.mark.parametrize("change", [("0.68.1", "0.68.2"), ("v3", "v4"), ("int64", "int32"), ("stamp", "other")])
def test_under_its_name_for_another_key_it_is_none(path, change):
    assert read_code(path, KEY.replace(*change)) is None


def test_for_a_key_that_goes_on_it_is_none(path):
    assert read_code(path, KEY[:-1]) is None
    assert read_code(path, KEY + "s") is None


@pytest.mark.parametrize(
    "damage", [lambda b: b[:-1], lambda b: b + b"0", lambda b: b[:-5] + b"x" + b[-4:], lambda _: b""]
)
def test_damaged_it_is_none(path, damage):
    path.write_bytes(damage(path.read_bytes()))
    assert read_code(path, KEY) is None


def test_new_source_takes_the_place_of_old():
    assert file_name("f", KEY) == file_name("f", KEY.replace("stamp", "new"))
    assert file_name("f", KEY) != file_name("f", KEY.replace("int64", "int32"))


def test_where_nothing_can_be_written_nothing_happens(tmp_path):
    (tmp_path / "file").touch()
    write_code(tmp_path / "file" / "code", KEY, b"")
    assert [each.name for each in tmp_path.iterdir()] == ["file"]
