  // Live: the page asks the server it came from, twice a second for what is new. Of the page's script it uses `all`,
  // `button`, `copied` and `set`; of "What if" the factors of its sliders.
  all(".live").forEach((place) => {
    let state = JSON.parse(place.querySelector("script").textContent);
    const { revision } = state;
    const sliders = document.querySelector(".what-if");
    const make = (name, content = [], pairs = {}) => {
      const element = set(document.createElement(name), pairs);
      element.append(...[content].flat());
      return element;
    };
    const tag = (words, tone) => make("span", words, { class: `tag ${tone}` });
    const plainButton = (words, action) => set(button(words, action), { class: "copy" });
    const alarm = make("p", [], { class: "alarm", role: "alert", hidden: "" });
    document.querySelector("main").prepend(alarm);
    const said = make("p", [], { class: "said", role: "status" });
    const body = make("div", [], { class: "scroll", tabindex: 0, role: "group", "aria-label": "Settings side by side" });
    place.append(said, body);
    let [refused, gone, columns] = ["", false, []];
    const warn = () => {
      const words = gone ? "No answer: mcnav live has ended. Start it again, and open the address that it prints." : refused || state.error;
      if (alarm.textContent !== words) alarm.textContent = words;
      alarm.hidden = !words;
    };

    // The sliders stay where they are when the file changes, but those whose number it has changed.
    const KEPT = `mcnav-live ${location.pathname}`;
    const keep = () => {
      try {
        sessionStorage.setItem(KEPT, JSON.stringify([sliders.factors(), sliders.sizes()]));
      } catch { /* a browser may refuse it */ }
    };
    const restore = () => {
      try {
        const [factors, before] = JSON.parse(sessionStorage.getItem(KEPT) || "[{}, {}]");
        sessionStorage.removeItem(KEPT);
        const now = sliders.sizes();
        const same = Object.entries(factors).filter(([path]) => now[path] !== undefined && now[path] === before[path]);
        if (same.length) sliders.choose(Object.fromEntries(same));
      } catch { /* nothing is kept */ }
    };
    if (sliders) restore();

    // Requests; what is refused comes as one line.
    const ask = async (path, content) => {
      let answer;
      try {
        answer = await fetch(path, content && { method: "POST", headers: { "Content-Type": "application/json" }, body: JSON.stringify(content) });
      } catch {
        gone = true;
        warn();
        return false;
      }
      gone = false;
      if (content) refused = answer.ok ? "" : await answer.text();
      if (answer.ok) state = await answer.json();
      if (state.revision !== revision) {
        if (sliders) keep();
        location.reload();
      } else show();
      return answer.ok;
    };
    const title = ({ title: words }) => words;
    const headline = (setting) => `${title(setting)}: ${setting.sentences.map(([words]) => words).join(". ")}.`;

    // The banner follows the sliders: while they move with the gains held, once they are released as re-tuned.
    const banner = document.querySelector(".first-screen .verdict");
    const campaign = banner && [banner.className, banner.querySelector(".headline").innerHTML];
    const announce = (words, tone) => {
      if (!banner) return;
      banner.className = `verdict ${tone}`.trim();
      banner.querySelector(".headline").textContent = words;
    };

    // The sliders' own buttons.
    const told = make("span", [], { class: "told", role: "status" });
    let [tuning, wanted, following] = [false, "", true];
    const tune = async () => {
      const asked = sliders.factors();
      wanted = JSON.stringify(asked);
      if (tuning || !Object.keys(asked).length) return;
      tuning = true;
      told.textContent = "Computing …";
      const done = await ask("tune", { revision, factors: asked });
      tuning = false;
      const last = state.settings[state.settings.length - 1];
      told.replaceChildren(...(done ? [`${headline(last)} `, make("a", "Side by side", { href: "#settings" })] : []));
      if (wanted !== JSON.stringify(asked)) tune(); // released again meanwhile
      else if (done && last.sentences.length) {
        following = false;
        sliders.retune(last.curves, last.doubted);
        following = true;
        announce(`${last.sentences[0][0]}.`.split(/(?<=[.!?])\s/)[0], last.sentences[0][1]);
      }
    };
    if (sliders) {
      sliders.addEventListener("moved", () => {
        if (!following || !banner) return;
        if (!Object.keys(sliders.factors()).length) [banner.className, banner.querySelector(".headline").innerHTML] = campaign;
        else announce(`${sliders.verdict[0]} Release to re-tune.`.trim(), sliders.verdict[1]);
      });
      sliders.addEventListener("released", tune);
      sliders.querySelector(".bar-of-state").append(told);
    }

    // Settings side by side: a column each, made once; of a run what it does is written into its cell.
    const runOf = (setting) => {
      const words = make("div");
      const confirm = plainButton("Confirm by Monte Carlo", () => ask("confirm", { setting: setting.number }));
      const stop = plainButton("Stop", () => ask("stop", {}));
      const bar = make("progress", [], { "aria-label": `Monte Carlo of ${title(setting)}` });
      const link = make("a", "Report", { href: `report/${setting.number}`, target: "_blank", rel: "noreferrer" });
      const element = make("td", [words, bar, link, " ", confirm, stop], { class: "words" });
      set(confirm, { "aria-label": `Confirm ${title(setting)} by Monte Carlo` });
      return { number: setting.number, element, show({ run }, busy) {
        const running = run?.state === "running";
        words.replaceChildren(...(!run ? [] : run.state === "done" ? run.verdicts.map(([subject, finding, tone]) => make("p", [`${subject}: `, tag(finding, tone)]))
          : [run.words]), ...(run?.folder && !running ? [make("p", make("small", make("code", run.folder)))] : []));
        words.classList.toggle("failed", run?.state === "failed");
        bar.hidden = !running;
        if (run?.share != null) bar.value = run.share; else bar.removeAttribute("value");
        link.hidden = run?.state !== "done";
        confirm.hidden = running || run?.state === "done";
        confirm.disabled = busy;
        stop.hidden = !running;
      } };
    };
    const rowOf = (name, cells) => make("tr", [make("th", name, { scope: "row" }), ...cells]);
    const cell = (content, kind) => make("td", content, kind ? { class: kind } : {});
    const build = () => {
      const { settings } = state;
      const union = (pick) => [...new Map(settings.flatMap(pick).map((each) => [each.words, each])).values()];
      columns = settings.map(runOf);
      const heads = settings.map((each) => make("th", [title(each), make("small", `${each.when}${each.revision === revision ? "" : ", of an earlier file"}`)], { scope: "col" }));
      const changed = settings.map(({ changed: some, factors, revision: theirs, number }) => {
        const take = plainButton("Set the sliders", () => sliders.choose(factors));
        take.disabled = !sliders || theirs !== revision;
        const copy = plainButton("Copy as TOML", async () => {
          const answer = await fetch(`campaign/${number}`).catch(() => null);
          if (answer?.ok) await copied(await answer.text());
          copy.textContent = answer?.ok ? "Copied" : "Not copied";
          setTimeout(() => { copy.textContent = "Copy as TOML"; }, 2000);
        });
        return cell([make("ul", some.map(([path, value]) => make("li", [make("code", path), ` ${value}`]))), take, " ", copy, " ", make("a", "Page", { href: `setting/${number}`, target: "_blank", rel: "noreferrer" })], "words");
      });
      const asked = union(({ requirements }) => requirements).map(({ words }) => rowOf(words, settings.map(({ requirements }) => {
        const one = requirements.find((each) => each.words === words);
        return one ? cell([one.shown, one.margin ? make("small", ` margin × ${one.margin} `) : " ", tag(one.finding, one.tone)]) : cell("–");
      })));
      const sigmas = union((each) => each.sigmas).map(({ words, unit }) => rowOf([words, make("span", unit ? ` ${unit}` : "", { class: "unit" })], settings.map((setting) => {
        const one = setting.sigmas.find((each) => each.words === words);
        return one ? cell([one.shown, one.claimed && one.claimed !== one.shown ? make("small", ` claimed ${one.claimed}`) : "", one.doubt ? tag(one.doubt, "undecided") : ""]) : cell("–");
      })));
      const words = settings.map(({ sentences }) => cell(sentences.map(([sentence, tone]) => make("p", [tone ? tag(sentence, tone) : sentence])), "words"));
      const part = (name) => make("tr", make("th", name, { scope: "rowgroup", colspan: settings.length + 1 }));
      body.replaceChildren(make("table", [make("caption", make("span", "Settings side by side, by linear analysis; sigmas are those at the end")), make("thead", make("tr", [make("td"), ...heads])), make("tbody", [
        rowOf("Numbers changed", changed), rowOf("Linear analysis", words), ...(asked.length ? [part("Requirements"), ...asked] : []),
        part("One sigma at the end"), ...sigmas, rowOf("Monte Carlo", columns.map(({ element }) => element))])]));
    };
    let built = "";
    const show = () => {
      const names = state.settings.map(({ number }) => number).join(" ");
      if (names !== built) build();
      built = names;
      const going = state.settings.find(({ run }) => run?.state === "running");
      columns.forEach((column, k) => column.show(state.settings[k], Boolean(going)));
      const ended = state.settings.filter(({ run }) => run?.state === "done").map((each) => `${title(each)} by Monte Carlo: ${each.run.verdicts.map(([subject, finding]) => `${subject} ${finding}`).join(", ")}.`);
      const words = going ? `Monte Carlo of ${title(going)} is running.` : ended.join(" ");
      if (said.textContent !== words) said.textContent = words;
      warn();
    };
    show();
    const poll = async () => {
      await ask("state");
      setTimeout(poll, 500);
    };
    poll();
  });
