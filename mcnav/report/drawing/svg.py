"""A panel as SVG that can share a page with others: text stays text, colours are the style sheet's variables.

`mcnav.report.drawing.svg_paths` writes its paths.
"""

from __future__ import annotations

import math
from itertools import product
from typing import Final

import numpy as np
from markupsafe import Markup, escape

from mcnav.arrays.types import Array
from mcnav.report.drawing import marks as m
from mcnav.report.drawing.palette import GRID, INK, MUTED, PAPER, readable_on, variable
from mcnav.report.drawing.svg_paths import UNIT, Scale, area_path, dots_path, line_path, outline, rectangle
from mcnav.report.drawing.svg_paths import coordinate as _n
from mcnav.report.drawing.ticks import Box, overlap, place_label, points_in, text_width, ticks_along

TITLE, LABEL, TICK, SMALL = 13.0, 12.0, 11.5, 10.5
"""Sizes of text, px."""

GAP: Final = 5.0
"""Least room between two labels on a line, px."""

SLANTED: Final = 24.0
"""Least distance between slanted names of columns, px."""

LONGEST: Final = 0.42
"""Share of a panel's width that the names of rows may take; longer ones are cut."""


def _text(
    x: float, y: float, text: object, size: float = TICK, anchor: str = "", colour: str = INK, more: str = ""
) -> str:
    anchored = f' text-anchor="{anchor}"' if anchor else ""
    sized = f' font-size="{_n(size)}"' if size != TICK else ""
    coloured = f' fill="{variable(colour)}"' if colour != INK else ""
    return f'<text x="{_n(x)}" y="{_n(y)}"{anchored}{sized}{coloured}{more}>{escape(text)}</text>'


def _shortened(name: str, room: float) -> str:
    if text_width(name, TICK) <= room:
        return name
    while len(name) > 3 and text_width(name + "…", TICK) > room:
        name = name[:-1]
    return name.rstrip() + "…"


def _titled(text: str) -> str:
    return f"<title>{escape(text)}</title>" if text else ""


