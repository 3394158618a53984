"""Drives a device through `pyOpenHaptics`, unmodified: open, identify, read a pose that moves, command force, buttons, close and open
again. `flotor lend --api openhaptics -- python3 openhaptics.py [SECONDS]`."""

import sys
import time

import pyOpenHaptics.hd as hd
from pyOpenHaptics.hd_callback import hd_callback
from pyOpenHaptics.hd_device import HapticDevice

SECONDS = float(sys.argv[1]) if len(sys.argv) > 1 else 5.0
calls, heights, columns, buttons = 0, [], [], []


@hd_callback
def callback():
    global calls
    transform = hd.get_transform()
    heights.append(transform[3][1])  # column by column: the last one is the place, mm; y is up
    columns.append(transform[0][0])
    buttons.append(hd.get_buttons())
    hd.get_joints(), hd.get_gimbals()
    hd.set_force([0.1, 0.4, -0.2])
    calls += 1


device = HapticDevice(callback=callback, scheduler_type="async")
assert device.id == 0, device.id
assert hd.get_vendor() and hd.get_model()
began, first = time.monotonic(), calls
time.sleep(SECONDS)
rate_hz = (calls - first) / (time.monotonic() - began)
assert max(heights) - min(heights) > 1.0, "mm: nobody moves the handle"
assert max(map(abs, heights)) < 800.0 and set(buttons) == {0} and min(columns) > 0.9
device.close()
after = calls
time.sleep(0.05)
assert calls == after, "nothing is called after the scheduler stopped"
device = HapticDevice(callback=callback, scheduler_type="async")
time.sleep(0.3)
device.close()
assert calls > after + 150, "it opens again"
print(f"ok: {rate_hz:.1f} calls a second")
