"""Sphinx: `sphinx-build docs docs/_build` makes the manual as HTML, after `pip install -r docs/requirements.txt .`

Pages in docs/generated/ are written here, from the code and from the results of `parsolid verify`.
"""

from pathlib import Path
from shutil import rmtree

import parsolid
from parsolid.campaign.verification import build_report
from parsolid.commands.keys import page as page_of_keys
from parsolid.scene.codes import page as page_of_codes

project, release = "parsolid", parsolid.__version__
copyright = "the authors of parsolid"  # noqa: A001
extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.mathjax"]
myst_enable_extensions = ["dollarmath", "colon_fence"]
myst_heading_anchors = 3
html_theme = "furo"
exclude_patterns = ["_build"]
autodoc_member_order = "bysource"
# links into the repository, which the pages have for readers of the files themselves
suppress_warnings = ["myst.xref_missing"]

DOCS = Path(__file__).parent
GENERATED = DOCS / "generated"
NOT_RUN = (
    "# {title}\n\nThis manual was built without results: `parsolid verify {study} -o results/{folder}` makes them.\n"
)


def write_report(folder: str, title: str, study: str) -> None:
    """The report on the runs of `parsolid verify` in results/ as pages of the manual."""
    results, target = DOCS.parent / "results" / folder, GENERATED / folder
    if any(results.glob("*/summary.json")):
        build_report(results, target)
    else:
        target.mkdir()
        (target / "report.md").write_text(NOT_RUN.format(title=title, study=study, folder=folder))


rmtree(GENERATED, ignore_errors=True)
GENERATED.mkdir()
(GENERATED / "keys.md").write_text(page_of_keys())
(GENERATED / "codes.md").write_text(page_of_codes())
write_report("verification", "Verification", "")
write_report("validation", "Validation", "validation")
