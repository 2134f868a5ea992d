#!/usr/bin/env python3
"""From pairs of measurements to the tables and the picture of benches/results; no dependencies.

  table.py row ROW PAIRS.tsv HEADER OUT.csv   medians, ratios with their spread, pass or not
  table.py scaling <OUTPUT                    lines of `dem scaling` as quantities of P-12
  table.py picture RESULTS                    summary.svg from the CSV files there
  table.py show RESULTS                       the same on the terminal

PAIRS.tsv, from beside_peers.sh, one line a pair: quantity, unit, ours, peer, name of the peer, sense, bar, aim. Senses:
`rate` (ratio ours/peer, to reach the bar), `time` (ratio peer/ours, to reach the bar), `limit` (ratio ours/peer, to stay
at or below the bar). A bar of `-` is none: the line is there to be read.
"""
import csv
import math
import os
import re
import statistics
import sys

COLUMNS = ["id", "quantity", "unit", "ours", "peer", "peer name and version", "ratio", "lowest ratio", "highest ratio", "bar", "aim", "pass"]
ORDER = [f"P-{n}" for n in range(1, 15)]


def short(x):
    return f"{x:.4g}"


def write_row(row, pairs, header, out):
    groups = {}
    with open(pairs) as f:
        for line in f:
            quantity, unit, ours, peer, name, sense, bar, aim = line.rstrip("\n").split("\t")
            groups.setdefault((quantity, unit, name, sense), []).append((float(ours), float(peer), bar, aim))
    with open(out + ".part", "w", newline="") as f:
        with open(header) as head:
            f.write(head.read())
        table = csv.writer(f, lineterminator="\n")
        table.writerow(COLUMNS)
        for (quantity, unit, name, sense), measured in groups.items():
            ratios = [p / o if sense == "time" else o / p for o, p, _, _ in measured]
            ratio = statistics.median(ratios)
            sign = "<=" if sense == "limit" else ">="
            # A bar that was measured too, such as a ratio of bandwidths, is the median of its pairs.
            bars = ["-" if m[k] == "-" else m[k] for k in (2, 3) for m in measured[:1]]
            bar, aim = (None if word == "-" else statistics.median(float(m[k]) for m in measured) for k, word in zip((2, 3), bars))
            passed = "" if bar is None else "yes" if (ratio <= bar if sense == "limit" else ratio >= bar) else "no"
            table.writerow([row, quantity, unit, short(statistics.median(m[0] for m in measured)), short(statistics.median(m[1] for m in measured)), name,
                            short(ratio), short(min(ratios)), short(max(ratios)), *("" if b is None else sign + short(b) for b in (bar, aim)), passed])
    os.replace(out + ".part", out)


def scaling():
    """The dearest grain over the cheapest, for one size and for sizes 1:100; and these beside those, with as many grains."""
    costs = {"lists": {}, "step": {}, "pair": {}}
    pattern = r"(\d+) spheres, sizes 1:(\S+)\s+lists\s+(\S+) ns/grain\s+(\S+) ns/pair, step\s+(\S+) ns/grain"
    for count, ratio, grain, pair, step in re.findall(pattern, sys.stdin.read()):
        for name, cost in (("lists", grain), ("step", step), ("pair", pair)):
            if float(cost) <= 0:
                sys.exit(f"table: {name} of {count} spheres took no time: too short for the clock")
            costs[name].setdefault(float(ratio), {})[int(count)] = float(cost)
    if not {1.0, 100.0} <= set(costs["lists"]):
        sys.exit("table: no line of `dem scaling` in the input")
    # The bar is on the search for neighbours; the step is there to be read.
    for name, bars in (("lists", ("1.5", "1.2")), ("step", ("-", "-"))):
        for ratio, words in ((1.0, "one size"), (100.0, "sizes 1:100")):
            cost = costs[name][ratio]
            worst, best = max(cost, key=cost.get), min(cost, key=cost.get)
            print(f"{name}, {words}: dearest grain from {min(cost):.0e} to {max(cost):.0e}", "ns/grain", cost[worst], cost[best], "the cheapest of them", *bars, sep="\t")
        one, wide = costs[name][1.0], costs[name][100.0]
        worst = max(wide, key=lambda n: wide[n] / one[n])
        print(f"{name}, sizes 1:100 against one size", "ns/grain", wide[worst], one[worst], "one size, as many grains", *bars, sep="\t")
    one, wide = costs["pair"][1.0], costs["pair"][100.0]
    worst = max(wide, key=lambda n: wide[n] / one[n])
    print("lists, sizes 1:100 against one size, by pairs", "ns/pair", wide[worst], one[worst], "one size, as many grains", "-", "-", sep="\t")


