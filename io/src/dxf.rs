//! Polylines of drawings in the format DXF, as text.
//!
//! A drawing is a list of pairs of lines: a group code and a value. This reader takes the entities `LWPOLYLINE` and
//! `POLYLINE` of the model space, and the unit of the drawing (`$INSUNITS`). It counts all other entities by layer, so
//! that a message can name what a layer contains. The format is described in the *DXF Reference* of Autodesk; the codes
//! used here are the same from R12 to the present one.
//!
//! | code | value |
//! |---|---|
//! | 0 | beginning of an entity |
//! | 8 | layer |
//! | 10, 20, 30 | x, y and z of a vertex |
//! | 42 | bulge of the segment behind a vertex: tangent of a quarter of its angle, positive counter-clockwise |
//! | 67 | 1 for an entity of the paper space |
//! | 70 | bits: 1 closed, 8 polyline in 3-D, 16 and 64 meshes; of a vertex 16 the frame of a spline |
//! | 230 | z of the normal: -1 for a polyline that is seen from behind |

use std::collections::BTreeMap;

/// Maximum number of vertices of a polyline.
const MOST_VERTICES: usize = 1_000_000;

/// Vertex of a polyline.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Vertex {
    /// Position in units of the drawing.
    pub at: [f64; 2],
    /// Bulge of the segment to the next vertex.
    pub bulge: f64,
}

/// Polyline of a layer.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Polyline {
    /// Layer.
    pub layer: String,
    /// Vertices in their order.
    pub vertices: Vec<Vertex>,
    /// `true` if a segment joins the last vertex to the first.
    pub closed: bool,
    /// Line of the file at which it begins.
    pub line: usize,
}

/// Polylines and units of a drawing.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Drawing {
    /// Polylines of the model space.
    pub polylines: Vec<Polyline>,
    /// Length of a unit of the drawing \[m\]; none if the drawing has no unit of length.
    pub unit: Option<f64>,
    /// Numbers of the other entities, by layer and kind.
    pub others: BTreeMap<String, BTreeMap<String, usize>>,
}

/// Group code with its value and line.
#[derive(Clone, Copy, Debug)]
struct Group<'t> {
    code: i32,
    value: &'t str,
    line: usize,
}

impl Group<'_> {
    fn number(&self) -> Result<f64, String> {
        let number: Option<f64> = self.value.parse().ok();
        number.filter(|x| x.is_finite()).ok_or_else(|| {
            let (line, value) = (self.line, self.value);
            format!("line {line}: `{value}` is not a number")
        })
    }

    fn bits(&self) -> Result<i64, String> {
        self.value.parse().map_err(|_| {
            let (line, value) = (self.line, self.value);
            format!("line {line}: `{value}` is not a whole number")
        })
    }
}

/// Returns the text of a file: UTF-8, or Latin-1 as older programs write it.
fn decoded(bytes: &[u8]) -> Result<String, String> {
    if bytes.starts_with(b"AutoCAD Binary DXF") {
        return Err("it is a binary DXF file: save it as text (ASCII DXF)".into());
    }
    if bytes.starts_with(b"AC10") {
        return Err("it is a DWG file: save it as DXF".into());
    }
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    let text = std::str::from_utf8(bytes).map(str::to_owned);
    Ok(text.unwrap_or_else(|_| bytes.iter().map(|byte| char::from(*byte)).collect()))
}

/// Returns the groups of a text.
fn groups(text: &str) -> Result<Vec<Group<'_>>, String> {
    let mut lines = (1..).zip(text.lines());
    let mut found = Vec::new();
    while let Some((line, code)) = lines.next() {
        let code = code.trim();
        let Some((_, value)) = lines.next() else {
            // A blank line may follow the end.
            if code.is_empty() {
                break;
            }
            return Err(format!("line {line}: the file ends within a group"));
        };
        let code = code
            .parse()
            .map_err(|_| format!("line {line}: `{code}` is not a group code of a DXF file"))?;
        let value = value.trim();
        found.push(Group {
            code,
            value,
            line: line + 1,
        });
        if code == 0 && value == "EOF" {
            break;
        }
    }
    Ok(found)
}

/// Returns a name with its characters that are written as `\U+XXXX`.
fn named(written: &str) -> String {
    let mut parts = written.split("\\U+");
    let mut name = parts.next().unwrap_or_default().to_owned();
    for part in parts {
        let code = part
            .get(..4)
            .and_then(|code| u32::from_str_radix(code, 16).ok());
        match code.and_then(char::from_u32) {
            Some(character) => {
                name.push(character);
                name.push_str(&part[4..]);
            }
            None => {
                name.push_str("\\U+");
                name.push_str(part);
            }
        }
    }
    name
}

