"""A command is made of the fields of its job: an option is one line in one place."""

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
import typer
from typer.testing import CliRunner

from o3dleaf import remove_drift, remove_rings, samples, write_volume
from o3dleaf.commands.cli import JOBS, add_command
from o3dleaf.commands.leaf.job import LeafJob, in_a_line
from o3dleaf.commands.line.words import job_of
from o3dleaf.commands.patch import PatchJob
from o3dleaf.core.arguments.kinds import Positive
from o3dleaf.core.errors import InputError
from o3dleaf.core.jobs.job import Job, LongJob
from o3dleaf.core.jobs.option import argument, option, options_of, output, spelled, table


@dataclass(frozen=True)
class ShadedLeafJob(LeafJob):
    """A leaf with one option more, and without the work."""

    shade: float = option(0.5, "How dark the picture is", unit="percent of black")  # the one line

    def work(self):
        return self.settings

    def line(self, summary):
        return f"shade is {summary['shade']}"


@dataclass(frozen=True)
class PaintJob(Job):
    """Paint meshes."""

    meshes: list[Path] = argument("Meshes to paint.", reads=True)
    output: Path = output((".ply",))
    color: str = option("green", "Color of the paint.", "--in", choices=("green", "brown"))
    dots: tuple[float, ...] = option(
        (), "Where to leave out.", kind=list[str], parse=lambda texts: tuple(map(float, texts))
    )
    mask: Path | None = option(None, "What to leave out.", reads=True)
    log: Path | None = option(None, "A log too.", writes=())

    def work(self):
        self.output.write_text(self.color)
        return len(self.meshes)


def invoke(job, *words):
    program = typer.Typer()
    add_command(program, "it", job)
    return CliRunner().invoke(program, [str(word) for word in words], env={"COLUMNS": "200", "TERMINAL_WIDTH": "200"})


def test_a_new_option_of_leaf_is_one_line(tmp_path):
    """It is in the help with its unit and default, in the job, and among the settings that the summary keeps."""
    said = " ".join(re.sub("[│╭╮╰╯─]", " ", invoke(ShadedLeafJob, "--help").stdout).split())
    assert "--shade <float> How dark the picture is, in percent of black. [default: 0.5]" in said
    done = invoke(ShadedLeafJob, tmp_path / "scan.ply", "-o", tmp_path / "leaf.ply", "--shade", 0.25, "--threads", 1)
    assert (done.exit_code, done.stdout) == (0, "shade is 0.25\n")
    assert set(ShadedLeafJob(Path("scan.ply"), Path("leaf.ply")).settings) == {*options_of(LeafJob), "shade"} - {
        *options_of(LongJob),
        "resume",
    }


def test_the_help_shows_options_under_the_headings_of_their_classes():
    """Those of the job's own class stand under none; a class that adds to another's has its own heading, or none."""
    headings = {name: one.heading for name, (_, one) in options_of(ShadedLeafJob).items()}
    shown = {name: headings[name] for name in ("shade", "ct", "spacing", "scan_unit", "rim_radius", "level", "ct_unit")}
    assert shown == {
        "shade": None,
        "ct": None,
        "spacing": "Mesh",
        "scan_unit": "Input",
        "rim_radius": "Blade",
        "level": "Micro-structure",
        "ct_unit": "Micro-CT volume",
    }
    pages = re.split("╭─ ", invoke(ShadedLeafJob, "--help").stdout)
    under = {page.partition(" ─")[0]: page for page in pages}
    assert "--shade" in under["Options"]
    assert "--shade" not in under["Mesh"]
    assert "--spacing" in under["Mesh"]


def test_a_command_line_becomes_the_job():
    given = {"meshes": [Path("a.ply")], "output": Path("b.ply"), "color": "brown", "dots": ["1", "2.5"], "mask": None}
    job = job_of(PaintJob, given)
    assert job == PaintJob([Path("a.ply")], Path("b.ply"), "brown", (1.0, 2.5))
    assert job_of(PaintJob, given | {"dots": []}).dots == ()


def test_files_and_choices_are_refused_before_the_work(tmp_path):
    (tmp_path / "a.ply").write_text("mine")
    (tmp_path / "c.ply").write_text("mine too")
    good = {"meshes": [tmp_path / "a.ply", tmp_path / "c.ply"], "output": tmp_path / "b.ply"}
    for wrong, words in (
        ({"output": tmp_path / "c.ply"}, "not overwritten"),
        ({"log": tmp_path / "a.ply"}, "not overwritten"),
        ({"mask": tmp_path / "b.ply"}, "not overwritten"),
        ({"output": tmp_path / "b.txt"}, "suffix '.txt'"),
        ({"log": tmp_path / "nowhere" / "log.txt"}, "folder"),
        ({"color": "blue"}, "in: unknown 'blue'; choose one of green, brown"),
    ):
        with pytest.raises(InputError, match=re.escape(words)):
            PaintJob(**(good | wrong)).run()
        assert sorted(path.name for path in tmp_path.iterdir()) == ["a.ply", "c.ply"]
    assert PaintJob(**good).run() == 2
    assert (tmp_path / "b.ply").read_text() == "green"


