#!/usr/bin/env python3
"""Repeats the tables of `flotor analyse` from the trials, line by line, and draws figures 17 and 18 of CMU-RI-TR-07-21.

    python3 THIS.py [TRIALS.csv]

Needs numpy, scipy and pandas, and matplotlib for the figures. Written beside the trials by `flotor analyse --trials`. It knows the
defaults of `flotor analyse`: thresholds of the procedure, ratings divided by the mean, sums of squares of type III.
"""

import itertools
import sys
from pathlib import Path

import numpy as np
import pandas as pd
from scipy import optimize, stats

path = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).with_suffix(".csv")
trials = pd.read_csv(path, na_values="n/a")
main = trials[(trials.phase == "main") & trials.excluded.isna()]
counted = main[main.repeated == 0]
is_jnd = counted.base.notna().any()
LEVEL = "base" if is_jnd else "stimulus"
MODALITIES = ("vh", "h")

if is_jnd:
    # Thresholds in the unit of the stimulus: the mean over the replications whose track came to one.
    ends = counted[counted.threshold.notna()]
    cells = ends.groupby(["subject", "modality", "base"]).threshold.mean()
    cells = cells * cells.index.get_level_values("base")
else:
    # Ratings divided by the mean of all ratings of the subject.
    scaled = counted.assign(scaled=counted.rating / counted.groupby("subject").rating.transform("mean"))
    cells = scaled.groupby(["subject", "modality", "stimulus"]).scaled.mean()

levels = list(counted[LEVEL].dropna().drop_duplicates())
levels.sort()
columns = [(modality, level) for modality in MODALITIES for level in levels]
table = cells.unstack([1, 2])[columns]
responses = table.to_numpy()
subjects = len(table)
order = trials.groupby("subject").first_modality.first().loc[table.index].to_numpy()


def number(value):
    """The shortest text that is this number."""
    return repr(float(value)).removesuffix(".0")


def interval(values):
    half = stats.sem(values) * stats.t.ppf(0.975, len(values) - 1)
    return np.mean(values), np.mean(values) - half, np.mean(values) + half


def holm(p):
    p, ranked = np.asarray(p), np.argsort(p, kind="stable")
    steps = np.maximum.accumulate(p[ranked] * np.arange(len(p), 0, -1))
    corrected = np.empty(len(p))
    corrected[ranked] = np.minimum(steps, 1.0)
    return corrected


def p_text(p):
    return "p < 0.001" if p < 0.001 else f"p = {p:.3f}"


def size_text(value, low, high):
    if high == np.inf:
        return f"{value:.2f} ({low:.2f} or more)"
    if low == -np.inf:
        return f"{value:.2f} ({high:.2f} or less)"
    return f"{value:.2f} ({low:.2f} to {high:.2f})"


# Squares below this share of those of the responses are rounding errors, and what is nothing else is not testable.
ROUNDING = 1e-20


def contrasts(count):
    """Orthonormal contrasts of a factor with so many levels."""
    basis, _ = np.linalg.qr(np.column_stack([np.ones(count), np.eye(count)[:, 1:]]))
    return basis[:, 1:]


def anova(values, factors, groups):
    """Sums of squares of type III: a group of two between subjects, factors (name, levels) within them."""
    coded = np.where(groups == "vh", 1.0, -1.0)[:, None]
    has_order = len(set(groups)) == 2 and len(values) > 2
    between = {"": np.ones((len(values), 1))} | ({"order": coded} if has_order else {})
    full = np.column_stack(list(between.values()))
    for chosen in itertools.product((0, 1), repeat=len(factors)):
        chosen = chosen[::-1]
        within = np.ones((1, 1))
        for (_, count), is_in in zip(factors, chosen):
            within = np.kron(within, contrasts(count) if is_in else np.ones((count, 1)) / np.sqrt(count))
        seen = values @ within
        left = seen - full @ np.linalg.lstsq(full, seen, rcond=None)[0]
        error, error_df = np.sum(left**2), (len(values) - full.shape[1]) * within.shape[1]
        for name in between:
            parts = [name] * bool(name) + [factor for (factor, _), is_in in zip(factors, chosen) if is_in]
            if not parts:
                continue
            rest = [column for other, column in between.items() if other != name]
            fit = 0.0 * seen
            if rest:
                smaller = np.column_stack(rest)
                fit = smaller @ np.linalg.lstsq(smaller, seen, rcond=None)[0]
            squares, df = np.sum((seen - fit) ** 2) - error, within.shape[1]
            rounding = ROUNDING * np.sum(values**2)
            if error <= rounding:
                is_gone = squares <= rounding
                reason = "scaling of the responses removes the effect" if is_gone else "no variation between subjects, which the test requires"
                yield ":".join(parts), reason
                continue
            epsilon = None
            if df > 1:
                products = left.T @ left
                gg = np.trace(products) ** 2 / (df * np.sum(products**2))
                # Huynh and Feldt's correction, with Lecoutre's of it.
                freedom = len(values) - full.shape[1]
                epsilon = ((freedom + 1) * df * gg - 2) / (df * max(freedom - df * gg, 1e-9))
                # Of a single degree of freedom nothing is known: the least value.
                epsilon = epsilon if freedom > 1 else 1.0 / df
            yield ":".join(parts), ((squares / df) / (error / error_df), df, error_df, epsilon)


