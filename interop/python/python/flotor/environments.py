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

#: Radius of the lump of ``flotor/Palpation-v0`` and farthest position of its centre from home, m.
LUMP_M, HIDDEN_M = 0.003, 0.004

#: Scene of ``flotor/Palpation-v0``: soft tissue with a hard lump below its surface, at home.
PALPATION: Mapping[str, object] = {
    "title": "Palpation-v0",
    "device": {"plugin": "simulated", "parameters": {"hand_guide": 1}},
    "model": [
        {"name": "tissue", "plugin": "wall", "parameters": {"stiffness_n_per_m": 200, "damping_ns_per_m": 1}},
        {
            "name": "lump",
            "plugin": "wall",
            "parameters": {
                "shape": "sphere",
                "size_mm": LUMP_M * 1e3,
                "height_mm": -1,
                "stiffness_n_per_m": 1000,
                "damping_ns_per_m": 2,
            },
        },
    ],
}

_LOW, _HIGH = [-0.05] * 3 + [-5.0] * 3 + [-40.0] * 3, [0.05] * 3 + [5.0] * 3 + [40.0] * 3
_ACTION = spaces.Box(-1.0, 1.0, (3,), np.float32)


class _Task:
    """Runs of one scene with the numbers of their episodes: what one environment and many have in common."""

    #: Scene by default.
    scene: Mapping[str, object]
    observation_space: spaces.Box

    def __init__(self, count: int, scene: Mapping[str, object] | None, ticks: int) -> None:
        given = _scene.given(scene or self.scene, duration_s=float("inf"), rate_hz=None, seed=0, settings=None)
        self.runs = _flotor.Environments(given, count)
        self.ticks = ticks
        #: Position, velocity and force of each run, device frame.
        self.seen = np.zeros((count, 9))
        #: Origin of what the agent calls its position, in the device frame, m.
        self.origins_m = np.zeros((count, 3))

    def step(self, actions: np.ndarray) -> np.ndarray:
        """Steps all runs; returns the rewards."""
        actions = np.asarray(actions, np.float64).reshape(self.origins_m.shape)
        self.runs.step(np.clip(actions, -1.0, 1.0) * REACH_M + self.origins_m, self.ticks, self.seen)
        return self.rewards() * (self.ticks * 1e-3)

    def reset(self, which: np.ndarray, generator: np.random.Generator) -> None:
        """Restores the start of some runs, and draws their episodes."""
        self.runs.reset(which, self.seen)
        self.draw(which, generator)

    def draw(self, which: np.ndarray, generator: np.random.Generator) -> None:
        raise NotImplementedError

    def rewards(self) -> np.ndarray:
        """Returns the rewards per second."""
        raise NotImplementedError

    def observations(self) -> np.ndarray:
        observed = self.seen.copy()
        observed[:, :3] -= self.origins_m
        return observed


class _Spring(_Task):
    scene = SPRING
    observation_space = spaces.Box(np.array([*_LOW, 0.0]), np.array([*_HIGH, GOALS_N[1]]), dtype=np.float64)

    def __init__(self, count: int, scene: Mapping[str, object] | None, ticks: int) -> None:
        super().__init__(count, scene, ticks)
        self.goals_n = np.zeros(count)

    def draw(self, which: np.ndarray, generator: np.random.Generator) -> None:
        self.goals_n[which] = generator.uniform(*GOALS_N, int(which.sum()))

    def rewards(self) -> np.ndarray:
        return -np.abs(self.seen[:, 8] - self.goals_n)

    def observations(self) -> np.ndarray:
        return np.column_stack([super().observations(), self.goals_n])


class _Palpation(_Task):
    scene = PALPATION
    observation_space = spaces.Box(np.array(_LOW), np.array(_HIGH), dtype=np.float64)

    def draw(self, which: np.ndarray, generator: np.random.Generator) -> None:
        # The tissue is the same everywhere: a lump elsewhere is an origin elsewhere.
        self.origins_m[which, :2] = generator.uniform(-HIDDEN_M, HIDDEN_M, (int(which.sum()), 2))

    def rewards(self) -> np.ndarray:
        return -np.linalg.norm(self.seen[:, :2], axis=1) * 1e3


