"use strict";
// The page of a bench. It shows what the tool sends, and asks; the tool decides. It is not the heartbeat of the board: it reports which state
// it has drawn, and where that ends the tool brings the film to 0 V.
(() => {
  const $ = (id) => document.getElementById(id);
  const SECRET = "springpot-secret";
  const SHOWN_S = 60;
  /** Reports of what was drawn, a few a second. */
  const DREW_MS = 250;

  // The secret comes behind the #, which no server and no other page sees; a tab keeps it over a reload.
  const given = location.hash.slice(1);
  if (given) {
    sessionStorage.setItem(SECRET, given);
    history.replaceState(null, "", "/");
  }
  const headers = { "Content-Type": "application/json", "X-Springpot-Secret": sessionStorage.getItem(SECRET) ?? "" };

  let live = null;
  let connected = false;
  /** This page's own: its token, its place among those that were in control, its newest request, its arming. */
  let own = { page: null, place: -1, number: 0, arming: null };
  let reported = -Infinity;
  let waiting = false;
  let taking = false;
  let drawing = false;

  const note = (text) => {
    if ($("message").textContent !== text) $("message").textContent = text;
  };

  const post = (body, keepalive = false) =>
    fetch("/api", { method: "POST", headers, body: JSON.stringify(body), keepalive });

  /** Asks for something; returns the answer, or null and says why not. */
  const ask = async (wish, arming = null) => {
    own.number += 1;
    try {
      const answer = await post({ page: own.page, number: own.number, arming, ask: wish });
      if (answer.ok) return await answer.json();
      note(await answer.text());
    } catch {
      note("springpot does not answer: is it still running?");
    }
    return null;
  };

  const stop = (by) => {
    own.arming = null;
    // Also when the page is about to go.
    post({ ask: { stop: { by } } }, true).catch(() => note("NOT STOPPED: springpot does not answer. Open the interlock."));
  };

  const inControl = () => live !== null && own.page !== null && live.in_control === own.place;
  const enabled = () => connected && live !== null && ["armed", "running", "commissioning"].includes(live.state);

  // ---- stop ----
  $("stop").addEventListener("pointerdown", () => stop("button"));
  $("stop").addEventListener("click", (event) => {
    // The keyboard and screen readers click without a pointer.
    if (event.detail === 0) stop("button");
  });
  for (const kind of ["keydown", "keyup"]) {
    // Everywhere, in fields as well, and before anything else: no entry needs a blank.
    addEventListener(kind, (event) => {
      if (event.code !== "Space") return;
      event.preventDefault();
      event.stopImmediatePropagation();
      if (kind === "keydown" && !event.repeat) stop("key");
    }, true);
  }
  const leave = () => {
    if (inControl() && enabled()) stop("hidden");
  };
  document.addEventListener("visibilitychange", () => document.hidden && leave());
  addEventListener("pagehide", leave);

  // ---- plots ----
  const style = (name) => getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();
  const rows = [[], [], [], [], [], []];
  const PLOTS = [
    { title: "Stroke and reference, mm", lines: [["reference", "grey", 3, 4], ["stroke", "blue", 2, 3]] },
    { title: "Error, µm", lines: [["error", "vermilion", 2, 5]] },
    { title: "Voltage, kV", lines: [["commanded", "grey", 4, 1], ["monitor", "green", 2, 2]] },
  ];
  let plots = [];

  const width = () => Math.max(240, $("plots").firstElementChild?.clientWidth ?? 320);
  const fit = () => plots.forEach(({ plot }) => plot.setSize({ width: width(), height: 220 }));
  const build = () => {
    $("plots").replaceChildren();
    plots = PLOTS.map(({ title, lines }) => {
      const figure = document.createElement("figure");
      const caption = document.createElement("figcaption");
      caption.textContent = title;
      figure.append(caption);
      $("plots").append(figure);
      const axis = { stroke: style("ink"), grid: { stroke: style("rule") }, ticks: { stroke: style("rule") } };
      const plot = new uPlot({
        width: width(), height: 220, cursor: { show: false }, scales: { x: { time: false } }, axes: [{ ...axis }, { ...axis, size: 60 }],
        series: [{ label: "s" }, ...lines.map(([label, colour, wide]) => ({ label, stroke: style(colour), width: wide, dash: colour === "grey" ? [8, 4] : undefined }))],
        legend: { live: false },
      }, [[], ...lines.map(() => [])], figure);
      plot.root.setAttribute("role", "img");
      plot.root.setAttribute("aria-label", `${title}, over the last minute; the values are above`);
      return { plot, lines };
    });
    // Now that there are as many columns as fit.
    fit();
  };
  const remember = (state) => {
    const error = state.reference_m === null || state.displacement_m === null ? null : 1e6 * (state.displacement_m - state.reference_m);
    const scaled = (value, factor) => (value === null ? null : factor * value);
    const row = [
      state.at_ms / 1e3, scaled(state.command_v, 1e-3), scaled(state.monitor_v, 1e-3), scaled(state.displacement_m, 1e3),
      scaled(state.reference_m, 1e3), error,
    ];
    rows.forEach((column, k) => column.push(row[k]));
    while (rows[0].length > 1 && row[0] - rows[0][0] > SHOWN_S) rows.forEach((column) => column.shift());
  };

  // ---- what is shown ----
  const WORDS = {
    disconnected: ["○", "no board", "it is looked for"], disarmed: ["■", "off", "0 V, amplifier disabled"],
    armed: ["▲", "armed", "0 V, amplifier enabled"], running: ["⚡", "running", "high voltage"],
    tripped: ["✖", "tripped", ""], commissioning: ["⚡", "commissioning", "high voltage"], lost: ["?", "no connection", "what is shown is old"],
  };
  const put = (id, text) => {
    if ($(id).textContent !== text) $(id).textContent = text;
  };
  const digits = (value, factor, count) => (value === null ? "–" : (factor * value).toFixed(count).replace(/^-(?=[0.]+$)/, ""));

  const draw = () => {
    const state = connected && live !== null ? live.state : "lost";
    const [mark, word, hint] = WORDS[state] ?? WORDS.lost;
    $("state").dataset.state = state;
    put("mark", mark);
    put("word", word);
    put("hint", state === "tripped" ? live.cause : state === "disarmed" && live.live ? "the film still has voltage" : hint);
    const title = `${mark} ${word} – springpot bench`;
    // Set again, it would cost memory with every picture.
    if (document.title !== title) document.title = title;
    if (live === null) return;
    put("voltage", digits(live.monitor_v, 1, 0));
    put("stroke", digits(live.displacement_m, 1e3, 3));
    put("reference", digits(live.reference_m, 1e3, 3));
    const error = live.reference_m === null || live.displacement_m === null ? null : live.displacement_m - live.reference_m;
    put("error", digits(error, 1e6, 1));
    put("limits", live.limited.join(", ") || "none");
    const [at, of] = live.played_s;
    put("playing", live.playing === "" ? "" : of > 0 && ["running", "commissioning"].includes(state) ? `${live.playing}: ${at.toFixed(0)} of ${of.toFixed(0)} s` : live.playing);
    const [samples, lost] = live.samples;
    put("recording", live.recording === "" ? "Nothing is recorded yet." : `${live.recording}: ${samples} samples, ${lost} lost`);
    put("board", `${live.port} ${live.firmware}, parameters: ${live.parameters || "none"}`);
    const mine = inControl();
    put("whose", mine ? "This page is in control." : live.in_control === 0 ? "No page is in control." : "Another page is in control; this one may stop.");
    $("control").disabled = mine || taking || enabled() || !connected;
    // The board refuses to arm a film that has voltage left.
    const isOff = state === "disarmed" && !live.live;
    $("arm").disabled = !(mine && isOff);
    $("acknowledge").disabled = !(mine && state === "tripped");
    $("play").disabled = !(mine && state === "armed" && own.arming);
    $("tune").disabled = !(mine && state === "running" && own.arming);
    $("report").disabled = enabled() || $("file").length === 0;
    $("commission").disabled = !(mine && isOff);
    plots.forEach(({ plot, lines }) => plot.setData([rows[0], ...lines.map(([, , , k]) => rows[k])]));
  };

  /** Draws, and reports it. The browser calls this for pages in sight alone: a hidden or frozen one reports nothing. */
  const frame = () => {
    drawing = false;
    draw();
    const now = performance.now();
    if (live === null || !connected || !inControl() || waiting || now - reported < DREW_MS) return;
    reported = now;
    waiting = true;
    // An answer that is not read costs memory.
    const report = async () => (await post({ page: own.page, ask: { drew: { at_ms: live.at_ms } } })).text();
    report().catch(() => {}).finally(() => (waiting = false));
  };
  const redraw = () => {
    if (!drawing) requestAnimationFrame(frame);
    drawing = true;
  };

  const receive = (state) => {
    const ended = enabled() && ["disarmed", "tripped", "disconnected"].includes(state.state);
    if (live === null || live.message !== state.message) note(state.message);
    connected = true;
    live = state;
    remember(state);
    if (ended) {
      own.arming = null;
      list();
    }
    redraw();
  };

  /** The states, 20 a second, as long as the page is open. */
  const listen = async () => {
    for (;;) {
      try {
        const answer = await fetch("/api/live", { headers });
        if (!answer.ok) note(await answer.text());
        const reader = answer.ok ? answer.body.pipeThrough(new TextDecoderStream()).getReader() : null;
        let rest = "";
        while (reader) {
          const { value, done } = await reader.read();
          if (done) break;
          const events = (rest + value).split("\n\n");
          rest = events.pop();
          events.forEach((event) => receive(JSON.parse(event.slice("data: ".length))));
        }
      } catch { /* it is tried again */ }
      connected = false;
      redraw();
      await new Promise((done) => setTimeout(done, 500));
    }
  };

  // ---- what can be asked for ----
  const list = async () => {
    const answer = await fetch("/api/files", { headers }).catch(() => null);
    if (!answer?.ok) return;
    const { files, commission } = await answer.json();
    const [source, file] = [$("source").value, $("file").value];
    const option = (name, value) => new Option(name, value);
    for (const old of [...$("source").options].filter((known) => known.value.startsWith("file:"))) old.remove();
    $("source").append(...files.filter((name) => name.endsWith(".csv")).map((name) => option(name, `file:${name}`)));
    $("file").replaceChildren(...files.filter((name) => !name.endsWith(".csv") || name.startsWith("run-")).reverse().map((name) => option(name, name)));
    if (source) $("source").value = source;
    if (file) $("file").value = file;
    $("commission-form").hidden = !commission;
    redraw();
  };
  const control = async () => {
    if (taking) return;
    taking = true;
    own = { page: null, place: -1, number: 0, arming: null };
    const answer = await ask("control");
    if (answer) own = { ...own, page: answer.page, place: answer.place };
    taking = false;
    redraw();
  };
  const number = (id) => Number($(id).value);
  const unit = () => ($("mode").value === "voltage" ? 1 : 1e-3);
  const shapes = () => {
    const isFile = $("source").value.startsWith("file:");
    document.querySelectorAll(".shape").forEach((field) => (field.hidden = isFile));
    document.querySelectorAll(".unit").forEach((name) => (name.textContent = $("mode").value === "voltage" ? "V" : "mm"));
  };
  const on = (id, what) => $(id).addEventListener($(id).tagName === "FORM" ? "submit" : "click", (event) => {
    event.preventDefault();
    what();
  });
  on("control", control);
  on("arm", async () => {
    own.arming = (await ask("arm"))?.arming ?? null;
    redraw();
  });
  on("acknowledge", () => ask("acknowledge"));
  on("play-form", () => {
    const source = $("source").value;
    const shape = () => ({
      shape: { shape: source, low: unit() * number("low"), high: unit() * number("high"), period_s: number("period"), duration_s: number("duration") },
    });
    ask({ play: { mode: $("mode").value, reference: source.startsWith("file:") ? { file: source.slice(5) } : shape() } }, own.arming);
    $("scale").value = 1;
    $("offset").value = 0;
    put("scale-shown", "1.00");
  });
  on("tune-form", () => ask({ tune: { scale: number("scale"), offset: unit() * number("offset") } }, own.arming));
  on("report-form", async () => {
    const answer = await ask({ report: { file: $("file").value } });
    if (answer) open(answer.address, "_blank", "noopener");
  });
  on("commission-form", () => ask({ commission: { gauge: $("gauge").value, serial: $("serial").value } }));
  $("scale").addEventListener("input", () => put("scale-shown", number("scale").toFixed(2)));
  $("source").addEventListener("change", shapes);
  $("mode").addEventListener("change", shapes);

  build();
  shapes();
  addEventListener("resize", fit);
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => {
    build();
    redraw();
  });
  listen();
  list();
  control();
})();
