"""The robot, the partner's hand and the room, as MuJoCo simulates them."""

from __future__ import annotations

from collections.abc import Iterable
from functools import cache
from typing import Any

from experiments.handshake.anatomy import JOINTS, MUSCLES, RANGES

STEP = 0.002  # [s]
SHOULDER = (0.0, -0.21, 1.33)
JOINT_AT = {  # axis, damping [N m s/rad], armature [kg m²]
    "scapula_elevation": ("-1 0 0", 1.5, 0.02),
    "scapula_protraction": ("0 0 1", 1.5, 0.02),
    "scapula_rotation": ("-1 0 0", 1.5, 0.02),
    "shoulder_flexion": ("0 -1 0", 0.8, 0.01),
    "shoulder_abduction": ("-1 0 0", 0.8, 0.01),
    "shoulder_rotation": ("0 0 1", 0.4, 0.005),
    "elbow_flexion": ("0 -1 0", 0.4, 0.005),
    "forearm_pronation": ("0 0 1", 0.1, 0.002),
    "wrist_flexion": ("1 0 0", 0.08, 0.002),
    "wrist_deviation": ("0 -1 0", 0.08, 0.002),
}
MATERIALS = """
  <visual><global offwidth="960" offheight="640"/><map znear="0.02"/></visual>
  <asset>
    <material name="bone" rgba="0.86 0.87 0.89 1" specular="0.4"/>
    <material name="frame" rgba="0.25 0.28 0.33 1"/>
    <material name="joint" rgba="0.35 0.39 0.45 1"/>
    <material name="skin" rgba="0.87 0.68 0.55 1"/>
  </asset>
"""


@cache
def world() -> Any:
    """The compiled model."""
    import mujoco

    return mujoco.MjModel.from_xml_string(written())


def written(drawn: bool = False) -> str:
    """Its MJCF. drawn: with muscles to look at; they do not change how anything moves."""
    return f"""<mujoco model="handshake">
  <compiler angle="radian" autolimits="true"/>
  <option timestep="{STEP}" integrator="implicitfast"/>
  {MATERIALS}
  <default>
    <geom contype="0" conaffinity="0"/>
    <default class="palm">
      <geom contype="1" conaffinity="1" friction="0.6 0.01 0.001" solref="0.01 1" solimp="0.8 0.95 0.004"/>
    </default>
  </default>
  <worldbody>
    {_robot(drawn)}
    <body name="partner_hand" pos="1.05 0.25 0.85">
      <freejoint name="partner_hand"/>
      <inertial pos="0 0 0" mass="0.5" diaginertia="0.0006 0.0006 0.0006"/>
      <geom class="palm" type="box" pos="0 0.015 0" size="0.045 0.012 0.038" material="skin"/>
      <geom type="capsule" fromto="-0.045 0.015 0.022 -0.085 0.013 0.022" size="0.010" material="skin"/>
      <geom type="capsule" fromto="-0.045 0.015 0.007 -0.095 0.013 0.007" size="0.010" material="skin"/>
      <geom type="capsule" fromto="-0.045 0.015 -0.009 -0.092 0.013 -0.009" size="0.010" material="skin"/>
      <geom type="capsule" fromto="-0.045 0.015 -0.024 -0.080 0.013 -0.024" size="0.009" material="skin"/>
      <geom type="capsule" fromto="0.005 0.010 0.036 -0.035 0.004 0.058" size="0.011" material="skin"/>
      <site name="partner_grip" size="0.006" rgba="0 0 0 0"/>
    </body>
    <body name="partner_will" mocap="true" pos="1.05 0.25 0.85"/>
  </worldbody>
  <equality>
    <weld name="will" body1="partner_will" body2="partner_hand" solref="0.03 1" solimp="0.7 0.9 0.02"/>
  </equality>
  <tendon>
    {"".join(_pulleys())}
    {"".join(_lines()) if drawn else ""}
  </tendon>
  <actuator>
    {"".join(f'<motor name="{name}" tendon="{name}" gear="-1"/>' for name in MUSCLES)}
  </actuator>
</mujoco>"""


def _joint(name: str) -> str:
    axis, damping, armature = JOINT_AT[name]
    low, high = RANGES[JOINTS.index(name)]
    return (
        f'<joint name="{name}" axis="{axis}" range="{low} {high}" damping="{damping}" armature="{armature}" '
        f'frictionloss="0.02"/>'
    )