class _Plot:
    """A panel laid out in so many pixels: where its axes lie, and what has been written so far."""

    def __init__(self, panel: m.Panel, width: float, height: float) -> None:
        self.panel, self.width, self.height = panel, width, height
        reach_x, reach_y = panel.reaches()
        limit_x, limit_y = panel.x.limits(reach_x), panel.y.limits(reach_y)
        self.top = 24.0 if panel.title else 8.0
        self.bottom = height - 6.0 - (18.0 if panel.x.title else 0.0) - self._below()
        self.names = [_shortened(name, LONGEST * width) for name in panel.y.names]
        log, span = panel.y.log, self.bottom - self.top
        self.ticks_y: tuple[list[float], list[str]] = (
            ([float(k) for k in range(len(self.names))], self.names) if self.names
            else ([], []) if panel.y.bare
            else ticks_along(*limit_y, log, span, lambda _: LABEL + 6.0, max(2, int(span / 34)))
        )  # fmt: skip
        widest = max((text_width(text, TICK) for text in self.ticks_y[1]), default=0.0)
        self.left = 6.0 + (18.0 if panel.y.title else 0.0) + (widest + 6.0 if widest else 0.0)
        right = 10.0
        for _ in range(3):
            self.right = width - right
            self.x = Scale(*limit_x, self.left, self.right, panel.x.log)
            room = self.right - self.left
            self.ticks_x = ([], []) if panel.x.names or panel.x.bare else ticks_along(
                *limit_x, panel.x.log, room, lambda text: text_width(text, TICK)
            )  # fmt: skip
            labels = zip(*self.ticks_x, strict=True)
            reached = max((float(self.x(at)) + 0.5 * text_width(text, TICK) for at, text in labels), default=0.0)
            beyond = reached + 2.0 - width
            if beyond <= 0.0:
                break
            right += beyond
        upward = (self.top, self.bottom) if panel.y.names else (self.bottom, self.top)
        self.y = Scale(*limit_y, *upward, panel.y.log)
        self.taken: list[Box] = []
        self.drawn = [np.empty((0, 2))]

    def _below(self) -> float:
        """Return the height of the text below the x axis."""
        if not self.panel.x.names:
            return 18.0
        return 8.0 + 0.5 * max(text_width(name, TICK) for name in self.panel.x.names) + 0.87 * TICK

    def axes(self) -> str:
        """Write the grid, ticks, labels and the panel's title."""
        panel = self.panel
        left, right, top, bottom = self.left, self.right, self.top, self.bottom
        parts = ['<g class="x">']
        if panel.x.names:
            apart = (right - left) / len(panel.x.names)
            every = math.ceil(SLANTED / apart)  # of dense columns not all are named
            for column, name in list(enumerate(panel.x.names))[::every]:
                place = f"translate({_n(float(self.x(column)) + 4.0)} {_n(bottom + 14.0)}) rotate(-30)"
                parts.append(f'<text text-anchor="end" transform="{place}">{escape(name)}</text>')
        else:
            places = [float(self.x(tick)) for tick in self.ticks_x[0]]
            parts.append(_grid("".join(f"M{_n(x)} {_n(top)}l0 {_n(bottom - top)}" for x in places)))
            labels = zip(places, self.ticks_x[1], strict=True)
            parts += [_text(x, bottom + 15.0, text, anchor="middle") for x, text in labels]
        parts.append('</g><g class="y">')
        places = [float(self.y(tick)) for tick in self.ticks_y[0]]
        if not panel.y.names:
            parts.append(_grid("".join(f"M{_n(left)} {_n(y)}l{_n(right - left)} 0" for y in places)))
        whole = panel.y.names or self.ticks_y[1]
        for y, text, full in zip(places, self.ticks_y[1], whole, strict=True):
            shown = _text(left - 6.0, y + 4.0, text, anchor="end")
            parts.append(shown if full == text else shown.replace("</text>", f"{_titled(full)}</text>"))
        parts.append("</g>")
        if not (panel.x.names and panel.y.names):
            corner = f"M{_n(left)} {_n(top)}l0 {_n(bottom - top)}l{_n(right - left)} 0"
            parts.append(f'<path d="{corner}" fill="none" stroke="{variable(MUTED)}" stroke-width="{_n(0.9)}"/>')
        middle = 0.5 * (left + right)
        if panel.x.title:
            parts.append(_text(middle, self.height - 7.0, panel.x.title, LABEL, "middle"))
        if panel.y.title:
            turned = f'transform="translate({_n(14.0)} {_n(0.5 * (top + bottom))}) rotate(-90)"'
            parts.append(f'<text text-anchor="middle" font-size="{_n(LABEL)}" {turned}>{escape(panel.y.title)}</text>')
        if panel.title:
            begin = max(6.0, min(left, self.width - 8.0 - text_width(panel.title, TITLE)))
            parts.append(_text(begin, 15.0, panel.title, TITLE))
        return "".join(parts)

    def marks(self) -> str:
        """Write all marks, cut at the axes."""
        return "".join(self._mark(mark) for mark in self.panel.marks)

    def labels(self) -> str:
        """Render the labels next to the marks, once these are drawn."""
        points = np.concatenate(self.drawn)
        points = points[np.isfinite(points).all(axis=1)]
        return "".join(self._labels(mark, points) for mark in self.panel.marks)

    def _remember(self, x: Array, y: Array) -> None:
        self.drawn.append(np.column_stack((x, y)))

    def _mark(self, mark: m.Mark) -> str:
        match mark:
            case m.Line():
                x, y = self.x(mark.x), self.y(mark.y)
                self._remember(x, y)
                read_as = "" if mark.silent else "line"
                return _stroke(line_path(x, y), mark.series, mark.width, mark.kind or mark.series.kind, read_as)
            case m.Points():
                x, y = np.broadcast_arrays(self.x(mark.x), self.y(mark.y))
                self._remember(np.atleast_1d(x), np.atleast_1d(y))
                return _points(mark, np.atleast_1d(x), np.atleast_1d(y))
            case m.Band():
                path = area_path(self.x(mark.x), self.y(mark.low), self.y(mark.high))
                return _fill(path, mark.series, mark.opacity, "band")
            case m.Steps():
                heights = np.concatenate([[0.0], np.repeat(np.asarray(mark.heights, dtype=float), 2), [0.0]])
                path = outline(self.x(np.repeat(np.asarray(mark.edges, dtype=float), 2)), self.y(heights))
                return _fill(path, mark.series, 1.0, "steps")
            case m.Span():
                scale = self.y if mark.level else self.x
                low, high = (float(scale(end)) for end in (mark.low, mark.high))
                across = (self.left, high, self.right, low) if mark.level else (low, self.top, high, self.bottom)
                path = _fill(rectangle(*across), mark.series, mark.opacity, "shade" if mark.text else "")
                return path.replace("/>", f">{_titled(mark.text)}</path>") if mark.text else path
            case m.Rule():
                return self._rule(mark)
            case m.Bars():
                return self._bars(mark)
            case m.Interval():
                level = np.full(2, float(self.y(mark.row)))
                path = _stroke(line_path(self.x([mark.low, mark.high]), level), mark.series, mark.width, "line", "")
                return path.replace("/>", f">{_titled(mark.text)}</path>") if mark.text else path
            case m.Cells():
                return self._cells(mark)
            case _:
                return ""

    def _rule(self, mark: m.Rule) -> str:
        at = float((self.y if mark.level else self.x)(mark.at))
        low, high = (self.left, self.right) if mark.level else (self.top, self.bottom)
        if not math.isfinite(at):
            return ""
        path = f"M{_n(low)} {_n(at)}l{_n(high - low)} 0" if mark.level else f"M{_n(at)} {_n(low)}l0 {_n(high - low)}"
        series = mark.series or m.Series("", "", mark.colour)
        return _stroke(path, series, mark.width, mark.kind, "")

    def _bars(self, mark: m.Bars) -> str:
        parts = []
        rows, low, high = (np.asarray(each, dtype=float) for each in (mark.rows, mark.low, mark.high))
        for k, (row, text) in enumerate(zip(rows, mark.texts, strict=True)):
            left, right = float(self.x(low[k])), float(self.x(high[k]))
            top, bottom = (float(self.y(row + sign * 0.5 * mark.thickness)) for sign in (-1.0, 1.0))
            if right - left < 0.5 / UNIT:
                continue
            parts.append(f'<path d="{rectangle(left, top, right, bottom)}">{_titled(text)}</path>')
            name = mark.names[k] if mark.names else ""
            if name and text_width(name, SMALL) + 4.0 <= right - left:
                text_colour = readable_on(mark.series.colour)
                more = ' stroke="none" pointer-events="none"'
                x, y = 0.5 * (left + right), 0.5 * (top + bottom) + 4.0
                parts.append(_text(x, y, name, SMALL, "middle", text_colour, more))
        edge = f'stroke="{variable(PAPER)}" stroke-width="{_n(0.8)}"'
        return f'<g class="series-{mark.series.name}" fill="{mark.series.variable}" {edge}>{"".join(parts)}</g>'

    def _cells(self, mark: m.Cells) -> str:
        panel, parts = self.panel, []
        room = (self.right - self.left) / max(len(panel.x.names), 1) - 4.0
        for row, column in np.ndindex(mark.shares.shape):
            share, text = float(mark.shares[row, column]), mark.texts[row][column]
            if not math.isfinite(share):
                continue
            series = mark.positive if share >= 0.0 else mark.negative
            edges = self.x([column - 0.5, column + 0.5]), self.y([row - 0.5, row + 0.5])
            box = rectangle(float(edges[0][0]), float(edges[1][0]), float(edges[0][1]), float(edges[1][1]))
            opacity = round(mark.deepest * min(abs(share), 1.0), 3)
            full = f"{panel.y.names[row]}, {panel.x.names[column]}: {text}"
            size = min(LABEL, 10.0 * LABEL * room / max(text_width(text, 10.0 * LABEL), 1.0))
            label = ""
            if size >= 7.0:
                x, y = float(self.x(column)), float(self.y(row))
                label = _text(x, y + 0.36 * size, text, size, "middle", more=' pointer-events="none"')
            elif opacity == 0.0:
                continue  # neither seen nor read; of many outputs three in four
            path = f'<path d="{box}" fill="{series.variable}" fill-opacity="{opacity:g}">{_titled(full)}</path>'
            parts.append(f'<g class="series-{series.name}">{path}{label}</g>')
        return "".join(parts)

    def _labels(self, mark: m.Mark, points: Array) -> str:
        """Render the label next to a mark, where there is room."""
        frame = (self.left + 1.0, self.top - 2.0, self.right + 6.0, self.bottom - 1.0)
        match mark:
            case m.Points(names=names) if names:
                x, y = np.atleast_1d(self.x(mark.x)), np.atleast_1d(self.y(mark.y))
                places = zip(x.tolist(), y.tolist(), names, strict=True)
                labels = "".join(self._beside(*place, frame, points) for place in places)
                return f'<g class="series-{mark.series.name}">{labels}</g>'
            case m.Text(corner=True):
                return self._in_corner(mark)
            case m.Text():
                place = float(self.x(mark.x)), float(self.y(mark.y))
                return self._beside(*place, mark.text, frame, points, mark.colour)
            case m.Rule(name=name, level=False) if name:
                return self._event(mark, points)
            case _:
                return ""

    def _in_corner(self, mark: m.Text) -> str:
        parts = []
        for k, text in enumerate(mark.text.split("\n")):
            x, y = self.right - 2.0, self.top + 13.0 + 13.0 * k
            self.taken.append((x - text_width(text, SMALL), y - SMALL, x, y + 3.0))
            parts.append(_haloed(x, y, text, "end", mark.colour))
        return "".join(parts)

    def _event(self, mark: m.Rule, points: Array) -> str:
        """Write the name of an upright line at its foot or head, on the side where it hides least."""
        at, width = float(self.x(mark.at)), text_width(mark.name, SMALL)
        if not self.left <= at <= self.right:
            return ""
        places: list[tuple[int, int, Box]] = []
        for rank, (left, top) in enumerate(product((at + 3.0, at - 3.0 - width), (self.bottom - 15.0, self.top + 2.0))):
            box = (left, top, left + width, top + 12.0)
            free = not any(overlap(box, each) for each in self.taken)
            if free and box[0] >= self.left and box[2] <= self.width - 1.0:
                places.append((points_in(box, points), rank, box))
        if not places:
            return ""
        box = min(places)[2]
        self.taken.append(box)
        return _haloed(box[0], box[3] - 2.5, mark.name, "", INK)

    def _beside(self, x: float, y: float, text: str, frame: Box, points: Array, colour: str = INK) -> str:
        box = place_label(x, y, text_width(text, SMALL), SMALL + 1.0, frame, self.taken, points)
        if box is None:
            return ""
        self.taken.append((box[0] - GAP, box[1], box[2] + GAP, box[3]))
        return _haloed(box[0], box[3] - 2.0, text, "", colour)


