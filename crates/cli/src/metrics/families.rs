//! Metrics by family, as OpenMetrics text, as the older text format of Prometheus, or as JSON.

use serde_json::{Map, Value, json};
use std::fmt::Write;

/// Labels of a sample: name and value.
pub(super) type Labels<'a> = [(&'a str, &'a str)];

/// How metrics are written. Samples are the same in both.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Format {
    /// OpenMetrics 1.0, for who asks for it by name.
    OpenMetrics,
    /// Prometheus text format 0.0.4, which everything reads; node_exporter reads nothing else from files.
    Prometheus,
    /// An object for each sample, for scripts.
    Json,
}

impl Format {
    /// The best that the value of an `Accept` header names.
    pub(super) fn accepted(accept: &str) -> Self {
        match accept
            .to_ascii_lowercase()
            .contains("application/openmetrics-text")
        {
            true => Self::OpenMetrics,
            false => Self::Prometheus,
        }
    }

    pub(super) fn content_type(self) -> &'static str {
        match self {
            Self::OpenMetrics => "application/openmetrics-text; version=1.0.0; charset=utf-8",
            Self::Prometheus => "text/plain; version=0.0.4; charset=utf-8",
            Self::Json => "application/x-ndjson",
        }
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Kind {
    Info,
    Gauge,
    Counter,
    Summary,
    Histogram,
}

/// Units that names of metrics end with.
const UNITS: [&str; 8] = [
    "radians_per_second",
    "seconds",
    "hertz",
    "ratio",
    "celsius",
    "volts",
    "amperes",
    "radians",
];

/// Samples by family: those of one family have to follow each other.
#[derive(Default)]
pub(super) struct Families(Vec<Family>);

struct Family {
    name: String,
    kind: Kind,
    help: &'static str,
    samples: Vec<Sample>,
}

struct Sample {
    name: String,
    labels: Vec<(String, String)>,
    value: String,
}

impl Sample {
    /// The line of both text formats.
    fn text(&self) -> String {
        let labels: Vec<String> = self
            .labels
            .iter()
            .map(|(key, value)| format!("{key}=\"{}\"", escaped(value)))
            .collect();
        let labels = match labels.is_empty() {
            true => String::new(),
            false => format!("{{{}}}", labels.join(",")),
        };
        format!("{}{labels} {}\n", self.name, self.value)
    }

    /// A value that is no number in JSON is null.
    fn json(&self) -> String {
        let labels: Map<String, Value> = self
            .labels
            .iter()
            .map(|(key, value)| (key.clone(), value.as_str().into()))
            .collect();
        let value: Value = serde_json::from_str(&self.value).unwrap_or_default();
        format!(
            "{}\n",
            json!({ "name": self.name, "labels": labels, "value": value })
        )
    }
}

impl Families {
    /// A gauge, which goes up and down. `help` has no quotes and no backslashes: the formats escape them differently.
    pub(super) fn gauge(&mut self, name: &str, help: &'static str, labels: &Labels<'_>, value: f64) {
        self.sample(name, Kind::Gauge, help, "", labels, &number(value));
    }

    /// A count since the daemon's start.
    pub(super) fn counter(&mut self, name: &str, help: &'static str, labels: &Labels<'_>, value: u64) {
        self.sample(name, Kind::Counter, help, "_total", labels, &value.to_string());
    }

    /// One sample of the family `taxeld_NAME`, or of `taxeld` where `name` is empty.
    pub(super) fn sample(
        &mut self,
        name: &str,
        kind: Kind,
        help: &'static str,
        suffix: &str,
        labels: &Labels<'_>,
        value: &str,
    ) {
        let name = match name {
            "" => "taxeld".to_owned(),
            name => format!("taxeld_{name}"),
        };
        let known = self.0.iter().position(|family| family.name == name);
        let family = known.unwrap_or_else(|| {
            let samples = Vec::new();
            self.0.push(Family {
                name,
                kind,
                help,
                samples,
            });
            self.0.len() - 1
        });
        let family = &mut self.0[family];
        let labels = labels
            .iter()
            .map(|(key, value)| (key.to_string(), value.to_string()));
        family.samples.push(Sample {
            name: format!("{}{suffix}", family.name),
            labels: labels.collect(),
            value: value.into(),
        });
    }

