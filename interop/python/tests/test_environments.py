"""Gymnasium environments: its own checker, bits, and the vectorised form."""

import warnings

import numpy as np
import pytest

gymnasium = pytest.importorskip("gymnasium")

import flotor.environments  # noqa: E402  (needs Gymnasium)
from gymnasium.utils.env_checker import check_env  # noqa: E402


def episode(env, seed):
    observation, _ = env.reset(seed=seed)
    rows, generator = [observation], np.random.default_rng(5)
    for _ in range(30):
        observation, reward, *_ = env.step(generator.uniform(-1, 1, env.action_space.shape).astype(np.float32))
        rows += [observation, np.atleast_1d(reward)]
    return b"".join(np.asarray(row).tobytes() for row in rows)


IDS = ["flotor/Spring-v0", "flotor/Palpation-v0"]


@pytest.mark.parametrize("id", IDS)
def test_gymnasium_s_own_checker_passes_without_a_warning(id):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(gymnasium.make(id).unwrapped, skip_render_check=True)


@pytest.mark.parametrize("id", IDS)
def test_equal_seeds_and_actions_give_equal_bits_in_one_environment_and_in_another(id):
    env, other = (gymnasium.make(id) for _ in range(2))
    first = episode(env, 3)
    assert episode(env, 3) == first == episode(other, 3)
    assert episode(env, 4) != first


def test_the_vectorised_environments_are_those_of_one_each():
    many = gymnasium.make_vec("flotor/Spring-v0", num_envs=5, vectorization_mode="vector_entry_point")
    one = flotor.environments.SpringEnv()
    observations, _ = many.reset(seed=3)
    one.reset(seed=1)
    generator = np.random.default_rng(6)
    actions = generator.uniform(-1, 1, (20, 5, 3)).astype(np.float32)
    rows = [many.step(action)[0] for action in actions]
    for action, row in zip(actions, rows):
        assert np.array_equal(one.step(action[2])[0][:9], row[2, :9])
    assert observations.shape == (5, 10) and len(set(observations[:, 9])) == 5, "each has a goal of its own"


def test_an_episode_that_is_over_starts_again():
    many = gymnasium.make_vec("flotor/Spring-v0", num_envs=3, vectorization_mode="vector_entry_point", max_episode_steps=4)
    start, _ = many.reset(seed=3)
    push = np.tile(np.float32([0, 0, -1]), (3, 1))
    for step in range(1, 5):
        observations, rewards, terminated, truncated, _ = many.step(push)
        assert truncated.all() == (step == 4) and not terminated.any()
    assert (observations[:, 8] > 0.1).all() and (rewards < 0).all()
    observations, rewards, _, truncated, _ = many.step(push)
    assert np.array_equal(observations[:, :9], start[:, :9]) and (rewards == 0).all() and not truncated.any()


def test_a_force_near_the_goal_is_rewarded():
    env = flotor.environments.SpringEnv()

    def total(action):
        env.reset(seed=1)
        return sum(env.step(np.float32([0, 0, action]))[1] for _ in range(60))

    assert max(total(-action) for action in (0.2, 0.4, 0.6)) > total(0.0), "a hand at home holds nothing"


def test_the_lump_is_felt_where_it_is_hidden():
    env = flotor.environments.PalpationEnv()
    env.reset(seed=2)
    lump = -env._task.origins_m[0, :2] / flotor.environments.REACH_M

    def press(x, y):
        """Force and reward of a press at a place, after the way there above the surface."""
        for aim in ((0, 0, 0.3), (x, y, 0.3), (x, y, -0.5)):
            for _ in range(20):
                observation, reward, *_ = env.step(np.float32([*aim]))
        return observation[8], reward

    (there_n, there), (elsewhere_n, elsewhere) = press(*lump), press(*(lump - np.sign(lump) * 0.8))
    assert there_n > 1.5 * elsewhere_n > 0 and there > elsewhere


def test_what_is_wrong_is_said():
    with pytest.raises(flotor.FlotorError, match="num_envs = 0"):
        flotor.environments.SpringVectorEnv(0)
    env = flotor.environments.SpringEnv({"device": {"plugin": "simulated"}, "model": [{"plugin": "wall"}]})
    env.reset(seed=1)
    env.step(np.zeros(3))  # nobody guides this hand: the device refuses the aim, and the hand goes its own way
