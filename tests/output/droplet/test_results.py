"""What comes of runs: the table, pictures, the animation and the page, of caps that are known."""

import csv
import json
import re
from dataclasses import replace

import numpy as np
import pytest
from PIL import Image

import droplet_runs
from droplet_runs import cap, write_plate, write_run
from o3dleaf.commands.droplet.run import DropletJob
from o3dleaf.core.journal import Journal
from o3dleaf.output.droplet import pictures
from o3dleaf.output.droplet.page import figures_table
from o3dleaf.output.droplet.pictures import PANEL, chosen_times
from o3dleaf.output.droplet.results import DropletResults
from o3dleaf.output.droplet.written import SETTINGS, find_cases


@pytest.fixture(scope="module", autouse=True)
def _in_short():
    """Smooth edges and fine caps are no part of what is asked here, and take most of the time."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(pictures, "LOOK", replace(pictures.LOOK, supersampling=1))
        patch.setattr(droplet_runs, "STEP", 4.0)
        yield


@pytest.fixture(scope="module")
def case(tmp_path_factory):
    """A leaf whose droplet stands still, and a twin whose droplet is narrower."""
    folder = tmp_path_factory.mktemp("case")
    write_plate(folder, duration=1.5e-4)
    for name, angle in (("leaf", 120.0), ("twin", 150.0)):
        share, ticks = cap(angle)
        write_run(folder / name, [share] * 3, ticks, [5, 10, 15])
    return folder, DropletJob(case=folder, only_read=True).run()


def test_the_table_has_every_row_of_every_run(case):
    rows = list(csv.DictReader((case[0] / "droplet.csv").read_text().splitlines()))
    assert [row["run"] for row in rows] == ["leaf"] * 3 + ["twin"] * 3
    assert [round(float(row["t_s"]), 8) for row in rows] == [5e-5, 1e-4, 1.5e-4] * 2
    heights = np.array([float(row["height_m"]) for row in rows]).reshape(2, 3)
    # 30 (1 − cos θ) of 10 µm each.
    assert np.allclose(heights, [[45e-5], [30e-5 * (1 + 0.75**0.5)]], rtol=0.02)


def test_pictures_show_both_at_each_time(case):
    folder, _ = case
    stills = Image.open(folder / "droplet.png")
    assert stills.size == (PANEL[0] * 3, PANEL[1] * 2)
    animation = Image.open(folder / "droplet.gif")
    assert animation.n_frames >= 1
    assert animation.size == (PANEL[0] * 2, PANEL[1])
    pixels = np.asarray(stills.convert("RGB")).astype(float)
    blue = (pixels[..., 2] > pixels[..., 0] + 40) & (pixels[..., 2] > pixels[..., 1] + 20)
    green = (pixels[..., 1] > pixels[..., 0] + 20) & (pixels[..., 1] > pixels[..., 2] + 20)
    for row in range(2):
        for column in range(3):
            panel = (slice(row * PANEL[1], (row + 1) * PANEL[1]), slice(column * PANEL[0], (column + 1) * PANEL[0]))
            assert blue[panel].mean() > 0.03
            assert green[panel].mean() > 0.05
    # 150 degrees is a taller droplet than 120.
    tall = [
        np.ptp(np.flatnonzero(blue[row * PANEL[1] : (row + 1) * PANEL[1], : PANEL[0]].any(axis=1))) for row in (0, 1)
    ]
    assert tall[1] > tall[0]


def test_the_page_needs_nothing_else(case):
    text = (case[0] / "droplet.html").read_text()
    assert text.count("<svg") == 5
    assert text.count("data:image/") == 2
    assert not re.search(r"(src|href)=\"(?!data:|#)", text)
    assert "a plate" in text
    assert "<th>leaf</th><th>twin</th>" in text
    assert "droplet.html" in case[1]


def test_several_places_have_mean_and_spread(tmp_path):
    for place, angle in (("1_ridge", 120.0), ("2_furrow", 150.0)):
        write_plate(tmp_path / place, variants=("leaf", "twin"))
        share, ticks = cap(angle)
        for name in ("leaf", "twin"):
            write_run(tmp_path / place / name, [share] * 2, ticks, [5, 10])
    (tmp_path / SETTINGS).write_text(json.dumps({"cases": ["1_ridge", "2_furrow"]}))
    DropletJob(tmp_path, only_read=True).run()
    runs = {row["run"] for row in csv.DictReader((tmp_path / "droplet.csv").read_text().splitlines())}
    assert runs == {"1_ridge/leaf", "1_ridge/twin", "2_furrow/leaf"}  # one twin is enough
    assert "mean ± standard deviation" in (tmp_path / "droplet.html").read_text()


def test_chosen_times_are_even_and_there():
    times = [0.1 * k for k in range(1, 31)]
    found = chosen_times(times, 0.5, 1.5)
    assert set(found) <= set(times)
    assert np.allclose(found, np.linspace(0.5, 1.5, 6), atol=0.051)
    assert chosen_times(times[:2], 0.1, 0.2) == times[:2]


@pytest.mark.parametrize(("kept", "warned"), [(0.9995, False), (0.97, True)])
def test_a_run_that_loses_its_droplet_is_named_and_left_out_of_the_mean(tmp_path, kept, warned):
    for place, end in (("1_ridge", 1.0), ("2_furrow", 1.0), ("3_hair", kept)):
        write_plate(tmp_path / place, duration=1e-4)
        share, ticks = cap(140.0)
        write_run(tmp_path / place / "leaf", [share, end * share], ticks, [5, 10])
    (tmp_path / SETTINGS).write_text(json.dumps({"cases": ["1_ridge", "2_furrow", "3_hair"]}))
    cases = find_cases(tmp_path)
    results = DropletResults.read(tmp_path, dict.fromkeys(cases, ("leaf",)))
    notes = []
    journal = Journal()
    journal.note = notes.append
    with journal:
        results.warn()
    assert ["3_hair/leaf has failed" in text for text in notes] == [True] * warned
    page = figures_table(results.summaries, results.spread, [*results.failures.values()])
    assert ("3_hair/leaf has failed" in page) == warned
    assert list(results.failures) == ["3_hair/leaf"] * warned
    assert (results.spread["volume_drift"][0] < 1e-9) == warned


def test_a_droplet_that_meets_the_sides_is_named(tmp_path):
    write_plate(tmp_path, duration=1e-4)
    for name, radius in (("leaf", 44.0), ("twin", 40.0)):
        share, ticks = cap(90.0, radius)
        write_run(tmp_path / name, [share, share], ticks, [5, 10])
    # The box ends where the grid of the cap does, at 44; a cell is 5.
    constants = tmp_path / "constants"
    constants.write_text(re.sub(r"(xMax\s+)\S+;", r"\g<1>44;", constants.read_text()))
    results = DropletResults.read(tmp_path, dict.fromkeys(find_cases(tmp_path), ("leaf", "twin")))
    assert list(results.failures) == ["leaf"]
    assert "make the window wider" in results.failures["leaf"]
