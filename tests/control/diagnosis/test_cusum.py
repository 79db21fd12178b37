"""Run lengths of the CUSUM test: the closed form against the exact integral equation."""

import numpy as np
import pytest
from scipy.stats import norm

from jaxsat.control.diagnosis.diagnosis import average_run_length, cusum_threshold


def exact_run_length(reference, threshold, shift):
    """Page's integral equation by Gauss-Legendre quadrature, the mass at zero apart."""
    nodes, weights = np.polynomial.legendre.leggauss(80)
    nodes, weights = (nodes + 1) * threshold / 2, weights * threshold / 2
    begins = np.concatenate([[0.0], nodes])
    drift = shift - reference
    to_zero = norm.cdf(-begins - drift)
    inside = norm.pdf(nodes[None] - begins[:, None] - drift) * weights[None]
    transition = np.concatenate([to_zero[:, None], inside], axis=1)
    return np.linalg.solve(np.eye(len(begins)) - transition, np.ones(len(begins)))[0]


@pytest.mark.parametrize("shift", [0.0, 0.5, 2.0, 3.0])
@pytest.mark.parametrize(("reference", "threshold"), [(0.5, 4.0), (0.5, 8.0), (1.0, 6.0)])
def test_the_closed_form_is_that_of_the_integral_equation(reference, threshold, shift):
    found = average_run_length(reference, threshold, shift)
    exact = exact_run_length(reference, threshold, shift)
    assert found == pytest.approx(exact, rel=0.06, abs=0.3)


def test_without_drift_the_form_is_continuous():
    near = average_run_length(1.0, 5.0, 1.0 + 2e-6)
    assert average_run_length(1.0, 5.0, 1.0) == pytest.approx(near, rel=1e-4)


@pytest.mark.parametrize("wanted", [10.0, 1e4, 1e10])
def test_the_threshold_has_the_run_length_wanted(wanted):
    assert average_run_length(1.0, cusum_threshold(1.0, wanted)) == pytest.approx(wanted, rel=1e-6)


@pytest.mark.parametrize("wanted", [0.5, np.inf, np.nan])
def test_an_impossible_run_length_is_refused(wanted):
    with pytest.raises(ValueError, match="`run_length` must be finite and above"):
        cusum_threshold(1.0, wanted)
