# %% [markdown]
# # The erosion law of a piping study
#
# Erosion rate against the shear stress on the faces of the hole, with the fitted law $\dot m = k_d\,(\tau - \tau_c)$ above the threshold
# $\tau_c$ (Sibille, Lominé and Marot 2012).
#
# The folder is either one that `solver erosion-law` wrote (`erosion_points.csv`, `erosion_readings.csv`), or that of one run
# (`erosion.csv`). The law and its intervals are those of the program. A single run has no law of its own: its windows are drawn, and a
# line is fitted to them by weighted least squares.
#
# As a script: `python erosion_law.py FOLDER --stress balance --cohesion 0.506 --output law.svg`

# %%
import argparse
import sys
from pathlib import Path

import matplotlib
import numpy as np
import pandas as pd

HERE = Path(__file__).resolve().parent if "__file__" in globals() else Path.cwd()
sys.path.insert(0, str(HERE))
from solver_results import open_run, read_table, units  # noqa: E402

# %% [markdown]
# ## What is drawn
#
# `STRESS` is one of `gradient` (from the velocity at the faces, equation 10 of the paper), `balance` (from the balance of forces, as in the
# hole erosion test of the laboratory) and `traction` (from the forces on the grains of the faces).

# %%
FOLDER = HERE.parent / "piping_erosion" / "results" / "small"
STRESS = "balance"
COHESION = 0.506  # N/m
OUTPUT = None  # a file such as law.svg, or None to show the figure

if "ipykernel" not in sys.modules:
    parser = argparse.ArgumentParser(description="Draws the erosion law of a piping study or of one run.")
    parser.add_argument("folder", nargs="?", type=Path, default=FOLDER, help="output of `solver erosion-law`, or folder of a run")
    parser.add_argument("--stress", choices=["gradient", "balance", "traction"], default=STRESS)
    parser.add_argument("--cohesion", type=float, default=COHESION, help="C/d [N/m]")
    parser.add_argument("--output", type=Path, help="file of the figure (.svg, .pdf, .png); without it a window opens")
    given = parser.parse_args()
    FOLDER, STRESS, COHESION, OUTPUT = given.folder, given.stress, given.cohesion, given.output
    if OUTPUT:
        matplotlib.use("Agg")

import matplotlib.pyplot as plt  # noqa: E402

# %% [markdown]
# ## Points and law
#
# A study has one point for each run. One run is cut into windows as in the program: from the first grain that leaves until 60 % of the mass
# has left, in up to four equal parts with at least twenty grains each. The rate is the mass that left, divided by time and by the area of
# both faces, $2 L$ per metre of depth. Grains that leave one by one give it the standard error $\sqrt{\dot m\, m_1 / (2 L T)}$ with the mean
# mass $m_1$ of a grain.


# %%
def study(folder, stress, cohesion):
    """Points of the runs of one cohesion, and the law of the program as a dict, or None."""
    table = read_table(folder / "erosion_points.csv")
    near = np.isclose(table["cohesion"], cohesion, rtol=1e-6)
    if not near.any():
        raise SystemExit(f"no run has {cohesion} N/m; there are {', '.join(f'{c:g}' for c in table['cohesion'].unique())}")
    readings = read_table(folder / "erosion_readings.csv")
    readings = readings[np.isclose(readings["cohesion"], cohesion, rtol=1e-6) & (readings["stress"] == stress)]
    # With fewer than three runs the program fits the law to windows.
    kind = "run" if (near & (table["points"] == "run")).sum() >= 3 else "window"
    chosen = table[near & (table["points"] == kind)].copy()
    chosen["shear"] = chosen[f"shear_{stress}"]
    chosen["eroding"] = chosen["eroding"].astype(bool)
    law = readings[readings["points"] == f"{kind}s"].to_dict("records")
    given = units(table)
    return chosen, law[0] if law else None, (given[f"shear_{stress}"], given["rate"])


