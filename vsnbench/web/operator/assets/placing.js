// Placing the robot: checks of its position, arrows for corrections, and the expected image over the camera image.

import { post } from "./connection.js";
import { element } from "./judging.js";
import { keepFocus } from "./focus.js";

const ARROWS = { forward: "↑", backward: "↓", left: "←", right: "→", "turn left": "↶", "turn right": "↷" };
let drawnKey = "";

export function showPlacing(holder, imageHolder, state, run) {
  const { placing, question } = state;
  const isAsked = question?.kind === "place" && placing.can_measure;
  const key = JSON.stringify([isAsked, question?.number, placing]);
  if (key === drawnKey) return;
  const slider = imageHolder.querySelector("input[type=range]")?.value ?? 50;
  drawnKey = key;
  imageHolder.replaceChildren(...(isAsked && !placing.in_progress && placing.has_image ? [overlay(placing, slider)] : []));
  if (!isAsked) return holder.replaceChildren();
  const request = (action) => () => run(() => post("/placing", { question: question.number, action }));
  const parts = [];
  if (placing.in_progress) {
    parts.push(element("p", { class: "notice", role: "status" }, placing.in_progress === "turn" ? "The robot turns once around. Stand back." : "Checking the position …"));
  } else if (!placing.is_measured) {
    parts.push(element("button", { class: "button go", id: "check", onclick: request("moved") }, "Robot is in place. Check position"));
  } else {
    parts.push(...measurement(placing));
    const check = placing.within_tolerance || placing.needs_turn ? "button" : "button go";
    const turn = placing.needs_turn ? "button go" : "button";
    parts.push(element("div", { class: "row spaced" },
      element("button", { class: check, id: "moved", onclick: request("moved") }, "Check again"),
      element("button", { class: turn, id: "turn", onclick: request("turn") }, "Turn and check")));
  }
  keepFocus(holder, () => holder.replaceChildren(element("div", { class: "card" }, ...parts)));
}

function measurement(placing) {
  const parts = [];
  if (placing.problem) parts.push(element("p", { class: "notice" }, `Not measured: ${placing.problem}`));
  if (placing.headline) {
    const color = placing.within_tolerance ? "good" : placing.needs_turn ? "unsure" : "bad";
    parts.push(element("p", { class: `verdict ${color}`, id: "placement" }, placing.headline));
  }
  if (placing.arrows.length) {
    parts.push(element("ul", { class: "arrows" }, ...placing.arrows.map(([direction, text]) => element("li", {}, element("b", {}, ARROWS[direction] ?? "•"), ` ${text}`))));
  } else if (placing.needs_turn && placing.matches_site) {
    parts.push(element("p", {}, "One image from here is not enough. Stand back, and let the robot turn once around."));
  } else if (placing.advice) parts.push(element("p", {}, placing.advice));
  if (placing.differs) parts.push(element("p", { class: "notice" }, placing.differs));
  return parts;
}

// Comes below all buttons: images load late, and a button must not move under a thumb.
function overlay(placing, slider) {
  const image = (name, attributes) => element("img", { src: `/placing/${name}?look=${placing.key}`, ...attributes });
  const expected = image("expected", { class: "layer", alt: "", id: "layer-expected" });
  const photo = placing.has_photo ? image("photo", { class: "layer", alt: "", id: "layer-photo" }) : null;
  const update = () => {
    expected.style.opacity = photo && usePhoto.checked ? 0 : range.value / 100;
    if (photo) photo.style.opacity = usePhoto.checked ? range.value / 100 : 0;
    name.textContent = photo && usePhoto.checked ? "Photo from the first accepted placement" : "Expected image";
  };
  const name = element("span", {});
  const range = element("input", { type: "range", min: 0, max: 100, value: slider, "aria-label": "opacity of the overlay", oninput: () => update() });
  const usePhoto = element("input", { type: "checkbox", onchange: () => update() });
  const images = element("div", { class: "overlay" }, image("camera", { alt: "camera image" }), expected, photo);
  const card = element("div", { class: "card" }, images, element("label", {}, name, range));
  if (photo) card.append(element("label", { class: "check" }, usePhoto, " Show the stored photo of this mark instead"));
  update();
  return card;
}
