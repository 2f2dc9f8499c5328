
  // --- scenes: tubes along lines, lit from the eye, drawn by WebGL ---
  const sides = 14;
  const sub = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
  const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
  const dot3 = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
  const unit = (a) => { const n = Math.hypot(...a) || 1; return a.map((v) => v / n); };
  const hex = (text) => [1, 3, 5].map((k) => parseInt(text.slice(k, k + 2), 16) / 255);
  const tube = (out, line, radii, colours) => {
    let normal = null;
    const rings = [];
    for (let i = 0; i < line.length; i++) {
      const along = unit(sub(line[Math.min(i + 1, line.length - 1)], line[Math.max(i - 1, 0)]));
      const seed = normal || (Math.abs(along[2]) < 0.9 ? [0, 0, 1] : [0, 1, 0]);
      normal = unit(sub(seed, along.map((v) => v * dot3(seed, along))));
      const second = cross(along, normal), ring = [];
      for (let k = 0; k <= sides; k++) {
        const [c, s] = [Math.cos(2 * Math.PI * k / sides), Math.sin(2 * Math.PI * k / sides)];
        const n = normal.map((v, d) => c * v + s * second[d]);
        ring.push([...line[i].map((v, d) => v + radii[i] * n[d]), ...n, ...colours[i]]);
      }
      rings.push(ring);
    }
    for (let i = 1; i < rings.length; i++) for (let k = 0; k < sides; k++) {
      const [a, b, c, d] = [rings[i - 1][k], rings[i - 1][k + 1], rings[i][k], rings[i][k + 1]];
      for (const v of [a, b, c, c, b, d]) out.push(...v);
    }
  };
  // every other piece of a tube, so that what lies inside shows
  const dashes = (out, line, radius, colours) => {
    const lengths = [0];
    for (let i = 1; i < line.length; i++) lengths.push(lengths[i - 1] + Math.hypot(...sub(line[i], line[i - 1])));
    const whole = lengths[lengths.length - 1], count = 2 * Math.max(1, Math.round(whole / radius / 6)) - 1;
    const at = (value) => {
      let i = 1;
      while (i < line.length - 1 && lengths[i] < value) i++;
      const share = (value - lengths[i - 1]) / (lengths[i] - lengths[i - 1] || 1);
      return [line[i - 1].map((v, d) => v + share * (line[i][d] - v)), colours[share < 0.5 ? i - 1 : i]];
    };
    for (let k = 0; k < count; k += 2) {
      const points = [0, 0.25, 0.5, 0.75, 1].map((part) => at(whole * (k + part) / count));
      tube(out, points.map(([p]) => p), points.map(() => radius), points.map(([, c]) => c));
    }
  };
  const ball = (out, centre, radius, colour) => {
    const line = [], radii = [];
    for (let k = 0; k <= 8; k++) { const a = Math.PI * k / 8; line.push([centre[0], centre[1], centre[2] - radius * Math.cos(a)]); radii.push(radius * Math.sin(a) + 1e-6); }
    tube(out, line, radii, line.map(() => colour));
  };
  const ramp = (share) => { const s = Math.max(0, Math.min(1, share)); return [0.2 + 0.75 * s, 0.45 - 0.25 * s, 0.85 - 0.75 * s]; };
  const VERTEX = "attribute vec3 p,n,c;uniform mat3 r;uniform vec3 f;uniform vec2 z;varying vec3 v;void main(){vec3 q=r*(p-f);vec3 m=r*n;float l=0.35+0.65*abs(m.z);v=c*l;gl_Position=vec4(q.xy*z,-q.z*min(z.x,z.y)*0.2,1.0);}";
  const FRAGMENT = "precision mediump float;varying vec3 v;void main(){gl_FragColor=vec4(v,1.0);}";
  const scene = (figure) => {
    const data = JSON.parse(figure.dataset.scene), image = figure.querySelector("img");
    const canvas = make("canvas", { tabindex: "0", role: "img", "aria-label": image.alt + ". Turn it by dragging or with the arrow keys." });
    const gl = canvas.getContext("webgl", { antialias: true });
    if (!gl) return;  // the picture stays
    const program = gl.createProgram();
    for (const [kind, text] of [[gl.VERTEX_SHADER, VERTEX], [gl.FRAGMENT_SHADER, FRAGMENT]]) {
      const shader = gl.createShader(kind);
      gl.shaderSource(shader, text); gl.compileShader(shader); gl.attachShader(program, shader);
    }
    gl.linkProgram(program);
    if (!gl.getProgramParameter(program, gl.LINK_STATUS)) return;
    gl.useProgram(program); gl.enable(gl.DEPTH_TEST);
    gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
    ["p", "n", "c"].forEach((name, k) => {
      const slot = gl.getAttribLocation(program, name);
      gl.enableVertexAttribArray(slot); gl.vertexAttribPointer(slot, 3, gl.FLOAT, false, 36, 12 * k);
    });
    let [right, up] = [data.right, data.up], zoom = 1, count = 0, state = data.start;
    const tools = make("div", { class: "tools" }), said = make("span", { class: "soft", role: "status" });
    const shown = new Set(data.models.map((m) => m.name));
    const slider = make("input", { type: "range", min: "0", max: String(data.s.length - 1), value: String(state), "aria-label": "along the path" });
    const coloured = button("colour by difference", () => {
      coloured.setAttribute("aria-pressed", String(coloured.getAttribute("aria-pressed") !== "true")); build();
    }, { "aria-pressed": "false" });
    const build = () => {
      const out = [], by = coloured.getAttribute("aria-pressed") === "true";
      for (const model of data.models) {
        const grey = [0.72, 0.72, 0.72];
        const put = (line, colour, size, dashed) => {
          for (const [first, last, radius] of model.pieces) {
            const part = line.slice(first, last), colours = part.map((_, k) => colour(first + k));
            if (dashed) dashes(out, part, size * radius, colours); else tube(out, part, part.map(() => size * radius), colours);
          }
          if (size >= 1) for (const j of model.joints) ball(out, line[j], 1.6 * data.joint, [0.8, 0.47, 0.65]);
        };
        if (model === data.models[0]) put(model.rest, () => grey, 0.6, false);
        if (!shown.has(model.name)) continue;
        const moved = model.moved[state], own = hex(model.colour);
        const line = model.rest.map((p, i) => p.map((v, d) => v + data.times[state] * moved[i][d]));
        const gap = model.gap && model.gap[state];
        put(line, (i) => (by && gap ? ramp(gap[i] / (data.largest || 1)) : own), model === data.models[0] ? 1 : 1.06, model !== data.models[0] && shown.size > 1);
      }
      count = out.length / 9;
      gl.bufferData(gl.ARRAY_BUFFER, new Float32Array(out), gl.DYNAMIC_DRAW);
      const at = data.models.filter((m) => shown.has(m.name)).map((m) => `${m.name} ${short(m.force[state])} N`).join(", ");
      said.textContent = ` ${short(data.s[state])} mm: ${at}; displacements × ${data.times[state]}` + (by ? `; red: ${short(data.largest)} mm apart` : "");
      draw();
    };
    const draw = () => {
      const ratio = Math.min(devicePixelRatio || 1, 2), w = canvas.clientWidth || 640, h = canvas.clientHeight || 400;
      if (canvas.width !== Math.round(w * ratio)) { canvas.width = Math.round(w * ratio); canvas.height = Math.round(h * ratio); }
      gl.viewport(0, 0, canvas.width, canvas.height);
      gl.clearColor(1, 1, 1, 1); gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
      const eye = cross(right, up), scale = zoom / data.size;
      gl.uniformMatrix3fv(gl.getUniformLocation(program, "r"), false, [0, 1, 2].flatMap((d) => [right[d], up[d], eye[d]]));
      gl.uniform3fv(gl.getUniformLocation(program, "f"), data.focus);
      const wide = w / h;
      gl.uniform2f(gl.getUniformLocation(program, "z"), wide > 1 ? scale * 1.0 : scale, wide > 1 ? scale * wide : scale * wide);
      gl.drawArrays(gl.TRIANGLES, 0, count);
    };
    const turn = (x, y) => {
      const eye = cross(right, up), c = Math.cos(x), s = Math.sin(x);
      const spun = unit(right.map((v, d) => c * v - s * eye[d])), back = cross(spun, up), d2 = Math.cos(y), s2 = Math.sin(y);
      up = unit(up.map((v, d) => d2 * v + s2 * back[d])); right = spun; right = unit(sub(right, up.map((v) => v * dot3(right, up))));
      draw();
    };
    canvas.addEventListener("pointerdown", (event) => canvas.setPointerCapture(event.pointerId));
    canvas.addEventListener("pointermove", (event) => { if (event.buttons) turn(event.movementX / 120, event.movementY / 120); });
    canvas.addEventListener("keydown", (event) => {
      const step = { ArrowLeft: [-0.1, 0], ArrowRight: [0.1, 0], ArrowUp: [0, -0.1], ArrowDown: [0, 0.1] }[event.key];
      if (step) { turn(...step); event.preventDefault(); }
    });
    slider.addEventListener("input", () => { state = +slider.value; build(); });
    for (const model of data.models) {
      const own = button(model.name, () => {
        const hide = shown.delete(model.name);
        if (!hide) shown.add(model.name);
        own.setAttribute("aria-pressed", String(!hide)); build();
      }, { "aria-pressed": "true" });
      tools.append(own);
    }
    tools.append(slider);
    if (data.models.some((m) => m.gap)) tools.append(coloured);
    tools.append(button("closer", () => { zoom *= 1.25; draw(); }), button("farther", () => { zoom /= 1.25; draw(); }), said);
    image.classList.add("print-only");
    image.before(canvas, tools);
    build();
    new ResizeObserver(draw).observe(canvas);
  };
  const near = new IntersectionObserver((entries) => {
    for (const entry of entries) if (entry.isIntersecting) { near.unobserve(entry.target); scene(entry.target); }
  }, { rootMargin: "200px" });
  document.querySelectorAll("figure[data-scene]").forEach((figure) => near.observe(figure));
  reveal();
})();
