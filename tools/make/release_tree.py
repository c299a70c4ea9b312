"""The source of a release: the files of this commit, with texts that a package index needs and a clone does not.

pyproject.toml alone has authors and addresses. biotac-lab, biotac-rig and the ROS 2 package get them here, links of
the READMEs lead to the repository, and the example that biotac-lab tries lies in that package.

    release_tree.py FOLDER       makes it
    release_tree.py --missing    lists the facts that a person must still fill in
"""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path
from posixpath import join, normpath
from typing import Any

from biotac.documents import tomllib

ROOT = Path(__file__).resolve().parents[2]
ADDRESSES = ("Repository", "Issues", "Changelog", "Documentation")  # of an index page, in this order
LINK = re.compile(r"(!?)(\[[^\]]*\]\()(?!https?:|mailto:|#)([^)]+)")


def missing(project: dict[str, Any]) -> list[str]:
    """Facts for an index that pyproject.toml's table ``project`` lacks."""
    named = any("email" in author for author in project.get("authors", []))
    urls = [f'urls: {name} = "https://..."' for name in ADDRESSES if name not in project.get("urls", {})]
    return urls if named else ['authors with an address: authors = [{ name = "...", email = "..." }]', *urls]


def complete(tree: Path, project: dict[str, Any]) -> None:
    """Add the facts of pyproject.toml's table ``project`` to the files in ``tree``."""
    lab, urls = tree / "host/biotac-lab", project.get("urls", {})
    people = ["{ " + ", ".join(f'{key} = "{value}"' for key, value in own.items()) + " }" for own in project["authors"]]
    links = "".join(f'{name} = "{address}"\n' for name, address in urls.items())
    rig = tree / "host/biotac-rig"
    for folder in (lab, rig):
        own = (folder / "pyproject.toml").read_text()
        own = own.replace("\ndependencies", f"\nauthors = [{', '.join(people)}]\ndependencies", 1)
        (folder / "pyproject.toml").write_text(f"{own}\n[project.urls]\n{links}")
    package, author = tree / "host/ros2/biotac_ros2/package.xml", project["authors"][0]
    person = f'<maintainer email="{author.get("email", "nobody@example.invalid")}">{author["name"]}<'
    package.write_text(re.sub("<maintainer .*?>.*?<", person, package.read_text()))
    for folder in ("", "host/biotac-lab", "host/biotac-rig") if "Repository" in urls else ():

        def link(found: re.Match[str], folder: str = folder) -> str:
            kind = "raw" if found[1] else "blob"
            at = normpath(join(folder, found[3]))
            return f"{found[1]}{found[2]}{urls['Repository'].rstrip('/')}/{kind}/v{project['version']}/{at}"

        page = tree / folder / "README.md"
        page.write_text(LINK.sub(link, page.read_text()))


def main(argument: str) -> int:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    if argument == "--missing":
        sys.stderr.writelines(f"pyproject.toml, [project]: no {field}\n" for field in missing(project))
        return int(bool(missing(project)))
    Path(argument).mkdir(parents=True)
    files = subprocess.run(["git", "archive", "HEAD"], cwd=ROOT, check=True, capture_output=True).stdout
    subprocess.run(["tar", "-x", "-C", argument], input=files, check=True)
    complete(Path(argument), project)
    return 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
