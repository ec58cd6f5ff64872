  // What if: numbers of the data sheet are multiplied, and the linear covariance is summed anew. Of the page's script it
  // uses `all`, `button`, `convention`, `copied`, `get`, `number`, `set`, `made` and `ticksOf`. Equations are those of mcnav.analysis.what_if.

  // The error function: Taylor series of fourth order about the nearest of values 1/128 apart, good to 1e-13.
  const erf = (() => {
    const [step, density] = [1 / 128, (x) => Math.exp(-x * x) * 2 / Math.sqrt(Math.PI)];
    const values = [0];
    for (let n = 1; n <= 832; n += 1) { // Simpson's rule, four parts a step
      const at = (part) => density((n - 1 + part / 8) * step);
      values.push(values[n - 1] + step / 24 * (at(0) + 4 * (at(1) + at(3) + at(5) + at(7)) + 2 * (at(2) + at(4) + at(6)) + at(8)));
    }
    return (x) => {
      const size = abs(x);
      if (size >= 6.4) return Math.sign(x);
      const n = Math.round(size / step);
      const [a, d] = [n * step, size - n * step];
      return Math.sign(x) * (values[n] + density(a) * d * (1 - a * d + (2 * a * a - 1) * d * d / 3 + a * (3 - 2 * a * a) * d * d * d / 6));
    };
  })();

  // Nodes and weights of Gauss and Legendre.
  const RULE = ((count) => Array.from({ length: count }, (_, k) => {
    let [x, slope] = [Math.cos(Math.PI * (k + 0.75) / (count + 0.5)), 0];
    for (let turn = 0; turn < 20; turn += 1) {
      let [p, before] = [1, 0];
      for (let n = 1; n <= count; n += 1) [p, before] = [((2 * n - 1) * x * p - (n - 1) * before) / n, p];
      slope = count * (x * p - before) / (x * x - 1);
      x -= p / slope;
    }
    return [x, 2 / ((1 - x * x) * slope * slope)];
  }))(48);
  const integral = (low, high, f) => (high > low ? (high - low) / 2 * RULE.reduce((sum, [x, w]) => sum + w * f((low + high) / 2 + (high - low) / 2 * x), 0) : 0);
  const bell = (z) => Math.exp(-z * z / 2) / Math.sqrt(2 * Math.PI);
  const interval = (half, centre, sigma) => (sigma > 0 ? (erf((half - centre) / sigma / Math.SQRT2) + erf((half + centre) / sigma / Math.SQRT2)) / 2 : +(abs(centre) < half));

  // Principal axes of a covariance by Jacobi's rotations: sigmas, the least first, and the mean along each.
  const principal = (mean, covariance) => {
    const [a, m] = [covariance.map((row) => [...row]), [...mean]];
    for (let sweep = 0; sweep < 12; sweep += 1) {
      for (let p = 0; p < m.length; p += 1) {
        for (let q = p + 1; q < m.length; q += 1) {
          if (a[p][q]) {
            const angle = Math.atan2(2 * a[p][q], a[q][q] - a[p][p]) / 2;
            const [c, s] = [Math.cos(angle), Math.sin(angle)];
            a.forEach((row) => { [row[p], row[q]] = [c * row[p] - s * row[q], s * row[p] + c * row[q]]; });
            [a[p], a[q]] = [a[p].map((v, k) => c * v - s * a[q][k]), a[p].map((v, k) => s * v + c * a[q][k])];
            [m[p], m[q]] = [c * m[p] - s * m[q], s * m[p] + c * m[q]];
          }
        }
      }
    }
    return m.map((centre, k) => [Math.sqrt(max(a[k][k], 0)), centre]).sort((p, q) => p[0] - q[0]);
  };
  // Probability of a distance up to a radius: along the lesser axes in the angle that makes the chord smooth.
  const withinRadius = (radius, [[sigma, centre], ...others]) => {
    if (!others.length) return interval(radius, centre, sigma);
    if (sigma <= 1e-7 * others[others.length - 1][0]) return abs(centre) < radius ? withinRadius(Math.sqrt(radius ** 2 - centre ** 2), others) : 0;
    const angle = (at) => Math.asin(min(1, max(-1, at / radius)));
    return integral(angle(centre - 9 * sigma), angle(centre + 9 * sigma), (t) => {
      const chord = radius * Math.cos(t);
      return bell((radius * Math.sin(t) - centre) / sigma) / sigma * chord * withinRadius(chord, others);
    });
  };
  // Root of a rising function between two ends, by the Illinois method.
  const root = (f, low, high) => {
    let [[a, fa], [b, fb]] = [[low, f(low)], [high, f(high)]];
    for (let turn = 0; turn < 80 && abs(b - a) > 1e-12 * b; turn += 1) {
      const x = (a * fb - b * fa) / (fb - fa);
      const value = f(x);
      if (value * fb <= 0) [a, fa] = [b, fb]; else fa /= 2;
      [b, fb] = [x, value];
      if (!value) break;
    }
    return b;
  };
  const scale = (mean, covariance) => Math.sqrt(mean.reduce((sum, v, k) => sum + v * v + covariance[k][k], 0));
  const quantileOf = (mean, covariance, probability) => {
    const [size, axes] = [scale(mean, covariance), principal(mean, covariance)];
    if (!axes[axes.length - 1][0]) return size;
    let high = 2 * size;
    while (withinRadius(high, axes) < probability) high *= 2;
    return root((radius) => (radius ? withinRadius(radius, axes) : 0) - probability, 0, high);
  };
  // Probability of a box of at most three sides, one conditional on those before it.
  const withinBox = (limits, mean, covariance) => {
    const inside = (n, known, factor) => {
      if (n === limits.length) return 1;
      const centre = mean[n] + known.reduce((sum, z, k) => sum + factor[n][k] * z, 0);
      const sigma = factor[n][n];
      if (n === limits.length - 1) return interval(limits[n], centre, sigma);
      if (!sigma) return abs(centre) < limits[n] ? inside(n + 1, [...known, 0], factor) : 0;
      const [low, high] = [max(-9, (-limits[n] - centre) / sigma), min(9, (limits[n] - centre) / sigma)];
      const edges = [low, ...steps(n, known, factor).filter((z) => low < z && z < high).sort((p, q) => p - q), high];
      return edges.slice(1).reduce((sum, end, k) => sum + integral(edges[k], end, (z) => bell(z) * inside(n + 1, [...known, z], factor)), 0);
    };
    // Where the sides after one are passed within less than a sigma of it: the rule's nodes do not resolve a step.
    const steps = (n, known, factor) => limits.flatMap((limit, i) => {
      const slope = factor[i][n];
      const width = slope && Math.hypot(...factor[i].slice(n + 1)) / abs(slope);
      if (i <= n || !slope || width > 1) return [];
      const centre = mean[i] + known.reduce((sum, z, k) => sum + factor[i][k] * z, 0);
      return [-limit, limit].flatMap((side) => [-6, 0, 6].map((k) => (side - centre) / slope + k * width));
    });
    const factor = [];
    covariance.forEach((row, i) => {
      factor.push(row.map(() => 0));
      for (let j = 0; j <= i; j += 1) {
        const rest = row[j] - factor[j].slice(0, j).reduce((sum, v, k) => sum + v * factor[i][k], 0);
        factor[i][j] = i === j ? Math.sqrt(max(rest, 0)) : factor[j][j] && rest / factor[j][j];
      }
    });
    return inside(0, [], factor);
  };

  const [FOREMOST, MANY] = [6, 16]; // numbers that are not folded on a first screen, and where there are more than so many
  all(".what-if").forEach((root_) => {
    const data = JSON.parse(root_.querySelector("script").textContent);
    const { outputs, sliders, requirements } = data;
    const first_ = root_.classList.contains("first"); // on the first screen
    const brief_ = first_ || sliders.length > MANY; // what matters most, the rest folded
    const unmet = data.sampled ? "beyond" : "not met"; // of a bound of samples: it does not show the requirement
    const numbersIn = (text) => {
      const bytes = Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
      return new (data.wide ? Float64Array : Float32Array)(bytes.buffer);
    };
    const [count, width, last] = [data.readings, outputs.length, data.readings - 1];
    const terms = data.terms.map(([first, second, text]) => [first, second, numbersIn(text)]);
    const means = data.means.map(([number, text]) => [number, numbersIn(text)]);
    const [nominal, own] = [data.nominal, data.own].map((text) => text && numbersIn(text));
    const place = new Map(data.entries.map(([i, j], k) => [`${i} ${j}`, k]));
    const entry = (i, j) => place.get(i < j ? `${i} ${j}` : `${j} ${i}`);
    const factors = sliders.map(() => 1);

    // Moments with the numbers multiplied; of each number's share of a variance the part with others is half its own.
    const by = (k, number) => (number < 0 ? 1 : k[number]);
    const moments = (k) => {
      const covariance = new Float64Array(count * data.entries.length);
      terms.forEach(([first, second, values]) => {
        const factor = by(k, first) * by(k, second);
        values.forEach((v, n) => { covariance[n] += factor * v; });
      });
      const mean = new Float64Array(count * width);
      if (nominal) mean.set(nominal);
      means.forEach(([number, values]) => values.forEach((v, n) => { mean[n] += by(k, number) * v; }));
      return { covariance, mean };
    };
    const variance = (m, r, i) => max(m.covariance[r * data.entries.length + entry(i, i)], 0);
    const sigma = (m, r, i) => Math.sqrt(variance(m, r, i));
    // True over linear sigma at the end to second order; which outputs it marks.
    const bends = data.bends.map(([first, second, text]) => [first, second, numbersIn(text)]);
    const bent = (k, m, i) => {
      const added = bends.reduce((sum, [first, second, values]) => sum + (by(k, first) * by(k, second)) ** 2 * values[i], 0);
      return Math.sqrt(max(1 + (added / variance(m, last, i) || 0), 0));
    };
    const nonlinear = (k, m) => [...outputs.keys()].filter((i) => bends.length && abs(bent(k, m, i) - 1) > data.departure);
    const rms = (m, r, i) => hypot(sigma(m, r, i), m.mean[r * width + i]);
    const block = (m, r, members, origin) => [members.map((i, k) => m.mean[r * width + i] + (origin ? origin[k] : 0)),
      members.map((i) => members.map((j) => m.covariance[r * data.entries.length + entry(i, j)])),
      members.map((i, k) => (nominal ? nominal[r * width + i] : 0) + (origin ? origin[k] : 0))];
    const beyond = (m) => {
      for (let r = 0; r < count; r += 1) if (outputs.some(({ limit }, i) => limit && !(rms(m, r, i) <= limit))) return r;
      return count;
    };
    const shares = (m, k, i) => {
      const [parts, whole] = [sliders.map(() => 0), variance(m, last, i)];
      terms.forEach(([first, second, values]) => {
        const part = by(k, first) * by(k, second) * values[last * data.entries.length + entry(i, i)] / whole / 2;
        [first, second].filter((number) => number >= 0).forEach((number) => { parts[number] += part; });
      });
      return parts.map((part) => part || 0);
    };

    // Requirements: value, margin, and whether each is met. Linear errors are multiplied by what samples measured.
    const judged = (m, meaningless) => requirements.map(({ kind, members, origin, limits: allowed, probability, readings, measured }) => {
      const limits = allowed.map((limit) => limit / measured);
      if (readings.some((r) => r >= meaningless) || members.length > 3) return null;
      if (kind === "box") {
        const [mean, covariance, fixed] = block(m, last, members, origin && origin[0]);
        const at = (k) => withinBox(limits, mean.map((v, n) => fixed[n] + k * (v - fixed[n])), covariance.map((row) => row.map((v) => k * k * v)));
        const value = at(1);
        let [low, high] = [0, 1e9];
        for (let turn = 0; turn < 45; turn += 1) {
          const middle = Math.sqrt(max(low, 1e-9) * high);
          if (at(middle) < probability) high = middle; else low = middle;
        }
        return { value, margin: low > 9e8 ? Infinity : low, met: value >= probability };
      }
      let [value, worst] = [0, null];
      readings.map((r, n) => block(m, r, members, origin && origin[n])).sort((p, q) => scale(...q) - scale(...p)).forEach((each) => {
        const [mean, covariance] = each;
        if (worst && withinRadius(value, principal(mean, covariance)) >= probability) return;
        const quantile = quantileOf(mean, covariance, probability);
        if (!worst || quantile > value) [value, worst] = [quantile, each];
      });
      const [mean, covariance, fixed] = worst;
      const about = (k) => quantileOf(mean.map((v, n) => fixed[n] + k * (v - fixed[n])), covariance.map((row) => row.map((v) => k * k * v)), probability) - limits[0];
      let margin = value > 0 ? limits[0] / value : Infinity;
      if (fixed.some(Boolean)) {
        let high = margin;
        if (hypot(...fixed) >= limits[0]) margin = 0;
        else {
          while (about(high) < 0 && high < 1e9) high *= 2;
          margin = high < 1e9 ? root(about, 1e-9 * high, high) : Infinity;
        }
      }
      return { value: value * measured, margin, met: value < limits[0] };
    });

    // The page's parts.
    const make = (name, content, pairs = {}) => {
      const element = set(document.createElement(name), pairs);
      element.append(...[content].flat());
      return element;
    };
    const text = (v) => String(+v.toPrecision(12));
    const instant = (t) => {
      const [v, unit] = data.timeUnit === "min" && t && abs(t) < 0.995 ? [60 * t, "s"] : [t, data.timeUnit];
      const digits = number(+v.toFixed(v ? max(0, 2 - floor(log10(abs(v)))) : 0), 12);
      return `${digits.includes(".") ? digits.replace(/\.?0+$/, "") : digits} ${unit}`.trim();
    };
    const three = (v) => number(+v.toPrecision(3), 3); // 0.9999 is 1.00, not 1.000
    const brief = (v) => { // what a box has room for: the shorter of both forms, with five digits
      const [plain, power] = [String(+v.toPrecision(5)), (+v.toPrecision(5)).toExponential()];
      return plain.length > 8 && power.length < plain.length ? power : plain;
    };
    const unitOf = (unit) => make("span", unit ? [` ${unit}`] : [], { class: "unit" });
    const cells = (name, words) => words.map((each) => make(name, each));
    const heading = (words) => make("thead", make("tr", words.map((each) => make("th", each, { scope: "col" }))));
    const before = { k: [...factors], m: moments(factors) };
    before.beyond = beyond(before.m);
    before.judged = judged(before.m, before.beyond);

    const state = make("p", "", { class: first_ ? "state hidden" : "state", role: "status" }); // a banner says it
    const reset = button("Reset", () => { factors.fill(1); retuned = null; sliders.forEach((_, n) => rows[n].show()); update(); });
    let [retuned, doubted] = [null, []]; // sigmas over time of the filter that is re-tuned for the numbers, by output; those not shown to be linear
    const copy = button("Copy as TOML", async () => {
      await copied(toml());
      copy.textContent = "Copied";
      setTimeout(() => { copy.textContent = "Copy as TOML"; }, 2000);
    });
    [reset, copy].forEach((each) => { each.className = "copy"; });
    const chosen = make("select", outputs.map(({ name }) => make("option", name)));
    chosen.selectedIndex = requirements.length ? requirements[0].members[0] : outputs.findIndex((_, i) => sigma(before.m, last, i) > 0);

    // A row of each number: slider, marks of the grades, value, share.
    const rows = sliders.map((slider, n) => {
      const { path, sizes, shown: largest, grades, band } = slider;
      const [size, unit] = sizes[largest];
      const ends = [0.01, 100, ...grades.map(([, factor]) => factor), ...(band || []).filter((factor) => factor > 0)].map(log10);
      const [low, high] = [floor(min(...ends)), ceil(max(...ends))];
      const name = (brief_ ? path.split(".").slice(-2).join(" ") : path.split(".").pop()).replace(/_/g, " ");
      const id = `what-if-${n}`;
      const range = make("input", [], { type: "range", id, min: low, max: high, step: 0.02, "aria-label": path });
      const value = make("input", [], { type: "text", inputmode: "decimal", "aria-label": `${path}${unit ? ` in ${unit}` : ""}`, autocomplete: "off" });
      const at = (factor) => 100 * (log10(factor) - low) / (high - low);
      const near = []; // grades that are too close for letters of their own
      grades.forEach(([words, factor]) => {
        const beside = near.find((each) => abs(at(each[0][1]) - at(factor)) < 12);
        if (beside) beside.push([words, factor]); else near.push([[words, factor]]);
      });
      const marked = near.map((some) => set(make("span", some.map(([words]) => words[0].toUpperCase()).join("")), { class: "grade", style: `left:${at(some[0][1])}%`,
        title: some.map(([words, factor]) => `${words}: ${number(abs(size) * factor, 3)}${unit ? ` ${unit}` : ""}`).join(", ") }));
      const range_ = band && `${brief(size * band[0])} to ${brief(size * band[1])}${unit ? ` ${unit}` : ""}`;
      const [from_, to_] = (band || []).map((factor) => at(max(factor, 10 ** low)));
      const banded = band ? [make("span", [], { class: "band", title: range_, style: `left:${from_}%;width:${to_ - from_}%` })] : [];
      const marks = make("span", [...banded, make("span", [], { class: "origin", style: `left:${at(1)}%` }), ...marked], { class: "marks", "aria-hidden": "true" });
      const [bar, ghost, share] = [make("i", []), make("b", []), make("span", [], { class: "number" })];
      const of = slider.axes > 1 ? make("small", `largest of ${slider.axes}`) : band ? make("small", range_) : "";
      const row = make("div", [make("label", [name, ...(of ? [of] : [])], { for: id }), make("span", [range, marks], { class: "track" }), make("span", [value, unitOf(unit)], { class: "value" }),
        make("span", [share, make("span", [bar, ghost], { class: "bar", "aria-hidden": "true" })], { class: "share" })], { class: "row" });
      const choose = (factor) => { factors[n] = factor; self.show(); update(); };
      marked.forEach((each, g) => each.addEventListener("click", () => choose(near[g][0][1])));
      [range, value].forEach((each) => each.addEventListener("change", () => setTimeout(() => root_.dispatchEvent(new Event("released")))));
      range.addEventListener("input", () => {
        const rounded = +(size * 10 ** range.value).toPrecision(3);
        choose(abs(log10(rounded / size)) < 0.009 ? 1 : rounded / size);
      });
      value.addEventListener("change", () => {
        const given = Number(value.value.replace(",", ".").trim() || NaN) / size;
        value.setAttribute("aria-invalid", String(!(given > 0 && Number.isFinite(given))));
        if (given > 0 && Number.isFinite(given)) choose(given);
      });
      const self = { path, row, show() {
        range.value = log10(factors[n]);
        value.value = brief(size * factors[n]);
        value.setAttribute("aria-invalid", "false");
        set(range, { "aria-valuetext": `${value.value}${unit ? ` ${unit}` : ""}${factors[n] === 1 ? ", as in the campaign" : `, ${number(factors[n], 3)} times`}` });
        row.classList.toggle("changed", factors[n] !== 1);
      }, share(now, then) {
        bar.style.width = `${min(100, max(0, 100 * now))}%`;
        ghost.style.left = `${min(100, max(0, 100 * then))}%`;
        share.textContent = `${now && abs(now) < 5e-4 ? "<0.1" : (100 * now).toFixed(1).replace("-", "−")} %`;
      } };
      self.show();
      return self;
    });
    const groups = new Map();
    rows.forEach(({ path, row }) => {
      const table = path.split(".").slice(0, -1).join(".");
      if (!groups.has(table)) groups.set(table, make("fieldset", make("legend", make("code", `[${table}]`))));
      groups.get(table).append(row);
    });

    // Tables.
    const held = data.tuned || own ? ["Claimed", "True / claimed"] : [];
    const asked = make("tbody", requirements.map(({ words }) => make("tr", [make("th", words, { scope: "row" }), ...cells("td", ["", "", "", ""])])));
    const sigmas = make("tbody", outputs.map(({ name, unit }) => make("tr", [make("th", [name, unitOf(unit)], { scope: "row" }), ...cells("td", ["", "", ...held.map(() => "")])])));
    const table = (caption, headings, body, kind) => make("div", make("table", [make("caption", make("span", caption)), heading(headings), body], { class: kind }), { class: "scroll", tabindex: 0, role: "group", "aria-label": caption });
    const write = (row, words) => words.forEach((each, k) => {
      const cell = row.cells[k + 1];
      if (cell.textContent !== each) cell.textContent = each;
    });
    const filterLine = make("p", [], { class: "filter" });

    // Small figures of sigmas over time.
    const times = data.times;
    const [W, H, L, T, B] = [300, 130, 44, 8, 20];
    const panels = !times.length ? [] : outputs.map(({ name, unit, scale: shownScale }, i) => {
      const svg = set(made("svg"), { viewBox: `0 0 ${W} ${H}`, role: "img" });
      const [grid, ghost, claimed, line, again] = ["grid", "ghost", "claimed", "line", "again"].map((kind) => set(made("path"), { class: kind }));
      const words = made("g");
      svg.append(grid, words, ghost, claimed, line, again);
      const unitShown = unitOf(unit);
      const caption = make("p", [name, unitShown]);
      const [from, to] = [times[0], times[times.length - 1]];
      const across = (t) => L + (W - L - 6) * (t - from) / (to - from || 1);
      const put = (x, y, content, anchor) => { const each = set(made("text"), { x, y, "text-anchor": anchor }); each.textContent = content; words.append(each); };
      return { i, element: make("div", [caption, svg], { class: "panel" }), draw(m, until, dashed) {
        const [inUnit, factor] = convention.unit(unit, name);
        unitShown.textContent = inUnit ? ` ${inUnit}` : "";
        const value = (each, r) => factor * shownScale * sigma(each, r, i);
        const stated = (r) => factor * shownScale * (own ? own[r * width + i] : NaN);
        const tuned = (retuned?.[name] || []).map((v) => factor * shownScale * v);
        const top = max(...times.map((_, r) => max(value(before.m, r), r < until ? value(m, r) : 0)), ...tuned) || 1;
        const up = (v) => H - B - (H - B - T) * min(v / top, 1.2);
        const path = (f, end) => times.slice(0, end).map((t, r) => [t, f(r)]).filter(([, v]) => Number.isFinite(v))
          .map(([t, v], k) => `${k ? "L" : "M"}${across(t).toFixed(1)} ${up(v).toFixed(1)}`).join("");
        set(ghost, { d: path((r) => value(before.m, r), before.beyond) });
        set(claimed, { d: path(stated, times.length) });
        set(line, { d: path((r) => value(m, r), until), "stroke-dasharray": dashed ? "6 4" : "none" });
        set(again, { d: tuned.map((v, k) => `${k ? "L" : "M"}${across(retuned[""][k]).toFixed(1)} ${up(v).toFixed(1)}`).join(""), "stroke-dasharray": doubted.includes(name) ? "6 4" : "none" });
        words.replaceChildren();
        const ticks = ticksOf(0, top, 0, 3);
        ticks.forEach(([v, step]) => put(L - 4, up(v) + 4, shown(v + 0, step), "end"));
        set(grid, { d: ticks.map(([v]) => `M${L} ${up(v).toFixed(1)}H${W - 6}`).join("") });
        [[from, "start"], [to, "end"]].forEach(([t, anchor]) => put(across(t), H - 5, `${number(t, 3)} ${data.timeUnit}`, anchor));
        set(svg, { "aria-label": `Sigma of ${name} over ${data.label}: at the end ${number(value(m, last), 3)} ${inUnit}, in the campaign ${number(value(before.m, last), 3)} ${inUnit}` });
      } };
    });
    const first = [...new Set([...requirements.flatMap(({ members }) => members), ...outputs.keys()])].slice(0, brief_ ? 4 : 9);
    const plotsOf = (some) => make("div", some.map(({ element }) => element), { class: "small" });
    const others = panels.filter(({ i }) => !first.includes(i));
    const more = others.length ? make("details", [make("summary", `${others.length} more`), plotsOf(others)]) : null;
    more?.addEventListener("toggle", () => update());

    // The campaign's file with the numbers changed; the filter keeps what it took them for.
    const toml = () => {
      const changed = sliders.flatMap(({ path, sizes, shown: largest }, n) => (factors[n] === 1 ? []
        : [`#   ${path}: ${text(sizes[largest][0])} becomes ${text(sizes[largest][0] * factors[n])} ${sizes[largest][1] || ""}`.trimEnd()]));
      const file = data.text.replace(new RegExp(`"${data.mark}(\\d+)\\.(\\d+)${data.mark}"`, "g"), (_, n, k) => {
        const [size, unit] = sliders[n].sizes[k];
        const written = factors[n] === 1 ? String(size) : text(size * factors[n]);
        return unit === null ? written : `"${`${written} ${unit}`.trimEnd()}"`;
      });
      let table_ = "";
      const believed = data.beliefs.filter(([, , , n]) => n === null || factors[n] !== 1).map(([name, key, value]) => {
        const begin = name === table_ ? "" : `\n[${name}]\n`;
        table_ = name;
        return `${begin}${key} = ${value}`;
      });
      const said = data.tuned ? "# The filter's gains are held: [filter.believes] has what it took them for.\n" : "";
      const head = changed.length ? `# What if, in place of the campaign's own numbers:\n${changed.join("\n")}\n${said}\n` : "";
      return `${head}${file.trimEnd()}\n${believed.length ? `${believed.join("\n")}\n` : ""}`;
    };

    const shownIn = ({ kind, scale: each, unit }, value) => (kind === "box" ? `${(100 * value).toFixed(3)} %` : `${number(each * value)} ${unit}`);
    const worst = (m, until) => {
      let found = [1, -1, 0];
      for (let r = 0; r < min(until, last); r += 1) {
        for (let i = 0; i < width; i += 1) {
          const ratio = rms(m, r, i) / own[r * width + i];
          if (Number.isFinite(ratio) && ratio > 0 && (found[1] < 0 || abs(log10(ratio)) > abs(log10(found[0])))) found = [ratio, i, r];
        }
      }
      return found;
    };
    const update = () => {
      const [m, i] = [moments(factors), chosen.selectedIndex];
      const until = beyond(m);
      const results = judged(m, until);
      const changed = factors.filter((factor) => factor !== 1).length;
      root_.closest("section")?.classList.toggle("unchanged", !changed);
      const outside = until < count ? ` Beyond the range of linear analysis${until < last ? ` from ${number(times[until], 4)} ${data.timeUnit}` : ""}: later values have no meaning.` : "";
      const departing = nonlinear(factors, m);
      const open = requirements.map(({ members }) => members.some((each) => departing.includes(each)));
      const verdicts = results.filter((result, n) => result && !open[n]);
      const failed = verdicts.filter(({ met }) => !met).length;
      const metWords = verdicts.length ? ` ${failed ? `${failed} of ${verdicts.length} requirement${verdicts.length > 1 ? "s" : ""} ${data.sampled ? "beyond the limit, by the bound of the samples" : "not met"}.` : open.some(Boolean) ? "" : `${verdicts.length > 1 ? "All requirements" : "The requirement is"} met.`}` : "";
      root_.verdict = [metWords.trim(), !verdicts.length ? "" : failed ? (data.sampled ? "undecided" : "differs") : open.some(Boolean) ? "undecided" : "agrees"];
      state.textContent = `${changed ? `${changed} number${changed > 1 ? "s" : ""} changed.` : "As in the campaign."}${metWords}${outside}`;
      if (changed && until === count) state.append(` 1σ of ${outputs[i].name}: ${number(outputs[i].scale * sigma(before.m, last, i), 3)} → ${number(outputs[i].scale * sigma(m, last, i), 3)} ${outputs[i].unit}.`);
      if (changed) {
        const [most] = departing.sort((p, q) => abs(bent(factors, m, q) - 1) - abs(bent(factors, m, p) - 1));
        state.append(departing.length ? ` Linear analysis does not hold with these numbers: the true sigma of ${outputs[most].name} is about ${bent(factors, m, most).toFixed(2)} times. Simulate them.`
          : bends.length ? "" : " No flight has examined linear analysis of these numbers.");
      }
      reset.disabled = !changed;
      const [now, then] = [shares(m, factors, i), shares(before.m, before.k, i)];
      rows.forEach((row, n) => row.share(now[n], then[n]));
      results.forEach((result, n) => {
        const [row, earlier] = [asked.rows[n], before.judged[n]];
        write(row, [earlier ? shownIn(requirements[n], earlier.value) : "–", result ? shownIn(requirements[n], result.value) : "–", result ? `× ${number(result.margin, 3)}` : "–"]);
        row.cells[4].replaceChildren(make("span", open[n] ? "not linear: simulate" : result ? (result.met ? "met" : unmet) : "see mcnav lincov", { class: `tag ${result && !open[n] ? (result.met ? "agrees" : data.sampled ? "undecided" : "differs") : "undecided"}` }));
      });
      caption_.textContent = `At the end, ${convention.words}`;
      outputs.forEach(({ scale: own_, unit, name }, o) => {
        const [inUnit, factor] = convention.unit(unit, name);
        const each = factor * own_ * convention.sigma;
        sigmas.rows[o].querySelector(".unit").textContent = inUnit ? ` ${inUnit}` : "";
        const [was, is, claims] = [sigma(before.m, last, o), sigma(m, last, o), own ? own[last * width + o] : NaN];
        const told = until < count ? "–" : number(each * is);
        write(sigmas.rows[o], [number(each * was), told, ...(held.length ? [number(each * claims), until === count ? three(rms(m, last, o) / claims) : "–"] : [])]);
      });
      if (own) {
        const [[ratio, o, r], [earlier]] = [worst(m, until), worst(before.m, before.beyond)];
        filterLine.replaceChildren(make("strong", "Filter gains held."), o < 0 ? "" : ` Worst true/computed ratio: ${three(ratio)} (${outputs[o].name}, ${instant(times[r])}); in the campaign ${three(earlier)}.`);
      } else if (data.tuned) filterLine.replaceChildren(make("strong", "Filter gains held."));
      panels.filter((panel) => first.includes(panel.i) || more?.open).forEach((panel) => panel.draw(m, min(until, times.length), departing.includes(panel.i)));
      root_.dispatchEvent(new Event("moved"));
    };
    // What a live page asks: factors of the numbers that are changed, by their keys; and the other way about.
    root_.factors = () => Object.fromEntries(sliders.map(({ path }, n) => [path, factors[n]]).filter(([, factor]) => factor !== 1));
    root_.retune = (curves, names = []) => { [retuned, doubted] = [curves, names]; update(); };
    root_.multipliers = () => factors;
    root_.sizes = () => Object.fromEntries(sliders.map(({ path, sizes, shown: largest }) => [path, sizes[largest].join(" ")]));
    root_.choose = (chosenFactors) => {
      sliders.forEach(({ path }, n) => { factors[n] = chosenFactors[path] ?? 1; rows[n].show(); });
      update();
    };
    // What tests compare: sigmas by reading and output, SI, values and margins of requirements, and the file.
    root_.results = () => {
      const m = moments(factors);
      const values = judged(m, beyond(m)).map((each) => each && [each.value, each.margin]);
      return { sigmas: Array.from({ length: count }, (_, r) => outputs.map((__, i) => sigma(m, r, i))), requirements: values, toml: toml(), ratios: outputs.map((_, i) => bent(factors, m, i)), departing: nonlinear(factors, m) };
    };
    chosen.addEventListener("change", update);
    const key = make("ul", [["line", first_ && data.tuned ? "gains held" : "what if"], ["ghost", "campaign"], ...(own ? [["claimed", "filter"]] : []), ...(first_ && data.tuned ? [["again", "re-tuned"]] : [])]
      .map(([kind, words]) => make("li", [make("span", [], { class: `swatch ${kind}` }), words])), { class: "key" });
    const ends = table("At the end, one sigma", ["Output", "Campaign", "What if", ...held], sigmas, "sigmas");
    const caption_ = ends.querySelector("caption span");
    convention.changed.addEventListener("change", () => update());
    const folded = (words, parts) => make("details", [make("summary", words), ...parts]);
    const choice = make("p", make("label", [first_ ? "% of final variance: " : "Shares of the variance at the end of ", chosen]), { class: "choice" });
    const tables = [...(requirements.length ? [table(data.basis, ["Requirement", "Campaign", "What if", "Errors may be", "Finding"], asked, "requirements")] : []), ends];
    const plots = panels.length ? [key, plotsOf(first.map((each) => panels[each])), ...(more ? [more] : [])] : [];
    const foremost = () => { // numbers with the largest shares in what requirements limit, or in all outputs
      const wanted = requirements.length ? requirements.flatMap(({ members }) => members) : [...outputs.keys()];
      const largest = sliders.map(() => 0);
      wanted.forEach((i) => shares(before.m, before.k, i).forEach((share, n) => { largest[n] = max(largest[n], share); }));
      return [...rows.keys()].sort((p, q) => largest[q] - largest[p]).slice(0, FOREMOST);
    };
    const numbers = () => {
      if (!brief_) return [choice, ...groups.values()];
      const shownFirst = make("div", foremost().map((n) => rows[n].row));
      const rest = [...groups.values()].filter((group) => group.querySelector(".row"));
      const count_ = rest.reduce((sum, group) => sum + group.querySelectorAll(".row").length, 0);
      return [choice, shownFirst, ...(count_ ? [folded(`${count_} more`, rest)] : [])];
    };
    root_.append(
      make("div", [state, reset, copy], { class: "bar-of-state" }),
      ...(!first_ && (data.tuned || own) ? [filterLine] : []),
      make("div", [
        make("div", numbers(), { class: "numbers" }),
        make("div", first_ ? [...plots, folded("Numbers", [...(data.tuned || own ? [filterLine] : []), ...tables])] : [...tables.slice(0, -1), ...plots, brief_ ? folded("Sigmas at the end", [ends]) : ends], { class: "results" }),
      ], { class: "halves" }),
    );
    update();
  });
