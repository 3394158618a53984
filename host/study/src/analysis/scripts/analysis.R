# Repeats the tables of `flotor analyse` from the trials, and draws figures 17 and 18 of CMU-RI-TR-07-21.
#
#     Rscript THIS.R [TRIALS.csv]
#
# Needs base R alone. Written beside the trials by `flotor analyse --trials`. The analysis of variance is that of groups of
# equal size, where all types of sums of squares agree; for others use car::Anova(type = 3).

arguments <- commandArgs(trailingOnly = TRUE)
script <- sub("^--file=", "", grep("^--file=", commandArgs(), value = TRUE))
path <- if (length(arguments) > 0) arguments[1] else sub("\\.R$", ".csv", script)
trials <- read.csv(path, na.strings = "n/a")
counted <- trials[trials$phase == "main" & trials$repeated == 0 & is.na(trials$excluded), ]
is_jnd <- any(!is.na(counted$base))
level_name <- if (is_jnd) "base" else "stimulus"

if (is_jnd) {
  ends <- counted[!is.na(counted$threshold), ]
  ends$value <- ends$threshold * ends$base
} else {
  ends <- counted
  ends$value <- ends$rating / ave(ends$rating, ends$subject)
}
ends$level <- ends[[level_name]]
cells <- aggregate(value ~ subject + first_modality + modality + level, ends, mean)
cells <- cells[order(cells$subject, cells$modality, cells$level), ]

if (is_jnd) {
  cells$fraction <- cells$value / cells$level
  weber <- aggregate(fraction ~ subject + modality, cells, mean)
  vh <- weber$fraction[weber$modality == "vh"]
  h <- weber$fraction[weber$modality == "h"]
  for (name in c("vh", "h")) {
    test <- t.test(if (name == "vh") vh else h)
    cat(sprintf("Weber fraction %s: %.1f %%  (95 %%: %.1f to %.1f)\n", name, 100 * test$estimate,
                100 * test$conf.int[1], 100 * test$conf.int[2]))
  }
  test <- t.test(h, vh, paired = TRUE)
  cat(sprintf("difference: t(%d) = %.2f, p = %.3f\n", test$parameter, test$statistic, test$p.value))
}
print(aggregate(value ~ modality + level, cells, function(x) c(mean = mean(x), se = sd(x) / sqrt(length(x)))))

cells$subject <- factor(cells$subject)
cells$order <- factor(cells$first_modality)
cells$modality <- factor(cells$modality, levels = c("vh", "h"))
cells$level <- factor(cells$level)
formula <- if (nlevels(cells$order) > 1) {
  value ~ order * modality * level + Error(subject / (modality * level))
} else {
  value ~ modality * level + Error(subject / (modality * level))
}
print(summary(aov(formula, cells)))

p <- sapply(levels(cells$level), function(level) {
  here <- cells[cells$level == level, ]
  t.test(here$value[here$modality == "h"], here$value[here$modality == "vh"], paired = TRUE)$p.value
})
cat("h - vh at each level, p after Holm:\n")
print(p.adjust(p, "holm"))

svg(sub("\\.csv$", "-R.svg", path), width = 6, height = 4)
means <- tapply(cells$value, list(cells$level, cells$modality), mean)
errors <- tapply(cells$value, list(cells$level, cells$modality), function(x) sd(x) / sqrt(length(x)))
at <- as.numeric(rownames(means))
matplot(at, means, type = "p", pch = c(16, 17), col = c("#0072B2", "#D55E00"), xlab = level_name,
        ylab = if (is_jnd) "threshold" else "rating, scaled", ylim = range(means - errors, means + errors))
for (k in 1:2) arrows(at, means[, k] - errors[, k], at, means[, k] + errors[, k], angle = 90, code = 3, length = 0.03)
legend("topleft", c("vision + haptics", "haptics alone"), pch = c(16, 17), col = c("#0072B2", "#D55E00"), bty = "n")
invisible(dev.off())
