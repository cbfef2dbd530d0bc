"""A4 pages that are filled from the top: headings, sentences, tables, cards and pictures."""

import re
from collections.abc import Callable, Sequence
from typing import NamedTuple

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Rectangle

from cocap_opt.missions.sheet.letters import (
    BODY,
    HEAD,
    POINT,
    SMALL,
    SMALL_STRONG,
    STRONG,
    TITLE,
    Text,
    in_order,
    wide,
    wrapped,
)

WIDTH, HEIGHT = 210.0, 297.0  # mm
SIDE, TOP, BOTTOM = 14.0, 14.0, 14.0  # mm, margins
INNER = WIDTH - 2 * SIDE
_WHOLE = HEIGHT - TOP - BOTTOM  # mm, height of a page
_MM = 25.4  # mm per inch
# mm between columns of a table, and the minimum if it needs the whole width
_GAP, _LEAST_GAP = 3.0, 1.5
_PAD, _BETWEEN = 2.0, 3.0  # mm, inside a card, and between two cards
_AFTER_LINES, _AFTER_TABLE = 0.8, 2.0  # mm, after a sentence and after a table
_LABEL = 19.0  # mm, for the labels of a card's facts
# mm; longer sections continue on the next page; at least this much is on the first
_LONG, _LEAST = 120.0, 50.0
_RULE, _PALE = "#000000", "#999999"


class Table(NamedTuple):
    """A table: its cells are text, which is folded if it is too long.

    Attributes
    ----------
    right : numbers of right-aligned columns
    """

    heads: tuple[str, ...]
    rows: Sequence[tuple[str, ...]]
    right: frozenset[int] = frozenset()


class _Widths(NamedTuple):
    """The widths of a table's columns, and the gap between two of them (mm)."""

    each: Sequence[float]
    gap: float

    @property
    def sum(self) -> float:
        """The width of the table (mm)."""
        return sum(self.each) + self.gap * (len(self.each) - 1)


Block = str | Table  # a sentence or a table


class Section(NamedTuple):
    """A part of the sheet: its title, and sentences and tables in their order."""

    title: str
    blocks: list[Block]


class Card(NamedTuple):
    """A box that is never split by a page break: a title, labelled facts, and a table.

    Attributes
    ----------
    beside : a fact on the line of the title; its label is empty if there is none
    """

    title: str
    facts: Sequence[tuple[str, str]]
    table: Table | None = None
    beside: tuple[str, str] = ("", "")


class Inset(NamedTuple):
    """Millimetres around the axes of a picture, for labels and legends."""

    left: float = 11.0
    below: float = 9.0
    above: float = 0.0


AXES = Inset()


