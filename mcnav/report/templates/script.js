"use strict";
// Everything on the page is there without this script. With it, tables sort, series toggle, figures say their values and
// zoom, tables copy as CSV, and the contents show where the reader is.
(() => {
  const all = (selector, root = document) => Array.from(root.querySelectorAll(selector));
  const button = (label, action) => {
    const made = document.createElement("button");
    made.type = "button";
    made.textContent = label;
    made.addEventListener("click", action);
    return made;
  };

  // A cell's number as printed: a sign, digits, a power of ten in superscripts; NaN for words.
  const superscripts = "⁰¹²³⁴⁵⁶⁷⁸⁹";
  const value = (text) => {
    const plain = text.trim().replace(/[⁰¹²³⁴⁵⁶⁷⁸⁹]/g, (c) => superscripts.indexOf(c)).replace(/[−⁻]/g, "-")
      .replace(/,/g, "").replace("·10", "e").replace(/^[<>+]\s*/, "");
    return parseFloat(plain);
  };
  const first = (cell) => (cell ? (cell.innerText || cell.textContent).trim().split("\n")[0] : "");
  const compare = (a, b) => {
    const [x, y] = [value(a), value(b)];
    if (Number.isNaN(x) !== Number.isNaN(y)) return Number.isNaN(x) ? 1 : -1;
    return Number.isNaN(x) ? a.localeCompare(b) : x - y;
  };
  const sort = (table, column, heading) => {
    const falling = heading.getAttribute("aria-sort") === "ascending";
    all("th[aria-sort]", table).forEach((each) => each.removeAttribute("aria-sort"));
    heading.setAttribute("aria-sort", falling ? "descending" : "ascending");
    const body = table.tBodies[0];
    const rows = Array.from(body.rows).map((row) => [first(row.cells[column]), row]);
    rows.sort(([a], [b]) => (falling ? -1 : 1) * compare(a, b)).forEach(([, row]) => body.append(row));
  };
  const plain = (table) => table.tHead && table.tHead.rows.length === 1 && table.tBodies.length === 1
    && table.tBodies[0].rows.length > 1 && !table.querySelector("[colspan], [rowspan]");
  all("table").filter(plain).forEach((table) => {
    Array.from(table.tHead.rows[0].cells).forEach((heading, column) => {
      if (!heading.textContent.trim()) return;
      const inside = button("", () => sort(table, column, heading));
      inside.className = "sort";
      inside.append(...heading.childNodes);
      heading.append(inside);
    });
  });

  // Keys: every entry hides and shows its series in all plots of its figure; under the pointer the others step back.
  all("figure .key li").forEach((entry) => {
    const shown = entry.closest("figure");
    const others = Array.from(entry.parentNode.children).filter((each) => each !== entry);
    const faded = (opacity) => () => others.forEach((other) => {
      all(`.series-${other.dataset.series}`, shown).forEach((each) => { each.style.opacity = opacity; });
    });
    entry.addEventListener("pointerenter", faded("0.15"));
    entry.addEventListener("pointerleave", faded(""));
    const toggled = button("", () => {
      const visible = toggled.getAttribute("aria-pressed") !== "true";
      toggled.setAttribute("aria-pressed", String(visible));
      all(`.series-${entry.dataset.series}`, shown).forEach((each) => { each.style.display = visible ? "" : "none"; });
    });
    toggled.setAttribute("aria-pressed", "true");
    toggled.title = "hide or show";
    toggled.append(...entry.childNodes);
    entry.append(toggled);
  });

  // Figures. Scales are in data-x and data-y: limits, their coordinates, whether logarithmic. Paths know M, m, l, h0, z.
  const PAIR = /([Mml])(-?\d+) ?(-?\d+)/g;
  const AREA = /band|steps/;
  const GRAB = 480; // coordinates (of which 20 are a pixel) from the pointer to what it points at
  const tip = document.createElement("div");
  tip.className = "tip";
  tip.hidden = true;
  tip.setAttribute("role", "status");
  document.body.append(tip);
  const drawn = (name, attributes) => {
    const made = document.createElementNS("http://www.w3.org/2000/svg", name);
    Object.entries(attributes).forEach(([key, each]) => made.setAttribute(key, each));
    return made;
  };
  const shown = (number, step) => {
    const size = Math.abs(number);
    if (size && (size >= 1e7 || step < 1e-5)) {
      const [digits, power] = number.toExponential(3).split("e");
      return `${+digits}·10${String(+power).replace(/./g, (c) => (c === "-" ? "⁻" : superscripts[c]))}`.replace("-", "−");
    }
    const decimals = Math.min(8, Math.max(0, Math.ceil(-Math.log10(step) - 1e-6)));
    return number.toLocaleString("en", { minimumFractionDigits: decimals, maximumFractionDigits: decimals }).replace("-", "−");
  };
  const ticksOf = (low, high, log, most) => {
    if (log && high / low > 30) {
      const powers = [];
      for (let power = Math.ceil(Math.log10(low)); 10 ** power <= high; power += 1) powers.push([10 ** power, 10 ** power]);
      return powers;
    }
    const power = 10 ** Math.floor(Math.log10((high - low) / most));
    const step = power * [1, 2, 2.5, 5, 10].find((factor) => high - low <= most * factor * power * 1.000001);
    const fine = Math.abs(step / power - 2.5) < 1e-6 ? step / 5 : step;
    const found = [];
    for (let k = Math.ceil(low / step - 1e-6); k * step <= high + 1e-6 * step; k += 1) found.push([k * step, fine]);
    return found;
  };
  const axisOf = (svg, name) => {
    const [low, high, from, to, log] = svg.dataset[name].split(" ").map(Number);
    const [bent, straight] = log ? [Math.log10, (v) => 10 ** v] : [(v) => v, (v) => v];
    const [a, b] = [bent(low), bent(high)];
    const group = svg.querySelector(`g.${name}`);
    return { from, to, log, group, before: group.innerHTML, whole: [from, to], window: [from, to],
      named: `${name}Names` in svg.dataset, label: svg.dataset[`${name}Label`], unit: svg.dataset[`${name}Unit`],
      value: (at) => straight(a + (b - a) * (at - from) / (to - from)), at: (v) => from + (to - from) * (bent(v) - a) / (b - a),
      scale() { return (this.to - this.from) / (this.window[1] - this.window[0]); },
      place(at) { return this.from + (at - this.window[0]) * this.scale(); },
      origin(place) { return this.window[0] + (place - this.from) / this.scale(); },
      text(at) {
        if (this.named) return all("text", group).sort((p, q) => Math.abs(p.getAttribute("y") - at) - Math.abs(q.getAttribute("y") - at))[0].textContent;
        const [first, last] = this.window.map(this.value);
        const step = 10 ** Math.floor(Math.log10((this.log ? this.value(at) : Math.abs(last - first)) / 500));
        return `${shown(this.value(at), step)} ${this.unit}`.trim();
      } };
  };
  const plots = all("figure .plot").map((box) => {
    const svg = box.querySelector("svg");
    const [x, y] = [axisOf(svg, "x"), axisOf(svg, "y")];
    const size = svg.viewBox.baseVal;
    const ring = drawn("path", { class: "pointed" });
    const frame = drawn("path", { class: "frame" });
    svg.append(frame, ring);
    const key = (path) => box.closest("figure").querySelector(`[data-series="${(path.closest("[class*=series-]")?.getAttribute("class") || "").replace(/.*series-/, "")}"]`);
    let read = null; // what there is to point at, once somebody points
    const marks = () => {
      if (read) return read;
      all(".marks title", svg).forEach((title) => { title.parentNode.dataset.tip = title.textContent; title.remove(); });
      read = all(".marks path.line, .marks path.points, .marks path.band, .marks path.steps", svg).map((path) => {
        let [px, py] = [0, 0];
        const points = [];
        for (const [, command, a, b] of path.getAttribute("d").matchAll(PAIR)) {
          [px, py] = command === "M" ? [+a, +b] : [px + +a, py + +b];
          if (command === "M" || path.dataset.fixed === undefined) points.push([px, py]);
        }
        const kind = path.classList[0];
        const rising = kind === "line" && points.every(([at], k) => !k || at >= points[k - 1][0]);
        return { path, points, kind, rising };
      });
      return read;
    };
    const visible = ({ path }) => path.getClientRects().length > 0;
    const gap = ([a, b], [c, d]) => Math.hypot((a - c) * x.scale(), (b - d) * y.scale());
    const nearest = (mark, at) => {
      const { points, kind } = mark;
      if (AREA.test(kind)) {
        const k = points.findIndex(([px]) => px > at[0]) - 1;
        return k < 0 ? null : { mark, point: points[k], other: kind === "band" ? points[points.length - 1 - k] : points[k + 1] };
      }
      const far = mark.rising ? (p) => Math.abs(p[0] - at[0]) * x.scale() : (p) => gap(p, at);
      let [best, least] = [null, GRAB];
      points.forEach((p) => { const d = far(p); if (d < least) [best, least] = [p, d]; });
      return best && { mark, point: best, least };
    };
    const row = (text, entry) => {
      const made = document.createElement("div");
      if (entry) made.append(entry.querySelector(".swatch").cloneNode());
      made.append(text);
      return made;
    };
    const say = (rows, places) => {
      tip.replaceChildren(...rows);
      tip.hidden = !rows.length;
      ring.setAttribute("d", places.map(([a, b]) => [x.place(a), y.place(b)]).map(([a, b]) => `M${a - 80} ${b}a80 80 0 1 0 160 0a80 80 0 1 0-160 0`).join(""));
      if (!rows.length) return;
      const own = svg.getBoundingClientRect();
      const left = own.left + (x.place(places[0][0]) / size.width) * own.width;
      const top = own.top + (y.place(places[0][1]) / size.height) * own.height;
      const room = document.documentElement.clientWidth;
      tip.style.left = `${Math.max(4, left + tip.offsetWidth + 18 > room ? left - tip.offsetWidth - 14 : left + 14)}px`;
      tip.style.top = `${scrollY + Math.max(4, top - tip.offsetHeight - 10)}px`;
    };
    const named = ({ mark }) => key(mark.path)?.textContent || y.label;
    const told = (found) => {
      const [from, to] = [found.point, found.other];
      if (found.mark.kind === "steps") return `${named(found)}, ${x.text(from[0])} to ${x.text(to[0])}: ${y.text(from[1])}`;
      return `${named(found)}: ${y.text(from[1])}${to ? ` to ${y.text(to[1])}` : ""}`;
    };
    const one = ({ mark, point: [a, b] }) => say(
      [row(named({ mark }), key(mark.path)), row(`${x.label} ${x.text(a)}`), row(`${y.label} ${y.text(b)}`)], [[a, b]]);
    const point = (at, target) => {
      const text = target.closest("[data-tip]")?.dataset.tip;
      const found = marks().filter(visible).map((mark) => nearest(mark, at)).filter(Boolean);
      if (text) return say([row(text, key(target))], [at]);
      const along = ({ mark }) => mark.rising || AREA.test(mark.kind);
      const dot = found.filter((each) => !along(each)).sort((p, q) => p.least - q.least)[0];
      const curves = found.filter(along);
      if (dot && (!curves.length || dot.least < GRAB / 2)) return one(dot);
      if (!curves.length) return say([], []);
      const exact = curves.filter(({ mark }) => mark.rising).map((each) => each.point);
      return say([row(`${x.label} ${x.text((exact[0] || at)[0])}`), ...curves.map((each) => row(told(each), key(each.mark.path)))],
        exact.length ? exact : [at]);
    };

    const whole = (axis) => axis.window.every((end, n) => end === axis.whole[n]);
    const again = button("Whole range", () => reset());
    const ticks = (axis, upright) => {
      const { group } = axis;
      const grid = group.querySelector(".grid");
      const like = group.querySelector("text");
      if (axis.named || !grid || !like) return;
      if (whole(axis)) { group.innerHTML = axis.before; return; }
      const [low, high] = axis.window.map(axis.value);
      const room = Math.abs(axis.to - axis.from) / 20;
      const found = ticksOf(low, high, axis.log, Math.max(2, Math.floor(room / (upright ? 34 : 55))));
      const other = upright ? x : y;
      grid.setAttribute("d", found.map(([v]) => axis.place(axis.at(v))).map((p) => (upright ? `M${other.from} ${p}l${other.to - other.from} 0` : `M${p} ${Math.min(other.from, other.to)}l0 ${Math.abs(other.to - other.from)}`)).join(""));
      const texts = found.map(([v, step]) => {
        const made = like.cloneNode();
        made.textContent = shown(v, step);
        made.setAttribute(upright ? "y" : "x", axis.place(axis.at(v)) + (upright ? 80 : 0));
        return made;
      });
      group.replaceChildren(grid, ...texts);
    };
    const redraw = () => {
      marks();
      const [kx, ky] = [x.scale(), y.scale()];
      const n = (v) => +v.toFixed(2);
      all(".marks path, .marks text, .labels text", svg).forEach((each) => {
        if (each.tagName === "text") {
          each.dataset.at ||= `${each.getAttribute("x")} ${each.getAttribute("y")}`;
          const [a, b] = each.dataset.at.split(" ").map(Number);
          const [px, py] = [x.place(a), y.place(b)];
          each.setAttribute("x", n(px));
          each.setAttribute("y", n(py));
          each.style.visibility = px < x.from - 40 || px > x.to + 40 ? "hidden" : "";
        } else {
          each.dataset.d ||= each.getAttribute("d");
          const fixed = each.dataset.fixed !== undefined;
          each.setAttribute("d", each.dataset.d.replace(PAIR, (whole, c, a, b) => (c === "M" ? `M${n(x.place(+a))} ${n(y.place(+b))}` : fixed ? whole : `${c}${n(a * kx)} ${n(b * ky)}`)));
        }
      });
      ticks(x, false);
      ticks(y, true);
      if (whole(x) && whole(y)) again.remove(); else box.append(again);
    };
    const together = () => (svg.dataset.link ? plots.filter((each) => each.link === svg.dataset.link) : [self]);
    const show = (wx, wy) => {
      const limits = wx.map(x.value);
      if (!y.named) y.window = wy;
      together().forEach((each) => each.window(limits));
    };
    const reset = () => {
      say([], []);
      together().forEach((each) => each.window(null));
    };
    const cut = (axis, [a, b]) => (Math.abs(b - a) < Math.abs(axis.to - axis.from) / 2000 ? axis.window : [a, b]);
    const closer = (at, factor) => {
      const around = (axis, middle) => {
        const [a, b] = axis.window.map((end) => middle + (end - middle) / factor);
        const [low, high] = [Math.min(...axis.whole), Math.max(...axis.whole)];
        return cut(axis, [Math.min(high, Math.max(low, a)), Math.min(high, Math.max(low, b))]);
      };
      if (!x.named) show(around(x, at[0]), around(y, at[1]));
    };
    const self = { link: svg.dataset.link, box, svg,
      window(limits) {
        if (limits) {
          const ends = [Math.min(...x.whole), Math.max(...x.whole)];
          const [a, b] = limits.map((v) => Math.min(ends[1], Math.max(ends[0], x.at(v))));
          if (Number.isFinite(a + b) && b - a > 1) x.window = [a, b];
        } else [x.window, y.window] = [x.whole, y.whole];
        redraw();
      } };

    // Pointer: values under it, a frame drawn with it, closer and farther with the wheel and the control key.
    const under = (event) => {
      const own = svg.getBoundingClientRect();
      return [((event.clientX - own.left) / own.width) * size.width, ((event.clientY - own.top) / own.height) * size.height];
    };
    const origin = ([a, b]) => [x.origin(a), y.origin(b)];
    let begun = null;
    let waiting = 0;
    const clamp = (axis, v) => Math.min(Math.max(axis.from, axis.to), Math.max(Math.min(axis.from, axis.to), v));
    const framed = (end) => {
      const [a, c] = [begun[0], end[0]].map((v) => clamp(x, v)).sort((p, q) => p - q);
      const high = Math.abs(end[1] - begun[1]) > 300 && !y.named;
      const [b, d] = (high ? [begun[1], end[1]].map((v) => clamp(y, v)) : [y.from, y.to]).sort((p, q) => p - q);
      return [a, b, c, d];
    };
    const stop = () => { begun = null; frame.removeAttribute("d"); };
    svg.addEventListener("pointermove", (event) => {
      const at = under(event);
      cancelAnimationFrame(waiting);
      waiting = requestAnimationFrame(() => {
        if (begun) {
          const [a, b, c, d] = framed(at);
          frame.setAttribute("d", `M${a} ${b}H${c}V${d}H${a}z`);
        } else point(origin(at), event.target);
      });
    });
    svg.addEventListener("pointerleave", () => { cancelAnimationFrame(waiting); if (!begun) say([], []); });
    svg.addEventListener("pointerdown", (event) => {
      const at = under(event);
      if (event.pointerType !== "mouse" || x.named) { point(origin(at), event.target); return; }
      if (event.button || at[0] < x.from || at[0] > x.to) return;
      say([], []);
      begun = at;
      svg.setPointerCapture(event.pointerId);
    });
    svg.addEventListener("pointerup", (event) => {
      if (!begun) return;
      const [a, b, c, d] = framed(under(event));
      stop();
      if (c - a < 120) return;
      const levels = y.from > y.to ? [d, b] : [b, d];
      show(cut(x, [x.origin(a), x.origin(c)]), cut(y, levels.map((v) => y.origin(v))));
    });
    svg.addEventListener("pointercancel", stop);
    svg.addEventListener("dblclick", reset);
    svg.addEventListener("wheel", (event) => {
      if (!event.ctrlKey && !event.metaKey) return;
      event.preventDefault();
      closer(origin(under(event)), event.deltaY < 0 ? 1.25 : 0.8);
    }, { passive: false });
    if (!x.named) svg.classList.add("zoomable");

    // Keyboard: from value to value, from series to series, closer and farther.
    let [series, k] = [0, -1];
    box.tabIndex = 0;
    box.setAttribute("role", "group");
    box.setAttribute("aria-label", `${svg.getAttribute("aria-label")}. Arrow keys: values and series; plus, minus, 0: zoom`);
    box.addEventListener("keydown", (event) => {
      if (event.target !== box || event.altKey || event.ctrlKey || event.metaKey) return;
      const dots = marks().filter((each) => visible(each) && each.points.length && (each.kind === "line" || each.kind === "points"));
      const texts = all("[data-tip]", svg).filter((each) => each.getClientRects().length);
      const turn = { ArrowRight: [1, 0], ArrowLeft: [-1, 0], ArrowDown: [0, 1], ArrowUp: [0, -1] }[event.key];
      const middle = () => [(x.window[0] + x.window[1]) / 2, (y.window[0] + y.window[1]) / 2];
      if (turn) {
        series = (series + turn[1] + Math.max(1, dots.length)) % Math.max(1, dots.length);
        const many = dots.length ? dots[series].points.length : texts.length;
        if (!many) return;
        k = Math.min(many - 1, Math.max(0, k + turn[0] * (event.shiftKey ? 10 : 1)));
        if (dots.length) {
          one({ mark: dots[series], point: dots[series].points[k] });
        } else {
          const own = texts[k].getBBox();
          say([row(texts[k].dataset.tip, key(texts[k]))], [origin([own.x + own.width / 2, own.y])]);
        }
      } else if (event.key === "+" || event.key === "=") closer(middle(), 1.5);
      else if (event.key === "-") closer(middle(), 1 / 1.5);
      else if (event.key === "0" || event.key === "Escape") reset();
      else return;
      event.preventDefault();
    });
    box.addEventListener("blur", () => say([], []));
    return self;
  });
  // The table behind a figure as CSV.
  const quoted = (text) => (/[",\n]/.test(text) ? `"${text.replace(/"/g, '""')}"` : text);
  const csv = (table) => Array.from(table.rows)
    .map((row) => Array.from(row.cells).map((cell) => quoted(cell.textContent.trim())).join(",")).join("\n");
  const copied = async (text) => {
    try {
      await navigator.clipboard.writeText(text);
    } catch {
      const area = document.createElement("textarea");
      area.value = text;
      document.body.append(area);
      area.select();
      document.execCommand("copy");
      area.remove();
    }
  };
  all("details.data").forEach((details) => {
    const copy = button("Copy as CSV", async () => {
      await copied(csv(details.querySelector("table")) + "\n");
      copy.textContent = "Copied";
      setTimeout(() => { copy.textContent = "Copy as CSV"; }, 2000);
    });
    copy.className = "copy";
    details.querySelector("summary").after(copy);
  });

  // Rows of a table that a search and choices leave.
  all("[data-filters]").forEach((form) => {
    const rows = all(`#${form.dataset.filters} tbody tr`);
    const words = form.querySelector("input");
    const choice = form.querySelector("select");
    const apply = () => rows.forEach((row) => {
      const found = row.textContent.toLowerCase().includes(words.value.toLowerCase());
      row.hidden = !found || (choice.value !== "" && row.dataset.verdict !== choice.value);
    });
    form.hidden = false;
    [words, choice].forEach((each) => each.addEventListener("input", apply));
  });

  // Contents: the section that is being read.
  const links = new Map(all("nav.contents a").map((link) => [link.hash.slice(1), link]));
  if (links.size && "IntersectionObserver" in window) {
    const watch = new IntersectionObserver((entries) => entries.forEach((entry) => {
      const link = links.get(entry.target.id);
      if (!entry.isIntersecting) return;
      links.forEach((each) => each.removeAttribute("aria-current"));
      link.setAttribute("aria-current", "true");
    }), { rootMargin: "-10% 0px -80% 0px" });
    all("section[id]").filter((section) => links.has(section.id)).forEach((section) => watch.observe(section));
  }
})();
