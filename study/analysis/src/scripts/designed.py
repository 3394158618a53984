#!/usr/bin/env python3
"""Repeats the rows of `flotor analyse` for a study of one's own design, from the table of trials.

    python3 THIS.py [TRIALS.csv]

Needs numpy, scipy and pandas. Written beside the trials by `flotor analyse --trials`.
"""

import itertools
import sys
from pathlib import Path

import numpy as np
import pandas as pd
from scipy import optimize, stats

path = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).with_name("@TABLE@")
within = [@WITHIN@]
between = [@BETWEEN@]
levels = {@LEVELS@}
KIND = "@MEASURE@"

trials = pd.read_csv(path, na_values="n/a")
counted = trials[trials.counts == 1]


def p_text(p):
    return "p < 0.001" if p < 0.001 else f"p = {p:.3f}"


def row(name, text):
    print(f"  {name:<38}{text}")


def shortest(value):
    """The shortest text of a level, as `flotor` writes it."""
    return str(value).removesuffix(".0")


def difference(cell):
    """Half of the distance from 25 to 75 % of a cumulative normal of maximum likelihood."""
    counts = cell.groupby("level").positive.agg(["sum", "count"])
    level, positive, rest = counts.index.to_numpy(), counts["sum"].to_numpy(), (counts["count"] - counts["sum"]).to_numpy()
    some, others = level[positive > 0], level[rest > 0]
    # Answers that do not rise with the level, or change from none to all at once, have no function.
    if not (len(some) and len(others) and some.max() > others.min() and others.max() > some.min()):
        return np.nan
    unit = level.max() - level.min()
    x = (level - level.min()) / unit

    def loss(line):
        eta = line[0] + line[1] * x
        return -(positive @ stats.norm.logcdf(eta) + rest @ stats.norm.logsf(eta))

    def slope(line):
        eta = line[0] + line[1] * x
        density = stats.norm.logpdf(eta)
        score = positive * np.exp(density - stats.norm.logcdf(eta)) - rest * np.exp(density - stats.norm.logsf(eta))
        return -np.array([score.sum(), score @ x])

    found = optimize.minimize(loss, [-1.0, 2.0], jac=slope, method="BFGS", options={"gtol": 1e-10})
    return stats.norm.ppf(0.75) * unit / found.x[1] if found.x[1] > 1e-6 else np.nan


def measure(cell):
    if KIND == "sensitivity":
        by_signal = cell.groupby("signal").positive.agg(["sum", "count"])
        z = stats.norm.ppf((by_signal["sum"] + 0.5) / (by_signal["count"] + 1))
        z = dict(zip(by_signal.index, z))
        return z["present"] - z["absent"]
    if KIND == "difference":
        return difference(cell)
    answer = {"share": cell.positive, "threshold": cell.threshold, "rating": cell.answer, "log-magnitude": cell.answer}[KIND]
    answer = pd.to_numeric(answer)
    return (np.log(answer) if KIND == "log-magnitude" else answer).mean()


factors = within + between
cells = pd.DataFrame(
    [(*key, measure(cell)) for key, cell in counted.groupby(["subject", *factors], sort=False)],
    columns=["subject", *factors, "value"],
)

# Means over subjects with their intervals.
for key, cell in cells.groupby(factors, sort=False) if factors else [((), cells)]:
    key = key if isinstance(key, tuple) else (key,)
    values = cell.value.dropna()
    n, mean = len(values), values.mean()
    if n < 2:
        continue
    half = values.std() / np.sqrt(n) * stats.t.ppf(0.975, n - 1)
    name = ", ".join(f"{factor} {shortest(level)}" for factor, level in sorted(zip(factors, key))) or "all"
    row(name, f"{mean:.4f}  (95 %: {mean - half:.4f} to {mean + half:.4f}), n = {n}")

# Analysis of variance, sums of squares of type III: contrasts within subjects, explained by the groups.
cells = cells[~cells.subject.isin(cells.subject[cells.value.isna()])]
within = [factor for factor in within if len(levels[factor]) > 1]
between = [factor for factor in between if len(levels[factor]) > 1]
grid = list(itertools.product(*(levels[factor] for factor in within)))
subjects = list(dict.fromkeys(cells.subject))
wide = cells.set_index(["subject", *within]).value
response = np.array([[float(np.mean(wide.loc[(subject, *cell)])) for cell in grid] for subject in subjects])
group = cells.groupby("subject")[between].first().loc[subjects]


