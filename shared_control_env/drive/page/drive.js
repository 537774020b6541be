// The page: connection, what is shown when, and what the person asks for.

import { calibrate, element, Input, row } from "./input.js";
import { step } from "./study.js";
import { World } from "./world.js";

const get = (id) => document.getElementById(id);
const card = get("card"), hint = get("hint"), notice = get("notice");
const world = new World(get("world")), input = new Input();
const token = new URLSearchParams(location.search).get("token");
const RATE = 1000 / 60;

let socket, welcome = {}, state = "empty", seq = 0, echo = -1, echoed = 0, chosen = {};
window.drive = { world, input, get state() { return state; } };  // for the tests

function connect() {
  socket = new WebSocket(`ws://${location.host}/ws?token=${encodeURIComponent(token)}`);
  socket.addEventListener("message", (event) => receive(JSON.parse(event.data)));
  socket.addEventListener("close", (event) => {
    state = "lost";
    show("notice", "");
    tell("The connection is lost", event.reason || "Is the command still running? A drive that was under way is paused.", { "Connect again": () => location.reload() });
  });
}

function send(message) {
  if (socket.readyState === WebSocket.OPEN) socket.send(JSON.stringify(message));
}

function receive(message) {
  const kinds = {
    welcome: () => {
      welcome = message;
      if (message.lost) show("notice", message.lost);
      else if (message.role === "spectator") show("notice", "You look on: another page drives.");
      if (message.kind === "free" && !chosen.scenario) chosen = { ...message.choice, device: message.native ? "wheel" : "keyboard" };
    },
    road: () => { world.setRoad(message); input.choose(message.device, message.native ? welcome.native : ""); },
    frame: () => {
      world.setFrame(message, state === "driving");
      echo = message.n;
      echoed = performance.now();
      if (message.timing) timing(message.timing);
    },
    state: () => change(message.state, message.reason),
    result: () => result(message),
    replayed: () => replayed(message),
    recordings: () => recordings(message.names),
    step: () => { state = message.step; buttons(); hint.hidden = true; get("what").textContent = message.title; step(card, message, send, input, (device) => calibrate(card, device, nativeFor(device), ask), nativeFor); },
    calibration: () => answer(message),
    refused: () => { if (awaited) { answer(message); return; } show("notice", message.message); if (state === "preparing") change("empty"); },
  };
  kinds[message.type]?.();
}

// Sends a message; the promise is of the reply, where one is expected.
let awaited = null;
function ask(message, last) {
  send(message);
  return last ? new Promise((resolve) => { awaited = resolve; }) : null;
}
function answer(message) {
  awaited?.(message);
  awaited = null;
}
const nativeFor = (device) => (device === "wheel" ? welcome.native : "");

const show = (id, text) => { get(id).textContent = text; };

function timing([late, age, trip]) {
  const part = (name, value) => `${name} ${value === null ? "\u2013" : value.toFixed(value < 10 ? 1 : 0)}`;
  show("timing", `${part("tick late", late)}  ${part("input age", age)}  ${part("round trip", trip)} ms`);
}

function change(next, reason) {
  state = next;
  buttons();
  hint.hidden = true;
  card.hidden = true;
  if (welcome.kind === "free") show("what", chosen.scenario && next !== "empty" ? `${chosen.scenario}, ${chosen.degradation}, ${chosen.authority}, seed ${chosen.seed}` : "At the wheel");
  if (next === "empty" && welcome.kind === "free") choose();
  if (next === "preparing") say("Preparing\u2026", "The first drive of its kind compiles the numerical core, which can take a minute.");
  if (next === "ready") { show("notice", ""); say(keys(), "Follow the green marks. Space begins."); }
  if (next === "driving") show("notice", "");
  if (next === "paused") { say("Paused", `${reason || ""}. Space goes on; the drive counts as invalid.`); show("notice", "invalid: paused"); }
}

function buttons() {
  const free = welcome.kind === "free", seated = ["ready", "driving", "paused", "over"].includes(state);
  get("pause").hidden = !["driving", "paused"].includes(state);
  show("pause", state === "paused" ? "Go on" : "Pause");
  get("restart").hidden = !(free && seated);
  get("leave").hidden = !(free && seated);
}

function keys() {
  if (input.device !== "keyboard") return "Take the wheel";
  return "\u2190 \u2192 steer    \u2191 accelerate    \u2193 brake";
}

