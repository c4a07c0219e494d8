// The form in which an operator judges an episode. Its draft survives a reload, a redraw and an undo.

import { NO_ANSWER } from "./connection.js";

const TAGS = ["glare", "person in view", "cable", "door moved", "slipped", "low battery"];
const LAST_FRAMES = 6;
const EARLIER_FRAMES = 6;

export function element(name, attributes = {}, ...children) {
  const made = document.createElement(name);
  for (const [key, value] of Object.entries(attributes)) {
    if (key.startsWith("on")) made.addEventListener(key.slice(2), value);
    else if (value === true) made.setAttribute(key, "");
    else if (value !== false && value != null) made.setAttribute(key, value);
  }
  made.append(...children.filter((child) => child != null));
  return made;
}

// Shows a button as pressed, also to a screen reader.
function setPressed(button, isPressed) {
  button.classList.toggle("on", isPressed);
  button.setAttribute("aria-pressed", isPressed);
}

// Numbers of the frames to show: the last ones, and some evenly spaced earlier ones.
export function frameNumbers(actions) {
  const earlier = Math.max(0, actions - LAST_FRAMES);
  const count = Math.min(EARLIER_FRAMES, earlier);
  const spaced = Array.from({ length: count }, (_, i) => 1 + Math.floor((i * earlier) / count));
  return [...spaced, ...Array.from({ length: actions - earlier }, (_, i) => earlier + 1 + i)];
}

// Frames of the robot's camera. The strip starts at the last ones, which show whether the robot reached the goal.
export function frameStrip(episode, actions) {
  const frames = frameNumbers(actions).map((number) => element("img", { src: `/episodes/${episode}/frames/${number}`, alt: `before action ${number}` }));
  const strip = element("div", { class: "strip", role: "group", "aria-label": "camera images", tabindex: 0 }, ...frames);
  let hasScrolled = false; // the operator, who may look at an earlier frame
  for (const kind of ["pointerdown", "wheel", "keydown"]) strip.addEventListener(kind, () => { hasScrolled = true; }, { passive: true });
  // Each frame that loads changes the strip's width.
  const scrollToEnd = () => { if (!hasScrolled) strip.scrollLeft = strip.scrollWidth; };
  new ResizeObserver(scrollToEnd).observe(strip);
  for (const frame of frames) frame.addEventListener("load", scrollToEnd);
  return strip;
}

// Storage key of the draft for an episode that awaits a judgement.
export const draftKeyOf = (episode) => `draft-${episode}`;

