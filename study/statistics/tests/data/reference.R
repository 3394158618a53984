# Makes reference.json: published data sets, and what R says about them, with all digits.
#
#   Rscript study/statistics/tests/data/reference.R > study/statistics/tests/data/reference.json
#
# Needs R with the packages car and carData; the versions it was made with stand in the file. The data come with
# R (package datasets) and carData; where they were first published is said beside each.
suppressPackageStartupMessages(library(car))
options(contrasts = c("contr.sum", "contr.poly"))

number <- function(x) ifelse(is.nan(x), "null", sprintf("%.17g", x))
array <- function(x) paste0("[", paste(x, collapse = ", "), "]")
numbers <- function(x) array(number(x))
rows <- function(m) array(apply(m, 1, numbers))
text <- function(x) paste0('"', x, '"')
object <- function(...) {
  fields <- list(...)
  paste0("{", paste(text(names(fields)), unlist(fields), sep = ": ", collapse = ", "), "}")
}

t_result <- function(test, difference) object(
  df = number(test$parameter), value = number(test$statistic), p = number(test$p.value),
  difference = number(difference), interval = numbers(test$conf.int))

# One subject per row of `responses`; cells in the order of `idata`, whose last factor runs fastest.
mixed <- function(name, provenance, responses, idata, design_formula, between) {
  data <- c(list(responses = responses), between)
  right <- if (length(between)) paste(names(between), collapse = "*") else "1"
  model <- lm(as.formula(paste("responses ~", right)), data = data)
  table <- function(type) {
    result <- summary(Anova(model, idata = idata, idesign = design_formula, type = type), multivariate = FALSE)
    tests <- result$univariate.tests
    corrections <- result$pval.adjustments
    effects <- setdiff(rownames(tests), "(Intercept)")
    array(sapply(effects, function(effect) {
      line <- tests[effect, ]
      epsilon <- if (effect %in% rownames(corrections)) corrections[effect, ] else rep(NaN, 4)
      object(effect = text(effect), sum_of_squares = number(line["Sum Sq"]), df = number(line["num Df"]),
        error_sum_of_squares = number(line["Error SS"]), error_df = number(line["den Df"]),
        f = number(line["F value"]), p = number(line["Pr(>F)"]),
        epsilon_gg = number(epsilon[1]), p_gg = number(epsilon[2]),
        epsilon_hf = number(epsilon[3]), p_hf = number(epsilon[4]))
    }))
  }
  object(name = text(name), provenance = text(provenance), responses = rows(responses),
    within = array(mapply(function(factor, n) object(name = text(factor), levels = n), names(idata), sapply(idata, nlevels))),
    between = array(mapply(function(factor, groups) object(name = text(factor), groups = numbers(as.integer(groups) - 1)),
      names(between), between)),
    type_2 = table(2), type_3 = table(3))
}

between_only <- function(name, provenance, response, between) {
  model <- lm(as.formula(paste("response ~", paste(names(between), collapse = "*"))), data = c(list(response = response), between))
  table <- function(type) {
    tests <- Anova(model, type = type)
    effects <- setdiff(rownames(tests), c("(Intercept)", "Residuals"))
    error <- tests["Residuals", ]
    array(sapply(effects, function(effect) object(effect = text(effect),
      sum_of_squares = number(tests[effect, "Sum Sq"]), df = number(tests[effect, "Df"]),
      error_sum_of_squares = number(error[["Sum Sq"]]), error_df = number(error[["Df"]]),
      f = number(tests[effect, "F value"]), p = number(tests[effect, "Pr(>F)"]),
      epsilon_gg = "null", p_gg = "null", epsilon_hf = "null", p_hf = "null")))
  }
  object(name = text(name), provenance = text(provenance), responses = rows(matrix(response)), within = "[]",
    between = array(mapply(function(factor, groups) object(name = text(factor), groups = numbers(as.integer(groups) - 1)),
      names(between), between)),
    type_2 = table(2), type_3 = table(3))
}

trend <- function(name, provenance, levels, responses) {
  means <- colMeans(responses)
  fit <- summary(lm(means ~ levels))
  test <- t.test(responses %*% (levels - mean(levels)))
  object(name = text(name), provenance = text(provenance), levels = numbers(levels), responses = rows(responses),
    slope = number(coef(fit)[2, 1]), intercept = number(coef(fit)[1, 1]), r_squared = number(fit$r.squared),
    f = number(test$statistic^2), error_df = number(test$parameter), p = number(test$p.value))
}

line <- function(name, provenance, x, y) {
  fit <- lm(y ~ x)
  s <- summary(fit)
  object(name = text(name), provenance = text(provenance), x = numbers(x), y = numbers(y),
    intercept = number(coef(s)[1, 1]), slope = number(coef(s)[2, 1]),
    intercept_se = number(coef(s)[1, 2]), slope_se = number(coef(s)[2, 2]),
    slope_interval = numbers(confint(fit)[2, ]), slope_p = number(coef(s)[2, 4]),
    r_squared = number(s$r.squared), residual_sd = number(s$sigma), f = number(s$fstatistic[1]))
}

long_to_rows <- function(value, subject, cell) {
  m <- tapply(value, list(subject, cell), mean)
  matrix(as.numeric(m), nrow(m))
}

