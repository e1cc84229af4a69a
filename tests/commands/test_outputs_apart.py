"""No file is written over another of the same run, or over one that is read."""

from pathlib import Path

import pytest

from o3dleaf.core.atomic_files import require_apart
from o3dleaf.core.errors import InputError


def test_outputs_are_apart_from_inputs_and_from_one_another(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "link.ply").symlink_to("mesh.ply")
    require_apart([Path("a.ply"), None, Path("a.json"), None], [Path("scan.ply"), None])
    with pytest.raises(InputError, match="is an input"):
        require_apart([Path("mesh.ply")], [tmp_path / "mesh.ply"])
    for second in ("mesh.ply", tmp_path / "mesh.ply", "./mesh.ply", "link.ply"):
        with pytest.raises(InputError, match="written twice"):
            require_apart([Path("mesh.ply"), Path(second)], [])


@pytest.mark.parametrize(
    "words",
    [
        ("qa", "mesh.ply", "--html", "a.html", "--json", "a.html"),
        ("leaf", "mesh.ply", "-o", "a.ply", "--no-picture", "--tile-solid", "a.ply"),
    ],
)
def test_commands_refuse_two_outputs_of_one_name(run, tmp_path, monkeypatch, words):
    monkeypatch.chdir(tmp_path)
    Path("mesh.ply").write_text("ply\n")
    result = run(*words)
    assert result.returncode == 2
    assert "written twice" in result.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["mesh.ply"]
