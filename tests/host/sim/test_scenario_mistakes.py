"""Malformed scenarios: every mistake is refused with the line and key."""

import pytest

from biotac.errors import ScenarioError
from biotac.sim.scenario import parse_scenario

REST = '[[step]]\ndo = "rest"\nseconds = 1.0\n'
PRESS = '[[step]]\ndo = "press"\nseconds = 0.5\nat = "E17"\nforce_n = 5.0\n'


def step(text: str) -> str:
    return f'name = "t"\n\n{PRESS}{text}'


def second(do: str, keys: str) -> str:
    """A step of a second after a press."""
    return step(f'[[step]]\ndo = "{do}"\nseconds = 1\n{keys}\n')


def first(do: str, keys: str) -> str:
    return f'name = "t"\n[[step]]\ndo = "{do}"\nseconds = 1\n{keys}\n'


def fault(at_s: float, seconds: float = 1, finger: int = 0, kind: str = "stuck_low", more: str = "") -> str:
    return (
        f'name = "t"\n{REST}[[fault]]\nat_s = {at_s}\nseconds = {seconds}\nfinger = {finger}\nkind = "{kind}"\n{more}'
    )


BAD: list[tuple[str, str, int, str, str]] = [
    # (case, text, line, label, part)
    ("unknown step key", first("press", 'at = "E1"\nforcen = 2'), 6, "step 1", "did you mean 'force_n'?"),
    ("key of another step", second("hold", "celsius = 30"), 11, "step 2", "'celsius' is unknown for hold"),
    ("unknown do", step('[[step]]\nseconds = 1\ndo = "pres"\n'), 10, "step 2", "did you mean 'press'?"),
    ("missing seconds", step('[[step]]\ndo = "hold"\n'), 8, "step 2", "'seconds' is missing"),
    ("missing force", first("press", 'at = "E1"'), 2, "step 1", "'force_n' is missing: expected a number 0 to 50 N"),
    ("nan", step('[[step]]\ndo = "hold"\nseconds = nan\n'), 10, "step 2", "'seconds' is nan"),
    (
        "too long for its fingers",
        'name = "t"\nfingers = 5\n[[step]]\ndo = "rest"\nseconds = 181\n',
        5,
        "step 1",
        "at most 180 s in total with 5 finger(s)",
    ),
    (
        "too long a change",
        'name = "t"\nfingers = 2\n[[step]]\ndo = "press"\nforce_n = 1\nat = "E17"\nseconds = 151\n',
        7,
        "step 1",
        "expected at most 160 s of changing load",
    ),
    ("too long", step('[[step]]\ndo = "hold"\nseconds = 7200\n'), 10, "step 2", "makes the scenario too long"),
    ("no such electrode", 'name = "t"\n' + PRESS.replace("E17", "E20"), 5, "step 1", "'at' is 'E20'"),
    (
        "off the finger",
        first("press", "at_mm = [4.0, 4.0]\nforce_n = 1"),
        5,
        "step 1",
        "a point on the ventral surface",
    ),
    ("two places", 'name = "t"\n' + PRESS + "at_mm = [0, 0]\n", 7, "step 1", "'at_mm' is given beside 'at'"),
    ("three coordinates", first("press", "at_mm = [0, 0, 0]\nforce_n = 1"), 5, "step 1", "'at_mm' is [0, 0, 0]"),
    ("place while touching", second("press", 'force_n = 2\nat = "E1"'), 12, "step 2", "'at' is given during a contact"),
    ("release of nothing", first("press", "force_n = 0"), 5, "step 1", "'force_n' is 0 but nothing touches"),
    ("shear of nothing", first("shear", "shear_n = [1, 0]"), 3, "step 1", "'do' is 'shear' but nothing touches"),
    ("shear nan", second("shear", "shear_n = [nan, 0]"), 11, "step 2", "'shear_n' is [nan"),
    ("twist too far", second("twist", "torsion_nmm = 101"), 11, "step 2", "'torsion_nmm' is 101"),
    ("too hot", second("temperature", "celsius = 61"), 11, "step 2", "'celsius' is 61"),
    ("slide nowhere", step('[[step]]\ndo = "slide"\nseconds = 1\n'), 8, "step 2", "'to' is missing"),
    ("finger out of range", second("hold", "fingers = [1]"), 11, "step 2", "'fingers' is [1]"),
    ("no fingers at all", second("hold", "fingers = []"), 11, "step 2", "'fingers' is []"),
    ("unknown top key", 'name = "t"\nspeed = 2\n' + REST, 2, "", "key 'speed' is unknown"),
    ("missing name", REST, 1, "", "key 'name' is missing"),
    ("no steps", 'name = "t"\n', 1, "", "key 'step' is missing"),
    ("single brackets", 'name = "t"\n[step]\ndo = "rest"\n', 2, "", "expected [[step]] tables; use double brackets"),
    ("gains", 'name = "t"\n\ngains = "fit"\n' + REST, 3, "", "key 'gains' is unknown"),  # an old version's
    ("huge", 'name = "t"\nseed = 0x' + "f" * 9000 + "\n" + REST, 2, "", "key 'seed' is a huge number"),
    ("many digits", 'name = "t"\nseed = 1' + "0" * 9000 + "\n" + REST, 1, "", "this TOML cannot be read"),
    ("fault at the end", fault(1), 6, "fault 1", "'at_s' is 1"),
    ("seed", 'name = "t"\nseed = -1\n' + REST, 2, "", "key 'seed' is -1"),
    ("tables and fingers", 'name = "t"\nfingers = 2\n[[finger]]\n' + REST, 2, "", "is 2, with 1 [[finger]] tables"),
    ("six tables", 'name = "t"\n' + "[[finger]]\n" * 6 + REST, 2, "", "key 'finger' has 6 tables"),
    ("profile", 'name = "t"\n[[finger]]\n[[finger]]\nprofile = "old"\n' + REST, 4, "finger 2", "'profile' is 'old'"),
    ("serial", 'name = "t"\n[[finger]]\nserial = "BT1"\n' + REST, 3, "finger 1", "'serial' is 'BT1'"),
    ("fault kind", fault(0, kind="odd"), 9, "fault 1", "'kind' is 'odd': expected one of electrode open"),
    ("fault finger", fault(0, finger=1), 8, "fault 1", "'finger' is 1"),
    ("fault too long", fault(0.5), 7, "fault 1", "'seconds' is 1: expected a number 0.001 to 0.5 s"),
    ("fault channel", fault(0, more='channel = "E20"\n'), 10, "fault 1", "'channel' is 'E20'"),
    ("no toml", 'name = "t"\n[[step]]\ndo = \n', 3, "", "not valid TOML"),
    ("key twice", 'name = "t"\nseed = 1\nseed = 2\n' + REST, 3, "", "not valid TOML"),
    ("empty", "# nothing\n", 1, "", "the file is empty"),
]


@pytest.mark.parametrize(("text", "line", "label", "part"), [case[1:] for case in BAD], ids=[case[0] for case in BAD])
def test_a_mistake_names_its_line_and_key(text: str, line: int, label: str, part: str) -> None:
    with pytest.raises(ScenarioError) as caught:
        parse_scenario(text.encode(), file="try.toml")
    message = str(caught.value)
    assert message.startswith(f"try.toml:{line}: " + (f"{label}: " if label else "")), message
    assert part in message and "\n" not in message and "expected" in message


def test_text_that_is_not_utf8_names_its_line() -> None:
    with pytest.raises(ScenarioError, match=r"try\.toml:2: not UTF-8"):
        parse_scenario(b'name = "t"\n# \xff\n', file="try.toml")