drug <- sleep$group
a <- sleep$extra[drug == 1]; b <- sleep$extra[drug == 2]
sleep_tests <- object(name = text("sleep"),
  provenance = text("Student (1908), The probable error of a mean, Biometrika 6; R datasets::sleep"),
  first = numbers(a), second = numbers(b),
  paired = t_result(t.test(a, b, paired = TRUE), mean(a - b)),
  one_sample = t_result({r <- t.test(b); r}, mean(b)),
  welch = t_result(t.test(a, b), mean(a) - mean(b)),
  pooled = t_result(t.test(a, b, var.equal = TRUE), mean(a) - mean(b)))

ok <- as.matrix(OBrienKaiser[, 3:17])
ok_cells <- expand.grid(hour = factor(1:5), phase = factor(c("pre", "post", "fup"), levels = c("pre", "post", "fup")))[, 2:1]
co2 <- CO2; co2$Plant <- factor(as.character(co2$Plant))
co2_rows <- long_to_rows(co2$uptake, co2$Plant, co2$conc)
co2_plants <- co2[!duplicated(co2$Plant), ]; co2_plants <- co2_plants[order(co2_plants$Plant), ]
pine <- Loblolly; pine$Seed <- factor(as.character(pine$Seed))
pine_rows <- long_to_rows(pine$height, pine$Seed, pine$age)
chick <- subset(ChickWeight, Time %in% c(0, 4, 8, 12, 16))
chick <- droplevels(subset(chick, ave(Time, Chick, FUN = length) == 5)); chick$Chick <- factor(as.character(chick$Chick))
chick_rows <- long_to_rows(chick$weight, chick$Chick, chick$Time)
chick_birds <- chick[!duplicated(chick$Chick), ]; chick_birds <- chick_birds[order(chick_birds$Chick), ]

anova_sets <- array(c(
  mixed("OBrienKaiser",
    "O'Brien and Kaiser (1985), MANOVA method for analyzing repeated measures designs, Psychological Bulletin 97, table 7; carData",
    ok, ok_cells, ~ phase * hour, list(treatment = OBrienKaiser$treatment, gender = OBrienKaiser$gender)),
  mixed("CO2", "Potvin, Lechowicz and Tardif (1990), The statistical analysis of ecophysiological response curves, Ecology 71; R datasets",
    co2_rows, data.frame(conc = factor(1:7)), ~ conc, list(type = co2_plants$Type, treatment = co2_plants$Treatment)),
  mixed("ChickWeight", "Crowder and Hand (1990), Analysis of repeated measures, example 5.3; R datasets; days 0 to 16 of the birds alive then: groups of unequal size",
    chick_rows, data.frame(day = factor(1:5)), ~ day, list(diet = chick_birds$Diet)),
  mixed("Loblolly", "Kung (1986), Fitting logistic growth curve with predetermined carrying capacity, ASA Proceedings; R datasets",
    pine_rows, data.frame(age = factor(1:6)), ~ age, list()),
  between_only("Moore", "Moore and Krupat (1971), Relationship between source status, authoritarianism, and conformity, Sociometry 34; carData",
    Moore$conformity, list(fcategory = Moore$fcategory, partner = Moore$partner.status)),
  between_only("ToothGrowth", "Crampton (1947), The growth of the odontoblast of the incisor teeth, Journal of Nutrition 33; R datasets",
    ToothGrowth$len, list(supp = ToothGrowth$supp, dose = factor(ToothGrowth$dose))),
  between_only("warpbreaks", "Tippett (1950), Technological applications of statistics, page 106; R datasets",
    warpbreaks$breaks, list(wool = warpbreaks$wool, tension = warpbreaks$tension))))

grid <- expand.grid(f = c(0.02, 1, 13.57, 400, 1e5), df = c(1, 2, 11, 0.73), error_df = c(1, 7.5, 154, 3000))
tails <- array(mapply(function(f, df, error_df) object(f = number(f), df = number(df), error_df = number(error_df),
  p = number(pf(f, df, error_df, lower.tail = FALSE))), grid$f, grid$df, grid$error_df))
t_grid <- expand.grid(t = c(0.01, 1, 3.3, 25, 1e3), df = c(1, 2.5, 15, 400))
t_tails <- array(mapply(function(t, df) object(t = number(t), df = number(df), p = number(2 * pt(-t, df))), t_grid$t, t_grid$df))
q_grid <- expand.grid(p = c(1e-6, 0.01, 0.05, 0.5), df = c(1, 4.2, 15, 1000))
t_quantiles <- array(mapply(function(p, df) object(p = number(p), df = number(df), t = number(qt(p / 2, df, lower.tail = FALSE))), q_grid$p, q_grid$df))
z <- c(-30, -8, -1.5, 0.3, 4)
normal <- array(mapply(function(z) object(z = number(z), below = number(pnorm(z))), z))

cat("{\n", paste(c(
  paste0('"made_with": ', text(paste0(R.version.string, ", car ", packageVersion("car"), ", carData ", packageVersion("carData")))),
  paste0('"t_tests": ', sleep_tests),
  paste0('"anova": ', gsub("}, {\"name\"", "},\n{\"name\"", anova_sets, fixed = TRUE)),
  paste0('"trend": ', trend("Loblolly", "as above", sort(unique(Loblolly$age)), pine_rows)),
  paste0('"line": ', line("cars", "Ezekiel (1930), Methods of correlation analysis; R datasets", cars$speed, cars$dist)),
  paste0('"fisher_above": ', tails), paste0('"student_two_sided": ', t_tails),
  paste0('"student_quantile": ', t_quantiles), paste0('"normal_below": ', normal)), collapse = ",\n"), "\n}\n", sep = "")
