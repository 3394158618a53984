"""Drives a device through `forcedimension-core`, unmodified: open, identify, read a pose that moves, command force and read it back,
limits, errors, regulation, close and open again. `flotor lend --api dhd -- python3 dhd.py [SECONDS]`."""

import math
import sys
import time

from forcedimension_core import dhd, drd
from forcedimension_core.containers import DOFFloat, Status, Vec3

SECONDS = float(sys.argv[1]) if len(sys.argv) > 1 else 5.0


def norm(vector):
    return math.sqrt(sum(part * part for part in vector))


assert dhd.getDeviceCount() >= 1 and dhd.getAvailableCount() >= 1
version = dhd.getSDKVersion()
assert (version.major, version.minor) >= (3, 16), version
assert dhd.close() == -1 and dhd.errorGetLast() == 5
assert dhd.stop() == 0, "a program may stop what is not open until that succeeds"

device = dhd.open()
assert device == 0, dhd.errorGetLastStr()
assert dhd.openID(0) == 0, "open already"
assert dhd.getSystemType(device) == 104 and dhd.getSystemName(device)
assert dhd.getSerialNumber(device) >= 0
assert dhd.hasBase(device) and dhd.hasWrist(device) and not dhd.hasGripper(device)

# The error stays until the next one, and every failing getter leaves something to read.
gap = [1.0]
assert dhd.expert.getJointAngles(DOFFloat(), device) == -1 and dhd.errorGetLast() == 9
dhd.expert.enableExpertMode()
assert dhd.expert.getJointAngles(DOFFloat(), device) == 0

assert dhd.enableForce(True, device) == 0
position, velocity, force = Vec3(), Vec3(), Vec3()
heights, loops, began = [], 0, time.monotonic()
while time.monotonic() - began < SECONDS:
    assert dhd.getPosition(position, device) >= 0
    assert dhd.getLinearVelocity(velocity, device) >= 0
    assert all(math.isfinite(part) for part in [*position, *velocity]) and norm(position) < 0.6
    heights.append(position[2])
    assert dhd.setForce((0.5, -0.25, 0.3), device) in (0, 2)
    assert 0 <= dhd.getButtonMask(device) < 2**32 and dhd.getButton(0, device) in (0, 1)
    loops += 1
rate_hz = loops / (time.monotonic() - began)
assert max(heights) - min(heights) > 1e-3, "nobody moves the handle"
assert dhd.getForce(force, device) >= 0
assert norm([force[0] - 0.5, force[1] + 0.25, force[2] - 0.3]) < 1e-12, force
assert 0.9 < dhd.getComFreq(device) < 1.1, dhd.getComFreq(device)

# Ten thousand newtons, a limit of one's own, and what is no number.
for _ in range(50):
    assert dhd.setForce((1e4, 0.0, 0.0), device) == 2
dhd.getForce(force, device)
assert 7.9 < norm(force) <= 8.0 + 1e-9, force
assert dhd.setMaxForce(1.0, device) == 0 and dhd.getMaxForce(device) == 1.0
for _ in range(50):
    assert dhd.setForce((0.0, 5.0, 0.0), device) == 2
dhd.getForce(force, device)
assert norm(force) <= 1.0 + 1e-9, force
dhd.setMaxForce(-1.0, device)
assert dhd.getMaxForce(device) == -1.0
assert dhd.setForce((math.nan, 0.0, 0.0), device) == -1 and dhd.errorGetLast() == 21
assert dhd.getPosition(position, device) >= 0 and all(map(math.isfinite, position))

status = Status()
assert dhd.getStatus(status, device) == 0 and status.force == 1 and status.connected == 1
assert dhd.stop(device) == 0
dhd.setForce((2.0, 0.0, 0.0), device)
dhd.setForce((2.0, 0.0, 0.0), device)
dhd.getForce(force, device)
assert norm(force) == 0.0, "nothing after a stop"

# Regulation moves the handle against the hand that holds it: towards the place, and not all the way, until the timeout.
assert drd.isInitialized(device) and drd.start(device) == 0 and drd.isRunning(device)
assert drd.moveToPos((0.0, 0.003, 0.0), True, device) == -1 and dhd.errorGetLast() == 7
dhd.getPosition(position, device)
assert position[1] > 0.0003, position
assert drd.stop(True, device) == 0 and not drd.isRunning(device)
assert drd.moveToPos((0.0, 0.0, 0.0), False, device) == -1 and dhd.errorGetLast() == 22

assert dhd.close(device) == 0 and dhd.close(device) == -1
assert dhd.open() == 0 and dhd.getPosition(position) >= 0 and dhd.close() == 0
print(f"ok: {rate_hz:.1f} loops a second")
