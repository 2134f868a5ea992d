"""Assembles the theory manual from the module heads of the models: equations as written, sources and limits.

    python3 jobs/theory/manual.py [--output results/theory]

Writes one HTML file, complete in itself. A chapter is a family of models; its sections are the heads (`//!`) of the
files, and the drawings of the velocity sets follow from the tables of the lattice. The bibliography and the papers of
each model are those of `solver cite` (src/plan/bibliography.json, src/plan/citations.rs).
"""

import argparse
import html
import json
import pathlib
import re
import sys

import mathml

ROOT = pathlib.Path(__file__).resolve().parents[2]
SOURCES = ROOT / "src"

# Chapters: title, families in the table of papers, and files below src; `*` takes the models of a folder
# in the order of the table.
CHAPTERS = [
    ("Lattice", ["lattice"], ["lbm/lattice.rs", "lbm/populations.rs", "lbm/initial.rs"]),
    (
        "Collision",
        ["collision", "body_force", "arithmetic"],
        [
            "lbm/collision.rs",
            "lbm/collision/*",
            "lbm/collision/second_order.rs",
            "lbm/collision/linear_stability.rs",
            "lbm/single.rs",
        ],
    ),
    ("Turbulence", ["turbulence"], ["lbm/turbulence.rs", "lbm/turbulence/*", "lbm/synthetic.rs"]),
    (
        "Boundaries",
        ["boundary", "opening"],
        ["lbm/boundary.rs", "lbm/boundary/*", "lbm/boundary/wall.rs", "lbm/boundary/sound.rs", "lbm/boundary/turbulent.rs"],
    ),
    (
        "Free surface",
        ["free_surface"],
        [
            "lbm/surface.rs",
            "lbm/surface/facet.rs",
            "lbm/surface/carried.rs",
            "lbm/surface/exchange.rs",
            "lbm/surface/conversion.rs",
            "lbm/surface/opening.rs",
            "lbm/surface/bodies.rs",
            "lbm/surface/tension.rs",
            "plan/scene/free_surface/solitary.rs",
        ],
    ),
    ("Porous zones", ["porous_zone"], ["lbm/term/porous.rs"]),
    (
        "Coupling by links",
        ["coupling", "scheme"],
        ["lbm/links.rs", "lbm/links/gaps.rs", "coupling/bounce_back.rs", "coupling/body_map.rs", "coupling/structure_map.rs"],
    ),
    (
        "Partially saturated cells",
        ["solid_operator"],
        [
            "lbm/saturation.rs",
            "lbm/saturation/*",
            "lbm/saturation/weighting.rs",
            "lbm/saturation/contact.rs",
            "coupling/partially_saturated.rs",
            "coupling/solid_fraction.rs",
        ],
    ),
    (
        "Seepage",
        ["seepage", "resistance", "drag", "porosity", "retention"],
        [
            "darcy/lib.rs",
            "darcy/pressure.rs",
            "darcy/multigrid.rs",
            "darcy/piping.rs",
            "darcy/piping/equilibrium.rs",
            "darcy/piping/influence.rs",
            "darcy/piping/rule.rs",
            "darcy/resistance.rs",
            "darcy/resistance/*",
            "darcy/drag.rs",
            "darcy/drag/*",
            "darcy/porosity.rs",
            "darcy/porosity/*",
            "darcy/mean_diameter.rs",
            "darcy/overlap.rs",
            "darcy/open_water.rs",
            "darcy/zones.rs",
            "darcy/retention.rs",
            "darcy/retention/*",
            "darcy/pressure/unsaturated.rs",
            "darcy/pressure/unsaturated/following.rs",
            "darcy/pressure/unsaturated/transient.rs",
            "darcy/cut_cells.rs",
            "darcy/drains.rs",
            "plan/scene/seepage/terrain.rs",
            "darcy/pressure/tensor.rs",
            "darcy/surface.rs",
            "coupling/seepage.rs",
            "coupling/seepage/moist.rs",
            "coupling/seepage/following.rs",
        ],
    ),
    (
        "Water in joints",
        ["joints"],
        [
            "joints/lib.rs",
            "joints/pairs.rs",
            "joints/cells.rs",
            "joints/edges.rs",
            "joints/network.rs",
            "joints/flow.rs",
            "joints/friction.rs",
            "joints/slot.rs",
            "joints/water.rs",
            "joints/loads.rs",
            "joints/motion.rs",
            "joints/cover.rs",
            "joints/takeover.rs",
            "coupling/jointed.rs",
        ],
    ),
    (
        "Contact laws",
        ["contact", "contact_option"],
        ["dem/contact.rs", "dem/contact/*", "dem/contact/rolling.rs", "dem/contact/bridges.rs", "dem/contact/softened.rs", "dem/dashpot.rs"],
    ),
    (
        "Blocks",
        ["block_model", "blocks"],
        [
            "dem/polyhedron.rs",
            "dem/polyhedron/contact.rs",
            "dem/polyhedron/contact/pressure.rs",
            "dem/polyhedron/force.rs",
            "dem/polyhedron/rotation.rs",
            "dem/polyhedron/analytic_centre.rs",
            "dem/polyhedron/linear_program.rs",
        ],
    ),
    ("Motion of grains", [], ["dem/lib.rs", "dem/integrate.rs", "dem/neighbors.rs"]),
    ("Structures and walls", ["structure", "walls"], ["structure/lib.rs", "structure/mesh.rs", "dem/surface.rs", "dem/servo.rs", "dem/walls/area.rs", "simulation/drives.rs"]),
    ("Samples of grains and blocks", [], ["preparation/growth.rs", "preparation/deposition.rs", "plan/scene/rock.rs", "plan/scene/rock/joints.rs"]),
    (
        "Limits of stability",
        [],
        [
            "plan/contacts.rs",
            "plan/added_mass.rs",
            "plan/coupling_interval.rs",
            "plan/explicit_drag.rs",
            "plan/scene/terms/*",
            "plan/free_surface.rs",
            "plan/levels.rs",
            "plan/servo.rs",
        ],
    ),
    (
        "Promised accuracy and numerical uncertainty",
        [],
        [
            "plan/scene/auto/bound.rs",
            "plan/scene/auto/density.rs",
            "plan/scene/auto/moving.rs",
            "plan/scene/auto/sound.rs",
            "plan/scene/auto/promise.rs",
            "plan/scene/auto/ground.rs",
            "plan/ends.rs",
            "studies/uncertainty/convergence.rs",
        ],
    ),
    (
        "Initial flow, probes and analyses",
        ["initial", "probe", "analysis"],
        [
            "output/probes/bed.rs",
            "output/probes/fabric.rs",
            "output/probes/wall_load.rs",
            "analysis/erosion_law.rs",
            "analysis/erosion_law/jet.rs",
            "analysis/ground_collapse.rs",
            "analysis/element_test.rs",
        ],
    ),
]

