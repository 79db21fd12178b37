"""Templates: files that are nearly the same for every controller, and their build outputs."""

from jaxsat.core import package_files

BUILT = frozenset(f"build/{name}" for name in (
    "controller.o", "controller_guard.o", "controller_parameters.o", "controller_plan.o",
    "test_controller", "run_controller", "commands.csv", "libcontroller.so", "test_sanitized",
    "test_coverage", "coverage.o", "coverage.gcno", "coverage.gcda", "proof.txt",
    "mcdc.c", "mcdc.txt", "mcdc.log", "test_mcdc",
    "cortex-m4-steps.elf", "cortex-m4-test.elf", "cortex-m7-steps.elf", "cortex-m7-test.elf",
    "libflight_controller.a", "CMakeCache.txt", "cmake_install.cmake",
    "CTestTestfile.cmake", "Makefile",
)) | {"build", "controller.c.gcov", "controller.c.mcdc"}  # fmt: skip
"""Files that `make` and CMake leave in the folder."""

OF_TOOLS = ("build/CMakeFiles", "build/Testing", "__pycache__")
"""Folders that belong to CMake and Python."""


def is_built(name: str) -> bool:
    """Whether a name, relative to the export's folder, is a build output."""
    return name in BUILT or any(name == one or name.startswith(f"{one}/") for one in OF_TOOLS)


def template(name: str, **values: object) -> str:
    """Return a file of `assets`, with each `@NAME@` replaced by the value of that name."""
    return package_files.template("jaxsat.flight", f"assets/{name}", **values)


DEVIATIONS = {
    "misra-c2012-2.5": "macros of modes are for callers",
    "misra-c2012-5.9": "names are unique in a file, and Python's names recur",
    "misra-c2012-7.2": "constants of UINT64_C, whose suffix the checker does not see",
    "misra-c2012-8.7": "the interface is for other files",
    "misra-c2012-8.9": "tables stand before the functions that read them",
    "misra-c2012-9.3": "a copy of a whole struct, which the checker takes for a list of elements",
    "misra-c2012-10.4": "selections of one type, which the checker takes for mixed",
    "misra-c2012-10.6": "selections of constants, for which the checker takes the narrowest type",
    "misra-c2012-12.1": "the precedence of * over + is relied on, as in any formula",
    "misra-c2012-12.3": "declarations of several variables, whose commas the checker takes for the "
    "operator",
    "misra-c2012-15.4": "a bounded loop with a condition of its own ends by break",
    "misra-c2012-15.5": "small helpers return where they know the result",
    "misra-c2012-17.3": "functions of math.h are declared there, which the checker does not read",
    "misra-c2012-17.7": "casts to pointers to rows, which the checker takes for calls",
    "misra-c2012-21.15": "bits of a number are copied with memcpy, between types of one size",
    "missingIncludeSystem": "headers of the C library",
    "unusedStructMember": "fields that the law reads in part",
}
"""Rules that are not followed, and the reasons."""
