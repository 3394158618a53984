//! Summary as text for users.

use super::{
    CouplingSummary, DeviceSummary, EnvelopeSummary, LinkSummary, PluginSummary, RunSummary, StageSummary,
};
use crate::telemetry::LinkCounts;
use flotor_servo::Percentiles;

impl RunSummary {
    /// Formats plugins, rate, clock, peak force and digest in one line, for the title of a plot.
    #[must_use]
    pub fn one_line(&self) -> String {
        let plugins: Vec<&str> = self.plugins.iter().map(|plugin| plugin.id.as_str()).collect();
        let (plugins, rate_hz, clock) = (plugins.join(" + "), self.rate_hz, self.clock);
        format!(
            "{plugins}, {rate_hz} Hz, {clock} clock, peak {:.2} N, digest {}",
            self.peak_force_n, self.trace_digest
        )
    }

    /// Formats the summary as lines of text for users.
    #[must_use]
    pub fn to_text(&self) -> String {
        let mut lines = Vec::new();
        let mut row = |name: &str, text: String| lines.push(format!("  {name:<11}{text}"));
        let Self { elapsed_s, rate_hz, clock, wall_s, .. } = self;
        row("ran", format!("{elapsed_s:.3} s at {rate_hz} Hz, {clock} clock, {wall_s:.2} s wall"));
        row("ticks", format!("{}   late {}   missed {}", self.ticks, self.late_ticks, self.missed_ticks));
        if self.clock == "real" {
            row("lateness", percentiles(&self.lateness_ns));
        }
        row("compute", percentiles(&self.compute_ns));
        let StageSummary { read, models, envelope, write } = &self.stages_ns;
        let [read, models, envelope, write] =
            [read, models, envelope, write].map(|stage| duration(stage.p50));
        row("of which", format!("read {read}   models {models}   envelope {envelope}   write {write}"));
        row("peak", format!("{:.3} N   {:.4} N·m", self.peak_force_n, self.peak_torque_nm));
        if let (Some(residual), Some(peak_j)) =
            (self.energy.device_residual_relative, self.energy.device_peak_j)
        {
            row("energy", format!("peak {:.3} mJ, balanced to {:.1e} of it", peak_j * 1.0e3, residual.abs()));
        }
        let [lowest_mj, end_mj] =
            [self.energy.port_lowest_j, self.energy.port_end_j].map(|joule| joule * 1.0e3);
        row("port", format!("{end_mj:+.3} mJ at the end, {lowest_mj:+.3} mJ at the lowest"));
        self.envelope.rows().for_each(|(stage, text)| row(stage, text));
        if let Some(longest_ms) = self.devices.iter().filter_map(|device| device.stop_ms).reduce(f64::max) {
            row("stop", format!("{longest_ms:.1} ms from the request to no force"));
        }
        if self.devices.len() > 1 {
            for DeviceSummary { name, peak_force_n, peak_torque_nm, port_lowest_j, port_end_j, .. } in
                &self.devices
            {
                let [lowest_mj, end_mj] = [port_lowest_j, port_end_j].map(|joule| joule * 1.0e3);
                let peaks = format!("peak {peak_force_n:.3} N   {peak_torque_nm:.4} N·m");
                row(name, format!("{peaks}   port {end_mj:+.3} mJ, lowest {lowest_mj:+.3} mJ"));
            }
        }
        for CouplingSummary { name, lowest_j, discarded_j, link, .. } in &self.couplings {
            let [first, second] = lowest_j.map(|joule| joule * 1.0e3);
            let heat_mj = discarded_j.iter().sum::<f64>() * 1.0e3;
            let tanks = match link {
                None => {
                    format!("tanks never below {first:+.3} and {second:+.3} mJ, {heat_mj:.3} mJ dissipated")
                }
                Some(link) => format!(
                    "tank never below {first:+.3} mJ with {:.3} mJ accepted from the partner, whose tank was never \
                     below {second:+.3} mJ",
                    link.accepted_j * 1.0e3
                ),
            };
            row("coupling", format!("{name}: {tanks}"));
            link.iter().for_each(|link| row("link", format!("{name}: {}", link.to_text())));
        }
        if !self.events.is_empty() {
            let events: Vec<String> =
                self.events.iter().map(|(name, count)| format!("{name} {count}")).collect();
            row("events", events.join("   "));
        }
        if !self.not_computed.is_empty() {
            row("not computed", format!(": {}", self.not_computed.join(", ")));
        }
        if self.dropped_records > 0 {
            let dropped = self.dropped_records;
            row("dropped", format!("{dropped} records dropped for a slow observer; the loop did not wait"));
        }
        for plugin in &self.plugins {
            let health = if plugin.health == "ok" { String::new() } else { format!("  {}", plugin.health) };
            let place = if plugin.isolation == Some("process") { ", in a process of its own" } else { "" };
            row(plugin.kind, format!("{} {} ({}){place}{health}", plugin.id, plugin.version, plugin.file));
            for (name, value) in &plugin.estimates {
                row("", format!("{name} {value:.1e}, by the model's own estimate"));
            }
        }
        for PluginSummary { name, id, version, file, .. } in &self.replacements {
            row("model", format!("{id} {version} ({file}), in place of `{name}` at the end"));
        }
        for warning in &self.warnings {
            row("warning", warning.clone());
        }
        row("digest", self.trace_digest.clone());
        lines.join("\n")
    }
}

