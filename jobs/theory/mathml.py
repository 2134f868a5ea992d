"""Equations as the comments of the sources write them, in MathML.

`K = eps^3 d^2 / [180 (1 - eps)^2]` is a fraction; `a/b` without spaces divides the factor before by the factor after, and
` / ` with spaces all factors before it. Names of Greek letters, `sqrt`, `sum`, `grad`, `div`, indices (`_`) and
exponents (`^`) have their usual forms. Words of English stay words.
"""

import html
import re

GREEK = dict(
    alpha="α", beta="β", gamma="γ", delta="δ", eps="ε", zeta="ζ", eta="η", theta="θ", kappa="κ", lambda_="λ", mu="μ", nu="ν",
    xi="ξ", pi="π", rho="ρ", sigma="σ", tau="τ", phi="φ", chi="χ", psi="ψ", omega="ω",
)
GREEK["lambda"] = GREEK.pop("lambda_")
OPERATORS = {"sum": "∑", "grad": "∇", "Σ": "∑"}
FUNCTIONS = {"cut", "min", "max", "exp", "ln", "sin", "cos", "tan", "tanh", "atan2", "diag", "centroid", "log10", "tr"}
SHORT_WORDS = {"on", "by", "no", "one", "two", "over", "odd", "down", "else", "of", "at", "to", "in", "or", "is", "if", "up", "and", "for", "the", "are", "all", "out", "but", "any", "cut"}
UPRIGHT = {"overlap", "slip", "roll", "spin", "depth", "area", "point", "rest", "gap", "body", "flow", "rate", "inflow", "outflow"}
RAISED = {"²": "2", "³": "3", "¹": "1", "½": "½", "⁺": "+", "⁻": "-", "ᵀ": "T"}
LOWERED = str.maketrans("₀₁₂₃₄₅₆₇₈₉", "0123456789")
BRACKETS = {"(": ")", "[": "]", "{": "}", "⟨": "⟩", "⟮": "⟯"}
RELATIONS = {"=", "<=", ">=", "<", ">", "≤", "≥", "~", "←", "→", "⊥", "≈"}
SEPARATORS = RELATIONS | {"+", "-", ",", ";", ":", "±"}

LETTERS = "[A-Za-z0-9α-ωΑ-Ωīȷ̄]"
TOKEN = re.compile(
    r"(?P<space>\s+)|(?P<code>`[^`]*`)|(?P<relation><=|>=|->|<-|(?<=\s)[<>](?=\s)|[=≤≥~←→⊥≈])"
    r"|(?P<raised>[²³¹⁺⁻ᵀ]+)|(?P<number>[0-9]+(?:\.[0-9]+)?|[¼½¾])|(?P<name>[A-Za-z]+(?:[0-9]+(?![A-Za-z.]))?|[^\W\d_A-Za-z])"
    r"|(?P<index>_(?:\{[^{}]*\}|\([^()]*\)|" + LETTERS + r"+(?:[+-]1(?![\w.]))?))"
    r"|(?P<power>\^(?:\{[^{}]*\}|\((?:[^()]|\([^()]*\))*\)|\[[^\]]*\]|-?" + LETTERS + r"+(?:\.[0-9]+)?|[⁺⁻¼½¾]))"
    r"|(?P<prime>')|(?P<star>(?<=[\w)\]])\*)|(?P<open>[(\[{⟮]|<(?=\S))|(?P<close>[)\]}⟯]|(?<=\S)>)|(?P<other>.)",
)


def escape(text):
    """Returns text for HTML."""
    return html.escape(text, quote=False)


def is_word(name):
    """Returns True for a word of English: four letters and more, or one of a short list."""
    return name.islower() and name.isascii() and (name in SHORT_WORDS or len(name) > 3) and name not in GREEK | OPERATORS and name not in FUNCTIONS | {"sqrt"}


