
  // --- plots: values under the pointer, series on and off, and panels that zoom with their axes ---
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
  const inverse = ([kind, threshold, linear], t) => {
    if (kind === "log") return 10 ** t;
    if (kind !== "symlog") return t;
    const inner = linear / 0.9, size = Math.abs(t);
    return size <= threshold * inner ? t / inner : Math.sign(t) * threshold * 10 ** (size / threshold - inner);
  };
  const limits = (panel, axis) => panel["xy"[axis]].map((end) => forward(panel.scale[axis], end));
  // from where an axis begins to where it ends, in the units of the drawing
  const ends = (panel, axis) => (axis ? [panel.box[3], panel.box[1]] : [panel.box[0], panel.box[2]]);
  const place = (panel, axis, v) => {
    const [low, high] = limits(panel, axis), [a, b] = ends(panel, axis);
    return a + (forward(panel.scale[axis], v) - low) / (high - low) * (b - a);
  };
  const short = (v) => String(Number(v.toPrecision(5))).replace("-", "−");
  const compact = (v) => (v !== 0 && (Math.abs(v) >= 1e5 || Math.abs(v) < 1e-3) ? Number(v.toPrecision(4)).toExponential().replace("e+", "e") : String(v)).replaceAll("-", "−");
  // round values between two places of an axis as it is drawn whole
  const ticks = (panel, axis, from, to) => {
    const [low, high] = limits(panel, axis), [a, b] = ends(panel, axis), scale = panel.scale[axis];
    const [s, t] = [from, to].map((p) => low + (p - a) / (b - a) * (high - low)), [v, w] = [inverse(scale, s), inverse(scale, t)];
    if (scale[0] === "log" && t - s > 1.5) {
      const step = Math.ceil((t - s) / 6);
      return Array.from({ length: Math.floor(t) - Math.ceil(s) + 1 }, (_, k) => 10 ** (Math.ceil(s) + k)).filter((_, k) => k % step === 0);
    }
    if (scale[0] === "symlog" && Math.max(Math.abs(v), Math.abs(w)) > 3 * scale[1]) {
      return [0, 1, 2, 3, 4].map((k) => Number(inverse(scale, s + (k + 0.5) / 5 * (t - s)).toPrecision(2))).map((u) => (Math.abs(u) < 1e-9 * scale[1] ? 0 : u));
    }
    const rough = Math.abs(w - v) / 5, decade = 10 ** Math.floor(Math.log10(rough));
    const step = decade * [1, 2, 5, 10].find((m) => m * decade >= rough), first = Math.ceil(Math.min(v, w) / step);
    return Array.from({ length: Math.floor(Math.max(v, w) / step) - first + 1 }, (_, k) => Number(((first + k) * step).toPrecision(12)));
  };
  // A panel of a drawing that shows a window of itself: what is in it moves, marks and lines keep their size.
  class Panel {
    constructor(svg, panel, index) {
      this.svg = svg; this.panel = panel; this.window = [...panel.box];
      this.group = svg.querySelector(`[id$="-axes_${index + 1}"]`);
      this.parts = null;
    }
    node(name, attributes) {
      const element = document.createElementNS(this.svg.namespaceURI, name);
      for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, value);
      return element;
    }
    map(axis, p) {
      const [w, b] = [[this.window[axis], this.window[axis + 2]], [this.panel.box[axis], this.panel.box[axis + 2]]];
      return b[0] + (p - w[0]) * (b[1] - b[0]) / (w[1] - w[0]);
    }
    inside(x, y) {
      const [l, t, r, b] = this.panel.box;
      return x >= l - 1 && x <= r + 1 && y >= t - 1 && y <= b + 1;
    }
    collect() {
      const other = '[id*="-matplotlib.axis_"], [id*="-legend"], defs', own = (part) => !part.closest(other);
      this.parts = { marks: [], shapes: [], words: [], axes: [] };
      for (const use of [...this.group.querySelectorAll("use")].filter(own)) {
        const x = +use.getAttribute("x"), y = +use.getAttribute("y");
        if (this.inside(x, y)) this.parts.marks.push([use, x, y]); else this.parts.shapes.push(use);
      }
      for (const path of [...this.group.querySelectorAll("path[clip-path]")].filter(own)) {
        // the clip stays where it is while the line moves
        const clip = this.node("g", { "clip-path": path.getAttribute("clip-path") });
        path.removeAttribute("clip-path"); path.before(clip); clip.append(path);
        this.parts.shapes.push(path);
      }
      for (const word of this.group.querySelectorAll(':scope > [id*="-text_"]')) {
        const b = word.getBBox(), x = b.x + b.width / 2, y = b.y + b.height / 2;
        if (this.inside(x, y)) this.parts.words.push([word, x, y]);
      }
      [...this.group.querySelectorAll('[id*="-matplotlib.axis_"]')].forEach((axis, k) => {
        const own = [...axis.querySelectorAll('[id*="tick_"]')], texts = own.map((t) => t.textContent.trim()).filter(Boolean);
        // a power of ten that the whole axis is multiplied by
        own.push(...[...axis.querySelectorAll(':scope > [id*="-text_"]')].filter((text) => /^1e/.test(text.textContent.trim())));
        this.parts.axes[k] = { ticks: own, labels: texts.length > 0, names: texts.some((t) => /[A-Za-z]/.test(t)) };
      });
      this.drawn = this.node("g", { class: "own-axes" });
      this.grid = this.node("g", { class: "own-grid" });
      this.group.firstElementChild.after(this.grid);
      this.group.append(this.drawn);
    }
    get whole() { return this.window.every((v, k) => v === this.panel.box[k]); }
    show(window) {
      this.window = window;
      if (!this.parts && this.whole) return;
      if (!this.parts) this.collect();
      const [sx, sy] = [0, 1].map((k) => this.map(k, 1) - this.map(k, 0)), matrix = `matrix(${sx} 0 0 ${sy} ${this.map(0, 0)} ${this.map(1, 0)})`;
      for (const shape of this.parts.shapes) {
        shape.setAttribute("transform", matrix);
        this.stroke(shape);
      }
      for (const [use, x, y] of this.parts.marks) { use.setAttribute("x", this.map(0, x)); use.setAttribute("y", this.map(1, y)); }
      for (const [word, x, y] of this.parts.words) {
        const [u, v] = [this.map(0, x), this.map(1, y)];
        word.setAttribute("transform", `translate(${u - x} ${v - y})`);
        word.style.visibility = this.inside(u, v) ? "" : "hidden";
      }
      this.axes();
    }
    // a stroke that does not grow with its line is measured on the screen and not in the drawing
    stroke(shape) {
      const style = shape.style, factor = this.svg.getScreenCTM().a;
      if (!shape.stroke0) shape.stroke0 = { width: parseFloat(style.strokeWidth) || 1, dashes: style.strokeDasharray };
      const { width, dashes } = shape.stroke0;
      style.vectorEffect = this.whole ? "" : "non-scaling-stroke";
      style.strokeWidth = this.whole ? width : width * factor;
      if (dashes && dashes !== "none") style.strokeDasharray = this.whole ? dashes : dashes.split(/[ ,]+/).map((d) => parseFloat(d) * factor).join(" ");
    }
    axes() {
      this.drawn.replaceChildren(); this.grid.replaceChildren();
      const [left, top, right, bottom] = this.panel.box;
      this.parts.axes.forEach((axis, k) => {
        for (const tick of axis.ticks) tick.style.display = this.whole ? "" : "none";
        if (this.whole) return;
        if (axis.names) {
          for (const tick of axis.ticks) {
            const b = tick.getAttribute("data-at") || (() => { tick.style.display = ""; const own = tick.getBBox(); return k ? own.y + own.height / 2 : own.x + own.width / 2; })();
            tick.setAttribute("data-at", b);
            const to = this.map(k, +b);
            tick.style.display = to >= this.panel.box[k] - 1 && to <= this.panel.box[k + 2] + 1 ? "" : "none";
            tick.setAttribute("transform", k ? `translate(0 ${to - b})` : `translate(${to - b} 0)`);
          }
          return;
        }
        const [from, to] = k ? [this.window[3], this.window[1]] : [this.window[0], this.window[2]];
        for (const value of ticks(this.panel, k, from, to)) {
          const at = this.map(k, place(this.panel, k, value));
          if (!(at >= this.panel.box[k] - 0.5 && at <= this.panel.box[k + 2] + 0.5)) continue;
          this.drawn.append(this.node("line", k ? { x1: left - 3, x2: left, y1: at, y2: at } : { x1: at, x2: at, y1: bottom, y2: bottom + 3 }));
          this.grid.append(this.node("line", k ? { x1: left, x2: right, y1: at, y2: at } : { x1: at, x2: at, y1: top, y2: bottom }));
          if (!axis.labels) continue;
          const word = this.node("text", k ? { x: left - 5, y: at + 2.8, "text-anchor": "end" } : { x: at, y: bottom + 11, "text-anchor": "middle" });
          word.textContent = compact(value);
          this.drawn.append(word);
        }
      });
      if (this.whole) for (const axis of this.parts.axes) for (const tick of axis.ticks) tick.removeAttribute("transform");
    }
  }
  for (const figure of document.querySelectorAll("figure[data-axes]")) {
    const svg = figure.querySelector("svg.plot"), link = figure.querySelector("a.csv");
    const panels = JSON.parse(figure.dataset.axes), shown = panels.map((panel, k) => new Panel(svg, panel, k));
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
    const tip = make("div", { class: "tip", hidden: "" }), dot = document.createElementNS(svg.namespaceURI, "circle");
    dot.setAttribute("r", "3"); dot.setAttribute("class", "dot"); dot.style.display = "none";
    svg.append(dot);
    // panels that share an axis show the same part of it
    const same = (a, b, axis) => a.box[axis] === b.box[axis] && a.box[axis + 2] === b.box[axis + 2] && String(a["xy"[axis]]) === String(b["xy"[axis]]);
    const show = (k, window) => {
      tip.hidden = true; dot.style.display = "none";
      panels.forEach((panel, i) => {
        const next = [...shown[i].window];
        for (const axis of [0, 1]) if (i === k || same(panel, panels[k], axis)) [next[axis], next[axis + 2]] = [window[axis], window[axis + 2]];
        if (String(next) !== String(shown[i].window)) shown[i].show(next);
      });
      back.disabled = shown.every((one) => one.whole);
    };
    const back = button("whole figure", () => panels.forEach((panel, k) => show(k, [...panel.box])), { disabled: "" });
    const closer = button("zoom in", () => {
      const next = shown.map((one) => { const [l, t, r, b] = one.window, w = 0.15 * (r - l), h = 0.15 * (b - t); return [l + w, t + h, r - w, b - h]; });
      next.forEach((window, k) => show(k, window));
    });
    tools.append(closer, back);
    const frame = make("div", { class: "frame" });
    svg.before(frame);
    frame.append(svg, tip);
    frame.after(tools);
    const at = (event) => new DOMPoint(event.clientX, event.clientY).matrixTransform(svg.getScreenCTM().inverse());
    let start = null;
    const box = document.createElementNS(svg.namespaceURI, "rect");
    box.setAttribute("class", "zoom");
    const over = (p) => shown.findIndex((one) => one.inside(p.x, p.y));
    svg.addEventListener("pointerdown", (event) => { if (event.pointerType === "mouse" && over(at(event)) >= 0) start = at(event); });
    svg.addEventListener("pointerup", (event) => {
      if (!start) return;
      const end = at(event), k = over(start), one = shown[k], [l, t, r, b] = one.panel.box;
      const to = (axis, p) => { const o = one.window, d = one.panel.box; return o[axis] + (p - d[axis]) / (d[axis + 2] - d[axis]) * (o[axis + 2] - o[axis]); };
      const [x0, x1] = [start.x, end.x].map((x) => Math.max(l, Math.min(r, x))).sort((p, q) => p - q);
      const [y0, y1] = [start.y, end.y].map((y) => Math.max(t, Math.min(b, y))).sort((p, q) => p - q);
      if (x1 - x0 > 8 && y1 - y0 > 8) show(k, [to(0, x0), to(1, y0), to(0, x1), to(1, y1)]);
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
        if (off.has(p.series)) continue;
        const one = shown[p.panel], x = one.map(0, p.px), y = one.map(1, p.py), distance = (x - here.x) ** 2 + (y - here.y) ** 2;
        if (distance < least && one.inside(x, y)) [best, least] = [{ ...p, x_: x, y_: y }, distance];
      }
      tip.hidden = !best; dot.style.display = best ? "" : "none";
      if (!best) return;
      dot.setAttribute("cx", best.x_); dot.setAttribute("cy", best.y_);
      tip.textContent = `${best.series}: ${isNaN(best.x) ? "" : short(best.x) + ", "}${short(best.y)}`;
      const bounds = frame.getBoundingClientRect(), x = event.clientX - bounds.left, y = event.clientY - bounds.top;
      tip.style.top = `${y + 12}px`;
      if (x > bounds.width / 2) { tip.style.right = `${bounds.width - x + 8}px`; tip.style.left = "auto"; } else { tip.style.left = `${x + 12}px`; tip.style.right = "auto"; }
    });
    svg.addEventListener("pointerleave", () => { tip.hidden = true; dot.style.display = "none"; start = null; box.remove(); });
  }
