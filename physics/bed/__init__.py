"""A beam in space on a bed of strands that part: blunt dissection, in mm, N and MPa."""

from physics.bed.beam_on_bed import BeamOnBed, step_numbers
from physics.bed.bed import Bed, Patch
from physics.bed.flow import Flow, Fluid
from physics.bed.network import Join, Network
from physics.bed.pull import Hand, History, Rod, pull, step_places
from physics.bed.readings import EnergyBalance, WorstStress
from physics.bed.relaxation import Relaxation
from physics.bed.space_beam import End, SpaceBeam
from physics.bed.strands import Strands

__all__ = [
    "BeamOnBed",
    "Bed",
    "End",
    "EnergyBalance",
    "Flow",
    "Fluid",
    "Hand",
    "History",
    "Join",
    "Network",
    "Patch",
    "Relaxation",
    "Rod",
    "SpaceBeam",
    "Strands",
    "WorstStress",
    "pull",
    "step_numbers",
    "step_places",
]
