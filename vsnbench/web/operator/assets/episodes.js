// The session's episodes, newest first. A judgement can be undone for some seconds, then corrected with a reason.

import { NO_ANSWER, get, post } from "./connection.js";
import { draftKeyOf, element, frameStrip, judgingForm } from "./judging.js";
import { hideUndoBar, showUndoBar } from "./undo_bar.js";
import { keepFocus } from "./focus.js";

let open = 0; // number of the episode with an open form
let openSeen = 0;
let isSending = false;
let undoing = 0;
let isDrawn = false;
let isRefreshing = false;
let refreshAgain = false;
let asked = 0;
let awaiting = 0;
let toOpen = 0;
let you = "";
let showMessage = () => {};

const revisionOf = (state) => JSON.stringify([state?.question, state?.driving, state?.revision]);

// Whether a form in the list is open.
export const isFormOpen = () => open > 0;

const unjudged = (episodes) => episodes.filter((episode) => episode.outcome === "unjudged" && episode.episode !== asked).length;

// For the question whether to end the session. Counted anew, because the list may be behind.
export async function awaitingText() {
  try {
    awaiting = unjudged((await get("/episodes")).episodes);
  } catch {
    // the last number stays
  }
  return awaiting ? ` ${awaiting} ${awaiting === 1 ? "episode awaits" : "episodes await"} a judgement.` : "";
}

export function showEpisodes(holder, state, before, showMessageOnPage) {
  asked = state.case?.episode ?? 0;
  you = state.you;
  showMessage = showMessageOnPage;
  if (state.ended_by) return hideUndoBar();
  if (!state.you || (revisionOf(state) === revisionOf(before) && isDrawn)) return;
  refresh(holder);
}

async function refresh(holder) {
  if (isRefreshing) {
    refreshAgain = true;
    return;
  }
  isRefreshing = true;
  try {
    const { episodes } = await get("/episodes");
    // The answer in progress triggers its own refresh; the list must not change under the operator's hands before that.
    if (isSending || undoing) return;
    const overtaken = episodes.find((episode) => episode.episode === open && episode.seen !== openSeen);
    if (overtaken) close(open); // its form can no longer be sent
    showUndoBar(episodes, you, (episode) => undo(episode, holder));
    showAwaiting(holder.closest("details"), unjudged(episodes));
    keepFocus(holder, () => draw(episodes, holder));
    isDrawn = true;
    if (overtaken && overtaken.author !== you) showMessage(`#${overtaken.episode}: ${overtaken.author || "another operator"} judged it meanwhile. Your answer was not sent.`);
    openWanted(episodes, holder);
  } catch {
    // the next state tries again
  } finally {
    isRefreshing = false;
    if (refreshAgain) {
      refreshAgain = false;
      refresh(holder);
    }
  }
}

// Draws the episodes that have changed. An open form is never replaced.
function draw(episodes, holder) {
  const cards = new Map([...holder.querySelectorAll(":scope > .episode")].map((card) => [Number(card.dataset.episode), card]));
  const wanted = episodes.map((episode) => {
    const key = JSON.stringify([{ ...episode, undo_s: episode.undo_s > 0 }, episode.episode === asked]);
    const card = cards.get(episode.episode);
    if (card && (episode.episode === open || card.dataset.key === key)) return card;
    const made = episodeCard(episode, holder);
    made.dataset.key = key;
    card?.replaceWith(made);
    return made;
  });
  for (const child of [...holder.children]) if (!wanted.includes(child)) child.remove();
  wanted.forEach((card, i) => { if (holder.children[i] !== card) holder.insertBefore(card, holder.children[i] ?? null); });
  if (!wanted.length) holder.append(element("p", { class: "dim" }, "No episodes yet."));
}

// Removes the form of an episode at once, so that a second key press cannot send it again.
function close(episode) {
  open = 0;
  const card = document.querySelector(`#episodes [data-episode="${episode}"]`);
  if (!card) return;
  card.dataset.key = "";
  card.querySelectorAll("[data-judging]").forEach((part) => part.remove());
}

