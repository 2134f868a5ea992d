//! `solver cite`: the papers of the models that a case uses.

use plan::Plan;
use plan::citations::{citations, publications};

/// Format of the references.
#[derive(Clone, Copy, Debug, clap::ValueEnum)]
pub(super) enum Format {
    /// Models with the keys of their papers, followed by the papers.
    Text,
    /// Entries of BibTeX, in UTF-8.
    Bibtex,
}

/// Returns the papers of the models of a plan, each once.
pub(super) fn text(plan: &Plan, format: Format) -> String {
    let citations = citations(plan);
    let all = publications(&citations);
    let mut lines = Vec::new();
    match format {
        Format::Bibtex => lines.extend(all.iter().map(|entry| entry.bibtex() + "\n")),
        Format::Text => {
            let name = |text: &str| text.replace('_', " ");
            for citation in &citations {
                let papers = citation.publications.iter();
                let keys: Vec<&str> = papers.map(|paper| paper.key.as_str()).collect();
                let model = format!("{}: {}", name(citation.family), name(citation.model));
                lines.push(format!("{model:45} {}", keys.join(", ")));
            }
            lines.push(String::new());
            for entry in all {
                lines.push(format!("[{}] {}", entry.key, entry.text()));
            }
        }
    }
    lines.join("\n").trim_end().to_owned()
}
