"""The folder of a case: complete, consistent, whole or not at all; with OpenFOAM, what that makes of it."""

import json
import re
import shutil
import subprocess

import numpy as np
import pytest

from droplet_runs import CELL, write_plate
from o3dleaf.core.atomic_files import require_replaceable, whole_folder
from o3dleaf.core.errors import InputError
from o3dleaf.core.mesh_arrays import mesh_arrays
from o3dleaf.io.triangle_mesh import read_mesh
from o3dleaf.output.droplet.box import DropletBox
from o3dleaf.output.droplet.readings import DropletReadings
from o3dleaf.output.droplet.solver import SolverRun, missing_tools, solve_all
from o3dleaf.output.droplet.units import LENGTH, TIME, Impact
from o3dleaf.output.droplet.written import RESULTS, SETTINGS, find_cases
from tolerances import FRACTION, RESTART, ROUNDING, SOLVED_VOLUME

openfoam = pytest.mark.skipif(bool(missing_tools()), reason="OpenFOAM is not installed")


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    folder = tmp_path_factory.mktemp("case")
    return folder, write_plate(folder)


def test_every_file_is_filled_in_and_every_bracket_closed(written):
    folder, _ = written
    texts = {path: path.read_text() for path in folder.rglob("*") if path.is_file() and path.suffix != ".obj"}
    assert len(texts) == 4 + 2 * 14
    for path, text in texts.items():
        assert not re.search(r"@\w*@", text), path
        if path.name in {"README.md", "run"}:
            continue
        bare = re.sub(r"//.*", "", text)
        for opened, closed in ("{}", "()", "[]"):
            assert bare.count(opened) == bare.count(closed), path
        # No other dictionary has numbers of its own for what stands in the one file.
        known = set(re.findall(r"^(\w+)\s+\S+;", (folder / "constants").read_text(), re.MULTILINE))
        used = set(re.findall(r"\$(\w+)", bare)) - {"p_rgh", "volume"}
        assert used <= known, path
        assert bool(used) <= ('#include "../../constants"' in bare), path


def test_constants_are_the_impact_in_both_units(written):
    folder, case = written
    lines = re.findall(r"^(\w+)\s+(\S+);(?:\s*// (\S+) (?:m|m/s2|s|kg/m3|m2/s)\b)?", (folder / "constants").read_text(),
                       re.MULTILINE)  # fmt: skip
    numbers = {name: float(value) for name, value, _ in lines}
    scaled = case.impact.scaled()
    for name, value in (
        ("diameter", scaled.diameter),
        ("rhoLiquid", scaled.density),
        ("rhoGas", scaled.gas_density),
        ("nuLiquid", scaled.viscosity),
        ("nuGas", scaled.gas_viscosity),
        ("tension", scaled.tension),
        ("angle", scaled.angle),
        ("zSpeed", -scaled.speed),
        ("zGravity", scaled.gravity[2]),
        ("endTime", case.duration / TIME),
    ):
        assert np.isclose(numbers[name], value, rtol=1e-9), name
    # What stands beside a length is its number of meters; of a time, seconds.
    for name, value, meters in lines:
        if meters and name in {"diameter", "radius", "cell", "zDrop", "zMin", "zMax", "endTime", "frame", "maxDeltaT"}:
            assert np.isclose(float(value) * LENGTH, float(meters), rtol=1e-5), name


def test_box_and_droplet_fit(written):
    _, case = written
    box, radius = case.box, case.impact.diameter / 2
    assert np.isclose(box.half * 2, box.cells[0] * box.cell)
    assert np.isclose(box.top - box.bottom, box.cells[2] * box.cell)
    assert box.top - box.bottom >= 2.5 * case.impact.diameter * (1 - ROUNDING)
    assert box.bottom < 0 < box.start - radius
    assert box.start + radius < box.top
    assert box.half < 0.6e-3  # the surface reaches past it


@pytest.mark.parametrize("away", [0.0, 0.2e-3])
def test_the_droplet_starts_just_over_what_is_highest_below_it(away):
    """A peak of 0.2 mm under its middle, or beside: its nearest point is two cells away along z."""
    impact, peak = Impact(), np.array([[0.0, 0.0, 0.0], [away, 0.0, 0.2e-3]])
    box = DropletBox.around(peak, impact, 1.2e-3, CELL)
    below = box.start - np.sqrt((impact.diameter / 2) ** 2 - away**2)
    assert np.isclose(below - 0.2e-3, 2 * CELL)


def test_surfaces_are_written_in_the_solvers_unit_with_labels(written):
    found = read_mesh(written[0] / "leaf" / "constant" / "triSurface" / "leaf.obj")
    assert np.allclose(np.ptp(mesh_arrays(found.mesh)[0], axis=0), [120, 120, 30])
    assert found.names[:3] == ("adaxial", "abaxial", "rim")


def test_what_cannot_be_is_refused_in_one_line():
    with pytest.raises(InputError, match="too narrow"):
        DropletBox.around(np.zeros((1, 3)), Impact(diameter=1e-3), 1.2e-3, CELL)
    with pytest.raises(InputError, match="larger one"):
        DropletBox.around(np.zeros((1, 3)), Impact(), 1.2e-3, 1e-6)


