"""Bias, error and length of the estimators of a threshold, by a simulation of its own (NumPy).

    python3 tests/generators/estimators.py > tests/data/cases/estimators.csv

The observer compares the difference, in deviations of the noise, plus a normal number with a criterion: above it the answer is
correct, below its negative wrong, between them "I don't know". The threshold is the difference at which the correct answers and half of
the undecided ones are 75 %. Two tracks make an estimate.

- thesis: weighted up-down (Kaernbach 2001), the mean difference from the 4th to the 8th reversal, mean of both tracks.
- map: the most likely observer of the same trials of both tracks, on a grid; the density is that over 1 / threshold.
- questplus: 18 trials, each at the difference with the largest mutual information of answer and observer (Watson 2017, on his grid);
  the geometric mean of the threshold over the posterior, by quadrature, mean of both tracks.
"""

import math

import numpy as np

ESTIMATES, BLOCK = 20_000, 2_000
TARGET, LAPSE = 0.75, 0.005
MEDIAN, SPREAD = 0.14, 0.7
MODE, MODE_SPREAD = 0.75, 0.5
OBSERVERS = [(1.0, 0.1114), (1.0, 0.1357), (0.0, 0.142), (0.25, 0.142), (0.5, 0.142), (0.75, 0.142), (1.0, 0.142)]
CORRECT, WRONG, UNSURE = range(3)

normal_below = np.vectorize(lambda x: 0.5 * math.erfc(-x / math.sqrt(2)))
random = np.random.default_rng(20_171)


def attentive(x, criterion):
    """Shares of correct, wrong and undecided answers at a difference in deviations of the noise."""
    correct, wrong = normal_below(x - criterion), normal_below(-x - criterion)
    return np.array([correct, wrong, 1 - correct - wrong])


def sensitivity(criterion):
    """Threshold of an attentive observer, in deviations of the noise, by bisection."""
    low, high = 0.0, 20.0
    for _ in range(100):
        middle = (low + high) / 2
        correct, _, unsure = attentive(middle, criterion)
        low, high = (middle, high) if correct + unsure / 2 < TARGET else (low, middle)
    return high


def answers(delta, threshold, criterion, lapse):
    """Shares of the answers of an observer who guesses in a share of the trials."""
    guesses = np.array([[0.5], [0.5], [0.0]])
    return (1 - lapse) * attentive(delta / threshold * sensitivity(criterion), criterion) + lapse * guesses


class Grid:
    """Observers with their log prior over the logarithm of the threshold and the criterion, and the logarithm of each answer's share."""

    def __init__(self, z, criteria, deltas, weights=None):
        weights = np.ones(len(criteria)) if weights is None else weights
        self.logs = np.repeat(math.log(MEDIAN) + SPREAD * z, len(criteria))
        self.shape = (len(z), len(criteria))
        criterion = np.tile(criteria, len(z))
        self.log_prior = -0.5 * (np.repeat(z, len(criteria)) ** 2 + ((criterion - MODE) / MODE_SPREAD) ** 2)
        self.log_prior += np.log(np.tile(weights, len(z)))
        unit = {c: sensitivity(c) for c in criteria}
        scaled = deltas[None, :] / np.exp(self.logs)[:, None] * np.array([unit[c] for c in criterion])[:, None]
        shares = (1 - LAPSE) * attentive(scaled, criterion[:, None])
        shares[:UNSURE] += LAPSE / 2
        # Observer, answer and difference.
        self.shares = np.maximum(shares.transpose(1, 0, 2), 1e-30)
        self.log_shares = np.log(self.shares).reshape(len(self.logs), -1)


def counted(index, answer, kinds):
    """How often each answer was given at each difference: track, answer and difference."""
    counts = np.zeros((len(index), 3, kinds))
    for place, given in zip(index.T, answer.T):
        given_at = np.flatnonzero(given >= 0)
        counts[given_at, given[given_at], place[given_at]] += 1
    return counts.reshape(len(index), -1)


# Weighted up-down: every difference is a multiple of the last step, a fortieth.
LATTICE = 40
lattice = np.arange(LATTICE) / LATTICE
places = np.linspace(-2.5, 2.5, 201), np.linspace(0, 2.75, 111)
most_likely = Grid(*places, lattice)