// options: {draftKey, isCorrection: a note is required, isSecond: a rater judges from the images, showGoal, send(form), postpone() or null}
export function judgingForm(theCase, options) {
  const draft = { touched: "", what: "", distance: "", note: "", tags: [], void: "", ...readDraft(options.draftKey) };
  const form = element("form", { action: "#", class: "judging-form", tabindex: -1, "aria-label": `judge episode ${theCase.episode}` });
  const message = element("p", { class: "notice", role: "alert", hidden: true });
  const saveDraft = () => sessionStorage.setItem(options.draftKey, JSON.stringify(draft));
  const showMessage = (text) => {
    message.textContent = text;
    message.hidden = !text;
    if (text) message.scrollIntoView({ block: "nearest" });
  };

  const field = (name, label, attributes = {}) => {
    const input = element("input", {
      class: "field", id: `${options.draftKey}-${name}`, "data-name": name, value: draft[name], autocomplete: "off", ...attributes,
      oninput: () => { draft[name] = input.value; saveDraft(); },
    });
    return [element("label", { for: input.id }, label), input];
  };

  const isCollision = theCase.ended_with === "collision";
  const isStop = theCase.ended_with === "stop";
  const parts = options.showGoal ? [element("p", { class: "verdict" }, `Goal: ${theCase.goal}, from mark ${theCase.start}`)] : [];
  const what = element("div", {}, ...field("what", "What did it touch?", { placeholder: "leg of the table" }));
  const tape = element("div", {});
  const choose = (touched) => {
    draft.touched = touched;
    saveDraft();
    setPressed(no, touched === "no");
    setPressed(yes, touched === "yes");
    what.hidden = touched !== "yes" || isCollision;
    tape.hidden = touched !== "no" || !isStop;
  };
  const no = element("button", { type: "button", class: "button", "data-touched": "no", onclick: () => choose("no") }, "No");
  const yes = element("button", { type: "button", class: "button", "data-touched": "yes", onclick: () => choose("yes") }, "Yes");
  const question = isCollision ? "The robot reported a collision. Did it collide?" : "Did the robot touch anything?";
  parts.push(element("label", {}, question), element("div", { class: "row" }, no, yes), what);
  if (isStop) {
    const sight = theCase.in_sight === false ? ", not in line of sight" : "";
    const [source, kept] = theCase.odometry ? ["Measured from images", "it"] : ["Estimate", "the estimate"];
    const estimate = theCase.estimate_m == null ? "" : `${source}: ${theCase.estimate || `${theCase.estimate_m} m`}${sight}. `;
    const advice = options.isSecond ? "Judge it from the images." : `${estimate}Leave empty to use ${kept}.`;
    tape.append(
      ...field("distance", `${options.isSecond ? "Distance" : "Measured distance"} to the ${theCase.measured_to}, in line of sight, m`, { placeholder: "0.84", inputmode: "decimal" }),
      element("p", { class: "dim small" }, `${advice} Success: under ${theCase.success_m} m.`),
    );
    if (theCase.odometry) {
      // The other pose of the robot, in place of the one measured from images.
      const input = tape.querySelector("input");
      const useOdometry = () => { input.value = draft.distance = "odometry"; saveDraft(); };
      tape.append(element("button", { type: "button", class: "button", "data-odometry": true, onclick: useOdometry }, `Odometry is right: ${theCase.odometry}`));
    }
    parts.push(tape);
  }
  const chips = TAGS.map((tag) => {
    const chip = element("button", { type: "button", class: "button", onclick: () => {
      draft.tags = draft.tags.includes(tag) ? draft.tags.filter((other) => other !== tag) : [...draft.tags, tag];
      setPressed(chip, draft.tags.includes(tag));
      saveDraft();
    } }, tag);
    setPressed(chip, draft.tags.includes(tag));
    return chip;
  });
  parts.push(...field("note", options.isCorrection ? "Reason for the correction" : "Note"), element("div", { class: "chips" }, ...chips), message);
  const confirm = element("button", { class: "button go" }, "Confirm");
  parts.push(confirm);
  const voidDetails = element("details", { open: !!draft.void }, element("summary", {}, "Declare void"),
    ...field("void", options.isSecond ? "Reason" : "Reason. The trial runs again.", { placeholder: "a visitor moved the chair" }),
    element("button", { type: "button", class: "button", "data-void": true, onclick: () => send({ void: draft.void || "" }, true) }, options.isSecond ? "Void" : "Void and run again"));
  parts.push(voidDetails);
  if (options.postpone) parts.push(element("button", { type: "button", class: "button", "data-later": true, onclick: () => options.postpone() }, "Judge later"));
  form.append(...parts);
  choose(draft.touched);

  async function send(answer, isVoid = false, isConfirmed = false) {
    if (isVoid && !answer.void.trim()) return showMessage("Enter the reason why the episode is void.");
    const note = [draft.note.trim(), ...draft.tags.map((tag) => `#${tag.replaceAll(" ", "-")}`)].filter(Boolean).join(" ");
    if (options.isCorrection && !draft.note.trim() && !isVoid) return showMessage("Enter the reason for the correction. The earlier verdict stays in the record.");
    confirm.disabled = true;
    try {
      await options.send({ ...answer, note: note || (isVoid ? answer.void : ""), confirmed: isConfirmed });
      // After an undo the form opens with these choices again.
      sessionStorage.removeItem(options.draftKey);
      sessionStorage.setItem(draftKeyOf(theCase.episode), JSON.stringify(draft));
    } catch (error) {
      if (error.answer?.needs_confirmation && (await askToConfirm(`${error.message}. Is that right?`))) return await send(answer, isVoid, true);
      showMessage(error.answer ? error.message : NO_ANSWER);
    } finally {
      confirm.disabled = false;
    }
  }

  form.addEventListener("submit", (event) => {
    event.preventDefault();
    showMessage("");
    if (!draft.touched) return showMessage(isCollision ? "Answer whether the robot collided." : "Answer whether the robot touched anything.");
    if (isCollision && draft.touched === "yes") return send({ felt: true });
    if (isCollision) {
      voidDetails.open = true;
      return showMessage("Without a collision the episode is void. Enter the reason below.");
    }
    if (draft.touched === "yes" && !draft.what.trim()) return showMessage("Enter what the robot touched.");
    const distance = isStop && draft.touched === "no" ? draft.distance : "";
    send({ touched: draft.touched === "no" ? "no" : draft.what, distance });
  });
  return form;
}

// Asks a question with yes and no, and resolves to whether the answer is yes.
export function askToConfirm(text) {
  const dialog = document.getElementById("dialog");
  document.getElementById("dialog-text").textContent = text;
  dialog.returnValue = "no";
  dialog.showModal();
  return new Promise((resolve) => dialog.addEventListener("close", () => resolve(dialog.returnValue === "yes"), { once: true }));
}

function readDraft(key) {
  try {
    return JSON.parse(sessionStorage.getItem(key)) ?? {};
  } catch {
    return {};
  }
}