function say(text, small) {
  hint.hidden = false;
  hint.replaceChildren(element("span", text), element("small", small));
}

function tell(title, text, choices) {
  hint.hidden = true;
  card.hidden = false;
  card.replaceChildren(element("h1", title), element("p", text), row(Object.keys(choices), (name) => choices[name]()));
}

// What to drive.
function choose() {
  card.hidden = false;
  card.replaceChildren(
    element("h1", "Drive a car whose automation fails"),
    element("p", "The automation steers, brakes and accelerates. At some moment its commands go bad. You share the wheel: what you do is added to what it still may do."),
  );
  const form = element("div", undefined, { class: "form" });
  for (const [field, names] of Object.entries(welcome.catalogue)) {
    const select = element("select", undefined, { id: field });
    for (const name of Object.keys(names)) select.append(element("option", name || "the authority's own", { value: name }));
    if (!(chosen[field] in names)) select.append(element("option", chosen[field], { value: chosen[field] }));
    select.value = chosen[field];
    const small = element("small", names[chosen[field]]);
    select.addEventListener("change", () => { chosen[field] = select.value; small.textContent = names[select.value]; });
    form.append(element("label", field, { for: field }), select, small);
  }
  const seed = element("input", undefined, { id: "seed", type: "number", min: 0, value: chosen.seed });
  seed.addEventListener("change", () => { chosen.seed = Math.max(0, Math.floor(Number(seed.value) || 0)); });
  const device = element("select", undefined, { id: "device" });
  for (const name of ["keyboard", "gamepad", "wheel"]) device.append(element("option", name));
  device.value = chosen.device;
  const about = element("small", welcome.native ? `wheel: ${welcome.native}, read by the server` : "");
  device.addEventListener("change", () => { chosen.device = device.value; });
  form.append(element("label", "seed", { for: "seed" }), seed, element("small", "the same seed gives the same episode"), element("label", "device", { for: "device" }), device, about);
  card.append(form, row(["Drive", "Calibrate", "Recordings"], (name) => ({ Drive: start, Calibrate: () => calibration(), Recordings: () => send({ type: "recordings" }) })[name]()));
}

async function start() {
  input.choose(chosen.device, nativeFor(chosen.device));
  if (chosen.device !== "keyboard" && !input.calibration && !(await calibration())) return;
  send({ type: "start", ...chosen, calibration: input.calibration });
}

async function calibration() {
  if (chosen.device === "keyboard") { show("notice", "The keyboard needs no calibration."); return false; }
  input.choose(chosen.device, nativeFor(chosen.device));
  const made = await calibrate(card, chosen.device, nativeFor(chosen.device), ask);
  if (made) input.keep(made);
  choose();
  return Boolean(made);
}

function recordings(names) {
  card.hidden = false;
  card.replaceChildren(element("h1", "Recordings"), element("p", names.length ? `In ${welcome.folder}. Choose one to see it again.` : `There are none in ${welcome.folder}.`));
  for (const name of names.slice(0, 50)) {
    const button = element("button", name);
    button.addEventListener("click", () => replay(name));
    card.append(button, " ");
  }
  card.append(row(["Back"], choose));
}

function replay(name) {
  chosen = { ...chosen };
  send({ type: "replay", name });
}

function replayed(message) {
  tell("Replay", message.same ? `${message.name} went as recorded, to the bit.` : `${message.name} went differently than recorded: it was made with other versions. Now: ${message.versions}.`, {
    Again: () => replay(message.name), Choose: () => send({ type: "leave" }),
  });
}

