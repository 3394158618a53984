"""Your name: a soft block, too slow for the loop. Replace `solve` by your solver, run the scene, and feel the difference.

The loop runs a thousand times a second; `contacts` runs at the rate that the scene gives, in an interpreter of its own. It gets where the
handle is (m, z up, home at the origin) and answers with the surface under the handle. In every tick the loop computes the force of
this surface, which pushes the hand and never pulls.
"""

from flotor_model import Answer, Contact

#: Height of a layer, m, and for each layer the force that halves it, N.
LAYER_M, HALF_N = 0.0075, (10.0, 20.0, 40.0, 80.0)
#: Largest depth passed to the solver, m. Below, the stiffness is constant.
DEEPEST_M = 0.012
#: Distance for which an answer is valid, m: within it the stiffness changes by less than a tenth.
VALID_M = 0.0005


def solve(depth_m):
    """Returns force (N) and stiffness (N/m) at a depth: a layer of height h gives way by h F / (s + F), and Newton's method finds the
    force F that all layers have when together they give way by the depth."""
    force_n = 0.0
    for _ in range(50):
        yielded_m = sum(LAYER_M * force_n / (half_n + force_n) for half_n in HALF_N)
        slope = sum(LAYER_M * half_n / (half_n + force_n) ** 2 for half_n in HALF_N)
        force_n += (depth_m - yielded_m) / slope
    return force_n, 1 / slope


def contacts(handle):
    """Returns the plane whose spring has force and stiffness of the block at this depth; above the block, its surface."""
    height_m = handle.position_m[2]
    depth_m = min(max(-height_m, 0.0), DEEPEST_M)
    force_n, stiffness_n_per_m = solve(depth_m)
    gap_m = height_m + depth_m - force_n / stiffness_n_per_m
    return Answer((Contact((0, 0, 1), gap_m, stiffness_n_per_m, damping_ns_per_m=3),), valid_m=VALID_M)
