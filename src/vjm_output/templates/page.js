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

  // --- plots ---
  const values = (text) => {
    const rows = [];
    for (const line of text.trim().split("\n").slice(1)) {
      const cells = (line.match(/("([^"]|"")*"|[^,]*)(,|$)/g) || []).map((c) => c.replace(/,$/, "").replace(/^"|"$/g, "").replace(/""/g, '"'));
      rows.push({ panel: +cells[0], series: cells[2], x: parseFloat(cells[3]), y: parseFloat(cells[4]) });
    }
    return rows;
  };
  const forward = ([kind, threshold, linear], v) => {
    if (kind === "log") return v > 0 ? Math.log10(v) : NaN;
    if (kind !== "symlog") return v;
    const inner = linear / 0.9, size = Math.abs(v);
    return size <= threshold ? v * inner : Math.sign(v) * threshold * (inner + Math.log10(size / threshold));
  };
  const place = (panel, axis, v) => {
    const [low, high] = panel["xy"[axis]].map((end) => forward(panel.scale[axis], end));
    const share = (forward(panel.scale[axis], v) - low) / (high - low);
    const [a, b] = axis ? [panel.box[3], panel.box[1]] : [panel.box[0], panel.box[2]];
    return a + share * (b - a);
  };
  const short = (v) => String(Number(v.toPrecision(5))).replace("-", "−");
  for (const figure of document.querySelectorAll("figure[data-axes]")) {
    const svg = figure.querySelector("svg.plot"), link = figure.querySelector("a.csv");
    const panels = JSON.parse(figure.dataset.axes);
    const bytes = Uint8Array.from(atob(link.href.split(",")[1]), (c) => c.charCodeAt(0));
    const points = values(new TextDecoder().decode(bytes));
    for (const p of points) [p.px, p.py] = [place(panels[p.panel], 0, p.x), place(panels[p.panel], 1, p.y)];
    const off = new Set(), tools = make("div", { class: "tools" });
    for (const name of new Set(points.map((p) => p.series))) {
      const own = button(name, () => {
        const hide = !off.delete(name);
        if (hide) off.add(name);
        own.setAttribute("aria-pressed", String(!hide));
        for (const part of svg.querySelectorAll("[data-series]")) if (part.dataset.series === name) part.style.display = hide ? "none" : "";
      }, { "aria-pressed": "true", class: "series" });
      tools.append(own);
    }
    const whole = svg.getAttribute("viewBox"), tip = make("div", { class: "tip", hidden: "" });
    const dot = document.createElementNS(svg.namespaceURI, "circle");
    dot.setAttribute("r", "3"); dot.setAttribute("class", "dot"); dot.style.display = "none";
    svg.append(dot);
    const back = button("whole figure", () => { svg.setAttribute("viewBox", whole); back.disabled = true; }, { disabled: "" });
    const closer = button("zoom in", () => {
      const [x, y, w, h] = svg.getAttribute("viewBox").split(" ").map(Number);
      show(x + 0.15 * w, y + 0.15 * h, 0.7 * w, 0.7 * h);
    });
    const show = (x, y, w, h) => { svg.setAttribute("viewBox", [x, y, w, h].join(" ")); back.disabled = false; };
    tools.append(closer, back);
    const frame = make("div", { class: "frame" });
    svg.before(frame);
    frame.append(svg, tip);
    frame.after(tools);
    const at = (event) => new DOMPoint(event.clientX, event.clientY).matrixTransform(svg.getScreenCTM().inverse());
    let start = null;
    const box = document.createElementNS(svg.namespaceURI, "rect");
    box.setAttribute("class", "zoom");
    svg.addEventListener("pointerdown", (event) => { if (event.pointerType === "mouse") start = at(event); });
    svg.addEventListener("pointerup", (event) => {
      if (!start) return;
      const end = at(event), w = Math.abs(end.x - start.x), h = Math.abs(end.y - start.y);
      if (w > 8 && h > 8) show(Math.min(start.x, end.x), Math.min(start.y, end.y), w, h);
      start = null; box.remove();
    });
    svg.addEventListener("pointermove", (event) => {
      const here = at(event);
      if (start && event.buttons) {
        svg.append(box);
        box.setAttribute("x", Math.min(start.x, here.x)); box.setAttribute("y", Math.min(start.y, here.y));
        box.setAttribute("width", Math.abs(start.x - here.x)); box.setAttribute("height", Math.abs(start.y - here.y));
        return;
      }
      let best = null, least = 400;
      for (const p of points) {
        const distance = (p.px - here.x) ** 2 + (p.py - here.y) ** 2;
        const b = panels[p.panel].box;
        if (distance < least && !off.has(p.series) && p.px >= b[0] - 1 && p.px <= b[2] + 1 && p.py >= b[1] - 1 && p.py <= b[3] + 1) [best, least] = [p, distance];
      }
      tip.hidden = !best; dot.style.display = best ? "" : "none";
      if (!best) return;
      dot.setAttribute("cx", best.px); dot.setAttribute("cy", best.py);
      tip.textContent = `${best.series}: ${isNaN(best.x) ? "" : short(best.x) + ", "}${short(best.y)}`;
      const bounds = frame.getBoundingClientRect(), x = event.clientX - bounds.left, y = event.clientY - bounds.top;
      tip.style.top = `${y + 12}px`;
      if (x > bounds.width / 2) { tip.style.right = `${bounds.width - x + 8}px`; tip.style.left = "auto"; } else { tip.style.left = `${x + 12}px`; tip.style.right = "auto"; }
    });
    svg.addEventListener("pointerleave", () => { tip.hidden = true; dot.style.display = "none"; start = null; box.remove(); });
  }
