"""Fits the psychometric functions of `flotor analyse --each --json` anew: the same model and prior on a fine and wide grid.

    python3 refit.py EACH.json DATA CONDITIONS

Takes so many conditions of each subject, prints each number that is farther off than 1e-6, and how many were compared. An end that is
not bounded has no number: there the likelihood, averaged over criterion and lapse, is tested.
"""

import json
import sys

import numpy as np
import pandas as pd
from scipy import integrate, interpolate, optimize, stats

KINDS = ("correct", "wrong", "unsure")
MEDIAN, SPREAD = 0.14, 0.7
compared = 0


def unit_threshold(criterion):
    def reached(x):
        return 0.5 * (1.0 + stats.norm.cdf(x - criterion) - stats.norm.cdf(-x - criterion)) - 0.75

    return optimize.brentq(reached, 1e-9, 20.0, xtol=1e-14)


nodes, weights = np.polynomial.legendre.leggauss(60)
criteria, weights = 2.125 * (nodes + 1.0), 2.125 * weights
units = np.array([unit_threshold(criterion) for criterion in criteria])
roots = np.linspace(0.0, 1.0, 201)
lapses = roots**2


def densities(answers, deviations):
    """Posterior without the prior of the threshold, over threshold (in deviations of its prior), criterion and root of the lapse."""
    sigma = MEDIAN * np.exp(SPREAD * deviations)[:, None] / units
    log = np.zeros((len(deviations), len(criteria), len(roots)))
    for delta, kinds in answers.groupby("delta").judgement:
        right = stats.norm.cdf(delta / sigma - criteria)[:, :, None]
        wrong = stats.norm.cdf(-delta / sigma - criteria)[:, :, None]
        shares = (right, wrong, None)
        for kind, share in zip(KINDS, shares):
            count = (kinds == kind).sum()
            if count:
                share = (1.0 - right - wrong) * (1.0 - lapses) if share is None else share * (1.0 - lapses) + lapses / 2
                log += count * np.log(np.maximum(share, 1e-30))
    log += (-0.5 * ((criteria - 0.75) / 0.5) ** 2)[:, None] - lapses / 0.02
    return log


def quantile(at, density, share):
    below = interpolate.CubicSpline(at, density).antiderivative()
    total = below(at[-1]) - below(at[0])
    return optimize.brentq(lambda x: (below(x) - below(at[0])) / total - share, at[0], at[-1], xtol=1e-14)


def over_criterion_and_lapse(log, most):
    density = np.exp(log - most) * 2.0 * roots
    return integrate.simpson(density, x=roots, axis=2) @ weights


def close(what, found, expected):
    global compared
    compared += 1
    if not abs(found / expected - 1.0) <= 1e-6:
        print(f"{what}: {found} for {expected}")


for subject in json.load(open(sys.argv[1])):
    name = subject["subject"]
    trials = pd.read_csv(f"{sys.argv[2]}/{name}/beh/{name}_task-jnd_beh.tsv", sep="\t", na_values="n/a")
    counted = trials[(trials.phase == "main") & (trials.repeated == 0)]
    for condition in subject["conditions"][: int(sys.argv[3])]:
        answers = counted[(counted.modality == condition["modality"]) & (counted.base == condition["base"])]
        what, found = f"{name} {condition['modality']} {condition['base']}", condition["function"]
        deviations = np.linspace(-7.0, 7.0, 421)
        log = densities(answers, deviations)
        log -= (0.5 * deviations**2)[:, None, None]
        by_threshold = over_criterion_and_lapse(log, log.max())
        density = np.einsum("dcr,c->dr", np.exp(log - log.max()), weights) * 2.0 * roots
        by_root = integrate.simpson(density, x=deviations, axis=0)
        at = [MEDIAN * np.exp(SPREAD * quantile(deviations, by_threshold, share)) for share in (0.5, 0.025, 0.975)]
        close(f"{what} threshold", found["threshold"], at[0])
        far = densities(answers, np.array([-8.0, *np.arange(-7.5, 7.75, 0.5), 8.0]))
        with np.errstate(divide="ignore"):
            likelihood = np.log(over_criterion_and_lapse(far, far.max()))
        for end, known, value, last in zip(("low", "high"), found["threshold_interval"], at[1:], likelihood[[0, -1]]):
            is_bounded = last < likelihood.max() - 0.5 * stats.chi2.ppf(0.95, 1)
            if is_bounded != (known is not None):
                print(f"{what} {end}: {known}, and the likelihood falls off by {likelihood.max() - last}")
            elif is_bounded:
                close(f"{what} {end}", known, value)
        mean = integrate.simpson(by_root * lapses, x=roots) / integrate.simpson(by_root, x=roots)
        close(f"{what} lapse", found["lapse"], mean)
        close(f"{what} largest lapse", found["lapse_most"], quantile(roots, by_root, 0.975) ** 2)
        right, wrong = ((answers.judgement == kind).sum() for kind in KINDS[:2])
        close(f"{what} chance", found["p_chance"], stats.binom.sf(wrong - 1, right + wrong, 0.5))
print(f"compared {compared}")
