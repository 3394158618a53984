# Repeats the rows of `flotor analyse` for a study of one's own design, from the table of trials.
#
#     Rscript THIS.R [TRIALS.csv]
#
# Needs base R alone. Written beside the trials by `flotor analyse --trials`.
arguments <- commandArgs(trailingOnly = TRUE)
path <- if (length(arguments) > 0) arguments[1] else "@TABLE@"
within <- c(@WITHIN@)
between <- c(@BETWEEN@)
levels_of <- list(@LEVELS@)
kind <- "@MEASURE@"

trials <- read.csv(path, na.strings = "n/a", stringsAsFactors = FALSE, check.names = FALSE)
counted <- trials[trials$counts == 1, ]
four <- function(x) sprintf("%.4f", x)
p_text <- function(p) ifelse(p < 0.001, "p < 0.001", sprintf("p = %.3f", p))
line <- function(name, text) cat(sprintf("  %-38s%s\n", name, text))

# The measure of a subject in a condition.
measure <- function(cell) {
  if (kind == "sensitivity") {
    z <- function(cell) qnorm((sum(cell$positive) + 0.5) / (nrow(cell) + 1))
    return(z(cell[cell$signal == "present", ]) - z(cell[cell$signal == "absent", ]))
  }
  if (kind == "difference") {
    positive <- tapply(cell$positive, cell$level, sum)
    all <- tapply(cell$positive, cell$level, length)
    level <- as.numeric(names(positive))
    some <- level[positive > 0]
    others <- level[all > positive]
    # Answers that do not rise with the level, or change from none to all at once, have no function.
    if (length(some) == 0 || length(others) == 0 || max(some) <= min(others) || max(others) <= min(some)) return(NA)
    # Half counts of "I don't know" are no error here.
    fit <- suppressWarnings(glm(cbind(positive, all - positive) ~ level, family = binomial(probit),
      control = glm.control(epsilon = 1e-14, maxit = 100)))
    slope <- coef(fit)[[2]]
    return(if (slope * diff(range(level)) > 1e-9) qnorm(0.75) / slope else NA)
  }
  switch(kind, share = mean(cell$positive), threshold = mean(cell$threshold, na.rm = TRUE),
    rating = mean(as.numeric(cell$answer)), "log-magnitude" = mean(log(as.numeric(cell$answer))))
}

factors <- c(within, between)
cells <- unique(counted[c("subject", factors)])
in_cell <- function(table, cell, names) {
  here <- rep(TRUE, nrow(table))
  for (name in names) here <- here & table[[name]] == cell[[name]]
  here
}
cells$value <- sapply(seq_len(nrow(cells)), function(index)
  measure(counted[in_cell(counted, cells[index, , drop = FALSE], c("subject", factors)), ]))

# Means over subjects with their intervals.
conditions <- if (length(factors)) unique(cells[factors]) else data.frame(all = 1)
for (index in seq_len(nrow(conditions))) {
  values <- cells$value[in_cell(cells, conditions[index, , drop = FALSE], factors)]
  values <- values[!is.na(values)]
  if (length(values) < 2) next
  half <- sd(values) / sqrt(length(values)) * qt(0.975, length(values) - 1)
  name <- if (length(factors)) paste(sapply(sort(factors), function(factor) paste(factor, conditions[[factor]][index])), collapse = ", ") else "all"
  line(name, sprintf("%s  (95 %%: %s to %s), n = %d", four(mean(values)), four(mean(values) - half), four(mean(values) + half), length(values)))
}

# Analysis of variance, sums of squares of type III: contrasts within subjects, explained by the groups.
cells <- cells[!cells$subject %in% cells$subject[is.na(cells$value)], ]
subjects <- unique(cells$subject)
within <- Filter(function(factor) length(levels_of[[factor]]) > 1, within)
between <- Filter(function(factor) length(levels_of[[factor]]) > 1, between)
# The last factor runs fastest.
grid <- if (length(within)) rev(expand.grid(rev(levels_of[within]), stringsAsFactors = FALSE)) else data.frame(all = 1)
response <- matrix(0, length(subjects), nrow(grid))
for (row in seq_along(subjects)) for (column in seq_len(nrow(grid)))
  response[row, column] <- mean(cells$value[cells$subject == subjects[row] & in_cell(cells, grid[column, , drop = FALSE], within)])
