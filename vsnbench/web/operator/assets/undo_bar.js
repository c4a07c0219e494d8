// The bar at the bottom that confirms the latest judgement and can undo it for some seconds.

const at = (id) => document.getElementById(id);
const TICK_MS = 250;
let current = null;

// Shows the latest judgement that can still be undone; `undo(episode)` undoes it.
export function showUndoBar(episodes, you, undo) {
  const undoable = episodes.filter((episode) => episode.undo_s > 0);
  const [latest] = undoable.sort((first, second) => second.undo_s - first.undo_s);
  if (!latest) return hideUndoBar();
  const until = performance.now() + latest.undo_s * 1000; // relative, because the clocks of phone and computer may differ
  const isCounting = current !== null;
  current = { episode: latest, until, undo };
  const outcome = latest.outcome === "void" ? "void, the trial runs again" : latest.outcome;
  const text = `Saved: #${latest.episode} ${outcome}${latest.author === you ? "" : ` (${latest.author})`}`;
  if (at("undo-text").textContent !== text) at("undo-text").textContent = text;
  at("undo-bar").hidden = false;
  if (!isCounting) countDown();
}

export function hideUndoBar() {
  current = null;
  at("undo-bar").hidden = true;
}

function countDown() {
  if (!current) return;
  const left = Math.ceil((current.until - performance.now()) / 1000);
  if (left <= 0) return hideUndoBar();
  at("undo-button").textContent = `Undo (${left} s)`;
  setTimeout(countDown, TICK_MS);
}

at("undo-button").addEventListener("click", () => {
  const { episode, undo } = current ?? {};
  hideUndoBar();
  if (episode) undo(episode);
});
