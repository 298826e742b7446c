"""Errors of blunt dissection: their classes as data, and the incidents of a run."""

from app.simulation.exercises.errors.classes import (
    CLOSED_AFTER,
    ERROR_CLASSES,
    MODES,
    Conditions,
    ErrorClass,
    Parameter,
)
from app.simulation.exercises.errors.incidents import (
    CONSEQUENCES,
    Consequence,
    Incident,
    Incidents,
    cause_of,
    read_incidents,
)

__all__ = [
    "CLOSED_AFTER",
    "CONSEQUENCES",
    "ERROR_CLASSES",
    "MODES",
    "Conditions",
    "Consequence",
    "ErrorClass",
    "Incident",
    "Incidents",
    "Parameter",
    "cause_of",
    "read_incidents",
]
