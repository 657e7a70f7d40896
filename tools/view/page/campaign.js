// A campaign: torque and drawbar pull against slip beside both forms of the equations, estimates run by run.
import {written} from "./chart.js";
import {path, picture, span, svgTicks} from "./pictures.js";
import {byId, made} from "./tell.js";

const BOX = {left: 56, right: 470, top: 26, bottom: 262};
const FORCES = [["torque", "torque T [N·m]", "T", "N·m"], ["drawbar_pull", "drawbar pull DP [N]", "DP", "N"]];
const COLOURS = 6;

export const campaign = async () => {
  const answer = await (await fetch("campaign")).json();
  byId("campaign").hidden = false;
  if (answer.state === "computing") {
    byId("campaign-caption").textContent = "Computing the forces of all runs by both forms of the equations …";
    setTimeout(() => campaign().catch(() => {}), 1500);
    return;
  }
  document.body.dataset.campaign = answer.state;
  if (answer.state === "failed") { byId("campaign-caption").textContent = `No campaign: ${answer.reason}`; return; }

  byId("campaign-caption").textContent = `Dots: windows of the runs, by load. Line: original equations (1) to (10); dashed: closed form (20) to (22); both with ` +
    `the soil that all runs together know, c ${pair(answer.soil.cohesion, 0)} Pa, tan φ ${pair(answer.soil.tan_phi, 4)}.`;
  const refused = answer.runs.map((run, i) => (run.counts ? "" : `run ${i + 1} is not believed: ${run.reason}`)).filter(Boolean);
  byId("refused").replaceChildren(...refused.map(words => made("li", `Left out, ${words}.`)));
  const into = byId("forces");
  into.replaceChildren(...FORCES.map(force => drawn(answer, ...force)).filter(Boolean), estimates(answer, "cohesion", "cohesion c [Pa]", 0),
    estimates(answer, "tan_phi", "tan φ", 4));
};

const pair = (known, decimals) => `${written(known.value, decimals)} ± ${written(known.sigma, decimals)}`;

const drawn = (answer, name, label, symbol, unit) => {
  const parts = answer.runs.flatMap(run => run.loads.map(load => ({...load, run: run.name, of: load[name]})))
    .filter(part => part.of.measured.some(v => v !== null));
  if (parts.length === 0) return null;

  const loads = [...new Set(parts.map(part => Math.round(part.load)))].sort((a, b) => a - b);
  const groups = grouped(loads), tones = toned(answer.runs, groups);
  const slips = parts.flatMap(part => part.slip.map(v => 100 * v));
  const forces = parts.flatMap(part => [...part.of.measured, ...part.of.original.value, ...part.of.closed.value]).filter(v => v !== null);
  const {figure, svg, X, Y, words} = axes(span(slips), span(forces), label, "slip [%]");
  for (const part of parts) {
    const tone = `run-${tones.get(groups.get(Math.round(part.load)))}`;
    const dots = part.of.measured.map((v, i) => (v === null ? "" : `M${X(100 * part.slip[i]).toFixed(1)} ${Y(v).toFixed(1)}h0`)).join("");
    picture(svg, "path", {class: `dots ${tone}`, d: dots});
    const curve = (of, kind) => picture(svg, "path", {class: `curve ${tone} ${kind}`, d: path(of.slip.map((s, i) => [X(100 * s), Y(of.value[i])]))});
    curve(part.of.original, "");
    curve(part.of.closed, "dashed");
  }
  [...new Map(loads.map(load => [groups.get(load), load]))].reverse().forEach(([group, load], i) =>
    words(`${load} N`, BOX.right - 52 * i, BOX.top - 10, `run-text-${tones.get(group)}`));

  const off = which => {
    const known = parts.filter(part => part.of.off[which] !== null), count = known.reduce((sum, part) => sum + part.slip.length, 0);
    return written(Math.sqrt(known.reduce((sum, part) => sum + part.of.off[which] ** 2 * part.slip.length, 0) / count), 3);
  };
  const said = `${symbol} against slip. What was measured differs by ${off("original")} ${unit} from the original equations, by ${off("closed")} ${unit} from the closed form (root mean square).`;
  figure.appendChild(made("figcaption", said));
  svg.setAttribute("aria-label", said);
  return figure;
};