STEP = [
    ("Fluid", "collide, stream, boundaries; sum the load on each body"),
    ("Solids", "N steps: half kick, drift, contacts, half kick"),
    ("Removal", "gates open, grains leave or enter"),
    ("Bodies", "mapped onto the lattice again where they moved"),
    ("Outputs", "averages, probes, fields, checkpoints, guards"),
]

STYLE = """
body { font: 16px/1.5 system-ui, sans-serif; margin: 0; color: #1b1b1b; background: #fff; }
main { max-width: 58rem; margin: 0 auto; padding: 1rem 2rem 6rem 22rem; }
nav { position: fixed; inset: 0 auto 0 0; width: 18rem; overflow: auto; padding: 1rem; box-sizing: border-box;
  background: #f4f4f1; font-size: 14px; }
nav ol { padding-left: 1.2rem; } nav a { text-decoration: none; color: inherit; }
h1, h2, h3 { line-height: 1.25; } h2 { border-top: 2px solid #ccc; padding-top: 1rem; margin-top: 3rem; }
h3 { margin-top: 2rem; } .file { color: #777; font: 13px ui-monospace, monospace; }
pre, .equation { font: 15px/1.6 "STIX Two Math", "Cambria Math", "DejaVu Serif", serif; background: #f6f6f9;
  border-left: 3px solid #8aa; padding: .5rem 1rem; overflow-x: auto; white-space: pre; }
.equation { white-space: normal; margin: .4rem 0; } math { font-size: 18px; font-family: "STIX Two Math", "Latin Modern Math", "Cambria Math", math; }
.note { color: #555; font: 14px system-ui, sans-serif; } .gap { display: inline-block; width: 2.5em; }
code { font: 14px ui-monospace, monospace; background: #f1f1ee; padding: 0 .2em; }
table { border-collapse: collapse; margin: 1rem 0; } td, th { border: 1px solid #ccc; padding: .2rem .6rem;
  vertical-align: top; text-align: left; }
sub, sup { font-size: .72em; line-height: 0; }
svg { background: #fff; margin: .5rem 1rem .5rem 0; } svg text { font: 12px system-ui, sans-serif; }
@media (max-width: 60rem) { nav { position: static; width: auto; } main { padding: 1rem; } }
@media print { nav { display: none; } main { padding: 0; } }
"""


