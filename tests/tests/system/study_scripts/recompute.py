"""Computes every number of `flotor analyse --json` anew from the table of trials, with numpy and scipy.

    python3 recompute.py REPORT.json TRIALS.csv

Prints each number that is farther off than 1e-9 (F, t, means, effect sizes, relative) or 1e-6 (p, epsilons, limits), and then how many
were compared. Group means and Helmert contrasts, where `flotor analyse` has projections.
"""

import json
import sys

import numpy as np
import pandas as pd
from scipy import optimize, stats

report = json.load(open(sys.argv[1]))
trials = pd.read_csv(sys.argv[2], na_values="n/a")
counted = trials[(trials.phase == "main") & trials.excluded.isna() & (trials.repeated == 0)]
is_jnd = report["task"] == "jnd"
level_name = "base" if is_jnd else "stimulus"
ends = counted[counted.threshold.notna()] if is_jnd else counted
share = ends.threshold if is_jnd else ends.rating / ends.groupby("subject").rating.transform("mean")
cells = ends.assign(share=share).groupby(["subject", "modality", level_name]).share.mean()
levels = sorted(ends[level_name].unique())
shares = cells.unstack([1, 2])[[(modality, level) for modality in ("vh", "h") for level in levels]].to_numpy()
responses = shares * np.array(levels * 2) if is_jnd else shares
people = len(responses)
first = trials.groupby("subject").first_modality.first().to_numpy()
compared = 0


def close(what, found, expected, bound):
    global compared
    compared += 1
    if found is None and not np.isfinite(expected):
        return
    if found is None or not abs(found - expected) <= bound * max(abs(expected), 1e-12):
        print(f"{what}: {found} for {expected!r}")


def interval(what, found, expected, bound):
    for end, known, value in zip(("low", "high"), found, expected):
        if known is None and abs(value) > 1e3:
            continue
        # A limit of 0 has no relative error.
        close(f"{what}, {end}", known, value, bound if abs(value) > 1e-9 else np.inf)


def helmert(count):
    contrasts = np.zeros((count, count - 1))
    for i in range(1, count):
        contrasts[:i, i - 1], contrasts[i, i - 1] = 1.0, -i
    return contrasts / np.linalg.norm(contrasts, axis=0)


def effects(values, factors, with_order):
    """F, p and more of each effect by name, of groups with type III sums of squares."""
    groups = sorted(set(first))
    has_order = with_order and len(groups) == 2 and people > 2
    found = {}
    for chosen in np.ndindex(*[2] * len(factors)):
        contrasts = np.ones((1, 1))
        for (_, count), is_in in zip(factors, chosen):
            contrasts = np.kron(contrasts, helmert(count) if is_in else np.full((count, 1), count**-0.5))
        seen = values @ contrasts
        parts = [seen[first == group] for group in groups] if has_order else [seen]
        sizes, means = [len(part) for part in parts], [part.mean(0) for part in parts]
        left = np.concatenate([part - mean for part, mean in zip(parts, means)])
        products, freedom = left.T @ left, people - len(parts)
        error, df = np.trace(products), contrasts.shape[1]
        inverse = sum(1.0 / size for size in sizes)
        grand = sum(means) / len(means)
        squares = {"": len(parts) ** 2 / inverse * grand @ grand}
        if has_order:
            squares["order"] = (means[0] - means[1]) @ (means[0] - means[1]) / inverse
        for between, effect in squares.items():
            name = ":".join([between] * bool(between) + [factor for (factor, _), is_in in zip(factors, chosen) if is_in])
            if not name or error <= 1e-20 * np.sum(values**2):
                continue
            f = effect / df / (error / (freedom * df))
            gg = error**2 / (df * np.sum(products**2))
            hf = ((freedom + 1) * df * gg - 2) / (df * (freedom - df * gg)) if freedom > 1 else 1.0 / df
            found[name] = (f, df, freedom * df, gg, hf, effect, error)
    return found


def root(of, low, high):
    return optimize.brentq(of, low, high, xtol=1e-13, rtol=1e-14)


def noncentral(f, df, error_df, below):
    if stats.f.cdf(f, df, error_df) <= below:
        return 0.0
    high = max(1.0, f * df)
    while stats.ncf.cdf(f, df, error_df, high) > below:
        high *= 2.0
    return root(lambda shift: stats.ncf.cdf(f, df, error_df, shift) - below, 1e-12, high)


def check_effect(what, line, known):
    f, df, error_df, gg, hf, squares, error = known
    close(f"{what} F", line["f"], f, 1e-9)
    close(f"{what} squares", line["sum_of_squares"], squares, 1e-9)
    close(f"{what} error", line["error_sum_of_squares"], error, 1e-9)
    close(f"{what} p", line["p"], stats.f.sf(f, df, error_df), 1e-6)
    close(f"{what} partial eta squared", line["partial_eta_squared"], squares / (squares + error), 1e-9)
    total, omega = df + error_df + 1.0, line["partial_omega_squared"]
    close(f"{what} omega", omega["value"], max(df * (f - 1.0), 0.0) / (max(df * (f - 1.0), 0.0) + total), 1e-9)
    shifts = [noncentral(f, df, error_df, below) for below in (0.975, 0.025)]
    if np.all(np.isfinite(shifts)):
        interval(f"{what} omega", omega["interval"], [shift / (shift + total) for shift in shifts], 1e-6)
    sphericity = line["sphericity"]
    if sphericity:
        close(f"{what} epsilon GG", sphericity["epsilon_gg"], gg, 1e-6)
        close(f"{what} epsilon HF", sphericity["epsilon_hf"], hf, 1e-6)
        for key, epsilon in (("p_gg", gg), ("p_hf", hf)):
            epsilon = min(max(epsilon, 1.0 / df), 1.0)
            close(f"{what} {key}", sphericity[key], stats.f.sf(f, epsilon * df, epsilon * error_df), 1e-6)


