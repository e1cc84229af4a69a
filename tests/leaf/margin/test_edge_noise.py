import numpy as np
import pytest
import shapely
import shapely.affinity
from scipy.spatial import cKDTree
from scipy.special import log_ndtr

import planar_leaves as leaves
from o3dleaf.leaf.margin.edge.edge_fit import most_likely
from o3dleaf.leaf.margin.edge.edge_frame import EdgeSample, edge_frame
from o3dleaf.leaf.margin.edge.edge_noise import edge_noise, log_likelihood, with_edge_noise
from o3dleaf.leaf.margin.edge.edge_score import blurred
from o3dleaf.leaf.margin.margin import Margin
from o3dleaf.leaf.margin.margin_curve import Spacing
from tolerances import DRAWN_IN, EDGE_GAIN, EDGE_NOISE

RADIUS = 20.0
DISC = shapely.Point(0, 0).buffer(RADIUS, quad_segs=256)
NO_TIPS = np.empty((0, 2))
LARGEST = 0.5


def scanned(noise, seed):
    """The margin of a disc, its points with noise in the plane, in spacings, and the spacing."""
    rng = np.random.default_rng(seed)
    points = leaves.uniform(DISC, 1256, rng)
    spacing = leaves.true_spacing(DISC, points)
    points = points + rng.normal(0, noise * spacing, points.shape)
    circle = RADIUS * np.stack([np.cos(leaves.TURN), np.sin(leaves.TURN)], axis=1)
    local = Spacing(cKDTree(points), np.full(len(points), spacing))
    return circle, EdgeSample(local, LARGEST * spacing, 1.0, shapely.MultiPolygon()), spacing


@pytest.mark.few(noise=1)
@pytest.mark.parametrize("noise", [0.25, 0.0, 0.5])
def test_noise_in_the_plane_is_found_by_how_it_blurs_the_edge(noise):
    cases = [scanned(noise, seed) for seed in range(60)]
    found = [edge_noise(circle, NO_TIPS, sample) / spacing for circle, sample, spacing in cases]
    assert np.mean(found) == pytest.approx(noise, abs=EDGE_NOISE)
    assert max(found) <= 1.5 * LARGEST


def test_a_fitted_curve_gains_as_much_likelihood_as_is_taken_off():
    """Over the true one, a circle, in the mean: the noise is known, and the curve averages over four spacings."""
    noise, width = 0.5, 4.0
    gained, told = [], []
    for seed in range(100):
        circle, sample, _ = scanned(noise, seed)
        frame = edge_frame(circle, NO_TIPS, sample)
        count = len(frame.curve)
        blur, still = np.full(count, noise), np.zeros(count)
        given = blur, np.ones(count, bool), np.full(count, width)
        stiffness = blurred(blur).information * blurred(blur).blur / blur * width**6
        moved = most_likely(frame, blur, stiffness, still)
        gained.append(raw_likelihood(frame, moved, blur) - raw_likelihood(frame, still, blur))
        told.append(raw_likelihood(frame, moved, blur) - log_likelihood(frame, moved, *given))
    assert np.mean(told) == pytest.approx(np.mean(gained), rel=EDGE_GAIN)


def raw_likelihood(frame, moved, blur):
    """The logarithm of the likelihood of the points about a curve, up to a constant."""
    return log_ndtr((moved[frame.node] - frame.across) / blur[frame.node]).sum() - (frame.length * moved).sum()


def test_noise_that_the_edge_does_not_show_draws_no_margin_in():
    """Points are exact in the plane, and may have noise of half a spacing: that of a scanner lies along its beam."""
    leaf, drawn_in = shapely.affinity.scale(DISC, 1.0, 0.3), []
    for seed in range(6):
        points = leaves.uniform(leaf, 377, np.random.default_rng(seed))
        noise = 0.5 * leaves.true_spacing(leaf, points)
        drawn_in.append(1 - Margin.fit(points, noise=noise).area / Margin.fit(points).area)
    assert np.mean(drawn_in) == pytest.approx(0, abs=DRAWN_IN)


def test_a_sample_without_noise_and_a_lattice_stay_as_they_are():
    circle, sample, _ = scanned(0.0, 0)
    for given in (
        EdgeSample(sample.local, 0.0, 1.0, sample.filled),
        EdgeSample(sample.local, sample.noise, 0.0, sample.filled),
    ):
        assert with_edge_noise(circle, NO_TIPS, given) is given
