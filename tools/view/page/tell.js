// Words, values and tables of a frame. Text only is ever set, so nothing of a recording becomes markup.

export const byId = id => document.getElementById(id);

export const made = (name, words, kind) => {
  const e = document.createElement(name);
  if (words !== undefined) e.textContent = words;
  if (kind) e.className = kind;
  return e;
};

const set = (e, words) => { if (e.textContent !== words) e.textContent = words; };

export const headline = words => {
  const header = byId("headline");
  if (header.className !== words.tone) header.className = words.tone;
  set(byId("title"), words.title);
  set(byId("reason"), words.reason);
  const notes = byId("notes");
  if (notes.dataset.said !== words.notes.join("\n")) {
    notes.dataset.said = words.notes.join("\n");
    notes.replaceChildren(...words.notes.map(note => made("li", note)));
  }
};

export const values = list => {
  const box = byId("values");
  if (box.children.length !== list.length) box.replaceChildren(...list.map(({label, unit}, i) => {
    const div = made("div", undefined, i < 4 ? "first" : "");
    const value = made("dd");
    value.append(made("span"), made("small", unit ? ` ${unit}` : ""));
    div.append(made("dt", label), value, made("dd", "", "sigma"));
    return div;
  }));
  list.forEach(({value, sigma}, i) => {
    const [, number, spread] = box.children[i].children;
    set(number.firstChild, value);
    set(spread, sigma === "–" ? "" : `± ${sigma}`);
  });
};

export const facts = (id, pairs) => {
  const box = byId(id);
  if (box.children.length !== pairs.length) box.replaceChildren(...pairs.map(() => {
    const div = made("div");
    div.append(made("dt"), made("dd"));
    return div;
  }));
  pairs.forEach(([term, words], i) => { set(box.children[i].children[0], term); set(box.children[i].children[1], words); });
};

export const table = (id, rows) => {
  const body = byId(id).tBodies[0];
  if (body.rows.length !== rows.length) body.replaceChildren(...rows.map(cells => {
    const row = made("tr");
    row.append(...cells.map((_, i) => made(i ? "td" : "th")));
    return row;
  }));
  rows.forEach((cells, i) => cells.forEach((words, j) => set(body.rows[i].cells[j], words)));
};

export const state = frame => {
  table("channels", frame.channels.map(c => [c.name, c.state, c.rate, c.age, c.noise]));
  frame.channels.forEach((c, i) => { byId("channels").tBodies[0].rows[i].className = c.state === "ok" ? "" : "bad"; });
  table("devices", frame.devices.map(d => [d.name, d.error && d.state !== "open" ? `${d.state}: ${d.error}` : d.state, d.rate, d.faults]));
  frame.devices.forEach((d, i) => { byId("devices").tBodies[0].rows[i].className = d.state === "open" ? "" : "bad"; });
  facts("log", frame.log);
  facts("loop", frame.loop);
};

export const events = (list, shown) => {
  const items = [...list].reverse().slice(0, 100).map(event => {
    const item = made("li");
    item.append(made("time", shown(event.time)), made("span", event.text, event.kind));
    return item;
  });
  byId("events").replaceChildren(...(items.length ? items : [made("li", "none yet")]));
};

export const legend = () => {
  const entries = [["estimate", "estimate"], ["measured", "measured"], ["predicted", "predicted at the estimate"],
    ["band", "± 2σ"], ["prior", "stated prior; 1 where σ is honest"]];
  byId("legend").append(...entries.map(([kind, words]) => {
    const entry = made("span");
    entry.append(made("i", undefined, `swatch ${kind}`), words);
    return entry;
  }));
};