    pub(super) fn text(&self, format: Format) -> String {
        if format == Format::Json {
            let samples = self.0.iter().flat_map(|family| &family.samples);
            return samples.map(Sample::json).collect();
        }
        let mut text = String::new();
        for family in &self.0 {
            let name = &family.name;
            // The older format knows no info, and names the sample of a count.
            let (name, kind) = match (format, family.kind) {
                (Format::OpenMetrics, Kind::Info) => (name.clone(), "info"),
                (_, Kind::Info) => (format!("{name}_info"), "gauge"),
                (Format::OpenMetrics, Kind::Counter) => (name.clone(), "counter"),
                (_, Kind::Counter) => (format!("{name}_total"), "counter"),
                (_, Kind::Gauge) => (name.clone(), "gauge"),
                (_, Kind::Summary) => (name.clone(), "summary"),
                (_, Kind::Histogram) => (name.clone(), "histogram"),
            };
            let _ = write!(text, "# TYPE {name} {kind}\n# HELP {name} {}\n", family.help);
            let unit = UNITS.iter().find(|unit| name.ends_with(&format!("_{unit}")));
            if let (Format::OpenMetrics, Some(unit)) = (format, unit) {
                let _ = writeln!(text, "# UNIT {name} {unit}");
            }
            text.extend(family.samples.iter().map(Sample::text));
        }
        if format == Format::OpenMetrics {
            text += "# EOF\n";
        }
        text
    }
}

pub(super) fn number(value: f64) -> String {
    match value {
        _ if value.is_nan() => "NaN".into(),
        _ if value.is_infinite() => (if value > 0.0 { "+Inf" } else { "-Inf" }).into(),
        _ => value.to_string(),
    }
}

fn escaped(text: &str) -> String {
    text.replace('\\', "\\\\")
        .replace('"', "\\\"")
        .replace('\n', "\\n")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn families() -> Families {
        let mut families = Families::default();
        let about = [("layout", "a \"hand\"")];
        families.sample("", Kind::Info, "The daemon.", "_info", &about, "1");
        families.gauge("uptime_seconds", "Since its start.", &[], 3.5);
        families.counter("images_made", "Images made.", &[], 90);
        families
    }

    #[test]
    fn the_older_format_knows_no_info_and_names_the_samples_of_counts() {
        let text = families().text(Format::Prometheus);
        let expected = "\
# TYPE taxeld_info gauge
# HELP taxeld_info The daemon.
taxeld_info{layout=\"a \\\"hand\\\"\"} 1
# TYPE taxeld_uptime_seconds gauge
# HELP taxeld_uptime_seconds Since its start.
taxeld_uptime_seconds 3.5
# TYPE taxeld_images_made_total counter
# HELP taxeld_images_made_total Images made.
taxeld_images_made_total 90
";
        assert_eq!(text, expected);
    }

    #[test]
    fn openmetrics_names_families_and_units_and_has_an_end() {
        let text = families().text(Format::OpenMetrics);
        let expected = "\
# TYPE taxeld info
# HELP taxeld The daemon.
taxeld_info{layout=\"a \\\"hand\\\"\"} 1
# TYPE taxeld_uptime_seconds gauge
# HELP taxeld_uptime_seconds Since its start.
# UNIT taxeld_uptime_seconds seconds
taxeld_uptime_seconds 3.5
# TYPE taxeld_images_made counter
# HELP taxeld_images_made Images made.
taxeld_images_made_total 90
# EOF
";
        assert_eq!(text, expected);
    }

    #[test]
    fn scripts_are_given_an_object_for_each_sample() {
        let mut families = families();
        families.gauge("voltage_volts", "Of a servo.", &[], f64::NAN);
        let expected = "\
{\"labels\":{\"layout\":\"a \\\"hand\\\"\"},\"name\":\"taxeld_info\",\"value\":1}
{\"labels\":{},\"name\":\"taxeld_uptime_seconds\",\"value\":3.5}
{\"labels\":{},\"name\":\"taxeld_images_made_total\",\"value\":90}
{\"labels\":{},\"name\":\"taxeld_voltage_volts\",\"value\":null}
";
        assert_eq!(families.text(Format::Json), expected);
    }

    #[test]
    fn openmetrics_is_for_who_asks_for_it() {
        for (accept, format) in [
            ("", Format::Prometheus),
            ("*/*", Format::Prometheus),
            ("text/plain;version=0.0.4;q=0.5,*/*;q=0.1", Format::Prometheus),
            (
                "Application/OpenMetrics-Text;version=1.0.0,text/plain;q=0.5",
                Format::OpenMetrics,
            ),
        ] {
            assert_eq!(Format::accepted(accept), format, "{accept}");
        }
    }
}
