"""Results as labelled arrays with units, and the folders that hold them."""

from jaxsat.results.dataset import open_trajectory, save_dataset, trajectory_dataset
from jaxsat.results.errors import OutputError
from jaxsat.results.folder import OutputFolder
from jaxsat.results.provenance import machine, provenance
from jaxsat.results.settling import is_within, time_at_rest, time_to_settle
from jaxsat.results.store import Column, StudyStore, open_study

__all__ = [
    "Column",
    "OutputError",
    "OutputFolder",
    "StudyStore",
    "is_within",
    "machine",
    "open_study",
    "open_trajectory",
    "provenance",
    "save_dataset",
    "time_at_rest",
    "time_to_settle",
    "trajectory_dataset",
]
