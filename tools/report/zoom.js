// Zooming of the curves. A page without this script is whole; it adds to pictures what a hand can do:
// drag over a stretch, + and - and the arrows where a picture has the focus, double click or Escape
// for the whole again. Kept free of the characters that XML reserves.
"use strict";
(() => {
  const NS = "http://www.w3.org/2000/svg";
  const HINT = " Drag over a stretch of a curve to zoom; double click for the whole.";
  const LEAST = 8; // [px] a shorter drag is a click
  const below = (a, b) => b > a;
  const made = (name, values, into) => {
    const e = into.appendChild(document.createElementNS(NS, name));
    for (const key in values) e.setAttribute(key, values[key]);
    return e;
  };

  // Axes: {frame, marks, x: [low, high, start, end], y: the same}, the data's range on pixels.
  const axesOf = plot => [...plot.querySelectorAll("g[data-x]")].map(frame => {
    const [x, y] = ["x", "y"].map(k => frame.dataset[k].split(" ").map(Number));
    const top = y[3];
    const marks = [...plot.querySelectorAll("svg")].filter(s => Number(s.getAttribute("y")) === top);
    return {frame, marks, x, y, now: {x: [x[0], x[1]], y: [y[0], y[1]]}};
  });

  const at = (s, now, value) => s[2] + (value - now[0]) / (now[1] - now[0]) * (s[3] - s[2]);
  const value = (s, now, px) => now[0] + (px - s[2]) / (s[3] - s[2]) * (now[1] - now[0]);

  const ticks = (low, high, most) => {
    const raw = (high - low) / most, power = 10 ** Math.floor(Math.log10(raw));
    const step = [1, 2, 5, 10].map(s => s * power).find(s => s >= raw * (1 - 1e-9));
    const places = Math.max(0, -Math.floor(Math.log10(step) + 1e-9)), found = [];
    for (let i = Math.ceil(low / step - 1e-9); high / step + 1e-9 >= i; i++) found.push(i * step);
    const words = v => Math.abs(v) > 1e-9 * step ? v.toFixed(places).replace("-", "\u2212") : "0";
    return found.slice(0, most).map(v => [v, words(v)]);
  };

  const drawn = axes => {
    const {frame, marks, x, y, now} = axes;
    const scale = (s, n) => [s[1] - s[0], n[1] - n[0]].reduce((a, b) => a / b);
    const [sx, sy] = [scale(x, now.x), scale(y, now.y)];
    const tx = at(x, now.x, x[0]) - sx * x[2], ty = at(y, now.y, y[0]) - sy * y[2];
    for (const svg of marks) for (const mark of svg.children)
      mark.setAttribute("transform", `matrix(${sx} 0 0 ${sy} ${tx} ${ty})`);

    for (const old of frame.querySelectorAll(".tick")) old.remove();
    for (const [v, words] of ticks(...now.y, Number(frame.dataset.most))) {
      const h = at(y, now.y, v);
      made("line", {class: "grid tick", x1: x[2], x2: x[3], y1: h, y2: h}, frame);
      made("text", {class: "tick", x: x[2] - 6, y: h + 3.5, "text-anchor": "end"}, frame).textContent = words;
    }
    if (frame.dataset.below === undefined) return;
    for (const [v, words] of ticks(...now.x, 6))
      made("text", {class: "tick", x: at(x, now.x, v), y: y[2] + 14, "text-anchor": "middle"}, frame)
        .textContent = words;
  };

  const zoomable = plot => {
    const all = axesOf(plot);
    if (all.length === 0) return;
    const shown = () => all.forEach(drawn);
    const whole = () => { all.forEach(a => { a.now = {x: a.x.slice(0, 2), y: a.y.slice(0, 2)}; }); shown(); };
    const along = range => { all.forEach(a => { a.now.x = range; }); };
    const place = event => new DOMPoint(event.clientX, event.clientY)
      .matrixTransform(plot.getScreenCTM().inverse());
    const inside = p => all.find(a => [p.y - a.y[3], a.y[2] - p.y, p.x - a.x[2], a.x[3] - p.x].every(d => d >= 0));

    plot.tabIndex = 0;
    plot.classList.add("zoomable");
    let from = null, box = null, of = null;

    plot.addEventListener("pointerdown", event => {
      if (event.pointerType === "touch" || event.button !== 0) return; // fingers scroll and pinch
      from = place(event);
      of = inside(from);
      if (of === undefined) { from = null; return; }
      if (event.isTrusted) plot.setPointerCapture(event.pointerId);
      box = made("rect", {class: "chosen"}, plot);
      event.preventDefault();
      plot.focus({preventScroll: true});
    });
    const ends = event => {
      const p = place(event), cut = (v, a, b) => Math.min(Math.max(v, a), b);
      const xs = [from.x, cut(p.x, of.x[2], of.x[3])].sort((a, b) => a - b);
      const ys = [from.y, cut(p.y, of.y[3], of.y[2])].sort((a, b) => a - b);
      return [xs, below(ys[1] - ys[0], 3 * LEAST) ? [of.y[3], of.y[2]] : ys];
    };
    plot.addEventListener("pointermove", event => {
      if (from === null) return;
      const [xs, ys] = ends(event);
      const size = {x: xs[0], y: ys[0], width: xs[1] - xs[0], height: ys[1] - ys[0]};
      for (const key in size) box.setAttribute(key, size[key]);
    });
    plot.addEventListener("pointerup", event => {
      if (from === null) return;
      const [xs, ys] = ends(event);
      if (xs[1] - xs[0] >= LEAST) {
        of.now.y = [value(of.y, of.now.y, ys[1]), value(of.y, of.now.y, ys[0])];
        along(xs.map(px => value(of.x, of.now.x, px)));
        shown();
      }
      from = null;
      box.remove();
    });
    plot.addEventListener("pointercancel", () => { if (from !== null) { from = null; box.remove(); } });
    plot.addEventListener("dblclick", whole);
    plot.addEventListener("keydown", event => {
      const [low, high] = all[0].now.x, width = high - low;
      const moved = {"+": [low + width / 4, high - width / 4], "-": [low - width / 2, high + width / 2],
        ArrowLeft: [low - width / 4, high - width / 4], ArrowRight: [low + width / 4, high + width / 4]}[event.key];
      if (event.key === "Escape") whole();
      else if (moved !== undefined) { along(moved); shown(); }
      else return;
      event.preventDefault();
    });
  };
  document.querySelectorAll("svg.plot").forEach(zoomable);
  const first = document.querySelector("figure:has(.zoomable) figcaption");
  if (first !== null) {
    const hint = first.appendChild(document.createElement("span"));
    hint.className = "hint";
    hint.textContent = HINT;
  }
  addEventListener("beforeprint", () => document.querySelectorAll("svg.plot").forEach(
    plot => plot.dispatchEvent(new Event("dblclick"))));
})();