/// Returns the length of the unit of a number of `$INSUNITS` \[m\].
fn unit(number: i64) -> Option<f64> {
    Some(match number {
        1 => 0.0254,
        2 => 0.3048,
        3 => 1609.344,
        4 => 1e-3,
        5 => 1e-2,
        6 => 1.0,
        7 => 1e3,
        8 => 2.54e-8,
        9 => 2.54e-5,
        10 => 0.9144,
        11 => 1e-10,
        12 => 1e-9,
        13 => 1e-6,
        14 => 0.1,
        15 => 10.0,
        16 => 100.0,
        17 => 1e9,
        21 => 1200.0 / 3937.0,
        22 => 100.0 / 3937.0,
        23 => 3600.0 / 3937.0,
        24 => 5280.0 * 1200.0 / 3937.0,
        _ => return None,
    })
}

/// Reads the polylines of a drawing.
///
/// # Errors
/// If the file is no DXF text; the message names the line.
pub fn read(bytes: &[u8]) -> Result<Drawing, String> {
    let text = decoded(bytes)?;
    let groups = groups(&text)?;
    let mut drawing = Drawing::default();
    let mut section = "";
    let mut at = 0;
    while at < groups.len() {
        let group = groups[at];
        let end = (at + 1..groups.len())
            .find(|n| groups[*n].code == 0)
            .unwrap_or(groups.len());
        let body = &groups[at + 1..end];
        match (group.code, group.value, section) {
            (0, "SECTION", _) => {
                section = body.iter().find(|g| g.code == 2).map_or("", |g| g.value);
                if section == "HEADER" {
                    drawing.unit = unit_of(body)?;
                }
            }
            (0, "ENDSEC", _) => section = "",
            (0, "LWPOLYLINE", "ENTITIES") => take(&mut drawing, light(group, body)?, body),
            (0, "POLYLINE", "ENTITIES") => {
                let (polyline, next) = heavy(&groups, at, end)?;
                take(&mut drawing, polyline, body);
                at = next;
                continue;
            }
            (0, kind, "ENTITIES") if !in_paper_space(body) => {
                let layer = drawing.others.entry(layer(body)).or_default();
                *layer.entry(kind.to_owned()).or_default() += 1;
            }
            _ => {}
        }
        at = end;
    }
    if section.is_empty() && groups.last().is_some_and(|last| last.value == "EOF") {
        Ok(drawing)
    } else {
        Err("the file is incomplete: its last group is not `EOF`".into())
    }
}

