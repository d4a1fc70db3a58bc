"""Write the table of registered criteria into the docs.

python -m pipeline.feasibility.docs_table docs/feasibility.md
"""

import argparse
import re
import sys
from pathlib import Path

from pipeline.errors import FileError
from pipeline.feasibility import settings  # noqa: F401  registers the criteria
from pipeline.feasibility.criterion import FRAMES, REGISTERED, groups

_PLACE = re.compile(r"(<!-- criteria: .*? -->\n).*?(<!-- end of criteria -->)", re.DOTALL)


def docs_table() -> str:
    """Markdown table with one row per criterion, by group; what a criterion cuts is named unless it is frames."""
    rows = ["| group | criterion | what it is | threshold | cut |", "|---|---|---|---|---|"]
    for group, codes in groups().items():
        for index, code in enumerate(codes):
            each = REGISTERED[code]
            name = "" if index else group
            unit = "" if each.unit == "-" or each.unit.startswith("of ") else f" [{each.unit}]"
            cuts = "" if each.cuts == FRAMES else each.cuts
            rows.append(f"| {name} | `{code}` | {each.what}{unit} | `{each.limit}` | {cuts} |")
    return "\n".join(rows) + "\n"


def rewrite(page: Path) -> None:
    """Replace the table between the two marker comments of a page. Raises FileError if they are missing."""
    text = page.read_text(encoding="utf-8")
    if not _PLACE.search(text):
        raise FileError(page, "the comments '<!-- criteria: … -->' and '<!-- end of criteria -->' are missing.")
    page.write_text(_PLACE.sub(lambda found: found[1] + docs_table() + found[2], text), encoding="utf-8")


def main(arguments: list[str]) -> int:
    """Rewrite a page; return the exit code, 1 on failure."""
    parser = argparse.ArgumentParser(prog="python -m pipeline.feasibility.docs_table", description=__doc__)
    parser.add_argument("page", type=Path, help="page with the table (docs/feasibility.md)")
    try:
        rewrite(parser.parse_args(arguments).page)
    except (FileError, OSError) as error:
        print(error, file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
