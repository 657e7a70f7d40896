// The page over recordings: a time line to play and scrub, several runs laid over each other by time or way.
import {campaign} from "./campaign.js";
import {Chart, watched, written} from "./chart.js";
import {placed, stretch} from "./data.js";
import {plane, wheel} from "./pictures.js";
import {byId, events as tellEvents, facts, headline, legend, made, table, values} from "./tell.js";

const POINTS = 1200, COLOURS = [1, 2, 3, 4, 5, 6].map(n => `--run-${n}`);
const MANY = 8; // runs, from which on they can be searched
const EVERY = 100; // [ms] between moments that are asked for while it plays

const page = {about: null, charts: [], runs: [], active: 0, along: "time", span: null, at: 0, playing: false, speed: 1,
  events: [], asking: false, wanted: false, before: 0, curves: null, moment: null, round: 0, order: {by: "", down: false}};

const shown = () => page.runs.filter(run => run.shown);
const active = () => page.runs[page.active];
const end = run => (page.along === "time" ? run.duration : run.way);
const whole = () => [0, Math.max(...shown().map(end), end(active()), 1e-3)];
const span = () => page.span || whole();
const clock = seconds => {
  const minutes = Math.floor(seconds / 60), rest = (seconds - 60 * minutes).toFixed(span()[1] - span()[0] < 20 ? 2 : 0);
  return `${minutes}:${rest.padStart(rest.includes(".") ? 5 : 2, "0")}`;
};
const words = place => (page.along === "time" ? clock(place) : `${written(place, 3)} m`);

const control = {
  clock: false, span, events: () => (page.along === "time" ? page.events : []), zoom: chosen => zoomed(chosen),
  words: (u, ticks) => ticks.map(v => (page.along === "time" ? clock(v) : `${+v.toPrecision(6)}`)),
  prior: chart => (chart.prior && active().prior ? active().prior[chart.prior][0] * chart.factor : null),
  chosen: place => moved(place),
  index: time => { const at = time.findIndex(t => t > page.at); return at < 0 ? time.length - 1 : Math.max(at - 1, 0); },
  drawn: (u, line) => {
    u.ctx.setLineDash([]);
    u.ctx.strokeStyle = getComputedStyle(document.body).color;
    const x = u.valToPos(page.at, "x", true);
    line(x, u.bbox.top, x, u.bbox.top + u.bbox.height);
  },
};

// --- curves ---

const load = async () => {
  const round = ++page.round, [from, to] = span(), runs = shown();
  const room = 1e-9 * Math.abs(to);
  const got = await Promise.all(runs.map(run =>
    stretch({run: run.number, along: page.along, from, to: to + room, points: POINTS})));
  if (round !== page.round) return;
  runs.forEach((run, i) => { run.curves = got[i]; });
  draw();
};

const draw = () => {
  const runs = shown().filter(run => run.curves);
  if (runs.length === 1) page.charts.forEach(chart => chart.draw(runs[0].curves));
  else if (runs.length) page.charts.forEach(chart => chart.drawRuns(runs));
  byId("legend").hidden = runs.length !== 1;
  byId("span").textContent = `${words(span()[0])} to ${words(span()[1])}`;
  page.charts.forEach(chart => chart.label());
  table("curves", page.charts.flatMap(chart => chart.summary()));
};

// --- the instant ---

const moment = async () => {
  if (page.asking) { page.wanted = true; return; }
  page.asking = true;
  try {
    const answer = await (await fetch(`moment?run=${page.active}&along=${page.along}&at=${page.at}`)).json();
    page.moment = answer;
    headline(answer.headline);
    values(answer.values);
    facts("trust", answer.trust);
    document.body.dataset.sequence = answer.sequence;
    pictures();
  } finally {
    page.asking = false;
    if (page.wanted) { page.wanted = false; setTimeout(() => quietly(moment()), EVERY); }
  }
};

const pictures = () => {
  const way = active().curves ? active().curves.way : {c: [], tanPhi: []};
  plane(byId("plane"), byId("plane-caption"), page.moment.ellipse, way, active().prior);
  wheel(byId("wheel"), byId("wheel-caption"), page.moment.rim);
};

const moved = place => {
  const last = end(active());
  page.at = Math.min(Math.max(place, 0), last);
  byId("scrub").value = 1000 * page.at / (last || 1);
  byId("scrub").setAttribute("aria-valuetext", words(page.at));
  byId("at").textContent = `${words(page.at)} of ${words(last)}`;
  page.charts.forEach(chart => { chart.plot.redraw(false); chart.values(); });
  quietly(moment());
};

