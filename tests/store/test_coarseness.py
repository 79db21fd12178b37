"""When an attitude is saved too coarsely."""

import numpy as np
import pytest
import xarray as xr
from scipy.spatial.transform import Rotation

from jaxsat.store.dataset import coarseness


def spin(turns):
    """A body that spins about z by these turns between two of five records, 2 s apart."""
    times = 2.0 * np.arange(5)
    angle = 2 * np.pi * turns * np.arange(5)
    turned = Rotation.from_euler("z", angle[:, None]).as_quat()
    omega = np.outer(np.ones(5), [0, 0, 2 * np.pi * turns / 2])
    return xr.Dataset(
        {
            "quaternion": (("time", "part"), np.roll(turned, 1, axis=1)),
            "omega": (("time", "body_axis"), omega),
        },
        {"time": times},
    )


@pytest.mark.parametrize("turns", [0.0, 0.1, 0.33])
def test_less_than_a_third_of_a_turn_is_fine(turns):
    assert coarseness(spin(turns)) == ""


@pytest.mark.parametrize("turns", [0.34, 0.5, 1.0, 3.0])
def test_more_is_told_with_what_would_do(turns):
    """Whole turns too, which attitudes alone do not show."""
    told = coarseness(spin(turns))
    assert f"turns by {turns:.3g} of a turn" in told
    assert f"every {2 / 3 / turns:.2g} s" in told


def test_only_the_attitude_may_tell():
    run = spin(0.4)
    run["omega"][:] = 0
    assert "0.4 of a turn" in coarseness(run)
    run["quaternion"][1:] = np.nan  # the run failed
    assert coarseness(run) == ""
