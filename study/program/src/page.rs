//! HTML page of a study, a single self-contained file: figure 17 or 18 of CMU-RI-TR-07-21 with the study's data, and all results; a
//! comparable study also has the results of the thesis.

mod figures;

use crate::analyse::provenance::Provenance;
use crate::analyse::report::Report;
use flotor_analysis::exclusion::Applied;
use flotor_analysis::published::ThesisComparison;
use flotor_analysis::{
    Analysis, Estimator, JndAnalysis, KinematicMeasure, MagnitudeAnalysis, PairTest, PostHoc, SubjectChecks,
    SubjectRecord, effect_text, exponent_text, order_note, p_text, published, size_interval_text, t_text,
};
use flotor_plot::{Figure, escape};
use flotor_statistics::anova::Effect;
use flotor_statistics::describe::MeanInterval;
use flotor_statistics::not_testable_text;
use flotor_statistics::trend::LinearTrend;
use flotor_study::exclusion::{Exclusion, ExclusionRules};
use flotor_study::log::Begin;
use flotor_study::protocol::{Protocol, Stimulus};
use flotor_study::trial::Modality;
use std::fmt::Write;

/// Returns the HTML page of a result.
///
/// `begin` is the first line of any log of the study, `applied` has the analysed sittings and the exclusions.
#[must_use]
pub(crate) fn html(begin: &Begin, report: &Report<'_>, applied: &Applied) -> String {
    let stimulus = begin.protocol.stimulus();
    let levels = begin.protocol.levels();
    let restriction = report.observer.restriction();
    let mut page = Page { text: String::new(), watermark: restriction.unwrap_or_default() };
    if let Some(restriction) = restriction {
        page.paragraph(&format!("{}: no number of this page is from people.", capitalised(restriction)));
    }
    let title = match report.analysis {
        Analysis::Jnd(jnd) => {
            jnd_page(&mut page, jnd, (&begin.protocol, &applied.kept), stimulus, levels);
            format!("Just noticeable difference of {stimulus}")
        }
        Analysis::Magnitude(magnitude) => {
            magnitude_page(&mut page, magnitude, stimulus, levels);
            format!("Perceived magnitude of {stimulus}")
        }
    };
    let title = restriction.map_or(title.clone(), |restriction| format!("{title}: {restriction}"));
    checks(&mut page, report.checks);
    exclusions(&mut page, &begin.exclusion(), applied);
    provenance(&mut page, begin, report.provenance);
    format!(
        "<!doctype html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n<title>{title}</title>\n\
         <meta name=\"viewport\" content=\"width=device-width\">\n<style>{STYLE}</style>\n</head>\n<body>\n\
         <h1>{title}</h1>\n{body}</body>\n</html>\n",
        title = escape(&title),
        body = page.text,
    )
}

/// Adds a table of each subject's check results; nothing without checks.
fn checks(page: &mut Page, checks: &[SubjectChecks]) {
    if checks.is_empty() {
        return;
    }
    page.heading("Checks");
    page.table(&["Subject", "Catch trials and repeated trials"], |rows| {
        checks.iter().for_each(|one| rows.row(&[one.subject.clone(), one.to_text()]));
    });
}

/// Adds the exclusions and the rules that could not be applied; nothing without rules and exclusions.
fn exclusions(page: &mut Page, rules: &ExclusionRules, applied: &Applied) {
    if rules.are_none() && applied.excluded.is_empty() {
        return;
    }
    page.heading("Exclusions");
    let names: Vec<String> = rules.names().iter().map(|rule| rules.text_of(rule)).collect();
    let names = if names.is_empty() { "none".to_owned() } else { names.join("; ") };
    page.paragraph(&format!("Rules of the study file: {names}. Excluded:"));
    page.table(&["Subject", "What", "Rule", "Found"], |rows| {
        if applied.excluded.is_empty() {
            rows.row(&["nothing".to_owned(), String::new(), String::new(), String::new()]);
        }
        for Exclusion { subject, scope, rule, found } in &applied.excluded {
            rows.row(&[subject.to_string(), scope.to_string(), rules.text_of(rule), found.clone()]);
        }
    });
    for rule in &applied.not_applied {
        page.paragraph(&format!("Not applied: {rule}."));
    }
    applied.warnings().for_each(|warning| page.paragraph(&format!("{warning}.")));
}