def up_down(count, threshold, criterion):
    shares = answers(lattice, threshold, criterion, 0)
    place, step = np.full(count, 16), np.full(count, 4)
    last, reversals = np.zeros(count, int), np.zeros(count, int)
    done = np.zeros(count, bool)
    sums, terms, indices, given = np.zeros(count), np.zeros(count), [], []
    while not done.all():
        drawn = random.random(count)
        correct, wrong, _ = shares[:, place]
        answer = np.where(drawn < correct, CORRECT, np.where(drawn < correct + wrong, WRONG, UNSURE))
        indices.append(place)
        given.append(np.where(done, -1, answer))
        direction = np.where(answer == CORRECT, -1, 1)
        turned = (last != 0) & (direction != last) & ~done
        reversals = reversals + turned
        counts = ~done & (reversals >= 4)
        sums, terms = sums + counts * lattice[place], terms + counts
        step = np.where(turned & ((reversals == 2) | (reversals == 4)), step // 2, step)
        done = done | (reversals >= 8)
        move = np.where(answer == CORRECT, -step, np.where(answer == WRONG, 3 * step, step))
        place = np.where(done, place, np.clip(place + move, 0, 38))
        last = direction
    given = np.array(given).T
    return sums / terms, counted(np.array(indices).T, given, LATTICE), (given >= 0).sum(1)


def largest(counts):
    scores = counts @ most_likely.log_shares.T + most_likely.log_prior + most_likely.logs
    return np.exp(most_likely.logs[scores.argmax(1)])


# QUEST+: the grid that places the trials, and a finer one for the estimate.
deltas = np.geomspace(0.01, 0.95, 40)
placing = Grid(np.linspace(-3, 3, 31), np.linspace(0, MODE + 3 * MODE_SPREAD, 10), deltas)
nodes, weights = np.polynomial.legendre.leggauss(24)
reach = MODE + 7 * MODE_SPREAD
posterior = Grid(np.linspace(-7, 7, 141), reach * (nodes + 1) / 2, deltas, weights)
prior = np.exp(placing.log_prior - placing.log_prior.max())
inner = -(placing.shares * np.log(placing.shares)).sum(1)


def quest_plus(count, threshold, criterion):
    odds = np.tile(prior / prior.sum(), (count, 1))
    truth = answers(deltas, threshold, criterion, 0)
    indices, given = [], []
    for _ in range(18):
        expected = np.stack([odds @ placing.shares[:, answer] for answer in range(3)])
        place = np.argmax(-(expected * np.log(expected)).sum(0) - odds @ inner, axis=1)
        drawn = random.random(count)
        correct, wrong, _ = truth[:, place]
        answer = np.where(drawn < correct, CORRECT, np.where(drawn < correct + wrong, WRONG, UNSURE))
        odds = odds * placing.shares[:, answer, place].T
        odds /= odds.sum(axis=1, keepdims=True)
        indices.append(place)
        given.append(answer)
    scores = counted(np.array(indices).T, np.array(given).T, len(deltas)) @ posterior.log_shares.T + posterior.log_prior
    found = np.exp(scores - scores.max(1, keepdims=True))
    return np.exp(found @ posterior.logs / found.sum(1))


print("criterion,threshold,method,estimates,bias,deviation,trials")
for criterion, threshold in OBSERVERS:
    found = {"thesis": [], "map": [], "questplus": []}
    trials = {"thesis": [], "map": [], "questplus": [np.array([18])]}
    for _ in range(ESTIMATES // BLOCK):
        tracks = [up_down(BLOCK, threshold, criterion) for _ in range(2)]
        found["thesis"].append((tracks[0][0] + tracks[1][0]) / 2)
        found["map"].append(largest(tracks[0][1] + tracks[1][1]))
        found["questplus"].append((quest_plus(BLOCK, threshold, criterion) + quest_plus(BLOCK, threshold, criterion)) / 2)
        for method in ("thesis", "map"):
            trials[method] += [track[2] for track in tracks]
    for method, estimates in found.items():
        relative = np.concatenate(estimates) / threshold - 1
        length = np.concatenate(trials[method]).mean()
        print(f"{criterion},{threshold},{method},{len(relative)},{relative.mean():.5f},{relative.std(ddof=1):.5f},{length:.3f}", flush=True)