// Loads closer than 5 % are one.
const grouped = loads => {
  const found = new Map();
  let group = -1, first = -Infinity;
  for (const load of loads) {
    if (load > 1.05 * first) { group++; first = load; }
    found.set(load, group);
  }
  return found;
};

// The colour of each group of loads: that of its first run in the curves above, where every run has one load.
const toned = (runs, groups) => {
  const driven = runs.map(run => [...new Set(run.loads.map(load => groups.get(Math.round(load.load))))].filter(group => group !== undefined));
  const single = driven.every(own => own.length <= 1);
  return new Map([...new Set(groups.values())].map(group =>
    [group, (single ? driven.findIndex(own => own.includes(group)) : group) % COLOURS + 1]));
};

const estimates = (answer, name, label, decimals) => {
  // A run that is not believed does not set the scale: its σ may be larger than all others together.
  const believed = answer.runs.filter(run => run.counts), of = believed.length ? believed : answer.runs;
  const edges = [...of.map(run => run.alone), ...answer.runs.map(run => run.together)].flatMap(soil => {
    const {value, sigma} = soil[name];
    return [value - 2 * sigma, value + 2 * sigma];
  });
  const {figure, svg, Y, words} = axes([0.4, answer.runs.length + 0.6], span(edges), label, "run", answer.runs.map((run, i) => i + 1));
  const X = v => BOX.left + (v - 0.4) / (answer.runs.length + 0.2) * (BOX.right - BOX.left);
  answer.runs.forEach((run, i) => {
    for (const [which, shift, kind] of [["alone", -0.1, "alone"], ["together", 0.1, "together"]]) {
      const {value, sigma} = run[which][name], x = X(i + 1 + shift), inside = y => Math.min(Math.max(y, BOX.top), BOX.bottom);
      picture(svg, "line", {class: `whisker ${kind}`, x1: x, x2: x, y1: inside(Y(value - 2 * sigma)), y2: inside(Y(value + 2 * sigma))});
      if (inside(Y(value)) === Y(value)) picture(svg, "circle", {class: `point ${kind}`, cx: x, cy: Y(value), r: 3.5});
    }
  });
  words("alone", BOX.right - 150, BOX.top - 10, "");
  words("with those before it", BOX.right, BOX.top - 10, "estimate-text");
  const said = `${label} run by run within 2σ, in the order of the table: ` + answer.runs.map((run, i) => `${i + 1} ${run.name}`).join(", ") +
    `. All together ${pair(answer.soil[name], decimals)}.`;
  figure.appendChild(made("figcaption", said));
  svg.setAttribute("aria-label", said);
  return figure;
};

const axes = (xs, ys, label, below, marks) => {
  const figure = made("figure");
  const svg = picture(figure, "svg", {viewBox: "0 0 480 305", role: "img"});
  const X = v => BOX.left + (v - xs[0]) / (xs[1] - xs[0]) * (BOX.right - BOX.left);
  const Y = v => BOX.bottom - (v - ys[0]) / (ys[1] - ys[0]) * (BOX.bottom - BOX.top);
  const words = (text, x, y, kind, anchor = "end") => picture(svg, "text", {class: kind, x, y, "text-anchor": anchor}, text);
  for (const v of marks || svgTicks(...xs)) words(String(+v.toPrecision(6)), X(v), BOX.bottom + 17, "", "middle");
  for (const v of svgTicks(...ys)) {
    picture(svg, "line", {class: "grid", x1: BOX.left, x2: BOX.right, y1: Y(v), y2: Y(v)});
    words(`${+v.toPrecision(6)}`.replace("-", "−"), BOX.left - 7, Y(v) + 4, "");
  }
  words(label, BOX.left, BOX.top - 10, "strong", "start");
  words(below, BOX.right, BOX.bottom + 36, "strong");
  return {figure, svg, X, Y, words};
};
