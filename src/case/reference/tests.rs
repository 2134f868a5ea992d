use super::*;
use std::collections::BTreeSet;

fn parameters() -> Vec<Parameter> {
    pages()
        .into_iter()
        .flat_map(|page| page.parameters)
        .collect()
}

#[test]
fn every_property_of_the_schema_appears() {
    /// Collects the keys of every object in the schema.
    fn objects(node: &Value, found: &mut Vec<BTreeSet<String>>) {
        match node {
            Value::Object(map) => {
                if let Some(Value::Object(properties)) = map.get("properties") {
                    found.push(properties.keys().cloned().collect());
                }
                map.values().for_each(|child| objects(child, found));
            }
            Value::Array(list) => list.iter().for_each(|child| objects(child, found)),
            _ => {}
        }
    }
    let mut siblings: BTreeMap<String, BTreeSet<String>> = BTreeMap::new();
    for parameter in parameters() {
        let (parent, key) = (parameter.path.rsplit_once('.')).unwrap_or(("", &parameter.path));
        siblings
            .entry(parent.into())
            .or_default()
            .insert(key.into());
    }
    let mut found = Vec::new();
    objects(&check::bare_schema(), &mut found);
    assert!(found.len() > 100, "{}", found.len());
    for keys in found {
        assert!(
            siblings.values().any(|known| known.is_superset(&keys)),
            "no page has {keys:?}"
        );
    }
}

#[test]
fn every_field_of_the_examples_is_described() {
    let known: Vec<String> = parameters().into_iter().map(|p| p.path).collect();
    for example in examples::EXAMPLES {
        let mut tree = serde_json::from_str(example.text).unwrap();
        annotation::strip(&mut tree);
        let mut seen = BTreeMap::new();
        collect(&tree, "", &known, &mut seen);
        for path in seen.keys().filter(|path| !path.ends_with("[]")) {
            assert!(known.contains(path), "{}: {path}", example.name);
        }
    }
}

#[test]
fn every_example_is_valid() {
    let root = check::bare_schema();
    let problems = |pointer: &str, value: &Value| {
        let mut schema = root.pointer(pointer).unwrap().clone();
        schema["$defs"] = root["$defs"].clone();
        check::problems_against(&schema, &mut value.clone())
    };
    let mut shown = 0;
    for page in pages() {
        for parameter in &page.parameters {
            if let Some(example) = &parameter.example {
                let found = problems(&parameter.pointer, example);
                assert!(found.is_empty(), "{}: {found:?}", parameter.path);
                shown += 1;
            }
        }
        if let Some(example) = &page.example {
            let value = &example.value[&page.name];
            let found = problems(&format!("/properties/{}", page.name), value);
            assert!(found.is_empty(), "{}: {found:?}", page.name);
        } else {
            assert_eq!(page.name, FRONT_PAGE, "a page without an example");
        }
    }
    assert!(shown > 200, "{shown}");
}

/// Returns all parts of a text between two marks.
fn between<'a>(text: &'a str, open: &str, close: char) -> Vec<&'a str> {
    text.split(open)
        .skip(1)
        .filter_map(|rest| rest.split(close).next())
        .collect()
}

fn every_link_resolves(files: &[File], link: (&str, char), anchor: &str) {
    let mut links = 0;
    for file in files {
        for target in between(&file.text, link.0, link.1) {
            let (name, place) = target.split_once('#').unwrap_or((target, ""));
            let name = if name.is_empty() { &file.name } else { name };
            let there = files.iter().find(|f| f.name == name);
            let there = there.unwrap_or_else(|| panic!("{}: no file {name}", file.name));
            let anchors = between(&there.text, anchor, '"');
            assert!(
                place.is_empty() || anchors.contains(&place),
                "{}: {target}",
                file.name
            );
            links += 1;
        }
        let anchors = between(&file.text, anchor, '"');
        let distinct: BTreeSet<_> = anchors.iter().collect();
        assert_eq!(
            distinct.len(),
            anchors.len(),
            "{}: an anchor twice",
            file.name
        );
    }
    assert!(links > files.len(), "{links}");
}

#[test]
fn every_link_of_the_html_resolves() {
    let files = html::files();
    assert_eq!(files[0].name, "index.html");
    every_link_resolves(&files, ("href=\"", '"'), "section id=\"");
    for file in &files {
        assert!(
            !file.text.contains("src=") && !file.text.contains("http"),
            "{}",
            file.name
        );
    }
}

#[test]
fn every_link_of_the_markdown_resolves() {
    every_link_resolves(&markdown::files(), ("](", ')'), "<a id=\"");
}

#[test]
fn a_parameter_has_all_its_facts() {
    let all = parameters();
    let find = |path: &str| all.iter().find(|p| p.path == path).unwrap();
    let density = find("fluid.lattice_boltzmann.density");
    assert_eq!(density.unit.as_deref(), Some("kg/m3"));
    assert_eq!(density.range.as_deref(), Some("above 0"));
    assert!(density.required && density.example.is_some());
    let skin = find("time.neighbour_skin");
    assert_eq!(skin.default, Some(0.5.into()));
    assert!(skin.restart.is_some());
    let split = find("domain.split");
    assert_eq!(split.words.len(), 4);
    assert_eq!(find("materials.NAME.density").key(), "density");
    assert_eq!(
        find("walls[].shape.mesh.path").anchor(),
        "walls-shape-mesh-path"
    );
    assert_eq!(unit("A plane [a, b, c, d] of x [m]."), Some("m"));
}

/// Checks that texts of the schema have units as `[m]`, and not with the backslashes of comments.
#[test]
fn units_have_no_backslashes() {
    assert!(!check::bare_schema().to_string().contains(r"\\["));
}