@pytest.mark.parametrize("command", JOBS)
def test_what_a_job_says_of_its_options_is_true(command):
    """Tables that it names are there, defaults are among the choices, and no two options share a name."""
    known = options_of(JOBS[command])
    for name, (field, one) in known.items():
        assert one.text.endswith((".", "...")), name
        if one.writes is not None:
            assert all(suffix.startswith(".") for suffix in table(one.writes)), name
        if one.choices:
            assert table(one.choices), name
            assert field.default in {*table(one.choices), None, ()}, name
    flags = [flag for name, (_, one) in known.items() for flag in (one.flags or (spelled(name, one),))]
    assert len(flags) == len(set(flags))


@dataclass(frozen=True)
class DotsJob(Job):
    """A job whose options lean on one another."""

    output: Path = output((".ply",))
    dots: bool = option(False, "Paint dots.")
    stripes: bool = option(False, "Paint stripes.", unless=("dots",))
    radius: Positive | None = option(None, "Of a dot.", needs=("dots", "stars", "no_such_option"))
    stars: bool = option(False, "Paint stars.")
    color: str = option("green", "Of all.", needs=("no_such_option",))
    ribbon: bool = option(False, "Wind it about.", unless=("in_green",))

    @property
    def in_green(self):
        """Whether it is painted green."""
        return self.color == "green"

    def work(self):
        return None


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"radius": 1.0}, "radius: acts only with dots or with stars; leave it out"),
        ({"dots": True, "stripes": True}, "stripes: cannot act with dots; leave one of them out"),
        ({"ribbon": True}, "ribbon: cannot act where it is painted green; leave one of them out"),
        ({"dots": True, "radius": -1.0}, "radius: is -1.0; give a number above zero"),
        ({"dots": "yes"}, "dots: is 'yes'; give True or False"),
    ],
)
def test_options_that_cannot_act_are_refused_by_name(tmp_path, given, words):
    with pytest.raises(InputError, match=f"^{re.escape(words)}"):
        DotsJob(tmp_path / "a.ply", **given).run()


@pytest.mark.parametrize("given", [{"dots": True, "radius": 1.0}, {"stars": True, "radius": 1.0}, {"color": "red"}, {}])
def test_options_that_can_act_are_taken(tmp_path, given):
    DotsJob(tmp_path / "a.ply", **given).run()


def test_the_last_line_tells_what_was_written():
    """Of a mesh too large to hold, a coarser one was looked at, and its triangles are fewer."""
    summary = {"mesh": {"triangles": 7, "area": 2.0}, "unit": "mm", "settings": {"output": "a.ply"}}
    summary["surface"] = {"triangles": 3_982_438}
    assert "7 triangles" in in_a_line(summary)
    summary["mesh"]["note"] = "of a coarser mesh"
    assert "3,982,438 triangles" in in_a_line(summary)


@pytest.mark.parametrize("asked", [{}, {"ring_axis": (300.0, 500.0)}])
def test_a_volume_is_corrected_around_the_middle_of_its_file_whatever_is_cropped(asked, tmp_path):
    volume = samples.wheat_ct(spacing=24)[0]
    file, crop = tmp_path / "ct.tif", [[100.0, 0.0, 0.0], [1200.0, 1500.0, 480.0]]
    write_volume(volume, file)
    job = PatchJob(file, tmp_path / "a.o3l", ct_crop=crop, remove_drift=True, remove_rings=True, **asked)
    axis = asked.get("ring_axis", volume.bounds.mean(axis=0)[:2])
    expected = remove_rings(remove_drift(volume.crop(crop)), axis)
    np.testing.assert_allclose(job.read_volume(file).data, expected.data, atol=1e-6)


@pytest.mark.parametrize("correction", ["remove_drift", "remove_rings"])
def test_workers_read_no_corrected_volume(correction, tmp_path):
    """They would fit the voxels of the file."""
    write_volume(samples.wheat_ct(spacing=48)[0], tmp_path / "ct.tif")
    with pytest.raises(InputError, match="as they are"):
        PatchJob(tmp_path / "ct.tif", tmp_path / "a.o3l", workers=2, **{correction: True}).run()