def contrast(count):
    return np.linalg.qr(np.column_stack([np.ones(count), np.eye(count)[:, :-1]]))[0][:, 1:]


def terms(names):
    return [term for size in range(len(names) + 1) for term in itertools.combinations(names, size)]


def coded(term):
    columns = np.ones((len(subjects), 1))
    for factor in term:
        count = len(levels[factor])
        sums = np.vstack([np.eye(count - 1), -np.ones(count - 1)])
        own = sums[[levels[factor].index(level) for level in group[factor]]]
        columns = np.column_stack([columns * own[:, [column]] for column in range(count - 1)])
    return columns


def rest(y, x):
    return np.sum((y - x @ np.linalg.lstsq(x, y, rcond=None)[0]) ** 2) if x.shape[1] else np.sum(y**2)


if within + between and len(subjects) > 1:
    of_groups = [coded(term) for term in terms(between)]
    full = np.column_stack(of_groups)
    for inside in terms(within):
        weights = np.ones((1, 1))
        for factor in within:
            count = len(levels[factor])
            weights = np.kron(weights, contrast(count) if factor in inside else np.full((count, 1), count**-0.5))
        products = response @ weights
        error, error_df = rest(products, full), (len(subjects) - np.linalg.matrix_rank(full)) * weights.shape[1]
        for index, term in enumerate(terms(between)):
            if not term + inside:
                continue
            smaller = np.column_stack([np.empty((len(subjects), 0)), *of_groups[:index], *of_groups[index + 1 :]])
            df = of_groups[index].shape[1] * weights.shape[1]
            f = (rest(products, smaller) - error) / df / (error / error_df)
            row(":".join(term + inside), f"F({df}, {error_df}) = {f:.2f}, {p_text(stats.f.sf(f, df, error_df))}")

# By ranks, over the mean of each subject at each level; a test of values that are all tied has no result.
by_level = {
    factor: cells.groupby(["subject", factor]).value.mean().unstack()[levels[factor]] for factor in within if len(subjects) > 0
}
for factor in within if len(subjects) > 1 else []:
    columns = by_level[factor].to_numpy().T
    if len(columns) > 2:
        test = stats.friedmanchisquare(*columns)
        chi, p = test.statistic, test.pvalue
    else:
        # scipy refuses two conditions.
        ranks = stats.rankdata(columns, axis=0).sum(axis=1)
        n, ties = columns.shape[1], sum(6.0 for one, other in columns.T if one == other)
        chi = 12 * np.sum((ranks - 1.5 * n) ** 2) / (n * 6 - ties) if n * 6 > ties else np.nan
        p = stats.chi2.sf(chi, 1)
    if not np.isnan(p):
        row(factor, f"chi-square({len(columns) - 1}) = {chi:.2f}, {p_text(p)}")
for factor in between if len(subjects) > 1 else []:
    means = cells.groupby("subject").value.mean().loc[subjects]
    split = [means[(group[factor] == level).to_numpy()] for level in levels[factor]]
    if min(len(one) for one in split) == 0 or means.nunique() < 2:
        continue
    test = stats.kruskal(*split)
    row(factor, f"chi-square({len(split) - 1}) = {test.statistic:.2f}, {p_text(test.pvalue)}")
for factor in by_level:
    columns, names = by_level[factor].to_numpy().T, levels[factor]
    pairs = list(itertools.combinations(range(len(names)), 2))
    tests = []
    for low, high in pairs:
        change = columns[high] - columns[low]
        nonzero = change[change != 0]
        if len(nonzero) == 0:
            tests.append((0.0, np.nan))
            continue
        exact = len(nonzero) == len(change) < 50 and len(set(np.abs(nonzero))) == len(nonzero)
        v = stats.rankdata(np.abs(nonzero))[nonzero > 0].sum()
        test = stats.wilcoxon(nonzero, correction=True, method="exact" if exact else "approx")
        tests.append((v, test.pvalue))
    # A comparison without any difference counts with 1.
    p = np.array([1.0 if np.isnan(p) else p for _, p in tests])
    ranked = np.argsort(p, kind="stable")
    holm = np.empty(len(p))
    holm[ranked] = np.minimum(np.maximum.accumulate(p[ranked] * np.arange(len(p), 0, -1)), 1)
    for (low, high), (v, p), corrected in zip(pairs, tests, holm):
        name = f"{factor} {shortest(names[high])} - {shortest(names[low])}"
        if not np.isnan(p):
            row(name, f"V = {shortest(v)}, {p_text(p)}, Holm {p_text(corrected)}")