fn jnd_page(
    page: &mut Page,
    analysis: &JndAnalysis,
    (protocol, subjects): (&Protocol, &[SubjectRecord]),
    stimulus: &Stimulus,
    levels: &[f64],
) {
    let [vh, h] = [&analysis.weber_detail.vh, &analysis.weber_detail.h];
    let how = match analysis.estimator {
        Estimator::Procedure => "the mean of each track's last differences, or its posterior for QUEST+",
        Estimator::Map => "the most likely observer given all answers of a subject at a base",
    };
    page.paragraph(&format!(
        "{} subjects compared {:.1} pairs each on average. The Weber fraction was {} with vision and haptics and {} with haptics \
         alone, {}. Thresholds are {how}.",
        analysis.subjects,
        analysis.pairs_per_subject,
        percent(vh),
        percent(h),
        analysis.t.to_text(t_text),
    ));
    let as_printed = analysis.thesis.text(
        ", as figure 18 of CMU-RI-TR-07-21. Its bars are printed without numbers; the markers are its mean Weber fraction, \
         14.2 and 17.2 %, times the base",
    );
    let caption = format!("Thresholds by base and modality{as_printed}.");
    page.figure(figures::thresholds(analysis, stimulus), &caption);
    page.heading("Weber fractions");
    page.table(&["", "this study", "95 % interval", "thesis"], |rows| {
        for ((name, detail), published) in
            [("Vision and haptics", vh), ("Haptics alone", h)].into_iter().zip(published::WEBER)
        {
            let [low, high] = detail.interval.map(|end| end * 100.0);
            rows.row(&[
                name.to_owned(),
                percent(detail),
                format!("{low:.1} to {high:.1} %"),
                analysis.thesis.text(&format!("{:.1} %", published * 100.0)).to_owned(),
            ]);
        }
        let t = &analysis.t;
        let interval = t.tested().map(|t| t.interval.map(|end| end * 100.0));
        rows.row(&[
            "Difference".to_owned(),
            t.to_text(t_text),
            interval.map_or(String::new(), |[low, high]| format!("{low:.1} to {high:.1} %")),
            analysis.thesis.text(published::T).to_owned(),
        ]);
    });
    page.heading("Thresholds");
    let cells = analysis.thresholds.iter().map(|cell| (cell.modality, cell.base, &cell.threshold));
    page.means("Base", cells);
    page.heading("Effects on thresholds");
    page.effects(&analysis.anova, analysis.thesis.effects(&published::JND));
    order_note(&analysis.anova).into_iter().for_each(|note| page.paragraph(&format!("{note}.")));
    page.comparisons(&analysis.post_hoc);
    page.paragraph("Is the Weber fraction the same at every base? Within each modality, on fractions:");
    let constancy =
        [("Vision and haptics", &analysis.constancy.vh), ("Haptics alone", &analysis.constancy.h)];
    let mut lines = Vec::new();
    let mut beside = Vec::new();
    for ((name, effect), report) in constancy.into_iter().zip(published::CONSTANCY) {
        if let Some(effect) = effect {
            lines.push(Effect { effect: name.to_owned(), ..effect.clone() });
            beside.push((name, report));
        }
    }
    page.effects(&lines, analysis.thesis.effects(&beside));
    page.figure(
        figures::subjects(analysis),
        "Each subject's Weber fraction without vision against that with it.",
    );
    if let Protocol::Jnd(jnd) = protocol {
        page.figure(
            figures::psychometric(jnd, subjects),
            "Right answers over the difference, and the function of each subject.",
        );
    }
    tracks(page, subjects, stimulus);
    movements(page, (analysis.task, analysis.thesis), &analysis.kinematics, levels, stimulus);
    let omitted = analysis.omitted_tracks();
    if omitted > 0 {
        page.paragraph(&format!("{omitted} tracks did not reach a threshold and are omitted."));
    }
}

/// Adds the tracks of the first subject, and the tracks of all other subjects in a collapsed section.
fn tracks(page: &mut Page, subjects: &[SubjectRecord], stimulus: &Stimulus) {
    let Some((first, others)) = subjects.split_first() else { return };
    page.figure(figures::tracks(first, stimulus), "The adaptive tracks of the first subject.");
    if others.is_empty() {
        return;
    }
    page.folded(&format!("Tracks of the other {} subjects", others.len()), |page| {
        for record in others {
            page.figure(
                figures::tracks(record, stimulus),
                &format!("The adaptive tracks of {}.", record.subject),
            );
        }
    });
}

