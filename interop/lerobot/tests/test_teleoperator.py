"""LeRobot, as it comes from the package index, teleoperates a simulated follower through a wall with a Flotor device."""

import sys
import time

import numpy as np
import pytest

pytest.importorskip("lerobot")

import flotor  # noqa: E402
from lerobot.teleoperators.utils import make_teleoperator_from_config  # noqa: E402
from lerobot.utils.import_utils import register_third_party_plugins  # noqa: E402

#: Seconds of a run; ten minutes in the full tests.
SECONDS = float(__import__("os").environ.get("FLOTOR_TELEOPERATION_S", "10"))
RATE_HZ, SCALE, WALL_N_PER_M = 30, 10.0, 2000.0
#: A hand that moves the handle 4 mm up and down, in and out of the wall of the follower.
HAND = {"hand": "oscillate", "hand_amplitude_mm": "4", "hand_frequency_hz": "0.7"}


class Follower:
    """Point mass of 1 kg that a controller moves to its goal; below z = 0 is a wall of 2 kN/m."""

    def __init__(self):
        self.position_m, self.velocity = np.zeros(3), np.zeros(3)

    def send_action(self, goal_m, seconds):
        for _ in range(int(seconds * 1e3)):
            force_n = 400.0 * (goal_m - self.position_m) - 40.0 * self.velocity
            force_n[2] += WALL_N_PER_M * max(-self.position_m[2], 0.0)
            self.velocity += force_n * 1e-3
            self.position_m += self.velocity * 1e-3


@pytest.fixture
def teleoperator(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    register_third_party_plugins()
    module = sys.modules["lerobot_teleoperator_flotor"]  # found by its name
    config = module.FlotorTeleoperatorConfig(
        id="test", calibration_dir=tmp_path, parameters=HAND, motion_scale=SCALE, record=str(tmp_path / "run.mcap")
    )
    return make_teleoperator_from_config(config)


def test_a_follower_behind_a_wall_is_felt_and_every_frame_is_of_a_tick(teleoperator, tmp_path):
    follower, frames = Follower(), []
    teleoperator.connect()
    assert teleoperator.is_connected and teleoperator.is_calibrated
    started = time.perf_counter()
    for frame in range(int(SECONDS * RATE_HZ)):
        action = teleoperator.get_action()
        assert action.keys() == teleoperator.action_features.keys()
        frames.append((time.perf_counter(), *action.values()))
        follower.send_action(np.array([action[axis] for axis in "xyz"]), 1 / RATE_HZ)
        teleoperator.send_feedback(dict(zip("xyz", follower.position_m)))
        time.sleep(max(started + (frame + 1) / RATE_HZ - time.perf_counter(), 0))
    teleoperator.disconnect()
    assert not teleoperator.is_connected

    recording, frames = flotor.read_recording(tmp_path / "run.mcap"), np.array(frames)
    rows = np.searchsorted(recording["tick"], frames[:, 5])
    assert recording.finished and np.array_equal(recording["tick"][rows], frames[:, 5].astype(np.uint64)), "no tick is lost"
    assert np.allclose(recording["time_ns"][rows] * 1e-9, frames[:, 6], atol=1e-12)
    assert np.array_equal(recording["position_m"][rows] * SCALE, frames[:, 1:4])
    clock_s = frames[:, 0] - frames[:, 6]
    print(f"offset of the clocks: spread {np.ptp(np.percentile(clock_s, [5, 95])) * 1e6:.0f} us")

    force_n, z_m = recording["commanded_force_n"], recording["position_m"][:, 2]
    steps_n = np.abs(np.diff(force_n, axis=0)).max()
    pressed = (z_m < -2e-3) & (recording["time_ns"] > 2e9)
    given_j = np.cumsum(np.sum(force_n[:-1] * np.diff(recording["position_m"], axis=0), axis=1))
    print(
        f"force in the wall {force_n[pressed, 2].mean():.2f} N, largest step {steps_n:.3f} N, energy out of the port "
        f"{max(given_j.max(), 0) * 1e3:.3f} mJ at most, {given_j[-1] * 1e3:.3f} mJ at the end"
    )
    assert force_n[pressed, 2].mean() > 0.2, "the wall of the follower is felt"
    assert steps_n < 0.3 and given_j.max() < 1e-4, "no jump, and no energy but what the hand gave"


def test_without_a_connection_it_says_so(teleoperator):
    for call in (teleoperator.get_action, lambda: teleoperator.send_feedback({"x": 0, "y": 0, "z": 0})):
        with pytest.raises(RuntimeError, match="not connected"):
            call()
