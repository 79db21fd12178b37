"""The processor that machine code is made for, and machine code as loaded."""

import mmap

import llvmlite.binding as llvm
import numpy as np
import pytest

from jaxsat.compiler import Mapped
from jaxsat.compiler.llvm import target
from jaxsat.compiler.llvm.drivers import RUN

HOSTS = {
    "apple-m1": ("arm64-apple-darwin23.6.0", "", 2),  # LLVM tells no features there
    "cortex-a76": ("aarch64-unknown-linux-gnu", "+neon,+fp-armv8,+crc,-sve", 2),
    "neoverse-v1": ("aarch64-unknown-linux-gnu", "+neon,+fp-armv8,+sve", 2),
    "nehalem": ("x86_64-unknown-linux-gnu", "+sse2,+sse4.2,-avx,-avx2,-avx512f", 2),
    "haswell": ("x86_64-unknown-linux-gnu", "+sse2,+avx,+avx2,+fma,-avx512f", 4),
    "knl": ("x86_64-unknown-linux-gnu", "+avx,+avx2,+fma,+avx512f,-avx512dq", 4),
    "skylake-avx512": ("x86_64-unknown-linux-gnu", "+avx,+avx2,+fma,+avx512f,+avx512dq", 8),
}
"""Triple, features and lanes, by LLVM's name."""


@pytest.mark.parametrize("name", HOSTS)
def test_lanes_fill_the_registers_of_the_processor(name, monkeypatch):
    triple, features, lanes = HOSTS[name]
    found = llvm.FeatureMap({one[1:]: one[0] == "+" for one in features.split(",") if one})
    monkeypatch.setattr(llvm, "get_host_cpu_name", lambda: name)
    monkeypatch.setattr(llvm, "get_host_cpu_features", lambda: found)
    monkeypatch.setattr(llvm, "get_default_triple", lambda: triple)
    host = target.host.__wrapped__()  # not what was found before
    assert host.lanes == lanes
    assert host.masks == (lanes == 8)  # and no instruction of AVX-512 anywhere else
    assert host.fuses == (name != "nehalem")


@pytest.mark.parametrize("name", ["cortex-a53", "x86-64"])
def test_two_lanes_are_one_register(name):
    cpu = target.named(name)
    text = Mapped(lambda case, shared: case * shared + 1.0, 0.0, 0.0, cpu=cpu).assembly()
    assert ("fmla\tv" if name == "cortex-a53" else "mulpd") in text


def test_libraries_may_lie_far_apart():
    mapped = Mapped(lambda case, shared: 2.0 * case + shared, 0.0, 0.0)
    code, between, kept = target.object_code(mapped.text), [], []
    for _ in range(30):
        kept.append(target.loaded(code, {"run": RUN})["run"])
        between.append(mmap.mmap(-1, 200 << 20))
    np.testing.assert_array_equal(mapped(np.arange(3.0), 1.0), [1.0, 3.0, 5.0])
