"""Tables as Markdown, LaTeX and HTML."""

from collections.abc import Callable, Mapping

import pandas as pd

from cocap_opt.experiments.results.tables import Table


def markdown(tables: Mapping[str, Table]) -> str:
    """Returns tables in Markdown with their titles as headings; bars in names are escaped."""
    parts = [
        f"## {title}\n\n{_frame(_escaped(table)).to_markdown(index=False, disable_numparse=True)}\n"
        for title, table in tables.items()
    ]
    return "\n".join(parts)


def _latex(tables: Mapping[str, Table]) -> str:
    """Returns tables in LaTeX (package booktabs) with their titles as captions."""
    return "% \\usepackage{booktabs}\n" + "\n".join(
        _frame(table).to_latex(
            index=False,
            escape=True,
            caption=title,
            position="ht",
            column_format="ll" + "r" * (len(table[0]) - 2),
        )
        for title, table in tables.items()
    )


def html(tables: Mapping[str, Table], level: int = 2) -> str:
    """Returns tables for an HTML page with their titles as headings of some level."""
    heading = f"h{level}"
    return "\n".join(
        f"<{heading}>{title}</{heading}>\n"
        f"{_frame(table).to_html(index=False, escape=True, border=0)}\n"
        for title, table in tables.items()
    )


DOCUMENTS: Mapping[str, Callable[[Mapping[str, Table]], str]] = {
    "markdown": markdown,
    "latex": _latex,
    "html": html,
}


def _frame(table: Table) -> pd.DataFrame:
    return pd.DataFrame(table)


def _escaped(table: Table) -> Table:
    return [{key: text.replace("|", "&#124;") for key, text in row.items()} for row in table]
