# Makes ranks.json: tests by ranks, psychometric functions and quantiles as base R computes them, with all digits.
#
#   Rscript study/statistics/tests/data/ranks.R > study/statistics/tests/data/ranks.json
#
# The data come with R (package datasets), or are drawn from a seed; nested, unbalanced, tied and tiny ones among them.
number <- function(x) ifelse(is.nan(x), "null", sprintf("%.17g", x))
array <- function(x) paste0("[", paste(x, collapse = ", "), "]")
numbers <- function(x) array(number(x))
lists <- function(x) array(sapply(x, numbers))
object <- function(...) {
  fields <- list(...)
  paste0("{", paste(paste0('"', names(fields), '"'), unlist(fields), sep = ": ", collapse = ", "), "}")
}
set.seed(55)

pair <- function(first, second) {
  test <- suppressWarnings(wilcox.test(first, second, paired = TRUE))
  object(first = numbers(first), second = numbers(second), v = number(test$statistic), p = number(test$p.value))
}
pairs <- c(
  pair(sleep$extra[sleep$group == 1], sleep$extra[sleep$group == 2]),
  pair(rnorm(8), rnorm(8)), pair(rnorm(49), rnorm(49) + 0.3), pair(rnorm(60), rnorm(60)),
  pair(round(rnorm(30)), round(rnorm(30) + 0.4)), pair(c(1.5, 2.25), c(1, 3)), pair(0.5, 2), pair(round(rnorm(12), 1), round(rnorm(12), 1)))

rows <- function(m) {
  test <- friedman.test(m)
  object(rows = lists(asplit(m, 1)), chi_square = number(test$statistic), df = number(test$parameter), p = number(test$p.value))
}
friedman <- c(
  rows(as.matrix(attitude)), rows(matrix(rnorm(36), 12)), rows(matrix(round(rnorm(40)), 10)), rows(matrix(rnorm(6), 2)),
  rows(matrix(rnorm(24), 12)), rows(matrix(round(rnorm(60), 1), 6)))

groups <- function(x) {
  test <- kruskal.test(x)
  object(groups = lists(x), chi_square = number(test$statistic), df = number(test$parameter), p = number(test$p.value))
}
air <- split(airquality$Ozone[!is.na(airquality$Ozone)], airquality$Month[!is.na(airquality$Ozone)])
kruskal <- c(
  groups(air), groups(split(InsectSprays$count, InsectSprays$spray)), groups(list(rnorm(3), rnorm(9), rnorm(1))),
  groups(list(rnorm(2), rnorm(2))), groups(list(round(rnorm(20)), round(rnorm(5)))))

curve <- function(level, positive, answers) {
  fit <- suppressWarnings(glm(cbind(positive, answers - positive) ~ level, family = binomial(probit),
    control = glm.control(epsilon = 1e-15, maxit = 200)))
  line <- coef(fit)
  object(level = numbers(level), positive = numbers(positive), answers = numbers(answers),
    location = number(-line[[1]] / line[[2]]), spread = number(1 / line[[2]]), deviance = number(deviance(fit)))
}
draw <- function(level, n, location, spread) rbinom(length(level), n, pnorm((level - location) / spread))
steps <- seq(-0.3, 0.3, 0.1)
curves <- c(
  curve(steps, draw(steps, 20, 0.02, 0.15), rep(20, 7)), curve(steps, draw(steps, 6, 0, 0.25), rep(6, 7)),
  curve(c(0, 1, 2, 3), c(2, 6, 13, 19), c(20, 20, 20, 20)), curve(1000 + 50 * steps, draw(steps, 12, 0, 0.2), rep(12, 7)),
  curve(c(0.1, 0.2, 0.5), c(3.5, 4, 9.5), c(10, 8, 10)))

cat(object(version = paste0('"', R.version.string, '"'), pairs = array(pairs), friedman = array(friedman), kruskal = array(kruskal),
  curves = array(curves),
  quantiles = array(sapply(c(1e-9, 0.001, 0.025, 0.3, 0.5, 0.9, 0.999), function(p) object(p = number(p), z = number(qnorm(p))))),
  chi_squares = array(unlist(lapply(c(1, 2, 3, 7, 40), function(df) sapply(c(0.1, 1, 3.8, 20, 90), function(x)
    object(x = number(x), df = number(df), p = number(pchisq(x, df, lower.tail = FALSE)))))))), "\n")