contrast <- function(n) qr.Q(qr(cbind(1, diag(n)[, -n])))[, -1, drop = FALSE]
terms <- function(names) {
  all <- list(character(0))
  for (name in names) all <- c(all, lapply(all, c, name))
  all[order(sapply(all, length))]
}
groups <- lapply(setNames(between, between), function(factor) cells[[factor]][match(subjects, cells$subject)])
coded <- function(term) {
  columns <- matrix(1, length(subjects), 1)
  for (factor in term) {
    own <- contr.sum(length(levels_of[[factor]]))[match(groups[[factor]], levels_of[[factor]]), , drop = FALSE]
    columns <- do.call(cbind, lapply(seq_len(ncol(own)), function(column) columns * own[, column]))
  }
  columns
}
rest <- function(y, x) sum(qr.resid(qr(x), y)^2)
if (length(c(within, between)) > 0 && length(subjects) > 1) {
  of_groups <- lapply(terms(between), coded)
  full <- do.call(cbind, of_groups)
  for (inside in terms(within)) {
    weights <- matrix(1, 1, 1)
    for (factor in within) {
      n <- length(levels_of[[factor]])
      weights <- weights %x% (if (factor %in% inside) contrast(n) else matrix(1 / sqrt(n), n, 1))
    }
    if (length(within) == 0) weights <- matrix(1, 1, 1)
    products <- response %*% weights
    for (index in seq_along(of_groups)) {
      term <- terms(between)[[index]]
      if (length(c(term, inside)) == 0) next
      smaller <- do.call(cbind, c(list(matrix(0, length(subjects), 0)), of_groups[-index]))
      error <- rest(products, full)
      effect <- (if (ncol(smaller)) rest(products, smaller) else sum(products^2)) - error
      df <- ncol(of_groups[[index]]) * ncol(weights)
      error_df <- (length(subjects) - qr(full)$rank) * ncol(weights)
      f <- effect / df / (error / error_df)
      line(paste(c(term, inside), collapse = ":"), sprintf("F(%d, %d) = %.2f, %s", df, error_df, f, p_text(pf(f, df, error_df, lower.tail = FALSE))))
    }
  }
}

# By ranks, over the mean of each subject at each level; a test of values that are all tied has no result.
for (factor in within) {
  if (length(subjects) < 2) break
  wide <- tapply(cells$value, list(cells$subject, factor(cells[[factor]], levels_of[[factor]])), mean)
  test <- friedman.test(wide)
  if (is.nan(test$p.value)) next
  line(factor, sprintf("chi-square(%d) = %.2f, %s", test$parameter, test$statistic, p_text(test$p.value)))
}
for (factor in between) {
  if (length(subjects) < 2) break
  means <- tapply(cells$value, cells$subject, mean)
  group <- cells[[factor]][match(names(means), cells$subject)]
  if (length(unique(group)) < length(levels_of[[factor]])) next
  test <- kruskal.test(means, factor(group))
  if (is.nan(test$p.value)) next
  line(factor, sprintf("chi-square(%d) = %.2f, %s", test$parameter, test$statistic, p_text(test$p.value)))
}
for (factor in within) {
  if (length(subjects) < 1) break
  wide <- tapply(cells$value, list(cells$subject, factor(cells[[factor]], levels_of[[factor]])), mean)
  pairs <- combn(ncol(wide), 2)
  tests <- lapply(seq_len(ncol(pairs)), function(index)
    suppressWarnings(wilcox.test(wide[, pairs[2, index]], wide[, pairs[1, index]], paired = TRUE)))
  p <- sapply(tests, function(test) test$p.value)
  # A comparison without any difference counts with 1.
  holm <- p.adjust(ifelse(is.nan(p), 1, p), "holm")
  for (index in which(!is.nan(p))) {
    name <- paste0(factor, " ", colnames(wide)[pairs[2, index]], " - ", colnames(wide)[pairs[1, index]])
    line(name, sprintf("V = %g, %s, Holm %s", tests[[index]]$statistic, p_text(p[index]), p_text(holm[index])))
  }
}