// How the drive went, beside the predictive driver.
function result(message) {
  hint.hidden = true;
  card.hidden = false;
  const kept = message.rows.find((one) => one.name === "controlled").mine === 1;
  card.replaceChildren(element("h1", kept ? "You kept control" : "Control was lost"), element("p", message.what, { class: "faint" }));
  if (!message.valid) card.append(element("p", `No valid trial: ${message.pauses.join("; ")}.`, { class: "bad" }));
  const table = element("table"), head = element("tr");
  for (const name of ["", "unit", "you", message.beside.replace("_", " ")]) head.append(element("th", name));
  table.append(head);
  for (const one of message.rows) {
    const line = element("tr", undefined, { title: one.definition });
    line.append(element("td", one.name), element("td", one.unit, { class: "faint" }));
    const better = one.mine === one.model ? 0 : one.better === "neither" ? 0 : (one.mine < one.model) === (one.better === "lower") ? 1 : -1;
    line.append(element("td", shown(one, one.mine), better > 0 ? { class: "good" } : {}), element("td", shown(one, one.model)));
    table.append(line);
  }
  card.append(table, plot(message));
  const age = message.latency.input_age;
  card.append(element("p", `Recorded as ${message.recording}. ${age ? `Input age: median ${(1e3 * age.median).toFixed(0)} ms, 95 % below ${(1e3 * age.p95).toFixed(0)} ms.` : ""}${message.latency.flagged ? " Flagged: more than 40 ms." : ""}`, { class: "faint" }));
  card.append(row(["Once more", "Next seed", "Replay", "Choose"], (name) => ({
    "Once more": () => send({ type: "restart" }),
    "Next seed": () => { chosen.seed += 1; send({ type: "next" }); },
    Replay: () => replay(message.recording),
    Choose: () => send({ type: "leave" }),
  })[name]()));
}

const shown = (one, value) => (one.name === "controlled" ? (value === 1 ? "yes" : "no") : number(value));
const number = (value) => (value === null ? "\u2013" : Math.abs(value) >= 100 ? value.toFixed(0) : value.toPrecision(3));

// Lateral position over the way, and the target.
function plot(message) {
  const svg = document.createElementNS("http://www.w3.org/2000/svg", "svg"), s = message.path.map((p) => p[0]), d = message.path.map((p) => p[1]);
  const low = Math.min(...d, ...message.target) - 0.5, high = Math.max(...d, ...message.target) + 0.5, span = s.at(-1) - s[0] || 1;
  const points = (values) => values.map((value, i) => `${(600 * (s[i] - s[0])) / span},${100 - (100 * (value - low)) / (high - low)}`).join(" ");
  svg.setAttribute("viewBox", "-2 -2 604 118");
  svg.setAttribute("class", "plot");
  svg.setAttribute("role", "img");
  for (const [values, colour, dash] of [[message.target, "var(--mark)", "5 4"], [d, "var(--ink)", ""]]) {
    const line = document.createElementNS("http://www.w3.org/2000/svg", "polyline");
    for (const [name, value] of Object.entries({ points: points(values), fill: "none", stroke: colour, "stroke-width": 2, "stroke-dasharray": dash })) line.setAttribute(name, value);
    svg.append(line);
  }
  const label = document.createElementNS("http://www.w3.org/2000/svg", "text");
  label.textContent = `lateral position over ${span.toFixed(0)} m: you (solid), wanted (dashed), ${low.toFixed(1)} to ${high.toFixed(1)} m`;
  for (const [name, value] of Object.entries({ x: 0, y: 113, fill: "var(--faint)", "font-size": 11 })) label.setAttribute(name, value);
  svg.append(label);
  return svg;
}

const begin = () => { if (state === "ready") send({ type: "begin" }); if (state === "paused") send({ type: "resume" }); };
const pause = () => { if (state === "driving") send({ type: "pause" }); else begin(); };
const view = () => { world.top = !world.top; show("view", world.top ? "Cockpit" : "Top view"); };
get("pause").addEventListener("click", (event) => { pause(); event.target.blur(); });
get("restart").addEventListener("click", (event) => { send({ type: "restart" }); event.target.blur(); });
get("leave").addEventListener("click", () => send({ type: "leave" }));
get("view").addEventListener("click", (event) => { view(); event.target.blur(); });
addEventListener("keydown", (event) => {
  if (!card.hidden || event.repeat || event.ctrlKey || event.metaKey) return;
  if (event.key === " ") { event.preventDefault(); begin(); }
  if (event.key === "p") pause();
  if (event.key === "v") view();
  if (event.key === "r" && welcome.kind === "free" && ["ready", "driving", "paused"].includes(state)) send({ type: "restart" });
});
document.addEventListener("visibilitychange", () => { if (document.hidden && state === "driving") send({ type: "pause", reason: "hidden" }); });

setInterval(() => {
  if (!["ready", "driving", "paused"].includes(state) || welcome.role !== "driver" || document.hidden) return;
  const readings = input.readings(), now = performance.now(), device = input.device;
  if (readings) send({ type: "input", seq: seq++, stamp: now / 1000, echo, held: echo < 0 ? 0 : (now - echoed) / 1000, readings, device });
}, RATE);

connect();
