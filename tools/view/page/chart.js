// A curve along time: uPlot, with bands of ± 2σ, marks of events, the stated prior, and zoom by a drag.

const HEIGHT = 190;
const MARKS = {good: "--good", note: "--note", bad: "--bad"};

export const colour = name => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
const faded = (name, share) => colour(name) + Math.round(share * 255).toString(16).padStart(2, "0");

export const written = (value, decimals) =>
  value === null || value === undefined ? "–" : value.toFixed(decimals).replace("-", "−");

export class Chart {
  constructor(of, into, control) {
    this.of = of;
    this.control = control;
    this.box = into.appendChild(document.createElement("div"));
    this.box.className = "chart";
    this.box.tabIndex = 0;
    this.box.setAttribute("role", "img");
    const head = this.box.appendChild(document.createElement("p"));
    head.className = "chart-head";
    const title = head.appendChild(document.createElement("b"));
    title.textContent = `${of.title} ${of.symbol}`.trim() + (of.unit ? ` [${of.unit}]` : "");
    this.now = head.appendChild(document.createElement("span"));
    this.build();
  }

  build() {
    if (this.plot) this.plot.destroy();
    const options = this.options();
    this.plot = new uPlot(options, options.series.map(() => []), this.box);
    this.plot.over.addEventListener("click", () => this.control.chosen(this.plot.posToVal(this.plot.cursor.left, "x")));
  }

  // Several runs over each other: [{curves, colour}]; of each the lines alone, the first whole, others dashed.
  drawRuns(runs) {
    const key = runs.map(run => run.colour).join();
    if (this.laid !== key) { this.laid = key; this.runs = runs; this.build(); }
    this.curves = runs[0].curves;
    const tables = runs.map(run => [run.curves.time, ...this.of.curves.map(c => run.curves.columns[c.line])]);
    this.plot.setData(uPlot.join(tables), true);
    this.now.textContent = "";
  }

  // Columns in the order of the series: of each curve its band's edges, if any, then its line.
  order() { return this.of.curves.flatMap(c => (c.sigma ? [c.high, c.low, c.line] : [c.line])); }

  options() {
    const series = [{}], bands = [];
    for (const run of this.runs || []) for (const [i, curve] of this.of.curves.entries())
      series.push({stroke: colour(run.colour), width: 1.4, points: {show: false}, dash: i ? [4, 3] : undefined, label: curve.label});
    if (!this.runs) for (const curve of this.of.curves) {
      const name = "--" + curve.style;
      if (curve.sigma) {
        bands.push({series: [series.length, series.length + 1], fill: faded(name, 0.18)});
        series.push({width: 0, points: {show: false}}, {width: 0, points: {show: false}});
      }
      series.push({stroke: colour(name), width: curve.style === "measured" && this.of.curves.length > 1 && !curve.sigma ? 3.4 : 1.5, points: {show: false}});
    }
    const axis = {stroke: colour("--soft"), grid: {stroke: colour("--rule"), width: 1}, ticks: {show: false}, font: "12px system-ui, sans-serif"};
    return {
      width: Math.max(this.box.clientWidth, 200), height: HEIGHT, series, bands,
      legend: {show: false},
      tzDate: ts => uPlot.tzDate(new Date(ts * 1e3), "Etc/UTC"),
      scales: {x: {time: this.control.clock, range: () => this.control.span()}, y: {range: ranged}},
      axes: [
        {...axis, size: 28, space: 60, values: this.control.clock ? clocked : this.control.words},
        {...axis, size: 54, space: 32, values: (u, ticks) => ticks.map(v => `${+v.toPrecision(8)}`.replace("-", "−"))},
      ],
      cursor: {sync: {key: "time"}, drag: {x: true, y: false, setScale: false}, points: {size: 6}},
      hooks: {
        drawAxes: [u => this.inside(u, line => this.marked(u, line))],
        draw: [u => this.inside(u, line => this.control.drawn(u, line))],
        setSelect: [u => this.zoomed(u)],
        setCursor: [() => this.values()],
      },
    };
  }

  zoomed(u) {
    const {left, width} = u.select;
    if (width < 8) return;
    const span = [u.posToVal(left, "x"), u.posToVal(left + width, "x")];
    u.setSelect({left: 0, top: 0, width: 0, height: 0}, false);
    this.control.zoom(span);
  }

  // What is drawn with lines inside the axes.
  inside(u, drawing) {
    const {ctx, bbox} = u;
    ctx.save();
    ctx.beginPath();
    ctx.rect(bbox.left, bbox.top, bbox.width, bbox.height);
    ctx.clip();
    drawing((x0, y0, x1, y1) => { ctx.beginPath(); ctx.moveTo(x0, y0); ctx.lineTo(x1, y1); ctx.stroke(); });
    ctx.restore();
  }

