// Where the robot stands, measured: arrows to mend it, and what it should see laid over what it does.

import { post } from "./link.js";
import { element } from "./judging.js";

let shown = "";

export function showPlacing(holder, pictureHolder, state, doing) {
  const { placing, question } = state;
  const asked = question?.asks === "place" && placing.can_measure;
  const key = JSON.stringify([asked, question?.number, placing]);
  if (key === shown) return;
  const slider = pictureHolder.querySelector("input[type=range]")?.value ?? 50;
  shown = key;
  pictureHolder.replaceChildren(...(asked && !placing.looking && placing.picture ? [overlay(placing, slider)] : []));
  if (!asked) return holder.replaceChildren();
  const wish = (what) => () => doing(() => post("/wish", { question: question.number, what }));
  const parts = [];
  if (placing.looking) {
    parts.push(element("p", { class: "words", role: "status" }, placing.looking === "turn" ? "It turns once around. Stand back." : "It looks where it stands …"));
  } else if (!placing.seen) {
    parts.push(element("button", { class: "button go", id: "check", onclick: wish("moved") }, "It stands there: check"));
  } else {
    parts.push(...seen(placing));
    const look = placing.green || placing.wants_turn ? "button" : "button go";
    const turn = placing.wants_turn ? "button go" : "button";
    parts.push(element("div", { class: "row spaced" },
      element("button", { class: look, id: "moved", onclick: wish("moved") }, "Moved it: check"),
      element("button", { class: turn, id: "turn", onclick: wish("turn") }, "Turn and check")));
  }
  holder.replaceChildren(element("div", { class: "card" }, ...parts));
}

function seen(placing) {
  const parts = [];
  if (placing.problem) parts.push(element("p", { class: "words" }, `Not measured: ${placing.problem}`));
  if (placing.headline) {
    const color = placing.green ? "good" : placing.wants_turn ? "unsure" : "bad";
    parts.push(element("p", { class: `verdict ${color}`, id: "placement" }, placing.headline));
  }
  if (placing.arrows.length) {
    parts.push(element("ul", { class: "arrows" }, ...placing.arrows.map(([direction, words]) => element("li", {}, element("b", {}, ARROW[direction] ?? "•"), ` ${words}`))));
  } else if (placing.wants_turn && placing.seen_near) parts.push(element("p", {}, "One look from here is not enough. Let it turn once around: it needs room to turn, and you stand back."));
  else if (placing.advice) parts.push(element("p", {}, placing.advice));
  if (placing.differs) parts.push(element("p", { class: "words" }, placing.differs));
  return parts;
}

// Below all buttons: pictures take their time to load, and nothing is to move from under a thumb.
function overlay(placing, slider) {
  const layer = (what) => element("img", { class: "layer", src: `/placing/${what}?look=${placing.key}`, alt: "", id: `layer-${what}` });
  const ghost = layer("ghost");
  const photo = placing.photo ? layer("photo") : null;
  const set = () => {
    ghost.style.opacity = photo && pick.checked ? 0 : range.value / 100;
    if (photo) photo.style.opacity = pick.checked ? range.value / 100 : 0;
    name.textContent = photo && pick.checked ? "What it saw here when it was first accepted" : "What it should see";
  };
  const name = element("span", {});
  const range = element("input", { type: "range", min: 0, max: 100, value: slider, "aria-label": "how much of it is laid over", oninput: () => set() });
  const pick = element("input", { type: "checkbox", onchange: () => set() });
  const pictures = element("div", { class: "overlay" }, element("img", { src: `/placing/seen?look=${placing.key}`, alt: "what the robot sees" }), ghost, photo);
  const card = element("div", { class: "card" }, pictures, element("label", {}, name, range));
  if (photo) card.append(element("label", { class: "check" }, pick, " lay over the photo kept of this mark instead"));
  set();
  return card;
}

const ARROW = { forward: "↑", backward: "↓", left: "←", right: "→", "turn left": "↶", "turn right": "↷" };
