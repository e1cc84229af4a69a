"""The commands of a droplet: what they refuse, in one line, before any work; what they write."""

import json

import numpy as np
import pytest

from leaf_fields import leaf_of, texture
from o3dleaf.commands.droplet.run import DropletJob
from o3dleaf.commands.export import ExportJob
from o3dleaf.core.errors import InputError
from o3dleaf.output.droplet import solver
from o3dleaf.output.droplet.solver import last_time
from o3dleaf.output.droplet.written import SETTINGS, find_cases


@pytest.fixture(scope="module")
def leaf():
    return leaf_of(texture(lambda x, y, z: 0.1**2 - z**2 + 0.0 * x, half=0.2, tile=0.6, n=9), bend=15.0)[0]


@pytest.fixture(scope="module")
def model(leaf, tmp_path_factory):
    path = tmp_path_factory.mktemp("model") / "leaf.o3l"
    leaf.save(path)
    return path


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"at": None}, "at: is missing"),
        ({"angle": 180.0}, "angle: is 180"),
        ({"down": (0.0, 0.0, 0.0)}, "down: is 0 0 0"),
        ({"tile": True}, "tile: cannot act"),
        ({"scalar": ("curvature",)}, "scalar: cannot act"),
        ({"consumer": "openfoam"}, "at: acts only where for is 'droplet'"),
        ({"size": 0.9}, "size: 0.9 mm is too narrow"),
        ({"at": (10.0, 2.9)}, "leaves the blade"),
    ],
)
def test_what_no_case_can_be_made_of_is_refused(model, tmp_path, changes, words):
    options = {"consumer": "droplet", "at": (10.0, 0.3), "spacing": 0.1} | changes
    with pytest.raises(InputError, match=words) as refused:
        ExportJob(model, tmp_path / "case", **options).run()
    assert "\n" not in str(refused.value)
    assert list(tmp_path.iterdir()) == []


def test_a_mesh_is_no_model(tmp_path):
    mesh = tmp_path / "a.ply"
    mesh.write_text("")
    with pytest.raises(InputError, match="needs the model of a leaf"):
        ExportJob(mesh, tmp_path / "case", consumer="droplet", at=(1.0, 1.0)).run()


def test_a_model_becomes_a_case_without_openfoam(model, tmp_path, monkeypatch, leaf):
    monkeypatch.setattr(solver.shutil, "which", lambda name: None)
    place = (5.0, 0.3)
    job = ExportJob(model, tmp_path / "case", consumer="droplet", at=place, spacing=0.1, down=(0.0, 0.0, -2.0))
    assert str(tmp_path / "case") in job.run()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["case"]
    (case,) = find_cases(tmp_path / "case")
    settings = case.settings
    assert settings["variants"] == ["leaf", "twin", "bare"]
    # The blade bends about the axis across: where it leans by s/r, so does gravity.
    turn = place[0] / 15.0
    assert np.allclose(settings["impact"]["gravity"], [9.81 * np.sin(turn), 0, -9.81 * np.cos(turn)], atol=1e-3)
    assert np.isclose(case.constant("xGravity"), 9.81e-5 * np.sin(turn), atol=1e-8)
    with pytest.raises(InputError, match="apt-get install"):
        DropletJob(tmp_path / "case").run()


def test_a_folder_that_is_no_case_is_refused(tmp_path):
    with pytest.raises(InputError, match="is no droplet case"):
        DropletJob(tmp_path).run()


def test_nothing_to_read_is_said(tmp_path, model):
    ExportJob(model, tmp_path / "case", consumer="droplet", at=(10.0, 0.3), spacing=0.1, landings=1).run()
    with pytest.raises(InputError, match="holds no results yet"):
        DropletJob(tmp_path / "case", only_read=True).run()
    assert json.loads((tmp_path / "case" / SETTINGS).read_text())["place"] == [10.0, 0.3]


def test_how_far_a_solver_is_stands_in_its_log(tmp_path):
    log = tmp_path / "log.solver"
    assert last_time(log) == 0.0
    log.write_text("Time = 12.5\n" + "x" * 100 + "\nTime = 17.25\nsolving\nTime = \n")
    assert last_time(log) == 17.25
