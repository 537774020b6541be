// The steps of a study beside the drives: consent, device, questionnaires, and what comes next.

import { element, row } from "./input.js";

export function step(card, message, send, input, calibrate, nativeFor) {
  card.hidden = false;
  card.replaceChildren(element("h1", message.title));
  for (const paragraph of (message.text || "").split("\n\n")) card.append(element("p", paragraph));
  const steps = {
    consent: () => card.append(row(["I agree", "I do not take part"], (name) => send({ type: "consent", agreed: name === "I agree" }))),
    device: () => card.append(row(message.devices, (name) => device(name, send, input, calibrate, nativeFor))),
    next: () => card.append(row([message.button], () => send({ type: "begin" }))),
    questionnaire: () => questionnaire(card, message, send),
    end: () => {},
  };
  steps[message.step]();
}

async function device(name, send, input, calibrate, nativeFor) {
  input.choose(name, nativeFor(name));
  if (name !== "keyboard" && !input.calibration) {
    const made = await calibrate(name);
    if (!made) { send({ type: "begin" }); return; }
    input.keep(made);
  }
  send({ type: "device", device: name, calibration: input.calibration });
}

// One slider or row of choices an item; nothing is answered before it is touched.
function questionnaire(card, message, send) {
  const values = {};
  const done = row(["Done"], () => send({ type: "answers", values }));
  const button = done.querySelector("button");
  const check = () => { button.disabled = message.items.some((item) => !(item.name in values)); };
  for (const item of message.items) {
    const line = element("div", undefined, { class: "scale" });
    line.append(element("span", item.question, { class: "question" }), element("span", item.low));
    if (item.steps <= 7) {
      const choices = element("div", undefined, { class: "choices" });
      for (let i = 0; i < item.steps; i++) {
        const radio = element("input", undefined, { type: "radio", name: item.name, "aria-label": `${item.low} to ${item.high}, ${i + 1} of ${item.steps}` });
        radio.addEventListener("change", () => { values[item.name] = item.least + i * item.step; check(); });
        choices.append(radio);
      }
      line.append(choices);
    } else {
      const slider = element("input", undefined, { type: "range", min: item.least, max: item.least + (item.steps - 1) * item.step, step: item.step, class: "unset", "aria-label": item.question });
      const touched = () => { values[item.name] = Number(slider.value); slider.classList.remove("unset"); check(); };
      slider.addEventListener("input", touched);
      slider.addEventListener("pointerdown", touched);
      line.append(slider);
    }
    line.append(element("span", item.high));
    card.append(line);
  }
  check();
  card.append(done);
}