def load(results):
    rows = []
    for name in ORDER:
        path = os.path.join(results, name + ".csv")
        if not os.path.exists(path):
            continue
        with open(path, newline="") as f:
            lines = list(f)
        mark = ("*" if any(line.startswith("# BUSY") for line in lines) else "") + ("q" if any(line.startswith("# QUICK") for line in lines) else "")
        for row in csv.DictReader(line for line in lines if not line.startswith("#")):
            rows.append(dict(row, mark=mark))
    return rows


def text(x, y, words, anchor="start", size=12, fill="#222", weight="normal"):
    words = words.replace("&", "&amp;").replace("<", "&lt;").replace(">", "&gt;")
    return f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}" font-size="{size}" fill="{fill}" font-weight="{weight}">{words}</text>'


def picture(results):
    """How far each ratio lies from its bar, on a logarithmic scale; right is better."""
    rows = [row for row in load(results) if row["bar"]]
    left, width, high, right = 380, 420, 24, 190
    least, most = 0.25, 8.0

    def place(x):
        return left + width * math.log(min(max(x, least), most) / least) / math.log(most / least)

    bottom = 58 + high * len(rows)
    parts = [f'<svg xmlns="http://www.w3.org/2000/svg" width="{left + width + right}" height="{bottom + 44}" font-family="sans-serif">',
             '<rect width="100%" height="100%" fill="white"/>', text(14, 24, "Ratio over its bar: right of the line the bar is met", size=15, weight="bold")]
    for tick in (0.25, 0.5, 1, 2, 4, 8):
        x = place(tick)
        parts.append(f'<line x1="{x:.1f}" y1="44" x2="{x:.1f}" y2="{bottom}" stroke="{"#222" if tick == 1 else "#ddd"}" stroke-width="{2 if tick == 1 else 1}"/>')
        parts.append(text(x, bottom + 16, "bar" if tick == 1 else f"{tick:g} x", "middle", 11))
    for k, row in enumerate(rows):
        limit = row["bar"].startswith("<=")
        bar, aim = float(row["bar"][2:]), float(row["aim"][2:])

        def margin(ratio):
            return bar / ratio if limit else ratio / bar

        y = 50 + high * k
        low, middle, up = sorted(margin(float(row[name])) for name in ("lowest ratio", "ratio", "highest ratio"))
        middle = margin(float(row["ratio"]))
        fill = "#3b8f5a" if row["pass"] == "yes" else "#c0504d"
        start, end = sorted((place(1), place(middle)))
        parts.append(text(14, y + 14, f'{row["id"]}  {row["quantity"]}'[:62]))
        parts.append(f'<rect x="{start:.1f}" y="{y + 4}" width="{max(end - start, 1):.1f}" height="{high - 10}" fill="{fill}"/>')
        parts.append(f'<line x1="{place(low):.1f}" y1="{y + 11}" x2="{place(up):.1f}" y2="{y + 11}" stroke="#222" stroke-width="1.5"/>')
        x = place(margin(aim) if not limit else bar / aim)
        parts.append(f'<path d="M {x:.1f} {y + 2} l 4 -4 l -8 0 z" fill="#2f5d9b"/>')
        parts.append(text(left + width + 10, y + 14, f'{row["ratio"]} ({row["bar"].replace("<=", "at most ").replace(">=", "bar ")}){row["mark"]}'))
    marks = {row["mark"] for row in rows} - {""}
    foot = "line: least to most of the pairs; triangle: aim; scale ends at a quarter of the bar and eight times it"
    parts.append(text(14, bottom + 36, foot + ("; * on a busy machine, q tiny sizes" if marks else ""), size=11, fill="#555"))
    parts.append("</svg>")
    path = os.path.join(results, "summary.svg")
    with open(path + ".part", "w") as f:
        f.write("\n".join(parts) + "\n")
    os.replace(path + ".part", path)


def show(results):
    rows = load(results)
    print(f'{"id":5} {"quantity":56} {"ours":>10} {"peer":>10} {"ratio":>7} {"least":>7} {"most":>7}  {"bar":8} {"aim":8} pass')
    for row in rows:
        print(f'{row["id"]:5} {row["quantity"][:56]:56} {row["ours"]:>10} {row["peer"]:>10} {row["ratio"]:>7} {row["lowest ratio"]:>7} {row["highest ratio"]:>7}'
              f'  {row["bar"]:8} {row["aim"]:8} {row["pass"]}{row["mark"]}')


def main():
    words = sys.argv[1:]
    if words[:1] == ["row"] and len(words) == 5:
        write_row(*words[1:])
    elif words == ["scaling"]:
        scaling()
    elif words[:1] == ["picture"] and len(words) == 2:
        picture(words[1])
    elif words[:1] == ["show"] and len(words) == 2:
        show(words[1])
    else:
        sys.exit(__doc__)


if __name__ == "__main__":
    main()