def head(path):
    """Returns the lines of the module head of a file."""
    lines = []
    for line in path.read_text(encoding="utf-8").splitlines():
        if not line.startswith("//!"):
            break
        lines.append(line[3:].removeprefix(" "))
    return lines


def papers():
    """Returns the table of families, models and keys of src/plan/citations.rs."""
    text = (ROOT / "src" / "plan" / "citations.rs").read_text(encoding="utf-8")
    table = re.search(r"pub const MODELS: .*? = &\[(.*?)\n\];", text, re.S)[1]
    families, name = {}, None
    for token in re.finditer(r'\(\s*"(\w+)",\s*&\[|"(\w+)"', table):
        if token[1]:
            models = re.match(r"\s*\(", table[token.end() :]) is not None
            if models:
                name = token[1]
                families[name] = {}
            else:
                model = token[1]
                families[name][model] = []
        else:
            families[name][model].append(token[2])
    return families


def velocities(name):
    """Returns the velocities of a set: all with at most two (D2Q9, D3Q19) or three components that are not zero."""
    most, depth = {"D2Q9": (2, (0,)), "D3Q19": (2, (-1, 0, 1)), "D3Q27": (3, (-1, 0, 1))}[name]
    steps = (-1, 0, 1)
    sets = [(x, y, z) for x in steps for y in steps for z in depth]
    return [c for c in sets if sum(v != 0 for v in c) <= most]


def velocity_set(name):
    """Draws the velocities of a set as arrows from the centre of a cell."""
    size, scale = 230, 72

    def project(c):
        x, y, z = c
        return size / 2 + scale * (x + 0.42 * z) * 0.85, size / 2 + 8 - scale * (y + 0.36 * z) * 0.85

    parts = [f'<svg width="{size}" height="{size + 24}" role="img" aria-label="Velocities of {name}">']
    corners = velocities("D2Q9" if name == "D2Q9" else "D3Q27")
    full = [c for c in corners if all(v != 0 for v in c[: 2 if name == "D2Q9" else 3])]
    for one in full:
        for other in full:
            if one < other and sum(a != b for a, b in zip(one, other)) == 1:
                (x, y), (u, v) = project(one), project(other)
                parts.append(f'<line x1="{x:.1f}" y1="{y:.1f}" x2="{u:.1f}" y2="{v:.1f}" stroke="#ccc"/>')
    colours = {1: "#20639b", 2: "#c65b1c", 3: "#3a7d44"}
    for c in sorted(velocities(name), key=lambda c: -c[2]):
        length = sum(v != 0 for v in c)
        (x, y), (u, v) = project((0, 0, 0)), project(c)
        if length == 0:
            parts.append(f'<circle cx="{x:.1f}" cy="{y:.1f}" r="4"/>')
            continue
        parts.append(f'<line x1="{x:.1f}" y1="{y:.1f}" x2="{u:.1f}" y2="{v:.1f}" stroke="{colours[length]}" stroke-width="2"/>')
        parts.append(f'<circle cx="{u:.1f}" cy="{v:.1f}" r="4" fill="{colours[length]}"/>')
    title = f"{name}: {len(velocities(name))} velocities"
    parts.append(f'<text x="{size / 2}" y="{size + 18}" text-anchor="middle">{title}</text></svg>')
    return "".join(parts)


def step_drawing():
    """Draws the order of work in a step."""
    width, row = 560, 54
    parts = [f'<svg width="{width}" height="{row * len(STEP)}" role="img" aria-label="Order of work in a step">']
    for n, (name, text) in enumerate(STEP):
        y = n * row
        parts.append(f'<rect x="1" y="{y + 2}" width="{width - 2}" height="36" rx="6" fill="#f4f4f1" stroke="#8aa"/>')
        parts.append(f'<text x="14" y="{y + 25}" font-weight="bold">{name}</text>')
        parts.append(f'<text x="112" y="{y + 25}">{html.escape(text)}</text>')
        if n + 1 < len(STEP):
            parts.append(f'<path d="M40 {y + 39} v13 m-4 -5 l4 5 l4 -5" stroke="#577" fill="none"/>')
    return "".join(parts) + "</svg>"


def scripts(text):
    """Returns an equation in HTML with its indices and exponents set low and high."""
    text = html.escape(text, quote=False)
    part = r"(\([^()]*\)|\{[^{}]*\}|-?[A-Za-zα-ωΑ-Ω0-9∥⊥]+(?:/[0-9]+)?(?:\.[0-9]+)?)"
    text = re.sub(r"(?<=[\w)\]'}|∂*])_" + part, r"<sub>\1</sub>", text)
    text = re.sub(r"\^" + part, r"<sup>\1</sup>", text)
    return re.sub(r"(<su[bp]>)[({]([^<]*)[)}](</su[bp]>)", r"\1\2\3", text)


