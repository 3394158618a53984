"""Flotor's devices as teleoperators of LeRobot: the handle leads, and the hand feels the follower.

LeRobot finds this package by its name: `--teleop.type=flotor`. Between the frames of LeRobot (30 a second) Flotor's loop renders a spring
between the handle and the follower at 1 kHz, inside the limits of the scene; it fades if the program stops.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import flotor
from lerobot.teleoperators.config import TeleoperatorConfig
from lerobot.teleoperators.teleoperator import Teleoperator

__all__ = ["FlotorTeleoperator", "FlotorTeleoperatorConfig"]

_AXES = ("x", "y", "z")


@TeleoperatorConfig.register_subclass("flotor")
@dataclass
class FlotorTeleoperatorConfig(TeleoperatorConfig):
    """Device, and the spring between handle and follower."""

    #: Plugin of the device, such as "simulated", "falcon" or "maglev".
    device: str = "simulated"
    #: Parameters of the device, by their ids.
    parameters: dict[str, str] = field(default_factory=dict)
    #: Metres of the follower for a metre of the handle.
    motion_scale: float = 10.0
    #: Stiffness of the spring between handle and follower, N/m at the handle.
    stiffness_n_per_m: float = 300.0
    #: Rate of the spring's centre, Hz; its force is computed at every tick.
    rate_hz: float = 200.0
    #: Largest force along each axis, N.
    force_n: float = 5.0
    #: Recording of every tick (MCAP).
    record: str | None = None


class FlotorTeleoperator(Teleoperator):
    """Leader with force feedback.

    Actions: where the follower should go (``x``, ``y``, ``z``, m), the opening of the grip (``gripper``, 0 without one), and tick and
    scheduled time (s) of the pose. Feedback: where the follower is (``x``, ``y``, ``z``, m).
    """

    config_class = FlotorTeleoperatorConfig
    name = "flotor"

    def __init__(self, config: FlotorTeleoperatorConfig) -> None:
        super().__init__(config)
        self.config = config
        self._run: flotor.Run | None = None

    def scene(self) -> dict[str, object]:
        """Returns the scene: the device, and the spring."""
        model = {
            "name": "spring",
            "plugin": "python",
            "parameters": {"file": Path(__file__).with_name("impedance.py")},
            "field": {"rate_hz": self.config.rate_hz},
        }
        return {
            "title": f"LeRobot teleoperation {self.id or ''}".strip(),
            "device": {"plugin": self.config.device, "parameters": dict(self.config.parameters)},
            "model": [model],
            "limits": {"force_n": self.config.force_n},
        }

    @property
    def action_features(self) -> dict[str, type]:
        return dict.fromkeys((*_AXES, "gripper", "tick", "time_s"), float)

    @property
    def feedback_features(self) -> dict[str, type]:
        return dict.fromkeys(_AXES, float)

    @property
    def is_connected(self) -> bool:
        return self._run is not None and self._run.running

    @property
    def is_calibrated(self) -> bool:
        return True

    def calibrate(self) -> None:
        """Does nothing: Flotor's devices are calibrated (`flotor calibrate`)."""

    def configure(self) -> None:
        """Does nothing: the scene has all settings."""

    def connect(self, calibrate: bool = True) -> None:
        if self.is_connected:
            raise RuntimeError("the teleoperator is already connected")
        self._run = flotor.open(self.scene(), record=self.config.record)

    def get_action(self) -> dict[str, float]:
        state = self._connected().state
        action = {axis: float(metre) * self.config.motion_scale for axis, metre in zip(_AXES, state.position_m)}
        return {**action, "gripper": state.grip_opening or 0.0, "tick": float(state.tick), "time_s": state.time_s}

    def send_feedback(self, feedback: dict[str, Any]) -> None:
        follower_m = [float(feedback[axis]) / self.config.motion_scale for axis in _AXES]
        values = {f"spring.value_{number}": metre for number, metre in enumerate(follower_m, 1)}
        self._connected().set({**values, "spring.value_4": self.config.stiffness_n_per_m}, at_once=True)

    def disconnect(self) -> None:
        """Ends the run in order: the force fades."""
        run, self._run = self._run, None
        if run is not None:
            run.close()

    def _connected(self) -> flotor.Run:
        if self._run is None:
            raise RuntimeError("the teleoperator is not connected: call `connect` first")
        if not self._run.running:
            self._run.close()  # raises the reason
        return self._run
