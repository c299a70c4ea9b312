"""The report: a row for each table and figure of Wettels and Loeb 2011, and the tables behind them."""

from __future__ import annotations

from ...report import Facts, Table

PAPER_PLACES = (19, 19, 13, 7)  # contacts of five presses: 95, 95, 65 and 35 stimulations
PAPER_TABLE3 = {
    "11-point LOWESS": ((3.19, 0.244, 0.782), (3.50, 0.218, 0.802)),
    "force threshold": ((2.37, 0.183, 0.839), (2.90, 0.198, 0.813)),
    "both": ((2.36, 0.182, 0.839), (2.89, 0.197, 0.813)),
}
PAPER_TABLE4 = {"Fz": (0.729, 31.4), "Fy": (0.931, 13.9), "Fx": (0.870, 37.9)}  # R2, percent error; class "rear, large"

LOAD, EQUATION = "30 to 40 N, as the paper", "rest offset removed"


def overview(facts: Facts) -> Table:
    """For each result: the paper's, ours emulated, ours on recordings, and why they differ."""
    by_row, by_contact, press, contact, press_machine, contact_machine = facts["roc"]
    one, four, cascade = facts["force"]
    plain, pca, ica, spearman = (row["pooled_n"] for row in facts["reductions"])
    rear = next((row for row in facts["classes"] if row["class"] == "rear, large"), None)
    kept = [sum((row[axis] or 0.0) > 0.1 for row in facts["correlations"]) for axis in range(3)]
    ratio = {row["mm"]: row["ratio"] for row in facts["impedance"]}
    real = "; ".join(_real(one) for one in facts["real"]) or "none given (--real)"
    none = "in no recording"
    rows = [
        ["Table 1", "range 0.01 to 50 N, PAC 0 to 2 kPa, 0 to 1 C/s", "random presses of 0.3 to 40 N", none,
         "the manufacturer's data, not a result; electrodes under 30 N read 10 MOhm, the converter's last counts"],
        ["Table 2", "why each feature is wanted", "-", "-", "text only"],
        ["Fig 1, 2", "vice, force plate, four hand-held probes", "four probes with Hertzian footprints", none,
         "no plate drift, no slips; places scatter by 0.3 mm and tilts by 4 degrees, like a hand's"],
        ["Fig 3", "(d, r) on the fingerprints", "d from x = -16 mm, r around the axis", "-",
         "the paper gives no numbers; the origin is that of the skin laid flat"],
        ["Fig 4", "impedance falls off around an electrode",
         f"E18's resistance at 10 N over that at rest: {text(ratio[0.0], 1)}, {text(ratio[2.0], 1)} at 2 mm, "
         f"{text(ratio[4.0], 1)} at 4 mm",
         none, "the paper pressed 4.5 mm deep with a 2 mm tip and plots a surface without numbers"],
        ["Fig 5", "shear squeezes one side and bulges the other", "true by construction", "F1, F2: both signs",
         "a schematic"],
        ["Fig 6", "keeps Spearman > 0.1, no numbers", f"{kept[0]}/{kept[1]}/{kept[2]} electrodes for Fx/Fy/Fz", "-",
         "the paper plots bars"],
        ["Fig 7", "94.7 % of rows correct",
         f"random rows {_percent(by_row)} ({sum(by_row['places'])} contacts), rows of new contacts "
         f"{_percent(by_contact)}, presses {_percent(press)}, contacts of five presses {_percent(contact)}; "
         f"with support vectors {_percent(press_machine)} and {_percent(contact_machine)}", none,
         "a random split puts a row's neighbours into training: the paper's figure has that leak; at a new place one "
         "frame cannot tell width from distance to the next electrode, but a growing press can"],
        ["Fig 8", "noisy, jumps at low force",
         f"d/r {_dr(facts, 'as printed', 'none')} as printed, "
         f"{_dr(facts, EQUATION, 'none')} mm without the rest offset", none,
         "as printed, Eq 4 gives 3.08 N without a touch, which pulls the mean to the middle; nothing divides by zero"],
        ["Fig 9, Table 3", f"both: d/r {PAPER_TABLE3['both'][0][0]} / {PAPER_TABLE3['both'][1][0]} mm",
         f"both: {_dr(facts, EQUATION, 'both')} mm; as printed {_dr(facts, 'as printed', 'both')} mm", none,
         "ours has no error from marking places by hand; the threshold uses the true force"],
        ["Fig 10", "PCA some, Spearman Fy and Fz, ICA poor (bars, no numbers)",
         f"pooled RMSE {text(plain, 2)} N; PCA {text(pca, 2)}, FastICA {text(ica, 2)}, Spearman {text(spearman, 2)}",
         "-",
         "PCA and ICA span the same space here, so a net can undo either, and electrodes without rank correlation "
         "still help to read the others; fewer contacts than for figure 11"],
        ["Fig 11", "segregation improves RMSE and R2 (bars)",
         f"one net {text(one['pooled_n'], 2)}, by class {text(four['pooled_n'], 2)}, by PAF's own d "
         f"{text(cascade['pooled_n'], 2)} N", real,
         "held out by contact, not by row; a wrong class at d = 14 mm costs some or all of what the classes gain"],
        ["Table 4, Fig 12", "; ".join(f"{axis} R2 {r2}, {error} %" for axis, (r2, error) in PAPER_TABLE4.items()),
         _class(rear), real, "our places are new to the net, the paper's were not; F1 and F2 are from one flat plate"],
        ["Fig 13", "classifier and look-up feed the nets", f"PAF feeds them: {text(cascade['pooled_n'], 2)} N pooled",
         "-", "the probe is assumed to be known, as in the paper"],
        ["Eq 7", "particle filter, proposed", "-", "-", "the paper gives no figure; built as biotac.features.grip"],
    ]  # fmt: skip
    head = ["paper", "its result", "emulated finger", "recordings", "why they differ"]
    return Table("Every table and figure", head, rows)


