"""Environments of reinforcement learning (Gymnasium) on the simulated device: the hand that holds the handle is the agent's.

Import this module, or name it in Gymnasium's id: ``gymnasium.make("flotor/Spring-v0")`` finds it by itself once the wheel is installed.

    >>> import gymnasium
    >>> env = gymnasium.make("flotor/Spring-v0")
    >>> observation, info = env.reset(seed=1)

``gymnasium.make_vec("flotor/Spring-v0", num_envs=64)`` steps all environments in one call, on all cores.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space

from . import _flotor, _scene

#: Farthest aim of the hand from home along each axis, m.
REACH_M = 0.006
#: Ticks of the loop in a step, 1 ms each.
TICKS = 20
#: Forces along z that the agent has to hold, N.
GOALS_N = (0.5, 3.0)

#: Scene of ``flotor/Spring-v0``: the compression spring, pressed by a guided hand.
SPRING: Mapping[str, object] = {
    "title": "Spring-v0",
    "device": {"plugin": "simulated", "parameters": {"hand_guide": 1}},
    "model": [{"name": "spring", "plugin": "spring"}],
}

_OBSERVATION = spaces.Box(
    low=np.array([-0.05] * 3 + [-5.0] * 3 + [-40.0] * 3 + [0.0]),
    high=np.array([0.05] * 3 + [5.0] * 3 + [40.0] * 3 + [GOALS_N[1]]),
    dtype=np.float64,
)
_ACTION = spaces.Box(-1.0, 1.0, (3,), np.float32)


class _Tasks:
    """Runs with their goals: what one environment and many have in common."""

    def __init__(self, count: int, scene: Mapping[str, object], ticks: int) -> None:
        given = _scene.given(scene, duration_s=float("inf"), rate_hz=None, seed=0, settings=None)
        self.runs = _flotor.Environments(given, count)
        self.ticks = ticks
        self.seen = np.zeros((count, 9))
        self.goals_n = np.zeros(count)

    def observations(self) -> np.ndarray:
        return np.column_stack([self.seen, self.goals_n])

    def step(self, actions: np.ndarray) -> np.ndarray:
        """Steps all runs; returns the rewards: minus the error of the force, N, times the length of the step, s."""
        aims_m = np.clip(np.asarray(actions, np.float64).reshape(len(self.goals_n), 3), -1.0, 1.0) * REACH_M
        self.runs.step(aims_m, self.ticks, self.seen)
        return -np.abs(self.seen[:, 8] - self.goals_n) * (self.ticks * 1e-3)

    def reset(self, which: np.ndarray, generator: np.random.Generator) -> None:
        self.runs.reset(which, self.seen)
        self.goals_n[which] = generator.uniform(*GOALS_N, int(which.sum()))


class SpringEnv(gymnasium.Env):
    """Hold a force on a compression spring.

    Observation (10,): position (m), velocity (m/s) and force on the hand (N) along x, y, z of the device, and the force along z to
    hold (N). Action (3,), -1 to 1: where the hand aims, in :data:`REACH_M` from home. Reward: minus the error of the force (N s).
    A step is :data:`TICKS` ticks of the loop. Equal seeds and actions give equal bits.
    """

    metadata = {"render_modes": []}

    def __init__(self, scene: Mapping[str, object] = SPRING, ticks: int = TICKS, render_mode: str | None = None) -> None:
        self.observation_space, self.action_space = _OBSERVATION, _ACTION
        self.render_mode = render_mode
        self._tasks = _Tasks(1, scene, ticks)

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None):
        super().reset(seed=seed)
        self._tasks.reset(np.ones(1, bool), self.np_random)
        return self._tasks.observations()[0], {}

    def step(self, action: np.ndarray):
        reward = self._tasks.step(action)
        return self._tasks.observations()[0], float(reward[0]), False, False, {}


class SpringVectorEnv(VectorEnv):
    """Many :class:`SpringEnv`, stepped by one call on all cores; an episode that is over starts again in the next step."""

    metadata = {"render_modes": [], "autoreset_mode": AutoresetMode.NEXT_STEP}

    def __init__(
        self,
        num_envs: int = 1,
        scene: Mapping[str, object] = SPRING,
        ticks: int = TICKS,
        max_episode_steps: int = 100,
        render_mode: str | None = None,
    ) -> None:
        self.num_envs, self.render_mode = num_envs, render_mode
        self.single_observation_space, self.single_action_space = _OBSERVATION, _ACTION
        self.observation_space = batch_space(_OBSERVATION, num_envs)
        self.action_space = batch_space(_ACTION, num_envs)
        self._tasks = _Tasks(num_envs, scene, ticks)
        self._most = max_episode_steps
        self._steps = np.zeros(num_envs, int)

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None):
        super().reset(seed=seed)
        self._tasks.reset(np.ones(self.num_envs, bool), self.np_random)
        self._steps[:] = 0
        return self._tasks.observations(), {}

    def step(self, actions: np.ndarray):
        over = self._steps >= self._most
        rewards = self._tasks.step(actions)
        self._steps += 1
        if over.any():
            self._tasks.reset(over, self.np_random)
            self._steps[over], rewards[over] = 0, 0.0
        terminated = np.zeros(self.num_envs, bool)
        return self._tasks.observations(), rewards, terminated, self._steps >= self._most, {}


def register() -> None:
    """Registers the environments; Gymnasium calls this function by the entry point of the wheel."""
    if "flotor/Spring-v0" in gymnasium.registry:
        return
    gymnasium.register(
        id="flotor/Spring-v0",
        entry_point="flotor.environments:SpringEnv",
        vector_entry_point="flotor.environments:SpringVectorEnv",
        max_episode_steps=100,
    )


register()
