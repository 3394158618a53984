# Repeats the tables of `flotor analyse` from the trials, line by line, and draws figures 17 and 18 of CMU-RI-TR-07-21.
#
#     Rscript THIS.R [TRIALS.csv]
#     source("THIS.R")                in a session of R, in RStudio too
#
# Needs base R alone. Written beside the trials by `flotor analyse --trials`. It knows the defaults of `flotor analyse`: thresholds
# of the procedure, ratings divided by the mean, sums of squares of type III.

# The table of trials as `flotor analyse` named it: it lies beside this script.
table_name <- "trials.csv"

# The file that source() reads now; none outside of source(), and of pasted lines.
sourced_file <- function() {
  for (frame in rev(sys.frames())) {
    file <- frame$ofile
    # With chdir = TRUE, R is in the folder of the file already.
    if (is.character(file)) return(if (file.exists(file)) file else basename(file))
  }
  character(0)
}

# The file that R was started with, as Rscript or `R -f` hand it on: blanks are `~+~` there.
started_file <- function() {
  words <- commandArgs()
  words <- words[seq_len(match("--args", words, nomatch = length(words) + 1) - 1)]
  files <- c(sub("^--file=", "", grep("^--file=", words, value = TRUE)), words[which(words == "-f") + 1])
  gsub("~+~", " ", files[!is.na(files)], fixed = TRUE)
}

table_of_trials <- function() {
  script <- sourced_file()
  # Whoever sources this script has arguments of their own.
  arguments <- if (length(script) == 0) commandArgs(trailingOnly = TRUE) else character(0)
  if (length(arguments) > 0) return(arguments[1])
  if (length(script) == 0) script <- started_file()
  folder <- if (length(script) > 0) dirname(script[1]) else "."
  named_alike <- if (length(script) > 0) sub("(\\.[Rr])?$", ".csv", basename(script[1]))
  places <- file.path(folder, c(named_alike, table_name))
  found <- places[file.exists(places)]
  if (length(found) == 0) stop("no table of trials at ", paste(places, collapse = " or "), "; put it beside this script")
  found[1]
}

path <- table_of_trials()
trials <- read.csv(path, na.strings = "n/a", stringsAsFactors = FALSE)
main <- trials[trials$phase == "main" & is.na(trials$excluded), ]
counted <- main[main$repeated == 0, ]
is_jnd <- any(!is.na(counted$base))
level_name <- if (is_jnd) "base" else "stimulus"
modalities <- c("vh", "h")
names_of <- c(vh = "vision + haptics", h = "haptics alone")
counted$level <- counted[[level_name]]

if (is_jnd) {
  # Thresholds in the unit of the stimulus: the mean over the replications whose track came to one.
  ends <- counted[!is.na(counted$threshold), ]
  ends$value <- ends$threshold
} else {
  # Ratings divided by the mean of all ratings of the subject.
  ends <- counted
  ends$value <- ends$rating / ave(ends$rating, ends$subject)
}
levels <- sort(unique(counted$level))
subjects <- sort(unique(counted$subject))
n <- length(subjects)
# Subjects by modality and level, the levels of a modality side by side.
cells_of <- function(rows) {
  cell <- function(subject, modality, level) {
    mean(rows$value[rows$subject == subject & rows$modality == modality & rows$level == level])
  }
  t(sapply(subjects, function(subject) {
    unlist(lapply(modalities, function(modality) sapply(levels, function(level) cell(subject, modality, level))))
  }))
}
responses <- cells_of(ends)
if (is_jnd) responses <- sweep(responses, 2, c(levels, levels), "*")
vh <- responses[, seq_along(levels), drop = FALSE]
h <- responses[, length(levels) + seq_along(levels), drop = FALSE]
first <- sapply(subjects, function(subject) trials$first_modality[trials$subject == subject][1])

