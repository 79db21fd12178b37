"""Documents written as TOML."""

import tomllib

from hypothesis import given
from hypothesis import strategies as st

from jaxsat.scenario.lines import line_map
from jaxsat.scenario.toml_text import toml_document
from scenario.documents import every_location

keys = st.text(st.characters(exclude_categories=["Cs"]), max_size=8)
scalars = (
    st.booleans()
    | st.integers(-(2**63), 2**63 - 1)
    | st.floats(allow_nan=False)
    | st.text(st.characters(exclude_categories=["Cs"]))
)

values = st.recursive(
    scalars, lambda inner: st.lists(inner, max_size=4) | st.dictionaries(keys, inner, max_size=4)
)


@given(st.dictionaries(keys, values, max_size=5))
def test_documents_read_back(document):
    """What is written is what `tomllib` reads (empty tables left out), and every key has a line."""
    text = toml_document(document)
    read = tomllib.loads(text)
    assert read == without_empty_tables(document)
    assert set(line_map(text)) >= set(every_location(read))


def without_empty_tables(table):
    kept = {}
    for key, value in table.items():
        inner = without_empty_tables(value) if isinstance(value, dict) else value
        if inner != {}:
            kept[key] = inner
    return kept
