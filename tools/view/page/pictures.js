// The two pictures of a moment: the plane of c and tan φ, and the wheel in its rut.
import {written} from "./chart.js";

const NS = "http://www.w3.org/2000/svg";
export const picture = (into, name, values, words) => {
  const e = into.appendChild(document.createElementNS(NS, name));
  for (const key in values) e.setAttribute(key, values[key]);
  if (words !== undefined) e.textContent = words;
  return e;
};
export const path = points => points.map(([x, y], i) => `${i ? "L" : "M"}${x.toFixed(1)} ${y.toFixed(1)}`).join("");

// --- the plane ---

const BOX = {left: 62, right: 466, top: 26, bottom: 286};

const CENTRE = {x: (BOX.left + BOX.right) / 2, y: (BOX.top + BOX.bottom) / 2};

// Values to places in a box, and points to a path.
const scaled = (box, xs, ys) => {
  const X = v => box.left + (v - xs[0]) / (xs[1] - xs[0]) * (box.right - box.left);
  const Y = v => box.bottom - (v - ys[0]) / (ys[1] - ys[0]) * (box.bottom - box.top);
  return [X, Y, points => path(points.map(([x, y]) => [X(x), Y(y)]))];
};

// The estimate in its prior, where the prior is far wider than what is drawn: in a corner that is free.
const inset = (svg, ranges, outline, stated, below) => {
  const box = below
    ? {left: BOX.left + 8, right: BOX.left + 128, top: BOX.bottom - 98, bottom: BOX.bottom - 8}
    : {left: BOX.right - 128, right: BOX.right - 8, top: BOX.top + 8, bottom: BOX.top + 98};
  const [, , at] = scaled(box, ...ranges);
  picture(svg, "rect", {class: "inset", x: box.left, y: box.top, width: box.right - box.left, height: box.bottom - box.top});
  picture(svg, "path", {class: "prior", d: at(stated)});
  picture(svg, "path", {class: "ellipse", d: at(outline) + "Z"});
};

export const plane = (svg, caption, ellipse, way, prior) => {
  svg.replaceChildren();
  if (!ellipse) { caption.textContent = "No estimate yet."; svg.setAttribute("aria-label", caption.textContent); return; }

  const turn = Array.from({length: 73}, (_, i) => i / 72 * 2 * Math.PI);
  const outline = turn.map(a => [ellipse.c + ellipse.ax * Math.cos(a), ellipse.tan_phi + ellipse.ay * Math.cos(a) + ellipse.by * Math.sin(a)]);
  const known = (prior && [prior.cohesion, prior.tan_phi]) || null;
  const passed = way.c.map((c, i) => [c, way.tanPhi[i]]).filter(p => p[0] !== null && p[1] !== null);
  const stated = known ? turn.map(a => [known[0][0] + 2 * known[0][1] * Math.cos(a), known[1][0] + 2 * known[1][1] * Math.sin(a)]) : [];
  const ranges = points => [span(points.map(p => p[0])), span(points.map(p => p[1]))];
  const near = ranges([...outline, ...passed]), far = ranges([...outline, ...passed, ...stated]);
  const wide = far.some(([low, high], i) => high - low > 2.5 * (near[i][1] - near[i][0])); // the prior would make the rest tiny
  const [xs, ys] = wide ? near : far;
  const [X, Y, at] = scaled(BOX, xs, ys);

  for (const v of svgTicks(...xs)) {
    picture(svg, "line", {class: "grid", x1: X(v), x2: X(v), y1: BOX.top, y2: BOX.bottom});
    picture(svg, "text", {x: X(v), y: BOX.bottom + 17, "text-anchor": "middle"}, number(v));
  }
  for (const v of svgTicks(...ys)) {
    picture(svg, "line", {class: "grid", x1: BOX.left, x2: BOX.right, y1: Y(v), y2: Y(v)});
    picture(svg, "text", {x: BOX.left - 7, y: Y(v) + 4, "text-anchor": "end"}, number(v));
  }
  picture(svg, "text", {class: "strong", x: BOX.right, y: BOX.bottom + 36, "text-anchor": "end"}, "cohesion c [Pa]");
  picture(svg, "text", {class: "strong", x: BOX.left - 7, y: BOX.top - 12, "text-anchor": "end"}, "tan φ");

  const inside = picture(svg, "svg", {x: 0, y: 0, width: 480, height: 330});
  const clip = picture(picture(inside, "defs", {}), "clipPath", {id: "inside"});
  picture(clip, "rect", {x: BOX.left, y: BOX.top, width: BOX.right - BOX.left, height: BOX.bottom - BOX.top});
  const plot = picture(inside, "g", {"clip-path": "url(#inside)"});
  if (known) picture(plot, "path", {class: "prior", d: at(stated)});
  picture(plot, "path", {class: "way", d: at(passed)});
  picture(plot, "path", {class: "ellipse", d: at(outline) + "Z"});
  picture(plot, "circle", {class: "centre", cx: X(ellipse.c), cy: Y(ellipse.tan_phi), r: 3.5});
  if (known && wide) inset(svg, far, outline, stated, X(ellipse.c) > CENTRE.x && Y(ellipse.tan_phi) < CENTRE.y);

  const words = `Filled: the estimate within 2σ, c ${written(ellipse.c, 0)} ± ${written(ellipse.ax / 2, 0)} Pa, tan φ ` +
    `${written(ellipse.tan_phi, 4)} ± ${written(Math.hypot(ellipse.ay, ellipse.by) / 2, 4)}. Line: its path in this window.` +
    (known ? ` Dashed${wide ? ", in the small picture at its own scale" : ""}: the stated prior, c ${written(known[0][0], 0)} ± ${written(known[0][1], 0)} Pa, tan φ ${written(known[1][0], 3)} ± ${written(known[1][1], 3)}.` : "");
  caption.textContent = words;
  svg.setAttribute("aria-label", words);
};