number <- function(value) format(value, digits = 15, trim = TRUE)
say <- function(...) cat(paste(...), "\n", sep = "")
p_text <- function(p) if (p < 0.001) "p < 0.001" else sprintf("p = %.3f", p)
size_text <- function(size) {
  if (size[3] == Inf) return(sprintf("%.2f (%.2f or more)", size[1], size[2]))
  if (size[2] == -Inf) return(sprintf("%.2f (%.2f or less)", size[1], size[3]))
  sprintf("%.2f (%.2f to %.2f)", size[1], size[2], size[3])
}
# Squares below this share of those of the responses are rounding errors, and what is nothing else is not testable.
rounding <- 1e-20
untestable <- function(reason) list(not_testable = reason)
untestable_text <- function(test) paste("not testable:", test$not_testable)
se <- function(x) sd(x) / sqrt(length(x))

contrasts_of <- function(count) qr.Q(qr(cbind(1, diag(count)[, -1, drop = FALSE])))[, -1, drop = FALSE]

# Sums of squares of type III: a group of two between subjects, factors within them; a list of effects by name.
anova_of <- function(values, factors, counts, groups) {
  has_order <- length(unique(groups)) == 2 && nrow(values) > 2
  one <- rep(1, nrow(values))
  between <- list(one)
  names(between) <- ""
  if (has_order) between$order <- ifelse(groups == "vh", 1, -1)
  full <- do.call(cbind, between)
  left_by <- function(design, seen) if (is.null(design)) seen else qr.resid(qr(design), seen)
  found <- list()
  for (chosen in 0:(2^length(factors) - 1)) {
    is_in <- bitwAnd(chosen, 2^(seq_along(factors) - 1)) > 0
    within <- matrix(1)
    for (k in seq_along(factors)) {
      within <- kronecker(within, if (is_in[k]) contrasts_of(counts[k]) else matrix(1 / sqrt(counts[k]), counts[k], 1))
    }
    seen <- values %*% within
    left <- left_by(full, seen)
    error <- sum(left^2)
    error_df <- (nrow(values) - ncol(full)) * ncol(within)
    for (name in names(between)) {
      parts <- c(if (name != "") name, factors[is_in])
      if (length(parts) == 0) next
      rest <- do.call(cbind, between[names(between) != name])
      squares <- sum(left_by(rest, seen)^2) - error
      df <- ncol(within)
      limit <- rounding * sum(values^2)
      if (error <= limit) {
        is_gone <- squares <= limit
        effect <- untestable(if (is_gone) "scaling of the responses removes the effect" else "no variation between subjects, which the test requires")
      } else {
        products <- t(left) %*% left
        gg <- sum(diag(products))^2 / (df * sum(products^2))
        # Huynh and Feldt's correction, with Lecoutre's of it.
        freedom <- nrow(values) - ncol(full)
        epsilon <- ((freedom + 1) * df * gg - 2) / (df * max(freedom - df * gg, 1e-9))
        # Of a single degree of freedom nothing is known: the least value.
        if (freedom == 1) epsilon <- 1 / df
        effect <- list(f = (squares / df) / (error / error_df), df = df, error_df = error_df, epsilon = epsilon)
      }
      found[[paste(parts, collapse = ":")]] <- effect
    }
  }
  found
}

effect_text <- function(effect) {
  if (!is.null(effect$not_testable)) return(untestable_text(effect))
  upper <- function(scale) pf(effect$f, scale * effect$df, scale * effect$error_df, lower.tail = FALSE)
  text <- sprintf("F(%d, %d) = %.2f, %s", effect$df, effect$error_df, effect$f, p_text(upper(1)))
  epsilon <- min(max(effect$epsilon, 1 / effect$df), 1)
  if (effect$df > 1) sprintf("%s (HF %s)", text, p_text(upper(epsilon))) else text
}

# Where a falling function is 0: first between two ends, then farther out; infinite beyond `least` and `most`.
falling_root <- function(of, low, high, least, most) {
  width <- high - low
  while (of(low) < 0) {
    if (low <= least) return(-Inf)
    width <- 2 * width
    high <- low
    low <- max(low - width, least)
  }
  while (of(high) > 0) {
    if (high >= most) return(Inf)
    width <- 2 * width
    low <- high
    high <- min(high + width, most)
  }
  uniroot(of, c(low, high), tol = 1e-12)$root
}