  // Below the curves: the stated prior as a dashed line, and events as lines from top to bottom.
  marked(u, line) {
    const {ctx, bbox} = u, scale = devicePixelRatio;
    const prior = this.of.expected ?? this.control.prior(this.of);
    if (prior !== null) {
      ctx.setLineDash([5 * scale, 4 * scale]);
      ctx.lineWidth = 1.2 * scale;
      ctx.strokeStyle = colour("--prior");
      const y = u.valToPos(prior, "y", true);
      line(bbox.left, y, bbox.left + bbox.width, y);
    }
    ctx.setLineDash([2 * scale, 3 * scale]);
    ctx.lineWidth = 1.4 * scale;
    const [from, to] = this.control.span();
    for (const event of this.control.events()) {
      if (event.time < from || event.time > to) continue;
      ctx.strokeStyle = colour(MARKS[event.kind] || "--note");
      const x = u.valToPos(event.time, "x", true);
      line(x, bbox.top, x, bbox.top + bbox.height);
    }
  }

  draw(curves) {
    if (this.runs) { this.runs = this.laid = null; this.build(); }
    this.curves = curves;
    const data = this.order().map(at => curves.columns[at] || []);
    this.plot.setData([curves.time, ...data], true);
    this.values();
  }

  // The value under the cursor, or the last one.
  values() {
    if (!this.curves || !this.plot || this.runs) return;
    const at = this.plot.cursor.idx ?? this.control.index(this.curves.time);
    const words = this.of.curves.map(c => {
      const column = this.curves.columns[c.line] || [];
      const value = written(column[at], this.of.decimals);
      if (this.of.curves.length > 1) return c.label === "measured" ? value : `${c.label} ${value}`;
      if (!c.sigma) return value;
      const half = (this.curves.columns[c.high][at] - column[at]) / 2;
      return column[at] === null || column[at] === undefined ? value : `${value} ± ${written(half, this.of.decimals)}`;
    });
    this.now.textContent = words.join(", ");
  }

  // Now, least and greatest of each curve: what stands in the table, and for who cannot see the picture.
  summary() {
    return this.of.curves.map(c => {
      const [from, to] = this.control.span();
      const values = (this.curves ? this.curves.columns[c.line] || [] : [])
        .filter((v, i) => v !== null && this.curves.time[i] >= from && this.curves.time[i] <= to);
      const shown = v => `${written(v, this.of.decimals)} ${this.of.unit}`.trim();
      const least = values.reduce((a, b) => Math.min(a, b), Infinity), most = values.reduce((a, b) => Math.max(a, b), -Infinity);
      const name = this.of.curves.length > 1 ? `${this.of.title}, ${c.label}` : this.of.title;
      return values.length ? [name, shown(values[values.length - 1]), shown(least), shown(most)] : [name, "–", "–", "–"];
    });
  }

  label() {
    const said = this.summary().map(([name, now, least, most]) => `${name}: ${now}, between ${least} and ${most}`);
    this.box.setAttribute("aria-label", said.join("; "));
  }

  resize() { this.plot.setSize({width: Math.max(this.box.clientWidth, 200), height: HEIGHT}); }
}

// Least and greatest of what is in sight of a series; without its outermost share, of about 200 of its values.
const extent = (u, at, share) => {
  const [from, to] = u.series[0].idxs || [0, -1], values = u.data[at] || [], some = [];
  const step = share ? Math.max(1, Math.floor((to - from) / 200)) : 1;
  let low = Infinity, high = -Infinity;
  for (let i = from; to >= i; i += step) {
    const value = values[i];
    if (value === null || value === undefined) continue;
    if (share) some.push(value);
    else { low = Math.min(low, value); high = Math.max(high, value); }
  }
  if (!share || some.length === 0) return [low, high];
  some.sort((a, b) => a - b);
  const cut = Math.floor(share * some.length);
  return [some[cut], some[some.length - 1 - cut]];
};

// All of every line, of a band's edges all but the outermost: a σ that nothing is known of at a start would hide the rest.
// A margin, and never a range so small that noise of the last digit fills the picture.
const ranged = u => {
  const extents = u.series.slice(1).map((series, i) => extent(u, i + 1, series.width === 0 ? 0.05 : 0));
  const low = Math.min(...extents.map(e => e[0])), high = Math.max(...extents.map(e => e[1]));
  if (!Number.isFinite(low)) return [0, 1];
  const room = Math.max(high - low, 1e-3 * Math.abs(high), 1e-9), middle = (low + high) / 2;
  return [middle - 0.6 * room, middle + 0.6 * room];
};

const clocked = (u, ticks) => {
  const fine = ticks.length > 1 && ticks[1] - ticks[0] < 60;
  return ticks.map(t => new Date(t * 1e3).toISOString().slice(11, fine ? 19 : 16));
};

// Charts follow their box, the colours of the reader's choice, and paper.
export const watched = (charts, draw) => {
  const into = document.getElementById("charts"), root = document.documentElement;
  new ResizeObserver(() => charts.forEach(chart => chart.resize())).observe(into);
  const repaint = () => { charts.forEach(chart => chart.build()); draw(); };
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", repaint);
  addEventListener("beforeprint", () => { root.classList.add("printing"); repaint(); });
  addEventListener("afterprint", () => { root.classList.remove("printing"); repaint(); });
};
