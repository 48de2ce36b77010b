"""What the pages for users tell them to type."""

import re

from harness.daemon import REPOSITORY

DOCS = REPOSITORY / "docs"
PAGES = [*sorted(DOCS.glob("*.md")), REPOSITORY / "README.md"]


def commands(page):
    """The lines of the indented blocks of a page without what is said of them; those that go on behind a backslash joined.

    A block stands behind an empty line; what goes on with a list does not.
    """
    text = re.sub(r"^```.*?^```", "", page.read_text(), flags=re.M | re.S).replace("\\\n", " ")
    found, within, before = [], False, ""
    for line in text.splitlines():
        within = line.startswith("    ") and (within or not before.strip())
        if within and not line.startswith("     "):
            found.append(re.split(r"\s{2,}|\s# ", line.strip())[0])
        before = line
    return found


def python_blocks(page):
    return re.findall(r"^```python\n(.*?)^```", page.read_text(), flags=re.M | re.S)
