// The rater's page: the next episode with the operator's judging form, and the rater's own answers.

import { NO_ANSWER, get, post } from "/operator/connection.js";
import { draftKeyOf, element, frameStrip, judgingForm } from "/operator/judging.js";

const at = (id) => document.getElementById(id);
const ENDINGS = {
  stop: "The model stopped.", collision: "The robot reported a collision.", step_limit: "The number of actions was used up.",
  time_limit: "The time was used up.", path_limit: "The length of the path was used up.",
};
let shown = "";

function showMessage(text) {
  at("message").textContent = text;
  at("message").hidden = !text;
}

async function refresh() {
  try {
    show(await get("/state"));
  } catch (error) {
    showMessage(error.answer ? error.message : NO_ANSWER);
  }
}

async function send(path, content) {
  showMessage("");
  try {
    await post(path, content);
  } catch (error) {
    showMessage(error.answer ? error.message : NO_ANSWER);
  }
  await refresh();
}

function show(state) {
  at("who").textContent = `${state.rater}: ${state.answers.length} of ${state.total} episodes answered`;
  at("judging").hidden = !state.episode;
  at("finished").hidden = !!state.episode;
  if (state.episode && state.episode.episode !== shown) showEpisode(state.episode);
  shown = state.episode?.episode ?? "";
  at("answers").replaceChildren(...state.answers.map(answerCard));
  if (!state.answers.length) at("answers").append(element("p", { class: "dim" }, "No answers yet."));
}

function showEpisode(episode) {
  const form = judgingForm(episode, {
    draftKey: draftKeyOf(episode.episode),
    isSecond: true,
    showGoal: true,
    send: async (answer) => {
      await post("/judge", { episode: episode.episode, ...answer });
      sessionStorage.removeItem(draftKeyOf(episode.episode));
      await refresh();
    },
    postpone: () => send("/skip", { episode: episode.episode }),
  });
  at("judging").replaceChildren(
    element("h2", {}, `Episode ${episode.number}`),
    element("p", { class: "dim" }, `${ENDINGS[episode.ended_with] ?? `It ended with ${episode.ended_with}.`} ${episode.actions} actions.`),
    frameStrip(episode.episode, episode.actions),
    form,
  );
}

function answerCard(answer) {
  return element("div", { class: "episode", "data-episode": answer.code },
    element("p", {}, element("strong", {}, `Episode ${answer.number}`), ` · ${answer.outcome}`),
    element("p", { class: "dim small" }, answer.text),
    element("button", { type: "button", class: "button", "data-retract": true, onclick: () => send("/retract", { episode: answer.code }) }, "Retract"));
}

refresh();