fn magnitude_page(page: &mut Page, analysis: &MagnitudeAnalysis, stimulus: &Stimulus, levels: &[f64]) {
    let rise = |trend: &LinearTrend| {
        let test = trend
            .test
            .to_text(|test| format!("F({}, {}) = {:.2}, {}", test.df, test.error_df, test.f, p_text(test.p)));
        let thesis = format!(" (thesis: {})", published::LINEAR_R2);
        format!("R² = {:.3}{}, {test}", trend.r_squared, analysis.thesis.text(&thesis))
    };
    page.paragraph(&format!(
        "{} subjects gave {} ratings each; {} presentations were repeated because the handle left its range. Linear trend \
         of the mean rating over the stimulus: {}.",
        analysis.subjects,
        analysis.trials_per_subject,
        analysis.repeated,
        analysis.trend.to_text(rise),
    ));
    let as_printed = analysis.thesis.text(", as figure 17 of CMU-RI-TR-07-21");
    let caption = format!("Mean ratings over the stimulus{as_printed}.");
    page.figure(figures::ratings(analysis, stimulus), &caption);
    page.heading("Ratings");
    page.means("Stimulus", analysis.ratings.iter().map(|cell| (cell.modality, cell.stimulus, &cell.rating)));
    page.heading("Effects on ratings");
    page.effects(&analysis.anova, analysis.thesis.effects(&published::MAGNITUDE));
    order_note(&analysis.anova).into_iter().for_each(|note| page.paragraph(&format!("{note}.")));
    page.comparisons(&analysis.post_hoc);
    movements(page, (analysis.task, analysis.thesis), &analysis.kinematics, levels, stimulus);
}

fn movements(
    page: &mut Page,
    (task, beside): (&str, ThesisComparison),
    measures: &[KinematicMeasure],
    levels: &[f64],
    stimulus: &Stimulus,
) {
    let Some(figure) = figures::movements(measures, levels, stimulus) else { return };
    page.heading("Exploration of the stimuli");
    page.figure(figure, "Mean speed, acceleration and force along the vertical (thesis: section 4.3).");
    for measure in measures {
        page.paragraph(&format!("Effects on {}:", measure.measure));
        page.effects(&measure.anova, beside.effects(published::movement(task, measure.measure)));
        if let Some(exponent) = &measure.exponent {
            let direction = published::direction(measure.measure, exponent);
            let beside = direction.filter(|_| beside == ThesisComparison::Thesis);
            let beside = beside.map_or(String::new(), |text| format!("; thesis: {text}"));
            page.paragraph(&format!("Exponent of the stimulus: {}{beside}.", exponent_text(exponent)));
        }
    }
}

/// Adds provenance, study file, protocol and apparatus.
fn provenance(page: &mut Page, begin: &Begin, provenance: &Provenance) {
    page.heading("Protocol and provenance");
    page.table(&["", ""], |rows| {
        rows.row(&["command".to_owned(), format!("flotor study {}", begin.protocol.task())]);
        for (name, value) in provenance.lines() {
            rows.row(&[name.to_owned(), value]);
        }
    });
    if let Some((name, text)) = provenance.study_file() {
        page.details(&format!("Study file {name}"), text);
    }
    let settings = serde_json::to_string_pretty(&begin.protocol).unwrap_or_default();
    let apparatus = serde_json::to_string_pretty(&begin.apparatus).unwrap_or_default();
    for (name, text) in [("Protocol", settings), ("Apparatus", apparatus)] {
        page.details(name, &text);
    }
}

/// Style sheet for light and dark screens and for print; tables with three horizontal rules, as in journals.
const STYLE: &str = "body{font:16px/1.5 system-ui,sans-serif;max-width:58rem;margin:2rem auto;padding:0 1rem;\
    color-scheme:light dark}h1{line-height:1.2}figure{margin:1.5rem 0}figcaption{font-size:.9rem;opacity:.8}\
    svg{max-width:100%;height:auto}table{border-collapse:collapse;margin:1rem 0;font-variant-numeric:tabular-nums;\
    border-top:2px solid;border-bottom:2px solid;font-size:.92rem}thead{border-bottom:1px solid}\
    th,td{padding:.2rem .9rem .2rem 0;text-align:left;vertical-align:baseline}pre{overflow-x:auto;line-height:1.4}\
    @media print{details{display:none}body{margin:0}}";

fn percent(value: &MeanInterval) -> String {
    format!("{:.1} %", value.mean * 100.0)
}

/// Capitalises the first letter.
fn capitalised(text: &str) -> String {
    let mut letters = text.chars();
    letters.next().map_or_else(String::new, |first| first.to_uppercase().chain(letters).collect())
}

/// Formats a p-value for a column with the heading p: `0.250`, or `< 0.001`.
fn p_cell(p: f64) -> String {
    p_text(p).replace("p = ", "").replace("p ", "")
}

/// HTML page under construction.
struct Page {
    text: String,
    /// Watermark of every figure; empty for answers of people.
    watermark: &'static str,
}

impl Page {
    fn heading(&mut self, text: &str) {
        let _ = writeln!(self.text, "<h2>{}</h2>", escape(text));
    }

