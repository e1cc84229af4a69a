"""Every stage that can be long moves its bar from beginning to end, step by step, and never back."""

from contextlib import contextmanager

import numpy as np
import pytest

from cloud_shapes import torus
from o3dleaf import create_from_point_cloud_rbfpu, samples
from o3dleaf.core.journal import Journal
from tolerances import LARGEST_STEP_OF_A_BAR

LONG = ("prepare cloud", "merge points", "fit balls", "follow surface", "trim to data", "measure support")


class Reported(Journal):
    """Keeps all that the stages report of their progress, as shares: before the journal ends their bars."""

    def __init__(self):
        super().__init__()
        self.shares, self.before_the_end = {}, {}

    @contextmanager
    def stage(self, name):
        with super().stage(name) as report:
            yield report
            self.before_the_end[name] = list(self.shares[name])

    @contextmanager
    def show(self, name):
        shares = self.shares.setdefault(name, [])
        yield lambda done, total: shares.append(done / total)


def clean():
    return torus(4000)


def open_and_noisy():
    points, _ = torus(4000)
    points += 0.03 * np.random.default_rng(0).normal(size=points.shape)
    return points[points[:, 0] < 0.5], None


def creased():
    return samples.Block().sample(6000, seed=0)


@pytest.mark.few(cloud=1)
@pytest.mark.parametrize("cloud", [creased, clean, open_and_noisy])
def test_every_long_stage_reports_its_steps_never_goes_back_and_ends_at_its_total(cloud):
    with Reported() as journal:
        create_from_point_cloud_rbfpu(cloud()[0])
    for stage in LONG:
        shares = np.array(journal.before_the_end[stage])
        assert np.all(np.diff(shares) > 0)
        assert shares[-1] == 1
    for stage in ("prepare cloud", "fit balls", "follow surface"):
        assert np.diff(journal.shares[stage], prepend=0).max() <= LARGEST_STEP_OF_A_BAR


@pytest.mark.few(local=1)
@pytest.mark.parametrize("local", ["mls", "hermite"])
def test_other_fits_report_theirs_too(local):
    with Reported() as journal:
        create_from_point_cloud_rbfpu(clean()[0], local=local, trim=None, measure=None)
    assert np.diff(journal.shares["fit balls"], prepend=0).max() <= LARGEST_STEP_OF_A_BAR
    assert journal.before_the_end["fit balls"][-1] == 1