partial_omega_squared <- function(effect) {
  end <- function(below) {
    at <- function(shift) suppressWarnings(pf(effect$f, effect$df, effect$error_df, ncp = shift)) - below
    if (pf(effect$f, effect$df, effect$error_df) <= below) return(0)
    # As far as `flotor analyse` looks; mostly the end is much nearer.
    falling_root(at, 0, max(1, effect$f * effect$df), 0, 1e6)
  }
  share <- function(shift) ifelse(is.finite(shift), shift / (shift + effect$df + effect$error_df + 1), 1)
  c(share(max(effect$df * (effect$f - 1), 0)), share(min(end(0.975), 1e6)), share(end(0.025)))
}

noncentral_t_below <- function(t, df, shift) {
  if (t < 0) return(1 - noncentral_t_below(-t, df, -shift))
  if (abs(shift) < 37) return(suppressWarnings(pt(t, df, ncp = shift)))
  # R has no value far from the middle: the tail of a chi-square, averaged over a normal number.
  normal <- seq(-10, 10, length.out = 4001)
  tail <- pchisq(pmax(normal + shift, 0)^2 * df / max(t, 1e-300)^2, df, lower.tail = FALSE)
  sum(dnorm(normal) * tail) * (normal[2] - normal[1])
}

cohen_d <- function(t, df) {
  end <- function(below) falling_root(function(shift) noncentral_t_below(t, df, shift) - below, t - 1, t + 1, -1e3, 1e3)
  c(t, min(end(0.975), 1e3), max(end(0.025), -1e3)) / sqrt(df + 1)
}

effects <- function(values, factors, counts, groups, sizes) {
  found <- anova_of(values, factors, counts, groups)
  for (name in names(found)) say(name, effect_text(found[[name]]))
  for (name in names(found)) {
    if (sizes && is.null(found[[name]]$not_testable)) say(name, size_text(partial_omega_squared(found[[name]])))
  }
}

# t and p of pairs, or the reason why there are none.
paired <- function(first, second) {
  differences <- first - second
  limit <- rounding * sum(first^2 + second^2)
  if (sum((differences - mean(differences))^2) <= limit) {
    is_none <- sum(differences^2) <= limit
    return(untestable(if (is_none) "no difference in any subject" else "the same difference in every subject"))
  }
  test <- t.test(differences)
  list(t = unname(test$statistic), p = test$p.value)
}

paired_text <- function(test, p = test$p) {
  if (!is.null(test$not_testable)) return(untestable_text(test))
  sprintf("t(%d) = %.2f, %s", n - 1, test$t, p_text(p))
}

comparisons <- function(names, first, second) {
  tests <- lapply(seq_along(names), function(k) paired(first[[k]], second[[k]]))
  # What cannot be tested counts in the family all the same.
  p <- p.adjust(sapply(tests, function(test) if (is.null(test$p)) 1 else test$p), "holm")
  for (k in seq_along(names)) {
    size <- if (is.null(tests[[k]]$t)) NULL else size_text(cohen_d(tests[[k]]$t, n - 1))
    do.call(say, as.list(c(names[k], paired_text(tests[[k]], p[k]), size)))
  }
}

trend_text <- function(means) {
  if (sum((means - mean(means))^2) <= rounding * sum(means^2)) return("not testable: equal means at all levels")
  sprintf("R\u00b2 = %.3f", cor(levels, means)^2)
}

# Mean and interval of one number for each subject.
interval <- function(values) mean(values) + c(0, -1, 1) * se(values) * qt(0.975, length(values) - 1)

columns_of <- function(values) lapply(seq_len(ncol(values)), function(k) values[, k])