def _haloed(x: float, y: float, text: str, anchor: str, colour: str) -> str:
    halo = f' class="at" paint-order="stroke" stroke="{variable(PAPER)}" stroke-width="{_n(2.5)}"'
    return _text(x, y, text, SMALL, anchor, colour, halo)


def _grid(path: str) -> str:
    return f'<path class="grid" d="{path}" stroke="{variable(GRID)}" stroke-width="{_n(0.9)}"/>'


def _class(series: m.Series, kind: str) -> str:
    names = " ".join(filter(None, (kind, f"series-{series.name}" if series.name else "")))
    return f' class="{names}"' if names else ""


def _stroke(path: str, series: m.Series, width: float, kind: str, read_as: str) -> str:
    dashes = m.DASHES.get(kind, ())
    dashed = f' stroke-dasharray="{" ".join(str(_n(dash)) for dash in dashes)}"' if dashes else ""
    drawn = f'fill="none" stroke="{series.variable}" stroke-width="{_n(width)}"{dashed}'
    return f'<path{_class(series, read_as)} d="{path}" {drawn}/>' if path else ""


def _fill(path: str, series: m.Series, opacity: float, read_as: str) -> str:
    faint = f' fill-opacity="{opacity:g}"' if opacity != 1.0 else ""
    return f'<path{_class(series, read_as)} d="{path}" fill="{series.variable}"{faint}/>' if path else ""


