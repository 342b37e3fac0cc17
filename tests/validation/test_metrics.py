"""The metrics against synthetic truth with known errors and known noise."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from openswim.validation.reference.metrics import BLOCK, block_means, image_score, score


@given(st.floats(-0.5, 0.5))
def test_a_constant_factor_is_bias_and_rmse(error: float) -> None:
    truth = np.linspace(1.0, 3.0, 50)
    found = score((1 + error) * truth, truth)
    assert found.bias == pytest.approx(error, abs=1e-12)
    assert found.relative_rmse == pytest.approx(
        abs(error) * np.sqrt(np.mean(truth**2)) / truth.mean(), abs=1e-12
    )
    assert found.correlation == pytest.approx(1.0)
    assert found.n == 50


def test_noise_of_the_reference_is_taken_out() -> None:
    rng = np.random.default_rng(1)
    truth = rng.uniform(0.5, 1.5, 200_000)
    model = truth + rng.normal(0.0, 0.03, truth.size)  # the model's own error: 3 % of the mean
    sigma = 0.1 * truth
    reference = truth + rng.normal(size=truth.size) * sigma
    with_noise, without = score(model, reference), score(model, reference, sigma)
    assert with_noise.relative_rmse > 0.1
    assert without.relative_rmse == pytest.approx(0.03, rel=0.05)


def test_a_perfect_model_scores_nothing_but_noise() -> None:
    rng = np.random.default_rng(2)
    truth = np.full(100_000, 2.0)
    found = score(truth, truth + rng.normal(0, 0.2, truth.size), 0.2)
    assert found.relative_rmse < 0.01
    assert abs(found.bias) < 0.001


def test_missing_truth_is_left_out_and_a_missing_model_is_not() -> None:
    truth = np.array([1.0, np.nan, 3.0])
    assert score([1.0, 99.0, 3.0], truth).relative_rmse == 0
    assert score([1.0, 99.0, 3.0], truth).n == 2
    assert np.isnan(score([1.0, 2.0, np.nan], truth).relative_rmse)
    image = np.ones((8, 8))
    broken = image.copy()
    broken[2, 2] = np.nan
    assert np.isnan(image_score(broken, image).relative_rmse)


def test_nothing_to_compare_is_not_a_number() -> None:
    assert np.isnan(score([], []).relative_rmse)
    assert np.isnan(score([1.0], [np.nan]).bias)


def test_block_means_against_a_loop() -> None:
    rng = np.random.default_rng(3)
    image = rng.uniform(size=(13, 18))
    image[0:4, 0:3] = np.nan  # 12 of 16 pixels: too few left
    image[4, 4:8] = np.nan  # 4 of 16: enough left
    means, counts = block_means(image)
    assert means.shape == (3, 4)
    assert np.isnan(means[0, 0])
    for i in range(3):
        for j in range(4):
            block = image[BLOCK * i : BLOCK * i + BLOCK, BLOCK * j : BLOCK * j + BLOCK]
            assert counts[i, j] == np.isfinite(block).sum()
            if (i, j) != (0, 0):
                assert means[i, j] == pytest.approx(np.nanmean(block))


def test_images_count_lit_blocks_only_and_remove_the_noise_of_block_means() -> None:
    rng = np.random.default_rng(4)
    truth = np.kron(rng.uniform(0.5, 1.5, (50, 50)), np.ones((BLOCK, BLOCK)))
    truth[:, :100] = 0.01  # dark half, where the model is wildly wrong
    model = np.where(truth > 0.02, 1.05 * truth, 7.0)
    sigma = 0.5 * truth
    found = image_score(model, truth + rng.normal(size=truth.shape) * sigma, sigma)
    assert found.n == 50 * 25
    assert found.bias == pytest.approx(0.05, abs=0.01)
    assert found.relative_rmse == pytest.approx(0.05, abs=0.012)  # 0.125 if the noise stayed in
