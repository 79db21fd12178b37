"""The cone of one-signed torques against linear programmes, direction by direction."""

import numpy as np
import pytest
from scipy.optimize import linprog, nnls

from jaxsat.controllability.cone import (
    KINDS,
    direction_words,
    nonnegative_least_squares,
    torque_cone,
)
from jaxsat.controllability.layout import TOLERANCE


def is_made(columns, wanted):
    """Whether a linear programme finds weights ≥ 0."""
    found = linprog(
        np.ones(columns.shape[1]), A_eq=columns, b_eq=wanted, bounds=(0, None), method="highs"
    )
    return found.status == 0


def random_columns(rng):
    """1 to 24 columns in special and in no special position, before and after a rotation."""
    count = rng.integers(1, 25)
    columns = rng.integers(-2, 3, size=(3, count)).astype(float)
    for row in range(rng.integers(3)):
        columns[2 - row] = rng.choice([0.0, 1.0]) * np.abs(columns[2 - row])
    if rng.random() < 0.2:
        columns = rng.normal(size=(3, count))
    rotation, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    return columns, rotation @ columns * 10 ** rng.uniform(-3, 3, size=count)


def check(seed):
    rng = np.random.default_rng(seed)
    plain, columns = random_columns(rng)
    two_sided = rng.random(columns.shape[1]) < 0.15
    cone = torque_cone(columns, two_sided)
    plain = np.concatenate([plain, -plain[:, two_sided]], axis=1)
    both = [column for column in plain.T if is_made(plain, -column)]
    assert cone.two_sided == (np.linalg.matrix_rank(np.array(both)) if both else 0)
    assert cone.span == np.linalg.matrix_rank(plain)
    assert not cone.borderline
    assert cone.neither.shape[1] == 3 - cone.span
    assert np.all(np.abs(cone.neither.T @ columns) <= 1e-8 * np.linalg.norm(columns, axis=0))
    if cone.opposed is not None:
        np.testing.assert_allclose(np.linalg.norm(cone.opposed), 1, atol=1e-12)
        rays = columns / np.maximum(np.linalg.norm(columns, axis=0), 1e-300)
        assert np.max(cone.opposed @ rays) < 1e-9
        assert np.min(cone.opposed @ rays) < -1e-6
    assert (cone.opposed is None) == (cone.two_sided == cone.span)
    return cone


@pytest.mark.parametrize("seed", range(60))
def test_shape_is_what_linear_programmes_find(seed):
    check(seed)


@pytest.mark.slow
def test_shape_of_a_hundred_random_sets():
    found = {check(seed).kind for seed in range(100, 200)}
    assert found == set(KINDS.values()) - {"nothing"}  # no set is empty


@pytest.mark.parametrize("seed", range(20))
def test_directions_are_made_or_not_as_a_linear_programme_says(seed):
    rng = np.random.default_rng(seed)
    columns = rng.normal(size=(3, rng.integers(1, 7)))
    cone = torque_cone(columns, np.zeros(columns.shape[1], bool))
    directions = rng.normal(size=(40, 3))
    angles = [cone.angle(direction) for direction in directions]
    assert [angle < 1e-7 for angle in angles] == [is_made(columns, d) for d in directions]
    # What is nearest to a direction outside is a mixture of two columns.
    unit = (columns / np.linalg.norm(columns, axis=0)).T
    weights = np.linspace(0, 1, 4001)[:, None]
    mixtures = np.concatenate([w * weights + v * (1 - weights) for v in unit for w in unit])
    mixtures = mixtures[np.linalg.norm(mixtures, axis=1) > 1e-9]
    cosines = directions @ (mixtures.T / np.linalg.norm(mixtures, axis=1))
    nearest = np.arccos(np.clip(cosines.max(axis=1) / np.linalg.norm(directions, axis=1), -1, 1))
    outside = np.array(angles) > 1e-7
    np.testing.assert_allclose(np.array(angles)[outside], nearest[outside], atol=2e-3)


EXAMPLES = {
    "space": [[1, 0, 0], [0, 1, 0], [0, 0, 1], [-1, -1, -1]],
    "half space": [[1, 0, 0], [-1, 1, 0], [-1, -1, 0], [0, 0, 1]],
    "plane": [[1, 0, 0], [-1, 1, 0], [-1, -1, 0], [2, 0, 0]],
    "wedge": [[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, 1, 1]],
    "half plane": [[1, 0, 0], [-3, 0, 0], [0, 1, 0]],
    "line": [[1, 1, 0], [-2, -2, 0], [0, 0, 0]],
    "pointed cone": [[1, 0, 1], [-1, 0, 1], [0, 1, 1], [0, -1, 1]],
    "sector": [[1, 0, 0], [0, 1, 0], [1, 1, 0]],
    "ray": [[0, 0, 1], [0, 0, 2], [0, 0, 0.1], [0, 0, 0]],
    "nothing": [[0, 0, 0]],
}


@pytest.mark.parametrize("kind", EXAMPLES)
def test_every_kind_by_name(kind):
    columns = np.array(EXAMPLES[kind], float).T
    cone = torque_cone(columns, np.zeros(columns.shape[1], bool))
    assert cone.kind == kind
    worst = {"half space": "-z", "pointed cone": "-z", "ray": "-z", "half plane": "-y"}
    if kind in worst:
        assert direction_words(cone.opposed) == worst[kind]
    if kind in ("plane", "half space"):
        assert direction_words(cone.normal) == "+z"


def test_no_columns_make_nothing():
    cone = torque_cone(np.zeros((3, 0)), np.zeros(0, bool))
    assert (cone.kind, cone.neither.shape) == ("nothing", (3, 3))
    assert cone.angle(np.array([1.0, 0, 0])) == np.pi


@pytest.mark.parametrize("size", [3e-7, -3e-7, 1e-12, -1e-12, 1e-4, -1e-4])
def test_what_the_data_leave_open_is_borderline(size):
    # Three torques around z, each tilted by `size` towards +z, and one towards +z.
    tilted = np.array([[1, 0, size], [-0.5, 0.8, size], [-0.5, -0.8, size], [0, 0, 1]]).T
    cone = torque_cone(tilted, np.zeros(4, bool))
    certain = abs(size) > TOLERANCE
    assert cone.borderline == (1e-9 < abs(size) < TOLERANCE)
    assert cone.kind == (("pointed cone" if size > 0 else "space") if certain else "half space")


def columns_and_target(random, number):
    """Random columns, many of them of few integers, equal, opposed, or zero, of any size."""
    shape = random.integers(1, 7), random.integers(1, 13)
    columns = random.normal(size=shape) if number % 3 else random.integers(-1, 2, shape) * 1.0
    if number % 4 == 0 and shape[1] > 2:
        columns[:, 1:3] = np.stack([columns[:, 0], -columns[:, 0]], axis=1)
    reachable = columns @ random.integers(0, 3, shape[1])
    target = reachable if number % 5 == 0 else random.normal(size=shape[0])
    return columns * 10.0 ** random.integers(-6, 3), target


def test_nonnegative_least_squares_are_those_of_scipy():
    random = np.random.default_rng(0)
    for number in range(300):
        columns, target = columns_and_target(random, number)
        weights, distance = nonnegative_least_squares(columns, target)
        assert (weights >= 0).all()
        np.testing.assert_allclose(distance, np.linalg.norm(columns @ weights - target))
        np.testing.assert_allclose(distance, nnls(columns, target)[1], rtol=1e-9, atol=1e-12)