if (is_jnd) {
  say(sprintf("%d subjects, %.1f pairs each", n, nrow(counted) / n))
  fractions <- list(vh = sweep(vh, 2, levels, "/"), h = sweep(h, 2, levels, "/"))
  weber <- lapply(fractions, rowMeans)
  for (modality in modalities) {
    ends <- 100 * interval(weber[[modality]])
    say(sprintf("%s %.1f %% (95 %%: %.1f to %.1f)", names_of[modality], ends[1], ends[2], ends[3]))
  }
  say("difference", paired_text(paired(weber$h, weber$vh)))
} else {
  say(sprintf("%d subjects, %s ratings each", n, number(nrow(counted) / n)))
  say(sum(main$repeat. > 0), "presentations repeated because the handle left its range")
  say("Linear trend", trend_text(colMeans(vh + h)))
}
for (k in seq_along(levels)) {
  name <- if (is_jnd) paste("base", number(levels[k])) else sprintf("stimulus %.2f", levels[k])
  cell <- function(values) sprintf("%.3f (se %.3f)", mean(values[, k]), se(values[, k]))
  say(name, cell(vh), cell(h))
}

several <- length(levels) > 1
counts <- c(2, if (several) length(levels))
effects(responses, c("modality", if (several) level_name), counts, first, TRUE)
comparisons(sprintf("h - vh, %s %s", level_name, sapply(round(levels, 4), number)), columns_of(h), columns_of(vh))
if (is_jnd && several) {
  both <- (fractions$vh + fractions$h) / 2
  pairs <- combn(seq_along(levels), 2)
  text <- sprintf("fraction, base %s - %s", sapply(levels[pairs[2, ]], number), sapply(levels[pairs[1, ]], number))
  comparisons(text, lapply(pairs[2, ], function(k) both[, k]), lapply(pairs[1, ], function(k) both[, k]))
  for (modality in modalities) {
    constancy <- anova_of(fractions[[modality]], "base", length(levels), rep("", n))
    say(sprintf("fraction over base, %s", modality), effect_text(constancy$base))
  }
}
for (measure in c("speed", "acceleration", "force")) {
  # One number for each stimulus of a trial; of a pair the base alone counts.
  each <- strsplit(as.character(counted[[paste0(measure, "_each")]]), " ")
  rows <- counted[rep(seq_along(each), lengths(each)), c("subject", "modality", "level", "comparison_at")]
  rows$value <- as.numeric(unlist(each))
  place <- sequence(lengths(each)) - 1
  if (is_jnd) rows <- rows[place %% 2 == (rows$comparison_at == "first"), ]
  moved <- cells_of(rows[!is.na(rows$value), ])
  if (anyNA(moved)) next
  effects(moved, c("modality", if (several) "stimulus"), counts, rep("", n), FALSE)
  if (several) {
    # Exponent of the stimulus to which the measure is proportional, subject by subject.
    both <- log((moved[, seq_along(levels)] + moved[, length(levels) + seq_along(levels)]) / 2)
    exponents <- apply(both, 1, function(values) cov(log(levels), values) / var(log(levels)))
    ends <- mean(exponents) + c(-1, 1) * qt(0.975, n - 1) * se(exponents)
    say(sprintf("exponent of the stimulus %.3f (95 %%: %.3f to %.3f)", mean(exponents), ends[1], ends[2]))
  }
}
if (is_jnd) {
  none <- aggregate(!is.na(threshold) ~ subject + track, counted, any)
  none <- sum(!none[[3]])
  if (none > 0) say(none, "tracks did not reach a threshold and are omitted")
}

svg(sub("\\.csv$", "-R.svg", path), width = 6, height = 4)
means <- cbind(colMeans(vh), colMeans(h))
errors <- cbind(apply(vh, 2, se), apply(h, 2, se))
matplot(levels, means, type = "p", pch = c(16, 17), col = c("#0072B2", "#D55E00"), xlab = level_name,
        ylab = if (is_jnd) "threshold" else "rating, scaled", ylim = range(means - errors, means + errors))
for (k in 1:2) {
  arrows(levels, means[, k] - errors[, k], levels, means[, k] + errors[, k], angle = 90, code = 3, length = 0.03)
}
legend("topleft", names_of, pch = c(16, 17), col = c("#0072B2", "#D55E00"), bty = "n")
invisible(dev.off())
