"""Exact rods along the paths of `flotor bench`, what a loop loses of their force, and the gains of `flotor stress` (NumPy, SciPy).

    python3 tests/generators/bench.py tests/data/cases
"""

import sys

import numpy as np
from rod import Spring, conjugate, cross, gains, product, quaternion, rotated, wrenches

TICK_S = 1e-3
# Gauss's two points within a tick.
MOMENTS = 0.5 - 0.5 / np.sqrt(3), 0.5 + 0.5 / np.sqrt(3)
# Ticks of the hand that are compared: of them are means.
EVERY = 50
WRENCH = "fx_n,fy_n,fz_n,tx_nm,ty_nm,tz_nm"


def hand(time_s):
    """Positions and rotation vectors of a hand about a point 4 mm below home."""

    def sines(size, rate):
        return np.array(size)[:, None] * np.sin(2 * np.pi * np.array(rate)[:, None] * time_s)

    middle = np.array([[0.0], [0.0], [-4e-3]])
    return middle + sines((1.5e-3, 1.2e-3, 3e-3), (1.37, 2.11, 1.03)), sines((0.03, 0.025, 0.035), (1.71, 2.53, 2.97))


def through_a_ball(time_s, radius, rates):
    """A motion that spends equal times in equal volumes: cubed radius and polar cosine rise and fall evenly."""
    cube, polar = (1 - np.abs(2 * (rate * time_s % 1) - 1) for rate in rates[:2])
    cosine = 2 * polar - 1
    sine, azimuth = np.sqrt(np.maximum(1 - cosine**2, 0)), 2 * np.pi * rates[2] * time_s
    return radius * np.cbrt(cube) * np.stack([sine * np.cos(azimuth), sine * np.sin(azimuth), cosine])


def workspace(time_s, radius=20e-3, angle=np.radians(7)):
    """12 mm of the device are 20 mm of spring 1, and 7 degrees."""
    return through_a_ball(time_s, radius, (0.618, 1.303, 1.732)), through_a_ball(time_s, angle, (0.541, 1.618, 2.236))


def sensed(position, rotation):
    """What sensors with steps of 2 um and 40 urad show."""
    return tuple(np.round(part / step) * step for part, step in ((position, 2e-6), (rotation, 4e-5)))


def write(name, header, ticks, columns):
    with open(f"{FOLDER}/{name}", "w") as file:
        print(header, file=file)
        for tick, row in zip(ticks, columns.T):
            print(tick, *(f"{number:.13g}" for number in row), sep=",", file=file)


def along_the_hand(ticks):
    """Wrenches, and forces at the moments of the tick after, when a loop that is a tick late renders them."""
    spring = Spring("thesis-1")

    def at(ticks):
        return wrenches(spring, *hand(ticks * TICK_S), parts=2)

    spread = ticks % EVERY == 0
    now, shown = at(ticks), wrenches(spring, *sensed(*hand(ticks * TICK_S)), parts=2)
    held, late = ([at(ticks + delay + moment)[:3] for moment in MOMENTS] for delay in (0, 1))

    def rms(errors):
        return np.sqrt(np.mean([(error[:, spread] ** 2).sum(0) for error in errors]))

    names = ",".join(f"late_{moment}_{axis}_n" for moment in (1, 2) for axis in "xyz")
    write("bench_hand.csv", f"tick,{WRENCH},{names}", ticks, np.vstack([now, *late]))
    losses = [rms([force - now[:3] for force in forces]) for forces in (held, late, [shown[:3]])]
    write("bench_losses.csv", "cases,hold_n,delay_n,sensor_n", ["exact"], np.array([losses]).T)


def through_the_workspace(ticks):
    spring = Spring("thesis-1")
    answers = wrenches(spring, *workspace(ticks * TICK_S), steps=24, parts=20)
    write("bench_workspace.csv", f"tick,{WRENCH}", ticks, answers)


