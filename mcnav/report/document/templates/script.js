"use strict";
// Everything on the page is there without this script. With it, tables sort, series toggle, figures say their values and
// zoom, tables copy as CSV, and the contents show where the reader is.
(() => {
  document.documentElement.classList.add("ready"); // see the style of sections
  const all = (selector, root = document) => Array.from(root.querySelectorAll(selector));
  const reveal = (element) => {
    for (let fold = element.closest("details"); fold; fold = fold.parentElement.closest("details")) fold.open = true;
    element.scrollIntoView();
  };
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
  const { abs, ceil, floor, hypot, log10, max, min } = Math;
  const AREA = /band|steps/;
  // Coordinates, of which 20 are a pixel, from the pointer to what it points at.
  const GRAB = 480;
  const tip = document.createElement("div");
  tip.className = "tip";
  tip.hidden = true;
  tip.setAttribute("role", "status");
  document.body.append(tip);
  const box = (element) => element.getBoundingClientRect();
  const get = (element, name) => element.getAttribute(name);
  const set = (element, pairs) => { Object.entries(pairs).forEach(([name, each]) => element.setAttribute(name, each)); return element; };
  // What is pointed at and framed lies above the plot in a picture of its own: the plot is not painted again.
  const made = (name) => document.createElementNS("http://www.w3.org/2000/svg", name);
  const over = set(made("svg"), { class: "over", "aria-hidden": true });
  const [ring, frame] = ["pointed", "frame"].map((name) => set(made("path"), { class: name }));
  over.append(ring, frame);
  document.body.append(over);
  let keys = false;
  const order = (pair) => pair.sort((p, q) => p - q);
  const within = (v, ends) => { const [low, high] = order([...ends]); return min(high, max(low, v)); };
  const shown = (v, step) => {
    const size = abs(v);
    if (size && (size >= 1e7 || step < 1e-5)) {
      const [digits, power] = v.toExponential(3).split("e");
      return `${+digits}·10${String(+power).replace(/./g, (c) => (c === "-" ? "⁻" : superscripts[c]))}`.replace("-", "−");
    }
    const decimals = min(8, max(0, ceil(-log10(step) - 1e-6)));
    return v.toLocaleString("en", { minimumFractionDigits: decimals, maximumFractionDigits: decimals }).replace("-", "−");
  };
  const ticksOf = (low, high, log, most) => {
    const found = [];
    if (log && high / low > 30) {
      for (let v = 10 ** ceil(log10(low)); v <= high; v *= 10) found.push([v, v]);
      return found;
    }
    const power = 10 ** floor(log10((high - low) / most));
    const factor = [1, 2, 2.5, 5, 10].find((each) => high - low <= most * each * power * 1.000001);
    const step = factor * power;
    for (let k = ceil(low / step - 1e-6); k * step <= high + 1e-6 * step; k += 1) found.push([k * step + 0, factor === 2.5 ? power / 2 : step]);
    return found;
  };
  // A number with significant digits, as mcnav.report.format.number writes it.
  const number = (v, digits = 4) => {
    if (!Number.isFinite(v)) return v > 0 ? "∞" : "–";
    if (!v) return "0";
    const power = floor(log10(abs(v)) + 1e-12);
    if (power >= digits + 2 || power < -4) {
      const [mantissa, exponent] = v.toExponential(digits - 1).split("e");
      return `${mantissa}·10${String(+exponent).replace(/./g, (c) => (c === "-" ? "⁻" : superscripts[c]))}`.replace("-", "−");
    }
    const decimals = max(0, digits - 1 - power);
    return v.toLocaleString("en", { minimumFractionDigits: decimals, maximumFractionDigits: decimals }).replace("-", "−");
  };

  // Units and multiples of sigma that the reader chooses; all are factors. Of each unit: its size, and what it becomes.
  const DEGREE = Math.PI / 180;
  const UNITS = {
    m: [1, "m", "ft"], km: [1e3, "m", "NM"], ft: [0.3048, "m", "ft"], mi: [1609.344, "m", "NM"], nmi: [1852, "m", "NM"], NM: [1852, "m", "NM"],
    "m/s": [1, "m/s", "kt"], "km/s": [1e3, "m/s", "kt"], "km/h": [1 / 3.6, "m/s", "kt"], "ft/s": [0.3048, "m/s", "kt"], kt: [1852 / 3600, "m/s", "kt"],
    rad: [1, "rad", "deg"], mrad: [1e-3, "rad", "deg"], urad: [1e-6, "rad", "deg"], deg: [DEGREE, "rad", "deg"], arcmin: [DEGREE / 60, "rad", "deg"], arcsec: [DEGREE / 3600, "rad", "deg"],
    "rad/s": [1, "rad/s", "deg/h"], "deg/s": [DEGREE, "rad/s", "deg/h"], "deg/h": [DEGREE / 3600, "rad/s", "deg/h"], meru: [7.292115e-8, "rad/s", "deg/h"],
    "m/s²": [1, "m/s²", "mg"], "m/s^2": [1, "m/s²", "mg"], g: [9.80665, "m/s²", "mg"], mg: [9.80665e-3, "m/s²", "mg"], ug: [9.80665e-6, "m/s²", "mg"],
  };
  const SYSTEMS = { own: "as computed", SI: "SI", aviation: "aviation" };
  const SIGMAS = { 1: ["1σ", "one sigma"], 3: ["3σ", "three sigma"], 1.959963985: ["95 %", "1.96 sigma (95 % of normal errors)"] };
  const UPRIGHT = /altitude|height|down|vertical/i;
  const convention = { system: "own", sigma: 1, changed: new EventTarget(),
    get words() { return SIGMAS[this.sigma][1]; },
    // The unit that one becomes, and by which factor its numbers; words tell heights, which are in feet.
    unit(unit, words = "") {
      const known = Object.hasOwn(UNITS, unit) && this.system !== "own" && UNITS[unit];
      if (!known) return [unit, 1];
      const chosen = known[this.system === "SI" ? 1 : 2];
      const target = chosen === "NM" && UPRIGHT.test(words) ? "ft" : chosen;
      return [target, target === unit ? 1 : known[0] / UNITS[target][0]];
    },
    text: (own, v, factor) => (factor === 1 || !v ? own : number(v * factor, own.split("·")[0].replace(/\D/g, "").replace(/^0+/, "").length || 4)) };

  // The instant that all figures over one time show together, as a line in each: who moves it sets the link of their axes.
  // Figures ask for another instant; zoom is the part of the time that they show.
  const clock = { link: "", at: NaN, zoom: null, everywhere: false, events: new EventTarget(),
    tell(name) { this.events.dispatchEvent(new Event(name)); },
    ask(at) { this.asked = at; this.tell("ask"); } };

  const axisOf = (svg, name) => {
    const [low, high, from, to, log] = get(svg, `data-${name}`).split(" ").map(Number);
    const [bent, straight] = log ? [log10, (v) => 10 ** v] : [(v) => v, (v) => v];
    const [a, b] = [bent(low), bent(high)];
    const group = svg.querySelector(`g.${name}`);
    const [unit, label] = ["unit", "label"].map((each) => get(svg, `data-${name}-${each}`));
    const title = all(":scope > text", svg).find(({ textContent: each }) => each && (each === `${label} (${unit})` || each === unit));
    return { from, to, log, group, before: group.innerHTML, texts: all("text", group).map(({ textContent: each }) => each), whole: [from, to], window: [from, to],
      named: svg.hasAttribute(`data-${name}-names`), label, unit, factor: 1,
      // Write the axis in the units that are chosen; the words of the panel tell heights.
      convert() {
        if (this.named) return;
        [this.unit, this.factor] = convention.unit(unit, `${label} ${get(svg, "aria-label").split(": ").pop()}`);
        if (title) title.textContent = label ? `${label} (${this.unit})` : this.unit;
      },
      value: (at) => straight(a + (b - a) * (at - from) / (to - from)), at: (v) => from + (to - from) * (bent(v) - a) / (b - a),
      get scale() { return (to - from) / (this.window[1] - this.window[0]); },
      get all() { return this.window.every((end, n) => end === this.whole[n]); },
      place(at) { return from + (at - this.window[0]) * this.scale; },
      origin(place) { return this.window[0] + (place - from) / this.scale; },
      text(at) {
        const off = (each) => abs(get(each, "y") - at);
        if (this.named) return all("text", group).sort((p, q) => off(p) - off(q))[0].textContent;
        const [first, last] = this.window.map((end) => this.factor * this.value(end));
        const v = this.factor * this.value(at);
        return `${shown(v, 10 ** floor(log10((log ? v : abs(last - first)) / 500)))} ${this.unit}`.trim();
      } };
  };
  const plots = all("figure .plot").map((plot) => {
    const svg = plot.querySelector("svg");
    const axes = [axisOf(svg, "x"), axisOf(svg, "y")];
    const [x, y] = axes;
    const size = svg.viewBox.baseVal;
    const cover = () => {
      const own = box(svg);
      set(over, { viewBox: get(svg, "viewBox"), style: `left:${own.left + scrollX}px;top:${own.top + scrollY}px;width:${own.width}px` });
      return own;
    };
    const key = (path) => {
      const name = /series-(.+)/.exec(get(path.closest("[class*=series-]") || path, "class"));
      return name && plot.closest("figure").querySelector(`[data-series="${name[1]}"]`);
    };
    // What there is to point at, once somebody points.
    let read = null;
    const marks = () => {
      if (!read) {
        all(".marks title", svg).forEach((title) => { title.parentNode.dataset.tip = title.textContent; title.remove(); });
        read = all(".marks path:is(.line, .points, .band, .steps)", svg).map((path) => {
          let [px, py] = [0, 0];
          const points = [];
          for (const [, command, a, b] of (path.dataset.d || get(path, "d")).matchAll(PAIR)) {
            [px, py] = command === "M" ? [+a, +b] : [px + +a, py + +b];
            if (command === "M" || !("fixed" in path.dataset)) points.push([px, py]);
          }
          const kind = path.classList[0];
          const along = AREA.test(kind) || (kind === "line" && points.every(([at], k) => !k || at >= points[k - 1][0]));
          return { path, points, kind, along };
        });
      }
      return read.filter(({ path }) => path.getClientRects().length);
    };
    const nearest = (mark, at) => {
      const { points, kind, along } = mark;
      if (AREA.test(kind)) {
        const k = points.findIndex(([px]) => px > at[0]) - 1;
        return k < 0 ? null : { mark, point: points[k], other: points[kind === "band" ? points.length - 1 - k : k + 1] };
      }
      let [best, least] = [null, GRAB];
      points.forEach((p) => {
        const far = hypot((p[0] - at[0]) * x.scale, along ? 0 : (p[1] - at[1]) * y.scale);
        if (far < least) [best, least] = [p, far];
      });
      return best && { mark, point: best, least };
    };
    const row = (text, path) => {
      const line = document.createElement("div");
      const entry = path && key(path);
      if (entry) line.append(entry.querySelector(".swatch").cloneNode());
      line.append(text);
      return line;
    };
    const say = (rows, places) => {
      tip.replaceChildren(...rows);
      tip.hidden = !rows.length;
      const shownAt = (places || []).map(([a, b]) => [x.place(a), y.place(b)]);
      set(ring, { d: shownAt.map(([a, b]) => `M${a - 80} ${b}a80 80 0 1 0 160 0a80 80 0 1 0-160 0`).join("") });
      if (!rows.length) return;
      const own = cover();
      const left = own.left + (shownAt[0][0] / size.width) * own.width + 14;
      const top = own.top + (shownAt[0][1] / size.height) * own.height - tip.offsetHeight - 10;
      const wide = tip.offsetWidth;
      tip.style.left = `${max(4, left + wide + 4 > document.documentElement.clientWidth ? left - wide - 28 : left)}px`;
      tip.style.top = `${scrollY + max(4, top)}px`;
    };
    const named = ({ path }) => key(path)?.textContent || y.label;
    const told = ({ mark, point, other }) => {
      const bin = mark.kind === "steps" ? `, ${x.text(point[0])} to ${x.text(other[0])}` : "";
      return row(`${named(mark)}${bin}: ${y.text(point[1])}${other && !bin ? ` to ${y.text(other[1])}` : ""}`, mark.path);
    };
    const one = (mark, [a, b]) => say([row(named(mark), mark.path), row(`${x.label} ${x.text(a)}`), row(`${y.label} ${y.text(b)}`)], [[a, b]]);
    const point = (at, target) => {
      const found = marks().map((mark) => nearest(mark, at)).filter(Boolean);
      const tipped = target.closest("[data-tip]");
      const text = tipped?.dataset.tip;
      const shade = text && tipped.classList.contains("shade");
      const dot = found.filter(({ mark }) => !mark.along).sort((p, q) => p.least - q.least)[0];
      const curves = found.filter(({ mark }) => mark.along);
      const exact = curves.filter(({ least }) => least !== undefined).map((each) => each.point);
      if (text && !shade) say([row(text, target)], [at]);
      else if (dot && (!curves.length || dot.least < GRAB / 2)) one(dot.mark, dot.point);
      else if (curves.length) say([row(`${x.label} ${x.text((exact[0] || at)[0])}`), ...curves.map(told), ...(shade ? [row(text, target)] : [])], exact.length ? exact : [at]);
      else if (shade) say([row(text, target)], [at]);
      else say([]);
    };

    // Zoom: a part of each axis, of linked x axes the same one.
    const again = button("Whole range", () => reset());
    const ticks = (axis) => {
      const { group } = axis;
      const [grid, like] = [group.querySelector(".grid"), group.querySelector("text")];
      if (axis.named || !grid || !like) return;
      if (axis.all && axis.factor === 1) { group.innerHTML = axis.before; return; }
      const up = axis === y;
      const found = ticksOf(...axis.window.map((end) => axis.factor * axis.value(end)), axis.log, max(2, floor(abs(axis.to - axis.from) / (up ? 680 : 1100))));
      const places = found.map(([v]) => axis.place(axis.at(v / axis.factor)));
      const widest = (texts) => max(1, ...texts.map((each) => each.length)) + 0.5;
      const narrow = up ? max(0.6, min(1, widest(axis.texts) / widest(found.map(([v, step]) => shown(v, step))))) : 1;
      set(grid, { d: places.map((p) => (up ? `M${x.from} ${p}H${x.to}` : `M${p} ${y.from}V${y.to}`)).join("") });
      group.replaceChildren(grid, ...found.map(([v, step], k) => {
        const text = set(like.cloneNode(), { [up ? "y" : "x"]: places[k] + (up ? 80 : 0), ...(narrow < 1 ? { "font-size": get(svg, "font-size") * narrow } : {}) });
        text.textContent = shown(v, step);
        return text;
      }));
    };
    const redraw = () => {
      marks();
      const same = x.all && y.all;
      const n = (v) => +v.toFixed(2);
      all(".marks path, .marks text, .labels text", svg).forEach((each) => {
        const { dataset, tagName } = each;
        if (tagName === "text") {
          dataset.at ||= `${get(each, "x")} ${get(each, "y")}`;
          const [a, b] = dataset.at.split(" ").map(Number);
          set(each, { x: n(x.place(a)), y: n(y.place(b)) });
          each.style.visibility = x.place(a) < x.from - 40 || x.place(a) > x.to + 40 ? "hidden" : "";
        } else {
          const d = dataset.d ||= get(each, "d");
          const fixed = "fixed" in dataset;
          set(each, { d: same ? d : d.replace(PAIR, (pair, c, a, b) => (c === "M" ? `M${n(x.place(+a))} ${n(y.place(+b))}`
            : fixed ? pair : `${c}${n(a * x.scale)} ${n(b * y.scale)}`)) });
        }
      });
      axes.forEach(ticks);
      line();
      if (same) again.remove(); else plot.append(again);
    };
    const cursor = set(made("path"), { class: "cursor" });
    const moved = svg.dataset.link && plot.closest("figure").querySelector(":scope > script");
    const timed = () => clock.link && svg.dataset.link === clock.link;
    const line = () => {
      if (!timed() || !(moved || clock.everywhere)) return;
      const at = x.place(x.at(clock.at));
      set(cursor, { d: at < x.from - 1 || at > x.to + 1 ? "" : `M${at.toFixed(1)} ${y.from}V${y.to}` });
      svg.append(cursor);
    };
    clock.events.addEventListener("move", line);
    convention.changed.addEventListener("change", () => {
      axes.forEach((axis) => { axis.convert(); ticks(axis); });
    });
    const self = { link: svg.dataset.link, svg, x, y,
      // Put a curve through points in the units of the axes, or a dot at a single one, in place of a mark.
      shape(path, points) {
        const [first, ...others] = points.map(([a, b]) => [Math.round(x.at(a)), Math.round(y.at(b))]);
        let [px, py] = first;
        const d = `M${px} ${py}${others.map(([a, b]) => { const step = `l${a - px} ${b - py}`; [px, py] = [a, b]; return step; }).join("") || "h0"}`;
        path.dataset.d = d;
        set(path, { d });
        read = null;
      },
      redraw: () => { if (!(x.all && y.all)) redraw(); },
      window(limits, own = false) {
        if (timed()) { clock.zoom = limits; clock.tell("zoom"); }
        const found = limits ? limits.map((v) => within(x.at(v), x.whole)) : x.whole;
        if (found[1] - found[0] > 1) x.window = found;
        if (!limits) y.window = y.whole;
        else if (!own) fit();
        redraw();
      } };
    // After a zoom in time the other axis fits what is to be seen, but in the plot whose frame the reader has drawn.
    const fit = () => {
      if (y.named || "even" in svg.dataset) return;
      const seen = marks().flatMap(({ points }) => points.filter(([at]) => at === within(at, x.window)).map(([, b]) => b));
      const [low, high] = seen.reduce(([a, b], v) => [min(a, v), max(b, v)], [Infinity, -Infinity]);
      if (!(high - low > abs(y.to - y.from) / 200)) return;
      const room = 0.06 * (high - low);
      const ends = [within(low - room, y.whole), within(high + room, y.whole)];
      y.window = y.from > y.to ? ends.reverse() : ends;
    };
    const together = (limits) => plots.filter((each) => each === self || (self.link && each.link === self.link)).forEach((each) => each.window(limits, each === self));
    const show = (across, upward) => {
      if (x.named) return;
      if ("even" in svg.dataset) { // one scale for both axes
        const wide = max(...axes.map((axis, n) => abs([across, upward][n][1] - [across, upward][n][0]) / abs(axis.to - axis.from)));
        [across, upward] = axes.map((axis, n) => {
          const [middle, half] = [([across, upward][n][0] + [across, upward][n][1]) / 2, wide * (axis.to - axis.from) / 2];
          return [middle - half, middle + half];
        });
      }
      const enough = (axis, [a, b]) => abs(b - a) > abs(axis.to - axis.from) / 2000;
      if (!y.named && enough(y, upward)) y.window = upward;
      if (enough(x, across)) together(across.map(x.value));
    };
    const reset = () => { say([]); together(null); };
    const closer = (at, factor) => show(...axes.map((axis, n) => axis.window.map((end) => within(at[n] + (end - at[n]) / factor, axis.whole))));

    // Pointer: values under it, a frame drawn with it, closer and farther by the wheel with the control key.
    const under = ({ clientX, clientY }) => {
      const own = box(svg);
      return [((clientX - own.left) / own.width) * size.width, ((clientY - own.top) / own.height) * size.height];
    };
    const origin = (at) => axes.map((axis, n) => axis.origin(at[n]));
    let [begun, dragged, waiting] = [null, false, 0];
    const grabs = (at, touch) => timed() && (touch ? Boolean(moved) : abs(x.place(x.at(clock.at)) - at[0]) < 160 && Boolean(cursor.parentNode));
    const drag = (at) => clock.ask(x.value(within(x.origin(at[0]), x.window)));
    const framed = (end) => axes.map((axis, n) => order(n && (y.named || abs(end[1] - begun[1]) < 300) ? [...y.whole]
      : [begun[n], end[n]].map((v) => within(v, axis.whole))));
    const on = (name, action, options) => svg.addEventListener(name, action, options);
    const stop = () => { begun = null; set(frame, { d: "" }); };
    on("pointermove", (event) => {
      if (!event.movementX && !event.movementY) return;
      keys = false;
      cancelAnimationFrame(waiting);
      waiting = requestAnimationFrame(() => {
        if (dragged) { drag(under(event)); return; }
        if (!begun) { point(origin(under(event)), event.target); return; }
        const [[a, c], [b, d]] = framed(under(event));
        set(frame, { d: `M${a} ${b}H${c}V${d}H${a}z` });
      });
    });
    on("pointerleave", () => {
      cancelAnimationFrame(waiting);
      if (!keys && !begun) say([]);
    });
    on("pointerdown", (event) => {
      const at = under(event);
      if (!event.button && grabs(at, event.pointerType !== "mouse")) {
        say([]);
        dragged = true;
        svg.setPointerCapture(event.pointerId);
        drag(at);
      } else if (event.pointerType !== "mouse") point(origin(at), event.target);
      else if (!event.button && !x.named && at[0] === within(at[0], x.whole)) {
        say([]);
        begun = at;
        cover();
        svg.setPointerCapture(event.pointerId);
      }
    });
    on("pointercancel", () => { dragged = false; });
    on("pointerup", (event) => {
      if (dragged) { dragged = false; return; }
      if (!begun) return;
      if (timed() && hypot(...under(event).map((v, n) => v - begun[n])) < 60) drag(begun); // a click
      const [across, upward] = framed(under(event));
      stop();
      if (across[1] - across[0] > 120) show(across.map((v) => x.origin(v)), (y.from > y.to ? upward.reverse() : upward).map((v) => y.origin(v)));
    });
    on("dblclick", reset);
    on("wheel", (event) => {
      if (!event.ctrlKey) return;
      event.preventDefault();
      closer(origin(under(event)), event.deltaY < 0 ? 1.25 : 0.8);
    }, { passive: false });
    if (!x.named) svg.classList.add("zoomable");

    // Keyboard: from value to value, from series to series, closer and farther.
    let [series, k] = [0, -1];
    set(plot, { tabindex: 0, role: "group", "aria-label": `${get(svg, "aria-label")}. Arrow keys: values; plus, minus, 0: zoom` });
    plot.addEventListener("keydown", (event) => {
      if (event.target !== plot || event.altKey || event.ctrlKey) return;
      const turn = { ArrowRight: [1, 0], ArrowLeft: [-1, 0], ArrowDown: [0, 1], ArrowUp: [0, -1] }[event.key];
      const factor = { "+": 1.5, "=": 1.5, "-": 1 / 1.5 }[event.key];
      keys = true;
      if (turn) {
        const curves = marks().filter(({ kind, points }) => points.length && !AREA.test(kind));
        const texts = all("[data-tip]", svg).filter((each) => each.getClientRects().length);
        series = (series + turn[1] + curves.length) % (curves.length || 1);
        const from = curves.length ? curves[series].points : texts;
        if (!from.length) return;
        k = within(k + turn[0] * (event.shiftKey ? 10 : 1), [0, from.length - 1]);
        if (curves.length) one(curves[series], from[k]);
        else {
          const own = from[k].getBBox();
          say([row(from[k].dataset.tip, from[k])], [origin([own.x + own.width / 2, own.y])]);
        }
      } else if (factor) closer(axes.map(({ window: [a, b] }) => (a + b) / 2), factor);
      else if (event.key === "0" || event.key === "Escape") reset();
      else return;
      event.preventDefault();
    });
    plot.addEventListener("blur", () => say([]));
    return self;
  });

  // Switches: tables whose rows have one unit, and axes, follow; what has its unit beside it in words stays. Remembered.
  const [own, captions] = [new Map(), new Map()];
  const textsOf = (element) => {
    const [walker, found] = [document.createTreeWalker(element, NodeFilter.SHOW_TEXT), []];
    while (walker.nextNode()) found.push(walker.currentNode);
    return found;
  };
  const originally = (element) => own.get(element) ?? own.set(element, element.textContent).get(element);
  const convertTables = () => {
    all("tr:has([data-unit])").forEach((row) => {
      const unit = row.querySelector("[data-unit]");
      const [shownIn, factor] = convention.unit(unit.dataset.unit, row.cells[0].textContent);
      unit.textContent = shownIn;
      all("data", row).forEach((each) => {
        const multiple = each.classList.contains("sigma") ? convention.sigma : 1;
        each.textContent = convention.text(originally(each), Number(each.value), factor * multiple);
      });
    });
    all("table:has(data.sigma)").forEach((table) => {
      const { words } = convention;
      const caption = table.querySelector("caption span");
      if (!caption) return;
      if (!captions.has(caption)) {
        const named = textsOf(caption).find((each) => /one sigma/i.test(each.data));
        if (!named) caption.append(" ");
        captions.set(caption, named ?? caption.appendChild(document.createTextNode("")));
      }
      const place = captions.get(caption);
      if (!own.has(place)) own.set(place, place.data);
      const before = own.get(place);
      const begun = before[0] === "O" ? words[0].toUpperCase() + words.slice(1) : words;
      place.data = convention.sigma === 1 ? before : before ? before.replace(/one sigma/i, begun) : `Sigmas are shown as ${words}.`;
    });
  };
  // Quantities in sentences: a number, or two as an interval, with its unit behind it; at least three digits.
  const NUMBER = "[−±]?\\d[\\d.,]*(?:·10[⁻⁰¹²³⁴⁵⁶⁷⁸⁹]+)?";
  const NAMES = Object.keys(UNITS).sort((p, q) => q.length - p.length).map((each) => each.replace(/[.^]/g, "\\$&")).join("|");
  const QUANTITY = new RegExp(`(?<![\\w.,])(?:(${NUMBER})( to | → ))?(${NUMBER})(\\s)(${NAMES})(?![\\w²/^·])`, "g");
  const reworded = (text, about) => text.replace(QUANTITY, (whole, low, between, high, gap, unit) => {
    const [target, factor] = convention.unit(unit, about);
    if (factor === 1) return whole;
    const changed = (each) => {
      const sign = each[0] === "±" ? "±" : "";
      return sign + number(value(each.slice(sign.length)) * factor, max(3, each.split("·")[0].replace(/\D/g, "").replace(/^0+/, "").length));
    };
    return `${low ? changed(low) + between : ""}${changed(high)}${gap}${target}`;
  });
  const convertWords = (root = document) => all(".tile, .asked li, .shows, #requirements td, #requirements th[scope=row]", root).forEach((part) => {
    const about = part.textContent;
    textsOf(part).forEach((text) => {
      if (!text.parentElement.closest("data, .sort")) text.data = reworded(originally(text), about);
    });
  });
  convention.reword = (element, words) => {
    element.textContent = words;
    textsOf(element).forEach((text) => { text.data = reworded(originally(text), words); });
  };
  const stored = (name, chosen) => {
    try {
      if (chosen === undefined) return localStorage.getItem(`mcnav-${name}`);
      localStorage.setItem(`mcnav-${name}`, chosen);
    } catch { /* a browser may refuse it to files */ }
    return null;
  };
  all(".switches").forEach((place) => {
    const choice = (legend, name, options, now, take) => {
      const set_ = document.createElement("fieldset");
      const title = document.createElement("legend");
      title.textContent = legend;
      set_.append(title, ...options.map(([value_, words]) => {
        const input = set(document.createElement("input"), { type: "radio", name, value: value_ });
        input.checked = value_ === now;
        input.addEventListener("change", () => { take(value_); stored(name, value_); apply(); });
        const label = document.createElement("label");
        label.append(input, words);
        return label;
      }));
      return set_;
    };
    const stays = set(document.createElement("p"), { class: "stays", role: "status" });
    const apply = () => {
      stays.textContent = convention.sigma === 1 ? "" : "In sentences and figures sigma is 1σ, unless they name another multiple.";
      convertTables(); convertWords(); convention.changed.dispatchEvent(new Event("change"));
    };
    const [sigma, system] = [stored("sigma"), stored("units")];
    if (sigma in SIGMAS) convention.sigma = Number(sigma);
    if (system in SYSTEMS) convention.system = system;
    place.append(choice("Sigmas in tables", "sigma", ["1", "3", "1.959963985"].map((each) => [each, SIGMAS[each][0]]), String(convention.sigma), (each) => { convention.sigma = Number(each); }),
      choice("Units", "units", Object.entries(SYSTEMS), convention.system, (each) => { convention.system = each; }), stays);
    if (convention.sigma !== 1 || convention.system !== "own") queueMicrotask(apply); // once the words of the glossary have their places
  });

  // Glossary: words have their meaning under the pointer, and the first of each in a section by keyboard and touch, too.
  all(".glossary script").forEach((place) => {
    const meanings = JSON.parse(place.textContent);
    const keys_ = Object.keys(meanings);
    const word = new RegExp(`(?<!\\b[A-Z]\\. )\\b(${keys_.join("|")})(?=s?\\b)`, "gi"); // no surname after an initial
    const keyOf = (text) => keys_.find((each) => each === text || (each === each.toLowerCase() && each === text.toLowerCase()));
    const told = set(document.createElement("div"), { class: "meaning", role: "tooltip" });
    told.hidden = true;
    document.body.append(told);
    place.after(...keys_.map((key, k) => { // what screen readers say of a word
      const each = set(document.createElement("p"), { id: `meaning-${k}` });
      each.textContent = meanings[key];
      return each;
    }));
    let leaving = 0;
    const hide = () => { told.hidden = true; };
    const later = () => { leaving = setTimeout(hide, 200); };
    told.addEventListener("pointerenter", () => clearTimeout(leaving));
    told.addEventListener("pointerleave", later);
    document.addEventListener("keydown", ({ key }) => { if (key === "Escape") hide(); });
    const show = (element, key) => {
      clearTimeout(leaving);
      told.textContent = `${key}: ${meanings[key]}.`;
      told.hidden = false;
      const at = box(element);
      told.style.left = `${max(4, min(at.left, document.documentElement.clientWidth - told.offsetWidth - 4))}px`;
      told.style.top = `${scrollY + (at.top > told.offsetHeight + 8 ? at.top - told.offsetHeight - 4 : at.bottom + 4)}px`;
    };
    const pieces = (text, seen, inside) => {
      let from = 0;
      const made_ = [];
      for (const found of text.matchAll(word)) {
        const key = keyOf(found[0]);
        if (key) {
          const first_ = !inside && !seen.has(key);
          if (!inside) seen.add(key);
          const element = document.createElement(first_ ? "button" : "span");
          element.textContent = found[0];
          set(element, { class: "term", ...(first_ ? { type: "button", "aria-describedby": `meaning-${keys_.indexOf(key)}` } : {}) });
          element.addEventListener("pointerenter", () => show(element, key));
          element.addEventListener("pointerleave", later);
          if (first_) ["focus", "click"].forEach((each) => element.addEventListener(each, () => show(element, key)));
          if (first_) element.addEventListener("blur", hide);
          made_.push(text.slice(from, found.index), element);
          from = found.index + found[0].length;
        }
      }
      return made_.length ? [...made_, text.slice(from)] : null;
    };
    all("main > header, main section, .fold > :not(section, summary)").forEach((part) => {
      const seen = new Set();
      textsOf(part).filter((each) => each.data.trim() && !each.parentElement.closest("script, style, svg, math, code, pre, select, h1, .hidden, .switches, .key, .what-if, .live, details.data")).forEach((each) => {
        const made_ = pieces(each.data, seen, each.parentElement.closest("button, a, summary, label"));
        if (made_) each.replaceWith(...made_);
      });
    });
  });

  // Of many panels those that are chosen: the first ones, a single one, or all.
  all("[data-shown]").forEach((list) => {
    const panels = all(".plot", list);
    const first = Number(list.dataset.shown);
    const chosen = document.createElement("select");
    const named = (plot) => ["x", "y"].map((name) => get(plot.querySelector("svg"), `data-${name}-label`)).join(" and ");
    chosen.append(...[`the ${first} most correlated or most different`, ...panels.map(named), `all ${panels.length}`].map((text) => new Option(text)));
    const show = () => {
      const at = chosen.selectedIndex - 1;
      panels.forEach((plot, k) => { plot.hidden = at < 0 ? k >= first : at < panels.length && k !== at; });
      list.classList.toggle("one", at >= 0 && at < panels.length);
    };
    const label = document.createElement("label");
    label.append("Show ", chosen);
    const line = document.createElement("p");
    line.className = "choice";
    line.append(label);
    list.before(line);
    chosen.addEventListener("change", show);
    show();
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
  // A campaign file with a remedy.
  all("[data-toml]").forEach((copy) => {
    copy.hidden = false;
    copy.addEventListener("click", async () => {
      await copied(copy.dataset.toml);
      copy.textContent = "Copied";
      setTimeout(() => { copy.textContent = "Copy TOML"; }, 2000);
    });
  });
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

  // Runs that are ticked, in the order of the ticks: the command that compares them, and the page if there is one.
  all("[data-compare]").forEach((place) => {
    const pages = JSON.parse(place.dataset.compare);
    let chosen = [];
    const show = () => {
      place.replaceChildren();
      if (chosen.length < 2) return;
      const code = document.createElement("code");
      code.textContent = `mcnav compare ${chosen.map((each) => each.value).join(" ")} --out ${place.dataset.out}`;
      const names = (count) => chosen.map(({ dataset }) => dataset.folder.split("/").slice(-count).join("-"));
      let count = 1; // of the last parts of the folders, as many as tell them apart
      while (count < 9 && new Set(names(count)).size < chosen.length) count += 1;
      const page = pages[`${names(count).join("_and_")}.html`];
      const link = document.createElement("a");
      if (page) { link.href = page; link.textContent = "the comparison"; }
      place.append(...(page ? [link, " · "] : []), code, place.dataset.where ? ` ${place.dataset.where}` : "");
    };
    all("input.pick").forEach((box) => {
      box.hidden = box.checked = false;
      box.addEventListener("change", () => {
        chosen = box.checked ? [...chosen, box] : chosen.filter((each) => each !== box);
        show();
      });
    });
  });

  // Folds: a link to what is in a fold opens it, and the contents list the sections of open folds alone.
  const fold_ = (name) => all("nav.contents > ul > li").find((item) => item.firstElementChild.hash === `#${name}`);
  all("details.fold").forEach((fold) => {
    const inside = fold_(fold.id)?.querySelector("ul");
    if (!inside) return;
    inside.hidden = !fold.open;
    fold.addEventListener("toggle", () => { inside.hidden = !fold.open; });
  });
  const follow = () => {
    const target = location.hash && document.getElementById(decodeURIComponent(location.hash.slice(1)));
    if (target) reveal(target);
  };
  all('a[href^="#"]').forEach((link) => link.addEventListener("click", () => queueMicrotask(() => { if (link.hash === location.hash) follow(); })));
  window.addEventListener("hashchange", follow);
  follow();

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