def inline(text):
    """Returns a line of Markdown in HTML: code, emphasis and the names of links to items."""
    kept = []

    def keep(match):
        kept.append(f"<code>{html.escape(match[1], quote=False)}</code>")
        return f"\0{len(kept) - 1}\0"

    text = re.sub(r"\[([^\]\[]+)\]\((?!https?:)[^)]*\)", r"\1", text)
    text = re.sub(r"\[(`[^`]+`)\]", r"\1", text)
    text = re.sub(r"`([^`]+)`", keep, text).replace(r"\[", "[").replace(r"\]", "]")
    # A letter with an index or an exponent is a symbol; names of code stand between backticks.
    symbol = r"(?<![A-Za-zα-ω_\0])[A-Za-zα-ωΑ-Ω∂]\*?(?:_[\wα-ωī+-]+|\^[\wα-ω+-]+|\^\([^()\s]*\)|\^\{[^{}\s]*\})+(?!\w)"
    parts = enumerate(re.split(f"({symbol})", text))
    text = "".join(scripts(part) if n % 2 else html.escape(part, quote=False) for n, part in parts)
    text = re.sub(r"(?<=[\w)\]])\^(½|⅓|⅕|-?\d+(?:/\d+)?|[a-z](?!\w)|\([^()\s]*\))", r"<sup>\1</sup>", text)
    text = re.sub(r"\*\*([^*]+)\*\*", r"<b>\1</b>", text)
    text = re.sub(r"(?<![\w*])\*([^*\s][^*]*)\*(?![\w*])", r"<i>\1</i>", text)
    text = re.sub(r"doi:(10\.[^\s,;)]+(?:\([^\s)]*\)[^\s,;)]*)?)", lambda m: doi(m[1].rstrip(".")), text)
    return re.sub("\0(\\d+)\0", lambda match: kept[int(match[1])], text)


def doi(name):
    """Returns the link of a DOI."""
    return f'<a href="https://doi.org/{name}">doi:{name}</a>'


def is_equation(text):
    """Returns True for a paragraph that is an equation: a relation, hardly any words, no code."""
    words = re.findall(r"\b[a-z]{4,}\b", text)
    relation = re.search(r"[=←≤≥~]", text)
    return bool(relation) and "`" not in text and len(words) <= 5 and len(text) < 260 and not text.rstrip().endswith(":")


def joined(rows):
    """Returns the rows of a block of equations; a note that continues on the next row belongs to the row before."""
    out = []
    for row in rows:
        text = row.strip()
        if out and row.startswith(" " * 20) and not re.match(r"[-+=*/<>≤≥]", text):
            out[-1] += " " + text
        elif text:
            out.append(row)
    return out


def body(lines):
    """Returns the Markdown of a module head in HTML."""
    out, n = [], 0
    while n < len(lines):
        line = lines[n]
        if not line.strip():
            n += 1
        elif line.startswith("```"):
            end = n + 1
            while end < len(lines) and not lines[end].startswith("```"):
                end += 1
            rows = lines[n + 1 : end]
            if mathml.is_drawing(rows):
                out.append("<pre>" + "\n".join(scripts(row.replace("`", "")) for row in rows) + "</pre>")
            else:
                out.append("".join(f'<p class="equation">{mathml.equation(row, inline)}</p>' for row in joined(rows)))
            n = end + 1
        elif line.startswith("|"):
            rows = []
            while n < len(lines) and lines[n].startswith("|"):
                rows.append([cell.strip() for cell in lines[n].strip().strip("|").split("|")])
                n += 1
            kind = ["th"] + ["td"] * len(rows)
            rows = [row for row in rows if not all(re.fullmatch(r":?-+:?", cell) for cell in row)]
            cells = ("".join(f"<{k}>{inline(c)}</{k}>" for c in row) for k, row in zip(kind, rows))
            out.append("<table>" + "".join(f"<tr>{row}</tr>" for row in cells) + "</table>")
        elif match := re.match(r"\s*([-*]|\d+\.) ", line):
            tag = "ul" if match[1] in "-*" else "ol"
            items = []
            while n < len(lines) and lines[n].strip():
                if match := re.match(r"\s*(?:[-*]|\d+\.) (.*)", lines[n]):
                    items.append(match[1])
                else:
                    items[-1] += " " + lines[n].strip()
                n += 1
            out.append(f"<{tag}>" + "".join(f"<li>{inline(item)}</li>" for item in items) + f"</{tag}>")
        elif line.startswith("#"):
            out.append(f"<h4>{inline(line.lstrip('# '))}</h4>")
            n += 1
        else:
            paragraph = []
            while n < len(lines) and lines[n].strip() and not lines[n].startswith(("```", "|")):
                paragraph.append(lines[n].strip())
                n += 1
            text = " ".join(paragraph)
            out.append(f'<p class="equation">{mathml.equation(text, inline)}</p>' if is_equation(text) and not mathml.is_note(text) else f"<p>{inline(text)}</p>")
    return "\n".join(out)