// Shows how many episodes await a judgement, and opens the list when there are more.
function showAwaiting(card, count) {
  card.querySelector("summary").textContent = count ? `Episodes (${count} to judge)` : "Episodes";
  if (count > awaiting) card.open = true;
  awaiting = count;
}

function episodeCard(episode, holder) {
  const card = element("div", { class: "episode", "data-episode": episode.episode });
  const author = episode.author ? ` · ${episode.author}` : "";
  const color = { success: "good", failure: "bad" }[episode.outcome] ?? "dim";
  card.append(
    element("p", {}, element("strong", {}, `#${episode.episode} ${episode.goal} from mark ${episode.start}`), ` · ${episode.driven_by}`),
    element("p", { class: color }, `${episode.outcome}${author}`),
    element("p", { class: "dim small" }, episode.verdict),
  );
  const buttons = element("div", { class: "row" });
  if (episode.undo_s > 0) buttons.append(undoButton(episode, holder));
  if (episode.episode === asked) buttons.append(element("p", { class: "dim small" }, "judged above"));
  else if (episode.can_be_judged) {
    buttons.append(element("button", { type: "button", class: "button", "data-amend": true, onclick: () => openForm(card, episode, holder) }, episode.outcome === "unjudged" ? "Judge" : "Correct"));
  }
  card.append(buttons);
  return card;
}

function undoButton(episode, holder) {
  const button = element("button", { type: "button", class: "button", "data-undo": true, onclick: () => undo(episode, holder) }, "Undo");
  const until = performance.now() + episode.undo_s * 1000; // relative, because the clocks of phone and computer may differ
  const countDown = () => {
    const left = Math.ceil((until - performance.now()) / 1000);
    if (left <= 0) return button.remove();
    button.textContent = `Undo (${left} s)`;
    setTimeout(countDown, 250);
  };
  countDown();
  return button;
}

// Retracts a judgement, and opens the form with the earlier choices.
async function undo(episode, holder) {
  showMessage("");
  undoing = episode.episode;
  try {
    await post("/undo", { episode: episode.episode, seen: episode.seen });
    toOpen = episode.episode;
  } catch (error) {
    showMessage(error.answer ? error.message : NO_ANSWER);
  } finally {
    undoing = 0;
  }
  refresh(holder);
}

function openWanted(episodes, holder) {
  const episode = episodes.find((each) => each.episode === toOpen);
  const card = holder.querySelector(`[data-episode="${toOpen}"]`);
  if (!episode || !card || open || episode.outcome !== "unjudged" || episode.episode === asked) return;
  toOpen = 0;
  holder.closest("details").open = true;
  openForm(card, episode, holder).focus({ preventScroll: true }); // the form, so that a second Enter presses no button
  card.scrollIntoView({ block: "start" });
}

function openForm(card, episode, holder) {
  [open, openSeen] = [episode.episode, episode.seen];
  card.querySelector(":scope > .row").hidden = true;
  const isUnjudged = episode.outcome === "unjudged";
  const cancel = () => {
    close(episode.episode);
    refresh(holder);
  };
  const form = judgingForm(episode.case, {
    draftKey: isUnjudged ? draftKeyOf(episode.episode) : `amend-${episode.episode}-${episode.seen}`,
    isCorrection: !isUnjudged,
    showGoal: true,
    send: async (answer) => {
      isSending = true;
      try {
        await post("/amend", { episode: episode.episode, seen: episode.seen, ...answer });
        close(episode.episode);
      } finally {
        isSending = false;
        refresh(holder);
      }
    },
    postpone: null,
  });
  const parts = element("div", { "data-judging": true },
    frameStrip(episode.episode, episode.case.actions),
    form,
    element("button", { type: "button", class: "button", onclick: cancel }, isUnjudged ? "Judge later" : "Cancel"));
  card.append(parts);
  return form;
}

export async function showSummary(holder, state, before) {
  if (holder.childElementCount && revisionOf(state) === revisionOf(before)) return;
  try {
    const { rows } = await get("/summary");
    holder.replaceChildren(element("table", { class: "numbers" }, ...rows.map(([name, value]) => element("tr", {}, element("td", {}, name), element("td", {}, value)))));
  } catch {
    // the next state tries again
  }
}