    fn paragraph(&mut self, text: &str) {
        let _ = writeln!(self.text, "<p>{}</p>", escape(text));
    }

    fn details(&mut self, name: &str, text: &str) {
        let [name, text] = [name, text].map(escape);
        let _ = writeln!(self.text, "<details><summary>{name}</summary><pre>{text}</pre></details>");
    }

    fn figure(&mut self, figure: Figure, caption: &str) {
        let svg = figure.watermark(self.watermark).to_svg();
        let _ = writeln!(self.text, "<figure>{svg}<figcaption>{}</figcaption></figure>", escape(caption));
    }

    /// Adds a section, initially collapsed, with the content of `fill`.
    fn folded(&mut self, summary: &str, fill: impl FnOnce(&mut Self)) {
        let _ = writeln!(self.text, "<details><summary>{}</summary>", escape(summary));
        fill(self);
        self.text.push_str("</details>\n");
    }

    fn table(&mut self, head: &[&str], fill: impl FnOnce(&mut Rows<'_>)) {
        self.text.push_str("<table><thead><tr>");
        head.iter().for_each(|cell| {
            let _ = write!(self.text, "<th>{}</th>", escape(cell));
        });
        self.text.push_str("</tr></thead><tbody>\n");
        fill(&mut Rows(&mut self.text));
        self.text.push_str("</tbody></table>\n");
    }

    /// Adds a table of means and standard errors per condition, with the modalities side by side.
    fn means<'m>(&mut self, level: &str, cells: impl Iterator<Item = (Modality, f64, &'m MeanInterval)>) {
        let cells: Vec<_> = cells.collect();
        let of = |modality| cells.iter().filter(move |(of, ..)| *of == modality);
        let cell = |value: &MeanInterval| format!("{:.3} (se {:.3})", value.mean, value.se);
        self.table(&[level, "Vision and haptics", "Haptics alone"], |rows| {
            for ((_, level, vh), (_, _, h)) in of(Modality::Vh).zip(of(Modality::H)) {
                rows.row(&[format!("{:.2}", level), cell(vh), cell(h)]);
            }
        });
    }

    fn comparisons(&mut self, comparisons: &[PostHoc]) {
        if comparisons.is_empty() {
            return;
        }
        self.paragraph(
            "Comparisons by paired t-tests, p after Holm's correction for each kind of comparison:",
        );
        self.table(&["Comparison", "t", "p (Holm)", "Cohen's d of the pairs", "95 % interval"], |rows| {
            for PostHoc { comparison, test } in comparisons {
                let PairTest { t, p_holm, d } = match test.result() {
                    Ok(test) => test,
                    Err(reason) => {
                        rows.row(&[comparison.clone(), not_testable_text(reason)]);
                        continue;
                    }
                };
                rows.row(&[
                    comparison.clone(),
                    format!("t({}) = {:.2}", t.df, t.value),
                    p_cell(*p_holm),
                    format!("{:.2}", d.value),
                    size_interval_text(d),
                ]);
            }
        });
    }

    fn effects(&mut self, effects: &[Effect], report: &[published::Published]) {
        let head = ["Effect", "F", "p", "ε (HF)", "p (HF)", "ω² partial", "95 % interval", "thesis"];
        self.table(&head, |rows| {
            for effect in effects {
                let name = effect.effect.replace(':', " × ");
                if !effect.is_testable() {
                    rows.row(&[name, effect_text(effect)]);
                    continue;
                }
                let beside = report.iter().find(|(name, _)| *name == effect.effect);
                let corrected = |value: fn(&flotor_statistics::anova::Sphericity) -> String| {
                    effect.sphericity.as_ref().map_or(String::new(), value)
                };
                let size = effect.partial_omega_squared.as_ref();
                rows.row(&[
                    name,
                    format!("F({}, {}) = {:.2}", effect.df, effect.error_df, effect.f),
                    p_cell(effect.p),
                    corrected(|s| format!("{:.3}", s.epsilon_hf.min(1.0))),
                    corrected(|s| p_cell(s.p_hf)),
                    size.map_or(String::new(), |size| format!("{:.2}", size.value)),
                    size.map_or(String::new(), size_interval_text),
                    beside.map_or(String::new(), |(_, text)| (*text).to_owned()),
                ]);
            }
        });
    }
}

/// Rows of a table under construction.
struct Rows<'p>(&'p mut String);

impl Rows<'_> {
    fn row(&mut self, cells: &[String]) {
        self.0.push_str("<tr>");
        for cell in cells {
            let _ = write!(self.0, "<td>{}</td>", escape(cell));
        }
        self.0.push_str("</tr>\n");
    }
}
