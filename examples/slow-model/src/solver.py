# A bar of gel, 30 mm long and 4 cm² in cross-section, twice as stiff at its foot as at its top, compressed along its axis.
# Twenty elements of neo-Hookean material; Newton's method finds the positions at which all forces are in balance.
# Reads lines "DEPTH_M MODULUS_PA", and answers each with a line "FORCE_N STIFFNESS_N_PER_M".
import sys

LENGTH_M, AREA_M2, ELEMENTS = 0.03, 4e-4, 20
SIZE_M = LENGTH_M / ELEMENTS


def solve(depth_m, modulus_pa):
    stretch = [1 - depth_m / LENGTH_M] * ELEMENTS
    for _ in range(50):
        moduli = [modulus_pa * (2 - (i + 0.5) / ELEMENTS) for i in range(ELEMENTS)]
        force = [AREA_M2 * g * (s**-2 - s) for g, s in zip(moduli, stretch)]
        slope = [AREA_M2 * g * (1 + 2 * s**-3) / SIZE_M for g, s in zip(moduli, stretch)]
        # Elements in series: their compliances add up, and each gives way until all carry the same force.
        stiffness = 1 / sum(1 / k for k in slope)
        common = stiffness * sum(f / k for f, k in zip(force, slope))
        change = [(f - common) / k / SIZE_M for f, k in zip(force, slope)]
        stretch = [s + d for s, d in zip(stretch, change)]
        if max(abs(d) for d in change) < 1e-12:
            break
    return common, stiffness


for line in sys.stdin:
    depth_m, modulus_pa = map(float, line.split())
    print(*solve(depth_m, modulus_pa), flush=True)
