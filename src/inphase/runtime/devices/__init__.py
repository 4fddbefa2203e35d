"""Devices that need no wires: stand-ins for tests and for trying out, and the ones to copy for one's own."""

from inphase.runtime.devices.faults import Dead, Drifting, Duplicated, Late, NanBursting, Reordered
from inphase.runtime.devices.replay_sensor import ReplaySensor
from inphase.runtime.devices.robot_state import RobotState
from inphase.runtime.devices.simulated_partner import SimulatedPartner
from inphase.runtime.devices.simulated_robot import SimulatedRobot

__all__ = [
    "Dead",
    "Drifting",
    "Duplicated",
    "Late",
    "NanBursting",
    "Reordered",
    "ReplaySensor",
    "RobotState",
    "SimulatedPartner",
    "SimulatedRobot",
]
