"""Where a law was verified: the range that measured points give, and the numbers of a scenario."""

import numpy as np
import pytest

from jaxsat.core.declaration.domain import NUMBERS, Sweep
from jaxsat.core.declaration.laws import LAWS
from jaxsat.scenario.build.load import load
from jaxsat.scenario.domain import dimensionless_numbers

POINTS = ((0.1, 0.5), (0.2, 0.99), (0.4, 1.0), (0.8, 0.97), (1.6, 1.0))


def test_the_range_ends_before_the_first_value_at_which_too_few_settle():
    sweep = Sweep("coupling", 0.3, POINTS)
    assert sweep.verified == (0.2, 0.4)
    assert sweep.beyond(0.15) == (0.1, 0.5)
    assert sweep.beyond(0.7) == (0.8, 0.97)
    assert sweep.beyond(9.0) == (1.6, 1.0)
    assert Sweep("coupling", 2.0, POINTS[-1:]).verified == (1.6, 2.0)
    assert Sweep("coupling", 2.0, POINTS[-1:]).beyond(1.0) is None


def test_points_are_in_order_and_numbers_known():
    for number, points in (("coupling", POINTS[::-1]), ("colour", POINTS)):
        with pytest.raises(ValueError, match="sorted"):
            Sweep(number, 0.3, points)


def test_the_numbers_do_not_change_with_the_units():
    """J, T, d over 1000, and all times by 3: the same spacecraft."""
    one = dimensionless_numbers(load("acceptance-hard", purpose="text"))
    data = [
        "spacecraft.inertia_kg_m2=[0.4495,0.2646,0.3125]",
        f"spacecraft.torque_limit_N_m={5e-3 / 9}",
        f"disturbance.amplitude_N_m=[{1e-5 / 9},{2e-5 / 9},{1e-6 / 9}]",
        f"disturbance.frequency_rad_s=[{0.7 / 3},{0.8 / 3},{0.1 / 3}]",
        f"orbit.rate_rad_s={0.0011 / 3}",
        "control.period_s=0.3",
        "simulation.save_every_s=0.3",
        f"sampling.rate_noise_rad_s={3e-5 / 3}",
    ]
    other = dimensionless_numbers(load("acceptance-hard", data, purpose="text"))
    assert set(one) == set(NUMBERS)
    paper = np.hypot(np.hypot(0.01 / 449.5 / 0.7, 0.02 / 264.6 / 0.8), 0.001 / 312.5 / 0.1)
    assert one["disturbance_rate"] == pytest.approx(paper / 1e-3)
    rate = one.pop("disturbance_rate")  # relative to a tolerance, which stays
    assert other["disturbance_rate"] == pytest.approx(rate / 3)
    for name, value in one.items():
        np.testing.assert_allclose(other[name], value, rtol=1e-9, err_msg=name)


def test_the_reference_of_every_sweep_is_the_acceptance_set():
    numbers = dimensionless_numbers(load("acceptance-hard", purpose="text"))
    for law in LAWS.values():
        for sweep in law.declaration.domain:
            low, high = sweep.verified
            assert low * 0.999 <= numbers[sweep.number] <= high * 1.001
            assert sweep.reference == pytest.approx(numbers[sweep.number], rel=0.02)
