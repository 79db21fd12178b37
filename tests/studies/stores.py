"""What is in a study's store, to be compared bit for bit."""

import numpy as np

from jaxsat.store.tables import open_study


def contents(path):
    dataset = open_study(path)
    return {name: np.asarray(dataset[name]) for name in dataset}


def same(one, other):
    assert one.keys() == other.keys()
    for name in one:
        np.testing.assert_array_equal(one[name], other[name], err_msg=name)


def without_status(columns):
    return {name: values for name, values in columns.items() if name != "status"}