const played = now => {
  if (!page.playing) return;
  const passed = (now - page.before) / 1000, last = end(active());
  if (passed * 1000 >= EVERY) {
    page.before = now;
    const rate = page.along === "time" ? page.speed : page.speed * last / active().duration;
    moved(page.at + passed * rate);
    if (page.span && page.at > page.span[1]) zoomed([page.at, page.at + page.span[1] - page.span[0]]);
    if (page.at >= last) play(false);
  }
  requestAnimationFrame(played);
};

const play = on => {
  page.playing = on;
  byId("play").setAttribute("aria-pressed", String(on));
  byId("play").textContent = on ? "Stop" : "Play";
  if (!on) return;
  if (page.at >= end(active())) page.at = 0;
  page.before = performance.now();
  requestAnimationFrame(played);
};

const quietly = promise => promise.catch(error => {
  headline({tone: "bad", title: "The view does not answer", reason: "Start gritd view again and load the page anew.", notes: []});
  console.warn(error.message);
});

// --- zoom ---

const zoomed = chosen => {
  const all = whole();
  page.span = chosen && [Math.max(chosen[0], all[0]), Math.min(chosen[1], all[1])];
  if (page.span && page.span[1] - page.span[0] >= 0.999 * (all[1] - all[0])) page.span = null;
  if (page.span && page.span[0] >= page.span[1]) page.span = null;
  byId("whole").hidden = !page.span;
  quietly(load());
};
const scaled = factor => {
  const [from, to] = span(), middle = page.at > from && to > page.at ? page.at : (from + to) / 2;
  zoomed([middle - (middle - from) * factor, middle + (to - middle) * factor]);
};
const shifted = share => {
  const [from, to] = span(), by = share * (to - from);
  if (page.span) zoomed([from + by, to + by]);
  else moved(page.at + by / 25);
};

// --- runs ---

const chosen = async number => {
  page.active = number;
  active().shown = true;
  page.events = await (await fetch(`events?run=${number}`)).json();
  tellEvents(page.events, clock);
  byId("ticks").replaceChildren(...page.events.map(event => {
    const tick = made("i", undefined, event.kind);
    tick.title = `${clock(event.time)} ${event.text}`;
    tick.style.left = `${100 * event.time / active().duration}%`;
    return tick;
  }));
  listed();
  quietly(differed());
  moved(page.at);
  await load();
};

// Of a column: numbers by size, what is not known last; words as people sort them.
const NUMBERS = new Set(["load", "duration", "way", "c", "tan_phi"]);
const compared = (by, a, b) => {
  if (!NUMBERS.has(by)) return a[by].localeCompare(b[by], "en", {numeric: true});
  const [x, y] = [a, b].map(run => parseFloat(run[by]));
  return Number.isNaN(x) || Number.isNaN(y) ? Number.isNaN(x) - Number.isNaN(y) : x - y;
};

const inOrder = () => {
  const {by, down} = page.order, words = byId("filter").value.toLowerCase();
  const found = page.runs.filter(run => `${run.name} ${run.status} ${run.notes}`.toLowerCase().includes(words));
  if (by) found.sort((a, b) => (down ? -1 : 1) * compared(by, a, b));
  return found;
};

const sortable = () => {
  for (const head of byId("runs").tHead.querySelectorAll("[data-by]")) {
    const button = made("button", head.textContent);
    head.replaceChildren(button);
    button.addEventListener("click", () => {
      page.order = {by: head.dataset.by, down: page.order.by === head.dataset.by && !page.order.down};
      for (const other of byId("runs").tHead.querySelectorAll("[data-by]"))
        other.ariaSort = other === head ? (page.order.down ? "descending" : "ascending") : "none";
      listed();
    });
  }
  byId("filter").hidden = page.runs.length < MANY;
  byId("filter").addEventListener("input", listed);
};