def effect_text(effect):
    if isinstance(effect, str):
        return f"not testable: {effect}"
    f, df, error_df, epsilon = effect
    text = f"F({df}, {error_df}) = {f:.2f}, {p_text(stats.f.sf(f, df, error_df))}"
    if epsilon is not None:
        epsilon = min(max(epsilon, 1.0 / df), 1.0)
        text += f" (HF {p_text(stats.f.sf(f, epsilon * df, epsilon * error_df))})"
    return text


def falling_root(of, low, high, least, most):
    """Where a falling function is 0: first between two ends, then farther out; infinite beyond `least` and `most`."""
    width = high - low
    while of(low) < 0.0:
        if low <= least:
            return -np.inf
        width, high, low = 2.0 * width, low, max(low - width, least)
    while of(high) > 0.0:
        if high >= most:
            return np.inf
        width, low, high = 2.0 * width, high, min(high + width, most)
    return optimize.brentq(of, low, high, xtol=1e-12)


def noncentral_f(f, df, error_df, below):
    """The noncentrality at which an F is as small as this with a probability."""
    if stats.f.cdf(f, df, error_df) <= below:
        return 0.0

    # As far as `flotor analyse` looks; mostly the end is much nearer.
    return falling_root(lambda shift: noncentral_f_below(f, df, error_df, shift) - below, 1e-12, max(1.0, f * df), 0.0, 1e6)


def noncentral_f_below(f, df, error_df, shift):
    below = stats.ncf.cdf(f, df, error_df, shift)
    if np.isfinite(below):
        return below
    # scipy has no value far from the middle: a noncentral chi-square over the quantiles of the error's.
    error = stats.chi2.ppf((np.arange(20000) + 0.5) / 20000, error_df)
    return np.mean(stats.ncx2.cdf(f * df * error / error_df, df, shift))


def partial_omega_squared(effect):
    f, df, error_df, _ = effect
    low, high = (noncentral_f(f, df, error_df, below) for below in (0.975, 0.025))

    def share(shift):
        return shift / (shift + df + error_df + 1.0) if np.isfinite(shift) else 1.0

    return share(max(df * (f - 1.0), 0.0)), share(min(low, 1e6)), share(high)


def noncentral_t_below(t, df, shift):
    if t < 0.0:
        return 1.0 - noncentral_t_below(-t, df, -shift)
    below = stats.nct.cdf(t, df, shift) if abs(shift) < 37.0 else np.nan
    if np.isfinite(below):
        return below
    # scipy has no value far from the middle: the tail of a chi-square, averaged over a normal number.
    normal = np.linspace(-10.0, 10.0, 4001)
    tail = stats.chi2.sf(np.maximum(normal + shift, 0.0) ** 2 * df / max(t, 1e-300) ** 2, df)
    return np.sum(stats.norm.pdf(normal) * tail) * (normal[1] - normal[0])


def cohen_d(t, df):
    low, high = (
        falling_root(lambda d: noncentral_t_below(t, df, d) - below, t - 1.0, t + 1.0, -1e3, 1e3) for below in (0.975, 0.025)
    )
    ends = np.array([t, min(low, 1e3), max(high, -1e3)])
    return ends / np.sqrt(df + 1.0)


def effects(values, factors, groups, sizes):
    found = list(anova(values, factors, groups))
    for name, effect in found:
        print(name, effect_text(effect))
    for name, effect in found if sizes else []:
        if not isinstance(effect, str):
            print(name, size_text(*partial_omega_squared(effect)))


def paired(first, second):
    """t and p of pairs, or the reason why there are none."""
    first, second = np.asarray(first), np.asarray(second)
    differences = first - second
    rounding = ROUNDING * np.sum(first**2 + second**2)
    if np.sum((differences - np.mean(differences)) ** 2) <= rounding:
        return "no difference in any subject" if np.sum(differences**2) <= rounding else "the same difference in every subject"
    test = stats.ttest_rel(first, second)
    return test.statistic, test.pvalue


