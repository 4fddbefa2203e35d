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
LIGHT = """
  <visual>
    <headlight ambient="0.42 0.42 0.42" diffuse="0.35 0.35 0.35" specular="0 0 0"/>
    <quality shadowsize="2048"/><global offwidth="960" offheight="640"/>
    <map znear="0.02"/>
  </visual>
  <asset>
    <texture name="sky" type="skybox" builtin="gradient" rgb1="0.93 0.95 0.97" rgb2="0.72 0.78 0.84" width="64"
             height="384"/>
    <texture name="floor" type="2d" builtin="checker" rgb1="0.80 0.81 0.83" rgb2="0.74 0.75 0.77" width="256"
             height="256"/>
    <material name="floor" texture="floor" texrepeat="8 8" reflectance="0.05"/>
    <material name="bone" rgba="0.86 0.87 0.89 1" specular="0.4"/>
    <material name="frame" rgba="0.25 0.28 0.33 1"/>
    <material name="joint" rgba="0.35 0.39 0.45 1"/>
    <material name="skin" rgba="0.87 0.68 0.55 1"/>
    <material name="shirt" rgba="0.24 0.45 0.62 1"/>
    <material name="trousers" rgba="0.22 0.24 0.30 1"/>
    <material name="hair" rgba="0.25 0.17 0.12 1"/>
  </asset>
"""


@cache
def world(drawn: bool = False) -> Any:
    """The compiled model. drawn: with muscles and a partner to look at; neither changes how anything moves."""
    import mujoco

    return mujoco.MjModel.from_xml_string(written(drawn))


def written(drawn: bool) -> str:
    """Its MJCF."""
    return f"""<mujoco model="handshake">
  <compiler angle="radian" autolimits="true"/>
  <option timestep="{STEP}" integrator="implicitfast"/>
  {LIGHT}
  <default>
    <geom contype="0" conaffinity="0"/>
    <default class="palm">
      <geom contype="1" conaffinity="1" friction="0.6 0.01 0.001" solref="0.01 1" solimp="0.8 0.95 0.004"/>
    </default>
  </default>
  <worldbody>
    <light pos="0.3 -2.5 3.2" dir="0 0.7 -0.7" diffuse="0.55 0.55 0.52" castshadow="true"/>
    <light pos="0.6 2.5 3" dir="0 -0.6 -0.7" diffuse="0.2 0.2 0.22" castshadow="false"/>
    <geom name="floor" type="plane" size="4 4 0.1" material="floor"/>
    <camera name="side" pos="0.62 -2.15 1.52" xyaxes="1 0 0 0 0.14 0.99" fovy="42"/>
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
    {_partner() if drawn else ""}
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


def _partner() -> str:
    """Somebody to look at, who stands; the arm is put where the hand is."""
    return """
    <body name="partner" pos="1.22 0.05 0">
      <geom type="capsule" fromto="0 0.09 0.10 0.0 0.085 0.85" size="0.075" material="trousers"/>
      <geom type="capsule" fromto="0 -0.09 0.10 0.0 -0.085 0.85" size="0.075" material="trousers"/>
      <geom type="ellipsoid" pos="-0.05 0.10 0.04" size="0.13 0.05 0.045" material="hair"/>
      <geom type="ellipsoid" pos="-0.05 -0.10 0.04" size="0.13 0.05 0.045" material="hair"/>
      <geom type="ellipsoid" pos="0 0 1.15" size="0.115 0.185 0.31" material="shirt"/>
      <geom type="capsule" fromto="0.0 0.17 1.38 0.0 -0.17 1.38" size="0.060" material="shirt"/>
      <geom type="capsule" fromto="0 0 1.44 0 0 1.52" size="0.048" material="skin"/>
      <geom type="ellipsoid" pos="-0.01 0 1.63" size="0.095 0.078 0.12" material="skin"/>
      <geom type="ellipsoid" pos="0.015 0 1.665" size="0.095 0.083 0.105" material="hair"/>
      <geom type="ellipsoid" pos="-0.105 0 1.62" size="0.018 0.012 0.02" material="skin"/>
      <geom type="capsule" fromto="0 -0.22 1.37 0.02 -0.25 1.09" size="0.043" material="shirt"/>
      <geom type="capsule" fromto="0.02 -0.25 1.09 -0.04 -0.25 0.85" size="0.034" material="skin"/>
    </body>
    <body name="partner_upper" mocap="true" pos="1.22 0.27 1.2">
      <geom type="capsule" fromto="0 0 -0.14 0 0 0.14" size="0.045" material="shirt"/>
    </body>
    <body name="partner_lower" mocap="true" pos="1.22 0.27 0.95">
      <geom type="capsule" fromto="0 0 -0.125 0 0 0.125" size="0.035" material="skin"/>
    </body>"""
