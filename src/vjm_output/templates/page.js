"use strict";
// What the page does beyond being read: it opens what a link points to, sorts and filters tables, gives the values of
// plots, and turns scenes. Nothing is loaded, and without this script everything is there all the same.
(() => {
  const make = (name, attributes = {}, ...content) => {
    const element = document.createElement(name);
    for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, value);
    element.append(...content);
    return element;
  };
  const button = (text, act, attributes = {}) => {
    const element = make("button", { type: "button", ...attributes }, text);
    element.addEventListener("click", act);
    return element;
  };

  // --- links open what they point to ---
  const reveal = () => {
    const target = location.hash.length > 1 && document.getElementById(decodeURIComponent(location.hash.slice(1)));
    if (!target) return;
    for (let at = target; at; at = at.parentElement) if (at.tagName === "DETAILS") at.open = true;
    target.scrollIntoView();
  };
  addEventListener("hashchange", reveal);
  document.addEventListener("click", (event) => {
    const link = event.target.closest && event.target.closest('a[href^="#"]');
    if (link && link.hash === location.hash) reveal();
  });
  addEventListener("beforeprint", () => document.querySelectorAll("details.print").forEach((one) => { one.open = true; }));
  // where the contents stand above the page and not beside it they take one line until they are asked for
  const contents = document.querySelector(".contents"), narrow = matchMedia("(max-width: 56rem)");
  if (contents) {
    const fold = () => { contents.open = !narrow.matches; };
    fold(); narrow.addEventListener("change", fold);
    contents.addEventListener("click", (event) => { if (narrow.matches && event.target.closest("a")) contents.open = false; });
  }
  const all = document.querySelector(".open-all");
  if (all) {
    all.hidden = false;
    all.addEventListener("click", () => {
      const open = all.getAttribute("aria-pressed") !== "true";
      all.setAttribute("aria-pressed", String(open));
      all.textContent = open ? "Close all" : "Open all";
      document.querySelectorAll("main details").forEach((one) => { one.open = open; });
    });
  }

  // --- tables ---
  const raised = { "⁻": "-", "⁰": "0", "¹": "1", "²": "2", "³": "3", "⁴": "4", "⁵": "5", "⁶": "6", "⁷": "7", "⁸": "8", "⁹": "9" };
  const numeric = (text) => {
    const plain = text.trim().replace(/−/g, "-").replace(/×10([⁻⁰¹²³⁴-⁹]+)/, (_, e) => "e" + [...e].map((c) => raised[c]).join(""));
    const found = /^-?\d+(\.\d+)?(e-?\d+)?/.exec(plain);
    return found ? parseFloat(found[0]) : NaN;
  };
  for (const table of document.querySelectorAll("table")) {
    const head = table.tHead, body = table.tBodies[0];
    if (!head || !body || body.rows.length < 3) continue;
    const plain = [...body.rows].filter((row) => row.cells.length === head.rows[0].cells.length);
    if (plain.length === body.rows.length) {
      [...head.rows[0].cells].forEach((cell, column) => {
        const text = [...cell.childNodes];
        if (!cell.textContent.trim()) return;
        const own = button("", () => {
          const down = cell.getAttribute("aria-sort") === "ascending";
          for (const other of head.rows[0].cells) other.removeAttribute("aria-sort");
          cell.setAttribute("aria-sort", down ? "descending" : "ascending");
          const key = (row) => row.cells[column].textContent;
          const sorted = [...body.rows].sort((a, b) => {
            const [x, y] = [numeric(key(a)), numeric(key(b))];
            if (isNaN(x) !== isNaN(y)) return isNaN(x) ? 1 : -1;  // what has no value stands last
            const order = isNaN(x) ? key(a).localeCompare(key(b)) : x - y;
            return down ? -order : order;
          });
          body.append(...sorted);
        }, { class: "sort" });
        own.append(...text);
        cell.append(own);
      });
    }
    if (body.rows.length > 12) {
      const field = make("input", { type: "search", placeholder: "filter rows", "aria-label": "filter rows" });
      const count = make("span", { class: "soft", role: "status" });
      field.addEventListener("input", () => {
        const words = field.value.toLowerCase().split(/\s+/).filter(Boolean);
        let shown = 0;
        for (const row of body.rows) {
          const text = row.textContent.toLowerCase();
          row.hidden = !words.every((word) => text.includes(word));
          shown += !row.hidden;
        }
        count.textContent = words.length ? ` ${shown} of ${body.rows.length} rows` : "";
      });
      table.closest(".scroll").before(make("div", { class: "tools" }, field, count));
    }
  }
