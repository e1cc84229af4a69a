"""Bars on the terminal: of stages, of a function that has none, and nothing where it is to be quiet."""

import numpy as np

import o3dleaf as o3l
from o3dleaf.core import journal


def test_stages_and_notes_are_shown(capfd):
    with o3l.show_progress():
        with journal.stage("melt wax"):
            pass
        journal.note("a candle is lit")
    shown = capfd.readouterr()
    assert "melt wax" in shown.err
    assert "a candle is lit" in shown.err
    assert shown.out == ""


def test_a_title_is_a_bar_for_what_has_no_stages(capfd):
    points = np.random.default_rng(0).uniform(size=(500, 2))
    with o3l.show_progress("fit sines"):
        o3l.PUInterpolant.fit(points, np.sin(points[:, 0]))
    assert "fit sines" in capfd.readouterr().err


def test_quiet_shows_nothing(capfd):
    with o3l.show_progress(quiet=True), journal.stage("melt wax"):
        journal.note("a candle is lit")
    assert capfd.readouterr() == ("", "")
