// What became of an episode, asked for in big buttons; what is half typed outlives a reload.

const TAGS = ["glare", "person in view", "cable", "door moved", "slipped", "low battery"];

function element(name, attributes = {}, ...children) {
  const made = document.createElement(name);
  for (const [key, value] of Object.entries(attributes)) {
    if (key.startsWith("on")) made.addEventListener(key.slice(2), value);
    else if (value === true) made.setAttribute(key, "");
    else if (value !== false && value != null) made.setAttribute(key, value);
  }
  made.append(...children.filter((child) => child != null));
  return made;
}

export { element };

// A button that is chosen, for the eye and for who hears the page.
function press(button, chosen) {
  button.classList.toggle("on", chosen);
  button.setAttribute("aria-pressed", chosen);
}

// What the robot saw: a dozen pictures from the first action to the last.
export function strip(episode, actions) {
  const count = Math.min(12, actions);
  const numbers = Array.from({ length: count }, (_, i) => 1 + Math.round((i * (actions - 1)) / Math.max(1, count - 1)));
  const pictures = numbers.map((number) => element("img", { src: `/episodes/${episode}/frames/${number}`, alt: `before action ${number}`, loading: "lazy" }));
  return element("div", { class: "strip", role: "group", "aria-label": "what it saw", tabindex: 0 }, ...pictures);
}

// options: {kept: key of the draft, reason: whether a note is needed, send(word), later() or null}
export function judgingForm(theCase, options) {
  const draft = { touched: "", what: "", distance: "", note: "", tags: [], void: "", ...read(options.kept) };
  const form = element("form", { action: "#", class: "judging-form" });
  const words = element("p", { class: "words", role: "alert", hidden: true });
  const keep = () => sessionStorage.setItem(options.kept, JSON.stringify(draft));
  const say = (text) => {
    words.textContent = text;
    words.hidden = !text;
    if (text) words.scrollIntoView({ block: "nearest" });
  };

  const field = (name, label, attributes = {}) => {
    const input = element("input", {
      class: "field", id: `${options.kept}-${name}`, "data-name": name, value: draft[name], autocomplete: "off", ...attributes,
      oninput: () => { draft[name] = input.value; keep(); },
    });
    return [element("label", { for: input.id }, label), input];
  };

  const felt = theCase.ended_with === "collision";
  const parts = [];
  const what = element("div", {}, ...field("what", "What did it touch?", { placeholder: "leg of the table" }));
  const tape = element("div", {});
  const choose = (touched) => {
    draft.touched = touched;
    keep();
    press(no, touched === "no");
    press(yes, touched === "yes");
    what.hidden = touched !== "yes" || felt;
    tape.hidden = touched !== "no" || theCase.ended_with !== "stop";
  };
  const no = element("button", { type: "button", class: "button", "data-touched": "no", onclick: () => choose("no") }, felt ? "No" : "No, nothing");
  const yes = element("button", { type: "button", class: "button", "data-touched": "yes", onclick: () => choose("yes") }, "Yes");
  parts.push(element("label", {}, felt ? "The robot felt a collision. Was there one?" : "Did it touch anything?"), element("div", { class: "row" }, no, yes), what);
  if (theCase.ended_with === "stop") {
    const sight = theCase.in_sight === false ? ", behind a wall" : "";
    const estimate = theCase.estimate_m == null ? "" : ` Estimate: ${theCase.estimate_m.toFixed(2)} m${sight}.`;
    tape.append(
      ...field("distance", "Metres by tape to the nearest one in sight", { placeholder: "0.84", inputmode: "decimal" }),
      element("p", { class: "dim small" }, `${estimate} Left empty, the estimate counts. Success is under ${theCase.success_m} m.`),
    );
    parts.push(tape);
  }
  const chips = TAGS.map((tag) => {
    const chip = element("button", { type: "button", class: "button", onclick: () => {
      draft.tags = draft.tags.includes(tag) ? draft.tags.filter((one) => one !== tag) : [...draft.tags, tag];
      press(chip, draft.tags.includes(tag));
      keep();
    } }, tag);
    press(chip, draft.tags.includes(tag));
    return chip;
  });
  parts.push(...field("note", options.reason ? "Why is it corrected?" : "Note"), element("div", { class: "chips" }, ...chips), words);
  const confirm = element("button", { class: "button go" }, "Confirm");
  parts.push(confirm);
  const aside = element("details", {}, element("summary", {}, "It is no result"),
    ...field("void", "Why? The trial is run again.", { placeholder: "somebody moved the chair" }),
    element("button", { type: "button", class: "button", "data-void": true, onclick: () => send({ void: draft.void || "" }, true) }, "Void and run again"));
  parts.push(aside);
  if (options.later) parts.push(element("button", { type: "button", class: "button", "data-later": true, onclick: () => options.later() }, "Judge it later"));
  form.append(...parts);
  choose(draft.touched);

  async function send(said, isVoid = false, sure = false) {
    if (isVoid && !said.void.trim()) return say("say why it is no result");
    const note = [draft.note.trim(), ...draft.tags.map((tag) => `#${tag.replaceAll(" ", "-")}`)].filter(Boolean).join(" ");
    if (options.reason && !draft.note.trim() && !isVoid) return say("say why it is corrected: what stood before stays in the record beside it");
    confirm.disabled = true;
    try {
      await options.send({ ...said, note: note || (isVoid ? said.void : ""), sure });
      sessionStorage.removeItem(options.kept);
    } catch (error) {
      if (error.answer?.unsure && (await sureOf(error.message))) return await send(said, isVoid, true);
      say(error.answer ? error.message : "no answer from the run: is the phone on its network? Nothing was lost, try again");
    } finally {
      confirm.disabled = false;
    }
  }

  form.addEventListener("submit", (event) => {
    event.preventDefault();
    say("");
    if (!draft.touched) return say(felt ? "say whether there was a collision" : "say whether it touched anything");
    if (felt && draft.touched === "yes") return send({ felt: true });
    if (felt) {
      aside.open = true;
      return say("then it is no result: say below why");
    }
    if (draft.touched === "yes" && !draft.what.trim()) return say("say what it touched");
    const distance = theCase.ended_with === "stop" && draft.touched === "no" ? draft.distance : "";
    send({ touched: draft.touched === "no" ? "no" : draft.what, distance });
  });
  return form;
}

export function sureOf(text) {
  const dialog = document.getElementById("ask");
  document.getElementById("ask-words").textContent = text;
  dialog.returnValue = "no";
  dialog.showModal();
  return new Promise((resolve) => dialog.addEventListener("close", () => resolve(dialog.returnValue === "yes"), { once: true }));
}

function read(key) {
  try {
    return JSON.parse(sessionStorage.getItem(key)) ?? {};
  } catch {
    return {};
  }
}