const listed = () => {
  byId("runs").tBodies[0].replaceChildren(...inOrder().map(run => {
    const row = made("tr"), name = made("th"), drawn = made("td"), above = made("td");
    const swatch = name.appendChild(made("i", undefined, "swatch"));
    swatch.style.color = `var(${run.colour})`;
    name.append(run.name);
    name.title = run.file;
    const box = drawn.appendChild(made("input")), radio = above.appendChild(made("input"));
    Object.assign(box, {type: "checkbox", checked: run.shown, disabled: run.number === page.active});
    Object.assign(radio, {type: "radio", name: "active", checked: run.number === page.active});
    box.setAttribute("aria-label", `draw ${run.name}`);
    radio.setAttribute("aria-label", `show ${run.name} above`);
    box.addEventListener("change", () => { run.shown = box.checked; quietly(load()); });
    radio.addEventListener("change", () => quietly(chosen(run.number)));
    row.append(name, drawn, above, made("td", run.load === null ? "–" : `${run.load} N`), made("td", clock(run.duration)),
      made("td", `${written(run.way, 3)} m`, "more"), made("td", run.status), made("td", run.c), made("td", run.tan_phi), made("td", run.notes, "more"));
    return row;
  }));
  byId("runs").hidden = page.runs.length < 2;
  byId("differences").hidden = page.runs.length < 2;
  const run = active(), day = new Date(1000 * Math.ceil(run.start)).toISOString().slice(0, 16).replace("T", " ");
  byId("about").textContent = `${["gritd", run.testbed, run.name, `${day} UTC`, run.operator, run.notes].filter(Boolean).join(" · ")}`;
  document.title = `${run.name} – gritd`;
};

// How the run above differs from another in what it was made with.
const differed = async () => {
  const others = page.runs.filter(run => run.number !== page.active), select = byId("other");
  const before = select.value;
  select.replaceChildren(...others.map(run => Object.assign(made("option", run.name), {value: run.number})));
  if (others.some(run => String(run.number) === before)) select.value = before;
  if (!byId("differences").open || others.length === 0) return;
  const found = await (await fetch(`diff?run=${page.active}&other=${select.value}`)).json();
  found.sort((a, b) => b.matters - a.matters);
  table("keys-of", found.map(d => [d.key, d.first || "nothing", d.second || "nothing", d.matters ? "yes" : "no"]));
  byId("keys-of").hidden = found.length === 0;
  byId("alike").hidden = found.length > 0;
};

// What was read of the files so far; asked again until it is all.
const reading = async about => {
  const left = about.runs.filter(run => !run.whole).length, damage = about.runs.flatMap(run => run.damage.map(line => `${run.name}: ${line}`));
  byId("reading").hidden = !about.busy && damage.length === 0;
  byId("reading").textContent = about.busy
    ? `A first look: ${about.runs.length - left} of ${about.runs.length} recordings are read whole.` : `Damaged: ${damage.join("; ")}`;
  document.body.dataset.whole = String(!about.busy);
  if (!about.busy) return;
  await new Promise(done => { setTimeout(done, 700); });
  const next = await (await fetch("about")).json();
  const more = next.runs.some((run, i) => run.whole !== about.runs[i].whole);
  next.runs.forEach((run, i) => Object.assign(page.runs[i], run));
  if (more) await chosen(page.active);
  await reading(next);
};

const wire = () => {
  byId("windows").hidden = true;
  byId("pause").hidden = true;
  byId("whole").textContent = "Whole run";
  byId("state").hidden = true;
  byId("player").hidden = false;
  byId("keys").textContent = "Keys: space plays and stops, + and − zoom, ← → move, Escape shows the whole. Drag over a curve to zoom, click to go there.";
  byId("whole").addEventListener("click", () => zoomed(null));
  byId("charts").addEventListener("dblclick", () => zoomed(null));
  byId("play").addEventListener("click", () => play(!page.playing));
  byId("speed").addEventListener("change", event => { page.speed = Number(event.target.value); });
  byId("along").addEventListener("change", event => { page.along = event.target.value; page.at = 0; zoomed(null); moved(0); });
  byId("scrub").addEventListener("input", event => moved(Number(event.target.value) / 1000 * end(active())));
  byId("differences").addEventListener("toggle", () => quietly(differed()));
  byId("other").addEventListener("change", () => quietly(differed()));
  const keys = {" ": () => play(!page.playing), "+": () => scaled(0.5), "-": () => scaled(2),
    ArrowLeft: () => shifted(-0.25), ArrowRight: () => shifted(0.25), Escape: () => zoomed(null)};
  addEventListener("keydown", event => {
    if (event.target.closest("button, summary, input, select") && event.key !== "Escape") return;
    const act = event.ctrlKey || event.metaKey || event.altKey ? undefined : keys[event.key];
    if (act) { event.preventDefault(); act(); }
  });
};

export const recorded = async about => {
  page.about = about;
  page.runs = about.runs.map((run, number) => ({...run, number, shown: number < COLOURS.length, colour: COLOURS[number % COLOURS.length]}));
  page.charts = placed(about.charts).map(chart => new Chart(chart, byId("charts"), control));
  legend();
  wire();
  sortable();
  watched(page.charts, draw);
  page.at = active().duration;
  await chosen(0);
  await Promise.all([reading(about), campaign()]);
};
