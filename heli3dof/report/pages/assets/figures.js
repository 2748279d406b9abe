// Draws the live figures of the page with uPlot from the JSON data in each <figure>.
//
// Drag to zoom, double-click to reset; buttons and keys do the same. Plots with the same group have
// one horizontal axis: the panels of a figure, and all figures over the time of one flight.
(() => {
  "use strict";
  const HEIGHT = { card: 165, single: 300, panel: 190 }; // px of a plot with its axes
  const NEAR = 0.01; // share of the visible axis within which a value is shown at the cursor
  const groups = new Map();
  const color = (name) => getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();
  const text = (v) => (v == null ? "–" : String(Number(v.toPrecision(4))).replace("-", "−"));

  function element(tag, parent, content = "", name = "") {
    const e = parent.appendChild(document.createElement(tag));
    e.textContent = content;
    if (name) e.className = name;
    return e;
  }

  // Index of the sample of `series` that is nearest to sample i of the joined times; a curve has no
  // value (undefined) at the times of other curves, and null where it is interrupted.
  function nearest(u, series, i) {
    const [x, y] = [u.data[0], u.data[series]];
    let [a, b] = [i, i];
    while (a > 0 && y[a] === undefined) a--;
    while (b < x.length - 1 && y[b] === undefined) b++;
    const best = y[a] === undefined || (y[b] !== undefined && x[b] - x[i] < x[i] - x[a]) ? b : a;
    const reach = NEAR * Math.abs(u.scales.x.max - u.scales.x.min);
    return Math.abs(x[best] - x[i]) <= reach ? best : i;
  }

  function polygon(u, xs, ys) {
    u.ctx.beginPath();
    xs.forEach((x, k) => u.ctx.lineTo(u.valToPos(x, "x", true), u.valToPos(ys[k], "y", true)));
  }

  function below(u, panel) {
    const { ctx, bbox } = u;
    ctx.save();
    ctx.beginPath();
    ctx.rect(bbox.left, bbox.top, bbox.width, bbox.height);
    ctx.clip();
    for (const { axis, ends } of panel.spans) {
      const [a, b] = ends.map((v) => u.valToPos(v, axis, true));
      ctx.fillStyle = color("grid");
      if (axis === "x") ctx.fillRect(a, bbox.top, b - a, bbox.height);
      else ctx.fillRect(bbox.left, a, bbox.width, b - a);
    }
    ctx.globalAlpha = 0.18;
    for (const band of panel.bands) {
      polygon(u, band.x, band.y);
      ctx.fillStyle = color(band.color);
      ctx.fill();
    }
    ctx.globalAlpha = 1;
    panel.curves.filter((c) => c.kind).forEach((c) => {
      ctx.strokeStyle = color(c.color);
      ctx.lineWidth = devicePixelRatio;
      c.x.forEach((x, k) => {
        const ends = c.kind === "stems" ? [0, c.y[k]] : [c.y[k] - c.error[k], c.y[k] + c.error[k]];
        polygon(u, [x, x], ends);
        ctx.stroke();
      });
    });
    ctx.restore();
  }

  // A line that null interrupts and undefined does not; uPlot's own line closes gaps below a pixel.
  function path(u, k) {
    const stroke = new Path2D();
    let drawing = false;
    u.data[k].forEach((y, i) => {
      if (y === undefined) return;
      if (y !== null) {
        const at = [u.valToPos(u.data[0][i], "x", true), u.valToPos(y, "y", true)];
        if (drawing) stroke.lineTo(...at);
        else stroke.moveTo(...at);
      }
      drawing = y !== null;
    });
    return { stroke, fill: null, clip: null, band: null, gaps: null, flags: 0 };
  }

  function series(c) {
    const line = !c.kind;
    return {
      label: c.name,
      stroke: color(c.color),
      width: line ? c.width : 0,
      dash: line && c.dash.length ? c.dash : undefined,
      paths: line ? path : () => null,
      points: { show: !line, size: c.kind === "stems" ? 3 : 6, fill: color(c.color) },
      value: (u, v) => text(v),
    };
  }

  // The whole range is the figure's; a zoomed plot fits its height to what is seen.
  function vertical(u, panel, low, high) {
    const [least, most] = panel.ylim;
    if (!u.zoom || low == null) return [least, most];
    const room = 0.05 * (high - low) || 0.1;
    return [Math.max(least, low - room), Math.min(most, high + room)];
  }

  function plot(box, panel, group, height, legend) {
    const tables = panel.curves.map((c) => [c.x, c.y]);
    const axis = { stroke: color("ink"), grid: { stroke: color("grid"), width: 1 }, ticks: { stroke: color("grid") } };
    const size = () => ({ width: Math.max(box.clientWidth, 120), height });
    const u = new uPlot({
      ...size(),
      legend: { show: legend },
      scales: {
        x: { time: false, distr: panel.log ? 3 : 1, range: (v) => v.zoom || panel.xlim },
        y: { range: (v, low, high) => vertical(v, panel, low, high) },
      },
      axes: [
        { ...axis, label: panel.x, labelSize: 18, labelFont: "12px system-ui", size: 34, space: 50, font: "12px system-ui", values: (v, at) => at.map((a) => (a == null ? "" : text(a))) },
        { ...axis, size: 48, space: 22, font: "12px system-ui", values: (v, at) => at.map(text) },
      ],
      series: [{ label: panel.x, value: (v, x) => text(x) }, ...panel.curves.map(series)],
      cursor: {
        dataIdx: nearest,
        drag: { setScale: false, x: true, y: false },
        sync: { key: group, filters: { pub: (type) => /mousemove|mouseleave/.test(type) } },
        bind: { dblclick: () => () => zoom(group, null) },
        points: { size: 6 },
      },
      hooks: {
        drawClear: [(v) => below(v, panel)],
        setSelect: [(v) => {
          const { left, width } = v.select;
          if (width > 4) zoom(group, [v.posToVal(left, "x"), v.posToVal(left + width, "x")]);
          v.setSelect({ left: 0, top: 0, width: 0, height: 0 }, false);
        }],
      },
    }, uPlot.join(tables), box);
    u.whole = panel.xlim;
    u.zoom = peers(group)[0]?.zoom ?? null;
    if (u.zoom) u.setScale("x", { min: u.zoom[0], max: u.zoom[1] });
    peers(group).push(u);
    u.over.addEventListener("touchmove", (e) => {
      const at = u.over.getBoundingClientRect();
      u.setCursor({ left: e.touches[0].clientX - at.left, top: e.touches[0].clientY - at.top });
    }, { passive: true });
    return u;
  }

  const peers = (group) => groups.get(group) ?? groups.set(group, []).get(group);

  // Shows the range [min, max] on every plot of a group; null: the whole range of each.
  function zoom(group, range) {
    for (const u of peers(group)) {
      u.zoom = range;
      const [min, max] = range ?? u.whole;
      u.setScale("x", { min, max });
    }
  }

  // Zooms by a factor about the cursor or the middle, and moves by a share of the visible range.
  function change(u, group, factor, move = 0) {
    const log = u.scales.x.distr === 3;
    const [to, from] = log ? [Math.log, Math.exp] : [(x) => x, (x) => x];
    const [low, high] = [to(u.scales.x.min), to(u.scales.x.max)];
    const [least, most] = u.whole.map(to);
    const at = u.cursor.left >= 0 ? to(u.posToVal(u.cursor.left, "x")) : (low + high) / 2;
    const span = Math.min((high - low) * factor, most - least);
    const start = at - ((at - low) / (high - low)) * span + move * span;
    const a = Math.min(Math.max(start, least), most - span);
    zoom(group, span >= most - least ? null : [from(a), from(a + span)]);
  }

  function keys(e, u, group) {
    const step = e.key === "ArrowLeft" ? -1 : e.key === "ArrowRight" ? 1 : 0;
    if (step && e.shiftKey) change(u, group, 1, 0.25 * step);
    else if (step) {
      const left = u.cursor.left >= 0 ? u.cursor.left : u.over.clientWidth / 2;
      u.setCursor({ left: Math.min(Math.max(left + 5 * step, 0), u.over.clientWidth), top: 0 });
    } else if (e.key === "+") change(u, group, 0.5);
    else if (e.key === "-") change(u, group, 2);
    else if (e.key === "0") zoom(group, null);
    else return;
    e.preventDefault();
  }

  function draw(figure) {
    const data = JSON.parse(figure.querySelector("script").textContent);
    const alt = figure.querySelector("img").alt;
    const card = Boolean(figure.closest(".answers"));
    const live = element("div", figure, "", "live");
    const caption = element("figcaption", live);
    data.texts.forEach((t, k) => element(k ? "span" : "strong", caption, k ? `${t} ` : t));
    const panels = element("div", live, "", "panels");
    panels.style.gridTemplateColumns = `repeat(${card ? 1 : data.columns}, minmax(0, 1fr))`;
    const own = `figure ${[...document.querySelectorAll("figure")].indexOf(figure)}`;
    const plots = [];
    for (const panel of data.panels) {
      const box = element("div", panels, "", "panel");
      element("p", box, [panel.title, panel.y].filter(Boolean).join(" · "));
      const group = data.flight && panel.x.startsWith("time") ? `flight ${data.flight}` : `${own} ${panel.link}`;
      const height = card ? HEIGHT.card : data.panels.length > 1 ? HEIGHT.panel : HEIGHT.single;
      const u = plot(box, panel, group, height / (card ? data.panels.length ** 0.5 : 1), true);
      u.over.tabIndex = 0;
      u.over.setAttribute("role", "img");
      u.over.setAttribute("aria-label", `${alt}: ${panel.y} over ${panel.x}. Arrow keys read values, plus and minus zoom, 0 shows the whole range.`);
      u.over.addEventListener("keydown", (e) => keys(e, u, group));
      new ResizeObserver(() => box.clientWidth && u.setSize({ width: box.clientWidth, height: u.height })).observe(box);
      plots.push([u, group]);
    }
    const tools = element("div", live, "", "tools");
    const each = (act) => () => new Map(plots.map(([u, group]) => [group, u])).forEach((u, group) => act(u, group));
    const button = (label, act) => element("button", tools, label).addEventListener("click", each(act));
    button("Zoom in", (u, group) => change(u, group, 0.5));
    button("Zoom out", (u, group) => change(u, group, 2));
    button("Whole", (u, group) => zoom(group, null));
    if (!card) element("span", tools, "or drag over a stretch; double-click for the whole");
    tools.querySelectorAll("button").forEach((b) => { b.type = "button"; });
    figure.plots = plots.map(([u]) => u);
    figure.classList.add("drawn");
  }

  function erase(figure) {
    for (const u of figure.plots) {
      for (const [, list] of groups) if (list.includes(u)) list.splice(list.indexOf(u), 1);
      u.destroy();
    }
    figure.querySelector(".live").remove();
    figure.classList.remove("drawn");
  }

  const seen = new IntersectionObserver((entries) => {
    for (const { target, isIntersecting } of entries) {
      if (isIntersecting && !target.classList.contains("drawn")) draw(target);
    }
  }, { rootMargin: "400px" });
  document.querySelectorAll("figure:has(> script)").forEach((f) => seen.observe(f));
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => {
    document.querySelectorAll("figure.drawn").forEach((f) => { erase(f); draw(f); });
  });

  // Paper shows everything: all details are open while the page prints.
  let opened = [];
  addEventListener("beforeprint", () => {
    opened = [...document.querySelectorAll("details:not([open])")];
    opened.forEach((d) => { d.open = true; });
  });
  addEventListener("afterprint", () => opened.forEach((d) => { d.open = false; }));
})();
