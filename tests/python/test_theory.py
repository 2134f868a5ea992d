"""The theory manual: every family of models has a chapter, every paper an entry, and the file is sound HTML."""

import html.parser
import importlib.util
import json
import re
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
VOID = {"meta", "line", "rect", "circle", "path", "mspace"}


def load(name="manual"):
    folder = ROOT / "jobs" / "theory"
    if str(folder) not in sys.path:
        sys.path.insert(0, str(folder))
    spec = importlib.util.spec_from_file_location(name, folder / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


class Reader(html.parser.HTMLParser):
    """Checks that elements close in order; keeps names, links, equations and text."""

    def __init__(self):
        super().__init__()
        self.open, self.names, self.links, self.words = [], [], [], []
        self.equations = 0

    def handle_starttag(self, tag, attributes):
        attributes = dict(attributes)
        if tag not in VOID:
            self.open.append(tag)
        self.names += [attributes["id"]] if "id" in attributes else []
        self.links += [attributes["href"]] if "href" in attributes else []
        self.equations += tag == "pre" or attributes.get("class") == "equation"

    def handle_endtag(self, tag):
        if tag not in VOID:
            assert self.open.pop() == tag, (tag, self.getpos())

    def handle_data(self, data):
        self.words.append(data)


def test_the_manual_has_all_models_and_papers():
    manual = load()
    reader = Reader()
    reader.feed(manual.manual())
    assert reader.open == []
    assert len(set(reader.names)) == len(reader.names)
    missing = [link for link in reader.links if link.startswith("#") and link[1:] not in reader.names]
    assert missing == []
    assert reader.equations > 50

    table = manual.papers()
    assert len(table) > 20 and all(keys for models in table.values() for keys in models.values())
    chapters = [family for _, families, _ in manual.CHAPTERS for family in families]
    assert sorted(chapters) == sorted(table)
    text = "".join(reader.words)
    for entry in json.loads((ROOT / "src" / "plan" / "bibliography.json").read_text(encoding="utf-8")):
        assert f"[{entry['key']}]" in text
        assert entry["title"] in text
    # Every operator has its section.
    for operator in table["collision"]:
        assert f"src/lbm/collision/{operator}.rs" in text


def test_equations_and_links_are_set():
    manual = load()
    assert manual.scripts("f_i^eq = w_i (1 - B)") == "f<sub>i</sub><sup>eq</sup> = w<sub>i</sub> (1 - B)"
    assert manual.scripts("x^{k+1} < 2") == "x<sup>k+1</sup> &lt; 2"
    assert manual.inline("see [`super::trt`] and `a_b`") == "see <code>super::trt</code> and <code>a_b</code>"
    assert manual.inline("with g_i^neq of K_x and max_steps") == "with g<sub>i</sub><sup>neq</sup> of K<sub>x</sub> and max_steps"
    assert manual.is_equation("ν_t = (C_s Δ)² √(2 S:S), S the rate of strain")
    assert not manual.is_equation("The symmetric part of each pair relaxes at ω = 1/τ, which sets the viscosity of the fluid.")
    found = manual.body(["A", "b.", "", "```text", "F_n = k", "```", "- one", "  two", "", "| a | b |", "|---|---|", "| 1 | 2 |"])
    assert "<p>A b.</p>" in found and "<msub><mrow><mi>F</mi></mrow><mrow><mi>n</mi></mrow></msub><mo>=</mo><mi>k</mi>" in found
    assert "<ul><li>one two</li></ul>" in found and "<tr><th>a</th><th>b</th></tr><tr><td>1</td>" in found
    assert [len(manual.velocities(name)) for name in ("D2Q9", "D3Q19", "D3Q27")] == [9, 19, 27]


def test_formulas_are_typeset():
    mathml = load("mathml")

    def shown(text):
        return re.sub(r' class="group"|<!--g-->', "", mathml.Parser(text).row())

    assert shown("a/b") == "<mfrac><mrow><mi>a</mi></mrow><mrow><mi>b</mi></mrow></mfrac>"
    # Factors before a slash with spaces stand above it, and brackets around all of a part are left out.
    assert shown("K = eps^3 d^2 / [180 (1 - eps)]").startswith("<mi>K</mi><mo>=</mo><mfrac><mrow><msup><mrow><mi>ε</mi>")
    assert shown("c / [1 + x]") == "<mfrac><mrow><mi>c</mi></mrow><mrow><mn>1</mn><mo>+</mo><mi>x</mi></mrow></mfrac>"
    assert shown("(a)(b) / c").startswith("<mfrac><mrow><mrow><mo>(</mo><mi>a</mi><mo>)</mo></mrow>")
    assert shown("sqrt(2 R*)") == "<msqrt><mn>2</mn><msup><mrow><mi>R</mi></mrow><mrow><mo>*</mo></mrow></msup></msqrt>"
    assert shown("-d eps/dt").startswith("<mo>−</mo><mfrac><mrow><mrow><mi>d</mi><mi>ε</mi></mrow></mrow>")
    assert "<mtext>&nbsp;while bonded&nbsp;</mtext>" in shown("F = C while bonded")
    assert mathml.is_note("pushing; pulling only with `attraction`") and not mathml.is_note("F_n = k_n overlap")
    assert mathml.is_drawing(["half kick  ->  ghosts  ->  forces"]) and not mathml.is_drawing(["a = b"])