def check_anova(what, lines, values, factors, with_order):
    known = effects(values, factors, with_order)
    tested = [line for line in lines if line["f"] is not None]
    if {line["effect"] for line in tested} != set(known):
        print(f"{what}: {[line['effect'] for line in tested]} for {list(known)}")
    for line in tested:
        if line["effect"] in known:
            check_effect(f"{what} {line['effect']}", line, known[line["effect"]])


def check_mean(what, line, values):
    mean, error = np.mean(values), stats.sem(values)
    close(f"{what} mean", line["mean"], mean, 1e-9)
    if error > 1e-12 * abs(mean):
        close(f"{what} se", line["se"], error, 1e-9)
        half = error * stats.t.ppf(0.975, len(values) - 1)
        interval(what, line["interval"], [mean - half, mean + half], 1e-6)


def check_t(what, line, first, second):
    test = stats.ttest_rel(first, second)
    close(f"{what} t", line["value"], test.statistic, 1e-9)
    close(f"{what} p", line["p"], test.pvalue, 1e-6)
    half = stats.sem(first - second) * stats.t.ppf(0.975, len(first) - 1)
    middle = np.mean(first - second)
    interval(what, line["interval"], [middle - half, middle + half], 1e-6)
    return test


def check_d(what, line, t, df):
    close(f"{what} d", line["value"], t / np.sqrt(df + 1.0), 1e-9)
    # scipy has no noncentral t far from the middle.
    if abs(t) < 15.0:
        reach = 20.0 + abs(t)
        ends = [root(lambda d: stats.nct.cdf(abs(t), df, d) - below, abs(t) - reach, abs(t) + reach) for below in (0.975, 0.025)]
        if t < 0.0:
            ends = [-end for end in reversed(ends)]
        interval(f"{what} d", line["interval"], np.array(ends) / np.sqrt(df + 1.0), 1e-6)


def check_family(lines, pairs):
    tested = [(line, *pair) for line, pair in zip(lines, pairs, strict=True)]
    p = [1.0 if "not_testable" in line else stats.ttest_rel(a, b).pvalue for line, a, b in tested]
    order, holm, largest = np.argsort(p, kind="stable"), np.empty(len(p)), 0.0
    for rank, index in enumerate(order):
        largest = max(largest, min(1.0, p[index] * (len(p) - rank)))
        holm[index] = largest
    for (line, a, b), corrected in zip(tested, holm):
        if "not_testable" not in line:
            test = check_t(line["comparison"], line["t"], a, b)
            close(f"{line['comparison']} Holm", line["p_holm"], corrected, 1e-6)
            check_d(line["comparison"], line["d"], test.statistic, people - 1)


several = [(level_name, len(levels))] if len(levels) > 1 else []
check_anova("responses", report["anova"], responses, [("modality", 2), *several], True)
vh, h = shares[:, : len(levels)], shares[:, len(levels) :]
modalities = [(responses[:, len(levels) + k], responses[:, k]) for k in range(len(levels))]
check_family([line for line in report["post_hoc"] if line["comparison"].startswith("h - vh")], modalities)
for k, line in enumerate(report["thresholds" if is_jnd else "ratings"]):
    check_mean(f"cell {k}", line["threshold" if is_jnd else "rating"], responses[:, k])
means = (responses[:, : len(levels)] + responses[:, len(levels) :]).mean(0) / 2
if report["linear_r2"] is not None:
    close("R squared", report["linear_r2"], stats.linregress(levels, means).rvalue ** 2, 1e-9)
if is_jnd:
    for modality, values in (("vh", vh), ("h", h)):
        check_mean(f"Weber fraction, {modality}", report["weber_detail"][modality], values.mean(1))
        if several:
            check_anova(f"constancy, {modality}", [report["constancy"][modality]], values, several, False)
    if "not_testable" not in report["t"]:
        check_t("difference", report["t"], h.mean(1), vh.mean(1))
    both = (vh + h) / 2
    pairs = [(both[:, high], both[:, low]) for low in range(len(levels)) for high in range(low + 1, len(levels))]
    check_family([line for line in report["post_hoc"] if line["comparison"].startswith("fraction")], pairs)
elif "slope" in report["trend"]:
    line, trend = stats.linregress(levels, means), report["trend"]
    close("slope", trend["slope"], line.slope, 1e-9)
    close("intercept", trend["intercept"], line.intercept, 1e-9)
    if "f" in trend:
        contrast = (responses[:, : len(levels)] + responses[:, len(levels) :]) / 2 @ (np.array(levels) - np.mean(levels))
        test = stats.ttest_1samp(contrast, 0.0)
        close("trend F", trend["f"], test.statistic**2, 1e-9)
        close("trend p", trend["p"], test.pvalue, 1e-6)
print(f"compared {compared}")
