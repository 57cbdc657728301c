"""python benchmarks/files_to_read.py: the files of a step of each method, as docs/architecture.md lists them.

Prints a row a list of the table: files and lines in the method, `pairs` and `materials`, and of `methods/leapfrog.py`,
which three methods share. Status 1 where a file is missing, or where files are more than 6 or lines 1,500 or more.
"""

import re
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
PACKAGE = ROOT / "parsolid"
MOST_FILES, MOST_LINES = 6, 1500
SHARED = "methods/leapfrog.py"


def lists() -> dict[str, list[str]]:
    """Name of a row -> paths below the package, from the table between two marks of the page."""
    page = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
    table = page.split("<!-- files to read -->")[1].split("<!-- end of files to read -->")[0]
    result: dict[str, list[str]] = {}
    for row in table.splitlines():
        cells = [cell.strip() for cell in row.strip("|").split("|")]
        if len(cells) == 2 and "`" in cells[1]:
            result[cells[0].replace("`", "")] = re.findall(r"`([^`]+\.py)`", cells[1])
    return result


def lines_of(path: str) -> int:
    """Lines of a file of the package; 0 where there is none."""
    file = PACKAGE / path
    return len(file.read_text(encoding="utf-8").splitlines()) if file.exists() else 0


def main() -> int:
    """Print the rows; exit status."""
    faults = 0
    print(f"{'':44s}{'files':>6s}{'lines':>7s}{'with leapfrog':>15s}")
    for name, paths in lists().items():
        missing = [path for path in paths if not lines_of(path)]
        own = [path for path in paths if path != SHARED]
        count, lines = len(own), sum(map(lines_of, own))
        shared = sum(map(lines_of, paths))
        fault = missing or count > MOST_FILES or lines >= MOST_LINES
        faults += bool(fault)
        told = ", ".join(f"no {path}" for path in missing) or ("too many" if fault else "")
        print(f"{name:44s}{count:6d}{lines:7d}{shared:15d}  {told}")
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