class Parser:
    """Reader of one equation."""

    def __init__(self, text):
        text = re.sub(r"\\([\[\]])", r"\1", text.rstrip(" ."))
        text = re.sub(r"\bd (\w+)/(d\w)\b", r"⟮d \1⟯/\2", text)
        text = re.sub(r"(?<=[A-Za-zα-ω])([₀-₉]+)", lambda m: "_{" + m[1].translate(LOWERED) + "}", text)
        self.tokens = [(m.lastgroup, m[0]) for m in TOKEN.finditer(text)]
        self.at = 0

    def peek(self, ahead=0):
        """Returns kind and text of a token; a stop after the last."""
        return self.tokens[self.at + ahead] if self.at + ahead < len(self.tokens) else ("end", "")

    def row(self, stop=None):
        """Returns the MathML of all up to a closing bracket; `start` is where the factors of a product begin."""
        out, start = [], 0
        while self.peek()[0] != "end":
            kind, text = self.peek()
            if kind == "close" and text == stop or stop == "|" and text == "|":
                break
            spaced = kind == "space"
            if spaced:
                self.at += 1
                kind, text = self.peek()
                if kind == "other" and text == "/" and self.peek(1)[0] == "space" and len(out) > start:
                    self.at += 2
                    below = self.factor()
                    while below.endswith("∑</mo>") and self.peek()[0] == "space":
                        self.at += 1
                        below += self.factor()
                    out[start:] = [self.fraction(out[start:], below)]
                    continue
                if kind in ("end", "close"):
                    continue
            if kind == "relation" or text in SEPARATORS and kind == "other":
                self.at += 1
                text = {"<=": "≤", ">=": "≥", "->": "→", "<-": "←", "-": "−"}.get(text, text)
                out.append(f"<mo>{escape(text)}</mo>")
                if text in ",;" and self.peek()[1].startswith("  "):
                    out.append('<mspace width="1.5em"/>')
                start = len(out)
                continue
            if kind == "close":
                self.at += 1
                out.append(f"<mo>{escape(text)}</mo>")
                continue
            if kind == "name" and is_word(text) and text not in UPRIGHT or kind == "code":
                out.append(self.words())
                start = len(out)
                continue
            out.append(self.factor())
        return "".join(out)

    def words(self):
        """Returns a run of words of English."""
        words = []
        while True:
            kind, text = self.peek()
            if kind == "code":
                words.append(text.strip("`"))
            elif kind == "name" and (is_word(text) or self.is_article()):
                words.append(text)
            elif kind == "space" and (self.peek(1)[0] == "code" or is_word(self.peek(1)[1]) or self.is_article(1)):
                pass
            elif kind == "other" and text in ",;:" and words and self.peek(1)[0] in ("space", "end"):
                words[-1] += text
            else:
                break
            self.at += 1
        return f"<mtext>&nbsp;{escape(' '.join(words))}&nbsp;</mtext>"

    def is_article(self, ahead=0):
        """Returns True for an article before a word."""
        return self.peek(ahead)[1] in ("a", "an") and self.peek(ahead + 1)[0] == "space" and is_word(self.peek(ahead + 2)[1])

    def factor(self):
        """Returns a factor, with all that it is divided by without spaces."""
        factor = self.scripted()
        while self.peek()[0] == "name":
            factor += self.scripted()
        while self.peek() == ("other", "/"):
            self.at += 1
            factor = self.fraction([factor], self.scripted())
        return factor

    def fraction(self, above, below):
        """Returns a fraction."""
        return f"<mfrac><mrow>{self.strip(''.join(above))}</mrow><mrow>{self.strip(below)}</mrow></mfrac>"

    @staticmethod
    def strip(text):
        """Returns the MathML of a group without its brackets."""
        match = re.fullmatch(r'<mrow class="group"><mo>.</mo>(.*)<mo>.</mo></mrow><!--g-->', text, re.S)
        depth = 0
        for mark in re.findall(r'<mrow class="group">|<!--g-->', match[1]) if match else []:
            depth += 1 if mark.startswith("<mrow") else -1
            if depth < 0:
                return text
        return match[1] if match else text

    def scripted(self):
        """Returns an atom with its indices and exponents, and the brackets of a function."""
        kind, _ = self.peek()
        base = self.atom()
        below, above = [], []
        while True:
            kind, text = self.peek()
            if kind == "index":
                below.append(self.script(text[1:]))
            elif kind == "power":
                above.append(self.script(text[1:]))
            elif kind == "raised":
                above.append("".join(f"<mo>{RAISED[c]}</mo>" if c in "⁺⁻" else f"<mn>{RAISED[c]}</mn>" for c in text).replace("<mo>-", "<mo>−"))
            elif kind == "number" and text == "½" and base.startswith("<mi"):
                above.append("<mn>½</mn>")
            elif kind == "prime":
                above.append("<mo>′</mo>")
            elif kind == "star":
                above.append("<mo>*</mo>")
            else:
                break
            self.at += 1
        if below or above:
            pair = [f"<mrow>{''.join(part)}</mrow>" for part in (below, above) if part]
            tag = "msubsup" if len(pair) == 2 else "msub" if below else "msup"
            base = f"<{tag}><mrow>{base}</mrow>{''.join(pair)}</{tag}>"
        if kind == "open" and text in "([" and "<mi" in base and not base.startswith("<mrow"):
            base = f"<mrow>{base}{self.group()}</mrow>"
            return self.again(base)
        return base

    def again(self, base):
        """Returns a function with the exponents after its brackets."""
        kind, text = self.peek()
        if kind == "power":
            self.at += 1
            return f"<msup><mrow>{base}</mrow><mrow>{self.script(text[1:])}</mrow></msup>"
        if kind == "raised":
            self.at += 1
            return f"<msup><mrow>{base}</mrow><mrow>{''.join(RAISED[c] for c in text)}</mrow></msup>"
        return base

    @staticmethod
    def script(text):
        """Returns an index or an exponent."""
        inner = text[1:-1] if text[:1] in "{([" else text
        if re.fullmatch(r"\d+(\.\d+)?", inner):
            return f"<mn>{inner}</mn>"
        if re.fullmatch(r"[A-Za-z]+", inner) and inner not in GREEK:
            return f"<mi>{inner}</mi>"
        inner = re.sub(r"(?<=[\w)])/(?=[\w(])", "∕", inner).replace("<", " < ")
        return Parser(inner).row()

    def group(self):
        """Returns a group in brackets."""
        _, text = self.peek()
        self.at += 1
        text = "⟨" if text == "<" else text
        inner = self.row(">" if text == "⟨" else BRACKETS[text])
        self.at += 1
        if text == "⟮":
            return f"<mrow>{inner}</mrow>"
        return f'<mrow class="group"><mo>{text}</mo>{inner}<mo>{BRACKETS[text]}</mo></mrow><!--g-->'

    def atom(self):
        """Returns a number, a name, a root or a group."""
        kind, text = self.peek()
        if kind == "open":
            return self.group()
        self.at += 1
        if kind == "number":
            return f"<mn>{text}</mn>"
        if text == "sqrt" or text == "√":
            if self.peek()[0] == "open":
                inner = self.strip(self.group())
                return f"<msqrt>{inner}</msqrt>"
            return "<mo>√</mo>"
        if kind == "name":
            return self.name(text)
        if text == "|":
            inner = self.row("|")
            self.at += 1
            return f"<mrow><mo stretchy='false'>|</mo>{inner}<mo stretchy='false'>|</mo></mrow>"
        if text == "-":
            return "<mo>−</mo>"
        return f"<mo>{escape({'.': '·', '∕': '/'}.get(text, text))}</mo>"

    @staticmethod
    def name(text):
        """Returns a symbol: a Greek letter, an operator, a function, or Latin letters with a number as index."""
        if text in OPERATORS:
            return f"<mo>{OPERATORS[text]}</mo>"
        if text == "div":
            return "<mo>∇</mo><mo>·</mo>"
        if text in FUNCTIONS:
            return "<msub><mi>log</mi><mn>10</mn></msub>" if text == "log10" else f"<mi>{text}</mi>"
        stem, digits = re.fullmatch(r"(\D+)(\d*)", text).groups()
        if stem in GREEK:
            symbol = f"<mi>{GREEK[stem]}</mi>"
        elif re.fullmatch(r"d[a-zA-Z]", stem):
            symbol = f"<mi mathvariant='normal'>d</mi><mi>{stem[1]}</mi>"
        elif len(stem) == 2 and stem.islower() and stem.isascii():
            symbol = f"<mi>{stem[0]}</mi><mi>{stem[1]}</mi>"
        elif stem in UPRIGHT:
            symbol = f'<mi>{stem}</mi><mspace width="0.2em"/>'
        else:
            symbol = f"<mi>{escape(stem)}</mi>"
        return f"<msub>{symbol}<mn>{digits}</mn></msub>" if digits else symbol


def is_note(text):
    """Returns True for a remark in words next to an equation."""
    words = [word for word in re.findall(r"(?<![_A-Za-z^])[A-Za-z]{4,}", text) if word not in GREEK | OPERATORS and word != "sqrt"]
    return bool(words) and (not re.search(r"[=≤≥]", text) or len(words) > 4) and not text.startswith(("sum ", "div ", "grad "))


def equation(line, remark):
    """Returns a line of equations in MathML; columns are three spaces apart, and `remark` gives remarks in words."""
    cells = []
    for cell in re.split(r"\s{3,}", line.strip()):
        if is_note(cell):
            cells.append(f'<span class="note">{remark(cell)}</span>')
        else:
            cells.append(f'<math display="inline" displaystyle="true">{Parser(cell).row()}</math>'.replace("<!--g-->", ""))
    return '<span class="gap"></span>'.join(cells)


def is_drawing(lines):
    """Returns True for lines that are no equations: flows with arrows, or more words than symbols."""
    text = "\n".join(lines)
    return "-->" in text or "->  " in text or "  -> " in text or not re.search(r"[=]|minimise|maximise", text)
