"""Results as labelled arrays with units, and the folders that hold them."""

from jaxsat.results.dataset import open_trajectory, save_trajectory, trajectory_dataset
from jaxsat.results.folder import OutputError, OutputFolder
from jaxsat.results.provenance import provenance

__all__ = [
    "OutputError",
    "OutputFolder",
    "open_trajectory",
    "provenance",
    "save_trajectory",
    "trajectory_dataset",
]