def windows(erosion, stress, most=4, grains=20, last_fraction=0.6):
    """The windows of one run: a data frame with shear [Pa], rate and rate_error [kg/(m^2 s)]."""
    table = erosion[np.isfinite(erosion[f"shear_{stress}"])].reset_index(drop=True)
    begun = np.flatnonzero(table["eroded_grains"] > 0)
    if not len(begun):
        return pd.DataFrame(columns=["shear", "rate", "rate_error", "pressure_difference", "eroding"])
    over = np.flatnonzero(table["eroded_fraction"] >= last_fraction)
    span = table.iloc[begun[0] : (over[0] if len(over) else len(table) - 1) + 1]
    left = span["eroded_grains"].iloc[-1] - span["eroded_grains"].iloc[0]
    count = int(np.clip(left // grains, 1, most))
    edges = np.linspace(span["time"].iloc[0], span["time"].iloc[-1], count + 1)
    rows = []
    for start, end in zip(edges[:-1], edges[1:]):
        part = span[(span["time"] >= start - 1e-12) & (span["time"] <= end + 1e-12)]
        if len(part) < 2:
            continue
        mass, number = (part[name].iloc[-1] - part[name].iloc[0] for name in ("eroded_mass", "eroded_grains"))
        area = 2.0 * part["hole_length"].mean() * (part["time"].iloc[-1] - part["time"].iloc[0])
        rows.append(
            {
                "shear": part[f"shear_{stress}"].mean(),
                "rate": mass / area,
                "rate_error": np.sqrt(mass / area * (mass / number if number else 0.0) / area),
                "pressure_difference": part["pressure_difference"].mean(),
                "eroding": number >= 3,
            }
        )
    return pd.DataFrame(rows)


def line(points):
    """The weighted line through the eroding points with its 95 % intervals, as a dict with the names of `erosion_readings.csv`."""
    points = points[points["eroding"] & (points["rate_error"] > 0)]
    if len(points) < 3:
        return None
    (slope, offset), covariance = np.polyfit(points["shear"], points["rate"], 1, w=1.0 / points["rate_error"], cov="unscaled")
    critical = -offset / slope
    # By the propagation of errors.
    gradient = np.array([offset / slope**2, -1.0 / slope])
    error = 1.96 * np.sqrt([gradient @ covariance @ gradient, covariance[0, 0]])
    return {
        "law": "fitted",
        "critical_shear": critical,
        "critical_shear_low": max(critical - error[0], 0.0),
        "critical_shear_high": critical + error[0],
        "coefficient": slope,
        "coefficient_low": max(slope - error[1], 0.0),
        "coefficient_high": slope + error[1],
        "r_squared": 1.0 - np.var(points["rate"] - slope * points["shear"] - offset) / np.var(points["rate"]),
    }


if (FOLDER / "erosion_points.csv").is_file():
    POINTS, LAW, UNITS = study(FOLDER, STRESS, COHESION)
    TITLE = f"C/d = {COHESION:g} N/m"
else:
    with open_run(FOLDER) as run:
        erosion = run.tables["erosion"]
        POINTS, UNITS = windows(erosion, STRESS), (units(erosion)[f"shear_{STRESS}"], "kg/(m^2 s)")
        TITLE = str(run.case.get("title", FOLDER.name))
    LAW = line(POINTS) if len(POINTS) else None

# %% [markdown]
# ## Figure
#
# Bars are 95 % intervals of the rates. The band lies between the laws at the ends of both 95 % intervals: the lowest coefficient with the
# highest threshold, and the highest coefficient with the lowest threshold.


# %%
def number(value):
    """A number with two digits, as in a text."""
    mantissa, exponent = f"{value:.1e}".split("e")
    power = int(exponent)
    return f"{float(f'{value:.1e}'):g}" if value == 0 or -2 <= power <= 3 else rf"{mantissa} \times 10^{{{power}}}"


def label(law):
    """The law with its intervals and units."""
    threshold, slope = law["critical_shear"], law["coefficient"]
    ends = [number(law[f"{name}_{end}"]) for name in ("critical_shear", "coefficient") for end in ("low", "high")]
    return (
        rf"$\tau_c = {number(threshold)}$ Pa (${ends[0]}$ to ${ends[1]}$)"
        + "\n"
        + rf"$k_d = {number(slope)}$ s/m (${ends[2]}$ to ${ends[3]}$)"
    )


def draw(points, law, given, title):
    """The figure."""
    figure, axes = plt.subplots(figsize=(5.2, 3.9), layout="constrained")
    stress = np.linspace(0.0, 1.06 * points["shear"].max() if len(points) else 1.0, 300)
    if law is not None and law["law"] == "fitted":

        def rate(slope, threshold):
            return slope * np.maximum(stress - threshold, 0.0)

        low = rate(law["coefficient_low"], law["critical_shear_high"])
        high = rate(law["coefficient_high"], law["critical_shear_low"])
        axes.fill_between(stress, low, high, color="0.88", lw=0, label="95 % intervals of both", zorder=1)
        axes.plot(stress, rate(law["coefficient"], law["critical_shear"]), color="0.2", lw=1.3, label=label(law), zorder=2)
    elif law is not None and law["law"] in ("lower_bound", "bracketed"):
        axes.axvline(
            law["critical_shear_low"], color="0.2", lw=1.3, ls="--", label=f"threshold at least {law['critical_shear_low']:.2g} Pa"
        )
    if len(points):
        axes.errorbar(points["shear"], points["rate"], 1.96 * points["rate_error"], fmt="none", ecolor="0.35", elinewidth=0.9, zorder=3)
        still = points[~points["eroding"]]
        moving = points[points["eroding"]]
        if len(still):
            axes.scatter(still["shear"], still["rate"], s=34, facecolors="white", edgecolors="0.2", zorder=5, label="no erosion")
        if len(moving):
            marks = axes.scatter(
                moving["shear"], moving["rate"], s=36, c=moving["pressure_difference"], cmap="viridis", edgecolors="0.2", lw=0.6, zorder=4
            )
            figure.colorbar(marks, label=r"pressure difference $\Delta P$ [Pa]")
        top = 1.25 * (points["rate"] + 1.96 * points["rate_error"]).max() or 1.0
        axes.set_ylim(-0.02 * top, top)
    axes.set_xlim(0.0, stress[-1])
    axes.set_xlabel(rf"shear stress $\tau$ ({STRESS}) [{given[0]}]")
    axes.set_ylabel(rf"erosion rate $\dot m$ [{given[1].replace('^2', '²')}]")
    axes.set_title(title, fontsize="medium")
    axes.ticklabel_format(axis="x", style="sci", scilimits=(-2, 3), useMathText=True)
    if axes.get_legend_handles_labels()[0]:
        # Below the axes, where it covers neither data nor the colour bar.
        figure.legend(*axes.get_legend_handles_labels(), fontsize="small", frameon=False, loc="outside lower center", ncols=2)
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
    return figure


FIGURE = draw(POINTS, LAW, UNITS, TITLE)
if OUTPUT:
    FIGURE.savefig(OUTPUT, dpi=200)
    print(f"{len(POINTS)} points, {LAW['law'] if LAW else 'no law'}: {OUTPUT}")
else:
    plt.show()