impl EnvelopeSummary {
    /// Returns name and effect of each stage that was active, as text for users.
    fn rows(&self) -> impl Iterator<Item = (&'static str, String)> {
        let Self { passivity_active_s, passivity_removed_j, slew_active_s, slew_generated_j } = *self;
        let removed_mj = passivity_removed_j * 1.0e3;
        let generated_mj = slew_generated_j * 1.0e3;
        let passivity = format!("removed {removed_mj:.3} mJ in {passivity_active_s:.3} s");
        let slew = format!("generated {generated_mj:+.3} mJ in {slew_active_s:.3} s");
        let rows = [("passivity", passivity, passivity_active_s), ("slew limit", slew, slew_active_s)];
        let active = rows.into_iter().filter(|(.., active_s)| *active_s > 0.0);
        active.map(|(stage, text, _)| (stage, text))
    }
}

impl LinkSummary {
    /// Formats the link statistics for users.
    fn to_text(&self) -> String {
        let Self { received_ticks, silences, longest_wait_ms, implausible, carried, .. } = self;
        let LinkCounts { lost, overtaken, refused, others, .. } = carried;
        let silent = match silences {
            0 => format!("longest wait for a message {longest_wait_ms:.0} ms"),
            silences => format!("force removed {silences} times for lack of messages"),
        };
        let unless_none = |count: u64, text: &dyn Fn(u64) -> String| match count {
            0 => String::new(),
            count => text(count),
        };
        let impossible = unless_none(*implausible, &|count| format!(", {count} implausible"));
        let partner = match self.partner.as_str() {
            "" => "no partner".to_owned(),
            run => format!("partner: run {run}"),
        };
        let others = unless_none(*others, &|others| format!(", {others} of other runs ignored"));
        let (cut_mj, cut_mm, cut_rad) = (self.cut_j * 1.0e3, self.cut_path_m * 1.0e3, self.cut_turn_rad);
        let cut = unless_none(self.cut_ticks, &|ticks| {
            format!("; claims rejected in {ticks} ticks: {cut_mj:.3} mJ, {cut_mm:.1} mm, {cut_rad:.3} rad")
        });
        let rejected_runs = match self.rejected_runs.as_slice() {
            [] => String::new(),
            runs => format!("; disconnected because of its claims: run {}", runs.join(", run ")),
        };
        format!(
            "{partner}; messages in {received_ticks} ticks, {silent}; {lost} lost, {overtaken} overtaken, {refused} \
             refused{impossible}{others}{cut}{rejected_runs}"
        )
    }
}

fn percentiles(p: &Percentiles) -> String {
    let [p50, p99, p999, max] = [p.p50, p.p99, p.p999, p.max].map(duration);
    format!("p50 {p50}   p99 {p99}   p99.9 {p999}   max {max}")
}

fn duration(ns: u64) -> String {
    match ns {
        0..1_000 => format!("{ns} ns"),
        1_000..1_000_000 => format!("{:.1} µs", ns as f64 * 1.0e-3),
        _ => format!("{:.2} ms", ns as f64 * 1.0e-6),
    }
}
