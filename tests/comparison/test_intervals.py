"""Scores against other people's libraries and numpy, and intervals against skies of which the truth is known."""

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from openswim.cameras import Camera
from openswim.comparison.categories import contingency
from openswim.comparison.correlation import bias, correlation, root_mean_square
from openswim.comparison.neighbourhoods import fraction_sums, fss, lambert_map, neighbourhoods
from openswim.comparison.tiles import Tiles

PIXELS = Camera.allsky(50, 10, size=90).pixels()
SKY = PIXELS.inside & (np.nan_to_num(PIXELS.altitude_deg, nan=-1) > 10)
WEIGHT = PIXELS.solid_angle_sr[SKY]
TILES = Tiles.of(PIXELS.direction[SKY], WEIGHT)


def pairs(random, rho, sigma_px):
    """Two fields (90, 90) of standard normal values that are correlated by rho, and each with itself."""
    point = np.zeros((91, 91))
    point[45, 45] = 1
    scale = np.sqrt((gaussian_filter(point, sigma_px) ** 2).sum())
    a, b = (gaussian_filter(random.normal(size=(140, 140)), sigma_px)[25:115, 25:115] / scale for _ in range(2))
    return a, rho * a + np.sqrt(1 - rho**2) * b


def test_r_and_differences_are_those_of_numpy():
    a, b = (field[SKY] for field in pairs(np.random.default_rng(0), 0.6, 2))
    same = np.ones(len(a))
    assert correlation(a[:, None], b[:, None], same, TILES).value == pytest.approx(np.corrcoef(a, b)[0, 1], abs=1e-12)
    of_all = np.cov(a, b, aweights=WEIGHT)
    weighted = of_all[0, 1] / np.sqrt(of_all[0, 0] * of_all[1, 1])
    assert correlation(a[:, None], b[:, None], WEIGHT, TILES).value == pytest.approx(weighted, abs=1e-12)
    both = np.stack([a, b], axis=-1), np.stack([b, a**3], axis=-1)
    mean = np.mean([np.corrcoef(x, y)[0, 1] for x, y in zip(both[0].T, both[1].T, strict=True)])
    assert correlation(*both, same, TILES).value == pytest.approx(mean, abs=1e-12)
    assert root_mean_square(a, b, WEIGHT, TILES).value == pytest.approx(
        np.sqrt(np.average((a - b) ** 2, weights=WEIGHT)), abs=1e-12
    )
    assert bias(a, b, same, TILES).value == pytest.approx((a - b).mean(), abs=1e-12)


def test_scores_are_those_of_scikit_learn():
    metrics = pytest.importorskip("sklearn.metrics")
    a, b = (field[SKY] > 0.3 for field in pairs(np.random.default_rng(1), 0.5, 2))
    found = contingency(a, b, WEIGHT, TILES)
    matrix = metrics.confusion_matrix(a, b, sample_weight=WEIGHT, normalize="all")
    cells = [[found.both_clear, found.false_alarms], [found.misses, found.hits]]
    np.testing.assert_allclose(cells, matrix, atol=1e-12)
    assert found.scores["pod"].value == pytest.approx(metrics.recall_score(a, b, sample_weight=WEIGHT), abs=1e-12)
    precision = metrics.precision_score(a, b, sample_weight=WEIGHT)
    assert found.scores["far"].value == pytest.approx(1 - precision, abs=1e-12)
    x, y = (field[SKY] for field in pairs(np.random.default_rng(2), 0.5, 2))
    error = metrics.root_mean_squared_error(x, y, sample_weight=WEIGHT)
    assert root_mean_square(x, y, WEIGHT, TILES).value == pytest.approx(error, abs=1e-12)


@pytest.mark.filterwarnings("ignore")
def test_scores_are_those_of_the_library_of_that_name():
    library = pytest.importorskip("scores")
    xr = pytest.importorskip("xarray")
    from scores.categorical import BasicContingencyManager
    from scores.spatial import fss_2d_single_field

    observed, simulated = (field > 0.3 for field in pairs(np.random.default_rng(3), 0.5, 3))
    a, b = observed[SKY], simulated[SKY]
    counts = {"tp_count": (a & b).sum(), "fp_count": (~a & b).sum(), "fn_count": (a & ~b).sum(),
              "tn_count": (~a & ~b).sum(), "total_count": a.size}  # fmt: skip
    manager = BasicContingencyManager({key: xr.DataArray(float(n)) for key, n in counts.items()})
    found = contingency(a, b, np.ones(len(a)), TILES).scores
    assert found["ets"].value == pytest.approx(float(manager.equitable_threat_score()), abs=1e-12)
    assert found["pod"].value == pytest.approx(float(manager.probability_of_detection()), abs=1e-12)
    assert found["far"].value == pytest.approx(float(manager.false_alarm_ratio()), abs=1e-12)
    x, y = (xr.DataArray(field[SKY]) for field in pairs(np.random.default_rng(4), 0.5, 3))
    theirs = float(library.continuous.correlation.pearsonr(x, y))
    ours = correlation(x.values[:, None], y.values[:, None], np.ones(x.size), TILES).value
    assert ours == pytest.approx(theirs, abs=1e-12)
    for window in (1, 5, 16):
        theirs = fss_2d_single_field(simulated * 1.0, observed * 1.0, event_threshold=0.5, window_size=(window, window))
        sums, counted = fraction_sums(simulated, observed, window)
        assert float(fss(sums[counted].sum(axis=0)[None])[0]) == pytest.approx(float(theirs), abs=1e-12)