export const span = values => {
  const low = values.reduce((a, b) => Math.min(a, b), Infinity), high = values.reduce((a, b) => Math.max(a, b), -Infinity);
  const room = Math.max(high - low, 1e-6) * 0.12;
  return [low - room, high + room];
};

export const svgTicks = (low, high) => {
  const raw = (high - low) / 5, power = 10 ** Math.floor(Math.log10(raw));
  const step = [1, 2, 5, 10].map(s => s * power).find(s => s >= raw);
  const found = [];
  for (let i = Math.ceil(low / step); i * step <= high; i++) found.push(i * step);
  return found;
};
const number = v => `${+v.toPrecision(6)}`.replace("-", "−");

// --- the wheel ---

const GROUND = 196, MIDDLE = 240, SIZE = 150; // [px] the undisturbed surface, the axle, the radius
const STRESS = 74; // [px] of the greatest stress

export const wheel = (svg, caption, rim) => {
  svg.replaceChildren();
  if (!rim) { caption.textContent = "The wheel does not stand in soil, or is not known."; svg.setAttribute("aria-label", caption.textContent); return; }

  const entry = rim.theta[0], depth = SIZE * (1 - Math.cos(entry)), bottom = GROUND + depth, axle = bottom - SIZE;
  const on = (theta, r) => [MIDDLE + r * Math.sin(theta), axle + r * Math.cos(theta)];
  const edge = rim.theta.map(t => on(t, SIZE));
  // the surface ahead, the arc of contact, the rut behind
  picture(svg, "path", {class: "soil", d: path([[480, 330], [480, GROUND], ...edge, [0, bottom], [0, 330]]) + "Z"});
  picture(svg, "line", {class: "thin", "stroke-dasharray": "3 4", x1: 0, x2: MIDDLE + SIZE * Math.sin(entry), y1: GROUND, y2: GROUND});
  picture(svg, "circle", {class: "tyre", cx: MIDDLE, cy: axle, r: SIZE});
  picture(svg, "circle", {class: "thin", cx: MIDDLE, cy: axle, r: 4});

  const most = rim.sigma.reduce((a, b) => Math.max(a, b), 1e-9), peak = rim.sigma.indexOf(most);
  const shear = rim.tau.reduce((a, b) => Math.max(a, Math.abs(b)), 0), greatest = rim.tau.findIndex(v => Math.abs(v) === shear);
  const scale = STRESS / Math.max(most, shear);
  const out = values => values.map((v, i) => on(rim.theta[i], SIZE + Math.abs(v) * scale));
  picture(svg, "path", {class: "normal", d: path([...edge, ...out(rim.sigma).reverse()]) + "Z"});
  picture(svg, "path", {class: "shear", d: path(out(rim.tau))});
  const degrees = t => `${written(t * 180 / Math.PI, 1)}°`;
  for (const theta of [entry, rim.theta[peak], 0]) {
    const [x, y] = on(theta, SIZE);
    picture(svg, "line", {class: "thin", x1: MIDDLE, y1: axle, x2: x, y2: y});
  }

  const [ex, ey] = on(entry, SIZE), words = (x, y, text, kind, anchor = "start") => picture(svg, "text", {class: kind, x, y, "text-anchor": anchor}, text);
  words(Math.min(ex + 12, 400), ey - 8, `θ₁ ${degrees(entry)}`, "strong");
  words(10, GROUND - 6, "surface", "");
  words(10, bottom + 16, `rut, sinkage ${written(rim.sinkage * 1e3, 1)} mm`, "strong");
  picture(svg, "path", {class: "thin", d: `M${MIDDLE - 28} 20h56m-7 -5l7 5l-7 5`});
  words(MIDDLE, 14, "travel", "", "middle");

  const said = `Wheel of radius ${written(rim.radius * 1e3, 0)} mm, in contact from θ₁ ${degrees(entry)} to the bottom. Outwards from the rim, ` +
    `by the linear model at the estimate: normal stress σ (filled), up to ${written(most, 1)} kPa at θₘ ${degrees(rim.theta[peak])}, ` +
    `and shear stress τ (line), up to ${written(shear, 1)} kPa at ${degrees(rim.theta[greatest])}.`;
  caption.textContent = said;
  svg.setAttribute("aria-label", `${said} Sinkage ${written(rim.sinkage * 1e3, 1)} mm.`);
};
