"""A wall of a MuJoCo scene, touched by the handle: MuJoCo says where its surfaces are, the loop computes the force.

A model of Flotor's plugin `python`: `flotor run scene.toml` calls `contacts` 200 times a second, in a process of its own. MuJoCo's own
contact force would be late by a period; the planes that stand for its surfaces are exact at every tick.
"""

import mujoco
import numpy as np
from flotor_model import Contact

#: Stiffness and damping of what is touched; the scene may set others, `value_1` and `value_2`.
STIFFNESS_N_PER_M, DAMPING_NS_PER_M = 2000.0, 4.0
#: Farthest surface that the loop has to know of, m.
FAR_M = 0.02

SCENE = """
<mujoco>
  <option timestep="0.005"/>
  <worldbody>
    <geom name="wall" type="box" size="0.05 0.05 0.01" pos="0 0 -0.01"/>
    <body name="handle" mocap="true">
      <geom name="tip" type="sphere" size="0.002" pos="0 0 0.002" contype="0" conaffinity="0"/>
    </body>
  </worldbody>
</mujoco>
"""

model = mujoco.MjModel.from_xml_string(SCENE)
data = mujoco.MjData(model)
tip = model.geom("tip").id
normals = {}
others = [geom for geom in range(model.ngeom) if geom != tip]


def contacts(handle):
    """Contacts of the tip with all other geometries within FAR_M."""
    data.mocap_pos[0] = handle.position_m
    x, y, z, w = handle.orientation_xyzw
    data.mocap_quat[0] = w, x, y, z
    mujoco.mj_forward(model, data)
    stiffness, damping = handle.values[0] or STIFFNESS_N_PER_M, handle.values[1] or DAMPING_NS_PER_M
    found, ends = [], np.zeros(6)
    for geom in others:
        gap_m = mujoco.mj_geomDistance(model, data, geom, tip, FAR_M, ends)
        apart = ends[3:] - ends[:3]
        length = np.linalg.norm(apart)
        if length > 0:  # else they just touch, and the normal is that of the last answer
            normals[geom] = tuple(apart / length * np.sign(gap_m))
        if gap_m < FAR_M and geom in normals:
            found.append(Contact(normals[geom], gap_m, stiffness, damping))
    return found
