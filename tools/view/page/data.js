// Curves as the server gives them: of a stretch of time at most so many points, least and greatest kept.

export const stretch = async query => {
  const answer = await fetch("stretch?" + new URLSearchParams(query));
  if (!answer.ok) throw new Error(await answer.text());
  return unpacked(await answer.arrayBuffer());
};

const unpacked = buffer => {
  const [points, columns, way] = new Int32Array(buffer, 0, 4);
  const time = Array.from(new Float64Array(buffer, 16, points));
  const rest = new Float32Array(buffer, 16 + 8 * points);
  const column = (at, count) => Array.from(rest.subarray(at, at + count), v => (Number.isNaN(v) ? null : v));
  const curves = Array.from({length: columns}, (_, i) => column(i * points, points));
  const from = columns * points;
  return {time, columns: curves, way: {c: column(from, way), tanPhi: column(from + way, way)}};
};

// Places of a chart's curves among the columns: a line, and where there is a band its two edges.
export const placed = charts => {
  let at = 0;
  return charts.map(chart => ({...chart, curves: chart.curves.map(curve => {
    const line = at++;
    return curve.sigma ? {...curve, line, low: at++, high: at++} : {...curve, line};
  })}));
};

export class Curves {
  constructor() { this.clear(); }

  clear() { this.time = []; this.columns = []; this.way = {c: [], tanPhi: []}; this.added = 0; }

  replace(made) { Object.assign(this, made); this.added = 0; }

  append(time, row, ellipse) {
    if (this.columns.length !== row.length) this.columns = row.map(() => []);
    if (this.time.length && time <= this.time[this.time.length - 1]) return;
    this.time.push(time);
    row.forEach((value, i) => this.columns[i].push(value));
    if (ellipse) { this.way.c.push(ellipse.c); this.way.tanPhi.push(ellipse.tan_phi); }
    this.added++;
  }

  // Forget what lies before a time, now and then.
  trim(before) {
    const keep = this.time.findIndex(t => t >= before);
    if (keep < 200) return;
    this.time.splice(0, keep);
    this.columns.forEach(column => column.splice(0, keep));
  }

  get last() { return this.time[this.time.length - 1]; }
}
