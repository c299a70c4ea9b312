"""The sources of a release (tools/make/release_tree.py), and the contents of its steps and workflows."""

import re
import subprocess
from pathlib import Path

import release_tree
from biotac.documents import tomllib

ROOT = Path(__file__).resolve().parents[2]
LAB, RIG, ROS = "host/biotac-lab", "host/biotac-rig", "host/ros2/biotac_ros2/package.xml"
OWNED = {
    "version": "0.1.0",
    "authors": [{"name": "A. Person", "email": "a@person.example"}],
    "urls": {name: f"https://code.example/{name}" for name in release_tree.ADDRESSES},
}


def test_what_a_person_has_to_fill_in_is_named_until_it_is_there() -> None:
    gaps = release_tree.missing({"authors": [{"name": "some"}], "urls": {"Issues": "https://code.example"}})
    assert [gap.partition(" = ")[0] for gap in gaps] == [
        "authors with an address: authors", "urls: Repository", "urls: Changelog", "urls: Documentation"
    ]  # fmt: skip
    assert release_tree.missing(OWNED) == []


def test_authors_and_addresses_reach_every_package_and_link(tmp_path: Path) -> None:
    files = [f"{folder}/{name}" for folder in (LAB, RIG) for name in ("README.md", "pyproject.toml")]
    for name in ("README.md", *files, ROS):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_bytes((ROOT / name).read_bytes())
    release_tree.complete(tmp_path, OWNED)
    lab = tomllib.loads((tmp_path / LAB / "pyproject.toml").read_text())
    rig = tomllib.loads((tmp_path / RIG / "pyproject.toml").read_text())
    for own in (lab["project"], rig["project"]):
        assert own["authors"] == OWNED["authors"] and own["urls"] == OWNED["urls"]
    assert '<maintainer email="a@person.example">A. Person</maintainer>' in (tmp_path / ROS).read_text()
    for page in ("README.md", f"{LAB}/README.md", f"{RIG}/README.md"):
        targets = re.findall(r"\]\((?!http)[^#)]", (tmp_path / page).read_text())
        assert targets == [], page
        for kind, path in re.findall(
            r"\]\(https://code.example/Repository/(\w+)/v0.1.0/([^)#]+)", (tmp_path / page).read_text()
        ):
            assert (ROOT / path).is_file() and (kind == "raw") == path.endswith(".png"), path


def test_every_action_is_pinned_by_a_hash_with_its_tag_beside_it() -> None:
    uses = [
        line.strip()
        for path in sorted((ROOT / ".github/workflows").glob("*.yml"))
        for line in path.read_text().splitlines()
        if "uses:" in line
    ]
    assert len(uses) > 10
    assert [one for one in uses if not re.search(r"@[0-9a-f]{40} # v\d+\.\d+\.\d+$", one)] == []


def test_a_workflow_runs_only_steps_that_there_are_and_publishes_to_the_index_first() -> None:
    release = (ROOT / ".github/workflows/release.yml").read_text()
    steps = re.search(r"^steps=\((.*)\)", (ROOT / "tools/release").read_text(), re.M)
    assert steps is not None
    for called in re.findall(r"tools/release ([\w ]+)$", release, re.M):
        assert set(called.split()) <= set(steps[1].split())
    assert release.index("gh-action-pypi-publish") < release.index("gh release create")
    assert "owner" in steps[1] and "owner" in release


def test_the_version_is_one_and_a_tag_of_another_is_refused() -> None:
    environment = {"PATH": "/usr/bin:/bin", "GITHUB_REF_TYPE": "tag", "GITHUB_REF_NAME": "v9.9.9"}
    run = subprocess.run([ROOT / "tools/release", "version"], env=environment, capture_output=True, text=True)
    assert run.returncode == 1 and run.stderr == "release: the tag is v9.9.9, and pyproject.toml says 0.1.0\n"
