  // Flight deck: one instant for all figures over its time. Of the page's script it uses `all`, `button`, `clock`, `convention`, `copied`,
  // `get`, `made`, `plots` and `set`. Ellipses are those of mcnav.report.figures.deck.
  all("#figure-deck").forEach((figure) => {
    const data = JSON.parse(figure.querySelector(":scope > script").textContent);
    const { link, times, instants, words, factor, causes, half } = data;
    const last = times.length - 1;
    const panels = all(".plot", figure).map((plot) => plots.find(({ svg }) => plot.contains(svg)));
    const panel = (name) => panels[data.panels[name]];
    const [track, ellipses, bars] = ["track", "ellipses", "causes"].map(panel);
    const still = matchMedia("(prefers-reduced-motion: reduce)");
    let [k, turning, saying, writing, drawing] = [data.at, 0, 0, 0, 0];

    // Causes with the numbers of the section "What if": terms of mcnav.analysis.what_if, summed anew.
    const [whatIf] = all(".what-if");
    const terms = whatIf ? data.terms.map(([cause, first, second, text]) => [cause, first, second,
      new Float32Array(Uint8Array.from(atob(text), (c) => c.charCodeAt(0)).buffer)]) : [];
    let factors = [];
    const changed = () => factors.some((factor) => factor !== 1);
    const budget = () => {
      const [parts, by] = [causes.map(() => 0), (number) => (number < 0 ? 1 : factors[number])];
      let whole = 0;
      terms.forEach(([cause, first, second, values]) => {
        const part = by(first) * by(second) * values[k];
        whole += part;
        if (cause >= 0) parts[cause] += part;
      });
      return { shares: parts.map((part) => (whole > 0 ? 100 * part / whole : 0)), times: Math.sqrt(max(whole, 0)) };
    };
    const nominal = () => causes.map((_, row) => data.shares[k * causes.length + row] / 10);
    const changedWords = () => {
      if (!changed()) return "";
      const { shares, times: larger } = budget();
      const largest = causes.map(([, label], row) => [shares[row], label]).filter(([share]) => share >= 0.5).sort(([a], [b]) => b - a).slice(0, 3);
      return ` With the numbers of What if${whatIf.querySelector(".filter") ? ", the filter's gains held" : ""}: ${largest.map(([share, label]) => `${label} ${share.toFixed(0)} %`).join(", ")}; the linear error is ${number(larger, 3)} times the campaign's, whose shares are marks on the bars.`;
    };

    // Points of an ellipse about the nominal, m: mean + reach L (cos a, sin a), with the Cholesky factor L.
    const circle = Array.from({ length: 73 }, (_, n) => [Math.cos(Math.PI * n / 36), Math.sin(Math.PI * n / 36)]);
    const points = ({ mean, covariance, reach }) => {
      const [xx, xy, yy] = covariance.slice(3 * k, 3 * k + 3);
      const first = Math.sqrt(max(xx, 0));
      const across = first && xy / first;
      const other = Math.sqrt(max(yy - across * across, 0));
      return circle.map(([c, s]) => [mean[2 * k] + reach * first * c, mean[2 * k + 1] + reach * (across * c + other * s)]);
    };
    const onTrack = ([a, b]) => {
      const [xx, xy, yx, yy] = data.axes.slice(4 * k, 4 * k + 4);
      return [data.place[2 * k] + factor / 1e3 * (xx * a + xy * b), data.place[2 * k + 1] + factor / 1e3 * (yx * a + yy * b)];
    };
    const titles = panels.map(({ svg }) => [svg, all(":scope > text", svg).find(({ textContent }) => textContent.endsWith(` at ${instants[data.at]}`))]).filter(([, title]) => title);

    // What is shown of an instant.
    const told = set(document.createElement("p"), { class: "hidden", role: "status" });
    const shows = figure.querySelector(".shows");
    const range = set(document.createElement("input"), { type: "range", min: 0, max: last, step: 1, "aria-label": "Instant" });
    const time = document.createElement("output");
    const drawCauses = () => {
      const [own, now] = [nominal(), changed() ? budget().shares.map((share) => +share.toFixed(1)) : null];
      causes.forEach(([name, label], row) => {
        const share = now ? now[row] : own[row];
        const path = made("path");
        const group = bars.svg.querySelector(`.series-${name}`);
        bars.shape(path, [[0, row - half], [share, row - half], [share, row + half], [0, row + half], [0, row - half]]);
        path.dataset.tip = `${label}: ${share} %${now ? `, in the campaign ${own[row]} %` : ""}`;
        group.replaceChildren(path);
        if (now) {
          const ghost = set(made("path"), { class: "ghost" });
          bars.shape(ghost, [[own[row], row - 1.3 * half], [own[row], row + 1.3 * half]]);
          group.append(ghost);
        }
      });
      if (bars) bars.redraw();
      convention.reword(shows, words[k] + changedWords());
    };
    const draw = () => {
      data.ellipses.forEach((each) => {
        const own = points(each);
        const name = `.series-${each.series}`;
        ellipses.shape(ellipses.svg.querySelector(`.marks ${name}`), own.map(([a, b]) => [a / data.rings[k], b / data.rings[k]]));
        if (track) track.shape(track.svg.querySelector(`.marks ${name}`), own.map(onTrack));
      });
      if (track) track.shape(track.svg.querySelector(".series-here"), [data.place.slice(2 * k, 2 * k + 2)]);
      ellipses.svg.querySelector(".labels text").textContent = data.ringWords[k];
      [track, ellipses].forEach((each) => each && each.redraw());
      titles.forEach(([svg, title]) => {
        const before = title.textContent;
        title.textContent = `${before.slice(0, before.lastIndexOf(" at "))} at ${instants[k]}`;
        set(svg, { "aria-label": get(svg, "aria-label").replace(before, title.textContent) });
      });
      drawCauses();
    };
    const show = (to) => {
      k = within(to, [0, last]);
      range.value = k;
      set(range, { "aria-valuetext": instants[k] });
      time.textContent = instants[k];
      [clock.at, clock.everywhere] = [times[k], true];
      draw();
      clock.tell("move");
      clearTimeout(saying);
      saying = setTimeout(() => { told.textContent = words[k] + changedWords(); }, 600);
      later();
    };

    // The address keeps instant and zoom.
    const written = () => {
      const zoomed = clock.zoom ? `&zoom=${clock.zoom.map((v) => +v.toPrecision(5)).join("~")}` : "";
      history.replaceState(null, "", `#t=${+times[k].toPrecision(6)}${zoomed}`);
    };
    const later = () => { clearTimeout(writing); writing = setTimeout(written, 300); };
    const nearest = (at) => times.reduce((best, each, n) => (abs(each - at) < abs(times[best] - at) ? n : best), 0);
    const read = () => {
      const asked = new URLSearchParams(location.hash.slice(1));
      const at = parseFloat(asked.get("t"));
      if (!Number.isFinite(at)) return;
      const zoom = (asked.get("zoom") || "").split("~").map(Number);
      if (zoom.length === 2 && zoom[1] > zoom[0]) plots.filter((each) => each.link === link).forEach((each) => each.window(zoom));
      show(nearest(at));
      reveal(figure);
    };

    const stop = () => {
      clearInterval(turning);
      turning = 0;
      play.textContent = "Play";
    };
    const play = button("Play", () => {
      if (turning) { stop(); return; }
      play.textContent = "Pause";
      if (k === last) show(0);
      turning = setInterval(() => {
        show(k + 1);
        if (k === last) stop();
      }, still.matches ? 1000 : max(60, min(250, 12000 / last)));
    });
    const copy = button("Copy link", async () => {
      clearTimeout(writing);
      written();
      await copied(location.href);
      copy.textContent = "Copied";
      setTimeout(() => { copy.textContent = "Copy link"; }, 2000);
    });
    [play, copy].forEach((each) => { each.className = "copy"; });
    range.addEventListener("input", () => { stop(); show(Number(range.value)); });
    clock.events.addEventListener("ask", () => { stop(); show(nearest(clock.asked)); });
    clock.events.addEventListener("zoom", () => { if (clock.everywhere) later(); });
    if (terms.length) whatIf.addEventListener("moved", () => {
      const before = changed();
      factors = [...whatIf.multipliers()];
      if (!before && !changed()) return;
      cancelAnimationFrame(drawing); // of several moves within a frame, the last one
      drawing = requestAnimationFrame(drawCauses);
    });
    if (track) track.svg.addEventListener("click", (event) => {
      const own = box(track.svg);
      const at = [track.x.origin((event.clientX - own.left) / own.width * track.svg.viewBox.baseVal.width), track.y.origin((event.clientY - own.top) / own.height * track.svg.viewBox.baseVal.height)];
      const far = (n) => hypot(track.x.at(data.place[2 * n]) - at[0], track.y.at(data.place[2 * n + 1]) - at[1]);
      const best = times.reduce((found, _, n) => (far(n) < far(found) ? n : found), 0);
      if (far(best) < GRAB) { stop(); show(best); }
    });

    const bar = set(document.createElement("div"), { class: "clock", role: "group", "aria-label": "Instant of all figures over time" });
    bar.append(play, range, time, copy);
    figure.querySelector(".plots").before(bar, told);
    all(".series-now", figure).forEach((each) => each.remove());
    range.value = k;
    set(range, { "aria-valuetext": instants[k] });
    time.textContent = instants[k];
    Object.assign(clock, { link, at: times[k] });
    clock.tell("move");
    window.addEventListener("hashchange", read);
    read();
  });