def details(facts: Facts) -> list[Table]:
    """The tables behind the overview."""
    paf = [
        [row["load"], row["equation"], row["technique"], _three(row["d"]), _three(row["r"]), row["share"]]
        for row in facts["paf"]
    ]
    paf += [
        ["paper", "as printed", name, *[" / ".join(map(str, one)) for one in both], None]
        for name, both in PAPER_TABLE3.items()
    ]
    roc = [[one["what"], one["split"], " ".join(map(str, one["places"])), _percent(one)] for one in facts["roc"]]
    names = ["1 mm", "3.6 mm", "10 mm", "flat"]
    confusion = [
        [f"{one['what']}, {one['split']}", name, *row]
        for one in facts["roc"]
        for name, row in zip(names, one["confusion"], strict=True)
    ]
    named = [(row.get("how") or row["class"], row) for row in [*facts["force"], *facts["classes"]]]
    named += [(f"figure 10: {row['how']}", row) for row in facts["reductions"]]
    for one in facts["real"]:
        named += [(f"{one['file']}: {name}", one[name]) for name in ("net", "calibrated map", "population map")]
    force = [[name, row["pooled_n"], *[_four(row["axes"][axis]) for axis in row["axes"]]] for name, row in named]
    about = f"Contacts per probe: {facts['force_places']}; paper: {PAPER_PLACES}. Five folds."
    if facts["real"]:
        about += " The population map was trained on these recordings, so it is not held out."
    pairs = [
        [f"{row['apart_mm']:g}" if row["apart_mm"] else "one contact", row["right"], row["poc_rmse_mm"],
         row["share_rmse"]]
        for row in facts["pairs"]
    ]  # fmt: skip
    bars = facts["bars"]
    return [
        Table("Table 3, PAF", ["loads", "Eq 4", "technique", "d", "r", "share"], paf,
              "RMSE mm, SMSE, R2; share of rows with a value.", digits=2),
        Table("Figure 7, radius of curvature", ["decided by", "split", "contacts per probe", "correct"], roc),
        Table("Confusions", ["decided by", "answer", *[f"true {name}" for name in names]], confusion),
        Table("Force", ["", "pooled RMSE [N]", *[f"{a}: RMSE N, SMSE, R2, %" for a in ("Fx", "Fy", "Fz")]], force,
              about),
        Table("Two contacts, 3.6 mm tips, 3 to 8 N each",
              ["apart [mm]", "number right", "PoC RMSE [mm]", "share RMSE"], pairs, digits=2),
        Table("Direction of a bar in the middle of the pad", ["new presses", "RMSE [deg]", "median [deg]"],
              [[bars["test"], bars["rmse_deg"], bars["median_deg"]]], digits=2),
    ]  # fmt: skip


def text(value: float | None, digits: int = 3) -> str:
    """A number in a sentence."""
    return "-" if value is None else f"{value:.{digits}f}"


def paf_row(facts: Facts, equation: str, technique: str) -> Facts:
    """The row of the paper's loads."""
    wanted = (LOAD, equation, technique)
    found: Facts = next(row for row in facts["paf"] if (row["load"], row["equation"], row["technique"]) == wanted)
    return found


def _dr(facts: Facts, equation: str, technique: str) -> str:
    row = paf_row(facts, equation, technique)
    return f"{text(row['d']['rmse'], 2)} / {text(row['r']['rmse'], 2)}"


def _three(one: Facts) -> str:
    return f"{text(one['rmse'], 2)} / {text(one['smse'])} / {text(one['r2'])}"


def _four(one: Facts) -> str:
    return f"{text(one['rmse'])} / {text(one['smse'])} / {text(one['r2'])} / {text(one['percent'], 1)}"


def _percent(one: Facts) -> str:
    return f"{100 * one['correct']:.1f} %"


def _class(row: Facts | None) -> str:
    if row is None:
        return "-"
    axes = row["axes"]
    return "; ".join(f"{a} R2 {text(axes[a]['r2'])}, {text(axes[a]['percent'], 1)} %" for a in ("Fz", "Fy", "Fx"))


def _real(one: Facts) -> str:
    pooled = [f"{name} {text(one[name]['pooled_n'])}" for name in ("net", "calibrated map", "population map")]
    return f"{one['file']}: {', '.join(pooled)} N"
