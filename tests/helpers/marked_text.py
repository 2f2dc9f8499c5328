"""Text between two marks in a page: tables that commands write into docs/how-well-it-works.md."""

import re


def renewed(page: str, begin: str, end: str, content: str) -> str:
    """A page with other content between its marks; unchanged where it has none."""
    block = f"{begin}\n{content}{end}"
    return re.sub(f"{re.escape(begin)}.*?{re.escape(end)}", lambda _: block, page, flags=re.S)
