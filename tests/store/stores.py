"""A small store of a study, with values that are plain to see."""

import numpy as np

from jaxsat.store.chunks import Column, Coordinate
from jaxsat.store.store import StudyStore

COLUMNS = {
    "cost": Column((), "float64", "1", "the cost"),
    "omega": Column((3,), "float64", "rad s-1", "the rates", ("body_axis",)),
    "code": Column((), "int8", "1", "how it ended"),
}

IDENTITY = {"seed": 1, "program": {"duration": 2.0}}


def values(numbers):
    return {
        "cost": numbers * 0.1,
        "omega": numbers[:, None] * np.ones(3),
        "code": numbers % 2,
    }


COORDINATES = {"body_axis": Coordinate(("x", "y", "z"))}


def made(path, count=10, chunk=4, identity=IDENTITY, **options):
    return StudyStore(path, identity, COLUMNS, count, chunk, coordinates=COORDINATES, **options)
