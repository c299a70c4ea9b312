"""The help of `biotac-lab --help`, with any characters in the texts."""

import pytest

from biotac_lab.calibrate import interval
from biotac_lab.cli import main


@pytest.mark.parametrize("verb", [[], ["interval"]])
def test_help_shows_what_each_verb_does(verb, capsys) -> None:
    with pytest.raises(SystemExit) as ended:
        main([*verb, "--help"])
    assert ended.value.code == 0
    assert interval.ABOUT in " ".join(capsys.readouterr().out.split())