def _points(mark: m.Points, x: Array, y: Array) -> str:
    """Write points as zero-length strokes, whose caps are their shape; triangles as outlines; with texts one by one."""
    kind, size, colour = mark.series.kind, mark.size, mark.series.variable
    named = f'class="points series-{mark.series.name}"'
    faint = f' stroke-opacity="{mark.opacity:g}"' if mark.opacity != 1.0 else ""
    if kind in ("triangle", "onward"):
        half = _n(0.55 * size)
        shape = f"l{-half} {-2 * half}l{2 * half} 0z" if kind == "triangle" else f"l{-2 * half} {-half}l0 {2 * half}z"
        path = "".join(
            f"M{_n(a)} {_n(b)}h0{shape}"
            for a, b in zip(x, y, strict=True) if math.isfinite(a) and math.isfinite(b)
        )  # fmt: skip
        return f'<path {named} d="{path}" fill="{colour}" data-fixed=""/>' if path else ""
    cap = "square" if kind in ("square", "box") else "round"
    style = f'fill="none" stroke-linecap="{cap}"{faint}'
    if mark.texts:
        parts = [
            f'<path d="{dots_path(x[k : k + 1], y[k : k + 1])}">{_titled(text)}</path>'
            for k, text in enumerate(mark.texts)
        ]
        return f'<g {named} {style} stroke="{colour}" stroke-width="{_n(size)}">{"".join(parts)}</g>'
    path = dots_path(x, y)
    if not path:
        return ""
    whole = f'<path {named} d="{path}" {style} stroke="{colour}" stroke-width="{_n(size)}"/>'
    if kind not in ("ring", "box"):
        return whole
    inner = f'<path class="series-{mark.series.name}" d="{path}" {style} stroke="{variable(PAPER)}"'
    return f'{whole}{inner} stroke-width="{_n(max(size - 3.2, 1.0))}"/>'


