"""Target processors, and their machine code through llvmlite.

All functions are thread-safe: llvmlite holds a lock of its own during every call of LLVM.
"""

import os
import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from importlib.util import find_spec
from itertools import count
from typing import Any

from jaxsat.compiler.ir import NativeBug
from jaxsat.core.once import once

LLVMLITE = find_spec("llvmlite") is not None
"""Whether machine code can be made on this installation."""

PASSES = ("always_inliner", "instruction_combine")
"""Passes of LLVM over a module, by llvmlite's names; part of the cache's key.

The first writes out short functions (`function_emitter.SHORT`). Programs have neither dead code
nor repeated operations. LLVM's pipelines O1 and O2 take as long as its generation of machine code,
which is no quicker for it.
"""

_libraries = count()


@dataclass(frozen=True)
class Host:
    """A processor: LLVM's name, features, bytes of a vector register, and system triple."""

    name: str
    features: str
    register: int
    triple: str

    @property
    def architecture(self) -> str:
        """First part of the triple: x86_64, aarch64, or arm64 on macOS."""
        return self.triple.split("-")[0]

    @property
    def fuses(self) -> bool:
        """Whether it has operations that multiply and add with one rounding."""
        return self.architecture != "x86_64" or "+fma" in self.features.split(",")

    @property
    def lanes(self) -> int:
        """Trajectories in a vector: one register of 64-bit numbers."""
        return self.register // 8

    @property
    def masks(self) -> bool:
        """Whether it stores some lanes of a vector at once, as AVX-512 does."""
        return self.register == 64

    def attributes(self) -> str:
        """Return the attributes of every function; the stack is aligned to what is stored there."""
        bits = self.register * 8
        wide = f' "prefer-vector-width"="{bits}" "min-legal-vector-width"="{bits}"'
        target = f'"target-cpu"="{self.name}" "target-features"="{self.features}"'
        return f"nounwind {target}" + (f'{wide} "stackrealign"' if self.register > 16 else "")


@once
def host() -> Host:
    """Return the processor of this process."""
    import llvmlite.binding as llvm

    features = llvm.get_host_cpu_features()
    longest = features.get("avx512f") and features.get("avx512dq")
    # 16 bytes: SSE2 and NEON, which every 64-bit x86 and ARM has; longer ones are those of x86
    register = 64 if longest else 32 if features.get("avx") else 16
    return Host(llvm.get_host_cpu_name(), features.flatten(), register, llvm.get_default_triple())


_NAMED = {
    "x86-64": (16, "x86_64-linux-gnu"),
    "x86-64-v3": (32, "x86_64-linux-gnu"),
    "cortex-a53": (16, "aarch64-linux-gnu"),
}


def named(name: str) -> Host:
    """Return another processor by LLVM's name, of those in tests."""
    return Host(name, "", *_NAMED[name])


def version() -> str:
    """Return the version of LLVM."""
    import llvmlite.binding as llvm

    return ".".join(map(str, llvm.llvm_version_info))


@once
def _machine(cpu: Host):
    import llvmlite.binding as llvm

    if cpu.architecture == host().architecture:
        llvm.initialize_native_target()
        llvm.initialize_native_asmprinter()
    else:  # which takes 30 ms
        llvm.initialize_all_targets()
        llvm.initialize_all_asmprinters()
    target = llvm.Target.from_triple(cpu.triple)
    return target.create_target_machine(
        cpu=cpu.name, features=cpu.features, opt=2, reloc="pic", codemodel="default", jit=True
    )


def optimised(text: str, cpu: Host | None = None):
    """Return the module of an LLVM text after `PASSES`, for this processor or another."""
    import llvmlite.binding as llvm

    machine = _machine(cpu or host())
    try:
        module = llvm.parse_assembly(text)
    except RuntimeError as error:
        raise NativeBug("the code that it printed", error) from error
    module.triple = machine.triple
    module.data_layout = str(machine.target_data)
    passes = llvm.create_new_module_pass_manager()
    for name in PASSES:
        getattr(passes, f"add_{name}_pass")()
    passes.run(module, llvm.create_pass_builder(machine, llvm.create_pipeline_tuning_options()))
    return module


def object_code(text: str, cpu: Host | None = None) -> bytes:
    """Return the machine code of an LLVM text as an object file."""
    return _machine(cpu or host()).emit_object(optimised(text, cpu))


def assembly(text: str, cpu: Host | None = None) -> str:
    """Return the machine code of an LLVM text as assembly."""
    return _machine(cpu or host()).emit_assembly(optimised(text, cpu))


@once
def _jit():
    import llvmlite.binding as llvm

    _machine(host())
    target = llvm.Target.from_default_triple().create_target_machine(
        cpu=host().name, features=host().features, jit=True
    )
    # the other linker breaks down where the parts of a library come to lie too far apart
    return llvm.create_lljit_compiler(target, use_jit_link=sys.platform != "win32")


def loaded(code: bytes, types: Mapping[str, Callable[[int], Any]]) -> dict[str, Any]:
    """Load functions of machine code, of these `ctypes` types.

    The code stays in memory as long as one of them, so that no caller's code is freed.
    """
    import llvmlite.binding as llvm

    library = llvm.JITLibraryBuilder().add_object_img(code).add_current_process()
    for name in types:
        library.export_symbol(name)
    tracker = library.link(_jit(), f"jaxsat-{os.getpid()}-{next(_libraries)}")
    functions = {name: kind(tracker[name]) for name, kind in types.items()}
    for function in functions.values():
        function.library = tracker
    return functions
