"""From a vehicle with failures to a controller that is verified on it: `design`."""

from jaxsat.controller_design.explanation import Remedy, Separation
from jaxsat.controller_design.reading import ALL, Vehicle, read_vehicle
from jaxsat.controller_design.result import ControllerDesign, Step, Verification
from jaxsat.controller_design.run import design
from jaxsat.controller_design.settings import DesignSettings, Seeds
from jaxsat.controller_design.turned import turned
from jaxsat.controller_design.vehicle import VehicleVerdict, vehicle_verdict

__all__ = [
    "ALL",
    "ControllerDesign",
    "DesignSettings",
    "Remedy",
    "Seeds",
    "Separation",
    "Step",
    "Vehicle",
    "VehicleVerdict",
    "Verification",
    "design",
    "read_vehicle",
    "turned",
    "vehicle_verdict",
]
