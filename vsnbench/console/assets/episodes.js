// The session's episodes, newest first: undone for a few seconds, then corrected with a reason.

import { get, post } from "./link.js";
import { element, judgingForm, strip } from "./judging.js";
import { hideKept, showKept } from "./kept.js";

let open = 0;
let openSeen = 0;
let sending = false;
let last = "";
let busy = false;
let again = false;
let asked = 0;
let awaited = 0;
let toOpen = 0;
let you = "";
let say = () => {};

const questionOf = (state) => JSON.stringify([state?.question, state?.driving, state?.record]);

// Whether a form is open in the list: whoever works there is not taken elsewhere.
export const isFormOpen = () => open > 0;

// For whoever is about to leave.
export const awaitingWords = () => (awaited ? ` ${awaited} ${awaited === 1 ? "episode awaits its" : "episodes await their"} judgement still.` : "");

export function showEpisodes(holder, state, before, words) {
  asked = state.case?.episode ?? 0;
  you = state.you;
  say = words;
  if (state.ended_by) return hideKept();
  if (!state.you || (questionOf(state) === questionOf(before) && last)) return;
  refresh(holder);
}

async function refresh(holder) {
  if (busy) {
    again = true;
    return;
  }
  busy = true;
  try {
    const { episodes } = await get("/episodes");
    const text = JSON.stringify([episodes, asked]);
    const overtaken = episodes.find((one) => one.episode === open && one.seen !== openSeen && !sending);
    if (overtaken) open = 0; // a form that can no longer be sent would hide all that comes after it
    showKept(episodes, you, (one) => undone(one, holder));
    remind(holder.closest("details"), episodes.filter((one) => one.outcome === "unjudged" && one.episode !== asked).length);
    if (text !== last && !open) {
      last = text;
      holder.replaceChildren(...(episodes.length ? episodes.map((one) => line(one, holder)) : [element("p", { class: "dim" }, "none yet")]));
      if (overtaken) say(`#${overtaken.episode}: ${overtaken.author || "somebody"} judged it meanwhile. What was typed here was not sent.`);
    }
    openWanted(episodes, holder);
  } catch {
    // the next state asks again
  } finally {
    busy = false;
    if (again) {
      again = false;
      refresh(holder);
    }
  }
}

// What awaits a person's word is not left for whoever happens to look.
function remind(card, count) {
  card.querySelector("summary").textContent = count ? `Episodes so far: ${count} to be judged` : "Episodes so far";
  if (count > awaited) card.open = true;
  awaited = count;
}

function line(one, holder) {
  const card = element("div", { class: "episode", "data-episode": one.episode });
  const said = one.author ? ` · ${one.author}` : "";
  card.append(
    element("p", {}, element("strong", {}, `#${one.episode} ${one.goal} from ${one.start}`), ` · ${one.driven_by}`),
    element("p", { class: one.outcome === "success" ? "good" : one.outcome === "failure" ? "bad" : "dim" }, `${one.outcome}${said}`),
    element("p", { class: "dim small" }, one.words),
  );
  const buttons = element("div", { class: "row" });
  if (one.undo_s > 0) {
    const undo = element("button", { type: "button", class: "button", "data-undo": true, onclick: () => undone(one, holder) }, "Undo");
    buttons.append(undo);
    const until = performance.now() + one.undo_s * 1000; // seconds from the run: no phone's clock is asked
    const count = () => {
      const left = Math.ceil((until - performance.now()) / 1000);
      if (left <= 0) return undo.remove();
      undo.textContent = `Undo (${left} s)`;
      setTimeout(count, 250);
    };
    count();
  }
  if (one.episode === asked) buttons.append(element("p", { class: "dim small" }, "asked about above"));
  else if (one.can_be_judged) {
    buttons.append(element("button", { type: "button", class: "button", "data-amend": true, onclick: () => form(card, one, holder) }, one.outcome === "unjudged" ? "Judge" : "Correct"));
  }
  card.append(buttons);
  return card;
}

// Whoever took a judgement back means to give another: its form opens.
async function undone(one, holder) {
  say("");
  try {
    await post("/undo", { episode: one.episode, seen: one.seen });
    toOpen = one.episode;
  } catch (error) {
    say(error.answer ? error.message : "no answer from the run, try again");
  }
  last = "";
  refresh(holder);
}

function openWanted(episodes, holder) {
  const one = episodes.find((each) => each.episode === toOpen);
  const card = holder.querySelector(`[data-episode="${toOpen}"]`);
  if (!one || !card || open || one.outcome !== "unjudged" || one.episode === asked) return;
  toOpen = 0;
  holder.closest("details").open = true;
  form(card, one, holder);
  card.scrollIntoView({ block: "start" });
}

function form(card, one, holder) {
  [open, openSeen] = [one.episode, one.seen];
  card.querySelector(":scope > .row").hidden = true;
  const close = () => { open = 0; last = ""; refresh(holder); };
  const made = judgingForm(one.case, {
    kept: one.outcome === "unjudged" ? `said-of-${one.episode}` : `amend-${one.episode}-${one.seen}`,
    reason: one.outcome !== "unjudged",
    send: async (word) => {
      sending = true;
      try {
        await post("/amend", { episode: one.episode, seen: one.seen, ...word });
        close();
      } finally {
        sending = false;
      }
    },
    later: null,
  });
  card.append(strip(one.episode, one.case.actions), made, element("button", { type: "button", class: "button", onclick: close }, one.outcome === "unjudged" ? "Judge it later" : "Leave it as it is"));
}

export async function showSummary(holder, state, before) {
  if (holder.childElementCount && questionOf(state) === questionOf(before)) return;
  try {
    const { rows } = await get("/summary");
    holder.replaceChildren(element("table", { class: "numbers" }, ...rows.map(([name, value]) => element("tr", {}, element("td", {}, name), element("td", {}, value)))));
  } catch {
    // shown with the next state
  }
}
