"use strict";
// Everything on the page is there without this script. With it, tables sort, series toggle, tables copy as CSV, and
// the contents show where the reader is.
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
