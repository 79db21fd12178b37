"""Distribution functions against those of SciPy."""

import numpy as np
import pytest
from scipy import special, stats

from jaxsat.studies.statistics import binomial, f_quantile, incomplete_beta


@pytest.mark.parametrize("count", [1, 2, 30, 1000, 10**6])
@pytest.mark.parametrize("probability", [0.0, 1e-5, 0.05, 0.5, 0.99, 1.0])
def test_binomial_probabilities(count, probability):
    first, at_most = binomial(count, probability)
    numbers = first + np.arange(len(at_most))
    expected = stats.binom(count, probability)
    np.testing.assert_allclose(at_most, expected.cdf(numbers), rtol=0, atol=3e-9)
    assert first == 0 or expected.cdf(first - 1) < 1e-20
    assert expected.sf(numbers[-1]) < 1e-20


@pytest.mark.parametrize("between", [1, 2, 7, 31])
@pytest.mark.parametrize("within", [2, 15, 967, 99_968])
def test_quantiles_of_f(between, within):
    for probability in (1e-4, 0.0125, 0.5, 0.975, 0.9999):
        expected = special.fdtri(between, within, probability)
        found = f_quantile(between, within, probability)
        assert found == pytest.approx(expected, rel=1e-8), probability


def test_the_incomplete_beta_function():
    x = np.linspace(0.001, 0.999, 41)
    for a, b in ((0.5, 0.5), (0.5, 3.0), (15.5, 2.0), (8.0, 800.0), (400.0, 3.5), (5e5, 4.0)):
        found = [incomplete_beta(a, b, one) for one in x]
        np.testing.assert_allclose(found, special.betainc(a, b, x), rtol=1e-9, atol=1e-15)
