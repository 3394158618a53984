#!/usr/bin/env python3
"""Repeats the tables of `flotor analyse` from the trials, and draws figures 17 and 18 of CMU-RI-TR-07-21.

    python3 THIS.py [TRIALS.csv]

Needs numpy, scipy and pandas, and matplotlib for the figures. Written beside the trials by `flotor analyse --trials`.
"""

import itertools
import sys
from pathlib import Path

import numpy as np
import pandas as pd
from scipy import stats

path = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).with_suffix(".csv")
trials = pd.read_csv(path, na_values="n/a")
counted = trials[(trials.phase == "main") & (trials.repeated == 0) & trials.excluded.isna()]
is_jnd = counted.base.notna().any()
LEVEL = "base" if is_jnd else "stimulus"

if is_jnd:
    # Thresholds in the unit of the stimulus: the mean over the replications whose track came to one.
    ends = counted[counted.threshold.notna()].copy()
    ends["response_value"] = ends.threshold * ends.base
    cells = ends.groupby(["subject", "modality", "base"]).response_value.mean()
else:
    # Ratings divided by the mean of all ratings of the subject.
    scaled = counted.copy()
    scaled["response_value"] = scaled.rating / scaled.groupby("subject").rating.transform("mean")
    cells = scaled.groupby(["subject", "modality", "stimulus"]).response_value.mean()

table = cells.unstack([1, 2])
levels = sorted(counted[LEVEL].dropna().unique())
table = table[[(modality, level) for modality in ("vh", "h") for level in levels]]
responses = table.to_numpy()
order = trials.groupby("subject").first_modality.first().loc[table.index].to_numpy()


def interval(values):
    half = stats.sem(values) * stats.t.ppf(0.975, len(values) - 1)
    return np.mean(values), np.mean(values) - half, np.mean(values) + half


def holm(p):
    p, ranked = np.asarray(p), np.argsort(p)
    steps = np.maximum.accumulate(p[ranked] * np.arange(len(p), 0, -1))
    corrected = np.empty(len(p))
    corrected[ranked] = np.minimum(steps, 1.0)
    return corrected


def p_text(p):
    return "p < 0.001" if p < 0.001 else f"p = {p:.3f}"


def contrasts(count):
    """Orthonormal contrasts of a factor with so many levels."""
    basis, _ = np.linalg.qr(np.column_stack([np.ones(count), np.eye(count)[:, 1:]]))
    return basis[:, 1:]


def anova():
    """Sums of squares of type III: order between subjects, modality and level within."""
    subjects = len(responses)
    has_order = len(set(order)) == 2 and subjects > 2
    coded = np.where(order == "vh", 1.0, -1.0)[:, None]
    between = {"": np.ones((subjects, 1))} | ({"order": coded} if has_order else {})
    ones = [np.ones((2, 1)) / np.sqrt(2), np.ones((len(levels), 1)) / np.sqrt(len(levels))]
    apart = [contrasts(2), contrasts(len(levels))]
    for first, second in [(0, 0), (1, 0), (0, 1), (1, 1)]:
        within = np.kron((ones, apart)[first][0], (ones, apart)[second][1])
        seen = responses @ within
        full = np.column_stack(list(between.values()))
        error = np.sum((seen - full @ np.linalg.lstsq(full, seen, rcond=None)[0]) ** 2)
        error_df = (subjects - full.shape[1]) * within.shape[1]
        for name in between:
            parts = [name] * bool(name) + ["modality"] * first + [LEVEL] * second
            if not parts:
                continue
            rest = [columns for other, columns in between.items() if other != name]
            smaller = np.column_stack(rest) if rest else np.zeros((subjects, 0))
            fit = smaller @ np.linalg.lstsq(smaller, seen, rcond=None)[0] if smaller.shape[1] else 0.0 * seen
            squares, df = np.sum((seen - fit) ** 2) - error, within.shape[1]
            if max(squares, error) <= 1e-20 * np.sum(responses**2):
                yield ":".join(parts), "not testable: nothing of it is left in the responses"
                continue
            f = (squares / df) / (error / error_df)
            yield ":".join(parts), f"F({df}, {error_df}) = {f:.2f}, {p_text(stats.f.sf(f, df, error_df))}"


print(f"{len(table)} subjects")
if is_jnd:
    fractions = table / np.array([level for _, level in table.columns])
    weber = {modality: fractions[modality].mean(axis=1).to_numpy() for modality in ("vh", "h")}
    for modality, values in weber.items():
        mean, low, high = interval(values)
        print(f"Weber fraction {modality}: {mean * 100:.1f} %  (95 %: {low * 100:.1f} to {high * 100:.1f})")
    test = stats.ttest_rel(weber["h"], weber["vh"])
    print(f"difference: t({len(table) - 1}) = {test.statistic:.2f}, {p_text(test.pvalue)}")
for (modality, level), column in table.items():
    print(f"{LEVEL} {level:.6g} {modality}: {column.mean():.3f} (se {column.sem():.3f})")
for effect, text in anova():
    print(f"{effect}: {text}")


def comparisons(pairs):
    tests = [(name, stats.ttest_rel(first, second)) for name, first, second in pairs]
    for (name, test), p in zip(tests, holm([test.pvalue for _, test in tests])):
        size = test.statistic / np.sqrt(len(table))
        print(f"{name}: t({len(table) - 1}) = {test.statistic:.2f}, {p_text(p)}, d = {size:.2f}")


comparisons([(f"h - vh, {LEVEL} {round(level, 4):.10g}", table["h"][level], table["vh"][level]) for level in levels])
if is_jnd:
    both = {level: (fractions["vh"][level] + fractions["h"][level]) / 2 for level in levels}
    comparisons(
        [(f"fraction, base {high:g} - {low:g}", both[high], both[low]) for low, high in itertools.combinations(levels, 2)]
    )

try:
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt
except ImportError:
    sys.exit()

figure, axes = plt.subplots(figsize=(6, 4))
for modality, label in (("vh", "vision + haptics"), ("h", "haptics alone")):
    means, errors = table[modality].mean(), table[modality].sem()
    axes.errorbar(levels, means[levels], errors[levels], marker="o", capsize=3, linestyle="none", label=label)
axes.set_xlabel(LEVEL)
axes.set_ylabel("threshold" if is_jnd else "rating, scaled")
axes.legend()
figure.tight_layout()
figure.savefig(path.with_suffix(".svg"))