def files_of(patterns, families, table):
    """Returns the files of a chapter in order; `*` stands for the models of its families in a folder."""
    files = []
    for pattern in patterns:
        if pattern.endswith("/*"):
            models = [model for family in families for model in table[family]]
            found = [SOURCES / pattern[:-1] / f"{model}.rs" for model in models]
            files += [path for path in found if path.is_file() and path not in files]
        else:
            path = SOURCES / pattern
            files.append(path)
    return files


def reference(entry):
    """Returns a publication of the bibliography as HTML."""
    source = ", ".join(entry[k] for k in ("journal", "booktitle", "publisher", "school") if k in entry)
    source += f" {entry['volume']}" if "volume" in entry else ""
    source += f" ({entry['year']})" + (f" {entry['pages']}" if "pages" in entry else "")
    link = f", {doi(html.escape(entry['doi']))}" if "doi" in entry else ""
    text = f"{', '.join(entry['authors'])}. <i>{html.escape(entry['title'])}</i>. {html.escape(source)}{link}"
    return f'<p id="{entry["key"]}"><b>[{entry["key"]}]</b> {text}</p>'


def links(keys):
    """Returns the links to the entries of publications."""
    return ", ".join(f'<a href="#{key}">{key}</a>' for key in keys)


def manual():
    """Returns the manual as HTML."""
    table = papers()
    entries = json.loads((ROOT / "src" / "plan" / "bibliography.json").read_text(encoding="utf-8"))
    contents, chapters = [], []
    for number, (title, families, patterns) in enumerate(CHAPTERS, 1):
        name = re.sub(r"\W+", "-", title.lower())
        contents.append(f'<li><a href="#{name}">{title}</a></li>')
        parts = [f'<h2 id="{name}">{number}. {title}</h2>']
        if title == "Lattice":
            parts += [velocity_set(each) for each in ("D2Q9", "D3Q19", "D3Q27")]
        rows = [(family, model, keys) for family in families for model, keys in table[family].items()]
        if rows:
            cells = (
                f"<tr><td>{family.replace('_', ' ')}</td><td><code>{model}</code></td><td>{links(keys)}</td></tr>"
                for family, model, keys in rows
            )
            parts.append("<table><tr><th>family</th><th>model</th><th>papers</th></tr>" + "".join(cells) + "</table>")
        for path in files_of(patterns, families, table):
            lines = head(path)
            if not lines:
                sys.exit(f"manual: {path.relative_to(ROOT)} has no module head")
            title = path.stem if path.stem != "lib" else path.parent.name
            parts.append(f"<h3>{title.replace('_', ' ').capitalize()}</h3>")
            parts.append(f'<p class="file">{path.relative_to(ROOT)}</p>')
            parts.append(body(lines))
        chapters.append("\n".join(parts))
    bibliography = "\n".join(reference(entry) for entry in entries)
    return f"""<!DOCTYPE html>
<html lang="en"><head><meta charset="utf-8"><meta name="viewport" content="width=device-width">
<title>Theory manual</title><style>{STYLE}</style></head><body>
<nav><b>Theory manual</b><ol>{"".join(contents)}</ol><a href="#bibliography">Bibliography</a></nav>
<main><h1>Theory manual</h1>
<p>Equations, sources and limits of the models, as the heads of their files state them. <code>solver cite CASE</code> lists
the papers of the models of a case, and <code>solver reference</code> writes all parameters.</p>
{step_drawing()}
{chr(10).join(chapters)}
<h2 id="bibliography">Bibliography</h2>
{bibliography}
</main></body></html>
"""


def main():
    words = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    words.add_argument("--output", type=pathlib.Path, default=ROOT / "results" / "theory", help="folder of the manual")
    folder = words.parse_args().output
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / "theory.html"
    path.write_text(manual(), encoding="utf-8")
    print(path)


if __name__ == "__main__":
    main()
