//! The bibliography of the models: one list of publications for `solver cite`, the theory manual and
//! the tests.
//!
//! The entries are in `bibliography.json`, in the order of their keys. A key is the name of the first
//! author and the year. An entry has a DOI only if the publisher has given one and it was checked.

use serde::{Deserialize, Serialize};
use std::sync::LazyLock;

/// A publication.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Publication {
    /// Key, unique in the bibliography.
    pub key: String,
    /// Type of the entry in BibTeX.
    pub kind: PublicationKind,
    /// Authors, given names as initials before the family name.
    pub authors: Vec<String>,
    /// Year.
    pub year: u16,
    /// Title.
    pub title: String,
    /// Journal of an article.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub journal: Option<String>,
    /// Volume of the journal.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub volume: Option<String>,
    /// Proceedings or collection of a paper.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub booktitle: Option<String>,
    /// First and last page, or the number of the article.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub pages: Option<String>,
    /// Publisher of a book.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub publisher: Option<String>,
    /// University of a thesis.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub school: Option<String>,
    /// Digital object identifier, without the address of a resolver.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub doi: Option<String>,
}

/// Kind of a publication.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum PublicationKind {
    /// Article in a journal.
    Article,
    /// Book or report.
    Book,
    /// Paper in proceedings or in a collection.
    InProceedings,
    /// Thesis.
    PhdThesis,
}

impl PublicationKind {
    /// Returns the name of the kind in BibTeX.
    const fn name(self) -> &'static str {
        match self {
            Self::Article => "article",
            Self::Book => "book",
            Self::InProceedings => "inproceedings",
            Self::PhdThesis => "phdthesis",
        }
    }
}

static ALL: LazyLock<Vec<Publication>> =
    LazyLock::new(|| serde_json::from_str(include_str!("bibliography.json")).unwrap_or_default());

/// Returns all publications, in the order of their keys.
#[must_use]
pub fn all() -> &'static [Publication] {
    &ALL
}

/// Returns the publication with a key.
#[must_use]
pub fn find(key: &str) -> Option<&'static Publication> {
    let found = ALL.binary_search_by(|entry| entry.key.as_str().cmp(key));
    found.ok().map(|index| &ALL[index])
}

impl Publication {
    /// Returns the reference as one line of text: authors, title, source, year, DOI.
    #[must_use]
    pub fn text(&self) -> String {
        let mut source: Vec<&str> = Vec::new();
        for part in [
            &self.journal,
            &self.booktitle,
            &self.publisher,
            &self.school,
        ] {
            source.extend(part.as_deref());
        }
        let mut source = source.join(", ");
        if let Some(volume) = &self.volume {
            source = format!("{source} {volume}");
        }
        source = format!("{source} ({})", self.year);
        if let Some(pages) = &self.pages {
            source = format!("{source} {pages}");
        }
        let doi = self.doi.as_ref();
        let doi = doi.map_or_else(String::new, |doi| format!(", doi:{doi}"));
        format!(
            "{}. {}. {source}{doi}",
            self.authors.join(", ").trim_end_matches('.'),
            self.title
        )
    }

    /// Returns the reference as an entry of BibTeX, in UTF-8.
    #[must_use]
    pub fn bibtex(&self) -> String {
        let year = self.year.to_string();
        let authors = self.authors.join(" and ");
        // Pages are joined by an en dash; a second pair of braces keeps the capitals of a title.
        let pages = self.pages.as_ref().map(|pages| pages.replace('-', "--"));
        let title = format!("{{{}}}", escaped(&self.title));
        let optional = |text: &Option<String>| text.as_deref().map(escaped);
        let fields = [
            ("author", Some(escaped(&authors))),
            ("title", Some(title)),
            ("journal", optional(&self.journal)),
            ("booktitle", optional(&self.booktitle)),
            ("volume", optional(&self.volume)),
            ("pages", pages),
            ("publisher", optional(&self.publisher)),
            ("school", optional(&self.school)),
            ("year", Some(year)),
            ("doi", self.doi.clone()),
        ];
        let mut text = format!("@{}{{{},\n", self.kind.name(), self.key);
        for (name, value) in fields {
            if let Some(value) = value {
                text.push_str(&format!("  {name} = {{{value}}},\n"));
            }
        }
        text.push('}');
        text
    }
}

/// Returns a text with the characters escaped that TeX reads as commands.
fn escaped(text: &str) -> String {
    let mut escaped = String::with_capacity(text.len());
    for c in text.chars() {
        if matches!(c, '&' | '%' | '$' | '#' | '_') {
            escaped.push('\\');
        }
        escaped.push(c);
    }
    escaped
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_file_is_read_and_its_keys_are_sorted_and_unique() {
        assert!(all().len() > 60);
        assert!(all().windows(2).all(|pair| pair[0].key < pair[1].key));
        for entry in all() {
            assert!(
                entry.key.ends_with(&entry.year.to_string()),
                "{}",
                entry.key
            );
            assert_eq!(find(&entry.key), Some(entry));
            let complete = match entry.kind {
                PublicationKind::Article => {
                    entry.journal.is_some() && entry.volume.is_some() && entry.pages.is_some()
                }
                PublicationKind::Book => entry.publisher.is_some(),
                PublicationKind::InProceedings => entry.booktitle.is_some(),
                PublicationKind::PhdThesis => entry.school.is_some(),
            };
            assert!(complete, "{}", entry.key);
            if let Some(doi) = &entry.doi {
                let (registrant, name) = doi.split_once('/').unwrap();
                assert!(registrant.starts_with("10.") && !name.is_empty(), "{doi}");
            }
        }
        assert_eq!(find("unknown1900"), None);
    }

    #[test]
    fn text_and_bibtex_have_all_parts() {
        let entry = find("geier2015").unwrap();
        assert_eq!(
            entry.text(),
            "M. Geier, M. Schönherr, A. Pasquali, M. Krafczyk. The cumulant lattice Boltzmann equation \
             in three dimensions: Theory and validation. Computers & Mathematics with \
             Applications 70 (2015) 507-547, doi:10.1016/j.camwa.2015.05.001"
        );
        let bibtex = entry.bibtex();
        assert!(
            bibtex.starts_with("@article{geier2015,\n  author = {M. Geier and M. Schönherr and ")
        );
        assert!(bibtex.contains("journal = {Computers \\& Mathematics with Applications},\n"));
        assert!(bibtex.contains("pages = {507--547},\n"));
        assert!(bibtex.ends_with("doi = {10.1016/j.camwa.2015.05.001},\n}"));
    }
}
