//! Rows of the matrix: a variant in an experiment, put together from its cases.

use serde::Serialize;

use crate::error::Error;

/// What became of a variant.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Verdict {
    /// No failure.
    Survives,
    Fails,
    /// It fails, and its own result tells exactly where or how often.
    Tells,
    /// What it cannot do is refused with a sentence.
    Refuses,
    /// It could not be run, or chance may have decided.
    NotDecided,
}

impl Verdict {
    pub fn name(self) -> &'static str {
        match self {
            Self::Survives => "survives",
            Self::Fails => "fails",
            Self::Tells => "tells",
            Self::Refuses => "refuses",
            Self::NotDecided => "not-decided",
        }
    }
}

/// A variant on one scene, scale or input.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Case {
    pub case: String,
    pub trials: u64,
    pub failures: u64,
    /// In what the experiment says that it measures; larger is worse.
    pub worst: Option<f64>,
    /// Whatever else there is to say.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub note: Option<String>,
    /// The picture's counts, where a run on another device is to be compared with it (`bits`).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub picture: Option<String>,
    /// An error kept it from being decided.
    #[serde(skip)]
    pub undecided: bool,
}

impl Case {
    /// One that did not run. What is refused with a sentence (exit codes 2 and 3) is no trial; any other error leaves the
    /// variant undecided.
    pub fn of_error(case: impl Into<String>, error: &Error) -> Self {
        let undecided = !matches!(error.exit_code(), 2 | 3);
        Self { case: case.into(), note: Some(error.to_string()), undecided, ..Self::default() }
    }
}

/// A variant in an experiment.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Row {
    pub variant: String,
    /// Over all cases.
    pub trials: u64,
    pub failures: u64,
    pub worst: Option<f64>,
    /// The case that is worst.
    pub worst_case: Option<String>,
    /// Summed kernel time over that of the plain choice on the same work.
    pub gpu_ms_ratio: Option<f64>,
    pub verdict: Verdict,
    pub note: Option<String>,
    pub cases: Vec<Case>,
}

impl Row {
    /// Adds up the cases; the variant survives if none has a failure and an error left none of them open.
    pub fn of(variant: impl Into<String>, cases: Vec<Case>) -> Self {
        let trials = cases.iter().map(|case| case.trials).sum();
        let failures = cases.iter().map(|case| case.failures).sum();
        let worst = cases
            .iter()
            .filter(|case| case.worst.is_some())
            .max_by(|a, b| a.worst.unwrap_or(0.0).total_cmp(&b.worst.unwrap_or(0.0)));
        let verdict = match (trials, failures) {
            (_, 1..) => Verdict::Fails,
            (0, 0) => Verdict::NotDecided,
            _ if cases.iter().any(|case| case.undecided) => Verdict::NotDecided,
            _ => Verdict::Survives,
        };
        let left_out: Vec<String> = cases
            .iter()
            .filter(|case| case.trials == 0)
            .map(|case| format!("{}: {}", case.case, case.note.as_deref().unwrap_or("not run")))
            .collect();
        Self {
            variant: variant.into(),
            trials,
            failures,
            worst: worst.and_then(|case| case.worst),
            worst_case: worst.map(|case| case.case.clone()),
            gpu_ms_ratio: None,
            verdict,
            note: (!left_out.is_empty()).then(|| left_out.join("; ")),
            cases,
        }
    }

    /// A variant of which nothing is known but why.
    pub fn undecided(variant: impl Into<String>, why: impl Into<String>) -> Self {
        Self { verdict: Verdict::NotDecided, note: Some(why.into()), ..Self::of(variant, Vec::new()) }
    }

    /// A variant that is refused, with the sentence that says so.
    pub fn refused(variant: impl Into<String>, sentence: impl Into<String>) -> Self {
        Self { verdict: Verdict::Refuses, note: Some(sentence.into()), ..Self::of(variant, Vec::new()) }
    }

    pub fn costing(self, gpu_ms_ratio: Option<f64>) -> Self {
        Self { gpu_ms_ratio, ..self }
    }

    /// With one more thing to say.
    pub fn noting(self, note: impl Into<String>) -> Self {
        let note = match self.note {
            Some(before) => format!("{before}; {}", note.into()),
            None => note.into(),
        };
        Self { note: Some(note), ..self }
    }

    pub fn judged(self, verdict: Verdict) -> Self {
        Self { verdict, ..self }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cases_add_up_and_the_worst_is_named() {
        let case = |name: &str, failures, worst| Case {
            case: name.into(),
            trials: 10,
            failures,
            worst,
            ..Case::default()
        };
        let row = Row::of("a", vec![case("x", 0, None), case("y", 2, Some(0.5)), case("z", 1, Some(0.25))]);
        assert_eq!((row.trials, row.failures, row.worst), (30, 3, Some(0.5)));
        assert_eq!((row.worst_case.as_deref(), row.verdict), (Some("y"), Verdict::Fails));
        assert_eq!(Row::of("b", vec![case("x", 0, Some(0.0))]).verdict, Verdict::Survives);
        assert_eq!(Row::of("c", Vec::new()).verdict, Verdict::NotDecided);
        let with = |error: Error| Row::of("d", vec![case("x", 0, None), Case::of_error("y", &error)]);
        assert_eq!(with(Error::device("The device was lost")).verdict, Verdict::NotDecided);
        let refused = with(Error::usage("Choose another size"));
        assert_eq!(
            (refused.verdict, refused.note.as_deref()),
            (Verdict::Survives, Some("y: Choose another size."))
        );
    }
}