def paired_text(test, p):
    return f"t({subjects - 1}) = {test[0]:.2f}, {p_text(p)}"


def comparisons(pairs):
    tests = [(name, paired(first, second)) for name, first, second in pairs]
    # What cannot be tested counts in the family all the same.
    for (name, test), p in zip(tests, holm([1.0 if isinstance(test, str) else test[1] for _, test in tests])):
        if isinstance(test, str):
            print(f"{name} not testable: {test}")
        else:
            print(f"{name} {paired_text(test, p)} {size_text(*cohen_d(test[0], subjects - 1))}")


def trend_text(levels, means):
    spread = np.sum((means - np.mean(means)) ** 2)
    if spread <= ROUNDING * np.sum(means**2):
        return "not testable: equal means at all levels"
    return f"R² = {np.corrcoef(levels, means)[0, 1] ** 2:.3f}"


if is_jnd:
    print(f"{subjects} subjects, {len(counted) / subjects:.1f} pairs each")
    fractions = table / np.array([level for _, level in columns])
    weber = {modality: fractions[modality].mean(axis=1).to_numpy() for modality in MODALITIES}
    for modality, name in (("vh", "vision + haptics"), ("h", "haptics alone")):
        mean, low, high = interval(weber[modality])
        print(f"{name} {mean * 100:.1f} % (95 %: {low * 100:.1f} to {high * 100:.1f})")
    test = paired(weber["h"], weber["vh"])
    print("difference", f"not testable: {test}" if isinstance(test, str) else paired_text(test, test[1]))
else:
    print(f"{subjects} subjects, {number(len(counted) / subjects)} ratings each")
    repeats = main[main.repeat > 0]
    print(f"{len(repeats)} presentations repeated because the handle left its range")
    means = (table["vh"] + table["h"]).mean()[levels] / 2
    print("Linear trend", trend_text(levels, means.to_numpy()))
for level in levels:
    name = f"base {number(level)}" if is_jnd else f"stimulus {level:.2f}"
    print(name, *(f"{table[m][level].mean():.3f} (se {table[m][level].sem():.3f})" for m in MODALITIES))

several = [(LEVEL, len(levels))] if len(levels) > 1 else []
effects(responses, [("modality", 2), *several], order, sizes=True)
comparisons([(f"h - vh, {LEVEL} {number(round(level, 4))}", table["h"][level], table["vh"][level]) for level in levels])
if is_jnd:
    both = {level: (fractions["vh"][level] + fractions["h"][level]) / 2 for level in levels}
    comparisons(
        (f"fraction, base {number(high)} - {number(low)}", both[high], both[low])
        for low, high in itertools.combinations(levels, 2)
    )
    for modality in MODALITIES if several else ():
        for _, effect in anova(fractions[modality].to_numpy(), [("base", len(levels))], np.array([""] * subjects)):
            print(f"fraction over base, {modality}", effect_text(effect))

for measure in ("speed", "acceleration", "force"):
    # One number for each stimulus of a trial; of a pair the base alone counts.
    texts = [str(text).split(" ") for text in counted[f"{measure}_each"]]
    if is_jnd:
        texts = [text[int(at == "first") :: 2] for text, at in zip(texts, counted.comparison_at)]
    each = counted[["subject", "modality", LEVEL]].assign(value=texts)
    each = each.explode("value").assign(value=lambda rows: pd.to_numeric(rows.value, errors="coerce")).dropna()
    moved = each.groupby(["subject", "modality", LEVEL]).value.mean().unstack([1, 2])
    if set(columns) <= set(moved.columns) and len(moved) == subjects and moved.notna().all(axis=None):
        seen = moved.loc[table.index][columns].to_numpy()
        several = [("stimulus", len(levels))] if len(levels) > 1 else []
        effects(seen, [("modality", 2), *several], np.array([""] * subjects), sizes=False)
        if several:
            # Exponent of the stimulus to which the measure is proportional, subject by subject.
            both = np.log((seen[:, : len(levels)] + seen[:, len(levels) :]) / 2)
            mean, low, high = interval(np.polyfit(np.log(levels), both.T, 1)[0])
            print(f"exponent of the stimulus {mean:.3f} (95 %: {low:.3f} to {high:.3f})")
if is_jnd:
    last = counted.groupby(["subject", "track"]).threshold.last()
    if last.isna().any():
        print(f"{last.isna().sum()} tracks did not reach a threshold and are omitted")

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