def steepest():
    """Gains at the poses where `flotor stress` finds the largest; turns and torques at 93.9 mm."""
    poses = {
        "thesis-1": ((-1.4757e-3, 1.6691e-3, -19.4847e-3), (0.1177, 0.1004, -0.0994)),
        "slender": (
            (-0.001319459299556911, -0.0016121184686198832, 0.010984089090488851),
            (-0.02264686731514829, -0.011241806264576694, 0.10387331945180402),
        ),
    }
    with open(f"{FOLDER}/stress_gains.csv", "w") as file:
        print("preset,x_m,y_m,z_m,rx_rad,ry_rad,rz_rad,gain_n_per_m,stiffness_n_per_m", file=file)
        for preset, pose in poses.items():
            matrix = gains(Spring(preset), *(np.array(part)[:, None] for part in pose), lever=93.9e-3)[0]
            gain = np.linalg.svd(matrix, compute_uv=False)[0]
            stiffness = np.linalg.eigvalsh(-(matrix + matrix.T) / 2)[-1]
            print(preset, *pose[0], *pose[1], f"{gain:.10g},{stiffness:.10g}", sep=",", file=file)


def blended(spring, has_remainder, position, rotation):
    """Whether the bound of the error in energy.md, or nearness to buckling, gives the rod a share at the default tolerance of 5 mN."""
    chord = position + np.array([[0.0], [0.0], [spring.length]])
    length = np.sqrt((chord**2).sum(0))
    attitude, lower = quaternion(rotation), np.zeros_like(chord)
    lower[2] = 1
    upper = rotated(attitude, lower)
    sway = np.sqrt(((chord / length - (upper + lower) / 2) ** 2).sum(0))
    bow = np.sqrt((((upper - lower) / 2) ** 2).sum(0))
    shortest = np.vstack([cross(lower, upper), 1 + upper[2]])
    rest = product(conjugate(shortest), attitude)
    twist = 2 * np.sin(np.arctan2(rest[2], rest[3]))
    argument = spring.gamma * (spring.length - length) / (4 * spring.alpha)
    argument *= length + spring.gamma / spring.beta * (spring.length - length)
    magnified = 1 + np.pi**2 / (np.pi**2 - argument)
    b, load = (magnified * bow) ** 2, spring.gamma * spring.length**2 / (4 * spring.alpha)
    x = sway**2 + 10 * b + 10 * twist**2
    if has_remainder:
        bound = 0.0058 * x**2 / (x**2 + 0.01) + 7 * twist**4 + 2100 * b**4 + 8.9e-6 * magnified**8 * sway**8
        bound += 0.2 * sway**24 + 6e-5 * (sway * spring.length / length) ** 8
        bound *= 1 + (load / 22) ** 4
    else:
        bound = 4.5 * (sway**2 + b) ** 2 + 4.2 * twist**2 * (sway**2 + b + 0.1)
        bound *= 1 + (load / (4 * np.pi**2)) ** 2
    bound *= spring.alpha / spring.length**2
    root = np.sqrt(np.abs(argument))
    nearness = np.where(argument > 0, np.sinc(root / np.pi), 1)
    pairs = ((chord / length, lower), (chord / length, upper), (lower, upper))
    apart = np.max([np.arccos(np.clip((a * b).sum(0), -1, 1)) for a, b in pairs], 0)
    return ((bound > 0.8 * 5e-3) | (nearness < 0.26)) & (apart < np.radians(78))


def shares():
    """Shares of the ticks through half of a workspace and through all of it in which the default law blends with the rod, per cent."""
    ticks = np.arange(2000)
    with open(f"{FOLDER}/bench_shares.csv", "w") as file:
        print("preset,radius_mm,share_percent", file=file)
        for preset in ("thesis-1", "thesis-2", "thesis-3", "slender"):
            # A slender rod sways in layers at its ends: its law has no remainder.
            spring, has_remainder = Spring(preset), preset != "slender"
            for part in (0.5, 1):
                radius = part * spring.length * 12 / 15
                share = blended(spring, has_remainder, *workspace(ticks * TICK_S, radius, part * np.radians(7))).mean()
                print(f"{preset},{1e3 * radius:.1f},{100 * share:.2f}", file=file)


def chosen(every, length, worst):
    """Evenly spread ticks, and those at which the errors of the laws are largest."""
    return np.unique(np.concatenate([np.arange(0, length, every), worst]))


FOLDER = sys.argv[1]
shares()
steepest()
through_the_workspace(chosen(2, 2000, [767, 773, 785, 927]))
along_the_hand(chosen(EVERY, 30_000, [1292, 4603, 7462, 7481, 7489, 13643, 29738]))
