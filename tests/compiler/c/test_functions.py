"""What a C file defines besides its functions."""

import numpy as np

from jaxsat.compiler.c.functions import Unit

WHOLE = np.dtype(np.int32)


def test_a_file_defines_the_tables_and_helpers_that_its_functions_name():
    unit = Unit(False, {}, {})
    add, lost = unit.need("add", WHOLE), unit.need("mul", WHOLE)
    table = unit.table([np.float64(0.5), np.float64(2.0)], (2,), "gain")
    unit.table([np.float64(3.0), np.float64(4.0)], (2,), "left_out")
    text = "\n".join(unit.used(f"return {table}[{add}(i, 1)];"))
    assert (
        text.index(table) < text.index("signed_of_u32(uint32_t x)") < text.index(f"{add}(int32_t")
    )
    assert lost not in text
    assert "left_out" not in text
    assert unit.used("return 1.0;") == []
