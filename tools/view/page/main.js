// The page: asks what there is to show, follows the stream of frames, and draws.
import {Chart, watched} from "./chart.js";
import {Curves, placed, stretch} from "./data.js";
import {plane, wheel} from "./pictures.js";
import {recorded} from "./recorded.js";
import {byId, events as tellEvents, facts, headline, legend, made, state, table, values} from "./tell.js";

const WINDOWS = [60, 300, 900, 1800, 3600]; // [s]
const POINTS = 1200, TEXT = 250, LABELS = 5000; // points of a curve; [ms] between changes of words, of labels
const RENEW = 900; // rows appended before the curves are asked for anew
const still = matchMedia("(prefers-reduced-motion: reduce)");

const page = {about: null, charts: [], curves: new Curves(), events: [], frame: null, prior: null,
  window: WINDOWS[0], held: null, marks: -1, answered: 0, frames: 0, written: 0, drawn: 0, took: 0, labelled: 0};

const span = () => page.held || [(page.curves.last || 0) - page.window, page.curves.last || 1];
const utc = t => new Date(t * 1e3).toISOString().slice(11, 19);

const control = {
  clock: true, span, events: () => page.events, zoom: chosen => hold(chosen), drawn: () => {}, chosen: () => {},
  index: time => time.length - 1,
  prior: chart => (chart.prior && page.prior ? page.prior[chart.prior][0] * chart.factor : null),
};

// --- what is asked for ---

const renew = async () => {
  const held = page.held;
  const query = held ? {from: held[0], to: held[1], points: POINTS} : {seconds: page.window, points: POINTS};
  page.curves.added = 0;
  const got = await stretch(query);
  if (held === page.held) { page.curves.replace(got); page.drawn = 0; draw(); }
};

const renewEvents = async () => {
  page.events = await (await fetch("events")).json();
  tellEvents(page.events, utc);
};

const quietly = promise => promise.catch(() => {}); // the stream says it when the view does not answer

// --- pause, zoom, window ---

const hold = chosen => { page.held = chosen; controls(); quietly(renew()); };

const choose = seconds => {
  page.window = seconds;
  page.held = null;
  controls();
  quietly(renew());
};

const scaled = factor => {
  const at = Math.min(Math.max(WINDOWS.indexOf(page.window) + (factor > 1 ? 1 : -1), 0), WINDOWS.length - 1);
  if (!page.held) { choose(WINDOWS[at]); return; }
  const [from, to] = page.held, half = (to - from) / 2 * factor;
  hold([(from + to) / 2 - half, (from + to) / 2 + half]);
};

const moved = share => {
  const [from, to] = span(), by = share * (to - from);
  hold([from + by, to + by]);
};

const controls = () => {
  for (const button of byId("windows").children)
    button.setAttribute("aria-pressed", String(!page.held && Number(button.dataset.seconds) === page.window));
  byId("pause").setAttribute("aria-pressed", String(Boolean(page.held)));
  byId("pause").textContent = page.held ? "Paused" : "Pause";
  byId("whole").hidden = !page.held;
  byId("whole").textContent = "Back to now";
};

const wire = () => {
  for (const seconds of WINDOWS) {
    const button = byId("windows").appendChild(made("button", `${seconds / 60} min`));
    button.dataset.seconds = seconds;
    button.addEventListener("click", () => choose(seconds));
  }
  byId("pause").addEventListener("click", () => (page.held ? choose(page.window) : hold(span())));
  byId("whole").addEventListener("click", () => choose(page.window));
  byId("charts").addEventListener("dblclick", () => choose(page.window));
  const keys = {" ": () => byId("pause").click(), "+": () => scaled(0.5), "-": () => scaled(2),
    ArrowLeft: () => moved(-0.25), ArrowRight: () => moved(0.25), Escape: () => choose(page.window)};
  addEventListener("keydown", event => {
    if (event.target.closest("button, summary, input, select") && event.key === " ") return;
    const act = event.ctrlKey || event.metaKey || event.altKey ? undefined : keys[event.key];
    if (act) { event.preventDefault(); act(); }
  });
  watched(page.charts, () => { page.drawn = 0; draw(); });
  controls();
};

// --- drawing ---

const draw = () => {
  const now = performance.now();
  const slow = page.window > 300 || still.matches ? 1000 : 90; // [ms] a wide window moves slowly
  if (now - page.drawn < Math.max(slow, 4 * page.took)) return; // a slow computer has time for other things
  page.drawn = now;
  if (page.curves.time.length) page.charts.forEach(chart => chart.draw(page.curves));
  if (page.frame) {
    plane(byId("plane"), byId("plane-caption"), page.frame.ellipse, page.curves.way, page.prior);
    wheel(byId("wheel"), byId("wheel-caption"), page.frame.rim);
  }
  const [from, to] = span();
  page.took = performance.now() - now;
  byId("span").textContent = page.curves.time.length ? `${utc(from)} to ${utc(to)} UTC` : "";
};

const label = () => {
  page.charts.forEach(chart => chart.label());
  table("curves", page.charts.flatMap(chart => chart.summary()));
};

const tell = () => {
  const frame = page.frame, now = performance.now();
  if (now - page.written < TEXT) return;
  page.written = now;
  byId("about").textContent = `gritd · ${frame.about}`;
  document.title = `${frame.headline.title} – gritd`;
  document.body.dataset.sequence = frame.sequence;
  document.body.dataset.time = frame.time;
  values(frame.values);
  facts("trust", frame.trust);
  state(frame);
  if (now - page.labelled > LABELS) { page.labelled = now; label(); }
};

// --- the stream ---

const taken = frame => {
  page.frames++;
  headline(frame.headline);
  if (frame.marks !== page.marks) { page.marks = frame.marks; quietly(renewEvents()); }
  document.body.classList.toggle("stale", frame.time === null);
  if (frame.time === null) return;

  page.frame = frame;
  page.prior = frame.prior;
  if (frame.row && !page.held) {
    if (page.curves.last > frame.time + 1) page.curves.clear(); // another daemon's clock
    page.curves.append(frame.time, frame.row, frame.ellipse);
    page.curves.trim(frame.time - 1.2 * page.window);
  }
  if (page.curves.added > RENEW && !page.held) quietly(renew());
  tell();
  if (!page.held && !document.hidden) draw();
};

const silent = () => {
  document.body.classList.add("stale");
  headline({tone: "bad", title: "The view does not answer", reason: "The page tries again by itself.", notes: []});
};

const follow = () => {
  const source = new EventSource("live");
  source.addEventListener("open", () => { page.written = 0; quietly(renew()); });
  source.addEventListener("message", event => taken(JSON.parse(event.data)));
  source.addEventListener("error", () => {
    silent();
    if (source.readyState === EventSource.CLOSED) setTimeout(follow, 3000);
  });
};

const begin = async () => {
  page.about = await (await fetch("about")).json();
  if (!page.about.live) { await recorded(page.about); return; }
  page.charts = placed(page.about.charts).map(chart => new Chart(chart, byId("charts"), control));
  legend();
  wire();
  follow();
};

addEventListener("load", () => begin().catch(silent));