class Pages:
    """A4 pages (`figures`); new content is added below the existing content of the last page.

    Parameters
    ----------
    families : font families; the first has most letters
    """

    def __init__(self, families: Sequence[str]) -> None:
        self._families = tuple(families)
        self.figures: list[Figure] = []
        self.begin_page()

    def begin_page(self) -> None:
        """Starts a new page."""
        self.figures.append(Figure(figsize=(WIDTH / _MM, HEIGHT / _MM)))
        self._y = TOP  # mm from the top

    @property
    def room(self) -> float:
        """Remaining height of the page in mm."""
        return HEIGHT - BOTTOM - self._y

    def need(self, height: float) -> None:
        """Starts a new page unless the given height (mm) remains."""
        if height > self.room and self._y > TOP:
            self.begin_page()

    def skip(self, height: float) -> None:
        """Leaves some height (mm) empty."""
        self._y += height

    def title(self, words: str) -> None:
        """Writes the title of all pages."""
        self._write(SIDE, self._y, words, TITLE, INNER)
        self.skip(2.0)

    def heading(self, words: str, below: float) -> None:
        """Writes a heading, on a page with enough room for the given height below it, too.

        If no page has room, it gets a page of its own.
        """
        look = HEAD
        self.need(min(look.line + 5.0 + below, _WHOLE))
        if self._y > TOP:
            self.skip(3.0)
        self._write(SIDE, self._y, words, look, INNER)
        self._line(SIDE, self._y + 0.4, SIDE + INNER)
        self.skip(2.0)

    def sentence(self, words: str, look: Text = BODY, mark: str = "") -> None:
        """Writes a sentence, after a mark if there is one; it is split only if no page can hold
        it.
        """
        inset = self._wide(mark + "  ", look) if mark else 0.0
        lines = self._wrapped(words, INNER - inset, look)
        if len(lines) * look.line <= _WHOLE:
            self.need(len(lines) * look.line)
        for k, line in enumerate(lines):
            self.need(look.line)
            if mark and k == 0:
                self._put(SIDE, self._y, mark, look)
            self._lines(SIDE + inset, [line], look)
        self.skip(_AFTER_LINES)

    def checklist(self, title: str, sentences: Sequence[str], mark: str) -> None:
        """Writes sentences after marks below a heading, in two columns, without a page break
        inside.

        A list that no page can hold is in one column.
        """
        width, inset = (INNER - _BETWEEN) / 2, self._wide(mark + "  ", BODY)
        items = [self._wrapped(words, width - inset, BODY) for words in sentences]
        heights = [len(lines) * BODY.line + _AFTER_LINES for lines in items]
        highs = [max(sum(heights[:k]), sum(heights[k:])) for k in range(len(items) + 1)]
        height = min(highs)
        first = highs.index(height)
        self.heading(title, height)
        if height > self.room:
            for words in sentences:
                self.sentence(words, mark=mark)
            return
        top = self._y
        for side, column in enumerate((items[:first], items[first:])):
            self._y, left = top, SIDE + side * (width + _BETWEEN)
            for lines in column:
                self._put(left, self._y, mark, BODY)
                self._lines(left + inset, lines, BODY)
                self.skip(_AFTER_LINES)
        self._y = top + height

    def box(self, words: Sequence[str]) -> None:
        """Writes sentences in a thick frame, for warnings; in several frames if necessary."""
        inner = INNER - 2 * _PAD
        lines = [line for text in words for line in self._wrapped(text, inner, STRONG)]
        most = int((_WHOLE - 2 * _PAD) / STRONG.line)
        for k in range(0, len(lines), most):
            part = lines[k : k + most]
            height = len(part) * STRONG.line + 2 * _PAD
            self.need(height)
            self._frame(SIDE, self._y, INNER, height, 1.6)
            self.skip(_PAD)
            self._lines(SIDE + _PAD, part, STRONG)
            self.skip(_PAD + 2.0)

    def section(self, words: str, blocks: Sequence[Block], look: Text = SMALL) -> None:
        """Writes a heading with sentences and tables below it; split only if they are long.

        Parameters
        ----------
        look : text style of tables
        """
        height = sum(self._height(block, look) for block in blocks)
        self.heading(words, height if height <= _LONG else _LEAST)
        for block in blocks:
            if isinstance(block, Table):
                self.table(block, look)
            else:
                self.sentence(block)

    def _height(self, block: Block, look: Text) -> float:
        if isinstance(block, str):
            return len(self._wrapped(block, INNER, BODY)) * BODY.line + _AFTER_LINES
        widths = self._widths(block, INNER, look)
        rows = (self._cells(row, widths, look) for row in (block.heads, *block.rows))
        return sum(self._high(row, look) for row in rows) + 1.0 + _AFTER_TABLE

    def table(self, table: Table, look: Text = BODY) -> None:
        """Writes a table; rows are not split, and the head is repeated on each page."""
        widths = self._widths(table, INNER, look)
        head = self._cells(table.heads, widths, look.in_bold)
        for k, row in enumerate(table.rows):
            cells = self._cells(row, widths, look)
            height = self._high(cells, look)
            before = self._high(head, look) + 1.0
            if k == 0 or height > self.room:
                self.need(height + before)
                self._row(head, widths, table, SIDE, look.in_bold)
                self._line(SIDE, self._y, SIDE + widths.sum, _PALE)
                self.skip(1.0)
            self._row(cells, widths, table, SIDE, look)
        self.skip(_AFTER_TABLE)

    def cards(self, title: str, cards: Sequence[Card]) -> None:
        """Draws cards below a heading in two columns; no card is split by a page break.

        They are ordered line by line: every other one is on the right, if the page has room there.
        """
        wide = (INNER - _BETWEEN) / 2
        self.heading(title, max(self._card_height(card, wide) for card in cards[:2]))
        ends, side = [self._y, self._y], 0  # mm from the top, for both columns
        for card in cards:
            height = self._card_height(card, wide)
            bottom = HEIGHT - BOTTOM - height
            if ends[side] > bottom >= ends[1 - side]:
                side = 1 - side
            if ends[side] > bottom and max(ends) > TOP:
                self.begin_page()
                ends, side = [self._y, self._y], 0
            self._y = ends[side]
            self._draw_card(card, SIDE + side * (wide + _BETWEEN), wide, height)
            ends[side] += height + _BETWEEN
            side = 1 - side
        self._y = max(ends)

    def fields(self, fields: Sequence[tuple[str, str]], columns: int) -> None:
        """Writes labels and values in a number of columns; an empty value is a line to fill in."""
        wide = (INNER - _GAP * (columns - 1)) / columns
        for k in range(0, len(fields), columns):
            row = fields[k : k + columns]
            texts = [
                self._wrapped(value, wide - self._wide(f"{name}: ", STRONG), BODY)
                for name, value in row
            ]
            height = max(len(lines) for lines in texts) * BODY.line + 1.2
            self.need(height)
            for side, ((name, value), lines) in enumerate(zip(row, texts, strict=True)):
                left = SIDE + side * (wide + _GAP)
                inset = self._wide(f"{name}: ", STRONG)
                self._put(left, self._y, f"{name}:", STRONG)
                for n, words in enumerate(lines):
                    self._put(left + inset, self._y + n * BODY.line, words, BODY)
                if not value:
                    self._line(left + inset, self._y + BODY.line - 0.6, left + wide, _PALE)
            self.skip(height)

    def picture(
        self, height: float, draw: Callable[[Axes], None],
        inset: Inset = AXES,
    ) -> None:  # fmt: skip
        """Draws a picture of the given height (mm), with the inset around its axes."""
        self.need(height)
        box = (
            (SIDE + inset.left) / WIDTH, 1 - (self._y + height - inset.below) / HEIGHT,
            (INNER - inset.left) / WIDTH, (height - inset.below - inset.above) / HEIGHT,
        )  # fmt: skip
        draw(self.figures[-1].add_axes(box))
        self.skip(height + 1.0)

    def foot(self, words: str) -> None:
        """Writes text and the page number at the foot of each page."""
        for number, figure in enumerate(self.figures, 1):
            line = f"{words}  ·  page {number} of {len(self.figures)}"
            self._draw(figure, WIDTH - SIDE, HEIGHT - 7.0, line, SMALL, "right")

    def _card_height(self, card: Card, wide: float) -> float:
        inner = wide - 2 * _PAD
        lines = len(self._wrapped(card.title, self._title_width(card, inner), STRONG))
        height = lines * STRONG.line + 1.0 + 2 * _PAD
        for _, value in card.facts:
            height += len(self._wrapped(value, inner - _LABEL, SMALL)) * SMALL.line + 0.4
        if card.table is not None:
            widths = self._widths(card.table, inner, SMALL)
            rows = [card.table.heads, *card.table.rows]
            height += 1.5 + sum(self._high(self._cells(r, widths, SMALL), SMALL) for r in rows)
        return height

    @staticmethod
    def _title_width(card: Card, inner: float) -> float:
        return inner / 2 - _GAP if card.beside[0] else inner

    def _draw_card(self, card: Card, left: float, wide: float, height: float) -> None:
        self._frame(left, self._y, wide, height, 0.8)
        self.skip(_PAD)
        inner = wide - 2 * _PAD
        if name := card.beside[0]:
            half = left + _PAD + inner / 2
            self._put(half, self._y, name, SMALL_STRONG)
            start = half + self._wide(f"{name}  ", SMALL_STRONG)
            self._put(start, self._y, card.beside[1], SMALL)
            if not card.beside[1]:
                self._line(start, self._y + STRONG.line - 0.5, left + _PAD + inner, _PALE)
        title = self._wrapped(card.title, self._title_width(card, inner), STRONG)
        self._lines(left + _PAD, title, STRONG)
        self.skip(1.0)
        for name, value in card.facts:
            self._put(left + _PAD, self._y, name, SMALL_STRONG)
            lines = self._wrapped(value, inner - _LABEL, SMALL)
            if not value:
                self._line(left + _PAD + _LABEL, self._y + SMALL.line - 0.5, left + _PAD + inner,
                           _PALE)  # fmt: skip
            self._lines(left + _PAD + _LABEL, lines, SMALL)
            self.skip(0.4)
        if card.table is not None:
            widths = self._widths(card.table, inner, SMALL)
            self.skip(0.5)
            head = self._cells(card.table.heads, widths, SMALL_STRONG)
            self._row(head, widths, card.table, left + _PAD, SMALL_STRONG)
            self._line(left + _PAD, self._y, left + _PAD + inner, _PALE)
            self.skip(0.5)
            for row in card.table.rows:
                cells = self._cells(row, widths, SMALL)
                self._row(cells, widths, card.table, left + _PAD, SMALL)

    def _widths(self, table: Table, inner: float, look: Text) -> "_Widths":
        """Returns the widths of columns: the required ones, reduced from the widest if there is no
        room.

        Words are split only if they have no room otherwise.
        """
        bold = look.in_bold
        cells = [
            [(head, bold), *((row[k], look) for row in table.rows)]
            for k, head in enumerate(table.heads)
        ]
        needs = [max(self._wide(text, how) for text, how in column) for column in cells]
        spare = inner - sum(needs)
        gaps = max(len(needs) - 1, 1)
        if spare >= _LEAST_GAP * gaps:
            return _Widths(needs, min(_GAP, spare / gaps))
        least = [
            max(self._wide(word, how) for text, how in column for word in re.split("[ \n]", text))
            for column in cells
        ]
        rest = inner - _LEAST_GAP * gaps - sum(least)
        if rest < 0:
            rest, least = rest + sum(least), [0.0] * len(needs)
        more = [need - word for need, word in zip(needs, least, strict=True)]
        left, most = len(more), max(more)
        for each in sorted(more):  # those that lack little get what they need
            if each * left > rest:
                most = rest / left
                break
            rest, left = rest - each, left - 1
        widths = [word + min(each, most) for word, each in zip(least, more, strict=True)]
        return _Widths(widths, _LEAST_GAP)

    def _cells(self, row: Sequence[str], widths: "_Widths", look: Text) -> list[list[str]]:
        return [self._wrapped(text, w, look) for text, w in zip(row, widths.each, strict=True)]

    @staticmethod
    def _high(cells: Sequence[Sequence[str]], look: Text) -> float:
        return max(len(lines) for lines in cells) * look.line

    def _row(
        self, cells: Sequence[Sequence[str]], widths: "_Widths", table: Table, left: float,
        look: Text,
    ) -> None:  # fmt: skip
        for k, (lines, width) in enumerate(zip(cells, widths.each, strict=True)):
            is_right = k in table.right
            for n, words in enumerate(lines):
                at = left + width if is_right else left
                self._put(at, self._y + n * look.line, words, look, "right" if is_right else "left")
            left += width + widths.gap
        self.skip(self._high(cells, look))

    def _write(self, left: float, top: float, words: str, look: Text, wide: float) -> None:
        self._y = top
        self._lines(left, self._wrapped(words, wide, look), look)

    def _lines(self, left: float, lines: Sequence[str], look: Text) -> None:
        for words in lines:
            self._put(left, self._y, words, look)
            self.skip(look.line)

    def _put(self, x: float, y: float, words: str, look: Text, side: str = "left") -> None:
        base = y + look.size * POINT  # baseline, relative to the top of the line
        self._draw(self.figures[-1], x, base, words, look, side)

    def _draw(self, page: Figure, x: float, y: float, words: str, look: Text, side: str) -> None:
        """Draws a line of text with its baseline at y (mm from the top)."""
        parts = in_order(words)
        if side == "right" and len(parts) > 1:
            x, side = x - self._wide(words, look), "left"
        for part in parts:
            page.text(
                x / WIDTH, 1 - y / HEIGHT, part, size=look.size, ha=side, va="baseline",
                weight="bold" if look.bold else "normal", family=list(self._families),
                parse_math=False,
            )  # fmt: skip
            x += self._wide(part, look)

    def _line(self, left: float, y: float, right: float, colour: str = _RULE) -> None:
        at = 1 - y / HEIGHT
        self.figures[-1].add_artist(
            Line2D([left / WIDTH, right / WIDTH], [at, at], color=colour, lw=0.6)
        )

    def _frame(self, left: float, top: float, wide: float, high: float, width: float) -> None:
        self.figures[-1].add_artist(Rectangle(
            (left / WIDTH, 1 - (top + high) / HEIGHT), wide / WIDTH, high / HEIGHT,
            fc="none", ec=_RULE, lw=width,
        ))  # fmt: skip

    def _wide(self, words: str, look: Text) -> float:
        return max(wide(line, look, self._families) for line in words.split("\n"))

    def _wrapped(self, words: str, width: float, look: Text) -> list[str]:
        return wrapped(words, width, look, self._families)
