"""Torques by which a helix of wire resists compression without a turn of its ends, from its elastic energy (NumPy).

    python3 tests/generators/wire.py > tests/data/cases/wire_twist.csv

A wire of constant length l winds by Theta about the axis over the height h, with pitch angle a, sin a = h/l: its curvature is
cos(a) Theta/l and its torsion sin(a) Theta/l (Love 1927, article 270). The energy is l/2 (EI d(curvature)^2 + GJ d(torsion)^2), the torque its
derivative by Theta at constant h. Spring 1 of the thesis; scaled, with rigidities that give its stated gamma.
"""

import numpy as np

YOUNG, SHEAR = 203395e6, 75842e6
LENGTH, WIRE, COIL, COILS, GAMMA = 25e-3, 0.63e-3, 6.07e-3, 11.8, 16.97


def torque(compression):
    bend, twist = YOUNG * np.pi * WIRE**4 / 64, SHEAR * np.pi * WIRE**4 / 32
    winding = 2 * np.pi * COILS
    wire = np.hypot(winding * COIL / 2, LENGTH)

    def shape(height):
        sine = height / wire
        return np.array([np.sqrt(1 - sine**2), sine]) * winding / wire

    bent = shape(LENGTH * (1 - compression))
    # The derivative of curvature and torsion by Theta is each over Theta.
    return wire * (np.array([bend, twist]) * (bent - shape(LENGTH)) * bent / winding).sum()


physical = SHEAR * WIRE**4 * LENGTH / (8 * COILS * COIL**3)
print("compression,torque_nmm,scaled_nmm")
for compression in (0.2, 0.7):
    each = 1e3 * torque(compression)
    print(f"{compression},{each:.5f},{each * GAMMA / physical:.5f}")
