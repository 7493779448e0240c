"use strict";
// Draws every figure of the page with uPlot from the JSON beside it: zoom, pan, hover, keys, themes and print.
(() => {
  const root = document.documentElement;
  const font = "13px system-ui, sans-serif";
  const style = (name) => getComputedStyle(root).getPropertyValue("--" + name).trim();
  const round = (value, digits) => (value == null ? "–" : String(Number(value.toPrecision(digits))));
  const tick = (value) => {
    if (value == null) return "";
    const size = Math.abs(value);
    return size !== 0 && (size < 1e-3 || size >= 1e5) ? value.toExponential(2).replace(/\.?0+e\+?/, "e") : round(value, 6);
  };

  const charts = [...document.querySelectorAll("figure.chart")].map((figure) => ({
    figure,
    holder: figure.querySelector(".plot"),
    group: figure.dataset.group,
    data: JSON.parse(figure.querySelector("script").textContent),
    plot: null,
    readout: null,
  }));
  // Zooms are shared once all plots are there.
  let shared = false;

  /** The drawn point nearest to a place on a plot whose x goes back and forth. */
  const nearest = (plot, left, top) => {
    let best = null;
    for (let s = 1; s < plot.series.length; s++) {
      if (!plot.series[s].show) continue;
      const [xs, ys] = plot.data[s];
      for (let k = 0; k < xs.length; k++) {
        const away = Math.hypot(plot.valToPos(xs[k], "x") - left, plot.valToPos(ys[k], "y") - top);
        if (best === null || away < best.away) best = { away, s, x: xs[k], y: ys[k] };
      }
    }
    return best;
  };

  const say = (chart) => {
    const { plot, data, readout } = chart;
    const { left, top, idx } = plot.cursor;
    if (left == null || left < 0) {
      readout.textContent = "";
    } else if (data.path) {
      const point = nearest(plot, left, top);
      if (point) readout.textContent = `${plot.series[point.s].label}: ${data.x} ${round(point.x, 5)}, ${data.y} ${round(point.y, 5)}`;
    } else if (idx != null) {
      const values = plot.series.slice(1).map((series, k) => `${series.label} ${round(plot.data[k + 1][plot.cursor.idxs[k + 1]], 5)}`);
      readout.textContent = `${data.x} ${round(plot.data[0][idx], 6)}: ${values.join(", ")}`;
    }
  };

  /** Neighbours with a value: lines that were thinned one by one do not share every x. */
  const withValue = (plot, s, idx) => {
    const values = plot.data[s];
    if (s === 0 || values[idx] != null) return idx;
    for (let away = 1; away < values.length; away++) {
      if (values[idx - away] != null) return idx - away;
      if (values[idx + away] != null) return idx + away;
    }
    return idx;
  };

  const drawPath = (plot, s) => {
    const path = new Path2D();
    const [xs, ys] = plot.data[s];
    xs.forEach((x, k) => path.lineTo(plot.valToPos(x, "x", true), plot.valToPos(ys[k], "y", true)));
    return { stroke: path, fill: null, clip: null, band: null, gaps: null, flags: 0 };
  };

  const drawBand = (band) => (plot) => {
    const { ctx, bbox } = plot;
    const place = (x) => Math.min(Math.max(plot.valToPos(x, "x", true), bbox.left), bbox.left + bbox.width);
    const [from, to] = [place(band.from), place(band.to)];
    ctx.save();
    ctx.fillStyle = style("band");
    ctx.fillRect(from, bbox.top, to - from, bbox.height);
    ctx.fillStyle = style("faint");
    ctx.font = `${12 * devicePixelRatio}px system-ui, sans-serif`;
    ctx.textBaseline = "top";
    ctx.fillText(band.label, from + 6 * devicePixelRatio, bbox.top + 4 * devicePixelRatio);
    ctx.restore();
  };

  const extent = ({ data }) => {
    const of = (key) => {
      const values = data.lines.flatMap((line) => line[key]);
      return [values.reduce((a, b) => Math.min(a, b), Infinity), values.reduce((a, b) => Math.max(a, b), -Infinity)];
    };
    return { x: of("x"), y: of("y") };
  };

  const show = (chart, key, min, max) => chart.plot.setScale(key, { min, max });

  const showAll = (chart) => {
    const full = extent(chart);
    chart.plot.batch(() => {
      show(chart, "x", ...full.x);
      if (chart.data.path) {
        const margin = 0.05 * (full.y[1] - full.y[0]);
        show(chart, "y", full.y[0] - margin, full.y[1] + margin);
      }
    });
  };

  /** Shows `factor` of what is shown, moved by `shift` of it; x alone, or of loops both axes when it zooms. */
  const view = (chart, factor, shift) => {
    const { plot, data } = chart;
    const axes = data.path && factor !== 1 ? ["x", "y"] : ["x"];
    plot.batch(() => {
      for (const key of axes) {
        const log = key === "x" ? data.logX : data.logY;
        const { min, max } = plot.scales[key];
        const [low, high] = log ? [Math.log10(min), Math.log10(max)] : [min, max];
        const at = key === "x" && plot.cursor.left > 0 ? plot.posToVal(plot.cursor.left, key) : null;
        const middle = at === null || shift !== 0 ? (low + high) / 2 : log ? Math.log10(at) : at;
        const move = shift * (high - low);
        const ends = [middle + (low - middle) * factor + move, middle + (high - middle) * factor + move];
        show(chart, key, ...(log ? ends.map((end) => 10 ** end) : ends));
      }
    });
  };

  const step = (chart, count, rise) => {
    const { plot, data } = chart;
    const inside = (value, most) => Math.min(Math.max(value, 0), most);
    const { width, height } = plot.over.getBoundingClientRect();
    const here = plot.cursor.left >= 0 ? plot.cursor : { left: width / 2, top: height / 2, idx: null };
    let left = here.left + 8 * count;
    if (!data.path && here.idx != null) {
      const idx = inside(here.idx + count, plot.data[0].length - 1);
      left = plot.valToPos(plot.data[0][idx], "x");
    }
    plot.setCursor({ left: inside(left, width), top: inside(here.top - 8 * rise, height) });
    say(chart);
  };

  const keys = (chart, event) => {
    const stride = event.shiftKey ? 10 : 1;
    const actions = {
      ArrowLeft: () => step(chart, -stride, 0),
      ArrowRight: () => step(chart, stride, 0),
      ArrowUp: () => step(chart, 0, stride),
      ArrowDown: () => step(chart, 0, -stride),
      "+": () => view(chart, 0.6, 0),
      "=": () => view(chart, 0.6, 0),
      "-": () => view(chart, 1 / 0.6, 0),
      PageUp: () => view(chart, 1, -0.4),
      PageDown: () => view(chart, 1, 0.4),
      0: () => showAll(chart),
    };
    const action = actions[event.key];
    if (!action || event.target !== chart.holder || event.ctrlKey || event.metaKey || event.altKey) return;
    event.preventDefault();
    action();
  };

  const tools = (chart) => {
    const bar = document.createElement("div");
    bar.className = "tools";
    for (const [sign, label, action] of [
      ["◀", "Pan left", () => view(chart, 1, -0.4)],
      ["▶", "Pan right", () => view(chart, 1, 0.4)],
      ["+", "Zoom in", () => view(chart, 0.6, 0)],
      ["−", "Zoom out", () => view(chart, 1 / 0.6, 0)],
      ["all", "Show all", () => showAll(chart)],
    ]) {
      const button = document.createElement("button");
      button.type = "button";
      button.textContent = sign;
      button.title = label;
      // Keys do the same on the plot itself: 100 stops less on the way through a page.
      button.tabIndex = -1;
      button.setAttribute("aria-label", `${label}: ${chart.figure.querySelector("h4").textContent}`);
      button.addEventListener("click", action);
      bar.append(button);
    }
    chart.holder.before(bar);
    chart.readout = document.createElement("div");
    chart.readout.className = "readout";
    chart.readout.setAttribute("aria-live", "polite");
    chart.holder.after(chart.readout);
    chart.holder.addEventListener("keydown", (event) => keys(chart, event));
  };

  const options = (chart, width) => {
    const { data, group } = chart;
    const decades = (_, splits) => splits.map((value) => (Number.isInteger(Math.round(1e6 * Math.log10(value)) / 1e6) ? value : null));
    const axis = (label, log, size) => ({
      label,
      size,
      labelSize: 22,
      font,
      labelFont: font,
      stroke: style("ink"),
      grid: { stroke: style("rule"), width: 1, ...(log ? { filter: decades } : {}) },
      ticks: { stroke: style("rule"), width: 1 },
      values: (_, splits) => splits.map(tick),
    });
    const line = (one) => ({
      label: one.label,
      stroke: style(one.colour),
      width: one.width,
      dash: one.dashed ? [8, 5] : undefined,
      points: { show: one.marked, size: 5 + one.width, fill: style(one.colour) },
      ...(data.path
        ? { paths: drawPath, facets: [{ scale: "x", auto: true }, { scale: "y", auto: true }] }
        : { spanGaps: true, value: (_, value) => round(value, 5) }),
    });
    const tight = (_, min, max) => (min < max ? [min, max] : [min - 0.5, max + 0.5]);
    return {
      mode: data.path ? 2 : 1,
      width,
      height: root.classList.contains("printing") ? 210 : Math.round(Math.min(Math.max(0.42 * width, 250), 340)),
      scales: {
        x: { time: false, distr: data.logX ? 3 : 1, ...(data.path ? {} : { range: tight }) },
        y: { distr: data.logY ? 3 : 1 },
      },
      axes: [axis(data.x, data.logX, 40), axis(data.y, data.logY, 64)],
      series: [data.path ? {} : { label: data.x, value: (_, value) => round(value, 6) }, ...data.lines.map(line)],
      legend: {
        live: !data.path,
        markers: { width: 3, dash: (_, s) => (s > 0 && data.lines[s - 1].dashed ? "dashed" : "solid") },
      },
      cursor: {
        drag: { x: true, y: data.path, uni: data.path ? 30 : undefined },
        points: { show: !data.path },
        ...(data.path ? {} : { dataIdx: withValue }),
        ...(group ? { sync: { key: group, scales: ["x", null], setSeries: false } } : {}),
      },
      hooks: {
        drawClear: data.band ? [drawBand(data.band)] : [],
        setCursor: data.path ? [() => chart.plot && say(chart)] : [],
        setScale: [
          (plot, key) => {
            if (!shared || key !== "x" || !group) return;
            const { min, max } = plot.scales.x;
            for (const other of charts) {
              const seen = other.group === group && other.plot !== plot && other.plot.scales.x;
              if (seen && (seen.min !== min || seen.max !== max)) show(other, "x", min, max);
            }
          },
        ],
      },
    };
  };

  const legend = (chart) => {
    const rows = [...chart.plot.root.querySelectorAll(".u-legend .u-series")];
    for (const row of data_rows(chart, rows)) {
      const name = row.querySelector("th");
      const shown = () => name.setAttribute("aria-pressed", String(!row.classList.contains("u-off")));
      name.tabIndex = 0;
      name.setAttribute("role", "button");
      name.addEventListener("click", () => setTimeout(shown));
      name.addEventListener("keydown", (event) => {
        if (event.key !== "Enter" && event.key !== " ") return;
        event.preventDefault();
        name.click();
      });
      shown();
    }
  };
  // The first row of a live legend is x.
  const data_rows = (chart, rows) => (chart.data.path ? rows : rows.slice(1));

  const draw = (chart, width) => {
    chart.plot?.destroy();
    const { lines, path } = chart.data;
    const data = path ? [null, ...lines.map((line) => [line.x, line.y])] : uPlot.join(lines.map((line) => [line.x, line.y]));
    chart.plot = new uPlot(options(chart, width), data, chart.holder);
    chart.plot.root.querySelector("canvas").setAttribute("aria-hidden", "true");
    legend(chart);
    if (path) showAll(chart);
  };

  const drawAll = (width) => {
    shared = false;
    for (const chart of charts) draw(chart, width ?? Math.max(chart.holder.clientWidth, 200));
    setTimeout(() => (shared = true));
  };

  for (const chart of charts) tools(chart);
  drawAll();
  root.dataset.plots = String(charts.length);

  const resized = new ResizeObserver((entries) => {
    for (const { target, contentRect } of entries) {
      const { plot } = charts.find((chart) => chart.holder === target);
      const width = Math.round(contentRect.width);
      if (width > 0 && Math.abs(plot.width - width) > 1 && !root.classList.contains("printing")) {
        requestAnimationFrame(() => plot.setSize({ width, height: plot.height }));
      }
    }
  });
  for (const chart of charts) resized.observe(chart.holder);
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => drawAll());
  addEventListener("beforeprint", () => {
    root.classList.add("printing");
    drawAll(680);
  });
  addEventListener("afterprint", () => {
    root.classList.remove("printing");
    drawAll();
  });
})();