def _robot(drawn: bool) -> str:
    """A stand with a chest, and 10 joints down to the palm, at rest hanging, the palm to the left."""
    return f"""
    <body name="torso">
      <geom type="cylinder" pos="-0.02 0 0.03" size="0.28 0.03" material="frame"/>
      <geom type="box" pos="-0.02 0 0.55" size="0.045 0.06 0.50" material="frame"/>
      <geom type="box" pos="-0.02 0 1.05" size="0.06 0.12 0.05" material="joint"/>
      <geom type="ellipsoid" pos="0.0 0 1.24" size="0.10 0.155 0.17" material="bone"/>
      <geom type="cylinder" pos="-0.01 0 1.45" size="0.035 0.06" material="joint"/>
      <geom type="ellipsoid" pos="0.01 0 1.59" size="0.09 0.075 0.115" material="bone"/>
      <geom type="box" pos="0.085 0 1.61" size="0.02 0.055 0.018" material="frame"/>
      {_sites("torso") if drawn else ""}
      <body name="scapula" pos="0.02 -0.04 {SHOULDER[2]}">
        <inertial pos="0 -0.10 0" mass="0.8" diaginertia="0.004 0.002 0.004"/>
        {_joint("scapula_elevation")}{_joint("scapula_protraction")}
        <geom type="capsule" fromto="0 0 0 -0.02 -0.17 0" size="0.018" material="bone"/>
        <geom type="box" pos="-0.045 -0.11 -0.03" size="0.01 0.045 0.06" material="bone"/>
        {_sites("scapula") if drawn else ""}
        <body name="glenoid" pos="-0.02 -0.17 0">
          <inertial pos="0 0 0" mass="0.2" diaginertia="0.0003 0.0003 0.0003"/>
          {_joint("scapula_rotation")}
          <geom type="sphere" size="0.038" material="joint"/>
          <body name="upper_arm">
            <inertial pos="0 0 -0.14" mass="1.2" diaginertia="0.009 0.009 0.0012"/>
            {_joint("shoulder_flexion")}{_joint("shoulder_abduction")}{_joint("shoulder_rotation")}
            <geom type="capsule" fromto="0 0 -0.03 0 0 -0.29" size="0.020" material="bone"/>
            {_sites("upper_arm") if drawn else ""}
            <body name="forearm" pos="0 0 -0.30">
              <inertial pos="0 0 -0.12" mass="0.7" diaginertia="0.004 0.004 0.0006"/>
              {_joint("elbow_flexion")}{_joint("forearm_pronation")}
              <geom type="cylinder" fromto="0 0.03 0 0 -0.03 0" size="0.030" material="joint"/>
              <geom type="capsule" fromto="0.012 0 -0.02 0.012 0 -0.25" size="0.011" material="bone"/>
              <geom type="capsule" fromto="-0.012 0 -0.02 -0.012 0 -0.25" size="0.011" material="bone"/>
              {_sites("forearm") if drawn else ""}
              <body name="hand" pos="0 0 -0.26">
                <inertial pos="0 0 -0.08" mass="0.35" diaginertia="0.0012 0.0012 0.0004"/>
                {_joint("wrist_flexion")}{_joint("wrist_deviation")}
                <geom type="sphere" size="0.022" material="joint"/>
                <geom class="palm" type="box" pos="0 -0.003 -0.085" size="0.040 0.012 0.045" material="bone"/>
                <geom type="capsule" fromto="0.027 -0.003 -0.13 0.027 0 -0.175" size="0.010" material="bone"/>
                <geom type="capsule" fromto="0.009 -0.003 -0.13 0.009 0 -0.185" size="0.010" material="bone"/>
                <geom type="capsule" fromto="-0.009 -0.003 -0.13 -0.009 0 -0.180" size="0.010" material="bone"/>
                <geom type="capsule" fromto="-0.027 -0.003 -0.13 -0.027 0 -0.165" size="0.009" material="bone"/>
                <geom type="capsule" fromto="0.036 0 -0.07 0.062 0.004 -0.105" size="0.011" material="bone"/>
                <site name="grip" pos="0 0.012 -0.085" size="0.006" rgba="0 0 0 0"/>
                {_sites("hand") if drawn else ""}
              </body>
            </body>
          </body>
        </body>
      </body>
    </body>"""


def _pulleys() -> Iterable[str]:
    """Every muscle runs over pulleys, one for every joint that it turns: its length is that of what is left."""
    for name, muscle in MUSCLES.items():
        over = "".join(f'<joint joint="{joint}" coef="{-arm / 100}"/>' for joint, arm in muscle.arms.items())
        yield f'<fixed name="{name}">{over}</fixed>'


def _sites(body: str) -> str:
    """Where muscles are drawn from and to."""
    text = ""
    for name, (_, _, _, (begin, at, end, to), _) in MUSCLES.items():
        for part, place, what in ((begin, at, "from"), (end, to, "to")):
            if part == body:
                text += f'<site name="{name}_{what}" pos="{" ".join(str(c / 100) for c in place)}" size="0.004"/>'
    return text


def _lines() -> Iterable[str]:
    for name, muscle in MUSCLES.items():
        yield (
            f'<spatial name="{name}_line" width="{muscle.diameter / 2500}" rgba="0.7 0.3 0.25 1">'
            f'<site site="{name}_from"/><site site="{name}_to"/></spatial>'
        )
