"""Machine code as loaded."""

import mmap

import numpy as np

from jaxsat.engine.native import Mapped, target
from jaxsat.engine.native.drivers import RUN


def test_libraries_may_lie_far_apart():
    mapped = Mapped(lambda case, shared: 2.0 * case + shared, 0.0, 0.0)
    code, between, kept = target.object_code(mapped.text), [], []
    for _ in range(30):
        kept.append(target.loaded(code, {"run": RUN})["run"])
        between.append(mmap.mmap(-1, 200 << 20))
    np.testing.assert_array_equal(mapped(np.arange(3.0), 1.0), [1.0, 3.0, 5.0])