/// Adds a polyline; one that has no outline in the plane is counted among the other entities.
fn take(drawing: &mut Drawing, found: Option<Polyline>, body: &[Group<'_>]) {
    match found {
        Some(found) => drawing.polylines.push(found),
        None if in_paper_space(body) => {}
        None => {
            let layer = drawing.others.entry(layer(body)).or_default();
            *layer
                .entry("polyline out of the plane".to_owned())
                .or_default() += 1;
        }
    }
}

fn layer(body: &[Group<'_>]) -> String {
    named(body.iter().find(|g| g.code == 8).map_or("0", |g| g.value))
}

fn in_paper_space(body: &[Group<'_>]) -> bool {
    body.iter().any(|g| g.code == 67 && g.value == "1")
}

/// Returns the unit that a header states.
fn unit_of(header: &[Group<'_>]) -> Result<Option<f64>, String> {
    let place = header
        .iter()
        .position(|g| g.code == 9 && g.value == "$INSUNITS");
    match place.and_then(|place| header.get(place + 1)) {
        Some(group) => Ok(unit(group.bits()?)),
        None => Ok(None),
    }
}

/// Returns the side from which a polyline is seen, 1 or -1; none for a plane that is inclined to x and y.
fn side(body: &[Group<'_>]) -> Result<Option<f64>, String> {
    let Some(normal) = body.iter().find(|g| g.code == 230) else {
        return Ok(Some(1.0));
    };
    let z = normal.number()?;
    Ok(Some(z.signum()).filter(|_| (z.abs() - 1.0).abs() <= 1e-6))
}

/// Returns a vertex as seen from the front.
fn seen(vertex: Vertex, side: f64) -> Vertex {
    Vertex {
        at: [side * vertex.at[0], vertex.at[1]],
        bulge: side * vertex.bulge,
    }
}

/// Returns the polyline of an entity `LWPOLYLINE`; none in the paper space and in an inclined plane.
fn light(group: Group<'_>, body: &[Group<'_>]) -> Result<Option<Polyline>, String> {
    if in_paper_space(body) {
        return Ok(None);
    }
    let Some(side) = side(body)? else {
        return Ok(None);
    };
    let mut found = Polyline {
        layer: layer(body),
        line: group.line,
        ..Polyline::default()
    };
    for g in body {
        match g.code {
            70 => found.closed = g.bits()? & 1 != 0,
            10 => found.vertices.push(Vertex {
                at: [g.number()?, 0.0],
                bulge: 0.0,
            }),
            20 | 42 => {
                let Some(last) = found.vertices.last_mut() else {
                    return Err(format!("line {}: a vertex has no x", g.line));
                };
                if g.code == 20 {
                    last.at[1] = g.number()?;
                } else {
                    last.bulge = g.number()?;
                }
            }
            _ => {}
        }
    }
    finish(found, side).map(Some)
}

/// Returns the polyline of an entity `POLYLINE` with its vertices, and the place behind it; none in the paper space, in
/// an inclined plane and for a mesh.
fn heavy(
    groups: &[Group<'_>],
    start: usize,
    end: usize,
) -> Result<(Option<Polyline>, usize), String> {
    let (group, body) = (groups[start], &groups[start + 1..end]);
    let side = side(body)?;
    let bits = body.iter().find(|g| g.code == 70);
    let bits = bits.map_or(Ok(0), Group::bits)?;
    let mut found = Polyline {
        layer: layer(body),
        closed: bits & 1 != 0,
        line: group.line,
        ..Polyline::default()
    };
    let mut at = end;
    while at < groups.len() && groups[at].code == 0 && groups[at].value == "VERTEX" {
        let next = (at + 1..groups.len())
            .find(|n| groups[*n].code == 0)
            .unwrap_or(groups.len());
        let (mut vertex, mut kind) = (Vertex::default(), 0);
        for g in &groups[at + 1..next] {
            match g.code {
                10 => vertex.at[0] = g.number()?,
                20 => vertex.at[1] = g.number()?,
                42 => vertex.bulge = g.number()?,
                70 => kind = g.bits()?,
                _ => {}
            }
        }
        // Control points of a spline are not on its curve.
        if kind & 16 == 0 {
            found.vertices.push(vertex);
        }
        at = next;
    }
    if groups.get(at).is_none_or(|g| g.value != "SEQEND") {
        return Err(format!("line {}: a polyline has no end", group.line));
    }
    let next = (at + 1..groups.len())
        .find(|n| groups[*n].code == 0)
        .unwrap_or(groups.len());
    // A mesh has no outline; a polyline in 3-D is taken as seen along z.
    let Some(side) = side.filter(|_| !in_paper_space(body) && bits & (16 | 64) == 0) else {
        return Ok((None, next));
    };
    Ok((Some(finish(found, side)?), next))
}

/// Returns the polyline as seen from the front, closed if its ends coincide.
fn finish(mut found: Polyline, side: f64) -> Result<Polyline, String> {
    if found.vertices.len() > MOST_VERTICES {
        let number = found.vertices.len();
        return Err(format!(
            "line {}: the polyline has {number} vertices, and at most {MOST_VERTICES} are read",
            found.line
        ));
    }
    for vertex in &mut found.vertices {
        *vertex = seen(*vertex, side);
    }
    let size = found.vertices.iter().flat_map(|v| v.at);
    let size = size.fold(0.0_f64, |most, x| most.max(x.abs()));
    let same = |a: &Vertex, b: &Vertex| (0..2).all(|k| (a.at[k] - b.at[k]).abs() <= 1e-9 * size);
    // Some programs repeat vertices.
    let mut kept: Vec<Vertex> = Vec::with_capacity(found.vertices.len());
    for vertex in found.vertices {
        match kept.last_mut() {
            Some(last) if same(last, &vertex) => last.bulge = vertex.bulge,
            _ => kept.push(vertex),
        }
    }
    if let [first, .., last] = &kept[..]
        && same(first, last)
    {
        kept.pop();
        found.closed = true;
    }
    found.vertices = kept;
    Ok(found)
}

impl Polyline {
    /// Returns the points of the outline, with arcs as chords that are at most `tolerance` away from them.
    #[must_use]
    pub fn points(&self, tolerance: f64) -> Vec<[f64; 2]> {
        let mut points = Vec::new();
        let count = self.vertices.len();
        for (n, vertex) in self.vertices.iter().enumerate() {
            points.push(vertex.at);
            let is_end = n + 1 == count && !self.closed;
            if vertex.bulge.abs() > 0.0 && !is_end {
                let next = self.vertices[(n + 1) % count];
                arc(vertex.at, next.at, vertex.bulge, tolerance, &mut points);
            }
        }
        points
    }
}

/// Adds the points between the ends of an arc.
fn arc(from: [f64; 2], to: [f64; 2], bulge: f64, tolerance: f64, points: &mut Vec<[f64; 2]>) {
    let [dx, dy] = [to[0] - from[0], to[1] - from[1]];
    let chord = dx.hypot(dy);
    let angle = 4.0 * bulge.atan();
    let radius = 0.25 * chord * (bulge.abs() + 1.0 / bulge.abs());
    // A chord over the angle a is at most r (1 - cos a/2) away from its arc.
    let step = 2.0 * (1.0 - (tolerance / radius).min(1.0)).acos();
    let number = (angle.abs() / step.max(1e-3)).ceil().clamp(2.0, 10_000.0);
    // The centre lies on the left of the chord for an arc of less than a half circle that runs counter-clockwise.
    let height = 0.25 * (1.0 / bulge - bulge);
    let centre = [
        0.5 * (from[0] + to[0]) - height * dy,
        0.5 * (from[1] + to[1]) + height * dx,
    ];
    let arm = [from[0] - centre[0], from[1] - centre[1]];
    let mut k = 1.0;
    while k < number {
        let (sin, cos) = (angle * k / number).sin_cos();
        points.push([
            centre[0] + cos * arm[0] - sin * arm[1],
            centre[1] + sin * arm[0] + cos * arm[1],
        ]);
        k += 1.0;
    }
}

#[cfg(test)]
mod tests;
