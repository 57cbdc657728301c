"""Tables on the terminal."""

from typing import Any


def show_table(title: str, names: list[str], rows: list[list[Any]]) -> None:
    """Print a table with right-aligned columns."""
    from rich.console import Console
    from rich.table import Table

    table = Table(title=title, title_justify="left")
    for name in names:
        table.add_column(name, justify="right")
    for row in rows:
        table.add_row(*map(str, row))
    Console(width=110).print(table)