def plot_area(panel: m.Panel, width: float, height: float) -> Box:
    """Return left, top, right and bottom of the area between the axes of a panel of so many pixels."""
    plot = _Plot(panel, width, height)
    return plot.left, plot.top, plot.right, plot.bottom


def svg(panel: m.Panel, width: float, height: float, key: str, title: str, described_by: str = "") -> Markup:
    """Return a panel of so many pixels as SVG; ``key`` begins its only id, ``title`` is its name for screen readers."""
    plot = _Plot(panel, width, height)
    whole = f"0 0 {_n(width)} {_n(height)}"
    described = f' aria-describedby="{escape(described_by)}"' if described_by else ""
    data = f'data-x="{plot.x.attribute()}" data-y="{plot.y.attribute()}"'
    for name, axis in (("x", panel.x), ("y", panel.y)):
        data += f' data-{name}-label="{escape(axis.label)}" data-{name}-unit="{escape(axis.unit)}"'
        data += f' data-{name}-names=""' if axis.names else ""
    data += ' data-even=""' if panel.even else ""
    data += f' data-link="{escape(panel.x.link)}"' if panel.x.link else ""
    corners = f'x="{_n(plot.left)}" y="{_n(plot.top - 3.0)}" width="{_n(plot.right - plot.left + 3.0)}"'
    clip = f'<clipPath id="{key}-c"><rect {corners} height="{_n(plot.bottom - plot.top + 3.0)}"/></clipPath>'
    return Markup(
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="{whole}" role="img" aria-label="{escape(title)}"{described} '
        f'{data} font-family="sans-serif" font-size="{_n(TICK)}" fill="{variable(INK)}" stroke-linejoin="round">{clip}'
        f'{plot.axes()}<g class="marks" clip-path="url(#{key}-c)">{plot.marks()}</g>'
        f'<g class="labels">{plot.labels()}</g></svg>'
    )
