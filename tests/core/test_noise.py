"""The noise generator against jax.random, bit for bit, and its statistics."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy import stats

from jaxsat.core import noise

SEEDS = (0, 1, 12345, 2**32 - 1, 2**40 + 17)


def typed(seed):
    return jax.random.key(seed, impl="threefry2x32")


@pytest.mark.slow
@pytest.mark.parametrize("seed", SEEDS)
def test_keys_bits_and_numbers_are_those_of_jax(seed):
    key = noise.key_of_seed(seed)
    np.testing.assert_array_equal(key, jax.random.key_data(typed(seed)))
    for number in (0, 3, 2**31, 2**32 - 1):
        mine, theirs = (
            noise.fold_in(key, np.uint32(number)),
            jax.random.fold_in(typed(seed), number),
        )
        np.testing.assert_array_equal(mine, jax.random.key_data(theirs))
        for count in (1, 2, 7):
            for width, dtype in ((32, jnp.uint32), (64, jnp.uint64)):
                expected = jax.random.bits(theirs, (count,), dtype)
                np.testing.assert_array_equal(noise.bits(mine, count, width), expected)
            for dtype in (jnp.float32, jnp.float64):
                expected = jax.random.uniform(theirs, (count,), dtype)
                np.testing.assert_array_equal(noise.uniform(mine, count, dtype), expected)
                expected = jax.random.normal(theirs, (count,), dtype)
                np.testing.assert_array_equal(noise.standard_normal(mine, count, dtype), expected)


def test_threefry_known_answer():
    """The vectors of the Random123 distribution: kat_vectors, threefry2x32 with 20 rounds."""
    for key, counter, answer in [
        ((0, 0), (0, 0), (0x6B200159, 0x99BA4EFE)),
        ((0xFFFFFFFF, 0xFFFFFFFF), (0xFFFFFFFF, 0xFFFFFFFF), (0x1CB996FC, 0xBB002BE7)),
        ((0x13198A2E, 0x03707344), (0x243F6A88, 0x85A308D3), (0xC4923A9C, 0x483DF7A0)),
    ]:
        words = [jnp.array([word], jnp.uint32) for word in counter]
        found = noise.threefry(jnp.array(key, jnp.uint32), *words)
        assert tuple(int(word[0]) for word in found) == answer


@pytest.mark.slow
def test_samples_are_white_and_normal():
    key = noise.key_of_seed(7)
    draws = jax.vmap(lambda k: noise.sample_noise(key, k, 6))(jnp.arange(4000))
    assert stats.kstest(np.ravel(draws), "norm").pvalue > 1e-3
    correlation = np.corrcoef(np.concatenate([draws[1:], draws[:-1]], axis=1).T)
    assert np.abs(correlation - np.eye(12)).max() < 5 / np.sqrt(4000)


def test_a_name_stands_for_the_first_word_of_its_sha256():
    assert noise.name_number("inertia") == 0x4A49C3B2


def test_a_seed_out_of_range_is_refused():
    for seed in (-1, 2**64):
        with pytest.raises(ValueError, match="`seed` must"):
            noise.key_of_seed(seed)