def test_a_folder_is_whole_or_not_at_all(tmp_path):
    target = tmp_path / "case"
    with pytest.raises(RuntimeError, match="stop"), whole_folder(target, SETTINGS, RESULTS) as folder:  # noqa: PT012
        (folder / "half").write_text("")
        raise RuntimeError("stop")
    assert list(tmp_path.iterdir()) == []
    for _ in range(2):  # ours is replaced
        with whole_folder(target, SETTINGS, RESULTS) as folder:
            write_plate(folder)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["case"]
    assert find_cases(target)[0].duration == pytest.approx(1e-4)
    (target / "leaf" / "postProcessing").mkdir()
    with pytest.raises(InputError, match="holds results"):
        require_replaceable(target, SETTINGS, RESULTS)
    other = tmp_path / "mine"
    other.mkdir()
    require_replaceable(other, SETTINGS, RESULTS)
    (other / "thesis.txt").write_text("")
    with pytest.raises(InputError, match="not empty"):
        require_replaceable(other, SETTINGS, RESULTS)
    with pytest.raises(InputError, match="is a file"):
        require_replaceable(other / "thesis.txt", SETTINGS, RESULTS)


def test_what_is_no_case_is_refused(tmp_path):
    with pytest.raises(InputError, match="is no droplet case"):
        find_cases(tmp_path)
    (tmp_path / SETTINGS).write_text("{")
    with pytest.raises(InputError, match="is no droplet case"):
        find_cases(tmp_path)
    write_plate(tmp_path)
    constants = tmp_path / "constants"
    constants.write_text(re.sub(r"endTime\s+\S+;", "endTime soon;", constants.read_text()))
    with pytest.raises(InputError, match="endTime is 'soon'"):
        _ = find_cases(tmp_path)[0].duration


def test_several_places_are_several_cases(tmp_path):
    write_plate(tmp_path / "1_ridge")
    write_plate(tmp_path / "2_hair")
    (tmp_path / SETTINGS).write_text(json.dumps({"cases": ["1_ridge", "2_hair"]}))
    assert [case.folder.name for case in find_cases(tmp_path)] == ["1_ridge", "2_hair"]


@openfoam
@pytest.mark.slow
def test_openfoam_keeps_the_volume_and_goes_on_where_it_was_stopped(tmp_path):
    """A run that was stopped after one frame and went on has the rows of one that was not."""
    for name, duration in (("whole", 1e-4), ("halves", 5e-5)):
        write_plate(tmp_path / name, duration=duration, variants=("leaf",))
        solve_all([SolverRun(tmp_path / name / "leaf", duration)], 1)
    constants = tmp_path / "halves" / "constants"
    constants.write_text(re.sub(r"(endTime\s+)\S+;", r"\g<1>10;", constants.read_text()))
    run = SolverRun(tmp_path / "halves" / "leaf", 1e-4)
    assert not run.finished
    solve_all([run], 1)
    whole, halves = (DropletReadings.read(tmp_path / name / "leaf") for name in ("whole", "halves"))
    assert len(whole.rows) == len(halves.rows) == 2
    volume = whole.column("volume")
    assert np.isclose(volume[0], np.pi / 6 * 0.6e-3**3, rtol=SOLVED_VOLUME)
    assert np.isclose(volume[-1], volume[0], rtol=1e-6)
    assert whole.column("alpha_min").min() > -1e-6
    # Before the touch it falls as a ball falls.
    assert np.allclose(whole.column("velocity_z"), -0.5, rtol=0.01)
    assert np.allclose(np.diff(whole.column("height")), -0.5 * 5e-5, atol=0.1 * CELL)
    for name in ("volume", "width_along", "height", "velocity_z"):
        assert np.allclose(halves.column(name), whole.column(name), rtol=RESTART), name


@openfoam
@pytest.mark.slow
def test_the_fraction_stays_bounded_on_ridged_walls(tmp_path):
    """Below 0 there the density and the friction change their signs, and air in a thin cell goes off without bound."""
    write_plate(tmp_path, Impact(angle=160.0), duration=3e-4, variants=("leaf",), ridges=3e-5)
    solve_all([SolverRun(tmp_path / "leaf", 3e-4)], 1)
    log = (tmp_path / "leaf" / "log.solver").read_text()
    lowest = min(float(value) for value in re.findall(r"Min\(alpha\.water\) = (\S+)", log))
    assert lowest > -FRACTION
    assert DropletReadings.read(tmp_path / "leaf").column("contact_area").max() > 0


@pytest.mark.skipif(shutil.which("bash") is None, reason="the script of a case is for bash")
def test_without_openfoam_the_script_says_how_to_get_it(written, tmp_path):
    for tool in ("bash", "dirname"):
        (tmp_path / tool).symlink_to(shutil.which(tool))
    done = subprocess.run(
        [str(tmp_path / "bash"), str(written[0] / "run")], env={"PATH": str(tmp_path)}, capture_output=True, text=True,
        check=False,
    )  # fmt: skip
    assert done.returncode == 2
    assert len(done.stderr.splitlines()) == 1
    assert "apt-get install" in done.stderr