def test_fss_of_a_shifted_edge_is_the_known_one():
    """Cloud on the left of two columns that differ by s: in windows of one cell 1 - s / (c + c + s)."""
    columns = np.arange(60)
    observed, simulated = (np.broadcast_to(columns < n, (60, 60)) for n in (30, 36))
    sums, _ = fraction_sums(simulated, observed, 1)
    assert float(fss(sums.reshape(-1, 3).sum(axis=0)[None])[0]) == pytest.approx(1 - 6 / 66, abs=1e-12)


def test_the_map_has_equal_areas_and_east_on_the_left():
    camera = Camera.allsky(50, 10, size=300)
    row, column, there, direction = lambert_map(camera, 60)
    np.testing.assert_allclose(direction[there], camera.pixels().direction[row[there], column[there]], atol=0.012)
    assert there.mean() == pytest.approx(np.pi / 4, abs=0.01)
    assert direction[30, 5, 0] > 0.8
    # a cap of 60 degrees has half of the hemisphere's area
    assert (direction[there][:, 2] > 0.5).mean() == pytest.approx(0.5, abs=0.01)


def test_random_skies_score_high_in_wide_windows():
    random = np.random.default_rng(0)
    camera = Camera.allsky(50, 10, size=120)
    direction = lambert_map(camera, 60)[3]
    masks = [random.random((60, 60)) < 0.5 for _ in range(2)]
    found = neighbourhoods(*masks, np.ones((60, 60), bool), direction, (1.0, 40.0))
    assert found[0].score.value == pytest.approx(0.5, abs=0.05)
    assert found[1].score.value > 0.98
    assert found[1].random == pytest.approx(found[1].score.value, abs=0.01)


def test_what_is_not_defined_is_nan_with_a_reason():
    clear, cloud = np.zeros(len(WEIGHT), bool), np.ones(len(WEIGHT), bool)
    for mask in (clear, cloud):
        ets = contingency(mask, mask, WEIGHT, TILES).scores["ets"]
        assert np.isnan(ets.value)
        assert "all clear or all cloud" in ets.reason
    assert "no cloud was observed" in contingency(clear, cloud, WEIGHT, TILES).scores["pod"].reason
    assert "no cloud is simulated" in contingency(cloud, clear, WEIGHT, TILES).scores["far"].reason
    flat = correlation(np.ones((len(WEIGHT), 1)), np.random.default_rng(0).normal(size=(len(WEIGHT), 1)), WEIGHT, TILES)
    assert np.isnan(flat.value)
    assert "contrast" in flat.reason
    nothing = correlation(np.empty((0, 3)), np.empty((0, 3)), np.empty(0), TILES)
    assert np.isnan(nothing.value)
    assert nothing.reason
    few = PIXELS.altitude_deg[SKY] > 85
    alone = correlation(*(np.random.default_rng(0).normal(size=(2, few.sum(), 1))), WEIGHT[few],
                        Tiles.of(PIXELS.direction[SKY][few], WEIGHT[few]))  # fmt: skip
    assert np.isfinite(alone.value)
    assert np.isnan(alone.low)
    assert "too few tiles" in alone.reason


@pytest.mark.parametrize(("sigma_px", "rho"), [(1, 0.3), (2, 0.6), (3, 0.9)])
def test_intervals_hold_the_truth_as_often_as_they_say(sigma_px, rho):
    """Fields alike over 4 to 12 degrees; 250 skies tell a share of 95 % to 1.4 % (standard deviation)."""
    random = np.random.default_rng(sigma_px)
    held = np.zeros(2)
    skies = 250
    for _ in range(skies):
        a, b = (field[SKY] for field in pairs(random, rho, sigma_px))
        r = correlation(a[:, None], b[:, None], WEIGHT, TILES)
        error = root_mean_square(a, b, WEIGHT, TILES)
        held += [r.low <= rho <= r.high, error.low <= np.sqrt(2 - 2 * rho) <= error.high]
    assert (held / skies >= 0.92).all(), held / skies
    assert (held / skies <= 0.985).all(), held / skies
