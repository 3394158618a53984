"""Impedance between the handle and the follower, for Flotor's plugin `python`: the loop evaluates it at every tick.

`value_1` to `value_3`: where the follower is, in the frame of the handle, m; `value_4`: stiffness, N/m, 0 before the first feedback.
"""

import math

from flotor_model import Field

#: Time constant with which the spring follows the follower: feedback arrives 30 times a second, and a hand would feel its steps.
FOLLOW_S = 0.02
#: Stiffness that the spring gains in a second, N/m.
RISE_N_PER_M_S = 1000.0

centre_m, stiffness_n_per_m = [0.0, 0.0, 0.0], 0.0


def reset():
    global stiffness_n_per_m
    stiffness_n_per_m = 0.0


def contacts(handle):
    global stiffness_n_per_m
    *follower_m, goal = handle.values
    part = 1 - math.exp(-handle.dt_s / FOLLOW_S)
    for axis, to_m in enumerate(follower_m):
        # The first feedback is where the spring begins: it is slack then.
        centre_m[axis] += (to_m - centre_m[axis]) * (part if stiffness_n_per_m > 0 else 1)
    step = RISE_N_PER_M_S * handle.dt_s
    stiffness_n_per_m += min(max(goal - stiffness_n_per_m, -step), step)
    force_n = [stiffness_n_per_m * (c - p) for c, p in zip(centre_m, handle.position_m)]
    rows = [[stiffness_n_per_m if row == column else 0.0 for column in range(6)] if row < 3 else [0.0] * 6 for row in range(6)]
    return Field(force_n, stiffness=rows)
