// Keyboard, gamepad and wheel: raw readings, and the calibration of axes.

const KEYS = { ArrowLeft: 0, ArrowRight: 1, ArrowUp: 2, ArrowDown: 3, a: 0, d: 1, w: 2, s: 3 };
const STORE = "shared_control_env calibration ";

export class Input {
  constructor() {
    this.keys = [0, 0, 0, 0];
    this.device = "keyboard";
    this.calibration = null;
    addEventListener("keydown", (event) => this.key(event, 1));
    addEventListener("keyup", (event) => this.key(event, 0));
    addEventListener("blur", () => this.keys.fill(0));
  }

  key(event, value) {
    const name = event.key.length === 1 ? event.key.toLowerCase() : event.key;
    if (!(name in KEYS) || /^(INPUT|SELECT|TEXTAREA)$/.test(event.target.tagName)) return;
    this.keys[KEYS[name]] = value;
    event.preventDefault();
  }

  // Raw readings of the chosen device alone; null while it is not there. A wheel that the server reads is only shown.
  readings() {
    if (this.device === "keyboard") return [...this.keys];
    if (this.native) return [0];
    const pad = connected(this.calibration?.name);
    return pad ? axesOf(pad) : null;
  }

  choose(device, native) {
    this.device = device;
    this.native = native;
    this.calibration = null;
    const name = native || connected()?.id.slice(0, 150);
    if (device !== "keyboard" && name) {
      const kept = localStorage.getItem(STORE + device + name);
      if (kept) this.calibration = JSON.parse(kept);
    }
  }

  keep(calibration) {
    this.calibration = calibration;
    localStorage.setItem(STORE + calibration.device + calibration.name, JSON.stringify(calibration));
  }
}

// The gamepad or wheel of a name, or the first without one.
export const connected = (name) => [...navigator.getGamepads()].find((pad) => pad && pad.connected && (!name || pad.id.slice(0, 150) === name)) || null;

// Axes, then buttons as axes from 0 to 1: the pedals of some devices are buttons.
const axesOf = (pad) => [...pad.axes, ...pad.buttons.map((button) => button.value)].slice(0, 32).map((v) => Math.max(-1, Math.min(1, v)));

const STEPS = [
  ["left", "Turn the wheel, or push the stick, fully to the left and hold it there."],
  ["right", "Now fully to the right, and hold it there."],
  ["centre", "Let go, so that it stands straight."],
  ["throttle", "Press the accelerator fully and hold it."],
  ["released", "Release it."],
  ["brake", "Press the brake fully and hold it."],
  ["free", "Release it."],
];

// Asks for movements one after the other. Ends with a calibration, or null.
// The server finds the axes, and reads a wheel that hangs on its machine (native) itself.
export async function calibrate(card, device, native, ask) {
  const pad = native ? null : connected(), name = native || (pad && pad.id.slice(0, 150));
  if (!name) {
    await say(card, "No gamepad or wheel is found", "Connect it and press one of its buttons: browsers show it only then.", ["Back"]);
    return null;
  }
  let reply = null;
  for (const [step, text] of STEPS) {
    if ((await say(card, `Calibration of ${name}`, text, ["Next", "Cancel"])) === "Cancel") return null;
    const last = step === STEPS.at(-1)[0];
    reply = ask({ type: "sample", step, device, name, readings: native ? [] : axesOf(connected() || pad) }, last);
  }
  reply = await reply;
  if (reply.calibration) return reply.calibration;
  await say(card, "That did not work", reply.message, ["Back"]);
  return null;
}

function say(card, title, text, buttons) {
  return new Promise((resolve) => {
    card.replaceChildren();
    card.hidden = false;
    card.append(element("h1", title), element("p", text), row(buttons, resolve));
  });
}

export function element(tag, text, attributes = {}) {
  const made = document.createElement(tag);
  if (text !== undefined) made.textContent = text;
  for (const [name, value] of Object.entries(attributes)) made.setAttribute(name, value);
  return made;
}

export function row(names, chosen) {
  const buttons = element("div", undefined, { class: "buttons" });
  names.forEach((name, i) => {
    const button = element("button", name, i ? {} : { class: "first" });
    button.addEventListener("click", () => chosen(name));
    buttons.append(button);
    if (!i) setTimeout(() => button.focus({ preventScroll: true }), 0);
  });
  return buttons;
}