class _OneEnv(gymnasium.Env):
    metadata = {"render_modes": []}
    task: type[_Task]

    def __init__(
        self, scene: Mapping[str, object] | None = None, ticks: int = TICKS, render_mode: str | None = None
    ) -> None:
        self.observation_space, self.action_space = self.task.observation_space, _ACTION
        self.render_mode = render_mode
        self._task = self.task(1, scene, ticks)

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None):
        super().reset(seed=seed)
        self._task.reset(np.ones(1, bool), self.np_random)
        return self._task.observations()[0], {}

    def step(self, action: np.ndarray):
        reward = self._task.step(action)
        return self._task.observations()[0], float(reward[0]), False, False, {}


class _ManyEnvs(VectorEnv):
    metadata = {"render_modes": [], "autoreset_mode": AutoresetMode.NEXT_STEP}
    task: type[_Task]

    def __init__(
        self,
        num_envs: int = 1,
        scene: Mapping[str, object] | None = None,
        ticks: int = TICKS,
        max_episode_steps: int = 100,
        render_mode: str | None = None,
    ) -> None:
        self.num_envs, self.render_mode = num_envs, render_mode
        self.single_observation_space, self.single_action_space = self.task.observation_space, _ACTION
        self._task = self.task(num_envs, scene, ticks)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(_ACTION, num_envs)
        self._most = max_episode_steps
        self._steps = np.zeros(num_envs, int)

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None):
        super().reset(seed=seed)
        self._task.reset(np.ones(self.num_envs, bool), self.np_random)
        self._steps[:] = 0
        return self._task.observations(), {}

    def step(self, actions: np.ndarray):
        over = self._steps >= self._most
        rewards = self._task.step(actions)
        self._steps += 1
        if over.any():
            self._task.reset(over, self.np_random)
            self._steps[over], rewards[over] = 0, 0.0
        terminated = np.zeros(self.num_envs, bool)
        return self._task.observations(), rewards, terminated, self._steps >= self._most, {}


class SpringEnv(_OneEnv):
    """Hold a force on a compression spring.

    Observation (10,): position (m), velocity (m/s) and force on the hand (N) along x, y, z of the device, and the force along z to
    hold (N). Action (3,), -1 to 1: where the hand aims, in :data:`REACH_M` from home. Reward: minus the error of the force (N s).
    A step is :data:`TICKS` ticks of the loop. Equal seeds and actions give equal bits.
    """

    task = _Spring


class SpringVectorEnv(_ManyEnvs):
    """Many :class:`SpringEnv`, stepped by one call on all cores; an episode that is over starts again in the next step."""

    task = _Spring


class PalpationEnv(_OneEnv):
    """Find a hard lump below the surface of soft tissue by pressing.

    Observation (9,): position (m), velocity (m/s) and force on the hand (N) along x, y, z, from an origin that is drawn: the lump is
    up to :data:`HIDDEN_M` from it along x and y, 1 mm below the surface. Action as of :class:`SpringEnv`. Reward: minus the distance of the
    handle from the lump along the surface (mm s).
    """

    task = _Palpation


class PalpationVectorEnv(_ManyEnvs):
    """Many :class:`PalpationEnv`, as :class:`SpringVectorEnv`."""

    task = _Palpation


def register() -> None:
    """Registers the environments; Gymnasium calls this function by the entry point of the wheel."""
    for name in ("Spring", "Palpation"):
        if f"flotor/{name}-v0" not in gymnasium.registry:
            gymnasium.register(
                id=f"flotor/{name}-v0",
                entry_point=f"flotor.environments:{name}Env",
                vector_entry_point=f"flotor.environments:{name}VectorEnv",
                max_episode_steps=100,
            )


register()
