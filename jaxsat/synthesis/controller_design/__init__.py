"""From a vehicle with failures to a controller that is verified on it: `design`."""

from jaxsat.synthesis.controller_design.explanation import Remedy, Separation
from jaxsat.synthesis.controller_design.reading import ALL, Vehicle, read_vehicle
from jaxsat.synthesis.controller_design.result import ControllerDesign, Step, Verification
from jaxsat.synthesis.controller_design.run import design
from jaxsat.synthesis.controller_design.settings import DesignSettings, Seeds
from jaxsat.synthesis.controller_design.turned import turned
from jaxsat.synthesis.controller_design.vehicle import VehicleVerdict, vehicle_verdict

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
