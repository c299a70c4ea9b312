"""The tables of the report; seeds.json has a row for each table and figure of Wettels and Loeb 2011."""

from __future__ import annotations

from ...report import Facts, Table

PAPER_PLACES = (19, 19, 13, 7)  # contacts of five presses: 95, 95, 65 and 35 stimulations
PAPER_TABLE3 = {
    "11-point LOWESS": ((3.19, 0.244, 0.782), (3.50, 0.218, 0.802)),
    "force threshold": ((2.37, 0.183, 0.839), (2.90, 0.198, 0.813)),
    "both": ((2.36, 0.182, 0.839), (2.89, 0.197, 0.813)),
}
LOAD, EQUATION = "30 to 40 N, as the paper", "rest offset removed"


def details(facts: Facts) -> list[Table]:
    """The tables behind the overview."""
    paf = [
        [row["load"], row["equation"], row["technique"], _three(row["d"]), _three(row["r"]), row["share"]]
        for row in facts["paf"]
    ]
    paf += [
        ["paper", "as printed", name, *[" / ".join(map(str, score)) for score in both], None]
        for name, both in PAPER_TABLE3.items()
    ]
    roc = [[row["what"], row["split"], " ".join(map(str, row["places"])), f"{100 * row['validated']:.1f} %",
            _percent(row)]
           for row in facts["roc"]]  # fmt: skip
    names = ["1 mm", "3.6 mm", "10 mm", "flat"]
    confusion = [
        [f"{fact['what']}, {fact['split']}", name, *row]
        for fact in facts["roc"]
        for name, row in zip(names, fact["confusion"], strict=True)
    ]
    named = [(row.get("how") or row["class"], row) for row in [*facts["force"], *facts["classes"]]]
    named += [("rear, large, rows at random, Levenberg-Marquardt", facts["table4"])]
    named += [(f"figure 10: {row['how']}", row) for row in facts["reductions"]]
    for file in facts["real"]:
        named += [(f"{file['file']}: {name}", file[name]) for name in ("net", "calibrated map", "population map")]
    force = [[name, row["pooled_n"], *[_five(row["axes"][axis]) for axis in row["axes"]]] for name, row in named]
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
        Table("Figure 7, radius of curvature",
              ["decided by", "split", "contacts per probe", "correct on rows aside", "correct"], roc),
        Table("Confusions", ["decided by", "answer", *[f"true {name}" for name in names]], confusion),
        Table("Force", ["", "pooled RMSE [N]", *[f"{a}: RMSE N, SMSE, R2, %, Eq 6" for a in ("Fx", "Fy", "Fz")]], force,
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


def _three(row: Facts) -> str:
    return f"{text(row['rmse'], 2)} / {text(row['smse'])} / {text(row['r2'])}"


def _five(row: Facts) -> str:
    digits = {"rmse": 3, "smse": 3, "r2": 3, "percent": 1, "printed": 0}
    return " / ".join(text(row[name], k) for name, k in digits.items())


def _percent(row: Facts) -> str:
    return f"{100 * row['correct']:.1f} %"
